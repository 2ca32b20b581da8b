"""Messages come from outside: what is no message is refused with what is wrong, and nothing else happens."""

from hypothesis import given, settings
from hypothesis import strategies as st

import rasterizer as rz
from rasterizer.viewer.controls import MAX_EVENTS, Click, Drag, Key, Switch, Zoom, read_message

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
