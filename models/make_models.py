"""Make the model files of this folder: `python models/make_models.py [folder]`.

Every model is a `Solid`: points, y up, and faces with any number of corners, counter-clockwise from outside.
Surfaces are built as grids of points; the grid's columns and rows are laid so that (step along a row) x
(step to the next row) points outwards, which makes the winding right by construction:

        j ->            face (i, j) = (i, j) (i, j+1) (i+1, j+1) (i+1, j)
      i  0---1---2
      |  | / | / |      outward normal = d/dj x d/di
      v  3---4---5

The files are the same bytes on every run and machine: sums are written out in a fixed order, not left to a
linear algebra library, and coordinates are rounded to six decimals before they are written.
"""

import sys
from itertools import combinations
from pathlib import Path

import numpy as np
from model_formats import (
    Solid,
    glb_bytes,
    mtl_bytes,
    obj_bytes,
    obj_parts_bytes,
    on_unit_sphere,
    ply_bytes,
    rounded,
    stl_bytes,
)
from model_globe import globe_files

# Martin Newell's teapot, University of Utah, 1975, with the bottom that was added later; z is up here.
# Four rows of control points make a bicubic patch and neighbours share a row: rows 0-3, 3-6, 6-9 and so on.
# Body and lid, a quarter of the turn; (r, k, z) is the row (r, 0, z) (r, -k, z) (k, -r, z) (0, -r, z).
TEAPOT_BODY = (
    (1.4, 0.784, 2.4), (1.3375, 0.749, 2.53125), (1.4375, 0.805, 2.53125),  # rim, from inside
    (1.5, 0.84, 2.4), (1.75, 0.98, 1.875), (2.0, 1.12, 1.35),  # wall
    (2.0, 1.12, 0.9), (2.0, 1.12, 0.45), (1.5, 0.84, 0.225),
    (1.5, 0.84, 0.15), (1.5, 0.84, 0.075), (1.425, 0.798, 0.0), (0.0, 0.0, 0.0),  # foot and bottom
)  # fmt: skip
TEAPOT_LID = (
    (0.0, 0.0, 3.15), (0.8, 0.45, 3.15), (0.0, 0.0, 2.85),  # knob
    (0.2, 0.112, 2.7), (0.4, 0.224, 2.55), (1.3, 0.728, 2.55), (1.3, 0.728, 2.4),
)  # fmt: skip
# Handle and spout, half; (xa, za, xb, zb, w) is the row (xa, 0, za) (xa, -w, za) (xb, -w, zb) (xb, 0, zb).
TEAPOT_HANDLE = (
    (-1.6, 2.025, -1.5, 2.25, 0.3), (-2.3, 2.025, -2.5, 2.25, 0.3), (-2.7, 2.025, -3.0, 2.25, 0.3),
    (-2.7, 1.8, -3.0, 1.8, 0.3), (-2.7, 1.575, -3.0, 1.35, 0.3), (-2.5, 1.125, -2.65, 0.9375, 0.3),
    (-2.0, 0.9, -1.9, 0.6, 0.3),
)  # fmt: skip
TEAPOT_SPOUT = (
    (1.7, 1.425, 1.7, 0.6, 0.66), (2.6, 1.425, 3.1, 0.825, 0.66), (2.3, 2.1, 2.4, 2.025, 0.25),
    (2.7, 2.4, 3.3, 2.4, 0.25), (2.8, 2.475, 3.525, 2.49375, 0.25), (2.9, 2.475, 3.45, 2.5125, 0.15),
    (2.8, 2.4, 3.2, 2.4, 0.15),
)  # fmt: skip


# ---------- building blocks


def grid_faces(n_row, n_column, *, wrap_rows=False, wrap_columns=False):
    """List the quads of a grid numbered row by row; where it wraps, the last line meets the first."""
    number = np.arange(n_row * n_column).reshape(n_row, n_column)
    if wrap_rows:
        number = np.concatenate([number, number[:1]])
    if wrap_columns:
        number = np.concatenate([number, number[:, :1]], axis=1)
    quads = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1)
    return [tuple(quad) for quad in quads.reshape(-1, 4).tolist()]


def joined(solids):
    """Put solids into one, each with its own points."""
    faces, first = [], 0
    for solid in solids:
        faces += [tuple(first + i for i in face) for face in solid.faces]
        first += len(solid.points)
    return Solid(np.concatenate([solid.points for solid in solids]), faces)


def welded(solid):
    """Round the points, make equal ones one point, and drop the corners and faces that collapse by that.

    A quad with one side at a pole becomes a triangle. Points are numbered in the order of their first use.
    """
    points = [tuple(point) for point in rounded(solid.points).tolist()]
    number = {}
    faces = []
    for face in solid.faces:
        corners = [points[i] for i in face]
        corners = [corner for k, corner in enumerate(corners) if corner != corners[k - 1]]
        if len(set(corners)) >= 3:
            faces.append(tuple(number.setdefault(corner, len(number)) for corner in corners))
    return Solid(np.array(list(number)), faces)


def placed(solid, *, scale=(1, 1, 1), turn=0.0, move=(0, 0, 0)):
    """Scale a solid, turn it by degrees about the y axis, and move it."""
    x, y, z = (solid.points * scale).T
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    return welded(Solid(np.stack([c * x + s * z, y, c * z - s * x], axis=1) + move, solid.faces))


def turn_angles(n):
    """Return n equally spaced angles of a full turn, in radians."""
    return np.arange(n) * (2 * np.pi / n)


def circle(radius, height, sides):
    """Return points on a circle about the y axis, from +x towards +z: clockwise seen from above."""
    angle = turn_angles(sides)
    return np.stack([radius * np.cos(angle), np.full(sides, float(height)), radius * np.sin(angle)], axis=1)


def lathe(profile, sides):
    """Turn a profile, (radius, height) from the top down, about the y axis; ends off the axis stay open."""
    rows = [circle(radius, height, sides) for radius, height in profile]
    return welded(Solid(np.concatenate(rows), grid_faces(len(profile), sides, wrap_columns=True)))


def disc(radius, height, sides, *, facing_up):
    """Make one polygon with many corners, facing up or down."""
    order = range(sides - 1, -1, -1) if facing_up else range(sides)
    return Solid(circle(radius, height, sides), [tuple(order)])


# ---------- models


def bernstein(n_step):
    """Weigh the four control points of a cubic at n_step + 1 equally spaced places: (n_step + 1, 4)."""
    t = np.arange(n_step + 1) / n_step
    s = 1 - t
    return np.stack([s * s * s, 3 * s * s * t, 3 * s * t * t, t * t * t], axis=1)


def bezier_grid(control, n_step):
    """Evaluate a bicubic Bezier patch (4, 4, 3) on a grid: (n_step + 1, n_step + 1, 3)."""
    weights = bernstein(n_step)
    grid = np.zeros((n_step + 1, n_step + 1, 3))
    for i in range(4):
        for j in range(4):
            grid += (weights[:, None, i] * weights[None, :, j])[:, :, None] * control[i, j]
    return grid


def mirrored(grid, axis):
    """Reflect a grid of points in one axis; its columns are reversed so that the outside stays outside."""
    sign = np.ones(3)
    sign[axis] = -1
    return grid[:, ::-1] * sign


def teapot_grids(n_step):
    """Yield the 32 patches of the teapot as grids of points, z up."""
    for rows in (TEAPOT_BODY, TEAPOT_LID):
        control = np.array([[(r, 0, z), (r, -k, z), (k, -r, z), (0, -r, z)] for r, k, z in rows])
        for first in range(0, len(rows) - 1, 3):
            quarter = bezier_grid(control[first : first + 4], n_step)
            half = mirrored(quarter, axis=0)
            yield from (quarter, half, mirrored(half, axis=1), mirrored(quarter, axis=1))
    for rows in (TEAPOT_HANDLE, TEAPOT_SPOUT):
        control = [[(xa, 0, za), (xa, -w, za), (xb, -w, zb), (xb, 0, zb)] for xa, za, xb, zb, w in rows]
        for first in range(0, len(rows) - 1, 3):
            half = bezier_grid(np.array(control[first : first + 4]), n_step)
            yield from (half, mirrored(half, axis=1))


def teapot(n_step=12):
    """Tessellate the teapot, y up, spout towards +x, standing on y = 0."""
    faces = grid_faces(n_step + 1, n_step + 1)
    solid = joined([Solid(grid.reshape(-1, 3), faces) for grid in teapot_grids(n_step)])
    x, y, z = solid.points.T
    return welded(Solid(np.stack([x, z, -y], axis=1), solid.faces))


def icosahedron():
    """Return the 20 triangles of an icosahedron with edge 2: (20, 3 corners, 3)."""
    golden = (1 + np.sqrt(5.0)) / 2
    corners = [np.roll((0, a, b * golden), k) for k in range(3) for a in (-1, 1) for b in (-1, 1)]
    a, b, c = np.array(list(combinations(corners, 3))).transpose(1, 0, 2)
    longest = np.max([((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    a, b, c = a[longest < 4.1], b[longest < 4.1], c[longest < 4.1]  # every other distance is over 3
    is_outward = (np.cross(b - a, c - a) * a).sum(axis=1) > 0
    return np.where(is_outward[:, None, None], np.stack([a, b, c], axis=1), np.stack([a, c, b], axis=1))


def sphere(levels=4):
    """Divide each triangle of an icosahedron into four, `levels` times, on the unit sphere."""
    triangles = on_unit_sphere(icosahedron())
    for _ in range(levels):
        a, b, c = triangles.transpose(1, 0, 2)
        ab, bc, ca = a + b, b + c, c + a
        quarters = np.stack([(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)])  # 4, 3 corners, n, 3
        triangles = on_unit_sphere(quarters.transpose(2, 0, 1, 3).reshape(-1, 3, 3))
    points = triangles.reshape(-1, 3)
    return welded(Solid(points, [(i, i + 1, i + 2) for i in range(0, len(points), 3)]))


def torus(ring=64, tube=32, ring_radius=1.0, tube_radius=0.4):
    """Make a torus about the y axis, centred at the origin."""
    angle, around = np.meshgrid(turn_angles(ring), turn_angles(tube), indexing="ij")
    radius = ring_radius + tube_radius * np.cos(around)
    points = np.stack([radius * np.cos(angle), tube_radius * np.sin(around), radius * np.sin(angle)], axis=-1)
    return welded(Solid(points.reshape(-1, 3), grid_faces(ring, tube, wrap_rows=True, wrap_columns=True)))


def cube():
    """Make the cube from -1 to 1 of six quads."""
    points = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return welded(Solid(points, faces))


def cylinder(sides=64):
    """Make a cylinder of radius 1 from y = 0 to 2; each cap is one polygon."""
    caps = [disc(1, 2, sides, facing_up=True), disc(1, 0, sides, facing_up=False)]
    return welded(joined([lathe([(1, 2), (1, 0)], sides), *caps]))


def cone(sides=64):
    """Make a cone of radius 1 from y = 0 to 2; its apex is one point, its base one polygon."""
    return welded(joined([lathe([(0, 2), (1, 0)], sides), disc(1, 0, sides, facing_up=False)]))


def sawtooth(n_slope=16, n_strip=8, step=0.5, rise=0.375):
    """Fold a sheet into ridges along z whose averaged vertex normals hide the folds.

    The slopes have normals (-0.6, 0.8, 0) and (0.6, 0.8, 0), so the plain average is (0, 1, 0) everywhere but
    on the two outer edges along the ridges. The quads of every second slope start at another corner, which
    mirrors the diagonals of a fan triangulation: a point meets as many triangles on its left as on its right.
    """
    i, j = np.meshgrid(np.arange(n_slope + 1), np.arange(n_strip + 1), indexing="ij")
    points = np.stack([step * (i - n_slope / 2), rise * (i % 2), step * (j - n_strip / 2)], axis=-1)
    quads = grid_faces(n_slope + 1, n_strip + 1)
    faces = [quad if (k // n_strip) % 2 == 0 else quad[1:] + quad[:1] for k, quad in enumerate(quads)]
    return Solid(points.reshape(-1, 3), faces)


def floor(size=100.0):
    """Make one large square at y = 0 that faces up: two triangles, larger than most views of it."""
    h = size / 2
    return Solid(np.array([(-h, 0, h), (h, 0, h), (h, 0, -h), (-h, 0, -h)]), [(0, 1, 2, 3)])


def gear_outline(n_tooth, root, tip):
    """Return angle (radians) and radius of the outline: per tooth a root arc, a flank, a tip arc, a flank."""
    share = np.array([0.0, 0.12, 0.24, 0.36, 0.48, 0.58, 0.68, 0.78, 0.88])  # of one tooth's angle
    radius = np.array([root, root, root, root, root, tip, tip, tip, tip])
    angle = (np.arange(n_tooth)[:, None] + share[None, :]) * (2 * np.pi / n_tooth)
    return angle.ravel(), np.tile(radius, n_tooth)


def gear(n_tooth=16, bore=0.3, hub=0.52, root=0.82, tip=1.0, hub_half=0.34, web_half=0.18):
    """Make a gear about the z axis, centred at the origin: flat sides, curved walls, sharp edges.

    Every cross-section has the same eight corners, so all faces are convex quads:

        z   0---1           0 bore, 1 2 hub, 3 outline of the teeth,
        ^   |   2------3    and back in the same way on the other side
        |   |          |
        +-> radius
    """
    angle, outline = gear_outline(n_tooth, root, tip)
    bores, hubs = np.full_like(outline, bore), np.full_like(outline, hub)
    corners = [(bores, hub_half), (hubs, hub_half), (hubs, web_half), (outline, web_half)]
    corners += [(radius, -z) for radius, z in reversed(corners)]
    rings = [np.stack([r * np.cos(angle), r * np.sin(angle), np.full_like(r, z)], axis=1) for r, z in corners]
    points = np.stack(rings, axis=1)
    faces = grid_faces(len(angle), len(corners), wrap_rows=True, wrap_columns=True)
    return welded(Solid(points.reshape(-1, 3), faces))


def knot(along=192, around=20, thickness=0.42):
    """Wind a tube as a trefoil knot on a torus about the z axis: twice about the axis, thrice about the ring.

    The normal of that torus stands at right angles to the curve everywhere and closes on itself, so it
    carries the tube.
    """
    t = turn_angles(along)
    c2, s2, c3, s3 = np.cos(2 * t), np.sin(2 * t), np.cos(3 * t), np.sin(3 * t)
    ring = 2 + c3
    centre = np.stack([ring * c2, ring * s2, s3], axis=1)
    forward = np.stack([-3 * s3 * c2 - 2 * ring * s2, -3 * s3 * s2 + 2 * ring * c2, 3 * c3], axis=1)
    normal = np.stack([c3 * c2, c3 * s2, s3], axis=1)
    side = np.cross(on_unit_sphere(forward), normal)
    angle = turn_angles(around)[None, :, None]
    points = centre[:, None] + thickness * (np.cos(angle) * normal[:, None] + np.sin(angle) * side[:, None])
    return Solid(points.reshape(-1, 3), grid_faces(along, around, wrap_rows=True, wrap_columns=True))


def knot_colors(along=192, around=20):
    """Let the hue run once along the knot: (along * around, 3) uint8, sRGB."""
    phase = turn_angles(along)[:, None] + np.array([0.0, -2 * np.pi / 3, 2 * np.pi / 3])
    return np.repeat(np.round(150 + 96 * np.cos(phase)).astype(np.uint8), around, axis=0)


# ---------- still life

# name: Ka, Kd, Ks, Ns, Ke, d
MATERIALS = {
    "wood": ((0.32, 0.17, 0.08), (0.42, 0.23, 0.11), (0.06, 0.06, 0.06), 12, (0, 0, 0), 1.0),
    "clay": ((0.55, 0.1, 0.06), (0.68, 0.13, 0.08), (0.12, 0.12, 0.12), 20, (0, 0, 0), 1.0),
    "brass": ((0.45, 0.28, 0.05), (0.6, 0.38, 0.08), (0.7, 0.55, 0.25), 80, (0, 0, 0), 1.0),
    "glaze": ((0.02, 0.22, 0.28), (0.03, 0.3, 0.38), (0.5, 0.5, 0.5), 150, (0, 0, 0), 1.0),
    "glass": ((0.25, 0.4, 0.3), (0.3, 0.5, 0.38), (0.8, 0.8, 0.8), 300, (0, 0, 0), 0.4),
    "iron": ((0.03, 0.03, 0.035), (0.05, 0.05, 0.06), (0.3, 0.3, 0.3), 40, (0, 0, 0), 1.0),
    "lamp": ((0, 0, 0), (0.2, 0.17, 0.1), (0, 0, 0), 1, (1.0, 0.82, 0.45), 1.0),
}


def still_life():
    """Set solids on a board: a list of (name, material, solid)."""
    foot = placed(cylinder(32), scale=(0.42, 0.05, 0.42))
    pole = placed(cylinder(24), scale=(0.06, 0.8, 0.06), move=(0, 0.1, 0))
    return [
        ("board", "wood", placed(cube(), scale=(2.7, 0.15, 1.8), move=(0, -0.15, 0))),
        ("ball", "clay", placed(sphere(3), scale=(0.8, 0.8, 0.8), move=(-1.5, 0.8, 0.1))),
        ("spire", "brass", placed(cone(48), scale=(0.62, 0.9, 0.62), move=(-0.15, 0, -0.85))),
        ("ring", "glaze", placed(torus(48, 24), scale=(0.55, 0.55, 0.55), move=(0.05, 0.22, 0.85))),
        ("block", "glass", placed(cube(), scale=(0.5, 0.5, 0.5), turn=25, move=(1.55, 0.5, 0.5))),
        ("stand", "iron", placed(joined([foot, pole]), move=(1.7, 0, -1.0))),
        ("bulb", "lamp", placed(sphere(3), scale=(0.38, 0.38, 0.38), move=(1.7, 2.05, -1.0))),
    ]


def table():
    """Set a box, a sphere and a cone on a floor of 4 x 4: parts that cast shadows, sharp edges and round ones."""
    return [
        ("floor", "wood", floor(4)),
        ("box", "glaze", placed(cube(), scale=(0.45, 0.45, 0.45), turn=30, move=(-0.85, 0.45, -0.55))),
        ("sphere", "clay", placed(sphere(3), scale=(0.55, 0.55, 0.55), move=(0.35, 0.55, 0.55))),
        ("cone", "brass", placed(cone(48), scale=(0.45, 0.65, 0.45), move=(0.95, 0, -0.75))),
    ]


# name: Ka, Kd, Ks, Ns, Ke, d
GLASS = {
    "ground": ((0.5, 0.48, 0.44), (0.6, 0.58, 0.53), (0, 0, 0), 1, (0, 0, 0), 1.0),
    "pearl": ((0.6, 0.6, 0.6), (0.75, 0.75, 0.75), (0.4, 0.4, 0.4), 80, (0, 0, 0), 1.0),
    "red": ((0.7, 0.06, 0.05), (0.85, 0.08, 0.06), (0.5, 0.5, 0.5), 120, (0, 0, 0), 0.4),
    "green": ((0.08, 0.5, 0.1), (0.1, 0.65, 0.14), (0.5, 0.5, 0.5), 120, (0, 0, 0), 0.4),
    "blue": ((0.06, 0.14, 0.7), (0.08, 0.18, 0.85), (0.5, 0.5, 0.5), 120, (0, 0, 0), 0.4),
}


def pane(width=1.3, height=1.3):
    """Make one upright rectangle that stands on y = 0 and faces +z."""
    h = width / 2
    return Solid(np.array([(-h, 0.0, 0), (h, 0, 0), (h, height, 0), (-h, height, 0)]), [(0, 1, 2, 3)])


def glass():
    """Set three coloured panes, one before the other and before a ball as seen from azimuth 35, on a floor."""
    return [
        ("floor", "ground", floor(4)),
        ("ball", "pearl", placed(sphere(3), scale=(0.6, 0.6, 0.6), move=(-0.5, 0.6, -0.7))),
        ("left", "red", placed(pane(), turn=25, move=(-0.4, 0, 0.2))),
        ("middle", "green", placed(pane(height=1.0), turn=35, move=(0.2, 0, 0.35))),
        ("right", "blue", placed(pane(), turn=45, move=(0.8, 0, 0.5))),
    ]


SHIPPED = ("still_life.obj", "still_life.mtl")  # inside the package, too: `demo_model` of `rasterizer/io/loader.py`


def model_files():
    """Return every model file as a dict of name and bytes."""
    makers = (teapot, sphere, torus, cube, cylinder, cone, sawtooth, gear, floor)
    files = {f"{maker.__name__}.obj": obj_bytes(maker.__name__, maker()) for maker in makers}
    files["still_life.obj"] = obj_parts_bytes(still_life(), "still_life.mtl")
    files["still_life.mtl"] = mtl_bytes(MATERIALS)
    files["table.obj"] = obj_parts_bytes(table(), "still_life.mtl")
    files["glass.obj"] = obj_parts_bytes(glass(), "glass.mtl")
    files["glass.mtl"] = mtl_bytes(GLASS)
    files |= globe_files()
    files["knot.ply"] = ply_bytes(knot(), knot_colors())
    files["gear.stl"] = stl_bytes("gear", gear())
    files["torus.glb"] = glb_bytes("torus", torus(), (0.8, 0.22, 0.06))
    return files


def main():
    """Write the files into the folder given, or next to this script."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    files = model_files()
    for name, data in files.items():
        (folder / name).write_bytes(data)
    if folder == Path(__file__).parent:
        for name in SHIPPED:
            (folder.parent / "rasterizer" / "demo" / name).write_bytes(files[name])


if __name__ == "__main__":
    main()
