"""The hard cases that are limits: each chapter "Limits" of rasterizer/README.md, as far as a picture can show it.

In: whether a small version will do, as in a test. Out: a `Case` for each, after those of hard_scenes.py. What is legal
and what is read of files is tested with the readers (tests/io/).
"""

import warnings
from dataclasses import replace

import numpy as np

import rasterizer as rz
from bench.hard_scenes import CASES, LAMP, LIGHTS, SIZE, Refused, Scene, ball, case, framed, on_screen

__all__ = ["CASES"]
FLOOR = ([(-3, -1, -3), (3, -1, -3), (3, -1, 3), (-3, -1, 3)], [[0, 2, 1], [0, 3, 2]])
SUN = rz.DirectionalLight((-0.4, -1.0, -0.5), 0.9, shadow=rz.Shadow(512))


# ── what it doesn't do ────────────────────────────────────────────────────────────────────────────────────


@case("a highlight inside a polygon", "A limit of Gouraud's method: no vertex sees the highlight, so no sample does.")
def lost_highlight(_):
    normals = [(-0.5, -0.5, 0.7), (0.5, -0.5, 0.7), (0.5, 0.5, 0.7), (-0.5, 0.5, 0.7)]
    square = rz.Mesh([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [[0, 1, 2], [0, 2, 3]], normals,
                     material=rz.Material(diffuse=0.2, specular=0.8, shininess=200))  # fmt: skip
    made = Scene(rz.Scene(square, rz.DirectionalLight((0, 0, -1)), rz.Camera.perspective((0, 0, 4))))

    def expect(frame):
        bright = rz.render(made.scene, made.size, shading="phong").color.max()
        return None if frame.color.max() < 0.5 < bright else "the highlight isn't lost, or isn't there"

    return made._replace(expect=expect)


@case("the alpha of vertex colours", "A limit: it isn't drawn; the colours are, as if opaque.")
def vertex_alpha(_):
    mesh = ball(8)
    colors = np.concatenate([np.abs(mesh.normals), np.full((len(mesh.vertices), 1), 0.25)], axis=1)
    made = framed([replace(mesh, colors=colors)])
    return made._replace(
        expect=lambda frame: None if (frame.alpha[frame.face >= 0] == 1.0).all() else "something is seen through"
    )


@case("a polygon that crosses itself", "A limit: no triangles between its corners fill it; it is warned of.")
def crossing_polygon(_):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        mesh = rz.Mesh([(-1, -1, 0), (1, 1, 0), (1, -1, 0), (-1, 1, 0)], [[0, 1, 2, 3]])
    told = [str(each.message) for each in caught]
    is_told = len(told) == 1 and "crosses itself" in told[0]
    made = Scene(rz.Scene(mesh, LIGHTS, rz.Camera.perspective((0, 0, 5))))
    return made._replace(expect=lambda frame: None if is_told else f"warnings: {told}")


# ── shadows ───────────────────────────────────────────────────────────────────────────────────────────────


@case(
    "a shadow on a floor of two triangles",
    "A limit of Gouraud's method: shadows are those of vertices, so this one is lost.",
)
def shadow_of_vertices(_):
    plate = rz.Mesh([(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1)], [[0, 2, 1], [0, 3, 2]])
    lights = (rz.AmbientLight(0.1), replace(SUN, direction=(0.0, -1.0, 0.0)))
    made = Scene(rz.Scene([plate, rz.Mesh(*FLOOR)], lights, rz.Camera.perspective((0, 4, 6))))

    def expect(frame):
        floor = frame.color[frame.face >= 2]
        return None if floor.min() > 0.5 and np.ptp(floor, axis=0).max() < 1e-3 else "the floor isn't even"

    return made._replace(expect=expect)


@case("a shadow of a pane", "A limit: transparent surfaces cast no shadow.")
def shadow_of_glass(_):
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


@case(
    "a highlight at the terminator", "A limit: classic highlights end with a step where N·L = 0; `stats.steps` says so."
)
def terminator(_):
    material = rz.Material(diffuse=0.2, specular=0.8, shininess=1)
    return framed([ball(12, material=material)], (rz.DirectionalLight((0, 0, 1)),), shading="phong")


@case(
    "a light parallel to a surface",
    "Within 2⁻²⁰ rad, 2⁻⁴⁰ in float64, it counts as parallel, so that no rounding decides.",
)
def grazing(_):
    lights = tuple(rz.DirectionalLight((1.0, -angle, 0.0), 0.3) for angle in (0.0, 2.0**-60, 2.0**-21, 1e-3))
    floor = rz.Mesh(*FLOOR, material=rz.Material(diffuse=1.0, ambient=1.0))
    scene = rz.Scene(floor, (rz.AmbientLight(0.1), *lights), rz.Camera.perspective((0, 3, 5)))
    return Scene(scene, options={"shading": "phong"})


@case("Blinn's highlight against the light", "A limit: H = L + V vanishes; `stats.steps` says how near no bound holds.")
def against_the_light(_):
    material = rz.Material(diffuse=0.3, specular=0.7, shininess=20, reflection="blinn")
    return framed(
        [ball(12, material=material)], (rz.DirectionalLight((0.3, 0.2, 1.0), 1.0, "camera"),), shading="phong"
    )


@case("brushed metal where u is mirrored, and at a pole", "A limit: tangents cancel there, and no direction is left.")
def mirrored_seam(is_small):
    n = 8 if is_small else 16
    mesh = ball(n)
    around = np.arctan2(mesh.normals[:, 2], mesh.normals[:, 0])
    uv = np.stack([np.abs(around) / np.pi, mesh.normals[:, 1]], axis=1)
    material = rz.Material(reflection="cook-torrance", roughness=(0.1, 0.5), tangent="u")
    return framed([replace(mesh, uv=uv, material=material)], shading="phong")


@case("colours of vertices under a spectrum", "A limit: they are RGB, and multiply what the spectra have become.")
def spectral_colors(_):
    mesh = ball(8)
    lights = (rz.AmbientLight(0.1), rz.DirectionalLight((-0.4, -0.5, -0.8), rz.Spectrum.blackbody(3000)))
    return framed([replace(mesh, colors=np.abs(mesh.normals))], lights)


# ── what is refused, or clipped ───────────────────────────────────────────────────────────────────────────


@case(
    "a convex polygon of 24 corners", "It is drawn about its centre, so that no diagonal shows; faces are its edges'."
)
def convex_polygon(_):
    turn = np.linspace(0.0, 2.0 * np.pi, 25)[:-1]
    rim = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    mesh = rz.Mesh(rim, [list(range(24))], normals=rim * (0.6, 0.6, 0) + (0, 0, 0.8))
    return Scene(rz.Scene(mesh, (*LIGHTS, LAMP), rz.Camera.perspective((0, 0, 4))))


@case("what is nearer than 2⁻²⁰ of the furthest distance", "A limit: it is clipped, the rest is as it was.")
def nearer_than_near(_):
    points = [(8, 60), (88, 60), (48, 8)] * 2
    faces, depths = [[0, 1, 2], [3, 4, 5]], np.repeat([2.0**-22, 1.0], 3)
    return Scene(on_screen(SIZE, points, depths, faces, is_perspective=True), expect=only(1))


def only(face):
    """Expect that one face alone is seen."""
    return lambda frame: None if np.unique(frame.face).tolist() == [-1, face] else "another face is seen"


@case(
    "faces nearer together than depth can tell",
    "A limit: 38 bits of the range of depths; there either may be in front.",
)
def too_near(_):
    points = [(8, 60), (88, 60), (48, 8)] * 2 + [(90, 2), (95, 2), (92, 6)]
    depths = np.repeat([2.0, 2.0 + 2.0**-40, 3.0], 3)
    return Scene(on_screen(SIZE, points, depths, [[0, 1, 2], [3, 4, 5], [6, 7, 8]]))


@case("numbers that float32 can't hold", "Refused: coordinates above 10¹⁰⁰, intensities and depths above 3·10³⁸.",
      is_shown=False)  # fmt: skip
def too_large(_):
    mesh = ball(4)
    return Refused({
        "coordinates": lambda: rz.Mesh(mesh.vertices * 1e101, mesh.faces),
        "intensities": lambda: rz.render(rz.Scene(mesh, rz.DirectionalLight((0, 0, -1), 1e39)), 8),
        "depths": lambda: rz.render(rz.Mesh(mesh.vertices * 1e40, mesh.faces), 8, outputs="depth"),
    })  # fmt: skip


@case(
    "more samples than legal",
    "Refused: 262144 along an axis are the most.",
    is_shown=False,
)
def too_wide(_):
    mesh = ball(4)
    return Refused({
        "pixels": lambda: rz.render(mesh, (2**18 + 1, 1)),
        "samples": lambda: rz.render(mesh, (2**17, 1), samples=9),
    })  # fmt: skip
