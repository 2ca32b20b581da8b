"""What scenes and meshes offer and leave to layers above: named here, and loaded when it is asked for.

A scene is data. It is made, checked and pickled without the compiler, and imports nothing that reads files or draws.
Five things that it offers are work for others: `geometry/` cuts the ears of concave polygons, computes normals that are
given as 0, and those of a finer mesh, in compiled code, and `io/` reads and writes scene files.
"""

from collections.abc import Callable
from importlib import import_module
from typing import Literal

_HOMES = {
    "cut_ears": "rasterizer.geometry.ears",
    "fill_normals": "rasterizer.geometry.normals",
    "subdivide": "rasterizer.geometry.subdivide",
    "read_scene": "rasterizer.io.scene_file",
    "write_scene": "rasterizer.io.scene_file_write",
}


def service(name: Literal["cut_ears", "fill_normals", "subdivide", "read_scene", "write_scene"]) -> Callable:
    """Return the function of this name, and load its module on first use."""
    return getattr(import_module(_HOMES[name]), name)
