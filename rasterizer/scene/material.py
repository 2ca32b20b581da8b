"""What a surface is made of: the coefficients of the illumination equation, and the model of its reflection.

What a model reflects from the light direction L to the viewer V, as a BRDF f(L, V); W is the specular reflection function:

    reflection               f(L,V) = f(V,L)    ∫ f cos <= 1, for coefficients kd + ks <= 1
    lambert                  yes                yes
    oren-nayar               yes                yes
    cook-torrance            yes                yes, each of its two terms: the matte one is not weakened by 1 - F
    phong, blinn             no                 no: the highlight doesn't shrink with N·L
    the same, with W         no                 no
    the same, normalized     yes                yes
    normalized, with W       no: W = W(N·L)     yes
    toon                     no                 no: steps are rounded up

tests/test_reflection.py integrates each of them. In the units of this package a matte white surface under a light of intensity 1
at N·L = 1 has intensity 1: intensity = π·f·N·L, and Lambert's BRDF is kd/π.
"""

from dataclasses import dataclass

import numpy as np

from rasterizer.errors import SceneError
from rasterizer.scene._check import choice, number, shown
from rasterizer.scene.color import linear_rgb
from rasterizer.scene.texture import Texture

REFLECTIONS = ("phong", "blinn", "lambert", "oren-nayar", "cook-torrance", "toon")
DISTRIBUTIONS = ("ggx", "beckmann")
LEAST_ROUGHNESS = 0.001  # of Cook-Torrance: its peak is 1/(2·roughness³), and must stay a number
MOST_LEVELS = 256


@dataclass(frozen=True, kw_only=True)
class Material:
    """Hold the reflection coefficients of a surface; every colour is checked and stored as a linear RGB
    triple.

    Colours are written as `rasterizer.scene.color.linear_rgb` reads them: a number (grey), three linear
    numbers, hex or CSS text, or a `Spectrum`.

    Parameters
    ----------
    ambient : colour, reflected share of the ambient light (ka); None = the same as `diffuse`
    diffuse : colour, Lambert's coefficient (kd)
    specular : colour, strength of the highlight (ks); "lambert" and "oren-nayar" have none
    shininess : exponent of the highlight (n) of "phong", "blinn" and "toon", finite, above 0; 1 is very dull,
        1000 nearly a mirror
    emissive : colour, light that the surface gives off by itself (ke)
    opacity : number within 0..1: the share of what is seen that is the surface itself; the rest comes from
        behind it (1 - opacity is the transmission coefficient kt). Interpolated transparency (Foley, van Dam,
        Feiner & Hughes 1990, 16.5.1): light is not bent. 0 isn't there in a picture; depth, face and normal buffers show
        every surface
    texture : Texture, or anything that its class takes as an image, or None: multiplies `diffuse` and `ambient`,
        and its alpha the opacity; the mesh needs `uv`
    reflection : "phong" (1975, mirrored ray against viewer), "blinn" (1977, half vector against normal),
        "lambert" (1760, matte), "oren-nayar" (1994, matte and rough, as clay or the moon), "cook-torrance"
        (1981, metals and plastics made of microscopic mirrors) or "toon" (few levels, as in a drawing)
    roughness : number within 0..1. "oren-nayar": standard deviation of the facets' slope angle, radians; 0 is
        Lambert. "cook-torrance": Beckmann's m or GGX' alpha, at least 0.001: root mean square slope, or its
        counterpart. The other models don't use it
    distribution : "ggx" (Walter et al. 2007) or "beckmann" (1963): how the mirrors of "cook-torrance" are tilted
    fresnel : number within 0..1, F0 of the specular reflection function W = F0 + (1 - F0)(1 - cos θ)^5 (Schlick
        1994), by which `specular` is multiplied; θ is the angle of incidence, for "cook-torrance" that on the
        mirrors. None: W = 1, for "cook-torrance" F0 = 0.04
    normalized : scale the highlight of "phong" by (n + 2)/2·N·L (Lafortune & Willems 1994), that of "blinn" by
        (n + 2)(n + 4)/(8 (2^(-n/2) + n))·N·L (Giesen 2009; the usual (n + 8)/8 gives up to 7.5 % too much): a
        highlight reflects at most `specular` of the light, whatever the exponent
    levels : whole number within 1..256: "toon" raises N·L to the next of the steps 1/levels, 2/levels, .. 1
        where it is above 0; its highlight is all there where (R·V)^n >= 1/2, else not at all. A picture with
        such a material is computed in float64, because next to a step no error is small: only points within
        about 1e-15 of a step may fall on its other side
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
    texture: Texture | None = None
    reflection: str = "phong"
    roughness: float = 0.5
    distribution: str = "ggx"
    fresnel: float | None = None
    normalized: bool = False
    levels: int = 3
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
        if self.texture is not None and not isinstance(self.texture, Texture):
            object.__setattr__(self, "texture", Texture(self.texture))
        choice(self.reflection, REFLECTIONS, "the material's reflection")
        self._check_model()
        if not isinstance(self.name, str):
            raise SceneError(f"the material's name must be text; given {self.name!r}")

    def _check_model(self) -> None:
        """Check and normalise the fields that only some of the reflection models read."""
        roughness = number(self.roughness, "the material's roughness")
        least = LEAST_ROUGHNESS if self.reflection == "cook-torrance" else 0.0
        if not least <= roughness <= 1.0:
            what = f"within {least:g}..1 for {self.reflection!r}"
            raise SceneError(f"the material's roughness must be {what}; given {self.roughness!r}")
        object.__setattr__(self, "roughness", roughness)
        choice(self.distribution, DISTRIBUTIONS, "the material's distribution")
        if self.fresnel is not None:
            fresnel = number(self.fresnel, "the material's fresnel")
            if not 0.0 <= fresnel <= 1.0:
                raise SceneError(f"the material's fresnel must be within 0..1 or None; given {self.fresnel!r}")
            object.__setattr__(self, "fresnel", fresnel)
        if not isinstance(self.normalized, (bool, np.bool_)):
            raise SceneError(f"the material's normalized must be True or False; given {shown(self.normalized)}")
        object.__setattr__(self, "normalized", bool(self.normalized))
        levels = number(self.levels, "the material's levels")
        if levels != int(levels) or not 1 <= levels <= MOST_LEVELS:
            raise SceneError(f"the material's levels must be whole, within 1..{MOST_LEVELS}; given {self.levels!r}")
        object.__setattr__(self, "levels", int(levels))

    @property
    def is_opaque(self) -> bool:
        """Whether nothing is seen through the surface."""
        return self.opacity == 1.0 and (self.texture is None or not self.texture.has_alpha)
