"""Follow one triangle through every stage of the pipeline, and print its numbers.

    python models/follow_triangle.py

The script calls the stages one by one, as `Renderer` and `engine/draw.py` do, and ends with the bytes of `rz.render`.
rasterizer/README.md explains what it prints.
"""

import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # a checkout need not be installed
import rasterizer as rz
from rasterizer.cores import Workers
from rasterizer.engine.depth_range import scale_depths, screen_of
from rasterizer.engine.draw import NO_SOURCES, choose_band_rows, cull
from rasterizer.engine.lit_points import light_seen
from rasterizer.engine.passes import NONE, ColorPass, Drawn
from rasterizer.engine.plan import make_plan
from rasterizer.engine.points import gather_geometry
from rasterizer.engine.scene_tables import SceneTables
from rasterizer.engine.uniforms import light_view, make_coding, make_encoding, make_lighting
from rasterizer.options import Options
from rasterizer.pipeline import setup as s
from rasterizer.pipeline.cull import Band, first_sample
from rasterizer.pipeline.resolve import srgb_thresholds
from rasterizer.pipeline.scan import ScanCounts, Triangle, advance, scan, start_edge
from rasterizer.pipeline.transform import DEPTH_BITS, SUBPIXEL, Drawables, Triangles, transform
from rasterizer.pipeline.visibility import CLEAR, INTENSITY_MASK, PAYLOAD_BITS
from rasterizer.pipeline.workspace import WorkspaceShape, make_picture, make_workspace

OPTIONS = Options(size=(24, 16), shading="gouraud", samples=1, threads=1)
WIDTH, HEIGHT = OPTIONS.size
COLUMN, ROW = 14, 9  # of the sample that is followed
NAMES = "ABC"
VERTICES = [(-2.5, -1.5, 0.0), (2.6, -0.9, 0.09), (0.2, 1.8, 0.02)]
NORMALS = [(0.0, 0.0, 1.0), (0.6, 0.0, 0.8), (0.0, 0.8, 0.6)]
SERIAL = Workers(1)


def make_scene() -> rz.Scene:
    """Return the triangle, a light that shines along the viewing axis, and a camera six units away."""
    triangle = rz.Mesh(VERTICES, [[0, 1, 2]], normals=NORMALS, material=rz.Material(diffuse=0.8, specular=0.0))
    lights = [rz.AmbientLight(0.1), rz.DirectionalLight((0, 0, -1), 0.9)]
    return rz.Scene(triangle, lights, rz.Camera.perspective((0, 0, 6), (0, 0, 0), fov=40))


class Followed(NamedTuple):
    """What the stages hand on."""

    render_pass: ColorPass  # with the intensities of the vertices
    vertices: object  # on the screen
    n_outside: int  # vertices that the clip stage has to see
    n_band_row: int
    band: Band
    block: object  # the triangle's planes
    packed: np.ndarray  # (HEIGHT, WIDTH) int64, the visibility buffer
    radiance: np.ndarray  # (HEIGHT, WIDTH), linear intensities
    rgba: np.ndarray  # (HEIGHT, WIDTH, 4) uint8


def go(scene) -> Followed:
    """Send the triangle through the stages."""
    geometry, view = gather_geometry(scene.meshes, OPTIONS.is_flat), scene.camera.view()
    bounds = np.stack([mesh.bounds for mesh in scene.meshes])
    screen, _ = screen_of(scene.camera, view, OPTIONS.size, geometry, bounds)
    render_pass = make_pass(scene, geometry, view, screen)

    vertices, n_outside = transform(geometry.positions, screen, SERIAL)
    triangles = Triangles(geometry.vertex, geometry.corner, geometry.is_inverted, geometry.face_material)
    lists, n_band_row = cull(triangles, vertices, render_pass, SERIAL)
    render_pass = replace(render_pass, attributes=render_pass.light(lists.faces), light=None)
    drawn = Drawn(Drawables(triangles, vertices, render_pass.attributes), NO_SOURCES)
    band = Band(lists.faces, 0, HEIGHT)
    shape = WorkspaceShape(WIDTH, n_band_row, 1, 1, render_pass.dtype, is_textured=False, is_transparent=False)
    workspace = make_workspace(shape, len(band.faces) * render_pass.units_per_setup)
    visibility, setups = workspace.visibility, workspace.setups
    counts = ScanCounts(*scan(band, drawn.drawables, render_pass.coding, workspace.block, visibility, setups, None))
    packed = visibility.packed.reshape(HEIGHT, -1)[:, :WIDTH].copy()
    render_pass.shade(workspace, band, counts)
    radiance = workspace.radiance.reshape(HEIGHT, -1)[:, :WIDTH].copy()
    render_pass.finish(workspace, band, counts, None, drawn)
    rgba = render_pass.picture.rgba.view(np.uint8).reshape(HEIGHT, WIDTH, 4)
    return Followed(render_pass, vertices, n_outside, n_band_row, band, workspace.block, packed, radiance, rgba)


def make_pass(scene, geometry, view, screen) -> ColorPass:
    """Plan the picture: what is done before the first stage."""
    plan = make_plan(SceneTables(scene, OPTIONS), OPTIONS)
    lightings = {dtype: light_view(make_lighting(plan, dtype), plan, view) for dtype in plan.of_materials.dtypes}
    return ColorPass(
        attributes=NONE,
        light=partial(light_seen, geometry, plan, lightings, screen, 2, np.empty(0), SERIAL),
        lightings=lightings,
        coding=make_coding(plan)._replace(depths=scale_depths(screen)),
        n_sample=OPTIONS.size,
        plan=plan,
        screen=screen,
        encoding=make_encoding(plan),
        picture=make_picture(OPTIONS.size, with_color=False),
    )


# ---------------------------------------------------------------- what is printed, stage by stage


def describe_light(followed: Followed) -> list[str]:
    """What the illumination equation gives at the vertices."""
    lines = ["vertex      x       y       z       normal         N·L   intensity"]
    intensities = followed.render_pass.attributes[0, :, 0].tolist()
    for name, (x, y, z), normal, intensity in zip(NAMES, VERTICES, NORMALS, intensities, strict=True):
        direction = " ".join(f"{component:.1f}" for component in normal)
        lines.append(f"  {name}    {x:7.3f} {y:7.3f} {z:7.3f}    {direction}    {normal[2]:.1f}   {intensity:.6f}")
    return [*lines, "intensity = 0.8·(0.1 + 0.9·N·L): the material's 0.8, ambient light 0.1, directional light 0.9"]


def describe_transform(followed: Followed) -> list[str]:
    """Where the vertices lie on the screen."""
    lines = ["vertex   x px     y px     x/256   y/256   depth w    1/w        z"]
    for k, name in enumerate(NAMES):
        x, y, z = int(followed.vertices.x[k]), int(followed.vertices.y[k]), followed.vertices.z[k]
        w = 6.0 - VERTICES[k][2]
        lines.append(
            f"  {name}   {x / SUBPIXEL:8.4f} {y / SUBPIXEL:8.4f}   {x:6d}  {y:6d}   {w:.3f}   {1 / w:.6f}   {z:15.1f}"
        )
    screen = followed.render_pass.screen
    return [
        *lines,
        f"z = a + b/w with a = {screen.z_offset:.8g}, b = {screen.z_scale:.8g}: 0 to 2^{DEPTH_BITS} = {2**DEPTH_BITS}",
    ]


def describe_clip(followed: Followed) -> list[str]:
    """How many vertices lie outside."""
    return [f"vertices outside: {followed.n_outside}; the triangle goes on as it is"]


def describe_cull(followed: Followed) -> list[str]:
    """The triangle's area and its box."""
    (x0, x1, x2), (y0, y1, y2) = followed.vertices.x.tolist(), followed.vertices.y.tolist()
    area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
    left, right, top, bottom = of_block(followed.block.ints, s.LEFT, 4)
    return [
        f"twice the signed area: {area} (1/256 px)²; negative: counter-clockwise, a front face",
        f"box: columns {left} to {right - 1}, rows {top} to {bottom - 1}; it holds samples, so the triangle is visible",
    ]


def describe_bands(followed: Followed) -> list[str]:
    """The band that the triangle falls into."""
    n_row = choose_band_rows(1920, 1080, 1, 1)
    return [
        f"a band has {followed.n_band_row} rows here, {n_row} at 1920×1080 with one thread",
        f"band 0 lists the triangles {followed.band.faces.tolist()}",
    ]


def describe_setup(followed: Followed) -> list[str]:
    """The planes over the triangle."""
    ordered = ", ".join(f"v{k} = {name_at(followed, k)}" for k in range(3))
    anchor = tuple(of_block(followed.block.ints, s.ANCHOR_X, 2))
    z, m, f = planes_of(followed)
    (middle,) = reals_of(followed, s.MIDDLE, 1)
    scale = followed.render_pass.coding.intensity_scale
    return [
        f"{ordered}: the topmost first, then clockwise",
        f"anchor: sample {anchor}, the first of the box",
        "plane        at the anchor            d/dx            d/dy",
        f"z        {z[0]:17d} {z[1]:15d} {z[2]:15d}",
        f"f        {f[0]:17.9f} {f[1]:15.9f} {f[2]:15.9f}",
        f"M        {m[0]:17.3f} {m[1]:15.3f} {m[2]:15.3f}",
        f"intensity = {middle:.1f} + M/f steps; a step is 1/{scale:.2f} of an intensity of 1",
    ]


def describe_choice(followed: Followed) -> list[str]:
    """Why spans are cut: the bounds of affine interpolation over the triangle, and over a piece."""
    intensities, scale = followed.render_pass.attributes[0, :, 0], followed.render_pass.coding.intensity_scale
    w = 6.0 - np.array(VERTICES)[:, 2]
    ratio, spread = w.max() / w.min(), float(np.ptp(intensities))
    (piece,), (_, m, f) = of_block(followed.block.ints, s.PIECE, 1), planes_of(followed)
    least, bend = w.min() / w.max(), abs(f[1])
    slope = (abs(m[1]) / scale + spread / 2 * bend) / least
    bound, tolerance = min(spread, piece * slope) * piece * bend / (4 * least), OPTIONS.tolerance
    assert bound < tolerance < spread * (ratio - 1) / 4
    return [
        f"|ΔI| = {spread:.6f}, r = w_max/w_min = {ratio:.6f}",
        f"|ΔI|·(r - 1)/4 = {spread * (ratio - 1) / 4:.3e}; the tolerance is {tolerance:.3e}: too much",
        f"over {piece} samples: |ΔI| <= {piece * slope:.6f}, r - 1 <= {piece * bend / least:.6f}: at most {bound:.3e}",
    ]


def describe_scan(followed: Followed) -> list[str]:
    """The two edges of every row, and the samples between them."""
    lines = ["row   left edge             right edge            span        samples"]
    for y, left, right in walk_edges(followed):
        edges = "   ".join(f"{edge.x:2d} {edge.rest:7d}/{edge.divisor:<7d}" for edge in (left, right))
        row = "".join("#" if packed < CLEAR else "." for packed in followed.packed[y].tolist())
        lines.append(f"{y:3d}   {edges}   {left.x:2d} to {right.x - 1:2d}    {row}")
        covered = np.flatnonzero(followed.packed[y] < CLEAR).tolist()
        assert covered == list(range(left.x, right.x)), "the edges and the buffer disagree"
    lines.append(f"covered: {int((followed.packed < CLEAR).sum())} samples")
    for name, edge in zip(("v0-v2", "v0-v1", "v1-v2"), edges_of(followed), strict=True):
        lines.append(f"each row adds to the edge {name}: {edge.dx:+d} to the sample, {edge.d_rest} to the rest")
    return lines


def describe_packed(followed: Followed) -> list[str]:
    """The packed sample that is followed."""
    anchor_x, anchor_y = of_block(followed.block.ints, s.ANCHOR_X, 2)
    z, m, f = planes_of(followed)
    (piece,), (middle,) = of_block(followed.block.ints, s.PIECE, 1), reals_of(followed, s.MIDDLE, 1)
    first = COLUMN // piece * piece  # where the piece of the sample begins, and the next one
    (_, left, right) = next(row for row in walk_edges(followed) if row[0] == ROW)
    assert left.x < first and first + piece < right.x, "the piece is one between two cuts"
    rows, ends = ROW - anchor_y, []
    for x in (first, first + piece):
        here = [plane[0] + (x - anchor_x) * plane[1] + rows * plane[2] for plane in (m, f)]
        ends.append(round(middle + here[0] / here[1]))
    columns, intensity_step = COLUMN - first, round((ends[1] - ends[0]) / piece)
    z_here, intensity = z[0] + (COLUMN - anchor_x) * z[1] + rows * z[2], ends[0] + columns * intensity_step
    packed, step = (z_here << PAYLOAD_BITS) + intensity, (z[1] << PAYLOAD_BITS) + intensity_step
    assert packed == followed.packed[ROW, COLUMN] and packed + step == followed.packed[ROW, COLUMN + 1]
    bits = f"{packed:064b}"
    return [
        f"sample ({COLUMN}, {ROW}), in the piece of the columns {first} to {first + piece - 1}",
        f"intensity at {first}: {ends[0]}, at {first + piece}: {ends[1]}, so {intensity_step} a sample",
        f"z     = {z[0]} {z[1]:+d}·{COLUMN - anchor_x} {z[2]:+d}·{rows} = {z_here}",
        f"intensity = {ends[0]} {intensity_step:+d}·{columns} = {intensity}",
        f"packed = z·2^{PAYLOAD_BITS} + intensity = {packed}",
        f"bits  = {bits[0]} | {bits[1 : 1 + DEPTH_BITS]} | {bits[1 + DEPTH_BITS]} | {bits[2 + DEPTH_BITS :]}",
        "        sign, z, is_id, intensity",
        f"the next sample: {step:+d} = {packed + step}",
    ]


def describe_shade(followed: Followed) -> list[str]:
    """The intensity of the sample, and what it is off the true one."""
    scale = followed.render_pass.coding.intensity_scale
    here, beside = (int(followed.packed[ROW, COLUMN + k] & INTENSITY_MASK) for k in range(2))
    intensities = followed.render_pass.attributes[0, :, 0]
    weights = weights_at(followed)
    q = weights / (6.0 - np.array(VERTICES)[:, 2])
    exact = float(q @ intensities / q.sum())
    return [
        f"intensity {here} / {scale:.2f} = {followed.radiance[ROW, COLUMN]:.6f}",
        f"one sample to the right: ΔI·Δv = {(beside - here) / scale:+.6f}, so {followed.radiance[ROW, COLUMN + 1]:.6f}",
        "weights of A, B, C on the screen: " + " ".join(f"{weight:.6f}" for weight in weights),
        f"their mean of the intensities: {float(weights @ intensities):.6f}; with perspective: {exact:.6f}",
        f"error of the packed intensity: {abs(here / scale - exact):.1e}",
    ]


def describe_resolve(followed: Followed) -> list[str]:
    """The bytes of the pixel."""
    level = int(followed.rgba[ROW, COLUMN, 0])
    thresholds = srgb_thresholds()
    linear = float(followed.radiance[ROW, COLUMN])
    encoded = 1.055 * linear ** (1 / 2.4) - 0.055
    same = bool(
        (np.asarray(rz.render(make_scene(), OPTIONS.size, shading=OPTIONS.shading, samples=1)) == followed.rgba).all()
    )
    return [
        f"sRGB: 1.055·{linear:.6f}^(1/2.4) - 0.055 = {encoded:.6f}, times 255 = {255 * encoded:.3f}",
        f"level {level} holds the intensities from {thresholds[level - 1]:.6f} to {thresholds[level]:.6f}",
        f"bytes of the pixel: {followed.rgba[ROW, COLUMN].tolist()}; rz.render draws the same picture: {same}",
    ]


def describe_explanation(_way: Followed) -> list[str]:
    """What the reference says of the same pixel, without what stands above."""
    explanation = rz.explain(make_scene(), COLUMN, ROW, size=OPTIONS.size, shading=OPTIONS.shading, samples=1)
    known = {
        "reflection",
        "depth",
        "weights",
        "position",
        "normal",
        "opacity",
        "visible",
        "texel",
        "emission",
        "background",
    }
    return [line for line in str(explanation).splitlines() if line.split()[0] not in known]


# ---------------------------------------------------------------- reading the block


def of_block(rows, first, n) -> list[int]:
    """The first triangle's numbers in n neighbouring rows of a block."""
    return [int(rows[int(first) + k * s.BLOCK]) for k in range(n)]


def reals_of(followed: Followed, first, n) -> list[float]:
    """The same of rows of real numbers."""
    return [float(followed.block.reals[int(first) + k * s.BLOCK]) for k in range(n)]


def planes_of(followed: Followed) -> tuple[list[int], list[float], list[float]]:
    """The planes of z, M and f: at the anchor, d/dx, d/dy."""
    z, rows = of_block(followed.block.longs, s.PLANE_Z, 3), (s.PLANE_OVER_W, s.PLANE_INV_W)
    m, f = (reals_of(followed, first, 3) for first in rows)
    return z, m, f


def name_at(followed: Followed, k) -> str:
    """The name of the k-th of the ordered vertices."""
    (x, y) = of_block(followed.block.ints, s.X0, 6)[2 * k : 2 * k + 2]
    return NAMES[list(zip(followed.vertices.x.tolist(), followed.vertices.y.tolist(), strict=True)).index((x, y))]


def weights_at(followed: Followed) -> np.ndarray:
    """The weights of A, B, C at the sample, from exact edge functions; their sum is 1."""
    x, y = followed.vertices.x.tolist(), followed.vertices.y.tolist()
    sx, sy = COLUMN * SUBPIXEL + SUBPIXEL // 2, ROW * SUBPIXEL + SUBPIXEL // 2
    edges = [
        (x[j] - x[i]) * (sy - y[i]) - (y[j] - y[i]) * (sx - x[i]) for i, j in ((1, 2), (2, 0), (0, 1))
    ]  # opposite of A, B, C
    return np.array(edges) / sum(edges)


def edges_of(followed: Followed) -> tuple:
    """The left edge v0-v2 and the right edges v0-v1 and v1-v2, each on its first row of samples.

    The middle vertex is v1: it lies on the right.
    """
    corners = Triangle(*of_block(followed.block.ints, s.X0, 6))
    top, middle = first_sample(corners.y0), first_sample(corners.y1)
    start = start_edge
    return (
        start(corners.x0, corners.y0, corners.x2, corners.y2, top),
        start(corners.x0, corners.y0, corners.x1, corners.y1, top),
        start(corners.x1, corners.y1, corners.x2, corners.y2, middle),
    )


def walk_edges(followed: Followed):
    """Each row that has samples, with its left and its right edge, as the scan stage walks them."""
    left, right, lower = edges_of(followed)
    top, bottom = of_block(followed.block.ints, s.TOP, 2)
    middle = first_sample(of_block(followed.block.ints, s.Y1, 1)[0])
    for y in range(top, bottom):
        right = lower if y == middle else right
        if left.x < right.x:
            yield y, left, right
        left, right = advance(left), advance(right)


STAGES = {
    "light": describe_light,
    "transform": describe_transform,
    "clip": describe_clip,
    "cull": describe_cull,
    "bands": describe_bands,
    "setup": describe_setup,
    "choice": describe_choice,
    "scan": describe_scan,
    "packed": describe_packed,
    "shade": describe_shade,
    "resolve": describe_resolve,
    "explanation": describe_explanation,
}


def follow() -> dict[str, str]:
    """Return what is printed of each stage, in order."""
    followed = go(make_scene())
    return {stage: "\n".join(describe(followed)) for stage, describe in STAGES.items()}


def main() -> int:
    """Print every stage."""
    for stage, text in follow().items():
        print(f"{stage}\n{text}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
