"""What arrives of a light at points, and what a material reflects there, by the compiled functions alone: no picture.

So registration compares them with the reference (agreement.py), in either floating-point type.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..compiler.kernels import batch_function
from ..errors import SceneError
from ..pipeline import fragments as f
from ..pipeline import material_coefficients as m
from ..scene.camera import View
from . import lights as light_table
from . import reflections as reflection_table


def light_at(
    part: Any, points: NDArray, normals: NDArray, view: View, dtype: np.dtype
) -> tuple[NDArray | None, NDArray]:
    """Return what arrives of a light that has a function.

    Parameters
    ----------
    part : one of what `LightEntry.expand` returns
    points, normals : (n, 3) float64, world space, n <= BATCH_SIZE; the normals are unit vectors

    Returns
    -------
    light_dirs : (n, 3) of `dtype`, unit vectors to the light; None of an ambient share
    strength : (n,) of `dtype`

    Raises
    ------
    SceneError : the function can't be compiled
    """
    n, batch, entry = len(points), f.make_batch(dtype), light_table.entry_of(part)
    function, row = entry.function(part), np.zeros(light_table.pipeline.N_LIGHT_COEFFICIENT)
    entry.write(row, part, view, dtype)
    row = row.astype(dtype)
    _put(batch, f.NORMAL, normals)
    # A function that says it needs no position, and reads it, gets no number.
    _put(batch, f.POSITION, points - view.eye if function.needs_position else np.full((n, 3), np.nan))
    _compiled(function.evaluate, dtype)(batch.ctypes.data, n, row.ctypes.data)
    light_dirs = np.stack([_get(batch, f.LIGHT_DIR + k * f.NEXT, n) for k in range(3)], axis=1)
    return None if entry.is_share else light_dirs, _get(batch, f.STRENGTH, n)


def reflected_at(
    material: Any, normals: NDArray, light_dirs: NDArray, view_dirs: NDArray, dtype: np.dtype
) -> NDArray[np.float64]:
    """Return D and S (n, 2) of a material for a light of strength 1; the vectors are (n, 3) float64, unit length.

    Raises
    ------
    SceneError : the function can't be compiled
    """
    n, batch = len(normals), f.make_batch(dtype)
    function = reflection_table.entry_of(material).function(material)
    _put(batch, f.NORMAL, normals)
    _put(batch, f.LIGHT_DIR, light_dirs)
    # A function that says it needs no direction to the viewer, and reads it, gets no number.
    _put(batch, f.VIEW_DIR, view_dirs if function.needs_view else np.full((n, 3), np.nan))
    batch[int(f.N_DOT_L) :][:n] = (normals * light_dirs).sum(axis=1)
    batch[int(f.N_DOT_V) :][:n] = (normals * view_dirs).sum(axis=1)
    batch[int(f.STRENGTH) :][:n] = 1.0
    row = np.zeros(m.N_MATERIAL_COEFFICIENT, dtype)
    row[m.SHININESS], row[m.ROUGHNESS], row[m.TOON_LEVELS] = material.shininess, material.roughness, material.levels
    _compiled(function.evaluate, dtype)(batch.ctypes.data, n, row.ctypes.data)
    highlight = _get(batch, f.SPECULAR, n) if function.has_highlight else np.zeros(n)
    return np.stack([_get(batch, f.DIFFUSE, n), highlight], axis=1).astype(np.float64)


def _compiled(function: Any, dtype: np.dtype) -> Any:
    """Return a compiled function; SceneError where it can't be compiled, with what the compiler says."""
    from numba.core.errors import NumbaError

    try:
        return batch_function(function, dtype)
    except NumbaError as fault:
        lines = [line.strip() for line in str(fault).splitlines() if line.strip()]
        what = f"{function.__module__}.{function.__name__}"
        raise SceneError(f"{what} can't be compiled for {dtype}: {' '.join(lines[:4])}") from fault


def _put(batch: NDArray, quantity: int, vectors: NDArray) -> None:
    """Write vectors (n, 3) into a batch."""
    for k in range(3):
        batch[int(quantity + k * f.NEXT) :][: len(vectors)] = vectors[:, k]


def _get(batch: NDArray, quantity: int, n: int) -> NDArray:
    """Return a quantity of n points of a batch."""
    return batch[int(quantity) :][:n]
