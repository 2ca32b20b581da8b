"""Moving pictures in every format: what is written comes back, and what can't be written is refused."""

import io
import sys

import numpy as np
import pytest
from PIL import Image

import rasterizer as rz
from rasterizer.io.animation import FORMATS, Timing, animation_format, encode_animation

BALL = rz.Mesh(*[[[0, 0, 1], [1, 0, -0.5], [-1, 0, -0.5], [0, 1.5, 0]], [[0, 1, 3], [1, 2, 3], [2, 0, 3], [0, 2, 1]]])


@pytest.fixture(scope="module")
def frames():
    scene = rz.Scene(BALL)
    return [rz.render(scene, (61, 47), samples=4, threads=1).rgba, *_turned(scene)]


def _turned(scene):
    with rz.Renderer(scene, (61, 47), samples=4, threads=1) as renderer:
        return [renderer.render(rz.Camera.framing(scene, 60 * k)).rgba for k in range(1, 5)]


@pytest.mark.parametrize("suffix", [".gif", ".webp", ".png", ".apng"])
def test_pictures_come_back(suffix, frames):
    data = encode_animation(frames, suffix, Timing(1.0))
    image = Image.open(io.BytesIO(data))
    assert image.n_frames == len(frames) and image.size == (61, 47) and image.is_animated
    for k, frame in enumerate(frames):
        image.seek(k)
        found = np.asarray(image.convert("RGBA")).astype(int)
        is_inside = frame[..., 3] == 255
        assert ((found[..., 3] >= 128) == (frame[..., 3] >= 128)).all()
        off = np.abs(found - frame)[is_inside].mean()
        assert off <= (4.0 if suffix == ".webp" else 0.0), f"frame {k} is off by {off:.2f} levels"


@pytest.mark.parametrize("suffix", [".mp4", ".mov", ".mkv"])
def test_videos_come_back(suffix, frames):
    av = pytest.importorskip("av", reason="the extra video is not installed")
    opaque = [
        np.dstack([frame[..., :3] * (frame[..., 3:] == 255), np.full((47, 61), 255, np.uint8)]) for frame in frames
    ]
    data = encode_animation(opaque, suffix, Timing(1.0, loop=2))
    with av.open(io.BytesIO(data)) as container:
        found = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
        seconds = float(container.duration) / av.time_base
    assert len(found) == 2 * len(frames) and found[0].shape == (48, 62, 3)  # sides are made even
    assert seconds == pytest.approx(2.0, abs=0.05)
    off = max(np.abs(a[:47, :61].astype(float) - b[..., :3]).mean() for a, b in zip(found[:5], opaque, strict=True))
    assert off < 4.0, f"off by {off:.2f} > 4 levels"


def test_times_add_up():
    for seconds, n in ((1.0, 7), (3.0, 36), (0.5, 24)):
        delays = Timing(seconds).delays(n, 0.01)
        assert sum(delays) == round(100 * seconds) and max(delays) - min(delays) <= 1


def test_what_cannot_be_written_is_refused(frames, monkeypatch):
    with pytest.raises(rz.SceneError, match=r"written as \.gif, \.webp, .*given \.jpg"):
        animation_format(".jpg")
    with pytest.raises(rz.SceneError, match="has no suffix"):
        animation_format("")
    with pytest.raises(rz.SceneError, match="a .gif file shows at most 50 frames a second; given 5 in 0.01 s"):
        encode_animation(frames, ".gif", Timing(0.01))
    with pytest.raises(rz.SceneError, match="at least one frame"):
        encode_animation([], ".gif", Timing(1.0))
    with pytest.raises(rz.SceneError, match="at most 16383 pixels a side; given 16384x1"):
        encode_animation([np.zeros((1, 16384, 4), np.uint8)], ".webp", Timing(1.0))
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(rz.OutputError, match=r"need the package av: pip install '\.\[video\]'"):
        animation_format(".mp4")


def test_every_format_says_whether_it_has_alpha():
    assert {suffix for suffix, each in FORMATS.items() if not each.has_alpha} == {".mp4", ".mov", ".mkv"}
