"""The hard cases: scenes at the limits of numbers, of pictures and of meshes, each with what is right about it.

In: whether a small version will do, as in a test. Out: a `Case` for each, in the order of the table; the last ones are
limits. What is legal and what is read of files is tested with the readers (tests/io/).
"""

import warnings
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

import rasterizer as rz

LIGHTS = (rz.AmbientLight(0.1), rz.DirectionalLight((-0.4, -0.5, -0.8), 0.8))
LAMP = rz.PointLight((2.0, 3.0, 3.0), 0.9, (1.0, 0.1, 0.05))
SIZE = (96, 72)
FLOOR = ([(-3, -1, -3), (3, -1, -3), (3, -1, 3), (-3, -1, 3)], [[0, 2, 1], [0, 3, 2]])
SUN = rz.DirectionalLight((-0.4, -1.0, -0.5), 0.9, shadow=rz.Shadow(512))


class Scene(NamedTuple):
    """What a case draws."""

    scene: rz.Scene
    size: tuple[int, int] = SIZE
    options: dict = {}
    has_reference: bool = True  # False where that would take minutes: `expect` says what is right then
    expect: Callable | None = None  # function from the Frame to None, or to what is wrong with it
    figure: Callable | None = None  # function from the Frame and the reference's Picture to a figure in words
    warning: str = ""  # what its frames warn of holds this


class Refused(NamedTuple):
    """What a case does that is refused."""

    calls: dict[str, Callable]  # by name; each raises a RasterizerError


class Case(NamedTuple):
    """A hard case."""

    name: str
    why: str  # what happens, and why that is right: the function's docstring
    make: Callable  # function from `is_small` to a Scene, or to a Refused
    path: str  # the paths that draw it: "packed", "planes", "exact", or several; "" where it is refused
    is_shown: bool = True  # whether its picture shows anything


CASES: list[Case] = []


def case(name, path="", is_shown=True):
    """Put a function that makes a Scene into the table."""

    def add(make):
        CASES.append(Case(name, " ".join(make.__doc__.split()), make, path, is_shown))
        return make

    return add


def on_screen(size, points, depth, faces, is_perspective=False, lights=LIGHTS, near=None, far=None, **mesh):
    """A scene given by places in the picture (n, 2), px, and depths (n,): the camera stands at the origin and looks
    down -z; without perspective a unit is a pixel."""
    width, height = size
    points, depth = np.asarray(points, float), np.broadcast_to(np.asarray(depth, float), len(points))
    spread = depth / (height / 2) if is_perspective else np.ones(len(points))
    vertices = np.stack([(points[:, 0] - width / 2) * spread, (height / 2 - points[:, 1]) * spread, -depth], axis=1)
    make = rz.Camera.perspective if is_perspective else rz.Camera.orthographic
    camera = make((0, 0, 0), (0, 0, -1), near=near, far=far, **({"fov": 90} if is_perspective else {"height": height}))
    return rz.Scene([rz.Mesh(vertices, faces, **mesh)], lights, camera)


def ball(n=16, radius=1.0, center=(0.0, 0.0, 0.0), **mesh):
    """A ball of n by 2n quads."""
    polar, around = np.linspace(0.0, np.pi, n + 1), np.linspace(0.0, 2.0 * np.pi, 2 * n + 1)[:-1]
    t, p = (grid.ravel() for grid in np.meshgrid(polar, around, indexing="ij"))
    normals = np.stack([np.sin(t) * np.cos(p), np.cos(t), np.sin(t) * np.sin(p)], axis=1)
    row, k = (grid.ravel() for grid in np.meshgrid(np.arange(n), np.arange(2 * n), indexing="ij"))
    a, b = 2 * n * row + k, 2 * n * row + (k + 1) % (2 * n)
    faces = np.concatenate([np.stack([a, b, b + 2 * n], 1), np.stack([a, b + 2 * n, a + 2 * n], 1)])
    return rz.Mesh(np.asarray(center) + radius * normals, faces, normals=normals, **mesh)


def framed(meshes, lights=LIGHTS, **options):
    """A scene that its camera frames."""
    return Scene(rz.Scene(meshes, lights), options=options)


def every_face(name, faces):
    """Expect that a picture shows these faces alone."""

    def expect(frame):
        seen = np.unique(frame.face[frame.face >= 0]).tolist()
        return None if seen == sorted(faces) else f"{name}: faces {seen[:5]} are seen"

    return expect


# ── where the picture's grid is at its limit ──────────────────────────────────────────────────────────────


@case("slivers of 1/256 px by 8000 px", path="packed")
def slivers(is_small):
    """The fill rule is integer: a sliver shows at the samples that lie in it, and nowhere else."""
    size = (512 if is_small else 8192, 24)
    rng, n = np.random.default_rng(1), 40
    y = rng.integers(0, 20 * 256, n) / 256
    y[::4] = np.floor(y[::4]) + 0.5  # some have an edge on the samples of a row
    fall = np.where(np.arange(n) % 4 == 0, 0.0, rng.integers(-3 * 256, 3 * 256, n) / 256)
    right = np.full(n, size[0] - 0.5)
    points = np.stack([np.zeros(n), y, right, y + fall + 1 / 256, right, y + fall], 1).reshape(-1, 2)
    return Scene(on_screen(size, points, 2.0, np.arange(3 * n).reshape(-1, 3)), size)


@case("20 000 triangles below a pixel", path="packed")
def soup(is_small):
    """Each covers a sample or none. The nearest one at a sample is seen."""
    n, rng = 2000 if is_small else 20_000, np.random.default_rng(2)
    corners = rng.uniform((0, 0), SIZE, (n, 1, 2)) + rng.uniform(-0.7, 0.7, (n, 3, 2))
    depth = np.repeat(rng.uniform(1.0, 9.0, n), 3)
    return Scene(on_screen(SIZE, corners.reshape(-1, 2), depth, np.arange(3 * n).reshape(-1, 3)))


@case("a triangle of 10⁶ px", path="packed")
def wide_triangle(_):
    """Edges reach 2²⁰ px beyond the picture before anything is clipped: no pixel of it moves."""
    points = [(-500_000.3, -400_000.7), (600_000.1, 20.4), (-300_000.9, 700_000.2)]
    return Scene(on_screen(SIZE, points, [2.0, 3.0, 7.0], [[0, 1, 2]]))


@case("a span of 16 384 px, in packed samples", path="packed")
def long_packed_span(_):
    """ΔI is rounded to a level of 2⁻²⁴: half a level a step adds up, within a bound over the whole span."""
    made = long_span(_)

    def drift(frame, expected):
        errors = np.abs(frame.color - expected.color).max(axis=(0, 2))
        first, last = (errors[columns].max() for columns in (slice(0, 1024), slice(-1024, None)))
        return f"error {first:.1e} in the first 1024 px, {last:.1e} in the last"

    return made._replace(options={"tolerance": 1 / 256}, figure=drift)


@case("a span of 16 384 px", path="packed")
def long_span(_):
    """One line over it would add up more than the default tolerance: in pieces it starts anew."""
    size = (16_384, 4)
    points = [(-3.0, -2.0), (size[0] + 5.0, 1.0), (size[0] - 1.0, 9.0), (-9.0, 8.0)]
    normals = [(1, 0, 1), (-1, 0, 1), (0, 1, 1), (0, -1, 1)]
    return Scene(on_screen(size, points, [2.0, 3.0, 4.0, 5.0], [[0, 1, 2], [0, 2, 3]], normals=normals), size)


@case("10⁶ faces in one pixel", path="packed")
def crowded_pixel(is_small):
    """The nearest at the pixel's centre is seen; of those at equal depth the one with the lowest index."""
    n, rng = 10_000 if is_small else 1_000_000, np.random.default_rng(3)
    corners = np.array([0.5, 0.5]) + rng.uniform(-0.6, 0.6, (n, 3, 2))
    depth = 1.0 + rng.integers(0, 1000, n) / 256
    a, b, c = (corners[:, k] * 256 for k in range(3))
    grid = np.rint(np.stack([a, b, c], axis=1)).astype(np.int64) - 128

    def edge(p, q):
        return p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]

    sides = np.stack([edge(grid[:, k], grid[:, (k + 1) % 3]) for k in range(3)], axis=1)
    is_inside = (sides > 0).all(axis=1) | (sides < 0).all(
        axis=1
    )  # none has the centre on an edge, but for those left out
    is_inside &= (sides != 0).all(axis=1)
    corners[(sides == 0).any(axis=1)] += 5.0  # beside the picture
    first = np.flatnonzero(is_inside & (depth == depth[is_inside].min()))[0]
    scene = on_screen((1, 1), corners.reshape(-1, 2), np.repeat(depth, 3), np.arange(3 * n).reshape(-1, 3))

    def expect(frame):
        return None if frame.face[0, 0] == first else f"face {frame.face[0, 0]} is seen, not {first}"

    return Scene(scene, (1, 1), {}, False, expect)


# ── depth and perspective ─────────────────────────────────────────────────────────────────────────────────


@case("depths from 1 to 10³ … 10⁷ in one triangle", path="exact")
def deep_triangles(_):
    """Interpolation is that of I/w and 1/w, in float64 where a triangle's perspective needs it."""
    points = [(4.0, 4.0), (92.0, 10.0), (40.0, 69.0)]
    meshes = [on_screen(SIZE, points, [1.0, 10.0**p, 30.0], [[0, 1, 2]], True, normals=np.eye(3)).meshes[0]
              for p in (3, 4, 5, 6, 7)]  # fmt: skip
    moved = [
        rz.Mesh(m.vertices + [0.3 * k, -0.2 * k, -0.01 * k], m.faces, normals=m.normals) for k, m in enumerate(meshes)
    ]
    camera = rz.Camera.perspective((0, 0, 0), (0, 0, -1), fov=90)
    return Scene(rz.Scene(moved, LIGHTS, camera))


@case("the eye in a triangle's plane", path="packed", is_shown=False)
def edge_on(_):
    """Seen from its edge a triangle has no area, and covers nothing."""
    vertices = [(-1, 0, -3), (1, 0, -3), (0, 0, -9), (-1, -1, -5), (1, -1, -5), (0, 1, -5)]
    camera = rz.Camera.perspective((0, 0, 0), (0, 0, -1), fov=60)
    scene = rz.Scene([rz.Mesh(vertices, [[0, 1, 2], [3, 4, 5]])], LIGHTS, camera)
    return Scene(scene, expect=every_face("edge on", [1]))


@case("near : far of 10⁻⁶", path="packed")
def wide_range(_):
    """Depths are 38-bit integers: a step of the z-buffer is far below what separates these faces."""
    points = [(x + 30 * k, y) for k in range(3) for x, y in ((2, 2), (60, 8), (20, 66))]
    depth = np.repeat([1e-3, 1.0, 1e3], 3) * np.tile([1.0, 1.3, 1.1], 3)
    return Scene(on_screen(SIZE, points, depth, np.arange(9).reshape(3, 3), True, near=1e-3, far=1e3))


@case("a model 10¹⁰ away from the origin", path="packed")
def far_from_origin(_):
    """Coordinates are float64. What they can't tell there, 2⁻¹⁹ of a unit, no renderer can draw."""
    center = np.array([1e10, -3e10, 2e10])
    mesh = ball(12)
    vertices = center + np.rint(mesh.vertices * 2**16) / 2**16
    return framed([rz.Mesh(vertices, mesh.faces)], (rz.AmbientLight(0.1), rz.DirectionalLight((-0.4, -0.5, -0.8), 0.8)))


@case("units of 10⁻³⁰", path="exact")
def tiny_units(_):
    """Everything is relative to the scene's extent."""
    return framed([ball(12, 1e-30)])


@case("units of 10³⁰", path="exact")
def huge_units(_):
    """Everything is relative to the scene's extent."""
    return framed([ball(12, 1e30)])


@case("lengths whose squares are denormal, or 0", path="exact")
def denormals(_):
    """Areas are those of coordinates times a power of two. Scenes below 10⁻¹⁴⁴ are refused; float32 depths before."""
    return framed([ball(8, 1e-140)], outputs=("color", "face"))


@case("coplanar and coincident faces", path="packed")
def coincident(_):
    """At equal depth the face with the lower index is seen, in every mode and with any number of threads."""
    points = [(5, 5), (90, 5), (90, 68), (5, 68)]
    faces = [[0, 1, 2], [0, 2, 3], [0, 1, 3], [1, 2, 3], [2, 1, 0]]
    scene = on_screen(SIZE, points, [3.0, 4.0, 4.0, 3.0], faces)
    return Scene(scene, expect=every_face("coincident", [0, 1]))


def tilted(places, factor=1.0):
    """Depths (n,) at places (n, 2) of the picture, px, of a plane that is tilted."""
    width, height = SIZE
    x, y = (np.asarray(places, float) - (width / 2, height / 2)).T / (height / 2)
    return 3.0 * factor / (1.0 + 0.5 * x - 0.2 * y)


def never_seen(places, wrong, what):
    """Expect, with a figure, that some faces aren't seen within a convex polygon, a pixel away from its border.

    Judged by the planes as they are given: no vertex is rounded.
    """
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    corners = np.asarray(places, float)
    along = np.roll(corners, -1, axis=0) - corners
    sides = [(x - px) * dy - (y - py) * dx for (px, py), (dx, dy) in zip(corners, along, strict=True)]
    far = np.stack(sides) / np.linalg.norm(along, axis=1)[:, None, None]
    is_inside = (far > 1.0).all(axis=0) | (far < -1.0).all(axis=0)

    def figure(frame, _=None):
        n_wrong = int((is_inside & np.isin(frame.face, wrong)).sum())
        return f"{what} at {n_wrong} of {is_inside.sum()} px"

    def expect(frame):
        return figure(frame) if (is_inside & np.isin(frame.face, wrong)).any() else None

    return {"figure": figure, "expect": expect}


@case("tilted planes 10⁻⁶ of their depth apart", path="packed")
def nearly_coplanar(_):
    """A face has the depth of its own plane, not of the triangle whose corners were rounded: parallel ones keep
    order."""
    far, near = [(3, 3), (93, 6), (90, 69), (6, 66)], [(10, 9), (84, 5), (88, 60), (13, 64)]
    depth = np.concatenate([tilted(far), tilted(near, 1.0 - 1e-6)])
    scene = on_screen(SIZE, far + near, depth, [[0, 1, 2, 3], [4, 5, 6, 7]], True)
    return Scene(scene, **never_seen(near, [0, 1], "the further one is seen"))


@case("a decal", path="packed")
def decal(_):
    """A limit: of faces in one plane, on other corners, either may be seen."""
    own, wall = [(10, 9), (84, 5), (88, 60), (13, 64)], [(3, 3), (93, 6), (90, 69), (6, 66)]
    depth = np.concatenate([tilted(own), tilted(wall)])
    scene = on_screen(SIZE, own + wall, depth, [[0, 1, 2, 3], [4, 5, 6, 7]], True)
    return Scene(scene, figure=never_seen(own, [2, 3], "the wall behind it is seen")["figure"])


@case("interpenetrating triangles", path="packed")
def interpenetrating(_):
    """Visibility is decided at every sample: the line where they cross comes out by itself."""
    rng = np.random.default_rng(4)
    points = rng.uniform((-20, -20), (116, 92), (36, 2))
    return Scene(on_screen(SIZE, points, rng.uniform(1.0, 5.0, 36), np.arange(36).reshape(-1, 3), True))


@case("T-junctions", path="packed")
def t_junctions(_):
    """A vertex on a neighbour's edge is rounded like any other: a pixel may show through, as the mesh has a gap
    there."""
    points = [(3, 3), (93, 7), (48, 70), (3 + 90 / 3, 3 + 4 / 3), (40.3, 0.2), (3 + 60, 3 + 8 / 3)]
    return Scene(on_screen(SIZE, points, 2.0, [[0, 1, 2], [4, 3, 0], [4, 5, 3], [4, 1, 5]]))


# ── light ─────────────────────────────────────────────────────────────────────────────────────────────────


@case("normals that cancel", path="exact")
def vanishing_normals(_):
    """Where an interpolated normal vanishes nothing is divided by 0; `stats.steps` says how near no bound holds."""
    points = [(4, 4), (92, 6), (90, 68), (6, 70)]
    normals = [(0, 0.6, 0.8), (0, -0.6, -0.8), (0, 0.6, 0.8), (0, -0.6, -0.8)]
    return Scene(on_screen(SIZE, points, 2.0, [[0, 1, 2], [0, 2, 3]], normals=normals), options={"shading": "phong"})


@case("normals of length 0", path="packed")
def zero_normals(_):
    """A vertex that is said to have none gets the normal of its faces, as where no normals are given."""
    mesh = ball(8)
    normals = mesh.normals.copy()
    normals[::3] = 0.0
    return framed([rz.Mesh(mesh.vertices, mesh.faces, normals=normals)])


@case("exponents from 0.1 to 10⁶", path="planes, exact")
def exponents(_):
    """Powers are exp2 and log2 with a bound for each exponent; sharp ones are lit in float64."""
    meshes = [ball(12, center=(2.1 * k, 0, 0), material=rz.Material(specular=0.8, shininess=n))
              for k, n in enumerate((0.1, 1, 10, 1e3, 1e6))]  # fmt: skip
    return framed(meshes, shading="phong")


@case("a light on the surface", path="exact")
def light_on_surface(_):
    """Its direction is that of nothing in the nearest point: such points have no bound, and are told of."""
    return framed([ball(12)], (rz.AmbientLight(0.1), rz.PointLight((0.0, 1.0, 0.0), 0.5)), shading="phong")


@case("a light inside, and one very far away", path="planes, exact")
def lights_inside_and_far(_):
    """Only what it faces is lit; from 10¹² units away rays are parallel."""
    lights = (rz.PointLight((0.1, 0.2, 0.1), 1.0), rz.PointLight((1e12, 1e12, 3e11), 0.7, (1.0, 0.0, 0.0)))
    return framed([ball(12)], lights, shading="phong")


@case("intensities of 10⁻³⁰", path="packed", is_shown=False)
def dim(_):
    """The picture is black; its colours keep their digits."""
    return framed([ball(12)], (rz.DirectionalLight((-0.4, -0.5, -0.8), 1e-30),))


@case("intensities of 10³⁰", path="exact", is_shown=False)
def bright(_):
    """The picture is white; its colours keep their digits, the tolerance is of white 1."""
    return framed([ball(12)], (rz.DirectionalLight((-0.4, -0.5, -0.8), 1e30),))


@case("attenuation next to 0", path="exact")
def attenuation(_):
    """1/(kc + kl d + kq d²) has the limit 1, unless `amplify` asks for more."""
    lights = (rz.PointLight((0.0, 0.0, 1.05), 1.0, (0.0, 0.0, 1.0)),
              rz.PointLight((1.05, 0.0, 0.0), 0.02, (0.0, 1.0, 1e-9), amplify=True))  # fmt: skip
    return framed([ball(12)], lights, shading="phong")


# ── meshes ────────────────────────────────────────────────────────────────────────────────────────────────


@case("edges at exactly the crease angle", path="packed")
def on_the_crease(_):
    """They are no creases: neither split in shading nor drawn as edges, however the corners are rounded."""
    turn = 2 * np.pi * np.arange(12) / 12
    ring = np.stack([np.cos(turn), 0 * turn, np.sin(turn)], axis=1)
    corners = (
        np.concatenate([ring - (0, 0.8, 0), ring + (0, 0.8, 0)]) @ rz.Camera(position=(1, 2, 3), fov=40).view()[1:]
    )
    sides = [[(k + 1) % 12, k, 12 + k, 12 + (k + 1) % 12] for k in range(12)]
    faces = [*sides, list(range(12)), list(range(23, 11, -1))]
    options = {"edges": "crease", "edge_color": "white"}

    def drawn(angle):
        mesh = rz.Mesh(corners, faces, crease_angle=angle)
        return framed([mesh], **options)

    def expect(frame):
        at, above, below = (rz.render(drawn(angle).scene, SIZE, samples=1, **options).rgb for angle in (30, 31, 29.99))
        return None if (at == above).all() and (at != below).any() else "edges between the walls are drawn, or never"

    return drawn(30.0)._replace(expect=expect)


@case("three faces at an edge", path="packed")
def non_manifold(_):
    """Normals are averaged among the faces that meet at less than the crease angle."""
    vertices = [(0, -1, 0), (0, 1, 0), (-1, 0, 0.2), (1, 0, 0.3), (0.1, 0, 1.0)]
    return framed([rz.Mesh(vertices, [[0, 1, 2], [1, 0, 3], [0, 1, 4]], crease_angle=60.0)])


@case("a spiral of 24 turns, as one polygon", path="packed")
def spiral(is_small):
    """Concave polygons are cut into triangles between their corners: covered is what the outline encloses."""
    turns = 8 if is_small else 24
    turn = np.linspace(0.0, 2 * np.pi * turns, 40 * turns)
    radius = 2.0 + 33.0 * turn / turn[-1]
    outer, inner = radius + 0.5 * 33.0 / turns, radius
    arms = [np.stack([48 + r * np.cos(turn), 36 + r * np.sin(turn)], axis=1) for r in (outer, inner)]
    grid = np.rint(np.concatenate([arms[0], arms[1][::-1]]) * 256).astype(np.int64)

    def expect(frame):
        """Count how often a ray to the right crosses the outline (even-odd rule), in whole numbers."""
        x, y = np.meshgrid(256 * np.arange(SIZE[0]) + 128, 256 * np.arange(SIZE[1]) + 128)
        is_inside, is_at_border = np.zeros(x.shape, bool), np.zeros(x.shape, bool)
        for (ax, ay), (bx, by) in zip(grid, np.roll(grid, -1, axis=0), strict=True):
            side = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
            spans = (ay <= y) != (by <= y)
            is_inside ^= spans & ((side > 0) == (by > ay))
            is_at_border |= (side == 0) & (min(ay, by) <= y) & (y <= max(ay, by))
        n_wrong = (((frame.face >= 0) != is_inside) & ~is_at_border).sum()
        return f"{n_wrong} samples are covered wrongly" if n_wrong else None

    return Scene(on_screen(SIZE, grid / 256, 2.0, [list(range(len(grid)))]), expect=expect)


@case("a Möbius strip", path="packed")
def moebius(is_small):
    """It has no inside: faces are lit on the side that the viewer sees."""
    n = 24 if is_small else 96
    turn = np.linspace(0.0, 2.0 * np.pi, n + 1)[:-1]
    edges = []
    for side in (-0.35, 0.35):
        radius = 1 + side * np.cos(turn / 2)
        edges.append(np.stack([radius * np.cos(turn), side * np.sin(turn / 2), radius * np.sin(turn)], axis=1))
    k = np.arange(n)
    a, b, c, d = k, (k + 1) % n, n + (k + 1) % n, n + k
    b[-1], c[-1] = n, 0  # the strip closes upside down
    return framed([rz.Mesh(np.concatenate(edges), np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]))])


@case("a model that is inside out", path="packed")
def inside_out(_):
    """The side that looks inwards is left out, and lighting is two-sided: it looks like the right one."""
    mesh = ball(12)
    return framed([rz.Mesh(mesh.vertices, mesh.faces[:, ::-1], normals=mesh.normals)])


@case("texture coordinates of 10³ … 10⁷", path="planes")
def large_uv(_):
    """Whole repeats are taken off in float64; planes hold what is left, which float32 can tell."""
    places = [(x + 19 * k, y) for k in range(5) for x, y in ((2, 3), (17, 5), (16, 69), (3, 66))]
    start = np.repeat(10.0 ** np.arange(3, 8), 4)[:, None]
    uv = start + np.tile([(0, 1.9), (1.1, 1.7), (0.9, 0.1), (-0.1, 0)], (5, 1))
    image = np.random.default_rng(7).random((8, 8, 3))
    faces = [[4 * k, 4 * k + 1, 4 * k + 2, 4 * k + 3] for k in range(5)]
    material = rz.Material(texture=rz.Texture(image, filter="bilinear"))
    depth = np.tile([3.0, 4.0, 3.5, 3.0], 5)
    return Scene(on_screen(SIZE, places, depth, faces, True, uv=uv, material=material))


# ── what is known not to be exact ─────────────────────────────────────────────────────────────────────────


@case("shadows from a map", path="planes")
def shadow_map(_):
    """A limit: shadow edges come from maps here and from rays in the reference; 1 texel wide, `stats.steps` says so."""
    floor = rz.Mesh([(-3, -1, -3), (3, -1, -3), (3, -1, 3), (-3, -1, 3)], [[0, 2, 1], [0, 3, 2]])
    lights = (rz.AmbientLight(0.1), rz.DirectionalLight((-0.4, -1.0, -0.5), 0.9, shadow=rz.Shadow(512)))
    return framed([ball(10), floor], lights, shading="phong")


@case("a closed room in the sun", path="planes, exact")
def closed_room(_):
    """A limit: a map knows walls to one texel, so light may leak in along inner edges."""
    corners = np.array([(x, y, z) for x in (-2, 2) for y in (-1, 1) for z in (-2, 2)], float)
    walls = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    lights = (SUN, rz.PointLight((5.0, 4.0, 3.0), 0.9, shadow=rz.Shadow(512)))
    camera = rz.Camera.perspective((1.2, 0.3, 1.4), (-2, -0.6, -2), fov=100)
    material = rz.Material(ambient=0, diffuse=0.8, specular=0)
    made = Scene(rz.Scene(rz.Mesh(corners, walls, material=material), lights, camera), options={"shading": "phong"})

    def leaks(frame, _):
        is_lit = frame.color.max(axis=-1) > 1e-3
        return f"light leaks to {is_lit.sum()} of {is_lit.size} px"

    return made._replace(figure=leaks)


@case("transparent layers in one place", path="planes")
def layers(_):
    """Sorted at every sample by depth, then by index: no order of the file matters."""
    points = [(6, 6), (90, 9), (45, 66)]
    faces = np.arange(15).reshape(5, 3)
    material = rz.Material(opacity=0.5, diffuse=(0.8, 0.4, 0.2))
    scene = on_screen(SIZE, points * 5, np.repeat([3.0, 2.0, 4.0, 2.5, 2.0], 3), faces, material=material)
    return Scene(scene)


@case("steps of the illumination", path="exact")
def toon(_):
    """A limit: within float32's rounding of a toon's step no error is small; `stats.steps` says how near."""
    return framed([ball(12, material=rz.Material(reflection="toon"))], shading="phong")


# ── what it doesn't do ────────────────────────────────────────────────────────────────────────────────────


@case("a highlight inside a polygon", path="packed")
def lost_highlight(_):
    """A limit of Gouraud's method: no vertex sees the highlight, so no sample does."""
    normals = [(-0.5, -0.5, 0.7), (0.5, -0.5, 0.7), (0.5, 0.5, 0.7), (-0.5, 0.5, 0.7)]
    square = rz.Mesh([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [[0, 1, 2], [0, 2, 3]], normals,
                     material=rz.Material(diffuse=0.2, specular=0.8, shininess=200))  # fmt: skip
    made = Scene(rz.Scene(square, rz.DirectionalLight((0, 0, -1)), rz.Camera.perspective((0, 0, 4))))

    def expect(frame):
        bright = rz.render(made.scene, made.size, shading="phong").color.max()
        return None if frame.color.max() < 0.5 < bright else "the highlight isn't lost, or isn't there"

    return made._replace(expect=expect)


@case("the alpha of vertex colours", path="planes, exact")
def vertex_alpha(_):
    """A limit: it isn't drawn; the colours are, as if opaque."""
    mesh = ball(8)
    colors = np.concatenate([np.abs(mesh.normals), np.full((len(mesh.vertices), 1), 0.25)], axis=1)
    made = framed([replace(mesh, colors=colors)])
    return made._replace(
        expect=lambda frame: None if (frame.alpha[frame.face >= 0] == 1.0).all() else "something is seen through"
    )


@case("a polygon that crosses itself", path="packed")
def crossing_polygon(_):
    """A limit: no triangles between its corners fill it; it is warned of."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        mesh = rz.Mesh([(-1, -1, 0), (1, 1, 0), (1, -1, 0), (-1, 1, 0)], [[0, 1, 2, 3]])
    told = [str(each.message) for each in caught]
    is_told = len(told) == 1 and "crosses itself" in told[0]
    made = Scene(rz.Scene(mesh, LIGHTS, rz.Camera.perspective((0, 0, 5))))
    return made._replace(expect=lambda frame: None if is_told else f"warnings: {told}")


# ── shadows ───────────────────────────────────────────────────────────────────────────────────────────────


@case("a shadow on a floor of two triangles", path="packed")
def shadow_of_vertices(_):
    """A limit of Gouraud's method: shadows are those of vertices, so this one is lost."""
    plate = rz.Mesh([(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1)], [[0, 2, 1], [0, 3, 2]])
    lights = (rz.AmbientLight(0.1), replace(SUN, direction=(0.0, -1.0, 0.0)))
    made = Scene(rz.Scene([plate, rz.Mesh(*FLOOR)], lights, rz.Camera.perspective((0, 4, 6))))

    def expect(frame):
        floor = frame.color[frame.face >= 2]
        return None if floor.min() > 0.5 and np.ptp(floor, axis=0).max() < 1e-3 else "the floor isn't even"

    return made._replace(expect=expect)


@case("a shadow of a pane", path="planes")
def shadow_of_glass(_):
    """A limit: transparent surfaces cast no shadow."""
    pane = rz.Mesh([(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1)], [[0, 2, 1], [0, 3, 2]],
                   material=rz.Material(opacity=0.5))  # fmt: skip
    lights = (rz.AmbientLight(0.1), SUN)
    made = Scene(rz.Scene([rz.Mesh(*FLOOR), pane], lights, rz.Camera.perspective((0, 4, 6))),
                 options={"shading": "phong"})  # fmt: skip

    def expect(frame):
        floor = frame.color[frame.face < 2][frame.face[frame.face < 2] >= 0]
        return None if len(floor) and np.ptp(floor, axis=0).max() < 1e-3 else "the floor isn't even"

    return made._replace(expect=expect)


# ── reflection ────────────────────────────────────────────────────────────────────────────────────────────


@case("a highlight at the terminator", path="planes, exact")
def terminator(_):
    """A limit: classic highlights end with a step where N·L = 0; `stats.steps` says so."""
    material = rz.Material(diffuse=0.2, specular=0.8, shininess=1)
    return framed([ball(12, material=material)], (rz.DirectionalLight((0, 0, 1)),), shading="phong")


@case("a light parallel to a surface", path="planes")
def grazing(_):
    """Within 2⁻²⁰ rad, 2⁻⁴⁰ in float64, it counts as parallel, so that no rounding decides."""
    lights = tuple(rz.DirectionalLight((1.0, -angle, 0.0), 0.3) for angle in (0.0, 2.0**-60, 2.0**-21, 1e-3))
    floor = rz.Mesh(*FLOOR, material=rz.Material(diffuse=1.0, ambient=1.0))
    scene = rz.Scene(floor, (rz.AmbientLight(0.1), *lights), rz.Camera.perspective((0, 3, 5)))
    return Scene(scene, options={"shading": "phong"})


@case("Blinn's highlight against the light", path="planes, exact")
def against_the_light(_):
    """A limit: H = L + V vanishes; `stats.steps` says how near no bound holds."""
    material = rz.Material(diffuse=0.3, specular=0.7, shininess=20, reflection="blinn")
    return framed(
        [ball(12, material=material)], (rz.DirectionalLight((0.3, 0.2, 1.0), 1.0, "camera"),), shading="phong"
    )


@case("brushed metal where u is mirrored, and at a pole", path="exact")
def mirrored_seam(is_small):
    """A limit: tangents cancel there, and no direction is left."""
    n = 8 if is_small else 16
    mesh = ball(n)
    around = np.arctan2(mesh.normals[:, 2], mesh.normals[:, 0])
    uv = np.stack([np.abs(around) / np.pi, mesh.normals[:, 1]], axis=1)
    material = rz.Material(reflection="cook-torrance", roughness=(0.1, 0.5), tangent="u")
    return framed([replace(mesh, uv=uv, material=material)], shading="phong")


@case("colours of vertices under a spectrum", path="planes, exact")
def spectral_colors(_):
    """A limit: they are RGB, and multiply what the spectra have become."""
    mesh = ball(8)
    lights = (rz.AmbientLight(0.1), rz.DirectionalLight((-0.4, -0.5, -0.8), rz.Spectrum.blackbody(3000)))
    return framed([replace(mesh, colors=np.abs(mesh.normals))], lights)


# ── what is refused, or clipped ───────────────────────────────────────────────────────────────────────────


@case("a convex polygon of 24 corners", path="packed")
def convex_polygon(_):
    """It is a fan of 22 triangles round its lowest corner, in every shading and buffer."""
    turn = np.linspace(0.0, 2.0 * np.pi, 25)[:-1]
    rim = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    mesh = rz.Mesh(rim, [list(range(24))], normals=rim * (0.6, 0.6, 0) + (0, 0, 0.8))
    return Scene(rz.Scene(mesh, (*LIGHTS, LAMP), rz.Camera.perspective((0, 0, 4))))


@case("what is nearer than 2⁻²⁶ of the furthest distance", path="packed")
def nearer_than_near(_):
    """A limit: it is clipped, which is warned of; the rest is as it was."""
    points = [(8, 60), (88, 60), (48, 8)] * 2
    faces, depths = [[0, 1, 2], [3, 4, 5]], np.repeat([2.0**-28, 1.0], 3)
    return Scene(on_screen(SIZE, points, depths, faces, is_perspective=True), expect=only(1), warning="near plane")


def only(face):
    """Expect that one face alone is seen."""
    return lambda frame: None if np.unique(frame.face).tolist() == [-1, face] else "another face is seen"


@case("faces nearer together than depth can tell", path="packed")
def too_near(_):
    """A limit: 38 bits of the range of depths; there either may be in front."""
    points = [(8, 60), (88, 60), (48, 8)] * 2 + [(90, 2), (95, 2), (92, 6)]
    depths = np.repeat([2.0, 2.0 + 2.0**-40, 3.0], 3)
    return Scene(on_screen(SIZE, points, depths, [[0, 1, 2], [3, 4, 5], [6, 7, 8]]))


@case("numbers that float32 can't hold", is_shown=False)
def too_large(_):
    """Refused: coordinates above 10¹⁰⁰, intensities and depths above 3·10³⁸."""
    mesh = ball(4)
    return Refused({
        "coordinates": lambda: rz.Mesh(mesh.vertices * 1e101, mesh.faces),
        "intensities": lambda: rz.render(rz.Scene(mesh, rz.DirectionalLight((0, 0, -1), 1e39)), 8),
        "depths": lambda: rz.render(rz.Mesh(mesh.vertices * 1e40, mesh.faces), 8, outputs="depth"),
    })  # fmt: skip


@case("more samples than legal", is_shown=False)
def too_wide(_):
    """Refused: 262144 along an axis are the most."""
    mesh = ball(4)
    return Refused({
        "pixels": lambda: rz.render(mesh, (2**18 + 1, 1)),
        "samples": lambda: rz.render(mesh, (2**17, 1), samples=9),
    })  # fmt: skip
