"""An exact, fast, classic scanline rasterizer: meshes to pictures and buffers, without GPU, OpenGL or display.

    import rasterizer as rz
    scene = rz.load("models/teapot.obj", crease_angle=30)
    frame = rz.render(scene, size=(640, 480), shading="gouraud")
    frame.save("teapot.png")

Names are imported when they are first used, so that the command line can print its help without loading the compiler.
"""

import sys
from importlib import import_module
from types import ModuleType

from ._version import __version__

_HOMES = {
    "AmbientLight": "scene.lights",
    "AreaLight": "scene.lights",
    "Camera": "scene.camera",
    "Comparison": "analysis.comparison",
    "DepthCue": "scene.depth_cue",
    "DirectionalLight": "scene.lights",
    "Frame": "frame",
    "MachBands": "analysis.mach",
    "Material": "scene.material",
    "Mesh": "scene.mesh",
    "ModelError": "errors",
    "Options": "options",
    "OutputError": "errors",
    "PointLight": "scene.lights",
    "RasterizerError": "errors",
    "Renderer": "renderer",
    "Scene": "scene.scene",
    "SceneError": "errors",
    "Shadow": "scene.lights",
    "SpotLight": "scene.lights",
    "Spectrum": "scene.spectrum",
    "Texture": "scene.texture",
    "compare": "analysis.comparison",
    "headlight": "scene.lights",
    "illuminate": "engine.point_lighting",
    "load": "io.loader",
    "mach_bands": "analysis.mach",
    "render": "renderer",
    "sheet": "analysis.contact_sheet",
    "studio": "scene.lights",
}
__all__ = sorted([*_HOMES, "__version__"])


class _Package(ModuleType):
    """Keep `compare`, `illuminate` and `sheet` functions, though importing the module of that name would bind it
    here."""

    def __setattr__(self, name, value):
        if not (name in _HOMES and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package


def __getattr__(name):
    """Import a public name from its home on first use (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f".{_HOMES[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__():
    return sorted(__all__)
