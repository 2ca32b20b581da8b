"""GIF files: colours of all frames in one palette, what is transparent, and what changes from frame to frame."""

import io

import numpy as np
import pytest
from PIL import Image

from rasterizer.io.gif import Palette, encode_gif


def disc(k, size=(40, 30), color=(200, 90, 20)):
    """A disc (h, w, 4) uint8 that moves from frame to frame; transparent outside."""
    width, height = size
    y, x = np.mgrid[:height, :width]
    frame = np.zeros((height, width, 4), np.uint8)
    frame[(x - 10 - 3 * k) ** 2 + (y - 15) ** 2 < 64] = (*color, 255)
    return frame


def decoded(data):
    """The frames of a file as viewers show them, (h, w, 4) uint8 each, and the seconds of each."""
    image, frames, seconds = Image.open(io.BytesIO(data)), [], []
    for k in range(image.n_frames):
        image.seek(k)
        frames.append(np.asarray(image.convert("RGBA")))
        seconds.append(image.info["duration"] / 1000)
    return frames, seconds, image


def encoded(frames, loop=0, delays=None):
    return b"".join(encode_gif(frames, Palette(frames), delays or [4] * len(frames), loop=loop))


def assert_same(found, frames, most=0):
    for k, (a, b) in enumerate(zip(found, frames, strict=True)):
        is_covered = b[..., 3] >= 128
        assert ((a[..., 3] == 255) == is_covered).all(), f"frame {k}"
        difference = np.abs(a[..., :3].astype(int) - b[..., :3])[is_covered].max(initial=0)
        assert difference <= most, f"frame {k}: {difference} > {most} levels"


@pytest.mark.parametrize("is_opaque", [False, True])
def test_few_colours_are_kept_exactly(is_opaque):
    rng = np.random.default_rng(3)
    frames = [disc(k) for k in range(8)]
    frames.insert(4, np.zeros_like(frames[0]))  # nothing is seen
    for frame in frames:
        frame[:, :20, :3] += rng.integers(0, 9, (30, 20, 1), np.uint8) * (frame[:, :20, 3:] > 0)
        if is_opaque:
            frame[frame[..., 3] == 0] = (10, 20, 30, 255)
    found, seconds, image = decoded(encoded(frames, delays=[4, 5, 6, 4, 4, 4, 4, 4, 9]))
    assert_same(found, frames)
    assert seconds[:3] == [0.04, 0.05, 0.06] and seconds[-1] == 0.09 and image.size == (40, 30)


def test_a_frame_does_not_show_what_stood_in_the_one_before():
    frames = [disc(0), disc(6), disc(0)]
    found, _, _ = decoded(encoded(frames))
    assert_same(found, frames)
    assert not (found[1][..., 3].astype(bool) & (frames[0][..., 3] > 0)).any()


def test_pixels_that_are_half_covered_count():
    frame = disc(0)
    frame[0, 0], frame[0, 1] = (1, 2, 3, 128), (1, 2, 3, 127)
    found, _, _ = decoded(encoded([frame]))
    assert found[0][0, 0].tolist() == [1, 2, 3, 255] and found[0][0, 1, 3] == 0


@pytest.mark.parametrize(("step", "most"), [(8, 24), (1, 40)])
def test_many_colours_become_near_ones(step, most):
    """Of a smooth picture: a palette of 255 out of some hundreds and of 40 000; each colour has one index in all
    frames."""
    y, x = np.mgrid[:200, :200]
    whole = np.stack([x, y, (x + y) // 2, np.full_like(x, 255)], axis=2).astype(np.uint8)
    whole[..., :3] = whole[..., :3] // step * step
    frames = [whole, whole[::-1].copy(), whole]
    palette = Palette(frames)
    assert len(palette.colors) == 255
    found, _, _ = decoded(b"".join(encode_gif(frames, palette, [4] * 3)))
    assert_same(found, frames, most)
    assert (found[0] == found[2]).all() and (found[0] == found[1][::-1]).all()


@pytest.mark.parametrize(("loop", "written"), [(0, 0), (1, None), (2, 1), (9, 8)])
def test_rounds_are_counted_as_viewers_do(loop, written):
    """A file says how many rounds come after the first one."""
    assert decoded(encoded([disc(0), disc(1)], loop))[2].info.get("loop") == written
