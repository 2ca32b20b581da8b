"""How a surface of a glTF file reflects: metallic and roughness as coefficients of Cook-Torrance's model.

    base color c, metallic m, roughness r         F0 of the dielectric: f = ((ior - 1)/(ior + 1))² · specularColor
    diffuse    c·(1 - m)·(1 - f)                   0.04 where the file says nothing
    fresnel    f·(1 - m) + c·m                     F0 of the whole
    roughness  r²                                  GGX' alpha, at least 0.001
    ambient    diffuse + F0: light from everywhere alike, at normal incidence
    specular   1 + (w - 1)·(1 - m)                 w: strength of KHR_materials_specular

A texture multiplies diffuse and ambient at every sample. F0 and roughness are those of a whole material, so of a
texture of metallic and roughness the means count; and so does that of a base color texture for the F0 of metals.
A material without metallicFactor is a metal, but in files that trimesh has written: it leaves out what it doesn't know.

    KHR_materials_ior, _specular, _emissive_strength    as above; their textures are left out
    KHR_materials_unlit                   emission alone; with a texture, or colours of vertices: diffuse, lit
    KHR_materials_pbrSpecularGlossiness   diffuse d·(1 - F0), F0 = specular, roughness (1 - glossiness)²

Sources: Khronos, glTF 2.0 Specification, 2021, appendix B; the extensions' texts; Schlick 1994 for F0.
"""

from collections.abc import Callable

import numpy as np

from ..scene.material import REFLECTION_MODELS

_WHITE, _BLACK = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
_F0 = 0.04  # of an index of refraction of 1.5
_LEAST_ALPHA = REFLECTION_MODELS["cook-torrance"].least_roughness
_UNLIT, _GLOSSY = "KHR_materials_unlit", "KHR_materials_pbrSpecularGlossiness"


def extension(source: dict, name: str) -> dict:
    """Return an extension of an item of the tree, empty where it has none."""
    return source.get("extensions", {}).get(f"KHR_materials_{name}", {})


def base_of(source: dict) -> tuple[tuple[float, ...], dict | None]:
    """Return the base color and alpha of a material, (4,), and the use of its texture, None where it has none."""
    glossy = source.get("extensions", {}).get(_GLOSSY)
    if glossy is not None:
        return _numbers(glossy.get("diffuseFactor", (1, 1, 1, 1)), 4), glossy.get("diffuseTexture")
    surface = source.get("pbrMetallicRoughness", {})
    return _numbers(surface.get("baseColorFactor", (1, 1, 1, 1)), 4), surface.get("baseColorTexture")


def emission_of(source: dict) -> tuple[float, ...]:
    """Return what a material gives off, linear: nothing where a texture says where it does."""
    if "emissiveTexture" in source:
        return _BLACK
    strength = float(extension(source, "emissive_strength").get("emissiveStrength", 1.0))
    return tuple(strength * value for value in _numbers(source.get("emissiveFactor", _BLACK), 3))


def is_unlit(source: dict) -> bool:
    """Tell whether a material shows its base color whatever the light."""
    return _UNLIT in source.get("extensions", {})


def unlit_fields(base, is_multiplied: bool) -> dict:
    """Return the fields of Material of an unlit surface.

    Parameters
    ----------
    base : (3,) base color, linear
    is_multiplied : whether a texture or colours of vertices multiply it, which do so with the diffuse coefficient only
    """
    diffuse, emissive = (base, _BLACK) if is_multiplied else (_BLACK, base)
    return {"reflection": "lambert", "diffuse": diffuse, "specular": 0.0, "emissive": emissive}


def metallic_unless_given(tree: dict) -> float:
    """Return the metallicFactor of materials that have none."""
    return 0.0 if "trimesh" in str(tree.get("asset", {}).get("generator", "")) else 1.0


def lit_fields(source: dict, base, mean_color, mean_of: Callable[[dict], np.ndarray | None], metallic=1.0) -> dict:
    """Return the fields of Material that say how a surface reflects.

    Parameters
    ----------
    source : dict, a material of the tree
    base : (3,) base color, linear, which the texture multiplies
    mean_color : (3,) the mean of that texture, linear; 1 where there is none
    mean_of : function of the use of a texture of numbers, which returns the mean (4,) of its texels, 0..1; None where
        it is missing
    metallic : metallicFactor of a material that has none
    """
    base, mean_color = np.array(base), np.array(mean_color)
    if (glossy := source.get("extensions", {}).get(_GLOSSY)) is not None:
        f0 = np.array(_numbers(glossy.get("specularFactor", _WHITE), 3))
        smoothness = float(glossy.get("glossinessFactor", 1.0))
        if (mean := _mean(glossy.get("specularGlossinessTexture"), mean_of)) is not None:
            f0, smoothness = f0 * _linear_from_srgb(mean[:3]), smoothness * mean[3]
        return _fields(base * (1.0 - f0.max()), f0, 1.0 - smoothness, 1.0)
    surface = source.get("pbrMetallicRoughness", {})
    metallic = float(surface.get("metallicFactor", 1.0 if "metallicRoughnessTexture" in surface else metallic))
    roughness = float(surface.get("roughnessFactor", 1.0))
    if (mean := _mean(surface.get("metallicRoughnessTexture"), mean_of)) is not None:
        metallic, roughness = metallic * mean[2], roughness * mean[1]
    metallic = min(max(metallic, 0.0), 1.0)
    weight, dielectric = _dielectric_of(source)
    f0 = dielectric * (1.0 - metallic) + base * mean_color * metallic
    diffuse = base * (1.0 - metallic) * (1.0 - weight * dielectric.max())
    ambient = diffuse + base * metallic + weight * dielectric * (1.0 - metallic)
    return _fields(diffuse, f0, roughness, 1.0 + (weight - 1.0) * (1.0 - metallic), ambient)


def _dielectric_of(source) -> tuple[float, np.ndarray]:
    """Return the strength of a material's highlight, and the F0 (3,) that it has where it isn't metal."""
    f0 = _F0
    if "ior" in extension(source, "ior"):
        ior = float(extension(source, "ior")["ior"])
        f0 = ((ior - 1.0) / (ior + 1.0)) ** 2 if ior > 0.0 else 1.0  # 0 stands for infinity: the extension's text
    specular = extension(source, "specular")
    color = np.array(_numbers(specular.get("specularColorFactor", _WHITE), 3))
    return float(specular.get("specularFactor", 1.0)), np.clip(f0 * color, 0.0, 1.0)


def _fields(diffuse, f0, roughness, specular, ambient=None) -> dict:
    """Return fields of Material; a value that rounding, or the file, moved out of its range goes to its end."""
    return {
        "reflection": "cook-torrance",
        "diffuse": tuple(diffuse.tolist()),
        "ambient": tuple((diffuse + f0 if ambient is None else ambient).tolist()),
        "specular": specular,
        "fresnel": tuple(np.clip(f0, 0.0, 1.0).tolist()),
        "roughness": min(max(float(roughness) ** 2, _LEAST_ALPHA), 1.0),
    }


def _mean(use, mean_of) -> np.ndarray | None:
    return None if use is None else mean_of(use)


def _numbers(values, n) -> tuple[float, ...]:
    """Return so many numbers of a list; ValueError where there are more or fewer."""
    numbers = tuple(float(value) for value in values)
    if len(numbers) != n:
        raise ValueError(f"a factor must have {n} numbers; given {len(numbers)}")
    return numbers


def _linear_from_srgb(values) -> np.ndarray:
    """Decode sRGB within 0..1: IEC 61966-2-1."""
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
