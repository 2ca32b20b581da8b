"""Polygons about their centres: no corner is preferred, and the reference agrees."""

from itertools import cycle, product

import numpy as np
from helpers.against_reference import EXACT, assert_matches_reference
from helpers.arrays import differences

import rasterizer as rz
from rasterizer.geometry.points import gather_geometry
from rasterizer.geometry.polygons import Centers, fill_means, with_means

SIZE = (32, 24)
SHADINGS = ("gouraud", "phong")
AMBIENT_ALONE = rz.Material(ambient=1, diffuse=0, specular=0)
QUAD = np.array([(-1.0, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])


def turned(polygon, steps, is_reversed=False):
    polygon = np.roll(polygon, steps).tolist()
    return polygon[::-1] if is_reversed else polygon


def grey(values):
    return np.asarray(values, float)[:, None] * np.ones(3)


def straight_on(meshes, **lights):
    return rz.Scene(
        meshes, [rz.AmbientLight(1)], rz.Camera.orthographic((0, 0, 5), (0, 0, 0), (0, 1, 0), 2.0), **lights
    )


def test_the_middle_of_a_quad_is_the_mean_of_its_corners():
    """0, 1, 0, 1: a fan shows 0 or 1 in the middle, as its list begins."""
    for first, shading, tolerance in product(range(2), SHADINGS, (0.0, 1 / 4096)):
        scene = straight_on(rz.Mesh(QUAD, [turned(range(4), first)], colors=grey([0, 1, 0, 1]), material=AMBIENT_ALONE))
        frame = rz.render(scene, 32, shading=shading, tolerance=tolerance, outputs=("color",), samples=1)
        middle, case = frame.color[15:17, 15:17, 0].mean(), f"first corner {first}, {shading}, {tolerance:.2g}"
        assert abs(middle - 0.5) < 1e-6, f"{case}: {middle} instead of 0.5"
        # Between the bottom edge and the centre values are linear along the edge: 0 to 1 from left to right.
        off = np.abs(frame.color[31, :, 0] - (np.arange(32) + 0.5) / 32).max()
        assert off < 2e-6 + tolerance, f"{case}: {off:.3g} off along the edge"


def polygon_scene(rng, k, steps=0, is_reversed=False, shading="gouraud", is_bent=False):
    """A convex polygon of k corners with normals, colours and texture coordinates of its corners, and lights near
    by."""
    angle = np.sort(rng.uniform(0, 2 * np.pi, k)) + np.arange(k) * 0.3
    angle *= 2 * np.pi / (angle[-1] + 0.4)
    points = np.stack([np.cos(angle), np.sin(angle), np.zeros(k)], axis=1)
    if is_bent:
        points[:, 2] = rng.uniform(-0.1, 0.1, k)
    axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    while abs(axes[2, 2]) < 0.4:  # else hardly anything of it is seen
        axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    facing = axes[:, 2] if axes[2, 2] >= 0 else -axes[:, 2]
    points = points @ axes.T * 0.8
    normals = rng.normal(size=(k, 3)) * 0.6 + facing
    colors, uv = rng.uniform(size=(k, 3)), rng.uniform(size=(k, 2))
    order = turned(range(k), steps, is_reversed)
    texture = rz.Texture(np.linspace(0.2, 1, 48).reshape(4, 4, 3).astype(np.float32))
    material = rz.Material(diffuse=0.9, specular=0.3, shininess=9, texture=texture)
    mesh = rz.Mesh(points, [order], normals=normals, colors=colors, uv=uv, material=material)
    lights = [rz.AmbientLight(0.1), rz.PointLight(tuple(rng.normal(size=3) + (0, 0, 2)), (1, 0.8, 0.6))]
    return rz.Scene([mesh], lights, rz.Camera.perspective((0.2, 0.1, 3), (0, 0, 0), fov=45))


def test_no_corner_is_preferred():
    """Another first corner, or the other direction, changes nothing: colours, depths and normals are the same."""
    for (seed, k), shading in zip(enumerate([4, 4, 5, 6, 9, 17, 4, 5]), cycle(SHADINGS)):
        frames = []
        for steps, is_reversed in ((0, False), (1, False), (k // 2, False), (k - 1, False), (1, True)):
            rng = np.random.default_rng(seed // 2)
            scene = polygon_scene(rng, k, steps, is_reversed, is_bent=seed % 4 > 1)
            frames.append(rz.render(scene, SIZE, shading=shading, tolerance=0, outputs=("color", "depth", "normal")))
        is_seen, case = np.isfinite(frames[0].depth), f"{k} corners, seed {seed}, {shading}"
        assert frames[0].color.max() > 0.05 and is_seen.sum() > 10, f"{case}: black pictures are the same, too"
        for frame in frames[1:]:
            assert (np.isfinite(frame.depth) == is_seen).all(), f"{case}: other samples are covered"
            for name in ("color", "depth", "normal"):
                off = np.abs(getattr(frames[0], name)[is_seen] - getattr(frame, name)[is_seen]).max()
                assert off <= 1e-6, f"{case}: {name} differs by {off:.3g} > 1e-6"


def test_the_reference_agrees_about_polygons():
    """Polygons, triangles and concave ones, with textures, several materials, in front of and behind the near plane."""
    for seed, shading in zip(range(8), cycle(SHADINGS)):
        rng = np.random.default_rng(seed)
        scene = polygon_scene(rng, int(rng.integers(4, 8)), is_bent=seed % 4 > 1)
        points = np.array([(-2, -1, -1), (2, -1, -1), (2, -1, 4), (-2, -1, 4), (0, -1, 0), (0, 2, -2.0)])
        floor = rz.Mesh(
            points, [(0, 1, 2, 3), (0, 4, 1, 5), (1, 2, 5)],
            materials=(rz.Material(diffuse=(1, 0.5, 0.2)), rz.Material(diffuse=0.4, specular=0.5)),
            face_material=[0, 1, 0], face_colors=rng.uniform(size=(3, 3)),
        )  # fmt: skip
        scene = rz.Scene([*scene.meshes, floor], scene.lights, scene.camera)
        assert_matches_reference(scene, SIZE, EXACT, shading=shading, tolerance=0, ignored=0.06, far=0.01)
    for seed, shading in enumerate(SHADINGS):  # transparent ones
        rng = np.random.default_rng(seed)
        offsets = np.array([(0, 0, z) for z in (-1, 0, 1)])[:, None]
        meshes = [
            rz.Mesh(points, [(0, 1, 2, 3)], colors=rng.uniform(size=(4, 3)), material=rz.Material(opacity=0.5))
            for points in rng.normal(size=(3, 4, 3)) * 0.1 + QUAD * [1, 1, 0] + offsets
        ]
        scene = rz.Scene(meshes, [rz.PointLight((1, 2, 3), 1.0)], rz.Camera.perspective((0.3, 0.2, 5), (0, 0, 0)))
        assert_matches_reference(scene, SIZE, EXACT, shading=shading, tolerance=0, ignored=0.02)


def test_the_default_tolerance_holds_for_polygons():
    for seed, shading in product(range(4), SHADINGS):
        scene = polygon_scene(np.random.default_rng(seed), 4 + seed % 3)
        (mesh,) = scene.meshes
        plain = rz.Mesh(mesh.vertices, mesh.faces, polygons=mesh.polygons, colors=mesh.colors, normals=mesh.normals)
        scene = rz.Scene(plain, scene.lights, scene.camera)
        options = {"shading": shading, "outputs": "color", "samples": 1}
        exact, cheap = (rz.render(scene, SIZE, tolerance=t, **options) for t in (0, 1 / 4096))
        off = np.abs(exact.color - cheap.color).max()
        assert exact.color.max() > 0.05, f"seed {seed}: black pictures are within any tolerance"
        assert off <= 1 / 4096, f"seed {seed}, {shading}: {off:.3g} > {1 / 4096:.3g}"


def test_flat_colours_do_not_depend_on_the_first_corner():
    for shape in (QUAD, np.concatenate([QUAD, [(-2.0, 0, 0)]])):
        k = len(shape)
        for first in range(k):
            scene = straight_on(
                rz.Mesh(shape, [turned(range(k), first)], colors=grey(np.arange(k) % 2), material=AMBIENT_ALONE)
            )
            color = rz.render(scene, 8, shading="flat", tolerance=0, outputs=("color",), samples=1).color[4, 4, 0]
            assert abs(color - (np.arange(k) % 2).mean()) < 1e-6, f"first corner {first}: {color}"
            assert_matches_reference(scene, (8, 8), EXACT, shading="flat", tolerance=0)


def test_flat_shading_needs_no_centres():
    mesh = rz.Mesh(QUAD, [(0, 1, 2, 3)])
    assert gather_geometry(rz.Scene(mesh).meshes, True).centers is None
    assert gather_geometry(rz.Scene(rz.Mesh(QUAD, [(0, 1, 2), (0, 2, 3)])).meshes, False).centers is None


def test_each_piece_belongs_to_the_triangle_with_its_edge():
    """Hexagon, then a triangle, then a quad: pieces stand where their polygons stood."""
    angle = np.arange(6) * np.pi / 3
    points = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    mesh = rz.Mesh(points, [(0, 1, 2, 3, 4, 5), (0, 1, 2), (0, 1, 3, 4)])
    geometry = gather_geometry(rz.Scene(mesh).meshes, False)
    assert geometry.n_loaded == mesh.n_face == 7 and geometry.vertex.shape == (3, 11)
    assert (np.diff(np.asarray(mesh.polygons)[geometry.face]) >= 0).all(), "another order of the polygons"
    for piece, face in zip(geometry.vertex.T, geometry.face, strict=True):
        edge = geometry.positions[piece[:2]]
        corners = points[mesh.faces[face]]
        assert all((corners == end).all(axis=1).any() for end in edge), f"no edge of face {face}"
    # The centre of the hexagon is its middle, but for the rounding of its corners; no point of a group is one.
    assert np.abs(geometry.positions[-2]).max() < 1e-15
    assert geometry.point_offsets[-1] == geometry.centers.first == len(geometry.points) - 2


def test_a_mirrored_mesh_keeps_its_centres():
    angle = np.arange(5) * 2 * np.pi / 5
    points = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    for polygon in ([0, 1, 2, 3], [0, 1, 2, 3, 4]):
        mesh = rz.Mesh(points, [polygon]).transformed(np.diag([-1.0, 1, 1, 1]))
        geometry = gather_geometry(rz.Scene(mesh).meshes, False)
        assert geometry.vertex.shape[1] == len(polygon)
        corners = geometry.positions[geometry.vertex.T]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert (normals[:, 2] > 0).all(), "wound against the polygon"


def test_subdivided_and_interrupted_polygons_are_drawn_as_they_are():
    quad = rz.Mesh(QUAD, [(0, 1, 2, 3)])
    assert gather_geometry(rz.Scene(quad.subdivide()).meshes, False).centers is None
    points = np.concatenate([QUAD, QUAD + 3])
    torn = rz.Mesh(points, [(0, 1, 2), (4, 5, 6), (0, 2, 3)], polygons=[0, 1, 0])
    assert gather_geometry(rz.Scene(torn).meshes, False).centers is None


def test_means_stay_within_their_points():
    values = np.random.default_rng(5).uniform(size=(40, 3))
    values[10:20] = 0.1  # three of them summed and divided are not 0.1 again
    offsets = np.array([0, 3, 10, 20])
    points = np.concatenate([[10, 11, 12], np.arange(13, 20), np.arange(10) * 3])
    centers = Centers(40, offsets, points)
    expected = with_means(values, centers)
    out = np.concatenate([values, np.full((3, 3), np.nan)])
    fill_means(out, 40, offsets, points, 0, 3)
    assert not differences(out[40:42], 0.1) and not differences(expected[40:42], 0.1)
    assert np.abs(out[42] - expected[42]).max() <= np.finfo(float).eps
