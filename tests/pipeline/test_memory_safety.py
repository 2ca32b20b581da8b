"""Check that no scene makes a kernel read or write outside its arrays: scenes aimed at every place where a float
becomes an index, at words and setup numbers, and at the ends of ranges.

Kernels are compiled without bounds checks: so these tests are worth most with NUMBA_BOUNDSCHECK=1, where a wrong index
is an IndexError. RASTERIZER_FUZZ_CASES is the number of random scenes of the nightly run.
"""

import os
import warnings

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.pairs import pairs
from helpers.pinhole import QUAD, SHADINGS, layer, sheet_camera
from helpers.raster import GREY
from helpers.stages import plain_screen

import rasterizer as rz
from rasterizer.errors import RasterizerError
from rasterizer.pipeline import clip, texcoords, textures

N_CASE = int(os.environ.get("RASTERIZER_FUZZ_CASES", "1600"))
N_CASE_BY_DEFAULT = 240
TINY, HUGE = (1e-300, -1e-300, 5e-324), (1e300, -1e300, 1.7e308, -1.7e308, 2.0**53, 2.0**63, -(2.0**63), 2.0**64)
NASTY = (0.0, -0.0, 1.0, -1.0, 0.5, *TINY, *HUGE)
NUMBERS = (*NASTY, np.inf, -np.inf, np.nan, np.nextafter(1.0, 2), np.nextafter(1.0, 0), -1e-17, 1e16 + 2, 4294967296.5)
FILTERS, WRAPS = ("nearest", "bilinear", "trilinear"), ("repeat", "clamp", "mirror")


# ── every float that becomes an index ───────────────────────────────────────────────────────────────────


def test_places_in_a_picture_lie_within_it_whatever_the_coordinate():
    rng = np.random.default_rng(1)
    bits = rng.integers(0, 2**64, 3000, dtype=np.uint64).view(np.float64)  # any float at all
    with np.errstate(all="ignore"):
        for wrap in (textures.WRAP_REPEAT, textures.WRAP_CLAMP, textures.WRAP_MIRROR):
            for x in (*NUMBERS, *bits, *rng.normal(scale=3, size=500)):
                place = texcoords.wrap_texcoord.py_func(np.float64(x), wrap)
                assert 0.0 <= place <= 1.0, f"{x!r} with wrap {wrap} becomes {place!r}"


@pytest.mark.parametrize("kind", FILTERS)
def test_texture_coordinates_of_any_size(kind):
    corners = np.array(layer((16, 12), 2.0, is_perspective=False))
    for wrap, shape in (("repeat", (1, 1)), ("clamp", (1, 7)), ("repeat", (5, 3)), ("mirror", (16, 2))):
        image = np.random.default_rng(2).uniform(0, 1, (*shape, 3))
        material = rz.Material(ambient=1, diffuse=0, specular=0, texture=rz.Texture(image, kind, wrap))
        for k, u in enumerate(NASTY):
            v = (0.25, -u, 3 * u if abs(u) < 1e300 else 1.0)[k % 3]
            mesh = rz.Mesh(corners, QUAD, uv=np.array([(0, 0), (u, 0), (u, v), (0, v)]), material=material)
            scene = rz.Scene([mesh], (rz.AmbientLight(1.0),), sheet_camera(12))
            color = rz.render(scene, (16, 12), shading="flat", threads=1, samples=1).color
            is_texel = np.isfinite(color).all() and color.max() <= image.max() + 1e-6
            assert is_texel, f"{kind}, {wrap}, {shape}, uv up to ({u}, {v}): {color.max()} > {image.max()}"


def test_a_near_plane_next_to_the_eye():
    """1/w of the near plane leaves what float64 can tell from 0: depths and texture coordinates may be no numbers."""
    image = np.random.default_rng(3).uniform(0, 1, (8, 8, 4))
    kinds, shares = (1.0, 0.5), (1e-300, 1e-100, 1e-30, 1e-16, 1e-11, 1e-6)
    for distance, share, opacity, kind, shading in pairs(
        distance=(1e-3, 1.0, 5.0, 1e6), share=shares, opacity=kinds, kind=FILTERS, shading=SHADINGS
    ):
        vertices = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, -0.5)]) * distance * 0.3
        near = max(share * distance, 5e-324)
        camera = rz.Camera.perspective((0.0, 0.0, distance), (0, 0, 0), fov=50, near=near)
        look = rz.Material(texture=rz.Texture(image, kind), opacity=opacity)
        mesh = rz.Mesh(vertices, QUAD, uv=[(0, 0), (9, 0), (9, 9), (0, 9)], material=look)
        lamp = rz.PointLight((0, 0, distance), 0.5, shadow=True)
        outputs = ("rgb", "depth", "face", "normal")
        draw(rz.Scene([mesh], (*GREY, lamp), camera), (16, 12), shading=shading, outputs=outputs)


def test_polygons_that_zigzag_through_all_planes_find_room():
    """Slivers far beyond the guard band, which rounding bends while they are clipped."""
    rng, screen = np.random.default_rng(9), plain_screen(True, (1.0, 10.0), far_clip=10.0)
    corners = rng.normal(size=(3, 2000)) * 2.0 ** rng.uniform(0, 60, (1, 2000))
    faces = rng.integers(0, 2000, (3, 4000)).astype(np.uint32)
    corners[:, faces[2]] = corners[:, faces[0]] + rng.uniform(-0.1, 1.1, 4000) * (
        corners[:, faces[1]] - corners[:, faces[0]]
    )
    parts, owners = np.full((7 * 4000 + 9, 3, clip.N_CORNER_COLUMN), np.nan), np.empty(7 * 4000, np.uint32)
    scratch = clip.ClipScratch(*np.full((2, clip.ROOM + 9, clip.N_CORNER_COLUMN), 77.0))
    corners, numbers = np.ascontiguousarray(corners.T), np.arange(4000, dtype=np.uint32)
    n = clip.clip_faces(corners, faces, numbers, screen, scratch, parts, owners)
    assert 1000 < n and not differences(np.isnan(parts[n:]), True) and not differences(np.isnan(parts[:n]), 0)
    assert all((room[clip.ROOM :] == 77).all() for room in scratch), "a polygon has more corners than there is room for"


# ── random scenes, every number of which may be extreme ─────────────────────────────────────────────────


def draw(scene, size, **options):
    """Draw a scene; what is refused is refused by an error of ours."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            frame = rz.render(scene, size, threads=1, **{"samples": 1} | options)
        except RasterizerError:
            return None
    return frame


def extreme(rng, low=-30, high=30):
    """A positive number of any size."""
    return float(10.0 ** rng.uniform(low, high))


def vertices_of(rng, unit):
    """A soup, a fan of slivers, a floor, or points on the eye."""
    n = 3 * int(rng.integers(1, 12))
    points = rng.normal(size=(n, 3))
    kind = rng.integers(4)
    if kind == 1:
        points = points[:1] + np.outer(np.arange(n), points[1 % n]) + 10.0 ** rng.uniform(-18, -3) * points
    elif kind == 2:
        points *= (10.0 ** rng.uniform(0, 7), 1e-3, 10.0 ** rng.uniform(0, 7))
    elif kind == 3:
        points[rng.integers(0, n, n // 3 + 1)] = (0, 0, 3)
    return points * unit


def material_of(rng):
    choice = rng.choice
    if rng.random() < 0.25:  # what is cheapest, beside what isn't
        return rz.Material(diffuse=float(rng.uniform(0, 1)), specular=float(choice((0, 0.3))))
    image = rng.uniform(0, 1, (int(choice((1, 2, 5, 16))), int(choice((1, 3, 8))), 4))
    textured = rz.Texture(image, str(choice(FILTERS)), (str(choice(WRAPS)), str(choice(WRAPS))))
    reflection = str(choice(("phong", "blinn", "cook-torrance", "toon", "oren-nayar")))
    return rz.Material(
        diffuse=tuple(rng.uniform(0, 1, 3)),
        specular=float(choice((0, 0.5, 6e-10, 30))),
        shininess=float(choice((0.05, 1, 20, 1e3, 3e8, 1e11, extreme(rng, -2, 20)))),
        opacity=float(choice((1, 1, 1, 0.5, 1e-12, 0))),
        emissive=float(choice((0, 0, 1e10))),
        texture=textured if rng.random() < 0.5 else None,
        reflection=reflection,
    )


def lights_of(rng, points, unit):
    place = points[rng.integers(len(points))] + unit * float(rng.choice((0, 1e-9, 1, 1e9))) * rng.normal(size=3)
    shadow = rz.Shadow(int(rng.choice((1, 2, 33, 64))), int(rng.choice((1, 3)))) if rng.random() < 0.4 else False
    lights = [
        rz.AmbientLight(0.1),
        rz.DirectionalLight(rng.normal(size=3), float(rng.choice((0.5, 1e8))), shadow=shadow),
        rz.PointLight(place, float(rng.choice((1, 1e-8, 1e12))), (1, 0.1, float(rng.choice((0, 1e-6)))), shadow=shadow),
        rz.SpotLight(
            place,
            rng.normal(size=3),
            1.0,
            outer=float(rng.uniform(1e-3, 90)),
            exponent=float(rng.choice((0, 1, 1e300))),
        ),
    ]
    return [light for light in lights if rng.random() < 0.6]


def camera_of(rng, points, unit):
    eye = points[rng.integers(len(points))] * float(rng.choice((0, 1, 1 + 1e-9, 1, 3))) + unit * np.array(
        (0.0, 0.0, 3.0)
    )
    near, far = (None if rng.random() < 0.6 else unit * extreme(rng, -40, 1)), None
    if near is not None and rng.random() < 0.5:
        far = near * (1 + extreme(rng, -12, 12))
    if rng.random() < 0.3:
        return rz.Camera.orthographic(
            eye, points[0] + unit * np.array((0.1, 0.2, -1.0)), height=unit * extreme(rng, -12, 12), near=near, far=far
        )
    if rng.random() < 0.2:
        focal = extreme(rng, -20, 20) if rng.random() < 0.3 else float(rng.uniform(1, 99))
        skew = focal * float(rng.choice((-1024, 1024, 1e-9, 0.3, extreme(rng, -300, 3))))
        lens = {
            "intrinsics": (focal, float(rng.uniform(1, 99)), *rng.normal(16, 99, 2)),
            "size": (31, 31),
            "skew": skew,
        }
        return rz.Camera(position=eye, target=points.mean(axis=0), near=near, far=far, **lens)
    fov = float(rng.choice((40, 90, 1e-6, 175, 179.999999)))
    return rz.Camera.perspective(eye, points.mean(axis=0), fov=fov, near=near, far=far)


def scene_of(rng):
    unit = float(rng.choice((1, 1, 1, extreme(rng), extreme(rng, -90, 90))))
    points = vertices_of(rng, unit)
    n_face = len(points) // 3
    faces = (
        rng.permutation(3 * n_face).reshape(-1, 3) if rng.random() < 0.5 else rng.integers(0, len(points), (n_face, 3))
    )
    uv = rng.normal(size=(len(points), 2)) * float(rng.choice((1, 1, 1e6, 1e300)))
    uv[rng.random(uv.shape) < 0.1] = rng.choice(NASTY)
    extras = {"uv": uv, "materials": [material_of(rng) for _ in range(4)], "face_material": rng.integers(0, 4, n_face)}
    if rng.random() < 0.3:
        extras["normals"] = rng.normal(size=points.shape) * rng.choice((0, 1e-200, 1, 1e100), (len(points), 1))
    if rng.random() < 0.3:
        extras["colors"] = rng.uniform(0, float(rng.choice((1, 1e30))), points.shape)
    mesh = rz.Mesh(points, faces, **extras)
    return rz.Scene([mesh], lights_of(rng, points, unit), camera_of(rng, points, unit))


def options_of(rng):
    width, height = (int(n) for n in rng.choice((1, 2, 7, 8, 9, 31, 64, 129), 2))
    outputs = ("color", "rgb", "depth", "face", "normal") if rng.random() < 0.3 else ("color", "rgb")
    return (width, height), {
        "shading": str(rng.choice(SHADINGS)),
        "tolerance": float(rng.choice((0, 1e-6, 1 / 4096, 0.1))),
        "samples": int(rng.choice((1, 4))),
        "cull": str(rng.choice(("none", "back"))),
        "color_range": str(rng.choice(("clamp", "global", "local"))),
        "exposure": float(rng.choice((0, 0, 64, -64))),
        "outputs": outputs,
    }


def check_random_scenes(cases):
    """Whatever is drawn: only errors of ours come out, every pixel is written, and most scenes are drawn."""
    n_drawn = 0
    for case in cases:
        rng = np.random.default_rng((20_261_121, case))
        try:
            scene = scene_of(rng)
        except RasterizerError:
            continue
        size, options = options_of(rng)
        try:
            frame = draw(scene, size, **options)
        except Exception as fault:
            raise AssertionError(f"case {case}: {type(fault).__name__}: {fault}") from fault
        n_drawn += frame is not None
        if frame is not None and "face" in options["outputs"]:
            assert frame.face.min() >= -1 and frame.face.max() < scene.meshes[0].n_face, f"case {case}"
    assert n_drawn > 0.5 * len(cases), f"only {n_drawn} of {len(cases)} scenes are drawn"


def test_random_scenes_with_extreme_numbers():
    check_random_scenes(range(N_CASE_BY_DEFAULT))


@pytest.mark.nightly
@pytest.mark.parametrize("part", range(8))
def test_many_random_scenes_with_extreme_numbers(part):
    check_random_scenes(range(part * N_CASE // 8, (part + 1) * N_CASE // 8))
