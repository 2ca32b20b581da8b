"""Messages come from outside: what is no message is refused with what is wrong, and nothing else happens."""

import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import rasterizer as rz
from rasterizer.viewer.events import MOST_EVENTS, Click, Drag, Key, Switch, Zoom, read_message

MESSAGE = {"size": [80, 60], "background": "#ffffff", "is_rest": False, "events": []}
EVENTS = {
    Drag("pan", 3.0, -4.5): {"kind": "drag", "action": "pan", "dx": 3, "dy": -4.5},
    Zoom(1.5, 10.0, 20.0): {"kind": "zoom", "factor": 1.5, "x": 10, "y": 20},
    Key("ArrowUp", True): {"kind": "key", "key": "ArrowUp", "is_shift": True},
    Click(5.0, 6.0, False): {"kind": "click", "x": 5, "y": 6, "is_double": False},
    Switch("shading", "flat"): {"kind": "switch", "name": "shading", "value": "flat"},
}


def test_every_kind_of_event_is_read():
    message = read_message({**MESSAGE, "events": list(EVENTS.values())})
    assert message.events == tuple(EVENTS) and message.size == (80, 60) and not message.is_rest


@pytest.mark.parametrize(
    "change",
    [
        {"size": [0, 60]},
        {"size": [80.0, 60]},
        {"size": [True, 60]},
        {"size": [80]},
        {"size": "80x60"},
        {"size": [8192, 8192]},
        {"size": [10**400, 1]},
        {"background": "white"},
        {"background": "#ffffff\n"},
        {"background": None},
        {"is_rest": 1},
        {"events": None},
        {"events": [list(EVENTS.values())[0]] * (MOST_EVENTS + 1)},
        {"events": [None]},
        {"events": [{"kind": []}]},
        {"events": [{"kind": "fly"}]},
        {"more": 1},
    ],
    ids=str,
)
def test_what_is_no_message_is_refused(change):
    with pytest.raises(rz.SceneError):
        read_message({**MESSAGE, **change})


@pytest.mark.parametrize("name", ["size", "background", "is_rest", "events"])
def test_every_part_of_a_message_is_needed(name):
    with pytest.raises(rz.SceneError, match=name):
        read_message({key: value for key, value in MESSAGE.items() if key != name})


@pytest.mark.parametrize("event", EVENTS.values(), ids=lambda event: event["kind"])
@pytest.mark.parametrize("value", [None, "x" * 41, [], {}, True, 1e7, float("nan"), float("-inf"), 10**400], ids=repr)
def test_every_field_of_an_event_is_checked(event, value):
    if value == 10**400:
        value = int(value)
    for name in event:
        if name == "kind" or (value is True and isinstance(event[name], bool)):
            continue
        with pytest.raises(rz.SceneError):
            read_message({**MESSAGE, "events": [{**event, name: value}]})


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=8,
)


@given(JSON, st.sampled_from(sorted(MESSAGE)), JSON)
@settings(max_examples=60, deadline=None)
def test_any_json_is_read_or_refused(whole, name, part):
    for message in (whole, {**MESSAGE, name: part}, {**MESSAGE, "events": [part]}):
        try:
            read_message(message)
        except rz.SceneError as fault:
            assert len(str(fault)) < 300
    json.dumps(MESSAGE)
