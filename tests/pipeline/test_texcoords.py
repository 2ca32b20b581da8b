"""Check textures in whole pictures: every sample against texels looked up by hand, along rays that are computed
here."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.pairs import pairs
from helpers.pinhole import ALBEDO, SHADINGS, WHITE, at_pixel, eye_camera, octasphere, sheet_camera

import rasterizer as rz

SIZE = (40, 30)
LIT = (
    rz.AmbientLight((0.2, 0.3, 0.1)),
    rz.DirectionalLight((0.3, -0.2, -1), (0.6, 0.5, 0.7)),
    rz.PointLight((1, 2, 0), 0.4),
)
TEXELS = np.random.default_rng(1).uniform(0, 1, (5, 7, 3))
WRAPS = ("repeat", "clamp", "mirror", ("repeat", "mirror"))


def tilted_quad(is_perspective=True):
    """A parallelogram whose first three corners are whole pixels, with texture coordinates from below 0 to above 1."""
    a, b, c = (np.array(at_pixel(SIZE, *p, is_perspective)) for p in ((2, 3, 2.0), (6, 28, 6.0), (39, 26, 4.0)))
    uv = np.array([(-0.7, 1.6), (-0.4, -1.3), (2.2, -0.5)])
    return np.array([a, b, c, a - b + c]), np.vstack([uv, uv[0] - uv[1] + uv[2]])


def coordinates(vertices, uv, x, y, is_perspective=True):
    """Texture coordinates (..., 2) of the plane through three vertices, at places of the picture, in pixels."""
    half = SIZE[1] / 2
    across, up = x - SIZE[0] / 2, half - y
    zero = np.zeros_like(across)
    origin = np.stack([zero, zero, zero] if is_perspective else [across, up, zero], axis=-1)
    ray = np.stack([across / half, up / half, zero - 1] if is_perspective else [zero, zero, zero - 1], axis=-1)
    e1, e2 = vertices[1] - vertices[0], vertices[2] - vertices[0]
    normal = np.cross(e1, e2)
    hit = origin + (((vertices[0] - origin) @ normal) / (ray @ normal))[..., None] * ray - vertices[0]
    weights = hit @ np.linalg.pinv(np.stack([e1, e2], axis=1)).T
    return uv[0] + weights @ np.stack([uv[1] - uv[0], uv[2] - uv[0]])


def grid(factor=1):
    """Centres of the samples, in pixels."""
    return np.meshgrid((np.arange(SIZE[0] * factor) + 0.5) / factor, (np.arange(SIZE[1] * factor) + 0.5) / factor)


def wrapped(k, n, how):
    """The texel that stands for the k-th of n."""
    if how == "repeat":
        return np.mod(k, n)
    if how == "clamp":
        return np.clip(k, 0, n - 1)
    return n - 1 - np.abs(np.mod(k, 2 * n) - n + 0.5).astype(int)


def looked_up(texels, uv, kind="nearest", wrap="repeat"):
    """Texels at coordinates, row 0 of the picture at v = 1; `bilinear` weighs the four that are about a place."""
    height, width = texels.shape[:2]
    wraps = (wrap, wrap) if isinstance(wrap, str) else wrap
    x, y = uv[..., 0] * width, (1 - uv[..., 1]) * height
    if kind == "nearest":
        return texels[
            wrapped(np.floor(y).astype(int), height, wraps[1]), wrapped(np.floor(x).astype(int), width, wraps[0])
        ]
    total = 0.0
    left, top = np.floor(x - 0.5).astype(int), np.floor(y - 0.5).astype(int)
    for i in (left, left + 1):
        for j in (top, top + 1):
            weight = (1 - np.abs(x - 0.5 - i)) * (1 - np.abs(y - 0.5 - j))
            total = total + weight[..., None] * texels[wrapped(j, height, wraps[1]), wrapped(i, width, wraps[0])]
    return total


def is_near_border(texels, uv):
    """Whether a place is so near to the border of two texels that rounding decides."""
    x = uv * (texels.shape[1], texels.shape[0])
    return (np.abs(x - x.round()) < 1e-9).any(axis=-1)


def test_the_wraps_of_this_file_are_those_of_the_drawing():
    assert wrapped(np.arange(-4, 8), 3, "repeat").tolist() == [2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1]
    assert wrapped(np.arange(-4, 8), 3, "clamp").tolist() == [0, 0, 0, 0, 0, 1, 2, 2, 2, 2, 2, 2]
    assert wrapped(np.arange(-4, 8), 3, "mirror").tolist() == [2, 2, 1, 0, 0, 1, 2, 2, 1, 0, 0, 1]


def show(meshes, shading="gouraud", lights=WHITE, camera=None, size=SIZE, **options):
    return rz.render(
        rz.Scene(meshes, lights, camera or eye_camera()),
        size,
        shading=shading,
        **({"samples": 1} | {"tolerance": 0} | options),
    )


def textured(texels, kind="nearest", wrap="repeat", is_perspective=True, material=ALBEDO):
    vertices, uv = tilted_quad(is_perspective)
    # Two triangles: the centre of a quad has a place of its own on the screen, which is rounded.
    return rz.Mesh(
        vertices, [[0, 1, 2], [0, 2, 3]], uv=uv, material=replace(material, texture=rz.Texture(texels, kind, wrap))
    )


# ── filters ─────────────────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize("kind", ["nearest", "bilinear"])
def test_every_pixel_shows_the_texel_of_its_ray(kind):
    shapes = (5, 7), (1, 1), (1, 6), (6, 1)
    for wrap, shading, is_perspective, shape in pairs(
        wrap=WRAPS, shading=SHADINGS, is_perspective=(True, False), shape=shapes
    ):
        texels = TEXELS[: shape[0], : shape[1]]
        camera, case = None if is_perspective else sheet_camera(SIZE[1]), f"{wrap} {shading} {is_perspective=} {shape}"
        mesh = textured(texels, kind, wrap, is_perspective)
        frame = show([mesh], shading, camera=camera, outputs=("color", "face"))
        uv = coordinates(*tilted_quad(is_perspective), *grid(), is_perspective)
        # the second triangle's last corner was rounded to 1/256 px, which moves its texels by as much
        first, others = frame.face == 0, frame.face == 1
        is_sure = first & (~is_near_border(texels, uv) | (kind == "bilinear"))
        off = np.abs(frame.color - looked_up(texels, uv, kind, wrap))
        assert is_sure.sum() > 100 and off[is_sure].max() < 1e-6, f"{case}: {off[is_sure].max():.3g} > 1e-6"
        assert others.sum() > 100 and np.median(off[others]) < 0.01, f"{case}: {np.median(off[others]):.3g} > 0.01"


def test_samples_look_their_own_texels_up():
    samples = 4
    factor = round(samples**0.5)
    triangle, uv = tilted_quad()
    mesh = rz.Mesh(
        triangle[:3], [[0, 1, 2]], uv=uv[:3], material=replace(ALBEDO, texture=rz.Texture(TEXELS, "nearest"))
    )
    frame = show([mesh], samples=samples)
    texels = looked_up(TEXELS, coordinates(triangle, uv, *grid(factor)))
    mean = texels.reshape(SIZE[1], factor, SIZE[0], factor, 3).mean(axis=(1, 3))
    whole = frame.alpha == 1
    assert whole.sum() > 300 and np.abs(frame.color - mean)[whole].max() < 1e-6


@pytest.mark.parametrize("scale, wrap, shading", [
    (0.2, "repeat", "flat"), (1.0, "mirror", "gouraud"), (5.0, "clamp", "phong"), (40.0, ("repeat", "mirror"), "phong"),
    (5.0, "repeat", "gouraud"),
])  # fmt: skip
def test_trilinear_takes_the_level_of_its_derivatives(scale, wrap, shading):
    """The larger step on the texture, in texels, of one pixel to the right or down, by differences; log2 of it is the
    level."""
    texels = np.random.default_rng(2).uniform(0, 1, (16, 32, 3))
    triangle, uv = tilted_quad()
    texture = rz.Texture(texels, "trilinear", wrap)
    mesh = rz.Mesh(triangle[:3], [[0, 1, 2]], uv=uv[:3] * scale, material=replace(ALBEDO, texture=texture))
    frame, (x, y), h = show([mesh], shading), grid(), 1e-4
    here = coordinates(triangle, uv * scale, x, y)
    steps = [
        coordinates(triangle, uv * scale, x + i, y + j) - coordinates(triangle, uv * scale, x - i, y - j)
        for i, j in ((h, 0), (0, h))
    ]
    step = np.linalg.norm(np.array(steps) / (2 * h) * (32, 16), axis=-1).max(axis=0)
    detail = np.clip(np.log2(np.maximum(step, 1)), 0, len(texture.pyramid) - 1)
    below = np.minimum(detail.astype(int), len(texture.pyramid) - 2)
    levels = np.stack([looked_up(level[..., :3].astype(float), here, "bilinear", wrap) for level in texture.pyramid])
    fine, coarse = (np.take_along_axis(levels, k[None, ..., None], axis=0)[0] for k in (below, below + 1))
    expected = fine + (detail - below)[..., None] * (coarse - fine)
    off = np.abs(frame.color - expected)[frame.alpha > 0]
    assert len(off) > 150 and off.max() < 1e-5, f"{off.max():.3g} > 1e-5"


# ── whose texture ───────────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize("shading", SHADINGS)
def test_corners_have_texture_coordinates_of_their_own(shading):
    """Two triangles of one quad lie on different parts of the picture: a seam along the diagonal."""
    vertices, _ = tilted_quad()
    uv = np.array([[(0, 0), (0.4, 0), (0.4, 0.9)], [(5.1, 5.2), (5.8, 5.9), (5.1, 5.9)]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    material = replace(ALBEDO, texture=rz.Texture(TEXELS, "nearest"))
    frame = show([rz.Mesh(vertices, faces, uv=uv, material=material)], shading, outputs=("color", "face"))
    for face in (0, 1):
        place = coordinates(vertices[faces[face]], uv[face], *grid())
        off = np.abs(frame.color - looked_up(TEXELS, place)).max(axis=-1)[frame.face == face]
        assert len(off) > 150 and np.median(off) < 1e-7 and (off > 1e-6).mean() < 0.02


@pytest.mark.parametrize("shading, colored", [("flat", True), ("gouraud", False), ("phong", True)])
def test_the_texture_weakens_the_matte_light_alone(shading, colored):
    """Emission and highlight stay: rest + (whole - rest)·texel, each of the two drawn without textures."""
    vertices, faces = octasphere(1)
    colors = np.random.default_rng(2).uniform(0.3, 1, (len(vertices), 3)) if colored else None
    mesh = {"normals": vertices.copy(), "uv": vertices[:, :2], "colors": colors}
    vertices = vertices + (0, 0, -3)
    shiny = rz.Material(
        ambient=(0.5, 0.2, 0.4), diffuse=(0.6, 0.5, 0.3), specular=0.4, shininess=5, emissive=(0.05, 0, 0.1)
    )
    picture = rz.Texture(TEXELS, "nearest")

    def draw(**changes):
        return show([rz.Mesh(vertices, faces, material=replace(shiny, **changes), **mesh)], shading, LIT).color

    whole, rest, product = draw(), draw(diffuse=0, ambient=0), draw(texture=picture)
    white = mesh | {"colors": None}
    texel = show([rz.Mesh(vertices, faces, material=replace(ALBEDO, texture=picture), **white)], shading).color
    assert np.ptp(texel) > 0.5 and np.ptp(rest) > 0.1
    off = np.abs(product - (rest + (whole - rest) * texel)).max()
    assert off < 1e-6, f"{off:.3g} > 1e-6"


def test_a_bright_texture_in_linear_floats_is_not_cut_off():
    frame = show([textured(TEXELS * 5)])
    assert frame.color.max() > 3 and not differences(frame.rgb.max(axis=(0, 1)), 255)


# ── several materials ───────────────────────────────────────────────────────────────────────────────────


NOISE = np.random.default_rng(2).uniform(0, 1, (2, 4, 4, 3))
PALETTE = [
    rz.Material(diffuse=0.7, specular=0.2, texture=rz.Texture(NOISE[0], "nearest")),
    rz.Material(diffuse=(0.2, 0.6, 0.3), specular=0.4, reflection="blinn"),
    rz.Material(diffuse=(0.8, 0.3, 0.3), reflection="lambert", emissive=0.1, texture=rz.Texture(NOISE[1], "trilinear")),
]


@pytest.mark.parametrize("shading, opacity", [("flat", 1.0), ("gouraud", 0.5), ("phong", 1.0), ("phong", 0.5)])
def test_a_mesh_of_several_materials_is_that_of_several_meshes(shading, opacity):
    """Also one that needs no texture coordinates beside those that have them."""
    vertices, faces = octasphere(2)
    number = np.argsort(np.argsort(np.sin(np.arange(len(faces)) * 7.3))) % 3
    order = np.argsort(number, kind="stable")  # several meshes number their faces one after the other
    normals, uv, palette = vertices, vertices[:, :2] * 1.7, [replace(material, opacity=opacity) for material in PALETTE]
    vertices = vertices + (0, 0, -3)
    outputs = ("color", "face", "depth", "normal")
    whole = rz.Mesh(vertices, faces, normals, uv=uv, materials=palette, face_material=number)
    parts = [
        rz.Mesh(vertices, faces[number == k], normals, uv=None if k == 1 else uv, material=palette[k]) for k in range(3)
    ]
    together, apart = (show(meshes, shading, LIT, outputs=outputs) for meshes in ([whole], parts))
    plain = show([rz.Mesh(vertices, faces, normals)], shading, outputs=outputs)
    off = np.abs(together.color - apart.color).max()
    assert off < 1e-6, f"{off:.3g} > 1e-6"
    assert not differences(together.face, plain.face) and not differences(together.depth, plain.depth)
    is_hit = together.face >= 0
    assert is_hit.sum() > 70 and not differences(together.face[is_hit], order[apart.face[is_hit]])
    bare = show([replace(part, material=replace(part.material, texture=None)) for part in parts], shading, LIT)
    assert (np.abs(together.color - bare.color).max(axis=-1) > 0.02).sum() > 45
    default = show([whole], shading, LIT, tolerance=1 / 4096)
    off = np.abs(default.color - together.color).max()
    assert off <= 1 / 4096, f"{off:.3g} > 1/4096"


def test_normals_are_averaged_across_borders_of_materials():
    vertices, faces = octasphere(2)
    vertices = vertices + (0, 0, -3)
    two = {"materials": [rz.Material(), PALETTE[1]], "face_material": np.arange(len(faces)) % 2}
    smooth = show([rz.Mesh(vertices, faces, crease_angle=180, **two)], "phong", outputs=("normal",)).normal
    plain = show([rz.Mesh(vertices, faces, crease_angle=180)], "phong", outputs=("normal",)).normal
    assert not differences(smooth, plain) and np.abs(plain).max() > 0.9


def test_polygons_keep_one_material():
    """Quads with a material each, on one plane: every quad shows its own, without a trace of the diagonal."""
    corners = np.array([at_pixel(SIZE, 10 * i, 10 * j, 3.0) for j in range(4) for i in range(5)])
    quads = np.array([[5 * j + i, 5 * j + 5 + i, 5 * j + 6 + i, 5 * j + 1 + i] for j in range(3) for i in range(4)])
    colors = np.random.default_rng(2).uniform(0, 1, (12, 3))
    materials = [replace(ALBEDO, ambient=tuple(color)) for color in colors]
    expected = np.kron(colors.reshape(3, 4, 3), np.ones((10, 10, 1)))
    for shading in SHADINGS:
        frame = show([rz.Mesh(corners, quads, materials=materials, face_material=np.arange(12))], shading)
        off = np.abs(frame.color[:30, :40] - expected).max()
        assert off < 1e-6, f"{shading}: {off:.3g} > 1e-6"
