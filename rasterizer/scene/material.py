"""What a surface is made of: the coefficients of the illumination equation."""

from dataclasses import dataclass

from rasterizer.errors import SceneError
from rasterizer.scene._check import choice, number
from rasterizer.scene.color import linear_rgb

REFLECTIONS = ("phong", "blinn")


@dataclass(frozen=True, kw_only=True)
class Material:
    """Hold the reflection coefficients of a surface; every colour is checked and stored as a linear RGB
    triple.

    Colours are written as `rasterizer.scene.color.linear_rgb` reads them: a number (grey), three linear
    numbers, hex or CSS text.

    Parameters
    ----------
    ambient : colour, reflected share of the ambient light (ka); None = the same as `diffuse`
    diffuse : colour, Lambert's coefficient (kd)
    specular : colour, strength of the highlight (ks)
    shininess : exponent of the highlight (n), finite, above 0; 1 is very dull, 1000 nearly a mirror
    emissive : colour, light that the surface gives off by itself (ke)
    opacity : number within 0..1; stored and reported, but every surface is drawn opaque
    reflection : "phong" (1975, mirrored ray against viewer) or "blinn" (1977, half vector against normal)
    name : text, for reports

    Coefficients above 1 are legal. `dataclasses.replace(material, diffuse=...)` keeps the ambient colour;
    pass `ambient=None` along to let it follow.

    Raises
    ------
    SceneError : a value that is not legal; the message names the field
    """

    ambient: object = None
    diffuse: object = 0.72
    specular: object = 0.18
    shininess: float = 32.0
    emissive: object = 0.0
    opacity: float = 1.0
    reflection: str = "phong"
    name: str = ""

    def __post_init__(self):
        for field in ("diffuse", "specular", "emissive", "ambient"):
            value = self.diffuse if field == "ambient" and self.ambient is None else getattr(self, field)
            object.__setattr__(self, field, linear_rgb(value, f"the material's {field}"))
        shininess = number(self.shininess, "the material's shininess")
        if shininess <= 0.0:
            raise SceneError(f"the material's shininess must be above 0; given {self.shininess!r}")
        object.__setattr__(self, "shininess", shininess)
        opacity = number(self.opacity, "the material's opacity")
        if not 0.0 <= opacity <= 1.0:
            raise SceneError(f"the material's opacity must be within 0..1; given {self.opacity!r}")
        object.__setattr__(self, "opacity", opacity)
        choice(self.reflection, REFLECTIONS, "the material's reflection")
        if not isinstance(self.name, str):
            raise SceneError(f"the material's name must be text; given {self.name!r}")
