"""The algorithms that a mesh needs and doesn't know: they are named here, and live in layers above.

A scene is data. It is made, checked, pickled and saved without the compiler, and imports nothing that draws. Two things that a mesh
offers are work for `geometry/`, where they are compiled: ears of concave polygons, and normals of a finer mesh. So the mesh
asks for them by name, when it needs them.
"""

from collections.abc import Callable
from importlib import import_module
from typing import Literal

_HOMES = {"cut_ears": "rasterizer.geometry.ears", "subdivide": "rasterizer.geometry.subdivide"}


def algorithm(name: Literal["cut_ears", "subdivide"]) -> Callable:
    """Return the function of this name, and load its module on first use."""
    return getattr(import_module(_HOMES[name]), name)
