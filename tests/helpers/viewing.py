"""Messages of the viewer's page, as a browser sends them: help for the viewer's tests."""

from rasterizer.viewer.session import Session

SIZE = (80, 60)


def message(*events, is_rest=False, size=SIZE, background="#ffffff") -> dict:
    return {"size": list(size), "background": background, "is_rest": is_rest, "events": list(events)}


def drag(dx, dy, action="rotate") -> dict:
    return {"type": "drag", "action": action, "dx": dx, "dy": dy}


def key(name, is_shift=False) -> dict:
    return {"type": "key", "key": name, "is_shift": is_shift}


def click(x, y, is_double=False) -> dict:
    return {"type": "click", "x": x, "y": y, "is_double": is_double}


def switch(name, value) -> dict:
    return {"type": "switch", "name": name, "value": value}


def zoom(factor, x=40, y=30) -> dict:
    return {"type": "zoom", "factor": factor, "x": x, "y": y}


def rest(session: Session, *events, **settings):
    """The answer at rest, after some events."""
    return session.answer(message(*events, is_rest=True, **settings))
