"""Check every kind of light in whole pictures: against closed forms on a plane, and against the reference on models."""

import itertools

import numpy as np
import pytest
from helpers.raster import sheet

import rasterizer as rz

SIZE, STEP, DEPTH = (48, 36), 4, 40.0
KD, KA, IA = np.array([0.6, 0.5, 0.2]), 0.5, 0.1
MATERIAL = rz.Material(ambient=KA, diffuse=tuple(KD), specular=0)
PLACE, COLOR = np.array([10.0, -6.0, 15.0 - DEPTH]), np.array([0.9, 0.6, 0.3])

ATTENUATIONS = {"none": "1", "linear": "1/(d+4)", "square": "1/d^2", "all": (0.5, 0.02, 0.003)}
LIGHTS = {
    **{f"point, {name}": rz.PointLight(PLACE, COLOR, form) for name, form in ATTENUATIONS.items()},
    "point, amplified": rz.PointLight(PLACE, COLOR, (0.2, 0, 0.001), amplify=True),
    "point, range": rz.PointLight(PLACE, COLOR, range=30),
    "directional": rz.DirectionalLight((0.3, 0.4, -0.5), COLOR),
    "spot": rz.SpotLight(PLACE, (-0.2, 0.1, -1), COLOR, inner=20, outer=55),
    "spot, exponent": rz.SpotLight(PLACE, (-0.2, 0.1, -1), COLOR, 20, 70, 5.5, "1/(d+4)", range=60),
    "spot, sharp": rz.SpotLight(PLACE, (-0.2, 0.1, -1), COLOR, 50, 50),
    "spot, late fall": rz.SpotLight(PLACE, (-0.2, 0.1, -1), COLOR, 20, 55, falloff=0.3),
    "spot, early fall": rz.SpotLight(PLACE, (-0.2, 0.1, -1), COLOR, 20, 70, 1.5, "1/(d+4)", range=60, falloff=4.5),
    "spot, sharp whatever falls": rz.SpotLight(PLACE, (-0.2, 0.1, -1), COLOR, 50, 50, falloff=3),
    "area": rz.AreaLight(PLACE, (9, 0, 2), (1, 7, 0), COLOR, (5, 3), (1, 0.01, 0)),
}


def plane(light):
    """A plane of small triangles with vertices in pixels' centres, one unit a pixel, seen from straight above."""
    columns, rows = SIZE[0] // STEP + 1, SIZE[1] // STEP + 1
    x, y = np.meshgrid(np.arange(columns), np.arange(rows))
    corner = np.arange(columns * rows).reshape(rows, columns)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
    faces = np.concatenate([np.stack([a, d, c], -1).reshape(-1, 3), np.stack([a, c, b], -1).reshape(-1, 3)])
    points = np.stack([x.ravel(), y.ravel()], axis=1) * float(STEP) + 0.5
    lights = (rz.AmbientLight(IA), light)
    return sheet(SIZE, points, DEPTH, faces, lights, material=MATERIAL), points, faces


def place_of(points):
    """Where places in the picture (n, 2), in pixels, lie on the plane."""
    x, y = np.moveaxis(np.asarray(points, float), -1, 0)
    return np.stack([x - SIZE[0] / 2, SIZE[1] / 2 - y, np.full(x.shape, -DEPTH)], axis=-1)


def closed_form(light, where):
    """The illumination equation on the plane, whose normal is +z, at points (..., 3); also how far a sharp edge is, in
    cosine."""
    ambient = KA * IA
    if isinstance(light, rz.DirectionalLight):
        return ambient + KD * COLOR * -light.direction[2], np.inf
    if isinstance(light, rz.AreaLight):
        total, (m, n) = 0.0, light.resolution
        for i in range(m):
            for j in range(n):
                u, v = np.array(light.edge_u), np.array(light.edge_v)
                place = np.array(light.corner) + u * (i + 0.5) / m + v * (j + 0.5) / n
                total += closed_form(rz.PointLight(place, COLOR, light.attenuation), where)[0] - ambient
        return ambient + total / (m * n), np.inf
    to_light = np.array(light.position) - where
    distance = np.sqrt((to_light**2).sum(axis=-1))
    kc, kl, kq = light.attenuation
    strength = 1 / (kc + kl * distance + kq * distance**2)
    strength = strength if light.amplify else np.minimum(strength, 1)
    strength *= np.maximum(0, 1 - (distance / light.range) ** 4) if light.range else 1
    edge = np.inf
    if isinstance(light, rz.SpotLight):
        cosine = -(to_light @ np.array(light.direction)) / distance
        c_inner, c_outer = np.cos(np.radians([light.inner, light.outer]))
        t = np.clip((cosine - c_outer) / (c_inner - c_outer), 0, 1) if c_inner > c_outer else 1.0 * (cosine >= c_outer)
        strength *= (t**2 * (3 - 2 * t)) ** light.falloff * np.maximum(cosine, 0) ** light.exponent
        edge = np.abs(cosine - c_outer) if c_inner == c_outer else np.inf
    return ambient + KD * COLOR * (strength * to_light[..., 2] / distance)[..., None], edge


@pytest.mark.parametrize("name, shading", list(zip(LIGHTS, itertools.cycle(("phong", "gouraud", "flat", "phong")))))
def test_a_lit_plane_is_that_of_the_closed_form(name, shading):
    """Flat: a value a triangle, of its centroid. Gouraud: right in the vertices. Phong: right in every pixel."""
    scene, points, faces = plane(LIGHTS[name])
    frame = rz.render(scene, SIZE, shading=shading, tolerance=0, outputs=("color", "face"), samples=1)
    rows, columns = np.nonzero(frame.face >= 0)
    if shading == "flat":
        where = points[faces].mean(axis=1)[frame.face[rows, columns]]
    else:
        where = np.stack([columns, rows], axis=1) + 0.5
    if shading == "gouraud":
        is_vertex = (columns % STEP == 0) & (rows % STEP == 0)
        rows, columns, where = rows[is_vertex], columns[is_vertex], where[is_vertex]
    expected, edge = closed_form(LIGHTS[name], place_of(where))
    off = np.abs(frame.color[rows, columns] - expected).max(axis=-1)
    off = off[np.broadcast_to(edge > 1e-12, off.shape)]
    assert len(off) > 80 and off.max() <= 1e-6, f"{off.max():.3g} > 1e-6, {len(off)} places"
    assert np.ptp(expected) > 0.002 or name == "directional"
