"""What each event does to the camera, in degrees, pixels and factors; and to what is said."""

import numpy as np
import pytest

import rasterizer as rz
from rasterizer.viewer.controls import Click, Drag, Key, State, Switch, Zoom, apply, home_camera
from rasterizer.viewer.orbit import Orbit

SIZE = (80, 60)
SCENE = rz.Scene(rz.Mesh([[x, y, z] for x in (0, 1) for y in (0, 2) for z in (0, 3)], [[0, 1, 3], [4, 6, 7]]))
HOME = home_camera(SCENE, SIZE)  # azimuth 35, elevation 25
FIRST = State(None, "phong", "own")


def after(*events, state=FIRST) -> State:
    for event in events:
        state, aim = apply(event, state, SCENE, HOME, SIZE)
        assert aim is None
    return state


def test_drags_and_keys_turn_by_so_many_degrees():
    for event, azimuth, elevation in (
        (Drag("rotate", 10.0, 0.0), -30, 0),  # 180 degrees over the height, to where the pointer pulls the model
        (Drag("rotate", 0.0, 5.0), 0, 15),
        (Key("ArrowLeft", False), -5, 0),
        (Key("ArrowRight", False), 5, 0),
        (Key("ArrowUp", False), 0, 5),
        (Key("ArrowDown", False), 0, -5),
    ):
        axes = after(event).orbit.camera.view()[1:]
        expected = rz.Camera.framing(SCENE, 35 + azimuth, 25 + elevation, aspect=4 / 3).view()[1:]
        assert np.allclose(axes, expected, atol=1e-12), event


def test_drags_and_keys_move_by_so_many_pixels_and_zoom_by_so_much():
    for event, moved in (
        (Drag("pan", 7.0, -4.0), (7, -4)),
        (Key("ArrowLeft", True), (3, 0)),
        (Key("ArrowRight", True), (-3, 0)),
        (Key("ArrowUp", True), (0, 3)),
        (Key("ArrowDown", True), (0, -3)),
    ):
        orbit, first = after(event).orbit, Orbit.of(HOME, SCENE)
        found = np.subtract(orbit.position_of(first.pivot, SIZE), first.position_of(first.pivot, SIZE))
        assert found == pytest.approx(moved, abs=1e-9), f"{event}: {found}"
    for event, factor in (
        (Drag("zoom", 0.0, -20.0), 2.0),  # 8 over the height
        (Drag("zoom", 0.0, 1e5), 8.0**-4),
        (Key("+", False), 1.25),
        (Key("=", False), 1.25),
        (Key("-", False), 0.8),
        (Key("_", False), 0.8),
        (Zoom(3.0, 40.0, 30.0), 3.0),
    ):
        found = Orbit.of(HOME, SCENE).distance / after(event).orbit.distance
        assert found == pytest.approx(factor), f"{event}: {found}"


def test_keys_show_named_views_in_the_projection_that_is_chosen():
    views = {"1": "front", "2": "back", "3": "left", "4": "right", "5": "top", "6": "bottom", "7": "iso"}
    for key, name in views.items():
        state = after(Key("ArrowUp", False), Zoom(9.0, 1.0, 1.0), Key(key, False))
        angles = rz.choices.VIEWS[name]
        assert state.orbit.camera == rz.Camera.framing(SCENE, *angles, aspect=4 / 3) and state.said == f"view: {name}"
        flat = after(Key("o", False), Key(key, False)).orbit.camera
        assert flat == rz.Camera.framing(SCENE, *angles, orthographic=True, aspect=4 / 3), name
    for key in ("0", "Home"):
        assert after(Drag("rotate", 5.0, 5.0), Key(key, False)) == FIRST._replace(said="view: as at first"), key


def test_clicks_and_keys_aim():
    for event, aim in (
        (Click(5.0, 6.0, False), (5, 6, False)),
        (Click(5.0, 6.0, True), (5, 6, True)),
        (Key("Enter", False), (40, 30, False)),
        (Key(" ", True), (40, 30, True)),
    ):
        assert (got := apply(event, FIRST, SCENE, HOME, SIZE)) == (FIRST, aim), f"{event}: {got} != {(FIRST, aim)}"


def test_what_means_nothing_does_nothing():
    state = after(Drag("rotate", 5.0, 5.0))
    for event in (Key("q", False), Key("é", True), Switch("shading", "wood"), Switch("__class__", "x")):
        assert (got := after(event, state=state)) == state, f"{event}: {got} != {state}"
