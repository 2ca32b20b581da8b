"""Small random scenes over lights, materials, normals, cameras and units: for the campaign of test_bounds.py."""

import numpy as np

import rasterizer as rz
from helpers.pinhole import octasphere

MODELS = ("phong", "phong", "blinn", "lambert", "oren-nayar", "cook-torrance", "toon")
ATTENUATIONS = ((1, 0, 0), (0, 0, 1), (1, 0.5, 0), (0.2, 0.1, 0.3))


def random_scene(rng):
    """(Scene, options of a picture) out of a generator: some three in ten in a unit between 1e-30 and 1e30."""
    unit = 1.0 if rng.random() < 0.7 else float(10.0 ** rng.uniform(-30, 30))
    meshes = [random_mesh(rng, unit) for _ in range(rng.integers(1, 3))]
    n_light = int(rng.integers(1, 4)) if rng.random() < 0.97 else int(10.0 ** rng.uniform(1, 2.5))
    lights = [random_light(rng, unit, min(1.0, 3 / n_light)) for _ in range(n_light)]
    if rng.random() < 0.6:
        lights.append(rz.AmbientLight(random_color(rng, 0.3)))
    background = None if rng.random() < 0.7 else random_color(rng)
    options = {"exposure": float(rng.choice([0, 0, 0, 2, -3])), "spectral": 9 if rng.random() < 0.1 else None}
    return rz.Scene(meshes, lights, random_camera(rng, unit), background), options


def random_color(rng, scale=1.0):
    """A grey or a colour."""
    color = rng.uniform(0, scale, 3)
    return tuple(color if rng.random() < 0.5 else color[[0, 0, 0]])


def random_mesh(rng, unit):
    """A ball, a floor or a soup, some with normals of their own: any, curved, reversed, or none at a corner."""
    kind = rng.integers(0, 3)
    if kind == 0:
        vertices, faces = octasphere(int(rng.integers(0, 3)))
    elif kind == 1:
        x, z = np.meshgrid(np.linspace(-1, 1, 3), np.linspace(-1, 1, 3))
        vertices = np.stack([x.ravel(), np.full(9, -0.07), z.ravel()], axis=1) * 10.0 ** rng.uniform(0, 1.5)
        faces = [[i, i + 3, i + 1] for i in (0, 1, 3, 4)] + [[i + 1, i + 3, i + 4] for i in (0, 1, 3, 4)]
    else:
        n = int(rng.integers(1, 6))
        vertices = rng.uniform(-1, 1, (n, 1, 3)) + rng.normal(size=(n, 3, 3)) * 10.0 ** rng.uniform(-1, 0.2)
        vertices, faces = vertices.reshape(-1, 3), np.arange(3 * n).reshape(n, 3)
    look = {"crease_angle": float(rng.choice([0, 30, 180]))}
    if rng.random() < 0.35:
        normals = rng.normal(size=vertices.shape)
        if rng.random() < 0.5:
            normals = vertices + 0.3 * normals
        normals[rng.integers(0, len(normals))] *= rng.choice([1, 1, -1, 0])
        look = {"normals": normals}
    if rng.random() < 0.25:
        look["colors"] = rng.uniform(0, 1, vertices.shape)
    return rz.Mesh(unit * vertices, faces, material=random_material(rng), **look)


def random_material(rng):
    """A material of any model, the exponent from 0.05 to a million."""
    return rz.Material(
        ambient=random_color(rng),
        diffuse=random_color(rng),
        specular=random_color(rng) if rng.random() < 0.8 else 0.0,
        shininess=float(10.0 ** rng.uniform(-1.3, 6)) if rng.random() < 0.3 else float(rng.integers(1, 200)),
        reflection=str(rng.choice(MODELS)),
        roughness=float(rng.uniform(0.05, 1)),
        distribution=str(rng.choice(["ggx", "beckmann"])),
        levels=int(rng.integers(1, 6)),
        normalized=bool(rng.random() < 0.2),
        fresnel=float(rng.uniform(0, 1)) if rng.random() < 0.2 else None,
        opacity=float(rng.choice([0.5, 0.9, 1e-6])) if rng.random() < 0.12 else 1.0,
        emissive=random_color(rng, 0.2) if rng.random() < 0.2 else 0.0,
    )


def random_light(rng, unit, scale):
    """A directional, point or spot light, from next to the surfaces to 1e25 units away."""
    way, color = rng.normal(size=3), random_color(rng, scale)
    kind = rng.random()
    if kind < 0.45:
        return rz.DirectionalLight(way, color, str(rng.choice(["world", "camera"])))
    distance = 10.0 ** (rng.uniform(-2, 1) if rng.random() < 0.85 else rng.uniform(1, 25))
    constant, linear, quadratic = ATTENUATIONS[rng.integers(0, 4)]
    look = {
        "attenuation": (constant, linear / unit, quadratic / unit**2),
        "amplify": bool(rng.random() < 0.2),
        "range": float(unit * distance * 10.0 ** rng.uniform(-0.3, 1)) if rng.random() < 0.3 else None,
    }
    place = unit * distance * way / np.linalg.norm(way)
    if kind < 0.75:
        return rz.PointLight(place, color, **look)
    outer = float(rng.uniform(10, 90)) if rng.random() < 0.8 else 90.0
    inner = rng.choice([0.8 * outer, outer, rng.uniform(0, outer)])
    return rz.SpotLight(place, -way, color, float(inner), outer, float(rng.choice([0, 0.3, 1, 5, 80, 1e4])), **look)


def random_camera(rng, unit):
    """A camera with or without perspective, one in ten of the former at 175 degrees."""
    eye = rng.normal(size=3)
    eye, target = unit * 10.0 ** rng.uniform(0.2, 1.2) * eye / np.linalg.norm(eye), unit * rng.uniform(-0.5, 0.5, 3)
    if rng.random() < 0.25:
        return rz.Camera.orthographic(eye, target, height=float(unit * rng.uniform(0.5, 4)))
    return rz.Camera.perspective(eye, target, fov=float(rng.uniform(10, 120)) if rng.random() < 0.9 else 175.0)
