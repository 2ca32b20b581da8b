"""Check shadow maps: against rays in random scenes of separate solids, their texels against rational numbers, which
are drawn, and which are kept."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.pinhole import octasphere, unit

import rasterizer as rz
from rasterizer.cores import Workers
from rasterizer.engine.points import gather_geometry
from rasterizer.engine.shadow_maps import draw_maps, gather_casters, plan_maps
from rasterizer.pipeline import shadow_lookup as lookup
from rasterizer.pipeline.workspace import WorkspacePool

KINDS = ("directional", "point", "spot", "point inside")
MOVED = 3  # texels: what a filter of one reaches, and one, twice, as the sine of 1 at most has it
MATTE = rz.Material(diffuse=0.7, specular=0)
DOUBLE = np.dtype(float)


def drawn_map(light, meshes, view):
    """The maps of a light, in float64; None where none is drawn."""
    bounds = np.stack([mesh.bounds for mesh in meshes])
    casters = gather_casters(gather_geometry(rz.Scene(meshes).meshes, False), bounds, None)
    planned = plan_maps(light, view, casters)
    return planned and draw_maps(planned, casters, DOUBLE, WorkspacePool(), Workers(1))


# ---------------------------------------------------------------- against rays


def cone(n_side, height):
    """A cone of unit radius about the y axis, without a base; the normal of its apex stands far off its sides."""
    around = 2 * np.pi * np.arange(n_side) / n_side
    rim = np.stack([np.cos(around), np.zeros(n_side), -np.sin(around)], axis=1)
    following = np.roll(np.arange(n_side), -1)
    sides = [(n_side, k, following[k]) for k in range(n_side)]
    return np.vstack([rim, [(0, height, 0)]]), sides


def box():
    """A box within the unit sphere."""
    corners = np.array([[(k >> axis & 1) - 0.5 for axis in range(3)] for k in range(8)]) * 1.1
    return corners, [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]


def random_solids(rng):
    """A floor, and 3 to 6 solids over it whose bounding spheres don't meet."""
    shapes = (lambda: cone(24, 1.3), lambda: cone(7, 2.0), lambda: octasphere(1), lambda: octasphere(2), box)
    spheres, meshes = [], [rz.Mesh([[-4, 0, -4], [-4, 0, 4], [4, 0, 4], [4, 0, -4]], [[0, 1, 2, 3]], material=MATTE)]
    n_solid = rng.integers(3, 7)
    while len(spheres) < n_solid:
        center, size = rng.uniform((-2, 0.9, -2), (2, 2.2, 2)), rng.uniform(0.25, 0.5)
        vertices, faces = shapes[rng.integers(len(shapes))]()
        radius = size * np.linalg.norm(vertices, axis=1).max()
        if all(np.linalg.norm(center - other) > radius + its for other, its in spheres) and center[1] > radius:
            turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
            turn = turn * np.sign(np.linalg.det(turn)) if rng.random() < 0.5 else np.eye(3)
            spheres.append((center, radius))
            meshes.append(rz.Mesh(vertices * size @ turn.T + center, faces, material=MATTE, crease_angle=100))
    return meshes


def random_light(rng, kind):
    """A light of a kind above the floor, with a map of a random size."""
    shadow = rz.Shadow(int(rng.choice([256, 400, 1024, 2048])))
    toward = unit(rng.uniform((-1, 0.4, -1), (1, 1.2, 1)))
    if kind == "directional":
        return rz.DirectionalLight(-toward, 0.8, shadow=shadow)
    if kind == "spot":
        return rz.SpotLight(8 * toward, -toward, 0.8, outer=40, shadow=shadow)
    return rz.PointLight(8 * toward if kind == "point" else rng.uniform((-3, 3.4, -3), (3, 4, 3)), 0.8, shadow=shadow)


def bare_of(light):
    """The light without shadows."""
    return replace(light, shadow=None)


def meets(corners, starts, ways):
    """Where rays (n, 3) meet triangles (m, 3, 3): multiples of `ways`, (n, m), infinite where they don't."""
    a, b, c = corners.transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = ((a - starts[:, None]) * normal).sum(axis=-1) / (ways @ normal.T)
        place = starts[:, None] + t[..., None] * ways[:, None]
        sides = [(np.cross(q - p, place - p) * normal).sum(axis=-1) for p, q in ((a, b), (b, c), (c, a))]
    return np.where((np.array(sides) >= 0).all(axis=0), t, np.inf)


def values_at(block, row, points, planes, corners, faces, shift, hop):
    """What a map should hold at the texels' centres that points (n, 3) lie at, moved by `shift` and `hop` texels: the
    value of the nearest other face, and the largest that lets the point be lit."""
    axes, (scale_x, scale_y), center = row[:9].reshape(3, 3), row[9:11], row[11:13]
    scale, half = np.array([scale_x, -scale_y]), 0.5
    is_perspective = block[lookup.IS_PERSPECTIVE] != 0
    away = points @ axes.T
    depth = away[:, 2:] if is_perspective else 1.0
    centers = np.floor(center + scale * away[:, :2] / depth + 8 * shift) + half + hop

    def line(places):
        """The light's rays through places of the map, (n, 3) each: where they start, where they go."""
        across = ((places - center) / scale) @ axes[:2]
        if is_perspective:
            return np.zeros_like(across), across + axes[2]
        return across - 100 * axes[2], np.broadcast_to(axes[2], across.shape)

    def value(t):
        return 1 / t if is_perspective else 100 - t

    def plane_value(places):
        starts, ways = line(places)
        return value(((points - starts) * planes).sum(axis=1) / (ways * planes).sum(axis=1))

    middle = plane_value(centers)
    slopes = sum(abs(plane_value(centers + step) - middle) for step in np.eye(2))
    starts, ways = line(centers + shift)
    t = meets(corners, starts, ways)
    t[np.arange(len(points)), faces] = np.inf
    t[t <= 0] = np.inf
    return value(t.min(axis=1)), middle + half * slopes


def pixels_of(frame, camera, light, corners):
    """The pixels that show a polygon that faces the light: their indices (2, n), points (n, 3), faces, planes."""
    rows, columns = np.nonzero(frame.face < len(corners))
    faces = frame.face[rows, columns].astype(int)
    view, projection = camera.view(), camera.projection(frame.size)
    x = (columns + 0.5 - projection.center_x) / projection.scale_x
    y = (projection.center_y - rows - 0.5) / projection.scale_y
    ways = view.forward + x[:, None] * view.right + y[:, None] * view.up
    a, b, c = corners[faces].transpose(1, 0, 2)
    planes = unit(np.cross(b - a, c - a))
    points = view.eye + ways * (((a - view.eye) * planes).sum(axis=1) / (ways * planes).sum(axis=1))[:, None]
    is_parallel = isinstance(light, rz.DirectionalLight)
    toward = np.broadcast_to(-np.array(light.direction), points.shape) if is_parallel else light.position - points
    is_front = ((planes * toward).sum(axis=1) > 0) & ((planes * ways).sum(axis=1) < 0)
    return np.stack([rows, columns])[:, is_front], points[is_front], faces[is_front], planes[is_front], toward[is_front]


def check_scene(kind, seed, size):
    """A polygon's own ray decides, but where the nearest texel's centre sees something else: there an edge lies within
    half a texel, or what is in the way is nearer than the slopes of the polygon's plane over half a texel.

    Polygons that are turned away, which normals may let be lit, are left out. The rays of the texel's centre are nine,
    a 256th of a texel apart: the map's vertices are rounded to half of that. The picture's are rounded to 1/256 px, no
    more than a 32nd of a texel here: so far from the border of a texel the next one may be asked. Where normals stand
    off a polygon its points are moved, by MOVED texels at most.
    """
    rng = np.random.default_rng([KINDS.index(kind), seed])
    meshes, light = random_solids(rng), random_light(rng, kind)
    camera = rz.Camera.perspective(rng.uniform((-5, 3, 5), (5, 5, 7)), (0, 0.8, 0), fov=38)
    scene, bare = (rz.Scene(meshes, (rz.AmbientLight(0.1), each), camera) for each in (light, bare_of(light)))
    options = {"shading": "phong", "tolerance": 0.0, "samples": 1, "outputs": ("color", "face")}
    frame, without = (rz.render(each, size, **options) for each in (scene, bare))
    shadow_map = drawn_map(light, meshes, camera.view())
    corners = np.concatenate([mesh.vertices[mesh.faces] for mesh in meshes])
    pixels, points, faces, planes, toward = pixels_of(frame, camera, light, corners)
    could_be_lit = without.color[tuple(pixels)][:, 0] > 0.1 * 0.7 + 1e-3
    pixels, points, faces, planes, toward = (
        pixels[:, could_be_lit], *(each[could_be_lit] for each in (points, faces, planes, toward))
    )  # fmt: skip
    is_dark = (frame.color != without.color).any(axis=-1)[tuple(pixels)]
    t = meets(corners, points, toward)
    t[np.arange(len(points)), faces] = np.inf
    nearest = np.where(t > 1e-9, t, np.inf).min(axis=1)
    is_hidden = nearest < (np.inf if kind == "directional" else 1.0)
    is_sure = np.ones(len(points), bool)
    block, from_light = shadow_map.block, points - shadow_map.origin
    axis = np.abs(from_light).argmax(axis=1)
    is_cube = block[lookup.N_MAP] == 6
    number = 2 * axis + (from_light[np.arange(len(points)), axis] <= 0) if is_cube else np.zeros(len(points), int)
    for k in np.unique(number):
        here, row = number == k, block[lookup.MAPS + k * lookup.N_MAP_COLUMN :][: lookup.N_MAP_COLUMN]
        moved, round_it = corners - shadow_map.origin, np.indices((3, 3)).reshape(2, 9).T - 1
        ways = [(way / 256, 0 * way) for way in round_it] + [(0.0 * way, MOVED * way) for way in round_it]
        for shift, hop in ways:
            found, most = values_at(block, row, from_light[here], planes[here], moved, faces[here], shift, hop)
            is_sure[here] &= (found > most) == is_hidden[here]
    wrong = (is_dark != is_hidden) & is_sure
    case = f"{kind}, seed {seed}"
    assert not wrong.any(), (
        f"{case}: {wrong.sum()} of {len(wrong)} pixels, {(wrong & is_dark).sum()} dark: {pixels[:, wrong].T}"
    )
    assert is_hidden.any() and is_sure.mean() > 0.75, f"{case}: {is_sure.mean():.3f} > 0.75 are sure"


@pytest.mark.parametrize("kind", KINDS)
def test_a_pixel_is_dark_where_rays_find_something_in_the_way(kind):
    for seed in range(2):
        check_scene(kind, seed, (24, 18))


@pytest.mark.nightly
@pytest.mark.parametrize("kind", KINDS)
def test_every_pixel_of_many_scenes_is_dark_where_rays_find_something_in_the_way(kind):
    for seed in range(2, 6):
        check_scene(kind, seed, (64, 48))


# ---------------------------------------------------------------- which maps are drawn, and kept


def test_too_many_maps_are_refused():
    """2^28 texels of all maps: no memory is asked for before."""
    room = rz.Mesh(4 * np.array([[x, y, z] for x in (-1.0, 1) for y in (-1.0, 1) for z in (-1.0, 1)]),
                   [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])  # fmt: skip
    sun = rz.DirectionalLight((0, 0, -1), shadow=rz.Shadow(256))
    lamps = [rz.PointLight((0, 0, 0), shadow=rz.Shadow(size)) for size in (8192, 6688)]
    for lights in ([lamps[0]], [sun, lamps[1]]):  # the lamp of 6 * 6688^2 texels would have room alone
        with pytest.raises(rz.SceneError, match="may have 268435456 texels; .*smaller shadow size, or fewer cells"):
            rz.render(rz.Scene([room], lights), 16, shading="phong", samples=1)
