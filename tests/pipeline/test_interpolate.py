"""Which kinds of records a run of entries shows, and the weights of an exact record's corners."""

from itertools import product

import numpy as np
import pytest

import rasterizer as rz
from rasterizer.pipeline.interpolate import has_exact, has_planes, needs_decoding
from rasterizer.pipeline.visibility import (
    CLEAR,
    IS_EXACT,
    IS_WEIGHTED,
    LEVEL_MASK,
    MAX_RECORDS,
    PAYLOAD_BITS,
    id_payload,
)

NEAR, FAR = 1 << PAYLOAD_BITS, CLEAR - (1 << PAYLOAD_BITS)


def entries(*payloads):
    """At the least and at the largest depth."""
    return [depth + int(payload) for depth in (NEAR, FAR) for payload in payloads]


NUMBERS = (0, 1, MAX_RECORDS - 1)
ENTRIES = {
    "nothing": [int(CLEAR)],
    "level": entries(0, 1, 2, 3, int(LEVEL_MASK) - 1),
    "planes": entries(*(id_payload(number, 0) for number in NUMBERS)),
    "weighted planes": entries(*(id_payload(number, IS_WEIGHTED) for number in NUMBERS)),
    "exact": entries(*(id_payload(number, IS_EXACT) for number in NUMBERS)),
}


def test_what_a_run_of_entries_shows_is_told_by_each_entry():
    for kind, other in product(ENTRIES, ENTRIES):
        for some, more in product(ENTRIES[kind], ENTRIES[other]):
            run, kinds = np.array([some, more, some]), {kind, other}
            assert has_exact(run) == ("exact" in kinds), kinds
            assert has_planes(run) == bool(kinds & {"planes", "weighted planes"}), kinds
            assert needs_decoding(run) == bool(kinds - {"exact", "nothing"}), kinds


def floor(n, material, **attributes) -> rz.Scene:
    """A square floor below the camera and behind it, of n x n squares."""
    across, along = (part.ravel() for part in np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1)))
    vertices = np.stack([60 * across - 30, 0 * across, 30 - 60 * along], axis=1)
    corner = np.arange(n * (n + 1)).reshape(n, n + 1)[:, :-1].ravel()
    faces = np.concatenate(
        [np.stack([corner, corner + 1, corner + n + 2], 1), np.stack([corner, corner + n + 2, corner + n + 1], 1)]
    )
    colors = {name: make(across, along) for name, make in attributes.items()}
    mesh = rz.Mesh(vertices, faces, uv=np.stack([20 * across, 20 * along], axis=1), material=material, **colors)
    lights = [rz.AmbientLight(0.2), rz.DirectionalLight((0.1, -1, -0.3), 0.7)]
    return rz.Scene([mesh], lights, rz.Camera.perspective((0, 1.5, 5), (0, 0.5, 0), fov=50))


@pytest.mark.parametrize("shading", ["gouraud", "phong"])
@pytest.mark.parametrize("look", ["coloured", "trilinear"])
def test_a_clipped_floor_is_the_diced_one(look, shading):
    """Two triangles that reach behind the camera are interpolated exactly, many small ones as a rule by planes. What is
    linear over the floor is the same for both."""
    if look == "coloured":
        frames = drawn(rz.Material(specular=0.0), shading, colors=lambda u, v: np.stack([u, v, 0.5 + 0 * u], axis=1))
    else:
        texels = (np.indices((64, 64)).sum(axis=0) // 16 % 2 * 100 + 100).astype(np.uint8)
        frames = drawn(rz.Material(texture=rz.Texture(texels, filter="trilinear"), specular=0.0), shading)
    large, small = (frame.color for frame in frames)
    shown = (frames[0].face >= 0) & (frames[1].face >= 0)
    difference = np.abs(large - small).max(axis=2)[shown]
    assert shown.mean() > 0.5 and np.ptp(large[shown]) > 0.1
    budget = sum(frame.stats.error_bound for frame in frames)
    assert difference.max() <= budget, f"{difference.max():.3g} > {budget:.3g}"


def drawn(material, shading, **attributes):
    """The floor as two triangles, and as many."""
    options = {"shading": shading, "samples": 1, "threads": 1, "outputs": ("color", "face")}
    return [rz.render(floor(n, material, **attributes), (64, 36), **options) for n in (1, 32)]
