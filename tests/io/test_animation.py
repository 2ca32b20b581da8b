"""Moving pictures in every format: what is written comes back, and what can't be written is refused."""

import io
import sys

import numpy as np
import pytest
from helpers.arrays import differences
from PIL import Image

import rasterizer as rz
from rasterizer.io.animation import FORMATS, Timing, animation_format, encode_animation


def disc(k, size=(41, 31), color=(200, 90, 20)):
    """A disc (h, w, 4) uint8 that moves from frame to frame; transparent outside."""
    width, height = size
    y, x = np.mgrid[:height, :width]
    frame = np.zeros((height, width, 4), np.uint8)
    frame[(x - 10 - 3 * k) ** 2 + (y - 15) ** 2 < 64] = (*color, 255)
    frame[..., 1] += (frame[..., 3] > 0) * (x % 9).astype(np.uint8)
    return frame


FRAMES = [disc(k) for k in range(5)]


def decoded(data):
    """The frames of a file as viewers show them, (n, h, w, 4) int, the seconds of each, and the file."""
    image, frames, seconds = Image.open(io.BytesIO(data)), [], []
    for k in range(image.n_frames):
        image.seek(k)
        frames.append(np.asarray(image.convert("RGBA")).astype(int))
        seconds.append(image.info["duration"] / 1000)
    return np.array(frames), seconds, image


def assert_same(found, frames, most=0, what=""):
    is_covered = np.array(frames)[..., 3] >= 128
    assert ((found[..., 3] >= 128) == is_covered).all(), f"{what}: other pixels are covered"
    off = np.abs(found - frames)[..., :3][is_covered].max()
    assert off <= most, f"{what}: off by {off} > {most} levels"


def test_pictures_come_back():
    for suffix in (".gif", ".webp", ".png", ".apng"):
        found, seconds, image = decoded(encode_animation(FRAMES, suffix, Timing(1.0)))
        assert image.size == (41, 31), f"{suffix}: {image.size} != {(41, 31)}"
        assert image.is_animated, suffix
        assert sum(seconds) == pytest.approx(1.0), f"{suffix}: {sum(seconds)} != {pytest.approx(1.0)}"
        assert image.info["loop"] == 0, suffix
        assert_same(found, FRAMES, 40 if suffix == ".webp" else 0, suffix)


def test_videos_come_back():
    av = pytest.importorskip("av", reason="the extra video is not installed")
    opaque = [np.dstack([frame[..., :3], np.full((31, 41), 255, np.uint8)]) for frame in FRAMES]
    for suffix in (".mp4", ".mov", ".mkv"):
        data = encode_animation(opaque, suffix, Timing(1.0, loop=2))
        with av.open(io.BytesIO(data)) as container:
            found = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
            seconds = float(container.duration) / av.time_base
        assert len(found) == 2 * len(FRAMES), f"{suffix}: {len(found)} frames in two rounds of {len(FRAMES)}"
        assert found[0].shape == (32, 42, 3), f"{suffix}: {found[0].shape}, though sides are made even"
        assert abs(seconds - 2.0) < 0.05, f"{suffix}: {seconds} s, not 2"
        pairs = zip(found[:5], opaque, strict=True)
        off = max(np.abs(a[:31, :41].astype(float) - b[..., :3]).mean() for a, b in pairs)
        assert off < 6.0, f"{suffix} is off by {off:.2f} > 6 levels"


def test_times_add_up():
    for seconds, n in ((1.0, 7), (3.0, 36), (0.5, 24)):
        delays = Timing(seconds).delays(n, 0.01)
        assert sum(delays) == round(100 * seconds) and max(delays) - min(delays) <= 1


def test_what_cannot_be_written_is_refused(monkeypatch):
    with pytest.raises(rz.SceneError, match=r"written as \.gif, \.webp, .*given \.jpg"):
        animation_format(".jpg")
    with pytest.raises(rz.SceneError, match="has no suffix"):
        animation_format("")
    with pytest.raises(rz.SceneError, match=r"a .gif file shows at most 50 frames a second; given 5 in 0\.01 s"):
        encode_animation(FRAMES, ".gif", Timing(0.01))
    with pytest.raises(rz.SceneError, match="at least one frame"):
        encode_animation([], ".gif", Timing(1.0))
    with pytest.raises(rz.SceneError, match="at most 16383 pixels a side; given 16384x1"):
        encode_animation([np.zeros((1, 16384, 4), np.uint8)], ".webp", Timing(1.0))
    huge = [np.broadcast_to(np.zeros(4, np.uint8), (16383, 16383, 4))] * 4
    with pytest.raises(rz.SceneError, match=r"4 frames of 16383x16383 take 4\.3 GB of memory as WEBP, more than 4; "):
        encode_animation(huge, ".webp", Timing(1.0))
    assert {suffix for suffix, each in FORMATS.items() if not each.has_alpha} == {".mp4", ".mov", ".mkv"}
    monkeypatch.setitem(sys.modules, "av", None)  # the extra is not installed
    with pytest.raises(rz.OutputError, match=r"needs av: pip install .*\[video\]'"):
        animation_format(".mp4")


# --- GIF ----------------------------------------------------------------------------------------------------


def encoded(frames, loop=0, seconds=1.0):
    return encode_animation(frames, ".gif", Timing(seconds, loop))


@pytest.mark.parametrize("is_opaque", [False, True])
def test_few_colours_are_kept_exactly_frame_by_frame(is_opaque):
    """What stood in the frame before is not shown, nor what is less than half covered; a file says how many rounds
    come after the first one."""
    frames = [disc(0), disc(6), np.zeros_like(disc(0)), disc(0), disc(1)]
    frames[0][0, 0], frames[0][0, 1] = (1, 2, 3, 128), (1, 2, 3, 127)
    if is_opaque:
        for frame in frames:
            frame[frame[..., 3] < 128] = (10, 20, 30, 255)
    found, seconds, image = decoded(encoded(frames, seconds=0.28))
    assert_same(found, frames)
    assert seconds == [0.06, 0.05, 0.06, 0.05, 0.06] and image.size == (41, 31)
    for loop, written in ((0, 0), (1, None), (2, 1), (9, 8)):
        assert decoded(encoded(frames, loop))[2].info.get("loop") == written, loop


def test_frames_that_are_alike_take_their_time():
    found, seconds, _ = decoded(encoded([disc(0), disc(0), disc(0), disc(3)], seconds=0.4))
    assert sum(seconds) == pytest.approx(0.4) and not differences(found[0], disc(0) * (disc(0)[..., 3:] > 0))


@pytest.mark.parametrize(("step", "most"), [(8, 24), (1, 40)])
def test_many_colours_become_near_ones(step, most):
    """Of a smooth picture: a palette of 255 out of some hundreds and of 10 000."""
    y, x = np.mgrid[:100, :100] * 2
    whole = np.stack([x, y, (x + y) // 2, np.full_like(x, 255)], axis=2).astype(np.uint8)
    whole[..., :3] = whole[..., :3] // step * step
    frames = [whole, whole[::-1].copy(), whole]
    found, _, _ = decoded(encoded(frames))
    assert_same(found, frames, most)
    assert len(np.unique(found.reshape(-1, 4), axis=0)) > 250
    assert not differences(found[0], found[2])
