"""Check that bounds are found for each material by itself: the scene's is the largest, and none depends on another.
And what they are made of: where the lit points lie, tables of highlights."""

from fractions import Fraction

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.pinhole import octasphere, unit

import rasterizer as rz
from rasterizer.engine import error_bounds, intensity_bounds
from rasterizer.engine.coding import scale_depths
from rasterizer.engine.depth_range import fit_screen
from rasterizer.engine.error_bounds import Surroundings, straight_rounding
from rasterizer.engine.float64_reasons import reasons_of
from rasterizer.engine.highlight_tables import LEAST_SUMS, HighlightTables
from rasterizer.engine.light_table import entry_of
from rasterizer.engine.lit_points import LitPoints, eye_distances
from rasterizer.engine.plan import make_plan
from rasterizer.engine.reflection_table import entry_of as entry_of_material
from rasterizer.engine.rounding import DOUBLE, SINGLE
from rasterizer.geometry.points import gather_geometry
from rasterizer.options import DEFAULT_TOLERANCE
from rasterizer.pipeline.transform import compute_z

MATERIALS = (
    rz.Material(shininess=30),
    rz.Material(reflection="blinn", shininess=300, specular=0.7),
    rz.Material(reflection="cook-torrance", roughness=0.3),
    rz.Material(reflection="oren-nayar", roughness=0.5, diffuse=(0.9, 0.2, 0.1)),
    rz.Material(specular=0, emissive=0.4),
)
LIGHTS = (
    rz.DirectionalLight((0.2, -0.5, -1), 0.6),
    rz.PointLight((1, 2, 3), (0.5, 0.4, 0.1), (0.4, 0.1, 0.2), amplify=True),
    rz.SpotLight((0, 1, 2), (0, -0.3, -1), 0.4, 20, 30, range=9),
)
PLACES = 3.0 * np.arange(len(MATERIALS))


def meshes_of(materials=MATERIALS):
    """A ball of each material, side by side."""
    vertices, faces = octasphere(2)
    return [
        rz.Mesh(vertices + (x, 0, 0), faces, material=material, crease_angle=180)
        for x, material in zip(PLACES, materials, strict=False)
    ]


def reflected_of(materials):
    return intensity_bounds.compute_reflected(materials, LIGHTS, np.full(3, 0.2), 1.0)


def around(n_material, is_lit_per_sample=True):
    """Surroundings that differ from material to material."""
    rows = np.arange(1.0, 1.0 + n_material)[:, None]
    return Surroundings(
        furthest=9.0,
        clearances=rows * (np.inf, 0.3, 1.1),
        shortest=0.8,
        is_lit_per_sample=is_lit_per_sample,
        eye_distances=np.array([np.inf, 4.0, 6.0]),
        least_sums=np.minimum(0.3 * rows * (1.0, 0.5, 2.0), 2.0),
    )


def row_of(surroundings, k):
    """The surroundings of one material alone."""
    return surroundings._replace(
        clearances=surroundings.clearances[k : k + 1], least_sums=surroundings.least_sums[k : k + 1]
    )


@pytest.mark.parametrize("u, is_lit_per_sample", [(SINGLE, True), (DOUBLE, False)])
def test_every_bound_of_a_material_is_that_of_a_scene_of_it_alone(u, is_lit_per_sample):
    together, surroundings = reflected_of(MATERIALS), around(len(MATERIALS), is_lit_per_sample)

    def known(reflected, surroundings):
        return error_bounds.bound_highlights(reflected, u, surroundings.least_sums)

    questions = {
        "bounds": lambda r, s: r.bounds,
        "turn slopes": lambda r, s: r.turn_slopes,
        "lighting": lambda r, s: error_bounds.lighting_error(r, u),
        "lighting in a view": lambda r, s: error_bounds.lighting_error(r, u, known(r, s)),
        "highlights": lambda r, s: error_bounds.highlight_error(r, u, known(r, s)),
        "normals": lambda r, s: error_bounds.normal_error(r, 3 * u, known(r, s)),
        "positions": lambda r, s: error_bounds.position_error(r, s, u, known(r, s)),
        "frame": lambda r, s: error_bounds.frame_error(r, s, u),
    }
    for name, ask in questions.items():
        found = ask(together, surroundings)
        alone = [ask(reflected_of(MATERIALS[k : k + 1]), row_of(surroundings, k))[0] for k in range(len(MATERIALS))]
        assert found.shape == (len(MATERIALS),) and (found == alone).all(), f"{name}: {found} != {alone}"
        assert len(set(found.tolist())) > 2, name
    assert together.bound == together.bounds.max() and together.turn_slope == together.turn_slopes.max()


def test_reasons_are_those_of_a_material_and_its_lights():
    shadowed, near = rz.DirectionalLight((0, 0, -1), shadow=True), rz.PointLight((0, 0, 1e30), range=1e30)
    texture = rz.Texture(np.ones((2, 2, 3)))
    cases = [
        ((rz.Material(), LIGHTS, DEFAULT_TOLERANCE, 1e-5, 1.0), ()),
        ((rz.Material(), LIGHTS, 0.0, 1e-5, 1.0), ("tolerance 0", "rounding beyond half of the tolerance")),
        ((rz.Material(), LIGHTS, DEFAULT_TOLERANCE, 2e-4, 1.0), ("rounding beyond half of the tolerance",)),
        ((rz.Material(), LIGHTS, DEFAULT_TOLERANCE, 1e-5, np.inf), ("lights without bound",)),
        ((rz.Material(), (near,), DEFAULT_TOLERANCE, 1e-5, 1.0), ("numbers of lights beyond float32",)),
        ((rz.Material(), (shadowed,), DEFAULT_TOLERANCE, 1e-5, 1.0), ()),
        ((rz.Material(texture=texture), (), DEFAULT_TOLERANCE, 1e-5, 1.0), ()),
        ((rz.Material(reflection="toon"), (), DEFAULT_TOLERANCE, 1e-5, 1.0), ("toon levels",)),
    ]
    for arguments, reasons in cases:
        assert reasons_of(*arguments) == reasons, f"{arguments}: {reasons_of(*arguments)} != {reasons}"
    toon, plain = rz.Material(reflection="toon"), rz.Material()
    assert make_plan(rz.Scene(meshes_of((plain, toon)), LIGHTS[:1]), rz.Options(), np.empty((0, 3))).reasons == (
        "toon levels",
    )


# ---------------------------------------------------------------- where the lit points lie


@pytest.mark.parametrize("is_flat, is_lit_per_sample", [(True, False), (False, False), (False, True)])
def test_no_lit_point_goes_below_what_is_said_of_its_material(is_flat, is_lit_per_sample):
    """Distances from the lights, and |L + V|, at many points of every ball."""
    rng = np.random.default_rng(8)
    meshes = meshes_of()
    geometry = gather_geometry(rz.Scene(meshes, LIGHTS), is_flat)
    for _ in range(6):
        eye = (6, 0, 0) + 10.0 ** rng.uniform(0.5, 1.5) * unit(rng.normal(size=3))
        camera = rz.Camera.perspective(eye, (6, 0, 0))
        is_perspective = bool(rng.random() < 0.7)
        lights = (
            rz.DirectionalLight(rng.normal(size=3)),
            rz.PointLight(rng.uniform((-2, -2, -2), (14, 2, 2))),
            rz.SpotLight(3 * rng.normal(size=3), (0, 0, -1), attached="camera"),
        )
        view, lit = camera.view(), LitPoints(geometry, len(MATERIALS), lights, is_lit_per_sample)
        clearances, sums = lit.clearances(view), lit.least_sums(view, is_perspective, 0.0)
        assert not differences(lit.clearances(view), clearances)
        near = np.array([np.inf, *(np.linalg.norm(entry_of(l).beam(l, view).origin - eye) for l in lights[1:])])
        assert eye_distances(lights, view) == pytest.approx(near, rel=1e-9)
        for k, mesh in enumerate(meshes):
            corners = mesh.vertices[mesh.faces[rng.integers(0, mesh.n_face, 200)]]
            weights = rng.dirichlet((0.5, 0.5, 0.5), 200)[:, :, None] if is_lit_per_sample else np.eye(3)[0][:, None]
            points = corners.mean(axis=1) if is_flat else (weights * corners).sum(axis=1)
            to_eye = unit(eye - points) if is_perspective else np.broadcast_to(-view.forward, points.shape)
            for i, light in enumerate(lights):
                beam = entry_of(light).beam(light, view)
                away = np.broadcast_to(-beam.axis, points.shape) if beam.origin is None else beam.origin - points
                if beam.origin is not None:
                    assert clearances[k, i] <= np.linalg.norm(away, axis=1).min() * (1 + 1e-12)
                least = np.linalg.norm(unit(away) + to_eye, axis=1).min()
                assert sums[k, i] <= least, f"material {k}, light {i}: {sums[k, i]} > {least}"


def test_light_and_viewer_on_one_side_are_known_to_be():
    """A ball seen from the sun's side: everywhere |L + V| is nearly 2."""
    geometry = gather_geometry(rz.Scene(meshes_of(MATERIALS[:1])), False)
    camera, lights = rz.Camera.perspective((0, 0, 30), fov=5), [rz.DirectionalLight((0, 0, z)) for z in (-1, 1)]
    sums = LitPoints(geometry, 1, lights, True).least_sums(camera.view(), True, 0.0)
    assert sums[0, 0] > 1.99 and sums[0, 1] < 0.1


def test_a_lamp_at_one_ball_leaves_the_others_in_peace():
    """The rounding of positions counts over the distance of each material's own surface."""
    meshes = meshes_of()
    lamp = rz.PointLight((0, 1.001, 0), 0.5)
    geometry = gather_geometry(rz.Scene(meshes, lamp), False)
    camera = rz.Camera.perspective((6, 3, 15), (6, 0, 0))
    clearances = LitPoints(geometry, len(MATERIALS), (lamp,), True).clearances(camera.view())
    assert clearances[0, 0] < 0.03 and clearances[1:, 0].min() > 1.9
    reflected = intensity_bounds.compute_reflected(MATERIALS[:1] * 2, (lamp,), np.zeros(3), 1.0)
    highlights = error_bounds.bound_highlights(reflected, SINGLE, 0.0)
    around_lamp = Surroundings(20.0, clearances[:2], 1.0, True)
    error = error_bounds.position_error(reflected, around_lamp, SINGLE, highlights)
    assert error[0] > 30 * error[1]


# ---------------------------------------------------------------- tables of highlights


def test_tables_hold_what_the_entries_say_rounded_to_the_safe_side():
    materials = [m for m in MATERIALS if m.reflection != "oren-nayar"]  # which has no highlight
    materials += [rz.Material(reflection="blinn", shininess=0.5), rz.Material(reflection="toon")]
    rng, tables = np.random.default_rng(1), HighlightTables(materials)
    for u in (SINGLE, DOUBLE):
        sums = rng.choice(LEAST_SUMS, (len(materials), 40))
        found = tables.look_up(u, sums)
        for m, material in enumerate(materials):
            expected = entry_of_material(material).highlight_bounds(material, u, sums[m])
            is_dull = max(material.specular) == 0
            for name, values, wanted in zip(found._fields, found, expected, strict=True):
                assert np.array_equal(values[m], np.zeros(40) if is_dull else wanted), f"{name} of {material}"
    between = rng.uniform(0, 2, (len(materials), 100))
    found, rounded = (tables.look_up(SINGLE, sums) for sums in (between, np.floor(8 * between) / 8))
    for name, values, wanted in zip(found._fields, found, rounded, strict=True):
        assert np.array_equal(values, wanted), f"{name} between two places of the table"


# ---------------------------------------------------------------- depths without perspective


def test_depths_of_means_err_by_no_more_than_is_said():
    """Corners anywhere in the range of depths, weights that are whole numbers: as `mean_depth` computes them."""
    rng, worst = np.random.default_rng(8), 0.0
    for _ in range(300):
        eye = rng.normal(size=3) * 10.0 ** rng.uniform(-3, 3)
        camera = rz.Camera.orthographic(eye, eye + rng.normal(size=3), height=2.0)
        view = camera.view()
        spread = 10.0 ** rng.uniform(-2, 4)
        points = view.eye + rng.normal(size=(3, 3)) * spread + view.forward * 4 * spread
        furthest = float(np.linalg.norm(points - view.eye, axis=1).max())
        depths = (points - view.eye) @ view.forward
        if depths.min() <= 0.0:
            continue
        nearest = float(depths.min()) * rng.choice([1.0, 2.0**-20])
        screen = fit_screen(view, camera.projection((64, 48)), (nearest, furthest), np.inf, None, (64, 48))
        line = scale_depths(screen)
        found = [line.depth_offset + line.depth_scale * float(compute_z(float(depth), screen)) for depth in depths]
        straight = view.eye.tolist(), view.forward.tolist()
        weights = rng.integers(1, 2**40, 3)
        q = weights.astype(float)
        mean = (q[0] * found[0] + q[1] * found[1] + q[2] * found[2]) / (q[0] + q[1] + q[2])
        exact = [
            sum((Fraction(p) - Fraction(e)) * Fraction(f) for p, e, f in zip(point, *straight, strict=True))
            for point in points.tolist()
        ]
        true = sum(int(w) * d for w, d in zip(weights, exact, strict=True)) / int(weights.sum())
        worst = max(worst, float(abs(Fraction(mean) - true)) / straight_rounding(furthest))
    assert 0.001 < worst <= 1.0, f"{worst:.3g} of the bound > 1"
