"""Call one light function or reflection function on points of a test's own, outside any scene."""

import numpy as np

from rasterizer.compiler.kernels import batch_function
from rasterizer.pipeline import fragments as f
from rasterizer.pipeline import material_coefficients as m
from rasterizer.pipeline import reflection

DTYPES = [np.float32, np.float64]
COEFFICIENTS = {
    m.ROUGHNESS: 0.3,
    m.ROUGHNESS_ACROSS: 0.5,
    m.TANGENT_AXIS: 1.0,
    m.HAS_FRESNEL: 1.0,
    m.HIGHLIGHT_SCALE: 0.0,
    m.TOON_LEVELS: 3.0,
}
REFLECTION_FUNCTIONS = {
    "lambert": reflection.lambert,
    "phong": reflection.phong,
    "blinn": reflection.blinn,
    "oren-nayar": reflection.oren_nayar,
    "ggx": reflection.ggx,
    "ggx of texture": reflection.ggx_of_texture,
    "beckmann": reflection.beckmann,
    "anisotropic ggx": reflection.anisotropic_ggx,
    "anisotropic ggx by axis": reflection.anisotropic_ggx_by_axis,
    "toon": reflection.toon,
}
DIFFUSE = ("lambert", "oren-nayar")  # they have no highlight
CLASSIC = COEFFICIENTS | {m.HAS_FRESNEL: 0.0}  # Phong's and Blinn's highlights, which nothing weighs


def call(function, batch, n, coefficients):
    """Call a compiled light or reflection function."""
    batch_function(function, batch.dtype)(batch.ctypes.data, n, coefficients.ctypes.data)


def axes_of(quantity):
    """The three quantities of a vector."""
    return [int(quantity + axis * f.NEXT) for axis in range(3)]


def read(batch, quantities, n):
    """What n fragments have, (number of quantities, n) float64."""
    return np.stack([batch[int(first) : int(first) + n] for first in quantities]).astype(np.float64)


def write(batch, quantities, rows):
    """Fill quantities of as many fragments as each row has."""
    for first, row in zip(quantities, rows, strict=True):
        batch[int(first) : int(first) + len(row)] = row


def dot(a, b):
    """Dot products of rows in the type they have, added in the order in which the kernels do."""
    return a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2]


def directions_of(dtype, *vectors):
    """Directions (n, 3) or (3,), brought to one shape (n, 3), rounded to `dtype` as in a batch."""
    return [np.atleast_2d(v).astype(dtype) for v in np.broadcast_arrays(*np.atleast_2d(*vectors))]


def reflect(
    model, normal, light_dir, view_dir, strength=1.0, shininess=8.0, has_kernels_cosines=False, given=None, fresnel=0.04
):
    """Evaluate a reflection model in the directions' type; return D and S (2, n) float64, S with W(θ) where it has one.

    Directions (n, 3) have been rounded by `directions_of`. N·L and N·V are rounded once, so that what is
    measured is the model's own error, or come about as the lights and the kernels find them. `given` takes the place of
    COEFFICIENTS, or of CLASSIC.
    """
    dtype, (n, results) = normal.dtype, (len(normal), [])
    kind = dtype if has_kernels_cosines else float
    cosines = [dot(normal.astype(kind), side.astype(kind)) for side in (light_dir, view_dir)]
    material = np.zeros(m.N_REFLECTION_COEFFICIENT, dtype)
    material[m.SHININESS] = shininess
    if given is None:
        given = CLASSIC if model in ("phong", "blinn") else COEFFICIENTS
    material[list(given)] = list(given.values())
    has_fresnel = model not in ("lambert", "oren-nayar", "toon") and material[m.HAS_FRESNEL] > 0.0
    quantities = [*axes_of(f.NORMAL), *axes_of(f.LIGHT_DIR), *axes_of(f.VIEW_DIR), f.N_DOT_L, f.N_DOT_V, f.STRENGTH]
    rows = [*normal.T, *light_dir.T, *view_dir.T, *cosines, np.full(n, strength)]
    for start in range(0, n, f.BATCH_SIZE):
        batch = np.zeros(f.BATCH_SHAPE, dtype)
        batch[:] = np.nan  # nothing may be taken over from before
        write(batch, axes_of(f.TANGENT), np.repeat([[3.0], [0.0], [-1.0]], f.BATCH_SIZE, axis=1))
        write(batch, quantities, [row[start : start + f.BATCH_SIZE] for row in rows])
        n_fragment = min(f.BATCH_SIZE, n - start)
        call(REFLECTION_FUNCTIONS[model], batch, n_fragment, material)
        diffuse, specular, grazing = read(batch, (f.DIFFUSE, f.SPECULAR, f.GRAZING), n_fragment)
        results.append(np.stack([diffuse, fresnel * specular + grazing if has_fresnel else specular]))
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
