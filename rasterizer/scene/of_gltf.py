"""What glTF says of surfaces, lights and cameras, in our terms: for its reader, and for foreign meshes, which speak of
them in the same words.

How a surface reflects: metallic and roughness as coefficients of Cook-Torrance's model.

    base color c, metallic m, roughness r         F0 of the dielectric: f = ((ior - 1)/(ior + 1))² · specularColor
    diffuse    c·(1 - m)·(1 - f)                   0.04 where the file says nothing
    fresnel    f·(1 - m) + c·m                     F0 of the whole
    roughness  r²                                  GGX' alpha, at least 0.001
    ambient    diffuse + F0: light from everywhere alike, at normal incidence
    specular   1 + (w - 1)·(1 - m)                 w: strength of KHR_materials_specular

Where a texture or colours of vertices multiply c, or a texture m and r, they do so at every sample:

    diffuse    c·(1 - f), of which Material leaves 1 - m
    fresnel    f       metallic  m       metal  c
    ambient, specular  as above, with the mean of m

A material without metallicFactor is a metal, but in files that trimesh has written: it leaves out what it doesn't
know.

    KHR_materials_ior, _specular, _emissive_strength    as above; their textures are left out
    KHR_materials_unlit                   emission alone; with a texture, or colours of vertices: diffuse, lit
    KHR_materials_pbrSpecularGlossiness   diffuse d·(1 - F0), F0 = specular, roughness (1 - glossiness)²

Sources: Khronos, glTF 2.0 Specification, 2021, appendix B; the extensions' texts; Schlick 1994 for F0.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .camera import Camera
from .color import linear_from_srgb
from .lights import DirectionalLight, Light, PointLight, SpotLight
from .material import REFLECTION_MODELS
from .texture import Texture

WHITE_FACTOR, BLACK = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
_F0 = 0.04  # of an index of refraction of 1.5
_MIN_ALPHA = REFLECTION_MODELS["cook-torrance"].min_roughness
UNLIT, GLOSSY = "KHR_materials_unlit", "KHR_materials_pbrSpecularGlossiness"


class Fault(ValueError):
    """A value of a tree isn't legal; the text says which, and what is."""


def extension(source: dict[str, Any], name: str) -> dict[str, Any]:
    """Return an extension of an item of the tree, empty where it has none."""
    found: dict[str, Any] = source.get("extensions", {}).get(f"KHR_materials_{name}", {})
    return found


def emission_of(source: dict[str, Any]) -> tuple[float, ...]:
    """Return what a material gives off, linear: nothing where a texture says where it does."""
    if "emissiveTexture" in source:
        return BLACK
    strength = float(extension(source, "emissive_strength").get("emissiveStrength", 1.0))
    return tuple(strength * value for value in numbers_of(source.get("emissiveFactor", BLACK), 3))


def opacity_fields(mode: str, alpha: float, cutoff: Any) -> dict[str, Any]:
    """Return the fields of Material that `alphaMode`, the alpha of the base color and `alphaCutoff` say."""
    if mode != "MASK":
        return {"opacity": 1.0 if mode == "OPAQUE" else alpha}
    cutoff = float(cutoff)  # above 1 it leaves nothing
    return {"alpha_cutoff": min(cutoff, 1.0), "opacity": alpha if cutoff <= 1.0 else 0.0}


def unlit_fields(base: Any, is_multiplied: bool) -> dict[str, Any]:
    """Return the fields of Material of an unlit surface.

    Parameters
    ----------
    base : (3,) base color, linear
    is_multiplied : whether a texture or colours of vertices multiply it, which do so with the diffuse coefficient only
    """
    diffuse, emissive = (base, BLACK) if is_multiplied else (BLACK, base)
    return {"reflection": "lambert", "diffuse": diffuse, "specular": 0.0, "emissive": emissive}


def lit_fields(
    source: dict[str, Any],
    base: Any,
    is_multiplied: bool,
    mean_of: Callable[[Any], NDArray[Any] | None],
    metallic: float = 1.0,
    numbers: Texture | None = None,
) -> dict[str, Any]:
    """Return the fields of Material that say how a surface reflects.

    Parameters
    ----------
    source : dict, a material of the tree
    base : (3,) base color, linear
    is_multiplied : whether a texture or colours of vertices multiply it
    mean_of : function of the use of a texture of numbers, which returns the mean (4,) of its texels, 0..1; None where
        it is missing
    metallic : metallicFactor of a material that has none
    numbers : the texture that says at every sample how metallic and rough it is; None = its means count
    """
    base = np.array(base)
    if (glossy := source.get("extensions", {}).get(GLOSSY)) is not None:
        f0 = np.clip(numbers_of(glossy.get("specularFactor", WHITE_FACTOR), 3), 0.0, 1.0)
        smoothness = float(glossy.get("glossinessFactor", 1.0))
        if (mean := _mean(glossy.get("specularGlossinessTexture"), mean_of)) is not None:
            f0, smoothness = f0 * linear_from_srgb(mean[:3]), smoothness * mean[3]
        return _fields(base * (1.0 - f0.max()), f0, 1.0 - smoothness, 1.0)
    surface = source.get("pbrMetallicRoughness", {})
    metallic = float(surface.get("metallicFactor", 1.0 if "metallicRoughnessTexture" in surface else metallic))
    roughness = float(surface.get("roughnessFactor", 1.0))
    mean = _mean(surface.get("metallicRoughnessTexture"), mean_of)
    if mean is not None and numbers is None:
        metallic, roughness = metallic * mean[2], roughness * mean[1]
    factor = min(max(metallic, 0.0), 1.0)
    metallic = factor * mean[2] if mean is not None and numbers is not None else factor
    weight, dielectric = _dielectric_of(source)
    f0 = dielectric * (1.0 - metallic) + base * metallic
    diffuse = base * (1.0 - metallic) * (1.0 - weight * dielectric.max())
    ambient = diffuse + base * metallic + weight * dielectric * (1.0 - metallic)
    specular = 1.0 + (weight - 1.0) * (1.0 - metallic)
    if numbers is None and not (is_multiplied and metallic > 0.0):
        return _fields(diffuse, f0, roughness, specular, ambient)
    fields = _fields(base * (1.0 - weight * dielectric.max()), dielectric, roughness, specular, ambient)
    return fields | {"metallic": factor, "metal": tuple(base.tolist()), "metallic_roughness": numbers}


def _dielectric_of(source: dict[str, Any]) -> tuple[float, NDArray[np.float64]]:
    """Return the strength of a material's highlight, and the F0 (3,) that it has where it isn't metal."""
    f0 = _F0
    if "ior" in extension(source, "ior"):
        ior = float(extension(source, "ior")["ior"])
        f0 = ((ior - 1.0) / (ior + 1.0)) ** 2 if ior > 0.0 else 1.0  # 0 stands for infinity: the extension's text
    specular = extension(source, "specular")
    color = np.array(numbers_of(specular.get("specularColorFactor", WHITE_FACTOR), 3))
    return float(specular.get("specularFactor", 1.0)), np.clip(f0 * color, 0.0, 1.0)


def _fields(diffuse: Any, f0: Any, roughness: Any, specular: Any, ambient: Any = None) -> dict[str, Any]:
    """Return fields of Material; a value that rounding, or the file, moved out of its range goes to its end."""
    return {
        "reflection": "cook-torrance",
        "diffuse": tuple(diffuse.tolist()),
        "ambient": tuple((diffuse + f0 if ambient is None else ambient).tolist()),
        "specular": specular,
        "fresnel": tuple(np.clip(f0, 0.0, 1.0).tolist()),
        "roughness": min(max(float(roughness) ** 2, _MIN_ALPHA), 1.0),
    }


def _mean(use: Any, mean_of: Callable[[Any], NDArray[Any] | None]) -> NDArray[Any] | None:
    return None if use is None else mean_of(use)


def numbers_of(values: Any, n: int) -> tuple[float, ...]:
    """Return so many numbers of a list; ValueError where there are more or fewer."""
    numbers = tuple(float(value) for value in values)
    if len(numbers) != n:
        raise Fault(f"a factor must have {n} numbers; given {len(numbers)}")
    return numbers


# --- lights and cameras -----------------------------------------------------------------------------------------------

_INVERSE_SQUARE = (0.0, 0.0, 1.0)


def light_of(source: dict[str, Any], matrix: NDArray[Any]) -> Light:
    """Make a light of its description and its node's matrix."""
    strength = source.get("intensity", 1.0)
    color = tuple(float(component) * float(strength) for component in source.get("color", (1.0, 1.0, 1.0)))
    direction, position = tuple((-matrix[:3, 2]).tolist()), tuple(matrix[:3, 3].tolist())
    name = source["type"]
    if name == "directional":
        return DirectionalLight(direction, color)
    fall: dict[str, Any] = {"attenuation": _INVERSE_SQUARE, "amplify": True, "range": source.get("range")}
    if name == "point":
        return PointLight(position, color, **fall)
    if name == "spot":
        cone = source.get("spot", {})
        inner = math.degrees(float(cone.get("innerConeAngle", 0.0)))
        outer = float(cone.get("outerConeAngle", math.pi / 4))
        if np.float32(outer) == np.float32(math.pi / 2):  # float32 rounds the largest legal angle up
            outer = math.pi / 2
        outer = math.degrees(outer)
        return SpotLight(position, direction, color, inner, outer, **fall)
    raise Fault(f"its type must be directional, point or spot; given {name!r}")


def camera_of(source: dict[str, Any], matrix: NDArray[Any]) -> Camera:
    """Make a camera of its description and its node's matrix, whose scale doesn't count."""
    eye, up, forward = matrix[:3, 3], matrix[:3, 1], -matrix[:3, 2]
    length = float(np.linalg.norm(forward))
    if not length > 0.0:
        raise Fault("its node's matrix leaves it no direction")
    # A target about as far away as the eye is from the origin keeps every digit of the direction.
    target = eye + forward / length * max(1.0, float(np.abs(eye).max()))
    name = source["type"]
    frame = {"position": eye.tolist(), "target": target.tolist(), "up": up.tolist()}
    if name == "perspective":
        lens = source["perspective"]
        frame["aspect"] = lens.get("aspectRatio")
        return Camera(fov=math.degrees(float(lens["yfov"])), near=lens["znear"], far=lens.get("zfar"), **frame)
    if name == "orthographic":
        lens = source["orthographic"]
        width, height = 2.0 * float(lens.get("xmag", 0.0)), 2.0 * float(lens["ymag"])
        frame["aspect"] = width / height if width > 0.0 and height > 0.0 else None
        return Camera(height=height, near=lens["znear"], far=lens["zfar"], **frame)
    raise Fault(f"its type must be perspective or orthographic; given {name!r}")
