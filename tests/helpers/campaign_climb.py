"""Cases that differ a little from others: help for climbing towards errors above their bounds."""

from dataclasses import replace

import numpy as np

import rasterizer as rz


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
        scene = replace(
            scene, camera=replace(camera, position=camera.position + away * turn[0], up=camera.up + 0.1 * turn[1])
        )
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
    changes = {"shininess": float(np.clip(material.shininess * np.exp(2 * step * rng.normal()), 0.05, 1e6))}
    if np.size(material.roughness) == 1:
        least = 0.001 if material.reflection == "cook-torrance" else 0.0
        changes["roughness"] = float(np.clip(material.roughness * np.exp(step * rng.normal()), least, 1.0))
    if not hasattr(material.specular, "wavelengths"):
        changes["specular"] = np.clip(np.add(material.specular, 0.1 * step * rng.normal()), 0.0, 1.0)
    return replace(material, **changes)


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
