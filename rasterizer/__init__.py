"""An exact, fast, classic scanline rasterizer: meshes to pictures and buffers, without GPU, OpenGL or display."""

from .errors import ModelError, OutputError, RasterizerError, SceneError
from .frame import Frame
from .options import Options
from .renderer import Renderer, render
from .scene.camera import Camera
from .scene.lights import AmbientLight, DirectionalLight, PointLight, headlight, studio
from .scene.load import load
from .scene.material import Material
from .scene.mesh import Mesh
from .scene.scene import Scene

__version__ = "0.1.0"
__all__ = sorted(name for name in globals() if name[0].isupper()) + ["headlight", "load", "render", "studio"]
