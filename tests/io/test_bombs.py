"""Tests of small files that ask for much: memory and time are looked at before they are spent, and the limit is
named."""

import io
import json
import resource
import struct
import subprocess
import sys
import time
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pytest
from helpers.fuzz_cases import MTL, OBJ, TRIANGLE, npz, picture
from helpers.model_bytes import box, embedded_gltf, gltf_with
from PIL import Image

import rasterizer as rz
from rasterizer.io import gltf, scene_file_arrays
from rasterizer.io.scene_file import MOST_DOTS, MOST_TOML, read_scene
from rasterizer.scene import texture
from rasterizer.scene.texture import Texture, read_picture

SECONDS = 10  # far more than any of these takes, far less than what they would ask for


@pytest.fixture(autouse=True)
def capped():
    """Each test in little time, and with little more memory."""
    start, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    yield
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    assert grown < 600, f"{grown:.0f} MB"
    assert time.perf_counter() - start < 6 * SECONDS


def blank_png(width, height, extra=b"") -> bytes:
    """A PNG of one grey, as small as it gets, without ever holding the picture."""

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    packer = zlib.compressobj(9)
    rows = b"".join(packer.compress(bytes(1 + width)) for _ in range(height)) + packer.flush()
    head = struct.pack(">2I5B", width, height, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + extra + chunk(b"IDAT", rows) + chunk(b"IEND", b"")


# --- pictures -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("width", "height"), [(9000, 9000), (16384, 16384), (2**31 - 1, 1), (60000, 60000)])
def test_pictures_with_too_many_texels_are_refused_by_their_header(width, height):
    head = blank_png(1, 1)
    data = bytearray(head)
    data[16:24] = struct.pack(">2I", width, height)
    data[29:33] = struct.pack(">I", zlib.crc32(bytes(data[12:29])))
    with pytest.raises(rz.ModelError, match="texels|can't be read as a picture"):
        read_picture(io.BytesIO(data), "bomb.png")


def test_a_bomb_of_a_texture_leaves_the_model(tmp_path):
    (tmp_path / "wood.png").write_bytes(blank_png(9000, 9000))
    (tmp_path / "m.obj").write_bytes(OBJ)
    (tmp_path / "a.mtl").write_bytes(MTL)
    with pytest.warns(
        UserWarning, match=r"wood\.png: this picture of 9000 x 9000 has more than 33554432 texels.*RASTER_MOST_TEXELS"
    ):
        assert rz.load(tmp_path / "m.obj").n_face > 3


def test_the_limit_can_be_raised_and_lowered(monkeypatch):
    data = picture(size=(5, 3))
    monkeypatch.setenv(texture.ENVIRONMENT, "14")
    with pytest.raises(
        rz.ModelError, match="5 x 3 has more than 14 texels, the most that are read; RASTER_MOST_TEXELS raises that"
    ):
        read_picture(io.BytesIO(data), "x.png")
    monkeypatch.setenv(texture.ENVIRONMENT, "15")
    assert read_picture(io.BytesIO(data), "x.png").shape == (3, 5, 3)
    for bad in ("", "-1", "many", "1e9", "0", "9" * 30):
        monkeypatch.setenv(texture.ENVIRONMENT, bad)
        with pytest.raises(rz.SceneError, match="RASTER_MOST_TEXELS must be a whole number"):
            read_picture(io.BytesIO(data), "x.png")


def test_all_textures_of_a_file_have_one_budget(tmp_path, monkeypatch):
    monkeypatch.setenv(texture.ENVIRONMENT, "40")
    (tmp_path / "wood.png").write_bytes(picture(size=(5, 3)))
    used = {"file": "wood.png"}
    ways = [
        used | {"filter": name, "wrap": wrap}
        for name in ("nearest", "bilinear")
        for wrap in ("clamp", "mirror", "repeat")
    ]
    meshes = [TRIANGLE | {"material": {"texture": way}} for way in ways]
    with pytest.raises(rz.ModelError, match="the textures of this file need more than 80 texels together"):
        read_scene(json.dumps({"meshes": meshes}).encode(), tmp_path)
    assert len(read_scene(json.dumps({"meshes": meshes[:4] + meshes[:3]}).encode(), tmp_path).scene.meshes) == 7


@pytest.mark.parametrize("kind", [b"zTXt", b"iTXt", b"iCCP"])
def test_metadata_that_unpacks_to_much(kind):
    body = zlib.compress(bytes(2**28), 9)
    head = {b"zTXt": b"Comment\0\0", b"iTXt": b"Comment\0\1\0\0\0", b"iCCP": b"profile\0\0"}[kind]
    chunk = kind + head + body
    extra = struct.pack(">I", len(chunk) - 4) + chunk + struct.pack(">I", zlib.crc32(chunk))
    try:
        read_picture(io.BytesIO(blank_png(4, 4, extra)), "x.png")
    except rz.ModelError as fault:
        assert str(fault).startswith("x.png: can't be read as a picture")


@pytest.mark.parametrize("format", ["TIFF", "GIF", "WEBP"])
def test_of_many_pictures_in_a_file_the_first_is_taken(format):
    stream = io.BytesIO()
    frames = [Image.new("RGB", (8, 8), color) for color in ("red", "blue", "lime") * 30]
    frames[0].save(stream, format, save_all=True, append_images=frames[1:])
    pixels = read_picture(io.BytesIO(stream.getvalue()), "x")
    assert pixels.shape[:2] == (8, 8) and pixels[0, 0, 0] > 250 and pixels[0, 0, 2] < 5


def test_deep_pictures_keep_their_high_bits():
    stream = io.BytesIO()
    Image.fromarray(np.array([[0, 257 * 7, 65535]], np.uint16)).save(stream, "PNG")
    assert read_picture(io.BytesIO(stream.getvalue()), "x").tolist() == [[0, 7, 255]]


@pytest.mark.parametrize("format", ["EPS", "PDF", "DDS", "PPM", "PCX", "ICO", "JPEG2000", "SGI", "IM", "MSP", "AVIF"])
def test_other_formats_are_refused_and_start_no_program(tmp_path, format, monkeypatch):
    started = []
    monkeypatch.setattr(
        subprocess, "Popen", lambda *a, **k: started.append(a) or (_ for _ in ()).throw(OSError("no programs"))
    )
    if format == "EPS":
        data = b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 10 10\n{} loop\n"
    else:
        stream = io.BytesIO()
        try:
            Image.new("1" if format == "MSP" else "RGB", (16, 16)).save(stream, format)
        except (KeyError, OSError):
            pytest.skip(f"Pillow can't write {format} here")
        data = stream.getvalue()
    (tmp_path / "wood.png").write_bytes(data)
    with pytest.raises(
        rz.ModelError, match=r"wood\.png: can't be read as a picture: is none of PNG, JPEG, WEBP, BMP, TGA, TIFF"
    ):
        Texture(tmp_path / "wood.png")
    assert not started


def test_a_texture_needs_little_more_room_than_it_takes():
    """In a process of its own, whose largest size is that of this texture alone."""
    code = (
        "import io, resource, numpy as np\n"
        "from PIL import Image\n"
        "from rasterizer.scene.texture import Texture\n"
        "stream = io.BytesIO(); Image.new('RGB', (2048, 2048), 'red').save(stream, 'PNG')\n"
        "open('t.png', 'wb').write(stream.getvalue())\n"
        "Texture(np.zeros((8, 8, 3), np.uint8)).pyramid\n"
        "before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "Texture('t.png').pyramid\n"
        "print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024 / 2048**2)"
    )
    root = Path(rz.__file__).parent.parent
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=root)
    (root / "t.png").unlink()
    assert float(done.stdout) < 32, (
        f"{done.stdout} bytes a texel > 32"
    )  # 21.3 are the texture and its mipmaps, 7 the decoded picture


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (37, 1), (300, 517), (64, 64), (1023, 33), (2, 70000 // 8)])
def test_strips_change_nothing(shape, monkeypatch):
    image = np.random.default_rng(4).integers(0, 256, (*shape, 4), dtype=np.uint8)
    monkeypatch.setattr(texture, "_STRIP", 2**40)
    whole = Texture(image).pyramid
    for strip in (1, 100, 2**12):
        monkeypatch.setattr(texture, "_STRIP", strip)
        for a, b in zip(Texture(image).pyramid, whole, strict=True):
            assert a.tobytes() == b.tobytes()


# --- arrays -------------------------------------------------------------------------------------------------


def scene_with(data, folder, **mesh):
    (folder / "a.npz").write_bytes(data)
    return read_scene(json.dumps({"meshes": [{"arrays": "a.npz", "mesh": 0} | mesh]}).encode(), folder)


def test_an_npz_that_unpacks_to_gigabytes_is_refused(tmp_path):
    stream = io.BytesIO()
    archive = zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED)
    with archive, archive.open("mesh0_vertices.npy", "w", force_zip64=True) as part:
        header = io.BytesIO()
        np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (2**24, 3)})
        part.write(header.getvalue())
        for _ in range(2**24 * 24 // 2**20):
            part.write(bytes(2**20))
    assert len(stream.getvalue()) < 2**20
    with pytest.raises(
        rz.ModelError, match=r"a\.npz: its arrays would take 40265\d{4} bytes; .* of its size may have 268435456"
    ):
        scene_with(stream.getvalue(), tmp_path)


@pytest.mark.parametrize(
    ("descr", "shape", "fault"),
    [
        ("<f8", (2**40, 3), "must hold"),
        ("<f8", (-3, 3), "must hold|can't be read"),
        ("<f8", (2**63, 2**63), "must hold"),
        ("|O", (4, 3), "holds no numbers"),
        ("<U5", (4, 3), "holds no numbers"),
        ([("x", "<f8")], (4, 3), "holds no numbers"),
        ("<c16", (4, 3), "holds no numbers"),
        ("<M8[s]", (4, 3), "holds no numbers"),
        ("<f8", (5, 3), "must hold 120 bytes|cut off"),
    ],
)
def test_headers_that_ask_for_what_is_not_there(tmp_path, descr, shape, fault):
    header, stream = io.BytesIO(), io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": descr, "fortran_order": False, "shape": shape})
    faces = io.BytesIO()
    np.save(faces, np.array([[0, 1, 2]]))
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr("mesh0_vertices.npy", header.getvalue() + bytes(96 - 64 + 0))
        archive.writestr("mesh0_faces.npy", faces.getvalue())
    with pytest.raises(rz.ModelError, match=rf"a\.npz.*({fault})"):
        scene_with(stream.getvalue(), tmp_path)


def test_an_encrypted_npz_is_refused(tmp_path):
    data = bytearray(
        npz({"mesh0_vertices": np.array(TRIANGLE["vertices"], float), "mesh0_faces": np.array(TRIANGLE["faces"])})
    )
    for mark, place in ((b"PK\x01\x02", 8), (b"PK\x03\x04", 6)):
        at = data.find(mark)
        while at >= 0:
            data[at + place] |= 1
            at = data.find(mark, at + 4)
    with pytest.raises(rz.ModelError, match=r"can't be read as .npz .*encrypted"):
        scene_with(bytes(data), tmp_path)


def test_arrays_that_are_used_again_and_again_are_counted(tmp_path, monkeypatch):
    arrays = {f"mesh0_{key}": np.array(TRIANGLE[key]) for key in ("vertices", "faces")}
    (tmp_path / "a.npz").write_bytes(npz(arrays))
    monkeypatch.setattr("rasterizer.io.scene_file_meshes.MOST_COPIES", 10)
    table = {"meshes": [{"arrays": "a.npz", "mesh": 0}] * 1000}
    with pytest.raises(rz.ModelError, match="used for more than 10 triangles"):
        read_scene(json.dumps(table).encode(), tmp_path)
    assert scene_file_arrays.MOST_UNPACKED == 2**28


# --- text ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("key", ["polygons", "smoothing", "face_material"])
def test_large_numbers_of_polygons_and_groups_take_no_room(key):
    mesh = TRIANGLE | {key: [2**31 - 1, 2**31 - 2]}
    if key == "face_material":
        with pytest.raises(rz.ModelError, match="face_material must be within"):
            read_scene(json.dumps({"meshes": [mesh | {"materials": [{}]}]}).encode())
        return
    scene = read_scene(json.dumps({"meshes": [mesh]}).encode()).scene
    for shading in ("flat", "gouraud"):
        few = {key: [1, 0]}
        small = read_scene(json.dumps({"meshes": [TRIANGLE | few]}).encode()).scene
        assert np.array_equal(
            rz.render(scene, 16, shading=shading, samples=1).rgba, rz.render(small, 16, shading=shading, samples=1).rgba
        )


@pytest.mark.parametrize(
    ("name", "text", "fault"),
    [
        ("x.toml", ".".join(["a"] * 100_000) + " = 1", f"up to {MOST_DOTS} dots"),
        ("x.toml", "[" + " . ".join(["a"] * 100_000) + "]", f"up to {MOST_DOTS} dots"),
        ("x.toml", "t = {" + ".".join(['"a"'] * 50_000) + " = 1}", f"up to {MOST_DOTS} dots"),
        ("x.toml", "#" * (MOST_TOML + 1), f"one in TOML may have {MOST_TOML}"),
        ("x.toml", "x = " + "[" * 100_000, "nested too deeply"),
        ("x.json", "[" * 10**6, "nested too deeply|not legal JSON"),
        ("x.json", '{"a":' * 10**6, "nested too deeply|not legal JSON"),
        (
            "x.json",
            '{"meshes": [' + '{"a": ' * 900 + "1" + "}" * 900 + "]}",
            "a mesh needs one of file|unknown key|nested",
        ),
        (
            "x.json",
            '{"up": ' + "[" * 900 + "]" * 900 + ', "meshes": [' + json.dumps(TRIANGLE) + "]}",
            "up: must be text",
        ),
        ("x.json", "{" + ",".join(f'"k{i}": 1' for i in range(10**5)) + ', "k99999": 2}', "duplicate key 'k99999'"),
    ],
    ids=range(10),
)
def test_text_that_takes_long(tmp_path, name, text, fault):
    (tmp_path / name).write_text(text)
    start = time.perf_counter()
    with pytest.raises((rz.ModelError, rz.SceneError), match=fault) as caught:
        rz.load(tmp_path / name)
    assert time.perf_counter() - start < SECONDS and len(str(caught.value)) < 500


# --- glTF ---------------------------------------------------------------------------------------------------


def test_a_chain_of_nodes_takes_no_longer_than_as_many_beside_each_other():
    def change(tree, _):
        n = 20_000
        tree["nodes"] = [{"children": [k + 1], "translation": [0.001, 0, 0]} for k in range(n)] + [{"mesh": 0}]
        tree["scenes"] = [{"nodes": [0]}]

    start = time.perf_counter()
    scene = rz.load(gltf_with(change), format="gltf")
    assert time.perf_counter() - start < SECONDS and scene.bounds.mean(axis=0)[0] == pytest.approx(20.0)


def test_nodes_that_are_shared_or_in_a_ring_are_placed_once():
    def change(tree, _):
        tree["nodes"] = [{"children": [k + 1, k + 1, 0]} for k in range(60)] + [{"mesh": 0}]
        tree["scenes"] = [{"nodes": [0, 0, 5]}]

    assert rz.load(gltf_with(change), format="gltf").n_face == 12


def test_copies_of_a_mesh_are_counted_before_they_are_made(monkeypatch):
    monkeypatch.setattr(gltf, "MOST_COPIES", 100)

    def repeat(n):
        def change(tree, _):
            tree["nodes"] = [{"mesh": 0} for _ in range(n)]
            tree["scenes"] = [{"nodes": list(range(n))}]

        return gltf_with(change)

    assert rz.load(repeat(10), format="gltf").n_face == 120
    with pytest.raises(rz.ModelError, match="ask for 2400 triangles, more than 100 of them copies"):
        rz.load(repeat(200), format="gltf")


@pytest.mark.parametrize(
    "change",
    [
        lambda accessor, view, buffer: accessor.update(count=10**12),
        lambda accessor, view, buffer: accessor.update(count=-1),
        lambda accessor, view, buffer: accessor.update(count=2**70),
        lambda accessor, view, buffer: accessor.update(byteOffset=-4),
        lambda accessor, view, buffer: accessor.update(byteOffset=10**9),
        lambda accessor, view, buffer: view.update(byteStride=10**9),
        lambda accessor, view, buffer: view.update(byteStride=0),
        lambda accessor, view, buffer: view.update(byteStride=-12),
        lambda accessor, view, buffer: view.update(byteLength=10**15),
        lambda accessor, view, buffer: view.update(byteOffset=-1),
        lambda accessor, view, buffer: buffer.update(byteLength=10**15),
        lambda accessor, view, buffer: buffer.update(uri="data:;base64,A"),
        lambda accessor, view, buffer: accessor.update(componentType=1, type="VEC9"),
        lambda accessor, view, buffer: accessor.update(sparse={"count": 10**12}),
        lambda accessor, view, buffer: accessor.pop("bufferView"),
    ],
)
def test_numbers_that_lead_out_of_a_buffer(change):
    def all_changed(tree, primitive):
        accessor = tree["accessors"][primitive["attributes"]["POSITION"]]
        view = tree["bufferViews"][accessor["bufferView"]]
        change(accessor, view, tree["buffers"][view["buffer"]])

    with pytest.raises(rz.ModelError, match="^model: ") as caught:
        rz.load(gltf_with(all_changed), format="gltf")
    assert "internal" not in str(caught.value)


def test_names_that_are_no_text_of_unicode(tmp_path):
    tree = embedded_gltf(__import__("trimesh").Scene(box()))
    tree["meshes"][0]["name"] = tree["nodes"][0]["name"] = "\ud800"
    scene = rz.load(json.dumps(tree).encode(), format="gltf")
    assert scene.n_face == 12 and rz.render(scene, 8, samples=1).stats.covered
    with pytest.raises(rz.SceneError, match="Unicode"):
        scene.save(tmp_path / "x.toml")
