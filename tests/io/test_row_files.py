"""Files that are written band by band: any order, any thread, whole or not at all; and what a TIFF file says."""

import io
import os
import shutil
import stat
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.arrays import differences
from PIL import Image, features

import rasterizer as rz
from rasterizer.io.files import HiddenFile
from rasterizer.io.icc import srgb_profile
from rasterizer.io.row_files import RowFile, npy_header, row_format_of
from rasterizer.io.tiff import encode_tiff, tiff_header
from rasterizer.pipeline.resolve import Picture

SIZE = (31, 20)


@pytest.fixture
def picture():
    """A picture with linear colours."""
    rng, (width, height) = np.random.default_rng(2), SIZE
    rgba = rng.integers(0, 2**32, (height, width), np.uint32)
    return Picture(rng.random((height, width, 3), np.float32), rgba, rng.random((height, width), np.float32))


def expected_bytes(picture, format, array):
    """What the file of a whole picture holds."""
    rgba = picture.rgba.view(np.uint8).reshape(*picture.rgba.shape, 4)
    if format != "npy":
        return encode_tiff(rgba)
    arrays = {"color": picture.color, "rgba": rgba, "rgb": rgba[..., :3], "alpha": picture.alpha}
    stream = io.BytesIO()
    np.save(stream, arrays[array or "color"])
    return stream.getvalue()


def draw_file(path, picture, format="tif", array=None, starts=(0,), n_row=SIZE[1]):
    """Write the rows of a picture, four threads at a time."""
    with RowFile(path, row_format_of(format, array), SIZE) as file, ThreadPoolExecutor(4) as pool:
        file.begin()
        bands = [(y, Picture(*(part[y : y + n_row] for part in picture))) for y in starts]
        list(pool.map(lambda band: file.write_rows(*band), bands))
        assert not os.path.exists(path) or os.path.getsize(path) == len(b"before"), "seen before it is whole"
        file.move()
        return file


def test_bands_in_any_order_make_the_file_of_the_whole(tmp_path, picture):
    kinds = [("tif", None), ("npy", None), *(("npy", name) for name in ("color", "rgb", "rgba", "alpha"))]
    for format, array in kinds:
        file = draw_file(tmp_path / "x", picture, format, array, [15, 0, 10, 5], 5)
        content = expected_bytes(picture, format, array)
        assert (tmp_path / "x").read_bytes() == content, (format, array)
        assert file.n_byte == len(content), f"{(format, array)}: {file.n_byte} != {len(content)}"
        assert os.listdir(tmp_path) == ["x"]
        os.remove(tmp_path / "x")
    draw_file(tmp_path / "x", picture._replace(color=picture.color[:0], alpha=picture.alpha[:0]), "npy", "alpha")
    alpha = (picture.rgba >> 24).astype(np.uint8) / np.float32(255)  # of the bytes, as Frame.alpha
    assert not differences(np.load(tmp_path / "x"), alpha)
    for format, array in (("png", None), ("npy", "depth"), ("tif", "color"), ("", None), ("npy", "x")):
        assert row_format_of(format, array) is None, (format, array)
    stream = io.BytesIO(npy_header(np.float32, (65536, 65536, 4)))
    assert np.lib.format.read_magic(stream) == (1, 0)
    assert np.lib.format.read_array_header_1_0(stream) == ((65536, 65536, 4), False, np.dtype(np.float32))


def test_only_black_pixels_are_noticed(tmp_path, picture):
    with RowFile(tmp_path / "x", row_format_of("tif", None), SIZE) as file:
        file.begin()
        black = picture._replace(rgba=np.full_like(picture.rgba, 0xFF000000))
        file.write_rows(0, black)
        assert file.is_black
        black.rgba[3, 4] += 1
        file.write_rows(0, black)
        assert not file.is_black


# --- whole or not at all: the system's disk is one that is full, or takes a little at a time ----------------


def test_a_disk_without_room_is_told_before_anything_is_written(tmp_path, picture, monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: SimpleNamespace(free=1000))
    with pytest.raises(rz.OutputError, match=r"x\.tif: it takes 3\.\d*e-06 GB, and 1e-06 GB are free"):
        draw_file(tmp_path / "x.tif", picture)
    assert os.listdir(tmp_path) == []


@pytest.mark.skipif(not hasattr(os, "pwrite"), reason="a system that writes in another way")
def test_a_disk_that_fills_up_leaves_nothing(tmp_path, picture, monkeypatch):
    (tmp_path / "x.tif").write_bytes(b"before")
    real = os.pwrite

    def fill_up(descriptor, content, offset):
        if offset > 1000:
            raise OSError(28, "No space left on device")
        return real(descriptor, content[:100], offset)

    monkeypatch.setattr(os, "pwrite", fill_up)
    with pytest.raises(rz.OutputError, match=r"can't write .*x\.tif: No space left"):
        draw_file(tmp_path / "x.tif", picture)
    assert os.listdir(tmp_path) == ["x.tif"] and (tmp_path / "x.tif").read_bytes() == b"before"


@pytest.mark.skipif(not hasattr(os, "pwrite"), reason="a system that writes in another way")
def test_a_system_may_write_less_than_it_is_given(tmp_path, monkeypatch):
    real, content = os.pwrite, np.arange(1000, dtype=np.uint16)
    monkeypatch.setattr(os, "pwrite", lambda descriptor, rest, offset: real(descriptor, rest[:77], offset))
    for has_pwrite in (True, False):
        if not has_pwrite:
            monkeypatch.delattr(os, "pwrite")
        with HiddenFile(str(tmp_path / "x")) as file:
            file.create()
            file.write_at(6, content)
            file.write_at(0, b"before")
            file.move()
        assert (tmp_path / "x").read_bytes() == b"before" + content.tobytes()


@pytest.mark.skipif(os.name != "posix", reason="permissions and links of POSIX")
def test_links_modes_and_protection_are_kept(tmp_path, picture):
    path = tmp_path / "x.tif"
    path.write_bytes(b"before")
    path.chmod(0o640)
    (tmp_path / "link.tif").symlink_to(path)
    draw_file(tmp_path / "link.tif", picture)
    assert (tmp_path / "link.tif").is_symlink() and stat.S_IMODE(path.stat().st_mode) == 0o640
    content = expected_bytes(picture, "tif", None)
    with RowFile(path, row_format_of("tif", None), SIZE) as file:  # what an interrupt leaves before it is moved
        file.begin()
    path.chmod(0o400)
    with pytest.raises(rz.OutputError, match="protected against writing"):
        draw_file(path, picture)
    assert path.read_bytes() == content and sorted(os.listdir(tmp_path)) == ["link.tif", "x.tif"]
    with pytest.raises(rz.OutputError, match="there is no folder .*missing"):
        draw_file(tmp_path / "missing" / "x.tif", picture)


# --- TIFF ---------------------------------------------------------------------------------------------------

OFFSETS, ORIENTATION, ROWS, LENGTHS, ALPHA, PROFILE = 273, 274, 278, 279, 338, 34675
CLASSIC, BIG = b"II\x2a\0", b"II\x2b\0"


@pytest.mark.parametrize("is_big", [False, True])
def test_pillow_reads_what_was_written(is_big):
    for shape in ((1, 1), (48, 64), (300, 2000), (1, 65536), (65536, 1)):
        pixels = np.random.default_rng(1).integers(0, 256, (*shape, 4), np.uint8)
        content = tiff_header(shape[1], shape[0], is_big) + pixels.tobytes()
        assert content.startswith(BIG if is_big else CLASSIC), shape
        image = Image.open(io.BytesIO(content))
        tags = dict(image.tag_v2)
        assert image.mode == "RGBA", f"{shape}: Pillow calls it {image.mode}"
        assert np.array_equal(np.asarray(image), pixels), f"{shape}: other pixels are read"
    assert tags[ALPHA] == (2,), "alpha must be unassociated: colours are not multiplied by it"
    assert tags[ORIENTATION] == 1, "row 0 is the top, column 0 the left"
    assert (tags[282], tags[283], tags[296]) == (1, 1, 1), "pixels are squares of no known size"
    assert tags[PROFILE] == srgb_profile() == image.info["icc_profile"]
    assert (tags[258], tags[259], tags[262], tags[277], tags[284]) == ((8, 8, 8, 8), 1, 2, 4, 1)


def test_strips_hold_the_rows_one_after_the_other(monkeypatch):
    """So bands of the picture may be written in any order. A file of four GiB is a BigTIFF."""
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", None)  # Pillow's guard, for sizes that are never read
    for size, magic in (
        ((1, 1), CLASSIC), ((640, 480), CLASSIC), ((2000, 700), CLASSIC), ((2**18, 5), CLASSIC),
        ((30000, 30000), CLASSIC), ((2**18, 4091), CLASSIC), ((2**15, 2**15), BIG), ((2**18, 4096), BIG),
    ):  # fmt: skip
        header = tiff_header(*size)
        tags, row_bytes = Image.open(io.BytesIO(header)).tag_v2, 4 * size[0]
        offsets, lengths = tags[OFFSETS], tags[LENGTHS]
        assert header.startswith(magic) and (magic == BIG or len(header) + row_bytes * size[1] < 2**32), size
        assert offsets[0] == len(header), f"{size}: {offsets[0]} != {len(header)}"
        assert len(header) % 16 == 0, f"{size}: {len(header) % 16} != 0"
        assert all(a + n == b for a, n, b in zip(offsets[:-1], lengths[:-1], offsets[1:], strict=True)), size
        assert sum(lengths) == row_bytes * size[1], f"{size}: {sum(lengths)} != {row_bytes * size[1]}"
        assert set(lengths[:-1]) <= {tags[ROWS] * row_bytes}, size
        assert max(lengths) <= max(2**20, row_bytes), f"{size}: a reader holds a strip in memory"
        assert (tags[256], tags[257]) == size, f"{size}: {(tags[256], tags[257])} != {size}"
        assert tags[ROWS] <= size[1], size


@pytest.mark.skipif(not features.check("littlecms2"), reason="Pillow without LittleCMS")
def test_the_profile_is_that_of_srgb():
    """LittleCMS takes it, and finds the colours that its own profile of sRGB has."""
    from PIL import ImageCms

    ours = ImageCms.ImageCmsProfile(io.BytesIO(srgb_profile()))
    assert ImageCms.getProfileDescription(ours).strip() == "sRGB"
    ramp = np.zeros((256, 4, 3), np.uint8)
    for channel in range(4):
        ramp[:, channel, [channel] if channel < 3 else [0, 1, 2]] = np.arange(256)[:, None]
    shown = ImageCms.profileToProfile(Image.fromarray(ramp), ours, ImageCms.createProfile("sRGB"))
    error = np.abs(np.asarray(shown).astype(int) - ramp).max()
    assert error <= 1, f"colours move by {error} > 1 level"
