"""Where pictures jump, and scenes moved by a little: help for the campaign.

Next to a step no error is small, so samples there are not judged by the bound. Steps are the levels of toon, N·L = 0 of
highlights that are not weakened by N·L, sharp cones, and the edges of texels without a filter.
"""

from dataclasses import replace

import numpy as np

import rasterizer as rz
from rasterizer import reference

N_JOLT = 6
ROUNDINGS = 2.0**-51  # relative: two roundings of float64
SEPARATE = 4.0  # groups lie so many times further apart than each is wide


def next_to_step(case, jolt, bound) -> np.ndarray:
    """Tell which pixels (h, w) have a sample next to a step, or one that the scene's own numbers do not determine.

    The judge draws the scene again with lights, normals and texture coordinates moved by `jolt`, relatively. What is
    continuous moves by about as much each time; next to a step, values fall into groups. Where lights moved by a few roundings
    of float64 change a value by a good part of the bound, as for a light in the very point that it lights, nobody can tell
    what it is.

    Parameters
    ----------
    case : Case
    jolt : relative; how far a step reaches
    bound : linear intensity; smaller jumps are none
    """
    width, height = case.size
    n = round(case.options["samples"] ** 0.5)
    is_loose = np.zeros((n * height, n * width), bool)
    if has_steps(case):
        gaps = np.diff(np.sort(_draw_jolted(case, jolt), axis=0), axis=0)
        largest = gaps.max(axis=0)
        is_loose |= ((largest > SEPARATE * (gaps.sum(axis=0) - largest)) & (largest > bound / 4)).any(axis=-1)
    if any(hasattr(light, "attenuation") for light in case.scene.lights):
        is_loose |= (np.ptp(_draw_jolted(case, ROUNDINGS), axis=0) > bound / 4).any(axis=-1)
    return is_loose.reshape(height, n, width, n).any(axis=(1, 3))


def _draw_jolted(case, jolt) -> np.ndarray:
    """Colours (1 + N_JOLT, h, w, 3) of a case's samples, as it is and moved by a little."""
    rng, n = np.random.default_rng(case.index), round(case.options["samples"] ** 0.5)
    settings = {name: case.options[name] for name in ("shading", "cull", "exposure", "spectral")}
    scenes = [case.scene] + [jolted(case.scene, rng, jolt) for _ in range(N_JOLT)]
    with np.errstate(all="ignore"):
        return np.stack([reference.render(scene, (n * case.size[0], n * case.size[1]), **settings).color for scene in scenes])


def has_steps(case) -> bool:
    """Tell whether anything in a scene jumps."""
    for mesh in case.scene.meshes:
        for material in mesh.palette:
            is_jumping = material.reflection == "toon" or (material.reflection in ("phong", "blinn") and not material.normalized)
            is_nearest = material.texture is not None and material.texture.filter == "nearest"
            if is_jumping or is_nearest:
                return True
    return any(isinstance(light, rz.SpotLight) and light.inner > light.outer * (1 - 1e-3) for light in case.scene.lights)


def jolted(scene, rng, jolt) -> rz.Scene:
    """The scene with lights, normals and texture coordinates moved by a little."""
    center, extent = scene.bounds.mean(axis=0), np.ptp(scene.bounds, axis=0).max()
    lights = [_jolted_light(light, rng, jolt, center, extent) for light in scene.lights]
    meshes = []
    for mesh in scene.meshes:
        changes = {}
        if mesh.normals is not None:
            changes["normals"] = mesh.normals + jolt * rng.normal(size=mesh.normals.shape)
        if mesh.uv is not None:
            changes["uv"] = mesh.uv + jolt * rng.normal(size=mesh.uv.shape) * np.maximum(np.abs(mesh.uv), 1)
        meshes.append(replace(mesh, **changes))
    return replace(scene, meshes=meshes, lights=lights)


def _jolted_light(light, rng, jolt, center, extent):
    """A light moved by a little, as seen from the scene."""
    changes = {}
    for name in ("position", "corner"):
        if hasattr(light, name):
            place = np.array(getattr(light, name))
            away = extent + np.linalg.norm(place - (center if light.attached == "world" else 0.0))
            changes[name] = place + jolt * away * rng.normal(size=3)
    if hasattr(light, "direction"):
        changes["direction"] = light.direction + jolt * rng.normal(size=3)
    return replace(light, **changes) if changes else light


# ── neighbours of a case ──────────────────────────────────────────────────────────────────────────────────


def mutated(case, rng):
    """A case whose numbers differ a little, or one of them a lot."""
    scene, options = case.scene, dict(case.options)
    step = 10.0 ** rng.uniform(-4, 0)
    kind = rng.choice(["lights", "light", "normals", "vertices", "material", "camera", "tolerance"])
    if kind in ("lights", "light"):
        one = rng.integers(len(scene.lights)) if kind == "light" and scene.lights else None
        center, extent = scene.bounds.mean(axis=0), np.ptp(scene.bounds, axis=0).max()
        lights = [
            _mutated_light(light, rng, step, center, extent) if one in (None, number) else light
            for number, light in enumerate(scene.lights)
        ]
        scene = replace(scene, lights=lights)
    elif kind == "tolerance":
        options["tolerance"] = float(np.clip(options["tolerance"] * 10.0 ** rng.normal(0, 0.5), 1e-6, 0.1))
    elif kind == "camera":
        camera, turn = scene.camera, step * rng.normal(size=(2, 3))
        away = np.linalg.norm(np.subtract(camera.position, camera.target))
        scene = replace(scene, camera=replace(camera, position=camera.position + away * turn[0], up=camera.up + 0.1 * turn[1]))
    else:
        scene = replace(scene, meshes=[_mutated_mesh(mesh, rng, step, kind) for mesh in scene.meshes])
    return case._replace(scene=scene, options=options)


def _mutated_light(light, rng, step, center, extent):
    light = _jolted_light(light, rng, step, center, extent)
    changes = {}
    if hasattr(light, "color") and not hasattr(light.color, "wavelengths"):
        changes["color"] = np.multiply(light.color, np.exp(0.3 * step * rng.normal()))
    if getattr(light, "range", None) is not None:
        changes["range"] = light.range * np.exp(step * rng.normal())
    if isinstance(light, rz.SpotLight):
        changes["exponent"] = light.exponent * np.exp(step * rng.normal())
        changes["inner"] = float(np.clip(light.inner + 5 * step * rng.normal(), 0, light.outer))
    return replace(light, **changes)


def _mutated_mesh(mesh, rng, step, kind) -> rz.Mesh:
    if kind == "vertices":
        extent = np.ptp(mesh.bounds, axis=0).max()
        return replace(mesh, vertices=mesh.vertices + step * extent * rng.normal(size=mesh.vertices.shape))
    if kind == "normals":
        if mesh.normals is None:
            return mesh
        return replace(mesh, normals=mesh.normals + step * rng.normal(size=mesh.normals.shape))
    palette = [_mutated_material(material, rng, step) for material in mesh.palette]
    return replace(mesh, material=palette[0], materials=palette if mesh.materials is not None else None)


def _mutated_material(material, rng, step) -> rz.Material:
    least = 0.001 if material.reflection == "cook-torrance" else 0.0
    return replace(
        material,
        shininess=float(np.clip(material.shininess * np.exp(2 * step * rng.normal()), 0.05, 1e6)),
        roughness=float(np.clip(material.roughness * np.exp(step * rng.normal()), least, 1.0)),
        specular=material.specular if hasattr(material.specular, "wavelengths") else np.clip(
            np.add(material.specular, 0.1 * step * rng.normal()), 0.0, 1.0
        ),
    )  # fmt: skip
