"""Pictures that memory can't hold are refused, with what to do."""

import pytest

import rasterizer as rz
from rasterizer.engine import prepared
from rasterizer.errors import SceneError
from rasterizer.options import Options

SIZE = (61, 43)
TRIANGLE = rz.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
CASES = [
    ({"outputs": "rgb"}, 4), ({"outputs": "color"}, 20), ({"outputs": ("color", "rgb")}, 20), ({"outputs": "depth"}, 4),
    ({"outputs": ("rgb", "depth", "face", "normal")}, 24), ({"outputs": "rgb", "color_range": "global"}, 20),
]  # fmt: skip


@pytest.fixture
def machine(monkeypatch, tmp_path):
    """A function that sets what the system tells of its memory: files that stand outside of the package."""
    info, limit = tmp_path / "info", tmp_path / "limit"
    monkeypatch.setattr(prepared, "MEMORY_INFO", str(info))
    monkeypatch.setattr(prepared, "MEMORY_LIMIT", str(limit))

    def tell(n_kilobyte, most="max"):
        info.write_text(f"MemTotal:  900 kB\nMemFree:  100 kB\nMemAvailable:  {n_kilobyte} kB\n")
        limit.write_text(f"{most}\n")

    return tell


def test_bytes_of_a_pixel_are_those_of_the_frames_arrays():
    for options, n_byte in CASES:
        found = prepared.count_pixel_bytes(Options(**options), False)
        assert found == n_byte, f"{options}: {found} != {n_byte}"
        frame = rz.render(TRIANGLE, SIZE, **{"samples": 1} | options)
        names = [name for name in ("rgba", "color", "depth", "face", "normal") if name == "rgba" or frame.has(name)]
        held = sum(frame.array(name).nbytes for name in names if name != "rgba" or frame.has("rgb"))
        held += frame.alpha.nbytes if frame.has("color") else 0
        is_drawn_first = options.get("color_range") == "global"  # linear colours, which the frame doesn't keep
        assert held == SIZE[0] * SIZE[1] * (4 if is_drawn_first else n_byte), f"{options}: {held} bytes"


def test_a_picture_that_memory_does_not_hold_is_refused(machine):
    side = 8500  # 289 MB: less is always there
    machine(4 * side * side // 1024 - 1)
    words = (
        rf"of {side}x{side} pixels takes 0.289 GB in memory, and 0.289 GB are there: "
        "draw a smaller one"
    )
    with pytest.raises(SceneError, match=words):
        rz.render(TRIANGLE, side, outputs="rgb", samples=1)
    with pytest.raises(SceneError, match="takes 0.289 GB"):
        rz.render(TRIANGLE, side, outputs="depth", samples=1)
    options = Options(size=side, outputs="rgb")
    prepared.check_memory(options, has_out=True)  # room that the caller brings isn't asked for
    machine(4 * side * side // 1024 + 1)
    prepared.check_memory(options, has_out=False)
    machine(10)
    rz.render(TRIANGLE, SIZE, samples=1)


def test_what_the_system_tells(machine):
    whole = prepared.available_memory()
    assert whole is None or whole > 2**26, "without the files, all that the machine has"
    for most, expected in (("max", 800 * 1024), ("4096", 4096), ("99999999", 800 * 1024)):
        machine(800, most)
        assert prepared.available_memory() == expected, f"a limit of {most}"
