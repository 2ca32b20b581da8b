"""Random materials and lights, and the dice that the campaign's scenes are drawn with: help for the campaign."""

from typing import NamedTuple

import numpy as np

import rasterizer as rz
from helpers.pinhole import unit
from rasterizer.choices import DISTRIBUTIONS, REFLECTIONS
from rasterizer.scene.texture import FILTERS, WRAPS

SIZE = (16, 12)  # of most pictures, pixels
MOST_LIGHTS = 1e4
MANY = 300  # lights


class Dice:
    """Draw numbers and words, and keep the words for a reader.

    `is_plain` asks for what a person would choose, so that float32 is good enough for most of the pictures.
    """

    def __init__(self, seed: int, index: int):
        self.rng = np.random.default_rng((seed, index))
        self.words = []
        self.is_plain = self.chance(0.5)
        self.scale = self._unit()
        self.size = (4, 3) if self.chance(0.04) else SIZE

    def chance(self, share: float) -> bool:
        """Decide with a probability."""
        return bool(self.rng.random() < share)

    def wild(self, share: float) -> bool:
        """Decide with a probability, unless the scene shall be plain."""
        return self.chance(share) and not self.is_plain

    def between(self, low, high) -> float:
        """A number."""
        return float(self.rng.uniform(low, high))

    def power(self, low, high) -> float:
        """A number between two powers of ten, given by their exponents."""
        return float(10.0 ** self.rng.uniform(low, high))

    def choose(self, **weights) -> str:
        """Choose a word by its weight, and note it down."""
        names, shares = list(weights), np.array(list(weights.values()), float)
        word = names[int(self.rng.choice(len(names), p=shares / shares.sum()))]
        self.words.append(word)
        return word

    def direction(self) -> np.ndarray:
        """A unit vector; sometimes one along an axis, so that products are exactly 0 or 1."""
        if self.wild(0.2):
            return self.rng.permutation([0.0, 0.0, 1.0]) * self.rng.choice([-1.0, 1.0])
        return unit(self.rng.normal(size=3))

    def _unit(self) -> float:
        """The scene's unit: mostly 1, else a power of ten, or any number."""
        kind = self.rng.random()
        if self.is_plain or kind < 0.3:
            return 1.0 if kind < 0.6 else self.power(-4, 4)
        return self.power(-4, 4) if kind < 0.6 else self.power(-30, 30)


class Lens(NamedTuple):
    """A camera in units of the model, and what places geometry before it."""

    options: dict  # of `rz.Camera`
    camera: rz.Camera
    reach: float  # how far the model is away


# ── materials ─────────────────────────────────────────────────────────────────────────────────────────────


def make_materials(dice) -> list:
    """One material, or several."""
    is_grey, has_texture, is_clear = dice.chance(0.5), dice.wild(0.3), dice.wild(0.25)
    n = 3 if dice.chance(0.2) else 1
    return [make_material(dice, is_grey, has_texture, is_clear) for _ in range(n)]


def make_material(dice, is_grey, has_texture, is_clear) -> rz.Material:
    """A material of any model, its numbers anywhere within what is legal."""

    def color(most=1.0):
        if dice.chance(0.1):
            return 0.0
        if dice.wild(0.02):
            return rz.Spectrum(np.linspace(400, 700, 4), most * dice.rng.random(4))
        return most * (float(dice.rng.random()) if is_grey else dice.rng.random(3))

    model = str(dice.rng.choice(REFLECTIONS, p=[0.34, 0.2, 0.14, 0.1, 0.14, 0.08]))
    model = "lambert" if model == "toon" and dice.is_plain else model
    n, roughness = dice.power(0, 2.3), dice.between(0.3, 1)
    if dice.wild(0.5):
        n, roughness = dice.power(-1.3, 6), dice.power(-3, 0)
    dice.words.append(f"{model}({roughness if model in ('cook-torrance', 'oren-nayar') else n:.3g})")
    brush = {"roughness": max(roughness, 0.001), "distribution": str(dice.rng.choice(DISTRIBUTIONS))}
    if model == "cook-torrance" and dice.wild(0.3):
        brush = {"roughness": (max(roughness, 0.001), dice.power(-2, 0)), "distribution": "ggx"}
        brush["tangent"] = "u" if has_texture else dice.direction()
        dice.words.append("brushed")
    material = rz.Material(
        ambient=None if dice.chance(0.5) else color(),
        diffuse=color(),
        specular=color(0.5),
        shininess=n,
        emissive=color(0.2) if dice.chance(0.1) else 0.0,
        opacity=_opacity(dice) if is_clear and dice.chance(0.8) else 1.0,
        reflection=model,
        fresnel=_fresnel(dice, is_grey),
        normalized=dice.chance(0.25),
        levels=int(dice.rng.integers(1, 7)),
        texture=_texture(dice) if has_texture else None,
        **brush,
    )
    notes = ("clear", not material.is_opaque), (getattr(material.texture, "filter", ""), has_texture)
    dice.words += [word for word, is_it in (*notes, ("normalized", material.normalized)) if is_it]
    return material


def _fresnel(dice, is_grey):
    """F0: mostly none, a number, or a colour."""
    if dice.chance(0.75):
        return None
    return dice.rng.random() if is_grey or dice.chance(0.5) else dice.rng.random(3)


def _opacity(dice) -> float:
    """A share of what is seen that is the surface itself."""
    shares = dice.rng.random(), dice.power(-7, 0), 0.0, 1.0 - dice.power(-7, -1)
    return float(dice.rng.choice(shares, p=[0.6, 0.2, 0.1, 0.1]))


def _texture(dice) -> rz.Texture:
    """A small picture, of bytes or floats, some with alpha."""
    n_channel = int(dice.rng.choice([1, 3, 3, 4]))
    image = dice.rng.random((*dice.rng.integers(1, 6, 2), n_channel))
    image = (255 * image).astype(np.uint8) if dice.chance(0.4) else image
    wrap = tuple(str(word) for word in dice.rng.choice(WRAPS, 2))
    return rz.Texture(image, str(dice.rng.choice(FILTERS)), wrap)


# ── lights ────────────────────────────────────────────────────────────────────────────────────────────────


def make_lights(dice, points, lens) -> list:
    """Lights of all kinds, near and far, few and sometimes very many.

    `points` (n, 3) are vertices of the model, in its own units.
    """
    n = int(dice.rng.integers(1, 4))
    if dice.chance(0.03):
        n = int(dice.power(1, 2.3))
    if dice.size != SIZE and dice.chance(0.12):
        n = int(dice.power(2, np.log10(MOST_LIGHTS)))
        n = n if n % 16 == 0 else min(n, MANY)  # thousands take half a minute: a few times are enough
    is_grey = dice.chance(0.5)
    strength = dice.between(0.3, 1.5) / (n if n > 4 else 1.0) * (dice.power(-3, 3) if dice.wild(0.2) else 1.0)
    kinds = [str(kind) for kind in dice.rng.choice(list(LIGHTS), min(n, 3), p=[0.4, 0.3, 0.24, 0.06])]
    has_shadows = dice.wild(0.1) and n < 5
    dice.words.append(f"{n}×({', '.join(sorted(set(kinds)))})" + (" shadows" if has_shadows else ""))
    lights = [rz.AmbientLight(_light_color(dice, is_grey, dice.between(0, 0.3)))] if dice.chance(0.7) else []
    for number in range(n):
        options = {
            "color": _light_color(dice, is_grey, strength),
            "attached": "camera" if dice.chance(0.25) else "world",
        }
        options["shadow"] = rz.Shadow(size=64, filter=int(dice.rng.choice([1, 3]))) if has_shadows else None
        lights.append(LIGHTS[kinds[number % len(kinds)]](dice, points, lens, options))
    return lights


def _light_color(dice, is_grey, strength):
    """A light's colour; few are black, few are spectra."""
    if dice.wild(0.03):
        return 0.0
    if dice.wild(0.02):
        return rz.Spectrum(np.linspace(400, 700, 4), strength * dice.rng.random(4))
    return strength * (dice.rng.random() if is_grey else dice.rng.random(3))


def _place(dice, points, lens, options) -> np.ndarray:
    """A place before the model, on it, next to it or far away, in the frame that the light is attached to."""
    kind = dice.rng.random()
    corners = points[dice.rng.integers(0, len(points), 3)]
    on, way = dice.rng.dirichlet([1, 1, 1]) @ corners, unit(dice.rng.normal(size=3))
    if dice.is_plain or kind < 0.5:
        place = on + lens.reach * dice.between(0.3, 3) * way
    elif kind < 0.7:
        place = on + dice.power(-9, 0) * way
    elif kind < 0.8:
        place = on if dice.chance(0.7) else corners[0]
    else:
        place = on + dice.power(1, 25) * way
    if options["attached"] == "camera":
        eye, right, up, forward = lens.camera.view()
        place = np.array([(place - eye) @ axis for axis in (right, up, -forward)])
    return place


def _weakened(dice, distance) -> dict:
    """What weakens a light with the distance, about as much as it should at a given one; or makes it stronger."""
    kc, kl, kq = 1.0, 0.0, 0.0
    kind = dice.rng.random()
    if kind < 0.15:
        kc, kl = dice.rng.random(), 1.0 / distance
    elif kind < 0.3:
        kc, kq = 0.0, 1.0 / distance**2
    elif kind < 0.5:
        kc, kl, kq = dice.rng.random(), dice.rng.random() / distance, dice.rng.random() / distance**2
    found = {"attenuation": (kc, kl / dice.scale, kq / dice.scale**2), "amplify": dice.wild(0.3)}
    if dice.wild(0.3):
        found["range"] = distance * dice.between(0.5, 4) * dice.scale
    return found


def _directional(dice, points, lens, options):
    return rz.DirectionalLight(dice.direction(), **options)


def _point(dice, points, lens, options):
    place = _place(dice, points, lens, options)
    return rz.PointLight(place * dice.scale, **options, **_weakened(dice, lens.reach))


def _spot(dice, points, lens, options):
    place = _place(dice, points, lens, options)
    axis = -place if options["attached"] == "world" else np.array([0.0, 0.0, -1.0])
    axis = axis + (np.linalg.norm(axis) + 1e-300) * dice.rng.normal(0, 0.2, 3)
    outer = dice.between(20, 90) if not dice.wild(0.3) else dice.power(-1, 1.9)
    inner = dice.between(0, 0.8) * outer
    exponent = dice.between(0, 5) if dice.chance(0.5) else 0.0
    if dice.wild(0.5):
        inner = float(dice.rng.choice([outer, outer * (1 - dice.power(-6, 0))]))
    if dice.wild(0.3):
        exponent = dice.power(-1.3, 4)
    options |= {"inner": inner, "outer": outer, "exponent": exponent}
    options["falloff"] = dice.power(-1, 1) if dice.wild(0.2) else 1.0
    return rz.SpotLight(place * dice.scale, axis, **options, **_weakened(dice, lens.reach))


def _area(dice, points, lens, options):
    place = _place(dice, points, lens, options)
    edges = dice.rng.normal(0, 0.5, (2, 3)) * lens.reach
    cells = tuple(int(m) for m in dice.rng.integers(1, 4, 2))
    return rz.AreaLight(
        place * dice.scale, *(edges * dice.scale), resolution=cells, **options, **_weakened(dice, lens.reach)
    )


LIGHTS = {"directional": _directional, "point": _point, "spot": _spot, "area": _area}
