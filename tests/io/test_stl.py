"""STL: every type of file that others write, and errors that name the line."""

import os
import struct

import numpy as np
import pytest
from helpers.model_bytes import box, exported
from helpers.refusals import assert_refused

from rasterizer.errors import ModelError
from rasterizer.io.files import LONG, opened_source
from rasterizer.io.loader import load

FACET = "facet normal 0 0 1\n outer loop\n  vertex 0 0 0\n  vertex 1 0 0\n  vertex 0 1 0\n endloop\nendfacet\n"


def binary_stl(n, promised=None, head=b""):
    rows = b"".join(struct.pack("<12fH", 0, 0, 1, 0, 0, k, 1, 0, k, 0, 1, k, 0) for k in range(n))
    return head.ljust(80, b" ") + struct.pack("<I", n if promised is None else promised) + rows


def load_stl(data, **options):
    return load(data, format="stl", **options)


def test_a_binary_file_may_begin_with_solid_or_have_a_wrong_number_of_faces():
    assert load_stl(binary_stl(3, head=b"solid exported")).n_face == 3
    assert load_stl(binary_stl(3, promised=7, head=b"solid exported\0")).n_face == 3
    wrong = [binary_stl(4, promised) for promised in (0, 2, 7, 2**32 - 1)]
    for data in (*wrong, binary_stl(4) + b"trailing"):
        facts = []
        assert load_stl(data, log=facts.append).n_face == 4
        assert any("another length than its header says; 4 faces" in fact for fact in facts), facts
    said = "binary STL of 4294967295 faces must have 214748364834 bytes, the file has 97"
    assert_refused(load_stl, [(binary_stl(0, 2**32 - 1) + bytes(13), said)], ModelError)  # costs no memory


def test_a_long_file_is_read_in_parts(tmp_path):
    corners = np.random.default_rng(1).integers(0, 40, (LONG // 50 + 1, 3, 3)) / np.float32(8)
    corners[::7] *= -1.0  # -0 is 0
    rows = np.zeros(len(corners), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    rows["corners"], rows["attribute"] = corners, np.arange(len(rows))
    path, data = tmp_path / "long.stl", b"COLOR=abcd".ljust(80) + np.uint32(len(rows)).tobytes() + rows.tobytes()
    path.write_bytes(data)
    (of_path,), (of_bytes,) = load(path).meshes, load_stl(data).meshes
    first = np.unique(corners.reshape(-1, 3) + 0.0, axis=0, return_index=True)[1]
    np.testing.assert_array_equal(of_path.vertices, corners.reshape(-1, 3)[np.sort(first)])
    np.testing.assert_array_equal(of_path.vertices[of_path.faces], corners)
    for key in ("vertices", "faces", "face_colors"):
        np.testing.assert_array_equal(getattr(of_path, key), getattr(of_bytes, key))
    with opened_source(path, "long.stl", in_parts=True) as whole:
        assert len(whole) == len(data) and whole[-50:] == data[-50:] and whole[:] == data
        os.truncate(path, 2_000_000)
        assert whole[:84] == data[:84]
        with pytest.raises(ModelError, match="it became shorter meanwhile"):
            whole[1_900_000:2_100_000]
    path.write_bytes(bytes(LONG))
    with pytest.raises(ModelError, match="no faces"):
        load(path)
    path.write_bytes(b" " * LONG)
    with pytest.raises(ModelError, match="the file is empty"):
        load(path)


def test_triangles_share_vertices_and_solids_stay_apart():
    (mesh,) = load_stl(exported(box(), "stl")).meshes
    assert mesh.n_vertex == 8
    one = exported(box(), "stl_ascii").decode()
    assert [mesh.n_face for mesh in load_stl((one.replace("solid", "solid a") + one).encode()).meshes] == [12, 12]


@pytest.mark.parametrize("convention", ["viscam", "magics"])
def test_stl_colors(convention):
    data, is_viscam = bytearray(exported(box(), "stl")), convention == "viscam"
    for face in range(12):
        red, green, blue = (31, 0, 10)[:: 1 if is_viscam else -1]
        bits = red << 10 | green << 5 | blue | (0x8000 if is_viscam else 0)
        data[84 + 50 * face + 48 : 84 + 50 * face + 50] = bits.to_bytes(2, "little")
    if not is_viscam:
        data[:10] = b"COLOR=\xff\x00\x00\xff"
        data[84 + 48 : 84 + 50] = b"\x00\x80"  # the first face has the colour of the part
    (mesh,) = load_stl(bytes(data)).meshes
    np.testing.assert_allclose(mesh.face_colors[1:, :3], [(1, 0, 0.084376)] * 11, atol=1e-6)
    assert is_viscam or mesh.face_colors[0, :3].tolist() == [1, 0, 0]
    assert mesh.material.diffuse == (1.0, 1.0, 1.0)


def test_ascii_in_any_spelling():
    windows, tabs = (lambda text: text.replace("\n", "\r\n")), (lambda text: text.replace(" ", "\t"))
    for spell in (str, str.upper, str.title, windows, tabs):
        text = spell("solid part one\n" + FACET * 2 + "endsolid part one\n")
        (mesh,) = load_stl(text.encode()).meshes
        assert mesh.n_face == 2, f"{text}: {mesh.n_face} != 2"
        assert mesh.name.lower().replace("\t", " ") == "part one", text


def test_ascii_as_careless_programs_write_it():
    one, other = f"solid a\n{FACET}", FACET.replace("0 0 0", "5 5 5")
    parted = one.replace("endloop", "end loop").replace("endfacet", "end facet")
    for text, names in (
        (one + "end solid a\nsolid b\n" + other + "end solid b\n", ["a", "b"]),
        (parted + "endsolid a\n", ["a"]),
        ("# made by hand\n\n # twice\n" + one + "endsolid\n", ["a"]),
        (one.replace("solid a", "solid my vertex 1 2 3") + "endsolid my vertex 1 2 3\n", ["my vertex 1 2 3"]),
        (one.replace("solid a", "solid endsolid") + "endsolid endsolid\n", ["endsolid"]),
        (one + f"solid b\n{other}endsolid b\n", ["a", "b"]),
    ):
        assert [mesh.name for mesh in load_stl(text.encode()).meshes] == names, text
    with pytest.warns(UserWarning, match="without 'endsolid' at its end"):
        assert load_stl((one + other).encode()).n_face == 2


def test_long_texts_are_read_as_short_ones(monkeypatch):
    """By compiled code, in blocks: any spelling, a name with a keyword, numbers of all digits, faults."""
    one = "solid part of it\n" + FACET * 3 + "endsolid part\n"
    texts = [
        one, one * 2, one.upper(), one.replace("\n", "\r\n"), one.replace(" ", "\t"), one.replace(" ", "   "),
        one.replace("part of it", "vertex"), one.replace("part of it", "vertex 1 2 3"),
        one.replace("0 1 0", "6.123233995736766e-17 +1.5E3 -.5"), one.replace("1 0 0", "nan 0 0"),
        one.replace("1 0 0", "1_0 0 0"), one.replace("1 0 0", "1 x 0"), one.replace("1 0 0\n", "1 0 0 "),
        one.replace("1 0 0", "1 0"), one.replace("1 0 0", "1 0 0 0"), one.replace("  vertex 0 1 0\n", ""),
        one.replace(" endloop\nendfacet\n", ""), "solid\nendsolid\n", "solid\n" + FACET,
    ]  # fmt: skip

    def outcome(text):
        try:
            return [(m.name, m.vertices.tolist(), m.faces.tolist()) for m in load_stl(text.encode()).meshes]
        except ModelError as error:
            return str(error)

    expected = [outcome(text) for text in texts]
    assert 8 <= sum(isinstance(each, str) for each in expected) <= 11
    monkeypatch.setattr("rasterizer.io.stl.FEW", 0)
    for block in (16, 100, 10**6):
        monkeypatch.setattr("rasterizer.io.stl._BLOCK", block)
        for text, wanted in zip(texts, expected, strict=True):
            assert outcome(text) == wanted, text


def test_stl_faults_name_the_line():
    assert_refused(lambda text: load_stl(text.encode()), [
        ("solid\n" + FACET.replace("1 0 0", "1 x 0") + "endsolid\n", ":5: 'vertex 1 x 0' is not a vertex of three"),
        ("solid é\n" + FACET.replace("1 0 0", "1 é 0") + "endsolid\n", ":5: 'vertex 1 é 0' is not a vertex of three"),
        ("solid\n" + FACET.replace("1 0 0", "1 \x85 0") + "endsolid\n", ":5: 'vertex 1 0' is not a vertex of three"),
        ("solid\n" + FACET + FACET.replace("  vertex 0 1 0\n", "") + "endsolid\n",
         ":13: a facet has 2 vertices, 3 are needed"),
        ("solid\n" + FACET.replace(" endloop\nendfacet\n", "") + "endsolid\n", "last facet is cut off"),
        ("solid\n" + FACET + FACET[:-10], "last facet is cut off"),
        ("solid_x\n" + FACET + "end\n", "no faces"),
        ("solid\nendsolid\n", "no faces"),
    ], ModelError, "model")  # fmt: skip
    said = "binary STL of 12 faces must have 684 bytes, the file has 674"
    assert_refused(load_stl, [(exported(box(), "stl")[:-10], said)], ModelError)
