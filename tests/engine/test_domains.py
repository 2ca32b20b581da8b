"""Check the domains of float32, and what a picture states: usual scenes stay in float32, hard ones keep what is stated,
and where nothing is stated the reason is; the campaign of all features is tests/pictures/test_campaign.py.

The exact picture is the judge's, or that of tolerance 0 where the judge would take too long.
"""

import warnings
from dataclasses import replace
from itertools import cycle, product
from pathlib import Path

import numpy as np
import pytest
from helpers.against_reference import depth_resolution
from helpers.arrays import differences
from helpers.pinhole import SHADINGS, octasphere

import rasterizer as rz
from rasterizer import reference
from rasterizer.cli.render import describe_bounds
from rasterizer.engine import domains
from rasterizer.engine.depth_range import screen_of
from rasterizer.engine.domains import EXACT, SHARES, TOO_MUCH
from rasterizer.engine.lights import FAR
from rasterizer.engine.prepared import MAX_DRAWINGS, PreparedScene
from rasterizer.engine.scene_tables import SceneTables
from rasterizer.options import DEFAULT_TOLERANCE as DEFAULT
from rasterizer.options import Options

SMALL = (24, 18)
FRONT = rz.Camera.perspective((0, 0, 3), fov=50)
SQUARE = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
QUAD = [[0, 1, 2], [0, 2, 3]]
BALL = octasphere(2)


def against_judge(scene, size, **options):
    """(frame, largest error) against the judge, where the order of surfaces is clear."""
    frame = rz.render(scene, size, outputs=("color", "face"), threads=1, **{"samples": 1} | options)
    options.pop("tolerance")
    expected = reference.render(scene, size, **options)
    is_clear = expected.margin > depth_resolution(scene, size, expected.depth, 2.0**15)
    is_same = (frame.face == expected.face) & is_clear
    return frame, np.where(is_same[..., None], np.abs(frame.color - expected.color), 0.0).max()


def assert_bounded(name, scene, size=SMALL, shading="phong", tolerance=DEFAULT, is_judged=True, most=None, **options):
    """Refuse an error above the stated bound, and a bound above `most`, where that is given."""
    chosen = {"shading": shading, "tolerance": tolerance} | options
    if is_judged:
        frame, error = against_judge(scene, size, **chosen)
        bound = frame.stats.error_bound
    else:
        frame, exact = (rz.render(scene, size, **chosen | {"tolerance": t, "samples": 1}) for t in (tolerance, 0))
        stated = [one.stats.error_bound for one in (frame, exact)]
        error, bound = np.abs(frame.color - exact.color).max(), None if None in stated else sum(stated)
        assert exact.color.max() > 0.1, f"{name}: black pictures keep any bound"
    assert np.isfinite(frame.color).all(), f"{name}: a colour is not finite"
    if bound is None:
        assert frame.stats.steps[-1].cause.startswith("no bound is stated: "), f"{name}: no reason is given"
        return frame
    assert bound <= max(2 * tolerance, 2 * EXACT), f"{name}: the bound {bound:.3g} is above the tolerance"
    full_scale = max(1.0, float(frame.color.max())) if bound <= 2 * EXACT else 1.0  # float64's is a share of it
    assert error <= bound * full_scale, f"{name}, {shading}, {tolerance:.2g}: {error:.3g} > the bound {bound:.3g}"
    assert most is None or bound <= max(most, 2 * tolerance), f"{name}: the bound {bound:.3g} > {most:.3g}"
    return frame


# ---------------------------------------------------------------- hard scenes: name, scene, what `assert_bounded` takes


def soup(rng, n, tilt=0.4):
    """Corners (3 n, 3) and faces (n, 3) of triangles in front of the camera, and a unit normal for each corner."""
    corners = rng.uniform(-0.8, 0.8, (n, 1, 3)) + rng.normal(size=(n, 3, 3)) * 0.7
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, None]
    normals = face / np.linalg.norm(face, axis=2, keepdims=True) + tilt * rng.normal(size=(n, 3, 3))
    return corners.reshape(-1, 3), np.arange(3 * n).reshape(n, 3), normals.reshape(-1, 3)


def much_depth():
    """The planes of n/w are scaled to the nearest corner: along a far edge, a 256th of a pixel from samples, little is
    left."""
    rng = np.random.default_rng(8)
    lights = (rz.DirectionalLight((0.3, -1, -0.4)), rz.DirectionalLight((-0.5, -0.2, -1), (0.2, 0.3, 0.6)))
    camera = rz.Camera.perspective((0, 0, 0), (0, 0, -1), fov=90)
    pixels = np.array([[32, 2.3], [3.5, 40.5 + 1 / 256], [60.5, 40.5 + 1 / 256]])
    for ratio, k in ((ratio, k) for ratio in (10.0, 1e3, 4e4, 1e6, 1e7) for k in range(3)):
        depth = np.array([1, ratio, 1.3 * ratio])
        vertices = np.stack([(pixels[:, 0] - 32) / 24 * depth, (24 - pixels[:, 1]) / 24 * depth, -depth], axis=1)
        normals = (0, 0.3, 1) + 0.4 * rng.normal(size=(3, 3))
        mesh = rz.Mesh(vertices, [[0, 1, 2]], normals=normals, material=rz.Material(specular=0))
        more = {"tolerance": (1e-5, DEFAULT, 0.01)[k], "is_judged": k == 1}
        yield f"depths of 1 to {ratio:.3g}", rz.Scene([mesh], lights, camera), {"size": (64, 48)} | more


def exponents():
    """h^n with n < 1 has no slope at h = 0: the error there is that of h, to the n-th power. No exponent may leave its
    place in a word."""
    lights, models = (rz.DirectionalLight((1, -0.2, 0.3)), rz.PointLight((2, 1, -1), 0.4)), cycle(("phong", "blinn"))
    for shininess, tolerance in zip((0.05, 0.1, 0.5, 0.99, 1.0), cycle((0.0, DEFAULT, 1e-6, 0.01))):
        material = rz.Material(specular=0.6, shininess=shininess, reflection=next(models))
        scene = rz.Scene([rz.Mesh(*BALL, material=material, crease_angle=180)], lights, FRONT)
        yield f"{material.reflection}, {shininess}", scene, {"tolerance": tolerance}
        # Whole faces on which R·V is 0 but for rounding.
        for angle in (0.3, 0.9, 1.2):
            camera = rz.Camera.orthographic((0, -3 * np.cos(angle), 3 * np.sin(angle)), height=2.5)
            light = rz.DirectionalLight((0, np.sin(angle), -np.cos(angle)))
            scene = rz.Scene([rz.Mesh(SQUARE, QUAD, material=material)], light, camera)
            yield f"{material.reflection}, {shininess}, {angle}", scene, {"is_judged": False}
    for shininess, specular in ((1e-50, 0.5), (3e8, 6e-10), (1e11, 0.5), (1e30, 6e-10), (1e300, 6e-10)):
        mesh = rz.Mesh(*BALL, material=rz.Material(specular=specular, shininess=shininess), crease_angle=180)
        for tolerance in (DEFAULT, 0.5):
            more = {"is_judged": False, "size": (48, 36), "tolerance": tolerance}
            yield f"{shininess}, {specular}", rz.Scene([mesh], rz.studio(), FRONT), more
    for exponent, (inner, outer) in zip((1e-50, 0.3, 1e5, 1e300, 0.3), cycle(((10, 80), (90, 90), (30, 30), (40, 90)))):
        light = rz.SpotLight((0.2, 0.1, 2), (0, 0, -1), 0.8, inner, outer, exponent)
        yield f"spot, {exponent}, {inner} to {outer}", rz.Scene([rz.Mesh(SQUARE, QUAD)], light, FRONT), {}


def many_lights(most=1000):
    """The rounding of a sum grows with the number of its terms."""
    mesh = rz.Mesh(SQUARE, QUAD, material=rz.Material(diffuse=1.0, specular=0.3, shininess=6))
    for n, tolerance in ((10, 1e-6), (most, 1e-5), (most, DEFAULT)):
        lights = [rz.AmbientLight(0.05), *[rz.DirectionalLight((0.1, 0.2, -1), 0.83 / n) for _ in range(n)]]
        more = {"size": (8, 6), "is_judged": False, "tolerance": tolerance, "shading": "flat"}
        yield f"{n} lights", rz.Scene([mesh], lights, FRONT), more


def scene_units():
    """Lengths whose squares float32 can't hold."""
    for unit, tolerance in zip((1e-30, 1e-22, 1e-21, 1e-10, 1e10, 1e19, 1e25, 1e60), cycle((DEFAULT, 0.0, DEFAULT))):
        mesh = rz.Mesh(unit * BALL[0], BALL[1], crease_angle=180)
        attenuation = (0.5, 0.1 / unit, 0.0)
        lights = rz.DirectionalLight((0, -1, -1), 0.4), rz.PointLight((2 * unit, unit, 3 * unit), 0.5, attenuation)
        more = {"tolerance": tolerance, "most": 1e-5}
        yield f"unit {unit}", rz.Scene([mesh], lights, rz.Camera.perspective((0, 0, 3 * unit), fov=50)), more
        straight = rz.Camera.orthographic((0, 0, 3 * unit), height=2.5 * unit)
        yield f"unit {unit}, straight", rz.Scene([mesh], lights, straight), {}


def nearly_clear():
    """Colours are divided by the opacity: it must have its digits."""
    rng = np.random.default_rng(3)
    for opacity, tolerance in zip((1e-3, 1e-5, 1e-9, 1e-30), cycle((0.0, DEFAULT))):
        vertices, faces, normals = soup(rng, 4)
        mesh = rz.Mesh(vertices, faces, normals=normals, material=rz.Material(opacity=opacity))
        more = {"tolerance": tolerance, "most": 1e-5}
        yield f"opacity {opacity}", rz.Scene([mesh], rz.studio(), FRONT), more


def wide_views():
    """At 175 degrees the ray through the first column is thousands of times as long as that through the middle."""
    wall = rz.Mesh(SQUARE * (4e4, 300, 0) - (0, 0, 1), QUAD, material=rz.Material(specular=0.6, shininess=60))
    for light, tolerance in ((rz.DirectionalLight((0.1, -0.1, -1), 0.8), 5e-5), (rz.PointLight((0.5, 0.2, 1)), 1e-5)):
        scene = rz.Scene([wall], light, rz.Camera.perspective((0, 0, 0), (0, 0, -1), fov=175))
        yield type(light).__name__, scene, {"size": (16384, 8), "is_judged": False, "tolerance": tolerance}


def tips_of_slivers():
    """A light next to the tip."""
    rng = np.random.default_rng(2)
    for k in range(10):
        tip, along = rng.uniform(-0.6, 0.6, 3), rng.normal(size=3)
        vertices = np.array([tip, tip + along, tip + along + 10.0 ** rng.uniform(-4, -1) * rng.normal(size=3)])
        place = tip + 10.0 ** rng.uniform(-6, -1) * rng.normal(size=3)
        scene = rz.Scene([rz.Mesh(vertices, [[0, 1, 2]])], rz.PointLight(place, 0.8, (0.5, 1, 0)), FRONT)
        yield f"sliver {k}", scene, {"size": (64, 48), "tolerance": (DEFAULT, 0.0, 0.01)[k % 3]}


def next_to_a_lamp():
    """Without perspective, with tolerance 0: a floor from under the eye to far away."""
    floor = rz.Mesh([[-4, -2e-6, 1e-7], [4, -2e-6, 1e-7], [4, -2e-6, -8], [-4, -2e-6, -8]], [[0, 1, 2, 3]])
    camera = rz.Camera.orthographic((0, 0, 0), (0, -1, -2.0), height=1e-5)
    yield "a lamp", rz.Scene(floor, [rz.PointLight((0, 1e-5, 0), 0.9)], camera), {"size": (48, 36), "tolerance": 0.0}


def noise_on_what_shines():
    """Neighbouring texels are black and white, and highlights are bright."""
    image = 255 * np.random.default_rng(4).integers(0, 2, (64, 64, 3), np.uint8)
    plate = rz.Mesh(SQUARE, QUAD, uv=[[0, 0], [2, 0], [2, 2], [0, 2]])
    for metallic, lights in product((0.0, 1.0), (rz.studio(), [rz.DirectionalLight((0.3, -0.2, -1), 1.2)])):
        for texture in (rz.Texture(image), rz.Texture(image, "bilinear")):
            look = rz.Material(reflection="cook-torrance", specular=1, diffuse=0.96, roughness=0.9, metallic=metallic,
                               texture=texture)  # fmt: skip
            scene = rz.Scene([replace(plate, material=look)], lights, FRONT)
            yield f"noise, {metallic}, {texture.filter}", scene, {"size": (64, 48)}


@pytest.mark.parametrize(
    "scenes",
    [much_depth, exponents, many_lights, scene_units,
     nearly_clear, wide_views, tips_of_slivers, next_to_a_lamp, noise_on_what_shines],
)  # fmt: skip
def test_the_stated_bound_holds_in_hard_scenes(scenes):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for (name, scene, more), shading in zip(scenes(), cycle(("phong", "gouraud", "phong", "flat"))):
            is_of_normals = scenes in (much_depth, wide_views, next_to_a_lamp)
            assert_bounded(name, scene, **{"shading": "phong" if is_of_normals else shading} | more)


def test_alphas_of_what_is_nearly_clear_have_their_digits():
    for name, scene, _ in nearly_clear():
        frame, expected = rz.render(scene, SMALL, samples=1), reference.render(scene, SMALL)
        is_seen = expected.alpha > 0
        off = np.abs(frame.alpha[is_seen] / expected.alpha[is_seen] - 1).max()
        assert off <= 3e-7, f"{name}: alpha differs by {off:.3g} of itself > 3e-7"


def test_floors_of_any_size_are_lit_from_the_side_that_is_seen():
    rng = np.random.default_rng(6)
    for k in range(50):
        size, height = 10.0 ** rng.uniform(3, 8), rng.uniform(0.5, 3)
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        corners = rng.uniform(-size, size, (8, 3)) * (1, 0, 1) @ turn.T
        faces = rng.permuted(np.tile(np.arange(8), (6, 1)), axis=1)[:, :3]
        eye, target, up = turn @ (0, height, 0), turn @ (1, height - 1e-3, 0.2), turn[:, 1]
        camera = rz.Camera.perspective(eye, target, up, fov=2)
        scene = rz.Scene(rz.Mesh(corners, faces, material=rz.Material(specular=0)), rz.DirectionalLight(-up), camera)
        frame = rz.render(scene, SMALL, shading="flat", outputs=("color", "face"), samples=1)
        assert (frame.color[frame.face >= 0] >= 0.5).all(), f"floor {k} of {size:.3g} units is lit from below"


# ---------------------------------------------------------------- steps, words, and what can't be drawn


def test_steps_are_told_by_their_cause():
    def of(material, light, **mesh):
        scene = rz.Scene([rz.Mesh(SQUARE, QUAD, material=material, **mesh)], light, FRONT)
        return " ".join(step.cause for step in rz.render(scene, SMALL, shading="phong", samples=1).stats.steps)

    sun, dull = rz.DirectionalLight((0, 0, -1)), rz.Material(specular=0)
    assert of(dull, sun) == "" and of(rz.Material(normalized=True), sun) == ""
    assert "N·L = 0" in of(rz.Material(), sun) and "Blinn" in of(rz.Material(reflection="blinn"), sun)
    assert "toon" in of(rz.Material(reflection="toon"), sun)
    for taps in (1, 5):  # half of the filter, and half a texel
        scene = rz.Scene(rz.Mesh(SQUARE, QUAD), rz.DirectionalLight((0, 0, -1), shadow=rz.Shadow(64, taps)), FRONT)
        near = {step.unit: step.near for step in rz.render(scene, SMALL, shading="phong", samples=1).stats.steps}
        assert near["texels of the shadow map"] == taps / 2 + 0.75
    assert "spot" in of(dull, rz.SpotLight((0, 0, 2), (0, 0, -1), 1.0, 20, 20))
    assert of(dull, rz.SpotLight((0, 0, 2), (0, 0, -1), 1.0, 10, 20)) == ""
    assert "a light on a surface" in of(dull, rz.PointLight((-1, -1, 0), 0.3, (0, 0, 1), amplify=True))
    frame = rz.render(rz.Scene([rz.Mesh(SQUARE, QUAD)], sun, FRONT), SMALL, outputs=("depth",))
    assert frame.stats.error_bound == 0 and frame.stats.steps == ()
    stats = rz.render(rz.Scene([rz.Mesh(SQUARE, QUAD)], sun, FRONT), SMALL, tolerance=0, samples=1).stats
    line = describe_bounds(stats)
    assert line.startswith("errors are at most 1e-06 in linear intensity; ") and "N·L = 0" in line


def test_what_float32_cannot_hold_is_refused_with_the_legal_range():
    square, sun = rz.Mesh(SQUARE, QUAD), (0, 0, -1)
    bright = rz.Mesh(SQUARE, QUAD, material=rz.Material(diffuse=1e200))
    far = rz.Scene([rz.Mesh(1e60 * SQUARE, QUAD)], rz.studio(), rz.Camera.perspective((0, 0, 3e60)))
    for scene, outputs, words in (
        (rz.Scene([square], rz.DirectionalLight(sun, 1e39), FRONT), "color", "legal is up to 3.4e"),
        (rz.Scene([bright], rz.AmbientLight(1e200), FRONT), "color", "legal is up to 3.4e"),
        (far, "depth", "depth buffer holds"),
    ):
        with pytest.raises(rz.SceneError, match=words):
            rz.render(scene, SMALL, outputs=outputs, samples=1)
    assert rz.render(far, SMALL, samples=1).color.max() > 0.1
    for place in ((1e101, 0, 0), (0, -1e300, 0)):
        for make in (rz.PointLight, rz.Camera.perspective):
            with pytest.raises(rz.SceneError, match="1e\\+100"):
                make(place)
    frame = rz.render(rz.Scene([square], rz.DirectionalLight(sun, 1e37), FRONT), SMALL, samples=1)
    assert not differences(np.isfinite(frame.color), True) and frame.color.max() > 1e36


def test_a_renderer_states_the_bound_of_each_view():
    """Not that of the view before: from far away a light on a surface leaves too little."""
    light, dull = rz.PointLight((0, 0, 0.05), 0.5), rz.Material(specular=0)
    scene = rz.Scene(rz.Mesh(SQUARE, QUAD, material=dull), [light])
    cameras = [rz.Camera.perspective((0, 0, 3 * away), fov=50 / away) for away in (1, 50)]
    with rz.Renderer(scene, (16, 12), shading="phong", samples=1) as renderer:
        found = [renderer.render(camera).stats for camera in cameras]
    alone = [rz.render(replace(scene, camera=each), (16, 12), shading="phong", samples=1).stats for each in cameras]
    assert [one.error_bound for one in found] == [one.error_bound for one in alone]
    assert [one.plan.dtype for one in found] == ["float32", "float64"] and found[1].error_bound == EXACT


def test_nothing_is_stated_where_float64_is_not_enough():
    """Exponents that magnify the rounding of float64."""
    sun = rz.DirectionalLight((0, 0, -1))
    for look in (rz.Material(shininess=1e12), rz.Material(reflection="blinn", shininess=1e11)):
        scene = rz.Scene([rz.Mesh(*BALL, material=look)], sun, FRONT)
        stats = rz.render(scene, SMALL, tolerance=0, samples=1).stats
        assert stats.error_bound is None and "magnify" in describe_bounds(stats)
        assert [step.near for step in stats.steps if step.cause.startswith("no bound is stated")] == [np.inf]


# ---------------------------------------------------------------- what is said of scenes as they come


def see(scene, **options):
    """What is stated of a scene, before anything is drawn."""
    chosen, camera = Options(**{"size": (64, 48), "samples": 1} | options), scene.camera_for((64, 48))
    made = PreparedScene(SceneTables(scene, chosen), chosen)
    screen, _ = screen_of(camera, camera.view(), made.n_sample, made.geometry, made.tables.bounds)
    return made.see(camera.view(), screen, made.slice_view(camera.view(), screen))


def test_the_reason_of_float64_is_that_of_the_view():
    """From near a lamp's light can't be told so well from afar; from very far lengths have no digits."""
    scene = rz.Scene(rz.Mesh(*BALL), [rz.PointLight((0, 1.02, 0), 0.5)])
    cameras = [rz.Camera.perspective((0, 0, away), fov=fov) for away, fov in ((3e3, 0.05), (1e20, 30.0), (3e3, 0.05))]
    with rz.Renderer(scene, SMALL, shading="phong") as renderer:
        found = [renderer.render(camera).stats.plan.reasons for camera in cameras]
    alone = [rz.render(scene, SMALL, shading="phong", camera=camera).stats.plan.reasons for camera in cameras]
    assert found == alone == [(TOO_MUCH,), (FAR,), (TOO_MUCH,)]


def test_few_drawings_are_kept(monkeypatch):
    scene = rz.Scene([rz.Mesh(SQUARE, QUAD, material=rz.Material(diffuse=0.1 * k)) for k in range(5)])
    chosen, camera, shares = Options(size=SMALL), scene.camera_for(SMALL), product(SHARES, repeat=5)
    made = PreparedScene(SceneTables(scene, chosen), chosen)
    screen, _ = screen_of(camera, camera.view(), made.n_sample, made.geometry, made.tables.bounds)
    monkeypatch.setattr(domains, "share_of_tolerance", lambda *_: np.array(next(shares)))
    for _ in range(100):
        made.see(camera.view(), screen, {})
    assert len(made.drawings) <= MAX_DRAWINGS


def usual_scenes():
    """What people draw: (name, scene)."""
    models = Path(__file__).resolve().parents[2] / "models"
    for path in sorted(models.iterdir()):
        if path.suffix in (".obj", ".ply", ".stl") or path.name in ("materials.json", "parallel.json"):
            scene = rz.load(path)
            yield path.name, scene
            if path.suffix == ".obj":
                yield f"{path.name}, on a table", rz.Scene(scene.meshes, rz.tabletop(), scene.camera)
    ball = rz.load(models / "sphere.obj").meshes[0]
    spot = rz.SpotLight((2, 3, 3), (-2, -3, -3), 6.0, 20, 35, 2, attenuation=(0, 0, 1))
    area = rz.AreaLight((2, 3, 3), (1, 0, 0), (0, 0, 1), 0.9)
    lights = {"studio": rz.studio(), "point": rz.PointLight((2, 3, 3), 0.9), "spot": spot, "area": area}
    for (kind, of_kind), n, model in product(lights.items(), (5, 32, 200), ("phong", "blinn")):
        material = rz.Material(reflection=model, shininess=n, specular=0.4)
        yield f"{model}, {n}, {kind}", rz.Scene([replace(ball, material=material)], of_kind)
    for roughness in (0.35, 0.6, 1.0):
        material = rz.Material(reflection="cook-torrance", roughness=roughness, specular=0.5)
        yield f"ggx, {roughness}", rz.Scene([replace(ball, material=material)], rz.studio())


def test_usual_scenes_are_lit_in_float32():
    for name, scene in usual_scenes():
        for shading in SHADINGS:
            drawing, bound, _ = see(scene, shading=shading)
            rows = drawing.plan.of_materials
            assert not rows.is_double.any(), f"{name}, {shading}: {rows.reasons}"
            assert bound == DEFAULT and (rows.shares <= 1 / 2).all(), f"{name}, {shading}: {bound}, {rows.shares}"
