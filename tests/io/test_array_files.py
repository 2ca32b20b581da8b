"""Files of arrays: what is read is what was written, PNG files say how to read them, and what they can't hold is
refused."""

import io
import sys
import zlib

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.pairs import pairs
from helpers.raster import ROOT
from helpers.refusals import assert_refused
from PIL import Image

import rasterizer as rz
from rasterizer.choices import ARRAY_SUFFIXES, BUFFERS
from rasterizer.io.array_files import encode_array_png, encode_arrays, encode_exr
from rasterizer.io.png import encode_png

SIZE = (37, 23)


@pytest.fixture(scope="module")
def frame() -> rz.Frame:
    """A picture with every buffer."""
    return rz.render(rz.load(ROOT / "models/cube.obj"), SIZE, outputs=("color", *BUFFERS), samples=4)


def read_png(data) -> tuple[np.ndarray, dict]:
    """The numbers of a PNG file, of 8 or 16 bits, and its text fields; read without the package's code or Pillow's,
    which takes 16 bits of grey alone."""
    with Image.open(io.BytesIO(data)) as image:
        text = dict(image.text)
    at, stream = 8, b""
    while at < len(data):
        n_byte, name = int.from_bytes(data[at : at + 4], "big"), data[at + 4 : at + 8]
        body = data[at + 8 : at + 8 + n_byte]
        assert data[at + 8 + n_byte : at + 12 + n_byte] == zlib.crc32(name + body).to_bytes(4, "big")
        if name == b"IHDR":
            width, height = (int.from_bytes(body[k : k + 4], "big") for k in (0, 4))
            n_bit, n_channel = body[8], {0: 1, 2: 3, 6: 4}[body[9]]
        stream += body if name == b"IDAT" else b""
        at += 12 + n_byte
    n_byte = n_channel * n_bit // 8
    rows = np.frombuffer(zlib.decompress(stream), np.uint8).reshape(height, 1 + width * n_byte)
    pixels, above = np.zeros((height, width, n_byte), np.uint8), np.zeros((width, n_byte), np.uint8)
    for y, row in enumerate(rows):
        here = row[1:].reshape(width, n_byte)
        pixels[y] = {0: here, 1: here.cumsum(axis=0, dtype=np.uint8), 2: here + above}[int(row[0])]
        above = pixels[y]
    numbers = pixels if n_bit == 8 else pixels.reshape(height, -1).view(">u2").reshape(height, width, n_channel)
    return numbers.astype(int).squeeze(axis=-1) if n_channel == 1 else numbers.astype(int), text


def decoded(data) -> tuple[np.ndarray, np.ndarray]:
    """What a PNG file holds, by its own text, and where it holds nothing."""
    stored, text = read_png(data)
    return stored * float(text["scale"]) + float(text["offset"]), stored == int(text["nothing"])


def test_png_files_of_8_and_16_bits_are_read_as_they_were_written():
    sizes, rng = [(1, 1), (1, 9), (31, 1), (200, 330), (3, 90_001)], np.random.default_rng(3)
    for case in pairs(size=sizes, dtype=(np.uint8, np.uint16), n_channel=(1, 3, 4)):
        size, dtype, n_channel = case
        pixels = (rng.integers(0, 65536, (*size, n_channel)) & (np.arange(size[1])[:, None] * 7)).astype(dtype)
        found, text = read_png(encode_png(pixels, text={"a": "b", "scale": "0.001"}))
        assert np.array_equal(found.reshape(pixels.shape), pixels), case
        assert text == {"a": "b", "scale": "0.001"}, case


def test_views_of_larger_arrays_are_written_as_they_look():
    pixels = np.random.default_rng(0).integers(0, 256, (60, 50, 4), np.uint8)
    pixels.setflags(write=False)
    for view in (pixels, pixels[..., :3], pixels[::-1], pixels[5:40:2, 30:3:-3], pixels.transpose(1, 0, 2)):
        assert not differences(read_png(encode_png(view))[0], view)


def test_depths_come_back_to_half_a_step(frame, tmp_path):
    for scale in (None, 2e-4, 0.25, 1 / 3):
        frame.save(tmp_path / "depth.png", array="depth", scale=scale)
        depth, is_nothing = decoded((tmp_path / "depth.png").read_bytes())
        assert not differences(is_nothing, np.isinf(frame.depth))
        error, most = np.abs(depth - frame.depth)[~is_nothing].max(), 0.5001 * (scale or 0.001)
        assert error <= most, f"{error:.3g} > {most:.3g}"


def test_what_is_out_of_range_is_an_error_and_no_lie(frame):
    with pytest.raises(rz.OutputError, match=r"from 1e-05 to 0\.65535; given .* to .*; scale=.* or more holds"):
        encode_array_png("depth", frame.depth, 1e-5)
    with pytest.raises(rz.OutputError, match=r"from 1000 to 6\.5535e\+07; given"):
        encode_array_png("depth", frame.depth, 1000)
    with pytest.raises(rz.OutputError, match="indices up to 65534; given face 65535"):
        encode_array_png("face", np.array([[-1, 65535]], np.int32))
    assert decoded(encode_array_png("face", np.array([[-1, 65534]], np.int32)))[0].tolist() == [[-1, 65534]]
    empty = encode_array_png("depth", np.full((2, 2), np.inf, np.float32), 1e-9)
    assert not differences(decoded(empty)[1], True)
    for factor in (1.0, 0.97, 1e5, 3e-4):  # what is suggested holds the depths
        depths = (frame.depth * np.float32(factor)).astype(np.float32)
        with pytest.raises(rz.OutputError) as fault:
            encode_array_png("depth", depths, 1e-9)
        scale, least = float(str(fault.value).split("scale=")[1].split()[0]), depths[np.isfinite(depths)].max() / 65535
        assert least <= scale <= 1.1 * least, f"{scale} is suggested for {least}"
        assert decoded(encode_array_png("depth", depths, scale))


def test_a_scale_is_a_number_above_0(frame):
    assert encode_array_png("depth", frame.depth) == encode_array_png("depth", frame.depth, 0.001)
    cases = [(scale, "scale") for scale in (0, -1.0, np.nan, np.inf, "1", True)]
    assert_refused(lambda scale: encode_array_png("depth", frame.depth, scale), cases, rz.SceneError)


def test_an_npz_file_has_all_arrays_by_name(frame, tmp_path):
    frame.save(tmp_path / "all.npz")
    with np.load(tmp_path / "all.npz") as found:
        assert set(found) == {"rgb", "color", "alpha", *BUFFERS}
        for name in found:
            expected = frame.array(name)
            assert found[name].dtype == expected.dtype, f"{name}: {found[name].dtype} != {expected.dtype}"
            assert found[name].tobytes() == expected.tobytes(), (
                f"{name}: {found[name].tobytes()} != {expected.tobytes()}"
            )
    frame.save(tmp_path / "two.npz", array=("depth", "mask"))
    with np.load(tmp_path / "two.npz") as found:
        assert list(found) == ["depth", "mask"]


def test_files_are_the_same_on_every_day(frame, tmp_path, pass_days):
    pytest.importorskip("OpenEXR", reason="the extra exr is not installed")
    suffixes = ("png", "jpg", "webp", "tiff", "gif", "bmp", *ARRAY_SUFFIXES)
    for name in "ab":
        for suffix in suffixes:
            frame.save(tmp_path / f"{name}.{suffix}", array="depth" if suffix == "npy" else None)
        pass_days(100)
    for suffix in suffixes:
        assert (tmp_path / f"a.{suffix}").read_bytes() == (tmp_path / f"b.{suffix}").read_bytes(), suffix


def test_an_exr_file_has_the_channels_that_others_expect(frame, tmp_path):
    exr = pytest.importorskip("OpenEXR", reason="the extra exr is not installed")
    frame.save(tmp_path / "all.exr")
    with exr.File(str(tmp_path / "all.exr"), separate_channels=True) as file:
        found = {name: channel.pixels for name, channel in file.channels().items()}
        assert "premultiplied" not in file.header() and "numbers as in the arrays" in file.header()["comments"]
    for k, name in enumerate("RGB"):
        assert not differences(found[name], frame.color[..., k] * frame.alpha)
    assert not differences(found["A"], frame.alpha) and not differences(found["Z"], frame.depth)
    for group, name in (("N", "normal"), ("P", "position"), ("Pcamera", "position_camera")):
        for k, axis in enumerate("XYZ"):
            assert not differences(found[f"{group}.{axis}"], frame.array(name)[..., k], equal_nan=True)
    for name in ("face", "object", "material"):
        assert not differences(found[f"id.{name}"], frame.array(name))
    assert not differences(found["mask"], frame.mask)
    assert not differences(found["UV.U"], frame.uv[..., 0], equal_nan=True)
    assert {channel.dtype for channel in found.values()} == {np.dtype(np.float32)}


def test_whole_numbers_that_float32_does_not_hold_are_refused_in_exr_files():
    pytest.importorskip("OpenEXR", reason="the extra exr is not installed")
    assert encode_exr({"face": np.array([[-1, 1 << 24]], np.int32)})
    with pytest.raises(rz.OutputError, match=r"up to 16777216; given face 16777217: write it as .npy or .npz"):
        encode_exr({"face": np.array([[-1, (1 << 24) + 1]], np.int32)})


def test_a_missing_library_is_told_with_its_extra(frame, monkeypatch):
    monkeypatch.setitem(sys.modules, "OpenEXR", None)  # the extra is not installed
    command = r"pip install .*\[exr\]'"
    with pytest.raises(rz.OutputError, match=f"an EXR file needs OpenEXR: {command}") as fault:
        encode_arrays({"depth": frame.depth}, "exr")
    assert "\n" not in str(fault.value)


def test_what_a_file_can_not_hold_is_refused(frame, tmp_path):
    pytest.importorskip("OpenEXR", reason="the extra exr is not installed")
    other = r"arrays are written as \.npy, \.npz, \.exr or \.png; given"
    cases = [
        (("a.png", {"array": "position"}), r"a PNG file can't hold 'position': write it as \.npy"),
        (("a.png", {"array": ["depth", "mask"]}), r"a \.png file holds one array"),
        (("a.npy", {"array": ["depth", "mask"]}), r"a \.npy file holds one array"),
        (("a.jpg", {"array": "mask"}), other + r" \.jpg for mask"),
        (("a", {"array": "mask"}), "given no suffix for mask"),
        (("a.npz", {"array": []}), "array must name at least one of"),
        (("a.npz", {"array": "masks"}), "array must be one of .*; given 'masks'"),
        (("a.npz", {"array": [3]}), "array must be one of"),
        (("a.npz", {"array": 3}), "array must be"),
        (("a.png", {"array": "mask", "scale": 1}), "scale is that of depth"),
        (("a.npy", {"array": "depth", "scale": 1}), "scale is that of depth in a PNG file"),
        (("a.png", {"scale": 1}), "give array='depth'"),
        (("a.exr", {"array": "rgb"}), "an EXR file holds linear colours"),
    ]
    assert_refused(lambda given: frame.save(tmp_path / given[0], **given[1]), cases, rz.SceneError)
    assert not list(tmp_path.iterdir())


def test_a_frame_without_linear_colours_says_what_to_ask_for(tmp_path):
    frame = rz.render(rz.load(ROOT / "models/cube.obj"), 4, outputs="rgb")
    with pytest.raises(rz.SceneError, match="has no color: ask for it with outputs"):
        frame.save(tmp_path / "a.exr")
    frame.save(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as found:
        assert list(found) == ["rgb", "alpha"]
