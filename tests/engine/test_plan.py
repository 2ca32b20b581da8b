"""Check what the plan finds out about a scene: channels, number formats, what it says in words, and bands."""

import pickle
from itertools import cycle
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.against_reference import EXACT as EXACTLY
from helpers.against_reference import assert_matches_reference
from helpers.pinhole import SHADINGS, octasphere
from helpers.stages import SERIAL, drawables_of
from hypothesis import given, settings
from hypothesis import strategies as st

import rasterizer as rz
from rasterizer.engine.draw import cull
from rasterizer.engine.plan import make_plan
from rasterizer.engine.scene_tables import SceneTables
from rasterizer.options import DEFAULT_TOLERANCE, Options
from rasterizer.pipeline.visibility import MAX_SETUPS

BALL = octasphere(1)
CLAY = (0.8, 0.4, 0.2)
GREY_LIGHTS = (rz.AmbientLight(0.1), rz.DirectionalLight((0, -1, -1), 0.6), rz.PointLight((3, 3, 3), 0.3))
WARM_LIGHTS = (rz.AmbientLight((0.1, 0.05, 0.025)), rz.DirectionalLight((0, -1, -1), (0.6, 0.3, 0.15)))
GREY = rz.Material()
TINTED = rz.Material(diffuse=CLAY, specular=tuple(0.5 * c for c in CLAY), emissive=tuple(0.1 * c for c in CLAY))
GLOSSY_CLAY = rz.Material(diffuse=CLAY)  # its highlight is grey
DULL_CLAY = rz.Material(diffuse=CLAY, specular=0)


def scene_of(materials, lights, **mesh):
    """One ball for each material."""
    places = 1.5 * np.arange(len(materials))
    meshes = [
        rz.Mesh(BALL[0] * 0.7 + (x, 0, 0), BALL[1], material=m, **mesh) for x, m in zip(places, materials, strict=True)
    ]
    return rz.Scene(meshes, lights)


def plan_of(scene, **options):
    """The plan of a scene."""
    options = Options(**options)
    return make_plan(SceneTables(scene, options), options)


# ---------------------------------------------------------------- one channel or three


def test_one_channel_is_found_where_all_colours_are_multiples_of_one():
    glow, black = rz.Material(emissive=(0.4, 0.2, 0.1)), rz.PointLight((1, 1, 1), 0)
    for materials, lights, tint in (
        ([GREY, rz.Material(diffuse=0.3)], GREY_LIGHTS, (1, 1, 1)),
        ([TINTED, DULL_CLAY], GREY_LIGHTS, (1, 0.5, 0.25)),
        ([GREY, glow], (*WARM_LIGHTS, black), (1, 0.5, 0.25)),
    ):
        found = plan_of(scene_of(materials, lights))
        assert found.n_channel == 1 and found.tint == pytest.approx(tint, abs=1e-7), (materials, lights)


def test_colours_of_a_model_need_three_channels_unless_they_are_grey():
    rng = np.random.default_rng(4)
    for name, n, shading in (("colors", 18, "gouraud"), ("face_colors", 32, "phong")):
        greys = np.repeat(rng.uniform(0.2, 1.0, (n, 1)), 3, axis=1)
        grey = scene_of([GREY], GREY_LIGHTS, **{name: greys})
        assert plan_of(grey).n_channel == 1
        assert plan_of(scene_of([GREY], GREY_LIGHTS, **{name: greys + [[0, 0, 1e-9]]})).n_channel == 3
        for tolerance in (0, DEFAULT_TOLERANCE):
            budget = max(EXACTLY, tolerance)
            assert_matches_reference(grey, (48, 20), budget, shading=shading, tolerance=tolerance, ignored=0.01)
    meshes = [rz.Mesh(*BALL, material=GREY, colors=np.full((18, 3), color)) for color in (CLAY, 0.5)]
    assert plan_of(rz.Scene(meshes, GREY_LIGHTS)).n_channel == 3, "the grey mesh has the material of the other one"


palette = st.sampled_from([(0.0,) * 3, (0.5,) * 3, (0.2,) * 3, CLAY, (0.4, 0.2, 0.1), (0, 0.3, 0), (0.1, 0.2, 0.8)])
one_material = st.builds(
    lambda a, d, s, e: rz.Material(ambient=a, diffuse=d, specular=s, emissive=e),
    palette,
    palette,
    palette,
    palette,
)


@settings(max_examples=50, deadline=None)
@given(st.lists(one_material, min_size=1, max_size=2), st.lists(palette, max_size=2), palette)
def test_no_intensity_leaves_the_tint_that_is_found(materials, colors, ambient):
    """Every product of a material's and a light's colour must be a multiple of the tint."""
    lights = (rz.AmbientLight(ambient), *(rz.DirectionalLight((0, 0, -1), color) for color in colors))
    found = plan_of(scene_of(materials, lights))
    terms = [np.array(m.emissive) for m in materials] + [np.array(m.ambient) * ambient for m in materials]
    terms += [np.array(m.diffuse) * c for m in materials for c in colors]
    terms += [np.array(m.specular) * c for m in materials for c in colors]
    if found.n_channel == 1:
        assert found.tint.max() == 1
        for term in terms:
            assert np.abs(term - term.max() * found.tint.astype(float)).max() < 1e-7
    else:
        everything = [
            np.array(getattr(m, n)) for m in materials for n in ("ambient", "diffuse", "specular", "emissive")
        ]
        assert any(np.ptp(color) > 0 for color in [*everything, *map(np.array, colors), np.array(ambient)])


# ---------------------------------------------------------------- number formats and ways

SHINY = rz.Material(specular=0.5, shininess=400)
AMPLIFIED = (rz.PointLight((3, 3, 3), 0.3, (0.1, 0, 0.3), amplify=True),)
INVERSE_SQUARE = (rz.PointLight((0, 0, 0), 0.3, (0, 0, 1), amplify=True, attached="camera"),)
MIRROR = rz.Material(specular=0.5, shininess=20_000)
DULL = rz.Material(specular=0.5, shininess=0.5)
BRIGHT = (rz.DirectionalLight((0, 0, -1), 500),)
SUN = (rz.DirectionalLight((0, 0, -1), 1.0),)
# The boxes of the scene are further from the light than half of its range.
RANGED = (rz.PointLight((0, 0, 9), 1.0, range=14.0),)
BOUNDED = {
    "default": (GREY, GREY_LIGHTS), "three channels": (GLOSSY_CLAY, GREY_LIGHTS), "shiny": (SHINY, SUN),
    "a mirror": (MIRROR, SUN), "too dull": (DULL, SUN), "too bright": (GREY, BRIGHT),
    "amplified ten times": (GREY, AMPLIFIED), "without bound": (GREY, INVERSE_SQUARE),
    "in half a range": (GREY, RANGED),
}  # fmt: skip


def test_no_intensity_is_above_the_bound():
    for (name, (material, lights)), shading in zip(BOUNDED.items(), cycle(SHADINGS), strict=False):
        scene = scene_of([material], lights)
        most = rz.render(scene, (48, 32), shading=shading, tolerance=0, samples=1).color.max()
        bound = plan_of(scene, shading=shading).bound
        assert 0 < most <= bound, f"{name}, {shading}: {most:.4g} > the bound {bound:.4g}"


# ---------------------------------------------------------------- the plan in words

SPHERE = rz.Mesh(*octasphere(3), crease_angle=180)
KEY = rz.DirectionalLight((0.2, -0.3, -1))
CAMERA = rz.Camera.perspective((0, 0, 4), fov=40)


def summary_of(mesh=SPHERE, lights=(KEY,), **options):
    frame = rz.render(rz.Scene([mesh], lights, CAMERA), (64, 48), **{"samples": 1} | options)
    return frame.stats.plan


def test_a_plan_names_the_features_that_a_scene_uses():
    image = np.full((2, 2, 3), 0.5)
    material = rz.Material(reflection="cook-torrance", texture=rz.Texture(image), opacity=0.5)
    mesh = rz.Mesh(*octasphere(2), uv=np.zeros((66, 2)), material=material)
    lights = (rz.SpotLight((0, 0, 4), (0, 0, -1), outer=30, shadow=True), rz.AmbientLight(0.2))
    plan = summary_of(mesh, lights, shading="phong")
    assert plan.features == ("textures", "shadows", "transparency") and plan.dtype == "float32"
    assert plan.reasons == () and plan.materials == 1 and plan.doubles == 0
    assert "float32" in repr(plan) and "textures" in repr(plan) and "shadows" in repr(plan)
    plan = rz.render(scene_of([GREY, DULL], GREY_LIGHTS), (48, 32), samples=1).stats.plan
    assert plan.materials == 2 and plan.doubles == 1, "float64 is for the material that needs it alone"


def test_a_renderer_tells_its_plan_before_and_after_a_picture():
    with rz.Renderer(rz.Scene([SPHERE], [KEY], CAMERA), (64, 48), samples=1, shading="gouraud") as renderer:
        assert renderer.plan.paths is None and renderer.plan.dtype == "float32"
        frame = renderer.render()
        assert renderer.plan == frame.stats.plan and renderer.plan.paths is not None
    assert pickle.loads(pickle.dumps(frame.stats.plan)) == frame.stats.plan


def test_a_plan_counts_the_lights():
    plan = summary_of(lights=(KEY, rz.DirectionalLight((0, 0, -1), 0), rz.AmbientLight(0.1)))
    assert plan.left_out == 1 and "left out: 1 light that" in repr(plan)
    assert plan.lights == 1 and "1 light" in repr(plan)
    assert summary_of().left_out == 0 and "left out" not in repr(summary_of())


# ---------------------------------------------------------------- bands


def test_too_many_triangles_for_a_band_make_it_lower():
    """Setup numbers are limited: bands are halved until they suffice; one row of pixels must do."""
    rng, (width, height), n, factor = np.random.default_rng(3), (64, 44), 900, 2
    corners = rng.uniform(0, (width - 8, height - 8), (n, 1, 2)) + np.array([(0, 0), (6, 0), (0, 6)])
    drawables = drawables_of(np.rint(256 * corners), np.full((n, 3), 2.0**30), np.zeros((1, n, 3, 1), np.float32))

    def bands_of(limit):
        as_pass = SimpleNamespace(
            n_sample=(width, height), factor=factor, sample_time=4, hidden_sides=None,
            units_per_setup=MAX_SETUPS // limit, opacity=None,
        )  # fmt: skip
        lists, n_row = cull(drawables.triangles, drawables.vertices, as_pass, SERIAL)
        return n_row, np.diff(lists.starts)

    whole, n_in_band = bands_of(n)
    assert whole == height and n_in_band.tolist() == [n]
    n_row, n_in_band = bands_of(400)
    assert n_row < height and n_row % factor == 0 and n_in_band.max() <= 400, f"{n_row} rows: {n_in_band.max()} > 400"
    assert bands_of(2 * n_in_band.max())[0] >= n_row, "lower than they need be"
    with pytest.raises(rz.SceneError, match="polygons meet one row of pixels; legal are 20: draw a larger picture"):
        bands_of(20)
