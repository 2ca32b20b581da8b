"""Small files that ask for much: memory and time are looked at before they are spent, and the limit is named."""

import base64
import io
import json
import struct
import subprocess
import sys
import tracemalloc
import warnings
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pytest
from helpers.file_bombs import BOMBS, QUICK
from helpers.file_grammar import MTL, OBJ, TRIANGLE, npz, picture
from helpers.model_bytes import gltf_with, rich_gltf
from helpers.refusals import assert_refused
from PIL import Image

import rasterizer as rz
from rasterizer.io.model_file import most
from rasterizer.io.scene_file import read_scene
from rasterizer.scene.texture import ENVIRONMENT, Texture, read_picture


def peak_of(call) -> int:
    """The bytes that numpy and Python hold at most during a call."""
    tracemalloc.start()
    try:
        call()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def chunk(kind, data) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(width, height, extra=b"") -> bytes:
    """A PNG of one black texel whose header says that it has more."""
    head = struct.pack(">2I5B", width, height, 8, 0, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", head)
        + extra
        + chunk(b"IDAT", zlib.compress(b"\0\0"))
        + chunk(b"IEND", b"")
    )


# --- pictures -----------------------------------------------------------------------------------------------


def test_pictures_with_too_many_texels_are_refused_by_their_header():
    sizes = [(9000, 9000), (16384, 16384), (2**31 - 1, 1), (60000, 60000)]
    assert_refused(
        lambda size: read_picture(io.BytesIO(png(*size)), "bomb.png"),
        [(size, "^bomb.png: .*(texels|can't be read as a picture)") for size in sizes],
        rz.ModelError,
    )


def test_a_bomb_of_a_texture_leaves_the_model(tmp_path):
    for name, data in (("wood.png", png(9000, 9000)), ("m.obj", OBJ), ("a.mtl", MTL)):
        (tmp_path / name).write_bytes(data)
    said = r"wood\.png: this picture of 9000 x 9000 has more than 33554432 texels.*RASTER_MOST_TEXELS"
    with pytest.warns(UserWarning, match=said):
        assert rz.load(tmp_path / "m.obj").n_face > 3


def test_the_limit_can_be_raised_and_lowered(monkeypatch):
    def read(limit):
        monkeypatch.setenv(ENVIRONMENT, limit)
        return read_picture(io.BytesIO(picture(size=(5, 3))), "x.png")

    said = "5 x 3 has more than 14 texels, the most that are read; RASTER_MOST_TEXELS raises that"
    assert_refused(read, [("14", said)], rz.ModelError)
    assert read("15").shape == (3, 5, 3)
    bad = ("", "-1", "many", "1e9", "0", "9" * 30)
    assert_refused(read, [(text, "RASTER_MOST_TEXELS must be a whole number") for text in bad], rz.SceneError)


def textured_files(folder, n):
    """Files of three formats with n materials each, whose pictures have 5 x 3 texels."""
    (folder / "wood.png").write_bytes(picture(size=(5, 3)))
    (folder / "leaf.png").write_bytes(picture(size=(5, 3), mode="RGBA"))
    names = ["wood.png", "leaf.png"] * n
    ways = [{"filter": filter, "wrap": wrap} for filter in ("nearest", "bilinear") for wrap in ("clamp", "mirror")]
    tables = [TRIANGLE | {"material": {"texture": {"file": names[k]} | ways[k // 2 % 4]}} for k in range(n)]
    (folder / "scene.json").write_text(json.dumps({"meshes": tables}))
    wraps = ("", "-clamp on ")
    mtl = "".join(f"newmtl m{k}\nmap_Kd {wraps[k % 2]}{names[k // 2]}\n" for k in range(n))
    (folder / "m.mtl").write_text(mtl + "map_d leaf.png\n")
    faces = "".join(f"usemtl m{k}\nf 1/1 2/2 3/3\n" for k in range(n))
    (folder / "m.obj").write_text(f"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n{faces}")
    return folder / "scene.json", folder / "m.obj"


def test_where_textures_of_a_file_are_too_many_all_are_halved_alike(tmp_path, monkeypatch):
    """With one warning, however often; pictures that were read before that is known, too."""
    monkeypatch.setenv(ENVIRONMENT, "40")
    for n, size in ((2, (3, 5)), (8, (1, 2))):
        for path in textured_files(tmp_path, n):
            with warnings.catch_warnings(record=True) as told:
                warnings.simplefilter("always")
                scene = rz.load(path)
            shapes = {material.texture.shape for mesh in scene.meshes for material in mesh.palette}
            assert shapes == {size}, f"{path.name}: {shapes}, not {size}"
            said = [str(each.message) for each in told]
            assert len(said) == (n > 2), said
            assert all("all are read at 1/2 of their size" in text and "more than 80:" in text for text in said), said


def test_one_picture_in_many_materials_of_a_gltf_keeps_all_of_them(monkeypatch):
    """As in Khronos' AlphaBlendModeTest: OPAQUE has a texture of its own, BLEND and MASK share one."""
    monkeypatch.setenv(ENVIRONMENT, "40")
    tree = json.loads(rich_gltf())
    data = picture(size=(6, 6), mode="RGBA")
    tree["images"] = [{"uri": "data:;base64," + base64.b64encode(data).decode()}]
    surface = {"baseColorTexture": {"index": 0}}
    modes = [{"alphaMode": "OPAQUE"}, {"alphaMode": "BLEND"}, {"alphaMode": "MASK", "alphaCutoff": 0.2}]
    tree["materials"] = [mode | {"pbrMetallicRoughness": surface} for mode in (*modes, {"alphaMode": "MASK"})]
    whole = tree["meshes"][0]["primitives"][0]
    tree["meshes"][0]["primitives"] = [whole | {"material": k} for k in range(4)]
    with pytest.warns(UserWarning, match="have 81 texels, more than 80: all are read at 1/2 of their size") as told:
        scene = rz.load(json.dumps(tree).encode(), format="gltf")
    assert len(told) == 1
    assert [mesh.material.texture.shape for mesh in scene.meshes] == [(3, 3)] * 4


def test_a_texture_is_halved_by_means_that_alpha_weights():
    image = np.array([[[200, 0, 0, 255], [0, 100, 0, 0], [8, 8, 8, 255]]] * 2, np.uint8)
    half = Texture(image, "nearest", "clamp", "leaf").halved(1)
    assert half.shape == (1, 1) and abs(int(half.encoded[0, 0, 0]) - 200) <= 1 and half.encoded[0, 0, 1] <= 1
    assert 126 <= half.encoded[0, 0, 3] <= 129
    assert (half.filter, half.wrap, half.name) == ("nearest", ("clamp", "clamp"), "leaf")
    numbers = Texture.of_numbers(np.full((4, 4), 51, np.uint8)).halved(2)
    assert numbers.shape == (1, 1) and abs(numbers.image[0, 0, 0] - 0.2) < 1e-6
    floats = Texture(np.full((4, 2, 3), 7.0)).halved(1)
    assert floats.shape == (2, 1) and (floats.image[..., :3] == 7.0).all()


def test_of_many_pictures_in_a_file_the_first_is_taken():
    frames = [Image.new("RGB", (8, 8), color) for color in ("red", "blue", "lime") * 9]
    for format in ("TIFF", "GIF", "WEBP"):
        stream = io.BytesIO()
        frames[0].save(stream, format, save_all=True, append_images=frames[1:])
        pixels = read_picture(io.BytesIO(stream.getvalue()), "x")
        assert pixels.shape[:2] == (8, 8), f"{format}: {pixels.shape[:2]} != {(8, 8)}"
        assert pixels[0, 0, 0] > 250, format
        assert pixels[0, 0, 2] < 5, format


def test_other_formats_are_refused_and_start_no_program(tmp_path, monkeypatch):
    """Pillow would start Ghostscript for EPS: the system's way to start a program is watched."""
    started = []
    monkeypatch.setattr(subprocess, "Popen", lambda *a, **k: started.append(a))
    data = {"EPS": b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 10 10\n{} loop\n"}
    for format in ("PDF", "DDS", "PPM", "PCX", "ICO", "JPEG2000", "SGI", "MSP", "AVIF"):
        stream = io.BytesIO()
        try:
            Image.new("1" if format == "MSP" else "RGB", (16, 16)).save(stream, format)
        except (KeyError, OSError):  # this Pillow can't write it
            continue
        data[format] = stream.getvalue()

    def read(format):
        (tmp_path / "wood.png").write_bytes(data[format])
        Texture(tmp_path / "wood.png")

    said = r"wood\.png: can't be read as a picture: is none of PNG, JPEG, WEBP, BMP, TGA, TIFF"
    assert_refused(read, [(format, said) for format in data], rz.ModelError)
    assert len(data) > 6 and not started, started


def test_a_texture_needs_little_more_room_than_it_takes(tmp_path):
    """21.3 bytes a texel are the texture and its mipmaps, 3 the decoded picture, some the strips that are converted."""
    Image.new("RGB", (2048, 2048), "red").save(tmp_path / "t.png")
    peak = peak_of(lambda: Texture(tmp_path / "t.png").pyramid) / 2048**2
    assert peak < 28, f"{peak:.1f} > 28 bytes a texel"


# --- arrays -------------------------------------------------------------------------------------------------


def scene_with(data, folder, **mesh):
    (folder / "a.npz").write_bytes(data)
    return read_scene(json.dumps({"meshes": [{"arrays": "a.npz", "mesh": 0} | mesh]}).encode(), folder)


def npy(descr, shape, data=b"") -> bytes:
    """An array's file whose header says what is wanted."""
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": descr, "fortran_order": False, "shape": shape})
    return stream.getvalue() + data


def archive_of(vertices) -> bytes:
    """An .npz file of a mesh."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("mesh0_vertices.npy", vertices)
        archive.writestr("mesh0_faces.npy", npy("<i8", (1, 3), np.arange(3).tobytes()))
    return stream.getvalue()


def test_arrays_that_ask_for_what_is_not_there_are_refused(tmp_path):
    cases = [
        *((("<f8", shape), "can't be read as .npz") for shape in ((2**24, 3), (2**40, 3), (2**63, 2**63), (5, 3))),
        (("<f8", (-3, 3)), "can't be read|no vertices"),
        (("|O", (1,)), "can't be read as .npz .*allow_pickle=False"),
        *(((descr, (1, 3)), "vertices must be") for descr in ("<U2", [("x", "<f4")], "<c8", "<M8[s]")),
    ]
    cases = [(case, rf"meshes\[0\].*({said})") for case, said in cases]
    assert_refused(lambda case: scene_with(archive_of(npy(*case, bytes(32))), tmp_path), cases, rz.ModelError)


def test_an_encrypted_npz_is_refused(tmp_path):
    data = bytearray(archive_of(npy("<f8", (3, 3), np.eye(3).tobytes())))
    assert scene_with(bytes(data), tmp_path).scene.n_face == 1
    for mark, place in ((b"PK\x01\x02", 8), (b"PK\x03\x04", 6)):
        at = data.find(mark)
        while at >= 0:
            data[at + place] |= 1
            at = data.find(mark, at + 4)
    with pytest.raises(rz.ModelError, match=r"can't be read as .npz .*encrypted"):
        scene_with(bytes(data), tmp_path)


def test_arrays_that_are_used_again_and_again_are_counted(tmp_path):
    n = 2**19
    arrays = {"mesh0_vertices": np.eye(3), "mesh0_faces": np.tile(np.arange(3, dtype=np.uint8), (n, 1))}
    (tmp_path / "a.npz").write_bytes(npz(arrays))
    table = {"meshes": [{"arrays": "a.npz", "mesh": 0}] * (most(0) // (3 * n) + 1)}
    with pytest.raises(rz.ModelError, match=rf"meshes\[42\]: asks for \d+ bytes of arrays: too many .*{most(0)} are"):
        read_scene(json.dumps(table).encode(), tmp_path)


# --- text ---------------------------------------------------------------------------------------------------


def test_large_numbers_of_polygons_and_groups_take_no_room():
    def drawn(key, numbers, shading):
        scene = read_scene(json.dumps({"meshes": [TRIANGLE | {key: numbers}]}).encode()).scene
        return rz.render(scene, 16, shading=shading, samples=1).rgba

    for key, shading in (("polygons", "flat"), ("smoothing", "gouraud")):
        large, small = drawn(key, [2**31 - 1, 2**31 - 2], shading), drawn(key, [1, 0], shading)
        assert np.array_equal(large, small), key
    mesh = TRIANGLE | {"face_material": [2**31 - 1, 0], "materials": [{}]}
    with pytest.raises(rz.ModelError, match="face_material must be within"):
        read_scene(json.dumps({"meshes": [mesh]}).encode())


# --- glTF ---------------------------------------------------------------------------------------------------


def loaded(nodes, roots=(0,), count=None):
    def change(tree, primitive):
        tree["nodes"], tree["scenes"] = nodes, [{"nodes": list(roots)}]
        if count:
            tree["accessors"][primitive["indices"]]["count"] = count

    return rz.load(gltf_with(change), format="gltf")


def test_chains_and_rings_of_nodes_are_followed_once():
    n = 5_000
    chain = [{"children": [k + 1], "translation": [0.001, 0, 0]} for k in range(n)] + [{"mesh": 0}]
    assert loaded(chain).bounds.mean(axis=0)[0] == pytest.approx(n / 1000)
    ring = [{"children": [k + 1, k + 1, 0]} for k in range(60)] + [{"mesh": 0}]
    assert loaded(ring, (0, 0, 5)).n_face == 12


def test_copies_of_a_mesh_are_counted_before_they_are_made():
    assert loaded([{"mesh": 0}] * 10, range(10)).n_face == 120
    with pytest.raises(rz.ModelError, match=f"asks for .* bytes of arrays: too many for .*, {most(0)} are legal"):
        loaded([{"mesh": 0}], count=3 * 2**22)


def test_names_that_are_no_text_of_unicode_are_drawn_and_saved(tmp_path):
    def change(tree, _):
        tree["meshes"][0]["name"] = tree["nodes"][0]["name"] = "\ud800"

    scene = rz.load(gltf_with(change), format="gltf")
    assert scene.n_face == 12 and rz.render(scene, 8, samples=1).stats.covered
    assert rz.load(rz.save(scene, tmp_path / "x.json")).meshes[0].name == "\ud800"


# --- every container ----------------------------------------------------------------------------------------


def assert_bounded(*names):
    """Load bombs, each in a process: none takes more than 300 MB or 10 s, and all are drawn, or refused in a line."""
    command = [sys.executable, "-m", "helpers.file_bombs", *names]
    ended = subprocess.run(command, capture_output=True, text=True, cwd=Path(__file__).parents[1], check=False)
    assert ended.returncode == 0 and not ended.stderr, ended.stderr[-2000:]
    rows = [json.loads(line) for line in ended.stdout.splitlines()]
    for row in rows:
        assert row["bytes"] <= 2**20 and row["outcome"] != "died" and "internal error" not in row["outcome"], row
        assert row["megabytes"] <= 300 and row["seconds"] <= 10, row
        assert row["longest"] <= 300 and row["lines"] == 1 and row["n_warning"] <= 40, row
    return rows


on_linux = pytest.mark.skipif(sys.platform != "linux", reason="the peak of memory is Linux' own")


@on_linux
def test_bombs_of_every_container_are_drawn_or_refused_in_a_line():
    assert len(assert_bounded(*QUICK)) == len(QUICK)


@on_linux
@pytest.mark.nightly
def test_all_bombs_are_drawn_or_refused_in_a_line():
    names = [name for name in BOMBS if name not in QUICK]
    assert len(assert_bounded(*names)) == len(names)
