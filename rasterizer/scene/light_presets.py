"""Ready-made lights: neutral, attached to the camera, so that every view of a model is lit alike."""

from .lights import AmbientLight, DirectionalLight, Light
from .shadow import Shadow, without_shadows


def studio() -> tuple[Light, ...]:
    """Return the default lights: key from the upper left, weaker fill from the right, rim from behind and
    above, low ambient.

    They move with the camera and are exactly neutral, so that a grey scene needs one channel. The intensities
    are chosen so that the default material stays below 1 whichever way a surface faces, highlight included.
    """
    return (
        AmbientLight(0.08),
        DirectionalLight((0.55, -0.65, -0.75), 0.85, "camera"),
        DirectionalLight((-0.85, -0.10, -0.50), 0.20, "camera"),
        DirectionalLight((0.15, -0.70, 0.70), 0.30, "camera"),
    )


def headlight() -> tuple[Light, ...]:
    """Return one directional light along the view and a low ambient, both neutral: nothing seen is dark."""
    return (AmbientLight(0.15), DirectionalLight((0.0, 0.0, -1.0), 0.80, "camera"))


def tabletop() -> tuple[Light, ...]:
    """Return the lights of `studio`, brighter for darker materials, with a key that casts shadows."""
    return (
        AmbientLight(0.08),
        DirectionalLight((0.55, -0.65, -0.75), 0.95, "camera", shadow=Shadow(1024, 5)),
        DirectionalLight((-0.85, -0.10, -0.50), 0.20, "camera"),
        DirectionalLight((0.15, -0.70, 0.70), 0.35, "camera"),
    )


def on_tabletop(lights: tuple[Light, ...], takes_shadows: bool) -> tuple[Light, ...]:
    """Return the lights of `tabletop` in place of those of `studio`, the default; others as they are.

    Without `takes_shadows` the key light casts none.
    """
    if lights != studio():
        return lights
    return tabletop() if takes_shadows else without_shadows(tabletop())


PRESETS = {"studio": studio, "headlight": headlight, "tabletop": tabletop}
