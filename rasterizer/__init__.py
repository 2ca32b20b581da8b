"""An exact, fast, classic scanline rasterizer: meshes to pictures and buffers, without GPU, OpenGL or display.

    import rasterizer as rz
    scene = rz.load("models/teapot.obj", crease_angle=30)
    frame = rz.render(scene, size=(640, 480), shading="gouraud")
    frame.save("teapot.png")

Names are imported when they are first used, so that the command line can print its help without loading the compiler.
"""

from importlib import import_module

from .version import __version__ as __version__

_HOMES = {
    "AmbientLight": "scene.lights",
    "Animation": "animation",
    "AreaLight": "scene.lights",
    "Camera": "scene.camera",
    "Comparison": "analysis.comparison",
    "DepthCue": "scene.scene",
    "DirectionalLight": "scene.lights",
    "Explanation": "reference.explain",
    "Frame": "frame",
    "MachBands": "analysis.mach",
    "Material": "scene.material",
    "Mesh": "scene.mesh",
    "ModelError": "errors",
    "Options": "options",
    "OptionError": "errors",
    "OutputError": "errors",
    "Pick": "picking",
    "PointLight": "scene.lights",
    "RasterizerError": "errors",
    "RenderRecord": "batch.tasks",
    "RenderTask": "batch.tasks",
    "Renderer": "renderer",
    "Scene": "scene.scene",
    "SceneError": "errors",
    "Shadow": "scene.lights",
    "SpotLight": "scene.lights",
    "Spectrum": "scene.spectrum",
    "Texture": "scene.texture",
    "color_difference": "analysis.comparison",
    "compare": "analysis.comparison",
    "demo_model": "io.demo",
    "explain": "analysis.pixel",
    "headlight": "scene.lights",
    "illuminate": "engine.point_lighting",
    "load": "io.loader",
    "mach_bands": "analysis.mach",
    "render": "renderer",
    "render_many": "batch.rendering",
    "sheet": "analysis.contact_sheet",
    "srgb": "scene.color",
    "studio": "scene.lights",
    "tabletop": "scene.lights",
    "turntable": "animation",
    "view": "notebook",
}
__all__ = sorted([*_HOMES, "__version__"])

TYPE_CHECKING = False  # what editors and type checkers take for that of `typing`, which would take 2 ms to import
if TYPE_CHECKING:  # for editors and type checkers; a test holds that these are the names of _HOMES
    from .analysis.comparison import Comparison as Comparison
    from .analysis.comparison import color_difference as color_difference
    from .analysis.comparison import compare as compare
    from .analysis.contact_sheet import sheet as sheet
    from .analysis.mach import MachBands as MachBands
    from .analysis.mach import mach_bands as mach_bands
    from .analysis.pixel import explain as explain
    from .animation import Animation as Animation
    from .animation import turntable as turntable
    from .batch.rendering import render_many as render_many
    from .batch.tasks import RenderRecord as RenderRecord
    from .batch.tasks import RenderTask as RenderTask
    from .engine.point_lighting import illuminate as illuminate
    from .errors import ModelError as ModelError
    from .errors import OptionError as OptionError
    from .errors import OutputError as OutputError
    from .errors import RasterizerError as RasterizerError
    from .errors import SceneError as SceneError
    from .frame import Frame as Frame
    from .io.demo import demo_model as demo_model
    from .io.loader import load as load
    from .notebook import view as view
    from .options import Options as Options
    from .picking import Pick as Pick
    from .reference.explain import Explanation as Explanation
    from .renderer import Renderer as Renderer
    from .renderer import render as render
    from .scene.camera import Camera as Camera
    from .scene.color import srgb as srgb
    from .scene.lights import AmbientLight as AmbientLight
    from .scene.lights import AreaLight as AreaLight
    from .scene.lights import DirectionalLight as DirectionalLight
    from .scene.lights import PointLight as PointLight
    from .scene.lights import Shadow as Shadow
    from .scene.lights import SpotLight as SpotLight
    from .scene.lights import headlight as headlight
    from .scene.lights import studio as studio
    from .scene.lights import tabletop as tabletop
    from .scene.material import Material as Material
    from .scene.mesh import Mesh as Mesh
    from .scene.scene import DepthCue as DepthCue
    from .scene.scene import Scene as Scene
    from .scene.spectrum import Spectrum as Spectrum
    from .scene.texture import Texture as Texture
else:

    def __getattr__(name: str) -> object:
        """Import a public name from its home on first use (PEP 562)."""
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = getattr(import_module(f".{_HOMES[name]}", __name__), name)
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    """List the public names alone."""
    return sorted(__all__)
