"""Random scenes of what a look is made of beside the classic terms: coloured F0, brushed surfaces, shaped spots, depth
cues, weightings.

Every picture keeps the promise of its `error_bound`, against the same picture at tolerance 0, and that one agrees with
the reference.
"""

import numpy as np
import pytest
from helpers.against_reference import EXACT, compare_with_reference
from helpers.pinhole import SHADINGS, octasphere, torus

import rasterizer as rz
from rasterizer.scene.named_materials import NAMED_MATERIALS

SIZE = (32, 24)
REFLECTIONS = ("phong", "blinn", "lambert", "oren-nayar", "cook-torrance", "cook-torrance")


def random_material(rng):
    """Any material whose picture has no steps."""
    if rng.random() < 0.15:
        return rz.Material.named(rng.choice(list(NAMED_MATERIALS)))
    reflection = str(rng.choice(REFLECTIONS))
    settings = {
        "reflection": reflection,
        "diffuse": rng.uniform(size=3),
        "specular": rng.uniform(0, 0.3, 3 if rng.random() < 0.5 else 1),
    }
    settings["specular"] = tuple(np.broadcast_to(settings["specular"], 3))
    settings["shininess"] = float(rng.choice([1.0, 3.5, 10, 32]))
    settings["normalized"] = bool(rng.random() < 0.3)
    settings["roughness"] = rng.uniform(0.25, 1)
    if reflection == "cook-torrance" and rng.random() < 0.6:
        settings["roughness"] = tuple(rng.uniform(0.25, 1, 2))
        settings["tangent"] = "u" if rng.random() < 0.5 else rng.normal(size=3)
    elif reflection == "cook-torrance":
        settings["distribution"] = str(rng.choice(["ggx", "beckmann"]))
    kind = rng.random()
    if kind < 0.5:
        settings["fresnel"] = tuple(rng.uniform(size=3))
    elif kind < 0.65:
        settings["fresnel"] = rz.Spectrum((400, 550, 700), rng.uniform(size=3))
    elif kind < 0.8:
        settings["fresnel"] = rng.uniform()
    return rz.Material(**settings)


def random_scene(rng):
    """A ball or a ring or both in all kinds of light."""
    meshes = []
    for place, (vertices, faces) in ((0.0, octasphere(2)), (2.2, torus(12, 8))):
        if meshes and rng.random() < 0.5:
            continue
        weighting = str(rng.choice(["angle", "area", "uniform"]))
        vertices = vertices + (place, 0, 0)
        meshes.append(rz.Mesh(vertices, faces, uv=vertices[:, :2], material=random_material(rng), weighting=weighting))
    lights = [rz.AmbientLight(0.1), rz.DirectionalLight(rng.normal(size=3), rng.uniform(0, 0.7, 3))]
    if rng.random() < 0.7:
        inner, outer = np.sort(rng.uniform(10, 80, 2))
        place = rng.normal(size=3)
        place *= 6 / np.linalg.norm(place)
        falloff = float(rng.choice([0.3, 0.5, 0.7, 1.0, 2.0, 6.5]))
        lights.append(
            rz.SpotLight(place, -place, rng.uniform(0, 0.7, 3), inner, outer, rng.choice([0.0, 2.0]), falloff=falloff)
        )
    cue = None if rng.random() < 0.6 else rz.DepthCue(rng.uniform(1, 9), rng.uniform(0, 4), rng.uniform(size=3))
    eye = rng.normal(size=3)
    eye *= 7 / np.linalg.norm(eye)
    camera = rz.Camera.perspective(eye) if rng.random() < 0.6 else rz.Camera.orthographic(eye, height=4)
    return rz.Scene(meshes, lights, camera, depth_cue=cue)


@pytest.mark.parametrize("seed", range(12))
def test_random_looks_keep_their_bounds(seed):
    rng = np.random.default_rng([seed, 20])
    n_single = 0
    for _ in range(4):
        scene, shading = random_scene(rng), SHADINGS[rng.integers(len(SHADINGS))]
        found = compare_with_reference(scene, SIZE, shading=shading, tolerance=0)
        with rz.Renderer(scene, SIZE, shading=shading, tolerance=0, samples=1) as renderer:
            exact, brightest = renderer.render(), renderer.plan.bound
        budget = max(EXACT, 2.0**-23 * brightest)
        assert found.color <= budget, f"against the reference: {found.color:.3g} > {budget:.3g} in {scene}, {shading}"
        for tolerance in (1e-5, 1 / 4096, 0.01):
            with rz.Renderer(scene, SIZE, shading=shading, tolerance=tolerance, samples=1) as renderer:
                frame = renderer.render()
                n_single += renderer.plan.dtype == "float32"
            error = np.abs(frame.color.astype(float) - exact.color).max()
            bound = frame.stats.error_bound + exact.stats.error_bound
            assert error <= bound, f"{error:.3g} > {bound:.3g} at tolerance {tolerance}, {shading}, {scene}"
            assert np.isfinite(frame.color).all() and frame.color.min() >= min(0.0, exact.color.min() - bound)
    assert seed > 0 or n_single > 0, "no scene ran in float32"
