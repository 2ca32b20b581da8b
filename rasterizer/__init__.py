"""An exact, fast, classic scanline rasterizer: meshes to pictures and buffers, without GPU, OpenGL or display.

    import rasterizer as rz
    frame = rz.render("models/teapot.obj", size=(640, 480), view="front", material="gold", shading="gouraud")
    frame.save("teapot.png")

What lives where, from the top downwards; a folder's `__init__` says what its files hold:

    cli, viewer, batch    the command `raster`; the page and the widget; many pictures in many processes
    analysis              pictures compared, sheets, Mach bands, speed against error
    renderer, frame       `render` and `Renderer`; the picture and its buffers; animation and picking stand beside them
    appearance, viewpoint words such as `material="gold"` and `view="front"`, of programs and of the command line
    reference             the judge: a slow renderer in float64, which shares no kernel with the fast one
    engine                draws a scene: plans it, prepares it, and calls the pipeline
    pipeline              the kernels, in the order in which a polygon meets them
    geometry              meshes become points and triangles: normals, creases, polygons
    io                    files in and out, a format a file
    scene                 meshes, lights, materials, cameras: frozen, checked dataclasses
    compiler              kernels are compiled once, and kept
    options, words, choices, errors, cores, processes, registries, locks, vectors

The public names stand in `__init__.pyi`, each with its module, where editors and type checkers find them as well. A
module is imported when one of its names is first used, so that the command line can print its help without numpy.
"""

from importlib import import_module

__version__ = "0.2.0"
__docformat__ = "numpy"  # for pdoc

with open(f"{__path__[0]}/__init__.pyi", encoding="utf-8") as _stub:
    # from .scene.mesh import Mesh as Mesh; "from . import reference as reference" is a module itself
    _MODULES = {line.split()[3]: line.split()[1] for line in _stub if line.startswith("from ")}

__all__ = sorted([*_MODULES, "__version__"])


def __getattr__(name: str) -> object:
    """Import a public name from its module on first use (PEP 562)."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    home = _MODULES[name]
    value = import_module(f".{name}", __name__) if home == "." else getattr(import_module(home, __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """List the public names alone."""
    return __all__
