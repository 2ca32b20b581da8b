"""Check shadows in whole pictures: no acne, edges and penumbrae where geometry has them, same bytes however they are
drawn."""

from dataclasses import replace
from itertools import cycle, product

import numpy as np
import pytest
from helpers.pinhole import QUAD, SHADINGS, octasphere, torus, unit
from numpy.lib.stride_tricks import sliding_window_view

import rasterizer as rz
from rasterizer.engine import shadow_maps
from rasterizer.engine.lights import entry_of
from rasterizer.engine.shadow_maps import choose_views, corners_of, draw_maps
from rasterizer.reference import shadow
from rasterizer.scene.lights import Shadow

AMBIENT = 0.1
SHINY = rz.Material(diffuse=0.6, specular=0.3, shininess=10)
MATTE = rz.Material(diffuse=0.7, specular=0)
PLANE = np.array([[-1, -1, 0], [-1, 1, 0], [1, 1, 0], [1, -1, 0]], float)
BOX_FACES = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
KINDS = ("directional", "point", "spot", "area")
FLOOR_SIZE, FLOOR_HEIGHT, SCALE = (160, 120), 4.8, 25  # pixels a unit
SMALL, FINE = Shadow(128), Shadow(256)  # of which a texel is about as large as a pixel of the floor
ABOVE = rz.Camera.orthographic((0, 0, 10), (0, 0, 0), up=(0, 1, 0), height=FLOOR_HEIGHT)


def make_light(kind, elevation, azimuth, shadow):
    """A light of a kind in a direction as seen from the origin, 4 away: degrees above the plane z = 0 and round it."""
    e, a = np.radians([elevation, azimuth])
    toward = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    place, across = 4.0 * toward, unit(np.cross(toward, (0.3, 0.2, 0.7)))
    if kind == "directional":
        return rz.DirectionalLight(-toward, 0.8, shadow=shadow)
    if kind == "point":
        return rz.PointLight(place, 0.8, shadow=shadow)
    if kind == "spot":
        return rz.SpotLight(place, -toward, 0.8, outer=60, shadow=shadow)
    edges = 1.2 * across, 1.2 * np.cross(toward, across)
    return rz.AreaLight(place, *edges, 0.8, (2, 2), shadow=shadow)


TOLERANCES = (0.0, rz.Options().tolerance)  # float64, and float32 wherever it will do


def draw_both(meshes, light, camera, size, shading="phong", tolerance=0.0, **options):
    """The picture, and the one without shadows: what is lit is the same in both to the last bit."""
    frames = []
    for each in (light, replace(light, shadow=None)):
        scene = rz.Scene(meshes, (rz.AmbientLight(AMBIENT), each), camera)
        outputs = ("color", "face")
        frames.append(
            rz.render(scene, size, shading=shading, tolerance=tolerance, outputs=outputs, **{"samples": 1} | options)
        )
    return frames


def is_changed(frame, bare):
    """The pixels that a light's shadows change, (h, w) bool; in float32 by more than what both pictures may err."""
    bounds = frame.stats.error_bound + bare.stats.error_bound
    is_double = frame.stats.plan.dtype == bare.stats.plan.dtype == "float64"
    least = 0.0 if is_double else bounds
    return (np.abs(frame.color - bare.color) > least).any(axis=-1)


def n_different(*arguments, **options):
    """How many pixels a light's shadows change."""
    frame, bare = draw_both(*arguments, **options)
    assert bare.color.max() > AMBIENT / 4, "shadows change nothing in a black picture"
    return int(is_changed(frame, bare).sum())


def lit_share(frame, bare):
    """The part of the light that arrives at every pixel, where any could."""
    ambient = AMBIENT * np.array(MATTE.ambient)
    return ((frame.color - ambient) / np.maximum(bare.color - ambient, 1e-9))[..., 0]


def floor_points():
    """The places on the floor z = 0 that ABOVE shows, (h, w, 3)."""
    (width, height), scale = FLOOR_SIZE, FLOOR_HEIGHT / FLOOR_SIZE[1]
    x, y = np.meshgrid((np.arange(width) + 0.5 - width / 2) * scale, (height / 2 - np.arange(height) - 0.5) * scale)
    return np.stack([x, y, np.zeros_like(x)], axis=-1)


def floor_mesh(reach=(3.2, 2.4)):
    return rz.Mesh(PLANE * (*reach, 1), QUAD, material=MATTE)


def is_hidden(quad, points, light):
    """Whether a parallelogram (4, 3) stands between points (..., 3) and a light: rays against its plane."""
    is_parallel = isinstance(light, rz.DirectionalLight)
    away = -np.broadcast_to(light.direction, points.shape) if is_parallel else np.array(light.position) - points
    edges = np.stack([quad[1] - quad[0], quad[3] - quad[0]], axis=1)
    normal = np.cross(*edges.T)
    along = (quad[0] - points) @ normal / (away @ normal)
    place = (points + along[..., None] * away - quad[0]) @ np.linalg.pinv(edges).T
    return (along > 0) & ((along < 1) | is_parallel) & ((place > 0) & (place < 1)).all(axis=-1)


def is_at_edge(mask, reach=1):
    """Pixels that have both kinds of pixels within `reach` of them."""
    windows = sliding_window_view(np.pad(mask, reach, mode="edge"), (2 * reach + 1, 2 * reach + 1))
    return windows.any(axis=(2, 3)) & ~windows.all(axis=(2, 3))


def sphere(n_around, n_down):
    """A unit sphere of meridians and parallels."""
    down, around = np.pi * np.arange(1, n_down) / n_down, 2 * np.pi * np.arange(n_around) / n_around
    ring = [(np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)) for t in down for p in around]
    vertices = np.array([(0, 0, 1), *ring, (0, 0, -1)])
    index = 1 + np.arange((n_down - 1) * n_around).reshape(n_down - 1, n_around)
    following = np.roll(index, -1, axis=1)
    quads = np.stack([index[:-1], index[1:], following[1:], following[:-1]], axis=-1).reshape(-1, 4)
    top = [(0, a, b) for a, b in zip(index[0], following[0], strict=True)]
    bottom = [(len(vertices) - 1, b, a) for a, b in zip(index[-1], following[-1], strict=True)]
    return vertices, [*quads.tolist(), *top, *bottom]


def box(low, high):
    """Vertices of an upright box; BOX_FACES are its faces."""
    return np.array([[(low, high)[(k >> 2 - axis) & 1][axis] for axis in range(3)] for k in range(8)], float)


# ── no acne ─────────────────────────────────────────────────────────────────────────────────────────────


def assert_all_lit(cases):
    """Refuse shadows in any of the pictures: (name of the case, arguments of `draw_both`, its options)."""
    for name, arguments, options in cases:
        n = n_different(*arguments, **options)
        assert n == 0, f"{name}, {options}: {n} pixels in shadow"


def in_turns():
    """Shading and tolerance for one case after the other: every pair of them comes soon."""
    pairs = cycle(product(SHADINGS, TOLERANCES))
    return lambda: dict(zip(("shading", "tolerance"), next(pairs), strict=True))


def test_a_plane_alone_is_lit_everywhere():
    camera, plane = rz.Camera.perspective((1.5, 2, 3), (0, 0, 0), fov=40), rz.Mesh(PLANE, QUAD, material=SHINY)
    more = in_turns()
    assert_all_lit(
        (f"{kind}, {e} degrees, {texels} texels, {n} taps",
         ([plane], make_light(kind, e, 23 + 97 * e, shadow=Shadow(texels, n)), camera, (40, 30)), more())
        for kind in KINDS for texels, n in ((16, 1), (100, 3), (1024, 1)) for e in (5, 37, 90)
    )  # fmt: skip


CONVEX = {
    "8 x 6": lambda: sphere(8, 6),
    "32 x 24": lambda: sphere(32, 24),
    "64 x 48": lambda: sphere(64, 48),
    "octasphere": lambda: octasphere(2),
    "cube": lambda: (box((0, 0, 0), (1, 1, 1)), BOX_FACES),
}


def check_convex(choices, size):
    """Also where polygons are turned away from the light that their normals still look at."""
    camera = rz.Camera.perspective((1.5, 2, 4), (0, 0, 0), fov=35)
    models = {name: rz.Mesh(*make(), material=SHINY) for name, make in CONVEX.items()}
    places = ((15, 130), (50, 20), (-30, 70))
    assert_all_lit(
        (f"{name}, {kind}, {texels} texels, {n} taps, {e} degrees",
         ([models[name]], make_light(kind, e, a, shadow=Shadow(texels, n)), camera, size), more)
        for name, kind, (texels, n), more in choices for e, a in places
    )  # fmt: skip


MAPS = ((16, 1), (64, 1), (256, 1), (256, 5), (1024, 1))


def test_a_convex_model_casts_no_shadow_on_itself():
    more, kinds = in_turns(), cycle(("directional", "point", "point", "directional", "directional", "point"))
    choices = [(name, next(kinds), texels, more()) for texels in MAPS for name in CONVEX]
    check_convex(choices[::2], (64, 48))  # every second one: each map and each model is among them


# ── edges ───────────────────────────────────────────────────────────────────────────────────────────────


def floating_quad():
    """A parallelogram above the floor, turned and tilted."""
    turn = np.array([[np.cos(0.3), -np.sin(0.3), 0], [np.sin(0.3), np.cos(0.3), 0], [0, 0, 1]])
    corners = np.array([[-0.5, -0.4, 1], [0.6, -0.4, 1], [0.6, 0.5, 1.2], [-0.5, 0.5, 1.2]])
    return corners @ turn.T


EDGES = {
    "directional": (rz.DirectionalLight((0.5, 0.3, -1), 0.8, shadow=FINE), 1),
    "spot": (rz.SpotLight((-1.5, -1, 4), (0.4, 0.25, -1), 0.8, outer=60, shadow=FINE), 1),
    "wide spot": (rz.SpotLight((-1, -0.7, 1.9), (0.4, 0.25, -1), 0.8, outer=90, shadow=FINE), 6),
    "point": (rz.PointLight((-1.5, -1, 5), 0.8, shadow=FINE), 1),
    "point inside": (rz.PointLight((-1, -0.7, 1.9), 0.8, shadow=FINE), 6),
    "point over a corner": (rz.PointLight((-0.9, -0.9, 1.4), 0.8, shadow=FINE), 6),
}


@pytest.mark.parametrize("name", ["directional", "point"])
def test_maps_of_a_light_that_stands_still_are_drawn_once_where_no_view_needs_finer_ones(name, monkeypatch):
    scene, drawn = rz.Scene([floor_mesh()], [EDGES[name][0]]), []
    monkeypatch.setattr(shadow_maps, "draw_maps", lambda *given: drawn.append(draw_maps(*given)) or drawn[-1])
    with rz.Renderer(scene, (16, 12)) as renderer:
        for azimuth in (0, 10, 100):
            renderer.render(azimuth=azimuth, elevation=80, zoom=1.5)
        assert len(drawn) == 1
        renderer.render(elevation=80, zoom=20)
    assert len(drawn) == 1 + (name == "directional")


@pytest.mark.parametrize("name", EDGES)
def test_edges_are_within_a_pixel_of_the_analytic_ones(name):
    light, n_map = EDGES[name]
    meshes = [floor_mesh(), rz.Mesh(quad := floating_quad(), QUAD, material=MATTE)]
    beam, bounds = entry_of(light).beam(light, ABOVE.view()), np.stack([mesh.bounds for mesh in meshes])
    assert len(choose_views(beam, corners_of(bounds), light.shadow).views) == n_map
    hidden = is_hidden(quad, floor_points(), light)
    for tolerance in TOLERANCES:
        frame, bare = draw_both(meshes, light, ABOVE, FLOOR_SIZE, tolerance=tolerance)
        could_be_lit = (bare.color[..., 0] > AMBIENT * 0.7) & (frame.face < 2)
        wrong = (is_changed(frame, bare) != hidden) & could_be_lit
        assert (hidden & could_be_lit).sum() > 300
        far = wrong & ~is_at_edge(hidden)
        assert not far.any(), f"{far.sum()} of {wrong.sum()} wrong pixels are further than a pixel from the edge"
    if n_map == 6:  # the shadow crosses a border of two faces of the cube
        axis = np.abs(floor_points() - np.array(light.position)).argmax(axis=-1)
        assert sum((hidden & could_be_lit & (axis == k)).sum() > 60 for k in range(3)) >= 2


def test_no_light_leaks_in_where_a_box_stands_on_the_floor():
    """A ray meets the box if it is within all three pairs of planes at once (Kay & Kajiya 1986)."""
    low, high = np.array([-0.5, -0.5, 0]), np.array([0.5, 0.5, 1])
    meshes = [floor_mesh(), rz.Mesh(box(low, high), BOX_FACES, material=MATTE)]
    points, tolerances = floor_points(), cycle((0.0, *TOLERANCES))
    for direction in ((1, 0.2, -0.3), (1, 0.2, -1), (0.3, 0.1, -2), (1, 0.07, -0.05)):
        for light in (
            rz.DirectionalLight(direction, 0.8, shadow=FINE),
            rz.PointLight(-4 * unit(np.array(direction)) + (0, 0, 0.3), 0.8, shadow=FINE),
        ):
            frame, bare = draw_both(meshes, light, ABOVE, FLOOR_SIZE, tolerance=next(tolerances))
            is_parallel, case = isinstance(light, rz.DirectionalLight), f"{type(light).__name__}, {direction}"
            toward = -np.array(light.direction) if is_parallel else np.array(light.position) - points
            with np.errstate(divide="ignore", invalid="ignore"):
                ends = np.stack([(low - points) / toward, (high - points) / toward])
            enters, leaves = ends.min(axis=0).max(axis=-1), ends.max(axis=0).min(axis=-1)
            hidden = leaves > np.maximum(enters, 0)
            is_floor = frame.face < 2
            wrong = (is_changed(frame, bare) != hidden) & is_floor & ~is_at_edge(hidden)
            assert (hidden & is_floor).sum() > 60 and not wrong.any(), f"{case}: {wrong.sum()} pixels"
            assert not is_changed(frame, bare)[~is_floor].any(), f"{case}: nothing hides the top"


BALL_VIEWS = {
    "near": rz.Camera.perspective((2, -4, 2.5), (0, 0, 0.4), up=(0, 0, 1), fov=40),
    "to the horizon": rz.Camera.perspective((1, -4, 1.2), (0, 0, 0.8), up=(0, 0, 1), fov=60),
    "orthographic": rz.Camera.orthographic((2, -4, 2.5), (0, 0, 0.4), up=(0, 0, 1), height=4),
}


@pytest.mark.parametrize("name", BALL_VIEWS)
def test_a_ball_casts_its_shadow_on_floors_of_any_size(name):
    """The shadow's edge is off by 2 texels at most of a map of what the view shows up to ten times as far away."""
    camera, size = BALL_VIEWS[name], (120, 90)
    faces = octasphere(2)[1]
    ball = 0.5 * octasphere(2)[0] + (0, 0, 0.7)
    caster = ball[np.asarray(faces)]
    casters = shadow.gather_casters(caster, np.arange(len(caster)), np.ones(len(caster), bool))
    turns = 2 * np.pi * np.arange(16)[:, None] / 16
    tolerances = cycle(TOLERANCES)
    for reach, way in product(10.0 ** np.arange(1, 6), ((-1, 0.3, -1), (-1, -0.5, -0.2), (0.05, 0, -1))):
        light = rz.DirectionalLight(way, 0.8, shadow=Shadow(512))
        meshes = [floor_mesh((reach, reach)), rz.Mesh(ball, faces, material=MATTE)]
        frame, bare = draw_both(meshes, light, camera, size, tolerance=next(tolerances))
        view, lens = camera.view(), camera.projection(size)
        x, y = np.meshgrid(np.arange(size[0]) + 0.5 - lens.center_x, lens.center_y - np.arange(size[1]) - 0.5)
        beside = (x[..., None] * view.right + y[..., None] * view.up) / lens.scale_x
        starts = view.eye + (0 if lens.is_perspective else beside)
        rays = view.forward + (beside if lens.is_perspective else 0)
        is_floor = (frame.face >= 0) & (frame.face < 2)
        with np.errstate(divide="ignore"):
            depth = -starts[..., 2] / rays[..., 2]
        points = (starts + depth[..., None] * rays)[is_floor]
        depth = depth[is_floor]

        def hidden(places, toward):
            owner = np.full(len(places), shadow.NO_OWNER)
            return ~shadow.reaches(casters, places, owner, np.broadcast_to(toward, places.shape), False)

        is_dark = is_changed(frame, bare)[is_floor]
        wrong = np.flatnonzero(is_dark != hidden(points, -np.array(way)))
        u, v = np.linalg.svd(np.array([way], float))[2][1:]
        for k in wrong:
            near = points[depth <= 10 * depth[k]]
            texel = max(np.ptp(near @ u), np.ptp(near @ v)) / (512 - 2)
            across = 2 * texel * (np.cos(turns) * u + np.sin(turns) * v)
            round_it = hidden(points[k] + across - across[:, 2:] * np.array(way) / way[2], -np.array(way))
            assert len(set(round_it)) == 2, f"{name}, {reach:g}, {way}: further than 2 texels from the edge"
        assert is_dark.sum() > 50, f"{name}, {reach:g}, {way}: {is_dark.sum()} pixels in shadow"


# ── penumbra and filter ─────────────────────────────────────────────────────────────────────────────────


def half_plane():
    """A sheet at height 1 that ends at x = 0, and a floor."""
    sheet = np.array([[-3, -3, 1], [-3, 3, 1], [0, 3, 1], [0, -3, 1]], float)
    return [floor_mesh((3, 3)), rz.Mesh(sheet, QUAD, material=MATTE)]


def test_a_penumbra_is_as_wide_as_the_light_makes_it():
    """A light of length w, d1 before an edge, makes a penumbra of the width w·d2/d1 on what lies d2 behind the edge."""
    d1, d2 = 3.0, 1.0
    for length, tolerance in ((0.3, 0.0), (1.0, TOLERANCES[1])):
        light = rz.AreaLight((-3 - length / 2, -0.5, d1 + d2), (length, 0, 0), (0, 1, 0), 0.9, (8, 8), shadow=True)
        camera = rz.Camera.orthographic((1, 0, 10), (1, 0, 0), up=(0, 1, 0), height=0.004)
        frame, bare = draw_both(half_plane(), light, camera, (800, 4), tolerance=tolerance)
        share, x = lit_share(frame, bare)[2], 1 + (np.arange(800) + 0.5 - 400) * 0.001
        assert (np.diff(share) >= -1e-6).all() and abs(share[0]) < 1e-6 and abs(share[-1] - 1) < 1e-6, length
        weights, middle = np.diff(share), (x[1:] + x[:-1]) / 2
        center = (weights * middle).sum()
        width, expected = np.sqrt(12 * (weights * (middle - center) ** 2).sum()), length * d2 / d1
        assert abs(center - 1) < 0.02 and abs(width / expected - 1) < 0.1, f"{width:.4f}, expected {expected:.4f}"
        assert len(np.unique(share.round(5))) > 8


def test_the_filter_averages_comparisons():
    """Multiples of 1/n²; what is further than half the filter and a texel from an edge stays as it was."""
    texels, diagonal, cosine = 128, 8.6, 0.76  # of the floor; of the light on it
    meshes = [floor_mesh((3, 3)), rz.Mesh(floating_quad() * (1, 1, 0) + (0, 0, 1), QUAD, material=MATTE)]
    for n, tolerance in ((3, 0.0), (5, TOLERANCES[1]), (9, 0.0)):
        lights = [rz.DirectionalLight((0.8, 0.3, -1), 0.8, shadow=Shadow(texels, size)) for size in (1, n)]
        pictures = [draw_both(meshes, light, ABOVE, FLOOR_SIZE, tolerance=tolerance) for light in lights]
        hard, soft = (np.where(bare.face >= 0, lit_share(frame, bare), 1) for frame, bare in pictures)
        steps = soft * n * n
        off = np.abs(steps - steps.round()).max()
        assert off < 1e-3, f"{n} taps: {off:.3g} beside a multiple of 1/{n}²"
        assert len(np.unique(steps.round())) > n + 1
        # pixels that taps lie away, at most
        reach = int(np.ceil((n + 1) / 2 * 2**0.5 / cosine * diagonal / (texels - 2) * SCALE))
        assert not ((np.abs(soft - hard) > 1e-5) & ~is_at_edge(hard > 0.5, reach)).any(), f"{n} taps reach further"


def test_a_filter_reaches_across_the_borders_of_a_cubes_faces():
    """Further than the filter's reach from an edge of the shadow the light arrives whole, or not at all."""
    taps, texels, tolerances = 7, 512, cycle(TOLERANCES)
    meshes = [floor_mesh(), rz.Mesh(quad := floating_quad(), QUAD, material=MATTE)]
    points = floor_points()
    for name in ("point inside", "wide spot", "point over a corner"):
        light = replace(EDGES[name][0], shadow=Shadow(texels, taps))
        frame, bare = draw_both(meshes, light, ABOVE, FLOOR_SIZE, tolerance=next(tolerances))
        share, hidden = lit_share(frame, bare), is_hidden(quad, points, light)
        depth = np.abs(points - np.array(light.position)).max(axis=-1)
        could_be_lit = (bare.color[..., 0] > AMBIENT * 0.7 + 0.01) & (frame.face < 2)
        reach = int(np.ceil((taps + 1) / 2 * 2**0.5 * 2 * depth.max() / texels * SCALE))  # pixels
        inside = np.zeros_like(hidden)
        inside[reach:-reach, reach:-reach] = True  # what lies beside the picture is no edge that is seen
        is_sure = could_be_lit & inside & ~is_at_edge(hidden, reach)
        wrong = (np.abs(share - ~hidden) > 0.03) & is_sure
        assert (is_sure & hidden).sum() > 60 and not wrong.any(), f"{name}: {wrong.sum()} pixels"


# ── who casts, and on what ──────────────────────────────────────────────────────────────────────────────


def test_what_lets_light_through_casts_none():
    light = rz.DirectionalLight((0.5, 0.3, -1), 0.8, shadow=FINE)
    texture = rz.Texture(np.dstack([np.ones((2, 2, 3)), [[1.0, 0.5], [1.0, 1.0]]]))
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    for see_through in (replace(MATTE, opacity=0.9), replace(MATTE, texture=texture)):
        meshes = [floor_mesh(), rz.Mesh(floating_quad(), QUAD, uv=uv, material=see_through)]
        for shading in SHADINGS:
            frame, bare = draw_both(meshes, light, ABOVE, (80, 60), shading)
            assert np.array_equal(frame.color, bare.color), shading
        lid = rz.Mesh(floating_quad() + (-0.5, -0.3, 1), QUAD, material=MATTE)
        assert n_different([*meshes, lid], light, ABOVE, (80, 60)) > 25, "it receives none"
        assert n_different(meshes[1:], light, ABOVE, (80, 60)) == 0, "there is no caster at all"


@pytest.mark.parametrize("kind, tolerance", [*zip(KINDS, TOLERANCES * 2, strict=True)])
def test_a_light_of_the_camera_goes_with_it(kind, tolerance):
    """Given in the camera's frame, or in the world's where it is then: the same picture."""
    camera = rz.Camera.perspective((1.5, -3, 3), (0.2, 0, 0), up=(0, 0, 1), fov=50)
    view = camera.view()
    axes = np.stack([view.right, view.up, -view.forward])
    meshes = [floor_mesh(), rz.Mesh(floating_quad(), QUAD, material=MATTE)]
    place, direction = np.array((1.5, 1, 0.5)), np.array((-0.4, -0.5, -1))
    own = {
        "directional": rz.DirectionalLight(direction, 0.8, "camera", True),
        "point": rz.PointLight(place, 0.8, attached="camera", shadow=True),
        "spot": rz.SpotLight(place, direction, 0.8, outer=60, attached="camera", shadow=True),
        "area": rz.AreaLight(place, (1, 0, 0), (0, 1, 0), 0.8, (2, 2), attached="camera", shadow=True),
    }[kind]
    turned = {"attached": "world"}
    for field in ("direction", "edge_u", "edge_v", "position", "corner"):
        if hasattr(own, field):
            away = view.eye if field in ("position", "corner") else 0.0
            turned[field] = tuple(np.array(getattr(own, field)) @ axes + away)
    frames = [
        draw_both(meshes, light, camera, (80, 60), tolerance=tolerance) for light in (own, replace(own, **turned))
    ]
    (of_camera, bare), (of_world, _) = frames
    assert is_changed(of_camera, bare).sum() > 50
    differs = np.abs(of_camera.color - of_world.color).max(axis=-1) > 1e-5  # at edges a rounding decides
    assert differs.sum() < 6, f"{differs.sum()} pixels > 5"


# ── the same bytes ──────────────────────────────────────────────────────────────────────────────────────


def test_neither_threads_nor_earlier_pictures_matter():
    meshes = [floor_mesh(), rz.Mesh(floating_quad(), QUAD, material=SHINY), rz.Mesh(*torus(16, 12), material=SHINY)]
    lights = [
        rz.AmbientLight(AMBIENT),
        make_light("area", 40, 30, shadow=Shadow(128)),
        make_light("spot", 60, 200, shadow=SMALL),
        make_light("directional", 50, 120, shadow=SMALL),
    ]
    lights += [replace(make_light("point", 70, 100, shadow=SMALL), attached="camera", position=(1, 1, 0))]
    cameras = [rz.Camera.perspective((2, y, 4), (0, 0, 0), fov=40) for y in (-3, 0, 2)]
    cameras += [rz.Camera.perspective((0, y, 1), (0, 0, 0), fov=30) for y in (-1, 1)]  # which show a part
    for shading, threads in zip(SHADINGS, (2, 1, 3), strict=True):
        options = {"shading": shading, "samples": 1}
        with rz.Renderer(rz.Scene(meshes, lights), (64, 48), threads=threads, **options) as renderer:
            for k in (0, 1, 2, 0, 3, 3, 4, 0, 0):
                alone = rz.render(rz.Scene(meshes, lights, cameras[k]), (64, 48), threads=1, **options)
                frame = renderer.render(cameras[k])
                assert frame.color.tobytes() == alone.color.tobytes(), f"{shading}, {threads} threads, camera {k}"
                assert frame.rgba.tobytes() == alone.rgba.tobytes(), f"{shading}, {threads} threads, camera {k}"


def test_too_many_maps_are_refused():
    """2^28 texels of all maps: no memory is asked for before."""
    room, sun = rz.Mesh(box((-4,) * 3, (4,) * 3), BOX_FACES), rz.DirectionalLight((0, 0, -1), shadow=FINE)
    lamps = [rz.PointLight((0, 0, 0), shadow=Shadow(size)) for size in (8192, 6688)]
    for lights in ([lamps[0]], [sun, lamps[1]]):  # the lamp of 6 * 6688^2 texels would have room alone
        with pytest.raises(rz.SceneError, match="may have 268435456 texels; .*smaller shadow size, or fewer cells"):
            rz.render(rz.Scene([room], lights), 16, shading="phong", samples=1)
