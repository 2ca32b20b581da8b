"""What a surface is made of: the coefficients of the illumination equation, and the model of its reflection.

What a model reflects from the light direction L to the viewer V, as a BRDF f(L, V); W is the specular reflection
function:

    reflection               f(L,V) = f(V,L)    ∫ f cos <= 1, for coefficients kd + ks <= 1
    lambert                  yes                yes
    oren-nayar               yes                yes
    cook-torrance            yes                yes, each of its two terms: the diffuse one is not weakened by 1 - F
    the same, anisotropic    yes                yes
    phong, blinn             no                 no: the highlight doesn't shrink with N·L
    the same, with W         no                 no
    the same, normalized     yes                yes
    normalized, with W       no: W = W(N·L)     yes
    toon                     no                 no: steps are rounded up

tests/pipeline/test_reflection.py integrates each of them. In the units of this package a white Lambertian surface
under a light of intensity 1 at N·L = 1 has intensity 1: intensity = π·f·N·L, and Lambert's BRDF is kd/π.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ..choices import DISTRIBUTIONS, REFLECTIONS, Distribution
from ..errors import SceneError, cut, shown
from .arrays import VectorLike
from .color import ColorLike, linear_rgb
from .plugins import find_plugin
from .texture import Texture, TextureLike
from .validate import choice, flag, number, store, text, unit3, value_class

MAX_LEVELS = 256
MAX_NUMBERS = 5
GREY_DIFFUSE = 0.55  # of what has neither material nor colours


class ReflectionModel(NamedTuple):
    """What a material checks where it names this model.

    Parameters
    ----------
    min_roughness : legal is `roughness` from here to 1
    brushed : the `distribution` with which `roughness` may be two numbers, or follow a texture; None = it is one number
    is_metallic : it reads `metallic`, and what belongs to it
    numbers : of a model of one's own, what `Material.numbers` are where they aren't given; up to MAX_NUMBERS
    enter : of a model of one's own, what registers it in another process; it is pickled with materials
    """

    min_roughness: float = 0.0
    brushed: str | None = None
    is_metallic: bool = False
    numbers: tuple[float, ...] = ()
    enter: Any = None


# Every reflection model that a material may name. What the engine and the reference know of it stands in tables by the
# same words; `rasterizer.registries` enters a model in all of them. Cook-Torrance's peak is 1/(2·roughness³) at
# most, which must stay a number of float32.
REFLECTION_MODELS: dict[str, ReflectionModel] = dict.fromkeys(REFLECTIONS, ReflectionModel())
REFLECTION_MODELS["cook-torrance"] = ReflectionModel(min_roughness=0.001, brushed="ggx", is_metallic=True)


@value_class
@dataclass(frozen=True, kw_only=True)
class Material:
    """Hold the reflection coefficients of a surface; every colour is checked and stored as a linear RGB
    triple.

    Colours are written as `rasterizer.scene.color.linear_rgb` reads them: a number (grey), three linear
    numbers, hex or CSS text, or a `Spectrum`.

    Parameters
    ----------
    ambient : colour, reflected share of the ambient light (ka); None = the same as `diffuse`
    diffuse : colour, Lambert's coefficient (kd), which a texture and the colours of a mesh multiply; None = 0.55, or 1
        with a texture, which is drawn as it is then
    specular : colour, strength of the highlight (ks); "lambert" and "oren-nayar" have none
    shininess : exponent of the highlight (n) of "phong", "blinn" and "toon", finite, above 0; 1 is very dull,
        1000 nearly a mirror
    emissive : colour, light that the surface gives off by itself (ke)
    opacity : number within 0..1: the share of what is seen that is the surface itself; the rest comes from
        behind it (1 - opacity is the transmission coefficient kt). Interpolated transparency (Foley, van Dam,
        Feiner & Hughes 1990, 16.5.1): light is not bent. 0 isn't there in a picture; depth, face and normal buffers
        show every surface
    texture : Texture, or anything that its class takes as an image, or None: multiplies `diffuse` and `ambient`,
        and its alpha the opacity; the mesh needs `uv`
    alpha_cutoff : number within 0..1, or None: where opacity times the texture's alpha is below it the surface is not
        there, for pictures, buffers, shadows and edges alike; elsewhere it is opaque, as a leaf on a card. The alpha is
        that of the picture itself, without mipmaps
    reflection : "phong" (1975, mirrored ray against viewer), "blinn" (1977, half vector against normal),
        "lambert" (1760, diffuse), "oren-nayar" (1994, diffuse and rough, as clay or the moon), "cook-torrance"
        (1981, metals and plastics made of microscopic mirrors) or "toon" (few levels, as in a drawing)
    roughness : number within 0..1. "oren-nayar": standard deviation of the facets' slope angle, radians; 0 is
        Lambert. "cook-torrance": Beckmann's m or GGX' alpha, at least 0.001: root mean square slope, or its
        counterpart. The other models don't use it. Two numbers, for "cook-torrance" with "ggx" only: alpha along the
        `tangent` and across it, as of brushed metal (Burley 2012; Heitz 2014). Brushed along the tangent, a surface is
        smooth along it and rough across: (0.05, 0.4). A material with two different ones is lit in float64
    tangent : the direction in the surface that two numbers of `roughness` refer to: "u", that in which the texture
        coordinate u grows, for which the mesh needs `uv`; or three numbers, an axis in the world, projected onto
        the surface. Where that leaves nothing, because the axis stands upright on the surface, or u grows nowhere,
        alpha is the geometric mean of the two in all directions
    distribution : "ggx" (Walter et al. 2007) or "beckmann" (1963): how the mirrors of "cook-torrance" are tilted
    fresnel : F0 of the specular reflection function W = F0 + (1 - F0)(1 - cos θ)^5 (Schlick 1994), by which `specular`
        is multiplied; θ is the angle of incidence, for "cook-torrance" that on the mirrors. A number within 0..1, or a
        colour whose components are within 0..1, a `Spectrum` included: W channel by channel, or wavelength by
        wavelength. W grows from F0 to 1, so `specular` times W never exceeds `specular`. (With samples of the spectrum
        an RGB F0 becomes a curve, as all RGB colours do: that of a saturated one leaves 0..1 here and there, its RGB
        doesn't.) None: W = 1, for "cook-torrance" F0 = 0.04. Stored as a float, or as a linear RGB triple or Spectrum
        where it isn't grey
    metallic : number within 0..1, the share m of the surface that is bare metal, for "cook-torrance"; the other models
        don't use it. Metal reflects nothing diffusely, and its F0 is `metal` times the colours of the mesh and
        `texture`, at every sample: W = F + (1 - F)(1 - cos θ)^5 with F = (1 - m)·F0 + m·metal·colour·texel
    metal : colour, F0 of the metal (m), where `metallic` is above 0; None = the same as `diffuse`
    metallic_roughness : Texture, or anything that `Texture.of_numbers` takes as an image, or None: at every sample
        its blue multiplies `metallic`, and the square of its green `roughness`, both within 0..1, as in glTF;
        "cook- torrance" takes it with "ggx" and one `roughness`, the other models don't use it. The mesh needs
        `uv`; without a `texture` the material gets a white one. Flat shading and Gouraud's method, which light no
        samples, take its means. A picture with such a material is computed in float64
    normalized : scale the highlight of "phong" by (n + 2)/2·N·L (Lafortune & Willems 1994), that of "blinn" by
        (n + 2)(n + 4)/(8 (2^(-n/2) + n))·N·L (Giesen 2009; the usual (n + 8)/8 gives up to 7.5 % too much): a
        highlight reflects at most `specular` of the light, whatever the exponent
    levels : whole number within 1..256: "toon" raises N·L to the next of the steps 1/levels, 2/levels, .. 1
        where it is above 0; its highlight is all there where (R·V)^n >= 1/2, else not at all. Such a material
        is lit in float64, because next to a step no error is small: points within about 1e-12 of a step may
        fall on its other side
    numbers : what a reflection model of one's own reads beside these, as many finite numbers as it says; None = its
        defaults. The other models don't use them
    name : text, for reports

    Coefficients above 1 are legal, written as floats: whole numbers above 1, as (255, 128, 0), are refused.
    `dataclasses.replace(material, diffuse=...)` keeps the ambient colour, and a `metal` that was given; pass
    `ambient=None` along to let it follow.

    Raises
    ------
    SceneError : a value that is not legal; the message names the field
    """

    ambient: ColorLike | None = None
    diffuse: ColorLike = None  # type: ignore[assignment]  # never None once it is made
    specular: ColorLike = 0.18
    shininess: float = 32.0
    emissive: ColorLike = 0.0
    opacity: float = 1.0
    texture: TextureLike | None = None
    alpha_cutoff: float | None = None
    reflection: str = "phong"
    roughness: float | Sequence[float] = 0.5
    distribution: Distribution = "ggx"
    fresnel: ColorLike | None = None
    metallic: float = 0.0
    metal: ColorLike | None = None
    metallic_roughness: TextureLike | None = None
    normalized: bool = False
    levels: int = 3
    tangent: str | VectorLike = "u"
    numbers: Sequence[float] | float | None = None
    name: str = ""

    FOLLOWS = {"ambient": "diffuse"}  # what a field is where it isn't given

    def __post_init__(self) -> None:
        plain: Any = self.diffuse
        if plain is None:
            plain = GREY_DIFFUSE if self.texture is None else 1.0
        diffuse = linear_rgb(plain, "the material's diffuse")
        if isinstance(self.reflection, str) and self.reflection not in REFLECTION_MODELS:
            find_plugin(self.reflection, REFLECTION_MODELS)
        model = REFLECTION_MODELS[choice(self.reflection, REFLECTION_MODELS, "the material's reflection")]
        choice(self.distribution, DISTRIBUTIONS, "the material's distribution")
        levels = number(self.levels, "the material's levels", low=1, high=MAX_LEVELS)
        if levels != int(levels):
            raise SceneError(f"the material's levels must be whole; given {shown(self.levels)}")
        store(
            self,
            diffuse=diffuse,
            ambient=diffuse if self.ambient is None else linear_rgb(self.ambient, "the material's ambient"),
            specular=linear_rgb(self.specular, "the material's specular"),
            emissive=linear_rgb(self.emissive, "the material's emissive"),
            metal=None if self.metal is None else linear_rgb(self.metal, "the material's metal"),
            shininess=number(self.shininess, "the material's shininess", above=0),
            opacity=number(self.opacity, "the material's opacity", low=0, high=1),
            alpha_cutoff=None
            if self.alpha_cutoff is None
            else number(self.alpha_cutoff, "the material's alpha_cutoff", low=0, high=1),
            roughness=self._checked_roughness(model),
            numbers=self._checked_numbers(model),
            fresnel=_checked_fresnel(self.fresnel),
            metallic=number(self.metallic, "the material's metallic", low=0, high=1),
            normalized=flag(self.normalized, "the material's normalized"),
            levels=int(levels),
        )
        text(self.name, "the material's name")
        if not isinstance(self.tangent, str):
            store(self, tangent=unit3(self.tangent, "the material's tangent"))
        elif self.tangent != "u":
            legal = "'u' or three numbers, an axis"
            raise SceneError(f"the material's tangent must be {legal}; given {shown(self.tangent)}")
        if self.texture is not None and not isinstance(self.texture, Texture):
            store(self, texture=Texture(self.texture))
        if self.metallic_roughness is not None:
            self._check_metallic_roughness(model)

    def _check_metallic_roughness(self, model: ReflectionModel) -> None:
        """Check the texture that says where the surface is metal, and how rough it is."""
        given: Any = self.metallic_roughness
        numbers = given if isinstance(given, Texture) else Texture.of_numbers(given)
        if numbers.encoded is None and numbers.image[..., 1:3].max() > 1.0:
            raise SceneError("the material's metallic_roughness must have green and blue within 0..1")
        if model.is_metallic and (self.distribution != model.brushed or isinstance(self.roughness, tuple)):
            what = f"{self.reflection!r} takes it with {model.brushed!r} and one roughness"
            raise SceneError(f"the material must have no metallic_roughness: {what}")
        white = Texture(np.ones((1, 1, 3)), "bilinear") if self.texture is None else self.texture
        store(self, metallic_roughness=numbers, texture=white)

    def _checked_roughness(self, model: ReflectionModel) -> float | tuple[float, float]:
        """Return the roughness as a float, or as two that differ."""
        what, given = "the material's roughness", self.roughness
        unit = f" for {self.reflection!r}"
        if not isinstance(given, (tuple, list, np.ndarray)) or getattr(given, "ndim", 1) != 1:
            return number(given, what, low=model.min_roughness, high=1, unit=unit)
        if len(given) != 2 or self.distribution != model.brushed:
            pairs = [f"{word!r} with {m.brushed!r}" for word, m in REFLECTION_MODELS.items() if m.brushed is not None]
            legal = f"one number, or two (along the tangent and across it) for {' or '.join(pairs)}"
            raise SceneError(f"{what} must be {legal}; given {shown(given)}")
        along, across = (number(each, what, low=model.min_roughness, high=1, unit=unit) for each in given)
        return along if along == across else (along, across)

    def _checked_numbers(self, model: ReflectionModel) -> tuple[float, ...] | None:
        """Return the numbers of a model of one's own; what isn't given stays so where the model has none."""
        what, given, n = "the material's numbers", self.numbers, len(model.numbers)
        if given is None:
            return model.numbers or None
        is_row = isinstance(given, (tuple, list)) or (isinstance(given, np.ndarray) and given.ndim == 1)
        values: Any = given if is_row else (given,)
        if n and len(values) != n:
            raise SceneError(f"{what} must be {n}, which {self.reflection!r} reads; given {shown(given)}")
        return tuple(number(each, what) for each in values)

    def __reduce__(self) -> Any:
        """A copy in another process knows its reflection model there."""
        return _restored, (type(self), self.reflection, REFLECTION_MODELS[self.reflection].enter), self.__dict__

    @property
    def is_anisotropic(self) -> bool:
        """Whether the highlight depends on a direction in the surface, `tangent`."""
        specular: Any = self.specular
        return isinstance(self.roughness, tuple) and max(specular) > 0.0

    @property
    def textures(self) -> tuple[Texture, ...]:
        """The textures that it has: of colours, of metal and roughness."""
        both: Any = self.texture, self.metallic_roughness
        return tuple(filter(None, both))

    @property
    def needs_uv(self) -> bool:
        """Whether the mesh must have texture coordinates."""
        return self.texture is not None or (self.is_anisotropic and self.tangent == "u")

    @property
    def metal_color(self) -> Any:
        """F0 of the metal, as the other colours are stored."""
        return self.diffuse if self.metal is None else self.metal

    def as_lit(self, is_lit_per_sample: bool) -> "Material":
        """Return the same with what counts of `metallic` and `metallic_roughness`: nothing where the model doesn't use
        them, the means of the texture where no samples are lit, or none of them has a highlight."""
        specular: Any = self.specular
        if not REFLECTION_MODELS.get(self.reflection, ReflectionModel()).is_metallic:
            is_plain = self.metallic == 0.0 and self.metallic_roughness is None
            return self if is_plain else replace(self, metallic=0.0, metallic_roughness=None)
        is_dull = max(specular) == 0.0
        return self if is_lit_per_sample and not is_dull else self.with_means()

    def with_means(self) -> "Material":
        """Return the same with the means of `metallic_roughness` in its place."""
        if self.metallic_roughness is None:
            return self
        texture: Any = self.metallic_roughness
        _, green, blue, _ = texture.mean.tolist()
        least = REFLECTION_MODELS[self.reflection].min_roughness
        roughness: Any = self.roughness if isinstance(self.roughness, tuple) else max(self.roughness * green**2, least)
        return replace(self, metallic_roughness=None, metallic=self.metallic * blue, roughness=roughness)

    def without_textures(self) -> "Material":
        """Return the same for a mesh without texture coordinates: with the means of `metallic_roughness` in its place,
        and nothing in that of `texture`."""
        return replace(self.with_means(), texture=None)

    @classmethod
    def named(cls, name: str, /, **changes: Any) -> "Material":
        """Return one of the materials of the classic table: "gold", "jade", "red plastic", ...

        Parameters
        ----------
        name : text, one of the names in `rasterizer.scene.material.NAMED_MATERIALS`; the error for another one
            lists them
        changes : fields of Material that differ from the table's

        Raises
        ------
        SceneError : an unknown name, or a value that is not legal
        """
        return cls(**{"name": name} | named_fields(name) | changes)

    @property
    def is_opaque(self) -> bool:
        """Whether nothing is seen through the surface, where it is there."""
        texture: Any = self.texture
        is_clear = self.opacity < 1.0 or (texture is not None and texture.has_alpha)
        return not is_clear or self.is_cut_out

    @property
    def is_visible(self) -> bool:
        """Whether anything of it is to be seen, whatever its texture shows."""
        return self.opacity > 0.0 and self.opacity >= (self.alpha_cutoff or 0.0)

    @property
    def is_cut_out(self) -> bool:
        """Whether `alpha_cutoff` says where the surface is there."""
        return self.alpha_cutoff is not None


def _restored(cls: type, reflection: str, enter: Any) -> Any:
    """Return what becomes a material of another process, whose reflection model may be unknown here."""
    if enter is not None and reflection not in REFLECTION_MODELS:
        enter()
    return object.__new__(cls)


def _checked_fresnel(value: ColorLike | None) -> ColorLike | None:
    """Return F0 as a float, as a colour where it isn't grey, or None."""
    if value is None:
        return None
    what = "the material's fresnel"
    is_number = not isinstance(value, str) and not hasattr(value, "__len__")
    color = (number(value, what),) * 3 if is_number else linear_rgb(value, what)
    # A Spectrum's RGB may leave 0..1 though no sample of it does.
    samples = np.asarray(getattr(color, "values", color))
    if not (samples.min() >= 0.0 and samples.max() <= 1.0):
        raise SceneError(f"{what} must be within 0..1 in each component, or None; given {shown(value)}")
    return color if hasattr(color, "wavelengths") or len(set(color)) > 1 else color[0]


# The material of a mesh without one, and where it has colours, which are drawn as they are. These very objects stand
# for a material that isn't given: a mesh that gets colours later turns white.
GREY, WHITE = Material(), Material(diffuse=1.0)


# --- the classic table: coefficients of Phong's reflection for displays of the 1990s -------------------------
# Source: the materials of teapots.c by Mark J. Kilgard, Silicon Graphics 1994 (OpenGL Programming Guide, colour plate
# 17), where the exponent is given as a part of 128. The numbers were made for displays without gamma correction; they
# are taken here as they stand, as linear coefficients, so pictures are a little lighter. They are no measurements: for
# metals, "cook-torrance" with a coloured `fresnel` is nearer to physics.

# name: (ambient, diffuse, specular, shininess / 128); a colour is a grey or red, green and blue
NAMED_MATERIALS: dict[str, tuple[Any, Any, Any, float]] = {
    "brass": (
        (0.329412, 0.223529, 0.027451),
        (0.780392, 0.568627, 0.113725),
        (0.992157, 0.941176, 0.807843),
        0.21794872,
    ),
    "bronze": ((0.2125, 0.1275, 0.054), (0.714, 0.4284, 0.18144), (0.393548, 0.271906, 0.166721), 0.2),
    "chrome": (0.25, 0.4, 0.774597, 0.6),
    "copper": ((0.19125, 0.0735, 0.0225), (0.7038, 0.27048, 0.0828), (0.256777, 0.137622, 0.086014), 0.1),
    "gold": ((0.24725, 0.1995, 0.0745), (0.75164, 0.60648, 0.22648), (0.628281, 0.555802, 0.366065), 0.4),
    "silver": (0.19225, 0.50754, 0.508273, 0.4),
    "emerald": ((0.0215, 0.1745, 0.0215), (0.07568, 0.61424, 0.07568), (0.633, 0.727811, 0.633), 0.6),
    "jade": ((0.135, 0.2225, 0.1575), (0.54, 0.89, 0.63), 0.316228, 0.1),
    "obsidian": ((0.05375, 0.05, 0.06625), (0.18275, 0.17, 0.22525), (0.332741, 0.328634, 0.346435), 0.3),
    "pearl": ((0.25, 0.20725, 0.20725), (1.0, 0.829, 0.829), 0.296648, 0.088),
    "ruby": ((0.1745, 0.01175, 0.01175), (0.61424, 0.04136, 0.04136), (0.727811, 0.626959, 0.626959), 0.6),
    "turquoise": ((0.1, 0.18725, 0.1745), (0.396, 0.74151, 0.69102), (0.297254, 0.30829, 0.306678), 0.1),
    "black plastic": (0.0, 0.01, 0.5, 0.25),
    "cyan plastic": ((0.0, 0.1, 0.06), (0.0, 0.50980392, 0.50980392), 0.50196078, 0.25),
    "green plastic": (0.0, (0.1, 0.35, 0.1), (0.45, 0.55, 0.45), 0.25),
    "red plastic": (0.0, (0.5, 0.0, 0.0), (0.7, 0.6, 0.6), 0.25),
    "white plastic": (0.0, 0.55, 0.7, 0.25),
    "yellow plastic": (0.0, (0.5, 0.5, 0.0), (0.6, 0.6, 0.5), 0.25),
    "black rubber": (0.02, 0.01, 0.4, 0.078125),
    "cyan rubber": ((0.0, 0.05, 0.05), (0.4, 0.5, 0.5), (0.04, 0.7, 0.7), 0.078125),
    "green rubber": ((0.0, 0.05, 0.0), (0.4, 0.5, 0.4), (0.04, 0.7, 0.04), 0.078125),
    "red rubber": ((0.05, 0.0, 0.0), (0.5, 0.4, 0.4), (0.7, 0.04, 0.04), 0.078125),
    "white rubber": (0.05, 0.5, 0.7, 0.078125),
    "yellow rubber": ((0.05, 0.05, 0.0), (0.5, 0.5, 0.4), (0.7, 0.7, 0.04), 0.078125),
}


def named_fields(name: str) -> dict[str, Any]:
    """Return the fields of a named material as arguments of `Material`; SceneError for an unknown name."""
    if not isinstance(name, str) or name not in NAMED_MATERIALS:
        from difflib import get_close_matches

        near = get_close_matches(name, NAMED_MATERIALS, n=1) if isinstance(name, str) else ()
        meant = f"; did you mean {near[0]}?" if near else ""
        legal = cut(", ".join(NAMED_MATERIALS), 120)
        raise SceneError(f"a named material is one of {legal}; given {shown(name)}{meant}")
    ambient, diffuse, specular, part = NAMED_MATERIALS[name]
    return {"ambient": ambient, "diffuse": diffuse, "specular": specular, "shininess": 128.0 * part}
