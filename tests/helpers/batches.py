"""Call one light function or reflection function on points of a test's own, outside any scene."""

import ctypes

import numpy as np

from rasterizer.compiler.kernels import row_function
from rasterizer.pipeline import fragments as r
from rasterizer.pipeline.reflection import (
    BRUSH,
    FRESNEL,
    LEVELS,
    N_MATERIAL_NUMBER,
    REFLECTIONS,
    ROUGHNESS,
    ROUGHNESS_ACROSS,
    SCALE,
    SHININESS,
)

DTYPES = [np.float32, np.float64]
WRITTEN = (r.DIFFUSE, r.SPECULAR)
NUMBERS = {ROUGHNESS: 0.3, ROUGHNESS_ACROSS: 0.5, BRUSH: 1.0, FRESNEL: 0.04, SCALE: 0.0, LEVELS: 3.0}


def call(function, rows, n, numbers):
    """Call a compiled row function."""
    compiled = row_function(function, rows.dtype)
    number = ctypes.POINTER(ctypes.c_float if rows.dtype == np.float32 else ctypes.c_double)
    compiled.ctypes(rows.ctypes.data_as(number), n, numbers.ctypes.data_as(number))


def take(rows, first, n):
    """The numbers of n points, of as many rows as `first` has."""
    return np.stack([rows[int(row) : int(row) + n] for row in first]).astype(np.float64)


def dot(a, b):
    """Dot products of rows in the type they have, added in the order in which the kernels do."""
    return a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2]


def directions_of(dtype, *vectors):
    """Directions (n, 3) or (3,), brought to one shape (n, 3), rounded to `dtype` as in the rows."""
    return [np.atleast_2d(v).astype(dtype) for v in np.broadcast_arrays(*np.atleast_2d(*vectors))]


def reflect(model, normal, to_light, to_viewer, strength=1.0, shininess=8.0, has_kernels_cosines=False, given=NUMBERS):
    """Evaluate a reflection model in the directions' type; return DIFFUSE and SPECULAR (2, n) float64.

    Directions (n, 3) have been rounded by `directions_of`. N·L and N·V are rounded once, so that what is
    measured is the model's own error, or come about as the lights and the kernels find them.
    """
    dtype, (n, results) = normal.dtype, (len(normal), [])
    kind = dtype if has_kernels_cosines else float
    cosines = [dot(normal.astype(kind), side.astype(kind)) for side in (to_light, to_viewer)]
    numbers = np.zeros(N_MATERIAL_NUMBER, dtype)
    numbers[SHININESS] = shininess
    numbers[list(given)] = list(given.values())
    first = (r.NORMAL_X, r.NORMAL_Y, r.NORMAL_Z, r.LIGHT_X, r.LIGHT_Y, r.LIGHT_Z)
    first += (r.VIEW_X, r.VIEW_Y, r.VIEW_Z, r.N_DOT_L, r.N_DOT_V, r.STRENGTH)
    columns = [*normal.T, *to_light.T, *to_viewer.T, *cosines, np.full(n, strength)]
    for start in range(0, n, r.CHUNK):
        rows = r.make_rows(dtype)
        rows[:] = np.nan  # nothing may be taken over from before
        rows[int(r.TANGENT_X) : int(r.TANGENT_X) + 3 * r.CHUNK] = np.repeat((3.0, 0.0, -1.0), r.CHUNK)
        part = [column[start : start + r.CHUNK] for column in columns]
        for row, values in zip(first, part, strict=True):
            rows[int(row) : int(row) + len(values)] = values
        call(REFLECTIONS[model].row_function, rows, len(part[0]), numbers)
        results.append(take(rows, WRITTEN, len(part[0])))
    return np.concatenate(results, axis=1)


def unit(vectors):
    """Vectors (n, 3), scaled to unit length in float64."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def random_directions(seed, n, dtype):
    """Normals, directions to the light and to the viewer, (n, 3) each."""
    return directions_of(dtype, *unit(np.random.default_rng(seed).normal(size=(3, n, 3))))


def polar(cosine, azimuth=0.0):
    """The direction with this cosine to the z axis."""
    sine = np.sqrt(1 - cosine * cosine)
    return sine * np.cos(azimuth), sine * np.sin(azimuth), cosine


UP = (0.0, 0.0, 1.0)
