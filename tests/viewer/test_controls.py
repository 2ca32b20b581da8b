"""What each event does to the camera, in degrees, pixels and factors; and to what is said."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import rasterizer as rz
from rasterizer.viewer.controls import (
    MAX_EVENTS,
    Click,
    Drag,
    Key,
    State,
    Switch,
    Zoom,
    apply,
    read_message,
)
from rasterizer.viewer.orbit import Orbit

SIZE = (80, 60)
SCENE = rz.Scene(rz.Mesh([[x, y, z] for x in (0, 1) for y in (0, 2) for z in (0, 3)], [[0, 1, 3], [4, 6, 7]]))
HOME = SCENE.camera_for(SIZE)  # azimuth 35, elevation 25
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


# ── messages of the page ───────────────────────────────────────────────────────────────────────────────────


MESSAGE = {"size": [80, 60], "background": "#ffffff", "is_rest": False, "events": []}
EVENTS = {
    Drag("pan", 3.0, -4.5): {"type": "drag", "action": "pan", "dx": 3, "dy": -4.5},
    Zoom(1.5, 10.0, 20.0): {"type": "zoom", "factor": 1.5, "x": 10, "y": 20},
    Key("ArrowUp", True): {"type": "key", "key": "ArrowUp", "is_shift": True},
    Click(5.0, 6.0, False): {"type": "click", "x": 5, "y": 6, "is_double": False},
    Switch("shading", "flat"): {"type": "switch", "name": "shading", "value": "flat"},
}


def test_every_type_of_event_is_read():
    message = read_message({**MESSAGE, "events": list(EVENTS.values())})
    assert message.events == tuple(EVENTS) and message.size == (80, 60) and not message.is_rest


def refuse(what, message, match=""):
    try:
        read_message(message)
    except rz.SceneError as fault:
        assert match in str(fault), f"{what}: {match!r} is not in {fault}"
    else:
        raise AssertionError(f"{what} is read as a message")


def test_what_is_no_message_is_refused():
    drag = next(iter(EVENTS.values()))
    for change in (
        {"size": [0, 60]}, {"size": [80.0, 60]}, {"size": [True, 60]}, {"size": [80]}, {"size": "80x60"},
        {"size": [8192, 8192]}, {"size": [10**400, 1]}, {"background": "white"}, {"background": "#ffffff\n"},
        {"background": None}, {"is_rest": 1}, {"events": None}, {"events": [drag] * (MAX_EVENTS + 1)},
        {"events": [None]}, {"events": [{"type": []}]}, {"events": [{"type": "fly"}]}, {"more": 1}, {"size": [1, 9000]},
        *({"events": [{"type": "zoom", "factor": factor, "x": 1, "y": 1}]} for factor in (0.009, 101, -1)),
    ):  # fmt: skip
        refuse(f"{change}"[:60], MESSAGE | change)
    for name in MESSAGE:
        refuse(f"what has no {name}", {key: value for key, value in MESSAGE.items() if key != name}, name)
    assert len(read_message(MESSAGE | {"events": [drag] * MAX_EVENTS}).events) == MAX_EVENTS


def test_every_field_of_an_event_is_checked():
    for event in EVENTS.values():
        for value in (None, "x" * 41, [], {}, True, 1e7, float("nan"), float("-inf"), 10**400):
            for name in event:
                if name != "type" and not (value is True and isinstance(event[name], bool)):
                    what = f"{event['type']} with {name} = {repr(value)[:45]}"
                    refuse(what, MESSAGE | {"events": [event | {name: value}]})
        for name in event:
            refuse(f"{event['type']} without {name}", MESSAGE | {"events": [{k: event[k] for k in event if k != name}]})


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=8,
)


@given(JSON, st.sampled_from(sorted(MESSAGE)), JSON)
@settings(max_examples=40, deadline=None)
def test_any_json_is_read_or_refused(whole, name, part):
    for message in (whole, {**MESSAGE, name: part}, {**MESSAGE, "events": [part]}):
        try:
            read_message(message)
        except rz.SceneError as fault:
            assert len(str(fault)) < 300
