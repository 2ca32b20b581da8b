"""Moving pictures: what goes in comes out of every format, at its times, and a turntable keeps its distance."""

import io

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.raster import ROOT
from PIL import Image, ImageSequence

import rasterizer as rz

CUBE = str(ROOT / "models" / "cube.obj")
SIZE = (24, 16)


@pytest.fixture(scope="module")
def animation():
    return rz.turntable(CUBE, SIZE, 6, seconds=1.2, threads=1)


def frames_of(content) -> tuple[list, int]:
    """The pictures of a file, RGBA, and how long all of them take, in milliseconds."""
    image = Image.open(io.BytesIO(content))
    frames, time = [], 0
    for frame in ImageSequence.Iterator(image):
        frames.append(np.asarray(frame.convert("RGBA")))
        time += frame.info["duration"]
    return frames, round(time)


def test_a_cell_shows_every_frame_as_it_was_drawn(animation):
    frames, time = frames_of(animation._repr_png_())
    assert len(frames) == len(animation) == 6 and time == 1200
    for shown, drawn in zip(frames, animation.frames, strict=True):
        assert not differences(shown[drawn[..., 3] > 0], drawn[drawn[..., 3] > 0])
        assert not differences(shown[..., 3], drawn[..., 3])


def test_other_formats_are_chosen_by_name(animation):
    for name in ("gif", ".WebP", "apng"):
        frames, time = frames_of(animation.encode(name))
        assert (len(frames), time) == (6, 1200), f"{name}: {len(frames)} frames, {time} ms"


def test_a_turntable_goes_round_once_at_one_distance(animation):
    scene = rz.load(CUBE)
    cameras = rz.Camera.orbit(scene, 6, size=SIZE)
    with rz.Renderer(scene, SIZE, outputs="rgb", threads=1) as renderer:
        for camera, frame in zip(cameras, animation.frames, strict=True):
            assert not differences(renderer.render(camera).rgba, frame)


def test_frames_and_arrays_make_an_animation_that_is_saved(folder):
    frame = rz.render(CUBE, SIZE, threads=1)
    animation = rz.Animation(iter([frame, frame.rgba]), seconds=1, loop=2)
    assert repr(animation) == "<Animation 24x16, 2 frames, 1 s>"
    assert animation.save("x.gif").read_bytes() == animation.encode()


def test_what_is_no_animation_is_told():
    frame = [np.zeros((2, 2, 4), np.uint8)]
    for number, make in enumerate((
        lambda: rz.Animation([]),
        lambda: rz.Animation(3),
        lambda: rz.Animation([np.zeros((2, 2, 3), np.uint8)]),
        lambda: rz.Animation([np.zeros((0, 2, 4), np.uint8)]),
        lambda: rz.Animation([np.zeros((k, 2, 4), np.uint8) for k in (1, 2)]),
        lambda: rz.Animation(frame, seconds=0),
        lambda: rz.Animation(frame, loop=-1),
        lambda: rz.Animation(frame).encode("obj"),
        lambda: rz.Animation(frame).encode(""),
        lambda: rz.Animation(frame).save(3),
        lambda: rz.turntable(CUBE, n_frame=0),
        lambda: rz.turntable(CUBE, outputs="depth"),
        lambda: rz.turntable(CUBE, camera="top"),
        lambda: rz.turntable(CUBE, camera=rz.Camera.look_at((0, 0, 5)), fov=40),
    )):  # fmt: skip
        with pytest.raises(rz.SceneError):
            pytest.fail(f"number {number} is taken: {make()}")
