"""Files that are written band by band: any order, any thread, whole or not at all."""

import io
import os
import shutil
import stat
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import rasterizer as rz
from rasterizer.io.files import HiddenFile
from rasterizer.io.row_files import RowFile, npy_header, row_format_of
from rasterizer.io.tiff import encode_tiff
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


def write_bands(file, picture, starts, n_row):
    """Hand the rows of a picture to a file, four threads at a time."""
    with ThreadPoolExecutor(4) as pool:
        bands = [(y, Picture(*(part[y : y + n_row] for part in picture))) for y in starts]
        list(pool.map(lambda band: file.write_rows(*band), bands))


KINDS = [("tif", None), ("tiff", None), ("npy", None), *(("npy", name) for name in ("color", "rgb", "rgba", "alpha"))]


@pytest.mark.parametrize(("format", "array"), KINDS)
def test_bands_in_any_order_make_the_file_of_the_whole(tmp_path, picture, format, array):
    with RowFile(tmp_path / "x", row_format_of(format, array), SIZE) as file:
        file.begin()
        write_bands(file, picture, [15, 0, 10, 5], 5)
        assert not (tmp_path / "x").exists(), "the file must not be seen before it is whole"
        file.move()
    content = expected_bytes(picture, format, array)
    assert (tmp_path / "x").read_bytes() == content and file.n_byte == len(content)
    assert os.listdir(tmp_path) == ["x"]


def test_alpha_comes_from_the_bytes_where_there_is_no_other(tmp_path, picture):
    picture = picture._replace(color=picture.color[:0], alpha=picture.alpha[:0])
    with RowFile(tmp_path / "x", row_format_of("npy", "alpha"), SIZE) as file:
        file.begin()
        file.write_rows(0, picture)
        file.move()
    alpha = (picture.rgba >> 24).astype(np.uint8) / np.float32(255)  # as Frame.alpha
    assert np.array_equal(np.load(tmp_path / "x"), alpha)


@pytest.mark.parametrize(
    ("format", "array"), [("png", None), ("npy", "depth"), ("tif", "color"), ("", None), ("npy", "x")]
)
def test_other_formats_have_no_place_for_rows(format, array):
    assert row_format_of(format, array) is None


@pytest.mark.parametrize("shape", [(1, 1), (480, 640, 3), (65536, 65536, 4), (7, 2**18)])
def test_the_header_of_an_array_is_that_of_numpy(shape):
    header = npy_header(np.float32, shape)
    stream = io.BytesIO(header)
    assert np.lib.format.read_magic(stream) == (1, 0) and len(header) % 64 == 0
    assert np.lib.format.read_array_header_1_0(stream) == (shape, False, np.dtype(np.float32))


def test_only_black_pixels_are_noticed(tmp_path, picture):
    with RowFile(tmp_path / "x", row_format_of("tif", None), SIZE) as file:
        file.begin()
        black = picture._replace(rgba=np.full_like(picture.rgba, 0xFF000000))
        file.write_rows(0, black)
        assert file.is_black
        black.rgba[3, 4] += 1
        file.write_rows(0, black)
        assert not file.is_black


# --- whole or not at all ------------------------------------------------------------------------------------


def draw_file(path, picture):
    """Write a TIFF file of a picture."""
    with RowFile(path, row_format_of("tif", None), SIZE) as file:
        file.begin()
        file.write_rows(0, picture)
        file.move()


def test_a_disk_without_room_is_told_before_anything_is_written(tmp_path, picture, monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: shutil._ntuple_diskusage(10**6, 10**6, 1000))
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
        return real(descriptor, content[:100], offset)  # a little at a time

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


@pytest.mark.parametrize("fault", [KeyboardInterrupt(), ValueError("x")])
def test_an_interrupt_leaves_nothing(tmp_path, picture, fault, monkeypatch):
    def fail(*_):
        raise fault

    monkeypatch.setattr(RowFile, "move", fail)
    with pytest.raises(type(fault)):
        draw_file(tmp_path / "x.tif", picture)
    assert os.listdir(tmp_path) == []


@pytest.mark.skipif(os.name != "posix", reason="permissions and links of POSIX")
def test_modes_protection_and_links(tmp_path, picture):
    path = tmp_path / "x.tif"
    path.write_bytes(b"before")
    path.chmod(0o640)
    (tmp_path / "link.tif").symlink_to(path)
    draw_file(tmp_path / "link.tif", picture)
    assert (tmp_path / "link.tif").is_symlink() and stat.S_IMODE(path.stat().st_mode) == 0o640
    content = path.read_bytes()
    assert content == expected_bytes(picture, "tif", None)
    path.chmod(0o400)
    with pytest.raises(rz.OutputError, match="protected against writing"):
        draw_file(path, picture)
    assert path.read_bytes() == content and sorted(os.listdir(tmp_path)) == ["link.tif", "x.tif"]


def test_a_folder_that_is_not_there(tmp_path, picture):
    with pytest.raises(rz.OutputError, match="there is no folder .*missing"):
        draw_file(tmp_path / "missing" / "x.tif", picture)
