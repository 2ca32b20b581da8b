"""Mach bands: on pictures whose jumps are known, and on a sphere by each method."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.pinhole import octasphere
from helpers.raster import ROOT, sheet

import rasterizer as rz
from rasterizer import reference

SIZE = (24, 8)
UP = np.tile([0.0, 0.0, 1.0], (6, 1))
STRIP = [(-1, -9), (12, -9), (25, -9), (25, 20), (12, 20), (-1, 20)]  # two quads that meet in the column 12


def strip(**mesh):
    """A scene of two quads side by side, with one normal everywhere, and its light: what the vertices' colours say."""
    lights = (rz.AmbientLight(1.0),)
    material = rz.Material(ambient=1.0, diffuse=0.0, specular=0.0)
    mesh = {"normals": UP, "polygons": [0, 0, 1, 1], **mesh}
    return sheet(SIZE, STRIP, 2.0, [[0, 5, 4], [0, 4, 1], [1, 4, 3], [1, 3, 2]], lights, material=material, **mesh)


def picture(scene, values) -> SimpleNamespace:
    """A picture whose pixels have the values (w,), and only show the two triangles that share the edge between the
    quads."""
    face = rz.render(scene, SIZE, outputs=("face",), shading="gouraud", samples=1).face
    color = np.broadcast_to(np.asarray(values, np.float32)[None, :, None], (*face.shape, 3))
    return SimpleNamespace(color=color, face=np.where(face < 2, 1, 2).astype(np.int32))


X = np.arange(24) + 0.5 - 12  # distance of the pixels from the edge


def test_known_jumps():
    scene = strip()
    for what, values, value_jump, slope_jump in (
        ("nothing", 0.5 + 0 * X, 0.0, 0.0),
        ("a ramp", 0.5 + 0.01 * X, 0.0, 0.0),
        ("flat: the slope across the edge is the jump", np.where(X < 0, 0.2, 0.5), 0.3, 0.3),
        ("a ridge", 0.5 - 0.01 * np.abs(X), 0.0, 0.02),
        ("a kink", np.where(X < 0, 0.3, 0.3 + 0.02 * X), 0.0, 0.02),
        ("a step in a ramp", np.where(X < 0, 0.2 + 0.01 * X, 0.5 + 0.01 * X), 0.3, 0.3),
        ("a step beside a parabola", np.where(X < 0, 0.2 + 0.002 * X**2, 0.5), 0.3, 0.3 - 0.002 / 4),
        ("smooth: curvature alone is no jump", 0.5 + 0.001 * X**2, 0.0, 0.0),
        ("nor is how fast that changes", 0.5 + 0.0003 * X**3, 0.0, 0.0),
        ("a highlight that is wider than the pixels that are looked at", 0.5 + 0.3 * np.exp(-((X / 5) ** 2)), 0.0, 0.0),
    ):
        bands = rz.mach_bands(picture(scene, values), scene)
        assert bands.n_place == SIZE[1]
        found = bands.value_jump, bands.slope_jump, bands.slope_rms
        assert found == pytest.approx((value_jump, slope_jump, slope_jump), abs=1e-6), what


def test_colours_count_by_their_luminance():
    scene = strip()
    step = picture(scene, np.where(X < 0, 0.2, 0.5))
    for channel, share in enumerate((0.2126, 0.7152, 0.0722)):
        step.color = np.zeros((*step.face.shape, 3), np.float32)
        step.color[..., channel] = np.where(X < 0, 0.2, 0.5)
        found = rz.mach_bands(step, scene).value_jump
        assert found == pytest.approx(0.3 * share, abs=1e-6), f"{found} of channel {channel}"


def test_a_ramp_between_vertices():
    """Colours 0, 0.5 and 0.5 at the columns -1, 12 and 25: slope 0.5/13, then none."""
    scene = strip(colors=np.repeat([0.0, 0.5, 0.5, 0.5, 0.5, 0.0], 3).reshape(6, 3))
    frame = rz.render(scene, SIZE, shading="gouraud", tolerance=0, outputs=("color", "face"), samples=1)
    bands = rz.mach_bands(frame, scene)
    assert bands.slope_jump == pytest.approx(0.5 / 13, abs=1e-6) and bands.value_jump < 1e-6


def test_colours_and_creases_are_to_be_seen():
    creased = np.repeat([[[0, 0, 1.0]], [[0, 0, 1.0]], [[0, 1, 1.0]], [[0, 1, 1.0]]], 3, axis=1)
    for mesh in (
        {"normals": None, "crease_angle": 0.0, "face_colors": np.eye(3)[[0, 0, 1, 1]]},
        {"normals": creased},
    ):
        scene = strip(**mesh)
        found = rz.mach_bands(picture(scene, np.where(X < 0, 0.2, 0.5)), scene)
        assert found == (0.0, 0.0, 0, 0.0), list(mesh)


def test_seams_of_a_file_are_no_edges():
    """Vertices cut in two at one place, with one normal, are one; without normals each side has its own."""
    scene = strip()
    mesh = scene.meshes[0]
    apart = rz.Mesh(mesh.vertices[mesh.faces.ravel()], np.arange(12).reshape(4, 3), normals=UP[:1].repeat(12, 0))
    cut = replace(scene, meshes=(apart,))
    assert rz.mach_bands(picture(scene, X), cut).n_place == SIZE[1]
    assert rz.mach_bands(picture(scene, X), replace(cut, meshes=(replace(apart, normals=None),))).n_place == 0


def test_outlines_do_not_count():
    """Of two faces that share an edge and turn different sides to the viewer, one lies behind the other's outline."""
    scene = strip()
    turned = replace(scene.meshes[0], faces=scene.meshes[0].faces[:, [0, 2, 1]], normals=-UP)
    half = replace(scene.meshes[0], faces=np.concatenate([scene.meshes[0].faces[:2], turned.faces[2:]]))
    assert rz.mach_bands(picture(scene, X), replace(scene, meshes=(half,))).n_place == 0
    assert rz.mach_bands(picture(scene, X), replace(scene, meshes=(turned,))).n_place == SIZE[1]


def test_places_where_light_ends_do_not_count():
    """Normals leaning to both sides: light from one side ends within the strip, light from the camera doesn't."""
    leaning = np.array([[-1, 0, 1], [1, 0, 1], [-1, 0, 1], [-1, 0, 1], [1, 0, 1], [-1, 0, 1]], float)
    camera_light = rz.PointLight((0, 0, 90), attached="camera")
    for light, ends in ((rz.DirectionalLight((-1, 0, 0)), True), (camera_light, False), (rz.AmbientLight(0.5), False)):
        scene = replace(strip(normals=leaning), lights=(light,))
        n_place = rz.mach_bands(picture(scene, X), scene).n_place
        assert (n_place == 0) == ends, f"{light}: {n_place} places"


def test_faces_seen_at_more_than_sixty_degrees_do_not_count():
    """The strip, leaning back about its middle line."""
    scene = strip()
    frame, (mesh,) = picture(scene, X), scene.meshes
    for degrees, n_place in ((58, SIZE[1]), (62, 0)):
        slope = np.tan(np.radians(degrees))
        vertices = mesh.vertices + np.outer(mesh.vertices[:, 1] * slope, (0, 0, 1))
        leaning = replace(scene, meshes=(replace(mesh, vertices=vertices),))
        assert rz.mach_bands(frame, leaning).n_place == n_place, f"{degrees} degrees"


def bands_of(scene, size) -> dict:
    """The Mach bands of each shading method."""
    found = {}
    for shading in ("flat", "gouraud", "phong"):
        frame = rz.render(scene, size, shading=shading, tolerance=0, samples=1, outputs=("color", "face"))
        found[shading] = rz.mach_bands(frame, scene)
    return found


def test_flat_above_gouraud_above_phong_on_a_sphere_and_the_judges_picture_will_do():
    mesh = rz.Mesh(*octasphere(3), material=rz.Material(specular=0.5, shininess=10))
    scene = rz.Scene([mesh])
    found = bands_of(scene, (160, 120))
    flat, gouraud, phong = found.values()
    assert flat.n_place == gouraud.n_place == phong.n_place > 100
    assert flat.slope_jump > 5 * gouraud.slope_jump and gouraud.slope_jump > 1.3 * phong.slope_jump, found
    assert flat.value_jump > 5 * gouraud.value_jump and gouraud.value_jump > phong.value_jump, found
    judged = rz.mach_bands(reference.render(scene, (160, 120), shading="phong"), scene)
    assert judged == pytest.approx(phong, abs=1e-6)


MODELS = [p for p in sorted((ROOT / "models").iterdir()) if p.suffix in (".obj", ".ply", ".glb", ".stl")]
NOISE = 1e-6  # of colours in float32, and of their differences


@pytest.mark.nightly
@pytest.mark.parametrize("model", MODELS, ids=lambda path: path.name)
def test_flat_above_gouraud_above_phong_on_every_model(model):
    """As a whole; where no smooth edge is seen, or nothing changes across them, all are 0. The largest jump is that of
    one place: on the teapot Phong's is above Gouraud's, which misses the highlight there."""
    found = bands_of(rz.load(model), (640, 480))
    flat, gouraud, phong = (bands.slope_rms for bands in found.values())
    assert flat >= gouraud - NOISE and gouraud >= phong - NOISE, found
    assert flat > 3 * gouraud or flat < 30 * NOISE, "flat shading's are the ones that everybody sees"


def test_textures_and_what_shines_through_do_not_count():
    scene = strip()
    for material in (rz.Material(opacity=0.5), rz.Material(texture=rz.Texture(np.ones((2, 2, 3))))):
        mesh = replace(scene.meshes[0], material=material, uv=np.zeros((6, 2)))
        assert rz.mach_bands(picture(scene, X), replace(scene, meshes=(mesh,))).n_place == 0


def test_subdivision_and_size_make_the_bands_smaller():
    scene = rz.Scene([rz.Mesh(*octasphere(3), material=rz.Material(specular=0.5, shininess=10))])
    camera = scene.camera_for((160, 120))
    finer = replace(scene, meshes=(scene.meshes[0].subdivide(),))

    def jump(scene, size):
        frame = rz.render(
            replace(scene, camera=camera), size, tolerance=0, samples=1, outputs=("color", "face"), shading="gouraud"
        )
        return rz.mach_bands(frame, scene, camera).slope_jump

    coarse = jump(scene, (160, 120))
    assert jump(finer, (160, 120)) < 0.8 * coarse
    assert jump(scene, (320, 240)) == pytest.approx(coarse / 2, rel=0.3)


def test_small_pictures():
    """No two faces of four pixels meet: nothing was looked at, and nothing jumps; in a larger picture something
    does."""
    scene = rz.Scene([rz.Mesh(*octasphere(1))])
    for size in ((1, 9), (2, 9), (5, 5), (6, 1), (64, 48)):
        frame = rz.render(scene, size, shading="flat", samples=1, outputs=("color", "face"))
        bands = rz.mach_bands(frame, scene)
        if size < (64, 48):
            assert bands == (0.0, 0.0, 0, 0.0), f"{size}: {bands}"
    assert bands.n_place > 0 and 0.01 < bands.value_jump < 1 and 0.01 < bands.slope_jump < 1, bands


def test_what_is_no_picture_for_it():
    scene = strip()
    good = picture(scene, X)
    fine = rz.render(scene, SIZE, samples=4, outputs=("color", "face"), shading="gouraud")
    for bad, message in (
        (fine, "one sample a pixel"),
        (rz.render(scene, SIZE, samples=1, shading="gouraud"), "no face: ask for it"),
        (good.color, "color and face is needed; given ndarray"),
        (SimpleNamespace(color=good.color, face=good.color), "face .height, width. integers; given float32"),
        (SimpleNamespace(color=good.color, face=good.face + 2), "shows face 4; the scene has 4 faces"),
    ):
        with pytest.raises(rz.SceneError, match=message):
            rz.mach_bands(bad, scene)
