"""Check anisotropic reflection: its limits, its rotating with the tangent, and pictures in all ways to shade."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.pinhole import octasphere

import rasterizer as rz
from rasterizer.engine.points import gather_geometry
from rasterizer.errors import ModelError, SceneError

LIGHTS = (rz.AmbientLight(0.1), rz.DirectionalLight((-1, -0.4, -1), 0.7), rz.PointLight((2, 3, 3), 0.4, "1/(d+1)"))
BRUSHED = rz.Material(diffuse=0.1, specular=0.05, reflection="cook-torrance", roughness=(0.12, 0.5), fresnel=0.8)


def ball(material, level=2, **more):
    """A ball whose u goes round its axis."""
    vertices, faces = octasphere(level)
    uv = np.stack([np.arctan2(vertices[:, 0], vertices[:, 2]), vertices[:, 1]], axis=1)
    return rz.Scene([rz.Mesh(vertices, faces, uv=uv, material=material)], LIGHTS, **more)


def light_at(normal, light_dir, view_dir, material, tangents=None):
    """One directional light of intensity 1, seen from infinity; the highlight alone."""
    material = replace(material, diffuse=0.0, ambient=0.0)
    light = rz.DirectionalLight(np.negative(light_dir))
    return rz.illuminate((0, 0, 0), normal, material, light, toward_viewer=view_dir, tangents=tangents)[..., 0]


def directions(seed, n):
    """Unit normals, and directions to light and viewer before the surface."""
    normal, *sides = np.random.default_rng(seed).normal(size=(3, n, 3))
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    for k, side in enumerate(sides):
        side = side / np.linalg.norm(side, axis=1, keepdims=True)
        up = (side * normal).sum(axis=1, keepdims=True)
        sides[k] = side + (np.abs(up) - up) * normal
    return normal, *sides


def test_it_rotates_with_the_tangent():
    """Rotating everything changes nothing; rotating the tangent by 90° is exchanging the roughnesses. An axis is a
    tangent; and where none lies in the surface, the mean roughness counts."""
    rng, mean = np.random.default_rng(2), replace(BRUSHED, roughness=float(np.sqrt(0.12 * 0.5)))
    for normal, light_dir, view_dir in zip(*directions(3, 20), strict=True):
        tangent = rng.normal(size=3)
        rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        rotation *= np.sign(np.linalg.det(rotation))
        sides = normal, light_dir, view_dir
        exchanged, as_mean = replace(BRUSHED, roughness=BRUSHED.roughness[::-1]), light_at(*sides, mean)
        found = light_at(*sides, BRUSHED, tangent)
        to_light, to_viewer = normal @ light_dir, normal @ view_dir  # intensity / N·L is reciprocal
        for name, value, wanted in (
            ("rotated", light_at(*(rotation @ side for side in sides), BRUSHED, rotation @ tangent), found),
            ("exchanged", light_at(*sides, exchanged, np.cross(normal, tangent)), found),
            ("back", light_at(normal, view_dir, light_dir, BRUSHED, tangent) / to_viewer, found / to_light),
            ("by axis", light_at(*sides, replace(BRUSHED, tangent=tangent)), found),
            ("an axis that stands upright", light_at(*sides, replace(BRUSHED, tangent=normal)), as_mean),
            ("no tangent", light_at(*sides, BRUSHED, np.zeros(3)), as_mean),
        ):
            assert value == pytest.approx(wanted, rel=1e-9), name


def test_tangents_are_the_directions_in_which_u_grows():
    """On a ball whose u is the azimuth, they run along the circles of latitude."""
    vertices, faces = octasphere(4)
    x, y, z = vertices[faces].transpose(2, 0, 1)
    u = np.arctan2(x, z)
    u = np.where(np.hypot(x, z) < 1e-9, np.nan, u)
    first = np.nanmax(u, axis=1, keepdims=True)
    u = np.where(first - u > np.pi, u + 2 * np.pi, u)  # across the seam
    u = np.where(np.isnan(u), np.nanmean(u, axis=1, keepdims=True), u)
    mesh = rz.Mesh(vertices, faces, uv=np.stack([u, y], axis=-1), material=BRUSHED)
    for is_flat in (False, True):
        geometry = gather_geometry(rz.Scene([mesh]).meshes, is_flat)
        points, tangents = geometry.points, geometry.tangents
        expected = np.stack([points[:, 2], np.zeros(len(points)), -points[:, 0]], axis=1)
        radius = np.linalg.norm(expected, axis=1)
        is_far = radius > 0.3  # from the poles
        cosine = (tangents * expected).sum(axis=1)[is_far] / radius[is_far]
        assert cosine.min() > np.cos(np.radians(6)), f"{is_flat=}: {np.degrees(np.arccos(cosine.min())):.2f}° > 6°"
    assert gather_geometry(ball(rz.Material()).meshes, False).tangents.size == 0


def test_forms_and_refusals():
    assert rz.Material(tangent=(0, 2, 0)).tangent == (0.0, 1.0, 0.0)
    for wrong in ((0.1, 0.2, 0.3), (0.0, 0.5), (0.5, 1.5), ("a", 0.5)):
        with pytest.raises(SceneError, match="roughness"):
            replace(BRUSHED, roughness=wrong)
    for other in ({"reflection": "phong"}, {"distribution": "beckmann"}, {"reflection": "oren-nayar"}):
        with pytest.raises(SceneError, match="'cook-torrance' with 'ggx'"):
            replace(BRUSHED, **other)
    for wrong in ("v", (0, 0, 0), (1, 2), None):
        with pytest.raises(SceneError, match="tangent"):
            rz.Material(tangent=wrong)
    with pytest.raises(ModelError, match="brushed along u .* needs texture coordinates"):
        rz.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], material=BRUSHED)
