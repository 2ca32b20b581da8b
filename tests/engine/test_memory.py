"""Pictures that memory can't hold are refused, with what to do."""

import pytest

import rasterizer as rz
from rasterizer.engine import memory
from rasterizer.errors import SceneError
from rasterizer.options import Options

SIZE = (61, 43)
TRIANGLE = rz.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
CASES = [
    ({"outputs": "rgb"}, 4), ({"outputs": "color"}, 20), ({"outputs": ("color", "rgb")}, 20), ({"outputs": "depth"}, 4),
    ({"outputs": ("rgb", "depth", "face", "normal")}, 24), ({"outputs": "rgb", "color_range": "global"}, 20),
]  # fmt: skip


@pytest.mark.parametrize(("options", "n_byte"), CASES)
def test_bytes_of_a_pixel_are_those_of_the_frames_arrays(options, n_byte):
    assert memory.count_pixel_bytes(Options(**options), False) == n_byte
    frame = rz.render(TRIANGLE, SIZE, **{"samples": 1} | options)
    names = [name for name in ("rgba", "color", "depth", "face", "normal") if name == "rgba" or frame.has(name)]
    held = sum(frame.array(name).nbytes for name in names if name != "rgba" or frame.has("rgb"))
    held += frame.alpha.nbytes if frame.has("color") else 0
    is_drawn_first = options.get("color_range") == "global"  # linear colours, which the frame doesn't keep
    assert held == SIZE[0] * SIZE[1] * (4 if is_drawn_first else n_byte)


@pytest.mark.parametrize(("options", "n_byte"), CASES)
def test_a_picture_that_memory_does_not_hold_is_refused(monkeypatch, options, n_byte):
    needed = n_byte * SIZE[0] * SIZE[1]
    monkeypatch.setattr(memory, "ALWAYS_THERE", 0)
    monkeypatch.setattr(memory, "available_memory", lambda: needed - 1)
    words = r"of 61x43 pixels takes .* GB in memory, and .* GB are there; .*Renderer\.render_to\('out\.tif'\)"
    with pytest.raises(SceneError, match=words):
        rz.render(TRIANGLE, SIZE, **{"samples": 1} | options)
    for there in (needed, None):
        monkeypatch.setattr(memory, "available_memory", lambda there=there: there)
        rz.render(TRIANGLE, SIZE, **{"samples": 1} | options)


def test_room_that_the_caller_brings_is_not_asked_for(monkeypatch):
    options = Options(size=SIZE, outputs="rgb")
    monkeypatch.setattr(memory, "ALWAYS_THERE", -1)
    monkeypatch.setattr(memory, "available_memory", lambda: 100)
    memory.check_memory(options, has_out=True)
    with pytest.raises(SceneError, match="GB in memory"):
        memory.check_memory(options, has_out=False)


def test_what_the_system_tells(monkeypatch, tmp_path):
    info, limit = tmp_path / "info", tmp_path / "limit"
    monkeypatch.setattr(memory, "MEMORY_INFO", str(info))
    monkeypatch.setattr(memory, "MEMORY_LIMIT", str(limit))
    whole = memory.available_memory()
    assert whole is None or whole > 2**26, "without the files, all that the machine has"
    info.write_text("MemTotal:  900 kB\nMemFree:  100 kB\nMemAvailable:  800 kB\n")
    assert memory.available_memory() == 800 * 1024
    for text, expected in (("max\n", 800 * 1024), ("4096\n", 4096), ("99999999\n", 800 * 1024)):
        limit.write_text(text)
        assert memory.available_memory() == expected
