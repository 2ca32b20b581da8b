"""Random scenes over everything that a scene can hold, each made from two whole numbers alone: help for the campaign.

    make_case(seed, index) ─ camera ─ mesh (shape, normals, colours, texture) ─ materials ─ lights ─ options ─ Case

Everything is drawn in units of about the size of the model, and brought to the scene's unit (10^-30..10^30) at the end.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from pinhole import octasphere, torus, unit

import rasterizer as rz
from rasterizer.options import DEFAULT_TOLERANCE
from rasterizer.scene.material import DISTRIBUTIONS, REFLECTIONS
from rasterizer.scene.texture import FILTERS, WRAPS

SIZE = (16, 12)
MANY = 1e4  # lights, at most


class Case(NamedTuple):
    """A random picture."""

    seed: int
    index: int
    words: str  # what was chosen, for a reader
    scene: rz.Scene
    size: tuple
    options: dict  # of `rz.render`, the tolerance included


class Lens(NamedTuple):
    """A camera in units of the model, and what places geometry before it."""

    options: dict  # of `rz.Camera`
    camera: rz.Camera
    reach: float  # how far the model is away


def make_case(seed: int, index: int) -> Case:
    """Make the picture that two whole numbers stand for."""
    rng = np.random.default_rng((seed, index))
    words = []
    size = (4, 3) if rng.random() < 0.04 else SIZE
    scale = pick_unit(rng)
    lens = make_lens(rng, size, words)
    material, materials = make_materials(rng, words)
    meshes = [make_mesh(rng, lens, size, material, materials, scale, words)]
    if rng.random() < 0.15:
        words.append("and")
        meshes.append(make_mesh(rng, lens, size, *make_materials(rng, words), scale, words))
    lights = make_lights(rng, meshes[0].vertices / scale, lens, scale, size, words)
    background = tuple(rng.random(3)) if rng.random() < 0.2 else None
    camera = scaled_camera(lens.options, scale)
    options = make_options(rng, words)
    words.append(f"unit {scale:.0e}")
    return Case(seed, index, " ".join(words), rz.Scene(meshes, lights, camera, background), size, options)


def chance(rng, share, *words) -> bool:
    """Decide with a probability."""
    return bool(rng.random() < share)


def log_uniform(rng, low, high) -> float:
    """A number between two powers of ten, given by their exponents."""
    return float(10.0 ** rng.uniform(low, high))


def choose(rng, words, **weights) -> str:
    """Choose a word by its weight, and note it down."""
    names = list(weights)
    shares = np.array(list(weights.values()), float)
    word = names[int(rng.choice(len(names), p=shares / shares.sum()))]
    words.append(word)
    return word


def direction(rng) -> np.ndarray:
    """A unit vector; sometimes one along an axis, so that products are exactly 0 or 1."""
    if rng.random() < 0.2:
        return rng.permutation([0.0, 0.0, 1.0]) * rng.choice([-1.0, 1.0])
    return unit(rng.normal(size=3))


def pick_unit(rng) -> float:
    """The scene's unit: mostly 1, else a power of ten, or any number."""
    kind = rng.random()
    if kind < 0.55:
        return 1.0
    return log_uniform(rng, -4, 4) if kind < 0.8 else log_uniform(rng, -30, 30)


# ── cameras ───────────────────────────────────────────────────────────────────────────────────────────────


def make_lens(rng, size, words) -> Lens:
    """A camera that looks at the model, from outside or from within."""
    kind = choose(rng, words, perspective=5, inside=1.5, orthographic=2, opencv=1)
    way = direction(rng)
    if kind == "orthographic":
        reach = log_uniform(rng, -1, 2)
        options = {"height": log_uniform(rng, -0.5, 0.8)}
    else:
        fov = float(rng.choice([rng.uniform(15, 80), rng.uniform(1, 175), log_uniform(rng, 0, 2)]))
        reach = rng.uniform(0.1, 0.8) if kind == "inside" else rng.uniform(0.8, 3) / np.tan(np.radians(fov) / 2)
        options = {"fov": fov}
    target = rng.normal(0, 0.2, 3) if chance(rng, 0.7) else np.zeros(3)
    options |= {"position": target - reach * way, "target": target, "up": direction(rng)}
    if kind == "opencv":
        focal = 0.5 * size[1] / np.tan(np.radians(options.pop("fov")) / 2)
        center = np.array(size) * rng.uniform(-0.3, 1.3, 2)
        options |= {"fov": 45.0, "intrinsics": (focal, focal * rng.uniform(0.8, 1.2), *center), "size": size}
    if chance(rng, 0.15):
        options["near"] = reach * (log_uniform(rng, -6, 0) if chance(rng, 0.5) else rng.uniform(0.4, 1.3))
        words.append("near")
    if chance(rng, 0.08):
        options["far"] = max(reach, options.get("near", 0.0)) * rng.uniform(1.05, 2)
        words.append("far")
    return Lens(options, rz.Camera(**options), reach)


def scaled_camera(options, scale) -> rz.Camera:
    """The camera in the scene's unit."""
    lengths = {name: np.multiply(options[name], scale) for name in ("position", "target", "height", "near", "far") if name in options}
    return rz.Camera(**(options | lengths))


# ── meshes ────────────────────────────────────────────────────────────────────────────────────────────────


def make_mesh(rng, lens, size, material, materials, scale, words) -> rz.Mesh:
    """A model of few faces, with all that belongs to its corners."""
    shape = choose(rng, words, soup=4, screen=3, slivers=1.5, specks=1, floor=1.5, cube=1, sphere=1.5, torus=1, twins=1)
    vertices, faces = SHAPES[shape](rng, lens, size)
    given = {"material": material} if materials is None else {
        "materials": materials, "face_material": rng.integers(0, len(materials), len(faces))
    }  # fmt: skip
    if materials is None or all(each.texture is None for each in materials):
        has_texture = material.texture is not None
    else:
        has_texture = True
    if has_texture:
        corners = (len(vertices), 2) if chance(rng, 0.6) else (len(faces), 3, 2)
        given["uv"] = rng.normal(0.5, log_uniform(rng, -1, 1), corners)
    if chance(rng, 0.25):
        values = rng.random((len(vertices), int(rng.choice([3, 4]))))
        given["colors"] = (255 * values).astype(np.uint8) if chance(rng, 0.3) else values
        words.append("colours")
    elif chance(rng, 0.1):
        given["face_colors"] = rng.random((len(faces), 3))
    given |= make_normals(rng, vertices, faces, shape, words)
    return rz.Mesh(vertices * scale, faces, **given)


def make_normals(rng, vertices, faces, shape, words) -> dict:
    """Normals from the file, good and bad ones, or a crease angle."""
    kind = choose(rng, words, made=2, smooth=3, tilted=3, reversed=1, zero=0.6, random=1)
    if kind == "made":
        return {"crease_angle": float(rng.choice([0.0, 30.0, 180.0]))}
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    flat = unit(np.cross(b - a, c - a) + 1e-300)
    if kind == "smooth" and shape in ("sphere", "torus", "cube"):
        return {"normals": unit(vertices + 1e-300)}
    spread = log_uniform(rng, -6, 0) if kind == "tilted" else 0.3
    normals = unit(np.repeat(flat[:, None], 3, axis=1) + rng.normal(0, spread, (len(faces), 3, 3)))
    if kind == "random":
        normals = unit(rng.normal(size=normals.shape))
    if kind in ("reversed", "zero"):
        factor = -1.0 if kind == "reversed" else 0.0
        normals[rng.random(normals.shape[:2]) < 0.4] *= factor
    return {"normals": normals}


def in_camera(lens, size, places, depth) -> np.ndarray:
    """The points (n, 3) that lie at places (n, 2) of the picture, in pixels, and at depths (n,)."""
    eye, right, up, forward = lens.camera.view()
    scale_x, scale_y, center_x, center_y, is_perspective = lens.camera.projection(size)
    spread = depth if is_perspective else np.ones_like(depth)
    x, y = (places[:, 0] - center_x) / scale_x * spread, (center_y - places[:, 1]) / scale_y * spread
    return eye + x[:, None] * right + y[:, None] * up + depth[:, None] * forward


def _soup(rng, lens, size):
    n = int(rng.integers(1, 9))
    center = rng.normal(0, 0.4, (n, 1, 3))
    points = center + rng.normal(0, log_uniform(rng, -0.7, 0.3), (n, 3, 3))
    if chance(rng, 0.2):
        points[rng.integers(n), 2] = points[0, 1]  # may leave a face without an area
    points[0] += rng.normal(0, 1e-3, (3, 3))
    return _loose(points)


def _screen(rng, lens, size):
    """Triangles placed on the picture, up to 10^7 times as far away at one corner as at another."""
    n = int(rng.integers(1, 5))
    spread = rng.choice([0.3, 1.0, 30.0, 1000.0], p=[0.3, 0.5, 0.15, 0.05])
    places = (0.5 + spread * rng.uniform(-0.8, 0.8, (3 * n, 2))) * size
    ratio = log_uniform(rng, 0, 7) if chance(rng, 0.4) else rng.uniform(1, 4)
    depth = lens.reach * ratio ** rng.uniform(0, 1, 3 * n)
    if chance(rng, 0.3):
        depth[::3], depth[1::3] = lens.reach, lens.reach * ratio
    return _loose(in_camera(lens, size, places, depth).reshape(n, 3, 3))


def _slivers(rng, lens, size):
    """Triangles a few sub-pixels wide."""
    n = int(rng.integers(2, 8))
    middle, angle = rng.uniform(0, 1, (n, 2)) * size, rng.uniform(0, np.pi, n)
    along = np.stack([np.cos(angle), np.sin(angle)], axis=1) * rng.choice([6, 40, 2**12], (n, 1))
    third = middle + along * rng.uniform(-0.9, 0.9, (n, 1)) + rng.choice([-30, 2, 50, 300], (n, 2)) / 256
    points = np.stack([middle - along, middle + along, third], axis=1).reshape(-1, 2)
    return _loose(in_camera(lens, size, points, lens.reach * rng.uniform(1, 3, 3 * n)).reshape(n, 3, 3))


def _specks(rng, lens, size):
    """Triangles about as large as a pixel, or smaller."""
    n = int(rng.integers(10, 40))
    center = rng.uniform(0, 1, (n, 1, 2)) * size
    points = (center + rng.uniform(0.2, 2) * rng.uniform(-1, 1, (n, 3, 2))).reshape(-1, 2)
    return _loose(in_camera(lens, size, points, lens.reach * rng.uniform(1, 2, 3 * n)).reshape(n, 3, 3))


def _floor(rng, lens, size):
    """A large level square, next to the eye or below it, and another one across it."""
    reach = log_uniform(rng, 0, 3 if chance(rng, 0.8) else 7)
    square = np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]]) * reach
    height = lens.camera.position[1] - lens.reach * rng.uniform(0, 1) * rng.choice([-1, 1])
    slabs = [square + (0, height, 0)]
    if chance(rng, 0.3):
        slabs.append(square[:, [1, 0, 2]] * 0.5)
    vertices = np.concatenate(slabs) + rng.normal(0, 1e-4, 3)
    faces = np.concatenate([np.array([[0, 3, 2], [0, 2, 1]]) + 4 * k for k in range(len(slabs))])
    return vertices, faces


def _cube(rng, lens, size):
    vertices = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * rng.uniform(0.3, 1, 3)
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    return vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def _sphere(rng, lens, size):
    vertices, faces = octasphere(int(rng.integers(0, 2)))
    return vertices * (rng.uniform(0.3, 1, 3) if chance(rng, 0.5) else 1.0), faces


def _torus(rng, lens, size):
    vertices, faces = torus(5, 4)
    return 0.8 * vertices, faces


def _twins(rng, lens, size):
    """Faces that lie on each other, corner by corner: the one with the lower number is seen."""
    points, faces = _screen(rng, lens, size) if chance(rng, 0.7) else _soup(rng, lens, size)
    return np.concatenate([points, points]), np.concatenate([faces, faces[::-1] + len(points)])


def _loose(points):
    """Vertices and faces of triangles (n, 3, 3) that share nothing."""
    return points.reshape(-1, 3), np.arange(3 * len(points)).reshape(-1, 3)


SHAPES = {
    "soup": _soup, "screen": _screen, "slivers": _slivers, "specks": _specks, "floor": _floor,
    "cube": _cube, "sphere": _sphere, "torus": _torus, "twins": _twins,
}  # fmt: skip


# ── materials ─────────────────────────────────────────────────────────────────────────────────────────────


def make_materials(rng, words):
    """One material, or several: (material, None) or (the first, all)."""
    is_grey, has_texture, is_clear = chance(rng, 0.5), chance(rng, 0.15), chance(rng, 0.12)
    materials = [make_material(rng, is_grey, has_texture, is_clear, words) for _ in range(3 if chance(rng, 0.2) else 1)]
    return materials[0], (None if len(materials) == 1 else materials)


def make_material(rng, is_grey, has_texture, is_clear, words) -> rz.Material:
    """A material of any model, its numbers anywhere within what is legal."""
    def color(most=1.0):
        kind = rng.random()
        if kind < 0.1:
            return 0.0
        if kind > 0.98:
            return rz.Spectrum(np.linspace(400, 700, 4), most * rng.random(4))
        return most * (float(rng.random()) if is_grey else rng.random(3))

    model = str(rng.choice(REFLECTIONS, p=[0.34, 0.2, 0.14, 0.1, 0.14, 0.08]))
    n = log_uniform(rng, 0, 2.5) if chance(rng, 0.6) else log_uniform(rng, -1.3, 6)
    roughness = rng.uniform(0.1, 1) if chance(rng, 0.8) else log_uniform(rng, -3, 0)
    words.append(f"{model}({n if model != 'cook-torrance' else roughness:.3g})")
    material = rz.Material(
        ambient=None if chance(rng, 0.5) else color(),
        diffuse=color(),
        specular=color(0.5),
        shininess=n,
        emissive=color(0.2) if chance(rng, 0.1) else 0.0,
        opacity=opacity_of(rng) if is_clear and chance(rng, 0.8) else 1.0,
        reflection=model,
        roughness=roughness,
        distribution=str(rng.choice(DISTRIBUTIONS)),
        fresnel=rng.random() if chance(rng, 0.25) else None,
        normalized=chance(rng, 0.25),
        levels=int(rng.integers(1, 7)),
        texture=make_texture(rng) if has_texture else None,
    )
    for name, is_it in (("clear", not material.is_opaque), (getattr(material.texture, "filter", ""), has_texture)):
        if is_it:
            words.append(name)
    return material


def opacity_of(rng) -> float:
    """A share of what is seen that is the surface itself."""
    return float(rng.choice([rng.random(), log_uniform(rng, -7, 0), 0.0, 1.0 - log_uniform(rng, -7, -1)], p=[0.6, 0.2, 0.1, 0.1]))


def make_texture(rng) -> rz.Texture:
    """A small picture, of bytes or floats, some with alpha."""
    n_channel = int(rng.choice([1, 3, 3, 4]))
    image = rng.random((*rng.integers(1, 6, 2), n_channel))
    if chance(rng, 0.4):
        image = (255 * image).astype(np.uint8)
    wrap = tuple(str(word) for word in rng.choice(WRAPS, 2))
    return rz.Texture(image, str(rng.choice(FILTERS)), wrap)


# ── lights ────────────────────────────────────────────────────────────────────────────────────────────────


def make_lights(rng, points, lens, scale, size, words) -> list:
    """Lights of all kinds, near and far, few and sometimes very many."""
    n = int(rng.integers(1, 4))
    if chance(rng, 0.03):
        n = int(log_uniform(rng, 1, 2.3))
    if size != SIZE and chance(rng, 0.3):
        n = int(log_uniform(rng, 2, np.log10(MANY)))
    is_grey = chance(rng, 0.5)
    strength = rng.uniform(0.3, 1.5) / (n if n > 4 else 1.0)
    if chance(rng, 0.1):
        strength *= log_uniform(rng, -3, 3)
    most_kinds = 2 if n > 20 else n
    kinds = [str(kind) for kind in rng.choice(list(LIGHTS), most_kinds, p=[0.36, 0.3, 0.26, 0.08])]
    kinds = (kinds * (n // most_kinds + 1))[:n]
    has_shadows = chance(rng, 0.05) and n < 5
    words.append(f"{n}×({', '.join(sorted(set(kinds)))})" + (" shadows" if has_shadows else ""))
    lights = [rz.AmbientLight(light_color(rng, is_grey, rng.uniform(0, 0.3)))] if chance(rng, 0.7) else []
    for kind in kinds:
        options = {"color": light_color(rng, is_grey, strength), "attached": "camera" if chance(rng, 0.25) else "world"}
        options["shadow"] = rz.Shadow(size=64, filter=int(rng.choice([1, 3]))) if has_shadows else None
        lights.append(LIGHTS[kind](rng, points, lens, scale, options))
    return lights


def light_color(rng, is_grey, strength):
    """A light's colour; few are black, few are spectra."""
    kind = rng.random()
    if kind < 0.02:
        return 0.0
    if kind > 0.99:
        return rz.Spectrum(np.linspace(400, 700, 4), strength * rng.random(4))
    return strength * (rng.random() if is_grey else rng.random(3))


def place_light(rng, points, lens, options) -> np.ndarray:
    """A place on the model, next to it, before it or far away, in the frame that the light is attached to."""
    kind = rng.random()
    corners = points[rng.integers(0, len(points), 3)]
    on = rng.dirichlet([1, 1, 1]) @ corners if chance(rng, 0.8) else corners[0]
    if kind < 0.6:
        place = on + lens.reach * rng.uniform(0.3, 3) * unit(rng.normal(size=3))
    elif kind < 0.8:
        place = on + log_uniform(rng, -9, 0) * unit(rng.normal(size=3))
    elif kind < 0.85:
        place = on
    else:
        place = on + log_uniform(rng, 1, 25) * unit(rng.normal(size=3))
    if options["attached"] == "camera":
        eye, right, up, forward = lens.camera.view()
        place = np.array([(place - eye) @ axis for axis in (right, up, -forward)])
    return place


def attenuate(rng, distance, scale) -> dict:
    """What weakens a light with the distance, about as much as it should at a given one; or makes it stronger."""
    kind = rng.random()
    if kind < 0.5:
        kc, kl, kq = 1.0, 0.0, 0.0
    elif kind < 0.6:
        kc, kl, kq = rng.random(), 1.0 / distance, 0.0
    elif kind < 0.75:
        kc, kl, kq = 0.0, 0.0, 1.0 / distance**2
    else:
        kc, kl, kq = rng.random(), rng.random() / distance, rng.random() / distance**2
    found = {"attenuation": (kc, kl / scale, kq / scale**2), "amplify": chance(rng, 0.2)}
    if chance(rng, 0.2):
        found["range"] = distance * rng.uniform(0.5, 4) * scale
    return found


def _directional(rng, points, lens, scale, options):
    return rz.DirectionalLight(direction(rng), **options)


def _point(rng, points, lens, scale, options):
    place = place_light(rng, points, lens, options)
    return rz.PointLight(place * scale, **options, **attenuate(rng, max(lens.reach, 1e-3), scale))


def _spot(rng, points, lens, scale, options):
    place = place_light(rng, points, lens, options)
    axis = -place if options["attached"] == "world" else np.array([0.0, 0.0, -1.0])
    axis = axis + np.linalg.norm(axis) * rng.normal(0, 0.2, 3) + 1e-300
    outer = rng.uniform(5, 90) if chance(rng, 0.8) else log_uniform(rng, -1, 1.9)
    cone = {"outer": outer, "inner": rng.choice([None, outer, rng.uniform(0, outer), outer * (1 - log_uniform(rng, -6, 0))])}
    cone["exponent"] = rng.choice([0.0, rng.uniform(0, 20), log_uniform(rng, -1.3, 4)])
    return rz.SpotLight(place * scale, axis, **cone, **options, **attenuate(rng, max(lens.reach, 1e-3), scale))


def _area(rng, points, lens, scale, options):
    place = place_light(rng, points, lens, options)
    edges = rng.normal(0, 0.5, (2, 3)) * lens.reach
    cells = tuple(int(m) for m in rng.integers(1, 4, 2))
    return rz.AreaLight(place * scale, *(edges * scale), resolution=cells, **options, **attenuate(rng, max(lens.reach, 1e-3), scale))


LIGHTS = {"directional": _directional, "point": _point, "spot": _spot, "area": _area}


# ── options, and neighbours of a case ─────────────────────────────────────────────────────────────────────


def make_options(rng, words) -> dict:
    """The options of the picture."""
    tolerance = DEFAULT_TOLERANCE if chance(rng, 0.55) else log_uniform(rng, -6, -1)
    options = {
        "shading": choose(rng, words, flat=2, gouraud=4, phong=5),
        "tolerance": 0.0 if chance(rng, 0.05) else tolerance,
        "samples": int(rng.choice([1, 4, 9, 16], p=[0.88, 0.09, 0.015, 0.015])),
        "cull": "back" if chance(rng, 0.12) else "none",
        "color_range": str(rng.choice(["clamp", "global", "local"], p=[0.8, 0.1, 0.1])),
        "exposure": rng.uniform(-4, 4) if chance(rng, 0.12) else 0.0,
        "spectral": int(rng.integers(3, 12)) if chance(rng, 0.03) else None,
    }
    words += [f"{key}={value:.3g}" for key, value in options.items() if key in ("tolerance", "exposure") and value]
    words += [f"{key}={value}" for key, value in options.items() if key in ("samples", "spectral") and value not in (None, 1)]
    return options
