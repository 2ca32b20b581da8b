"""Random scenes over everything that a scene can hold, each made from two whole numbers alone: help for the campaign.

    make_case(seed, index) ─ camera ─ meshes (shape, normals, colours, textures) ─ lights ─ options ─ Case

Everything is drawn in units of about the size of the model, and brought to the scene's unit (10^-30..10^30) at the end.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

import rasterizer as rz
from helpers.pinhole import octasphere, torus, unit
from rasterizer.choices import DISTRIBUTIONS, REFLECTIONS
from rasterizer.options import DEFAULT_TOLERANCE
from rasterizer.scene.lights import MAX_LIGHTS
from rasterizer.scene.material import NAMED_MATERIALS
from rasterizer.scene.texture import FILTERS, WRAPS

DEFAULT_RUN = 200  # scenes
SIZE = (16, 12)  # of most pictures, pixels
MANY = 300  # lights


class Case(NamedTuple):
    """A random picture."""

    seed: int
    index: int
    words: str  # what was chosen, for a reader
    scene: rz.Scene
    size: tuple
    options: dict  # of `rz.render`, the tolerance included


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


def make_case(seed: int, index: int) -> Case:
    """Make the picture that two whole numbers stand for."""
    dice = Dice(seed, index)
    lens = make_lens(dice)
    meshes, points = [], []
    for _ in range(2 if dice.chance(0.15) else 1):
        mesh, vertices = make_mesh(dice, lens)
        meshes.append(mesh)
        points.append(vertices)
    lights = make_lights(dice, np.concatenate(points), lens)
    if index % 4 == 2 and not any(getattr(light, "shadow", None) for light in lights):
        lights.append(lamp_by_number(index // 4, lens, dice.scale))
    lights = as_many_as_legal(lights)
    background = tuple(dice.rng.random(3)) if dice.chance(0.2) else None
    options = make_options(dice)
    meshes, options = by_number(index, meshes, options)
    cue = None
    if dice.wild(0.1):
        lengths = np.array([dice.power(-1, 1), dice.between(0, 1)]) * lens.reach * dice.scale
        cue = rz.DepthCue(*lengths.tolist(), dice.rng.random(3))
        dice.words.append("cue")
    dice.words.append(f"unit {dice.scale:.0e}")
    scene = rz.Scene(meshes, lights, scaled_camera(lens.options, dice.scale), background, depth_cue=cue)
    return Case(seed, index, " ".join(dice.words), scene, dice.size, options)


def by_number(index, meshes, options):
    """What is too rare to be left to the dice: materials by their names, F0 as a spectrum, a material of two meshes
    with colours of their own, sixteen samples."""
    one, turn = len(meshes[0].palette) == 1 and meshes[0].material.texture is None, index // 16
    if one and index % 16 == 9:
        name = list(NAMED_MATERIALS)[turn % len(NAMED_MATERIALS)]
        meshes = [replace(meshes[0], material=rz.Material.named(name)), *meshes[1:]]
    if one and index % 16 == 13:
        tinted = replace(meshes[0].material, fresnel=rz.Spectrum((400, 550, 700), (0.2, 0.9, 0.1 + 0.05 * (turn % 9))))
        meshes = [replace(meshes[0], material=tinted), *meshes[1:]]
    if one and index % 16 == 5:  # colours of one mesh between two with greys, which all have one material
        rng, first = np.random.default_rng(index), replace(meshes[0], material=rz.Material(specular=0.3))
        step, colors = 0.2 * np.ptp(first.vertices, axis=0) * (1.0, 0.5, 0.1), rng.random((3, first.n_vertex, 3))
        colors[::2] = colors[::2, :, :1]
        rows = zip((-step, 0 * step, step), colors, strict=True)
        meshes = [*(replace(first, vertices=first.vertices + away, colors=each) for away, each in rows), *meshes[1:]]
    return meshes, options | ({"samples": 16} if index % 64 == 7 else {})


def lamp_by_number(turn, lens, scale):
    """A lamp beside the eye that shines on the model, weakened by all that weakens lamps; some move with the camera."""
    place, way = lens.reach * np.array([0.5, 0.6, 0.1]), np.array([-0.4, -0.45, -1.0])
    options = {"color": (0.5, 0.35, 0.2) if turn % 3 else 0.4, "attached": ("camera", "world")[turn // 2 % 2]}
    options |= {"attenuation": (0.6, 0.3 / (lens.reach * scale), 0.2 / (lens.reach * scale) ** 2)}
    options |= {"range": 4 * lens.reach * scale if turn % 5 else None, "amplify": turn % 7 == 3}
    if options["attached"] == "world":
        eye, *axes = lens.camera.view()[:4]
        place, way = (vector @ np.array([axes[0], axes[1], -axes[2]]) for vector in (place, way))
        place = eye + place
    if turn % 3 == 0:
        u, v = lens.reach * scale * np.array([[0.5, 0.1, 0.0], [0.0, 0.4, 0.2]])
        return rz.AreaLight(place * scale, u, v, resolution=(2, 3), **options)
    cone = {"inner": 2.0 + turn % 20, "outer": 30.0 + turn % 40, "exponent": (0.0, 1.5)[turn % 2]}
    return rz.SpotLight(place * scale, way, **cone, falloff=(0.6, 2.0, 1.0, 3.5)[turn % 4], **options)


def as_many_as_legal(lights) -> list:
    """The lights, without the last ones while they are too many for a scene: the cells of area lights count one by
    one."""
    lights = list(lights)
    while sum(getattr(light, "n_cell", 1) for light in lights) > MAX_LIGHTS:
        lights.pop()
    return lights


# ── cameras ───────────────────────────────────────────────────────────────────────────────────────────────


def make_lens(dice) -> Lens:
    """A camera that looks at the model, from outside or from within."""
    kind = dice.choose(perspective=5, inside=1.5, orthographic=2, opencv=1)
    fov = dice.between(1, 175) if dice.wild(0.4) else dice.between(15, 80)
    fov = dice.power(0, 2) if dice.wild(0.2) else fov
    reach = dice.between(0.8, 3) / np.tan(np.radians(fov) / 2)
    if kind == "orthographic":
        reach = dice.power(-1, 2)
    elif kind == "inside":
        reach = dice.between(0.1, 0.8)
    target = dice.rng.normal(0, 0.2, 3) if dice.chance(0.7) else np.zeros(3)
    options = {"position": target - reach * dice.direction(), "target": target, "up": dice.direction()}
    if kind == "orthographic":
        options["height"] = dice.power(-0.5, 0.8)
    elif kind == "opencv":
        focal = 0.5 * dice.size[1] / np.tan(np.radians(fov) / 2)
        center = np.array(dice.size) * dice.rng.uniform(-0.3, 1.3, 2)
        options |= {"fov": 45.0, "intrinsics": (focal, focal * dice.between(0.8, 1.2), *center), "size": dice.size}
        if dice.chance(0.7):
            options["skew"] = focal * (dice.power(-3, 1.5) if dice.wild(0.5) else dice.between(0.0, 0.5))
            options["skew"] *= dice.rng.choice([-1.0, 1.0])
            dice.words.append(f"skew {options['skew'] / focal:.3g}")
    else:
        options["fov"] = fov
    if dice.wild(0.25):
        options["near"] = reach * (dice.power(-20, 0) if dice.chance(0.5) else dice.between(0.4, 1.3))
        dice.words.append("near")
    if dice.wild(0.12):
        options["far"] = max(reach, options.get("near", 0.0)) * dice.between(1.05, 2)
        dice.words.append("far")
    return Lens(options, rz.Camera(**options), reach)


def scaled_camera(options, scale) -> rz.Camera:
    """The camera in the scene's unit."""
    names = ("position", "target", "height", "near", "far")
    return rz.Camera(**(options | {name: np.multiply(options[name], scale) for name in names if name in options}))


# ── meshes ────────────────────────────────────────────────────────────────────────────────────────────────


def make_mesh(dice, lens):
    """A model of few faces with all that belongs to its corners, and its vertices in its own units."""
    materials = make_materials(dice)
    shape = dice.choose(soup=4, screen=3, slivers=1.5, specks=1, floor=1.5, cube=1, sphere=1.5, torus=1, twins=1)
    vertices, faces = SHAPES[shape](dice, lens)
    given = {"material": materials[0]}
    if len(materials) > 1:
        given = {"materials": materials, "face_material": dice.rng.integers(0, len(materials), len(faces))}
    elif shape == "cube" and dice.chance(0.5):
        given["polygons"] = np.tile(np.arange(6), 2)
    if any(material.needs_uv for material in materials):
        corners = (len(vertices), 2) if dice.chance(0.6) else (len(faces), 3, 2)
        given["uv"] = dice.rng.normal(0.5, dice.power(-1, 1), corners)
    if dice.chance(0.25):
        values = dice.rng.random((len(vertices), int(dice.rng.choice([3, 4]))))
        given["colors"] = (255 * values).astype(np.uint8) if dice.chance(0.3) else values
        dice.words.append("colours")
    elif dice.chance(0.1):
        given["face_colors"] = dice.rng.random((len(faces), 3))
    return rz.Mesh(vertices * dice.scale, faces, **given, **make_normals(dice, vertices, faces, shape)), vertices


def make_normals(dice, vertices, faces, shape) -> dict:
    """Normals from the file, good and bad ones, or a crease angle."""
    bad = 0.0 if dice.is_plain else 1.0
    kind = dice.choose(made=2, smooth=3, tilted=3, reversed=bad, zero=0.6 * bad, random=bad)
    if kind == "made":
        weighting = str(dice.rng.choice(["angle", "area", "uniform"]))
        return {"crease_angle": float(dice.rng.choice([0.0, 30.0, 180.0])), "weighting": weighting}
    if kind == "smooth" and shape in ("sphere", "torus", "cube"):
        return {"normals": unit(vertices + 1e-300)}
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    flat = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
    spread = dice.power(-6, 0) if kind == "tilted" else 0.3
    normals = unit(np.repeat(flat[:, None], 3, axis=1) + dice.rng.normal(0, spread, (len(faces), 3, 3)))
    if kind == "random":
        normals = unit(dice.rng.normal(size=normals.shape))
    if kind in ("reversed", "zero"):
        normals[dice.rng.random(normals.shape[:2]) < 0.4] *= -1.0 if kind == "reversed" else 0.0
    return {"normals": normals}


def in_camera(dice, lens, places, depth) -> np.ndarray:
    """The points (n, 3) that lie at places (n, 2) of the picture, in pixels, and at depths (n,)."""
    eye, right, up, forward = lens.camera.view()
    scale_x, scale_y, center_x, center_y, is_perspective, skew = lens.camera.projection(dice.size)
    spread = depth if is_perspective else np.ones_like(depth)
    y = (center_y - places[:, 1]) / scale_y
    x = (places[:, 0] - center_x + skew * y) / scale_x
    x, y = x * spread, y * spread
    return eye + x[:, None] * right + y[:, None] * up + depth[:, None] * forward


def _soup(dice, lens):
    n = int(dice.rng.integers(1, 9))
    points = dice.rng.normal(0, 0.4, (n, 1, 3)) + dice.rng.normal(0, dice.power(-0.7, 0.3), (n, 3, 3))
    if n > 1 and dice.chance(0.2):
        points[-1, 2] = points[0, 1]
    if n > 1 and dice.chance(0.1):
        points[-1, 2] = points[-1, 1]  # a face without an area
    return _loose(points)


def _screen(dice, lens):
    """Triangles placed on the picture, up to 10^7 times as far away at one corner as at another."""
    n = int(dice.rng.integers(1, 5))
    spread = dice.rng.choice([0.3, 1.0, 30.0, 1000.0], p=[0.3, 0.5, 0.15, 0.05])
    places = (0.5 + spread * dice.rng.uniform(-0.8, 0.8, (3 * n, 2))) * dice.size
    ratio = dice.power(0, 7) if dice.wild(0.6) else dice.between(1, 4)
    depth = lens.reach * ratio ** dice.rng.uniform(0, 1, 3 * n)
    if dice.chance(0.3):
        depth[::3], depth[1::3] = lens.reach, lens.reach * ratio
    return _loose(in_camera(dice, lens, places, depth).reshape(n, 3, 3))


def _slivers(dice, lens):
    """Triangles a few sub-pixels wide."""
    rng, n = dice.rng, int(dice.rng.integers(2, 8))
    middle, angle = rng.uniform(0, 1, (n, 2)) * dice.size, rng.uniform(0, np.pi, n)
    along = np.stack([np.cos(angle), np.sin(angle)], axis=1) * rng.choice([6, 40, 2**12], (n, 1))
    third = middle + along * rng.uniform(-0.9, 0.9, (n, 1)) + rng.choice([-30, 2, 50, 300], (n, 2)) / 256
    points = np.stack([middle - along, middle + along, third], axis=1).reshape(-1, 2)
    return _loose(in_camera(dice, lens, points, lens.reach * rng.uniform(1, 3, 3 * n)).reshape(n, 3, 3))


def _specks(dice, lens):
    """Triangles about as large as a pixel, or smaller."""
    n = int(dice.rng.integers(10, 40))
    center = dice.rng.uniform(0, 1, (n, 1, 2)) * dice.size
    points = (center + dice.between(0.2, 2) * dice.rng.uniform(-1, 1, (n, 3, 2))).reshape(-1, 2)
    return _loose(in_camera(dice, lens, points, lens.reach * dice.rng.uniform(1, 2, 3 * n)).reshape(n, 3, 3))


def _floor(dice, lens):
    """A large level square below the eye or above it, and another one across it."""
    reach = dice.power(0, 7) if dice.wild(0.3) else dice.power(0, 3)
    square = np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]]) * reach
    height = lens.camera.position[1] - lens.reach * dice.between(0, 1) * dice.rng.choice([-1, 1])
    slabs = [square + (0, height, 0)]
    if dice.chance(0.3):
        slabs.append(square[:, [1, 0, 2]] * 0.5)
    faces = np.concatenate([np.array([[0, 3, 2], [0, 2, 1]]) + 4 * k for k in range(len(slabs))])
    return np.concatenate(slabs) + dice.rng.normal(0, 1e-4, 3), faces


def _cube(dice, lens):
    vertices = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * dice.rng.uniform(0.3, 1, 3)
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    return vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def _sphere(dice, lens):
    vertices, faces = octasphere(int(dice.rng.integers(0, 2)))
    return vertices * (dice.rng.uniform(0.3, 1, 3) if dice.chance(0.5) else 1.0), faces


def _torus(dice, lens):
    vertices, faces = torus(5, 4)
    return 0.8 * vertices, faces


def _twins(dice, lens):
    """Faces that lie on each other, corner by corner: the one with the lower number is seen."""
    points, faces = _screen(dice, lens) if dice.chance(0.7) else _soup(dice, lens)
    return np.concatenate([points, points]), np.concatenate([faces, faces[::-1] + len(points)])


def _loose(points):
    """Vertices and faces of triangles (n, 3, 3) that share nothing."""
    return points.reshape(-1, 3), np.arange(3 * len(points)).reshape(-1, 3)


SHAPES = {
    "soup": _soup, "screen": _screen, "slivers": _slivers, "specks": _specks, "floor": _floor,
    "cube": _cube, "sphere": _sphere, "torus": _torus, "twins": _twins,
}  # fmt: skip


# ── options ───────────────────────────────────────────────────────────────────────────────────────────────


def make_options(dice) -> dict:
    """The options of the picture."""
    tolerance = DEFAULT_TOLERANCE if dice.chance(0.55) else dice.power(-6, -1)
    options = {
        "shading": dice.choose(flat=2, gouraud=4, phong=5),
        "tolerance": 0.0 if dice.wild(0.05) else tolerance,
        "samples": int(dice.rng.choice([1, 4, 9, 16], p=[0.88, 0.09, 0.015, 0.015])),
        "cull": dice.choose(auto=6, none=3, back=1),
        "color_range": str(dice.rng.choice(["clamp", "global", "local"], p=[0.8, 0.1, 0.1])),
        "exposure": dice.between(-4, 4) if dice.wild(0.2) else 0.0,
        "spectral": int(dice.rng.integers(3, 12)) if dice.wild(0.05) else None,
    }
    dice.words += [f"{name}={options[name]:.3g}" for name in ("tolerance", "exposure") if options[name]]
    dice.words += [f"{name}={options[name]}" for name in ("samples", "spectral") if options[name] not in (None, 1)]
    return options


# ── materials ─────────────────────────────────────────────────────────────────────────────────────────────


def make_materials(dice) -> list:
    """One material, or several, each with or without a texture and its alpha."""
    is_grey, has_texture, is_clear = dice.chance(0.5), dice.wild(0.3), dice.wild(0.25)
    if not dice.chance(0.2):
        return [make_material(dice, is_grey, has_texture, is_clear)]
    return [
        make_material(dice, is_grey, has_texture and dice.chance(0.8), is_clear and dice.chance(0.7)) for _ in range(4)
    ]


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
    if model == "cook-torrance" and dice.chance(0.4):
        brush |= {"metallic": float(dice.rng.choice([1.0, dice.rng.random()])), "metal": color()}
        if has_texture and np.size(brush["roughness"]) == 1 and brush["distribution"] == "ggx":
            brush["metallic_roughness"] = make_texture(dice.rng)
        dice.words.append("metal")
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
        texture=make_texture(dice.rng) if has_texture else None,
        **brush,
    )
    if has_texture and material.texture.has_alpha and int(1e6 * n) % 3 == 0:  # no draw of its own: scenes stay theirs
        material = replace(material, alpha_cutoff=0.5)
        dice.words.append("cut out")
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


def make_texture(rng) -> rz.Texture:
    """A small picture, of bytes or floats, some with alpha."""
    n_channel = int(rng.choice([1, 3, 3, 4]))
    image = rng.random((*rng.integers(1, 6, 2), n_channel))
    image = (255 * image).astype(np.uint8) if rng.random() < 0.4 else image
    wrap = tuple(str(word) for word in rng.choice(WRAPS, 2))
    return rz.Texture(image, str(rng.choice(FILTERS)), wrap)


# ── lights ────────────────────────────────────────────────────────────────────────────────────────────────


def make_lights(dice, points, lens) -> list:
    """Lights of all kinds, near and far, few and sometimes very many.

    `points` (n, 3) are vertices of the model, in its own units.
    """
    n = int(dice.rng.integers(1, 4))
    if dice.chance(0.03):
        n = int(dice.power(1, 2.3))
    if dice.size != SIZE and dice.chance(0.12):
        n = int(dice.power(2, 4))
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
