"""The public names, one a line, each with its module: what editors and type checkers see, and `__init__.py` imports."""

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
from .io.loader import demo_model as demo_model
from .io.loader import load as load
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
from .viewer.widget import view as view

__version__: str
