"""The illumination equation at points, without a picture: for a notebook, a plot, or a test of one's own."""

from collections.abc import Iterable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..compiler.kernels import batch_function
from ..errors import SceneError, shown
from ..options import Options
from ..pipeline import fragments as f
from ..pipeline import material_coefficients as m
from ..pipeline.lighting import SurfacePoints, light_points
from ..pipeline.lights import N_LIGHT_COEFFICIENT
from ..pipeline.transform import Screen
from ..scene.arrays import VectorLike, plain_array
from ..scene.camera import Camera, View
from ..scene.lights import Light, checked_lights
from ..scene.material import Material
from ..scene.validate import unit3, vector3
from . import lights as light_table
from . import reflections as reflection_table
from .plan import make_plan
from .scene_tables import SceneTables
from .uniforms import light_view, make_lighting


def illuminate(
    points: ArrayLike,
    normals: ArrayLike,
    material: Material | str,
    lights: Light | Iterable[Any],
    viewer: VectorLike | Camera | None = None,
    *,
    toward_viewer: VectorLike | None = None,
    tangents: ArrayLike | None = None,
    two_sided: bool = False,
    exposure: float = 0.0,
    spectral: int | None = None,
) -> NDArray[np.float64]:
    """Evaluate the illumination equation at points of a surface, by the code that renders, in float64.

    I = ke + ka·Ia + Σ f_att f_spot Ip [kd D + ks W h], summed over the lights; see `Material` for D, W and h.

    Parameters
    ----------
    points : (..., 3) numbers, world space, scene units
    normals : (..., 3) numbers of any length above 0, world space; the shapes of both are broadcast
    material : Material, or the name of one (see `Material.named`); without a texture
    lights : one light or a sequence of them; area lights as in a picture; shadows have no part, as nothing is there to
        cast them
    viewer : three numbers, the eye's position in the world; or a Camera, without perspective at infinity
    toward_viewer : three numbers in place of `viewer`: the direction from the surface to an eye at infinity, of any
        length
    tangents : (..., 3) numbers, world space, the direction in which u grows; needed by materials that are brushed along
        u
    two_sided : bool, turn normals that look away from the viewer, as pictures do; else the normals are taken as they
        are
    exposure : stops by which light is multiplied, 2^exposure
    spectral : number of samples of 380..780 nm, 3 to 401; None = 81 where a light or the material has a Spectrum, else
        RGB

    Returns
    -------
    (..., 3) float64, linear RGB, not clamped; a white Lambertian surface facing a light of intensity 1 has 1

    Raises
    ------
    SceneError : shapes that don't fit, values that are not finite, normals without length, no viewer or two, lights
        that move with a camera where the viewer is none, a texture
    """
    material = Material.named(material) if isinstance(material, str) else material
    if not isinstance(material, Material):
        raise SceneError(f"the material must be a Material, or the name of one; given {shown(material)}")
    if material.texture is not None:
        raise SceneError("the material must have no texture: points have no texture coordinates")
    if not isinstance(two_sided, (bool, np.bool_, int)):
        raise SceneError(f"two_sided must be True or False; given {shown(two_sided)}")
    if points is None or normals is None:
        raise SceneError("points and normals must be (..., 3) finite numbers; given None")
    points, normals, tangents, shape = _checked_points(points, normals, tangents)
    view, is_perspective = _look_from(viewer, toward_viewer)
    lights = checked_lights(lights)
    for i, light in enumerate(lights):
        if light_table.is_carried(light) and not isinstance(viewer, Camera):
            raise SceneError(f"light {i} moves with the camera: the viewer must be a Camera")
    lights = [replace(light, shadow=None) if light_table.shadow_of(light) else light for light in lights]
    options = Options(tolerance=0.0, exposure=exposure, spectral=spectral)
    bounds = np.zeros((2, 3))
    meshes = (SimpleNamespace(palette=(material,), uv=None, colors=None, face_colors=None, bounds=bounds),)
    tables = SceneTables(SimpleNamespace(meshes=meshes, lights=lights, background=None, depth_cue=None), options)
    plan = make_plan(tables, options, np.zeros(tables.is_lit.shape))
    if plan.has_tangents and tangents is None:
        raise SceneError("a material brushed along u needs tangents, (..., 3); or give its tangent as an axis")
    lighting = light_view(make_lighting(plan, plan.dtype), plan, view)
    # Of a screen lighting reads the eye and the axis along which it looks.
    screen = Screen(view.eye, view.right, view.up, view.forward, view.right, *[1.0] * 9, is_perspective)
    tangents = tangents if plan.has_tangents else None
    n, side = len(points), 0 if two_sided else 1
    surface = SurfacePoints(points, normals, tangents, np.empty((0, 3)), np.empty((2, 0)))
    found = np.empty((n, plan.n_channel))
    light_points(surface, np.arange(n), screen, side, lighting, 0, np.zeros(f.BATCH_SHAPE, plan.dtype), found)
    if plan.n_channel == 1:  # the plan's tint is float32, as a picture needs no more
        found = found * tables.tint_of(0)
    return found.reshape(shape)


def _checked_points(points, normals, tangents):
    """Points, unit normals and tangents, if any are given, as (n, 3) float64, and the shape that they had."""
    given = {"points": points, "normals": normals} | ({} if tangents is None else {"tangents": tangents})
    arrays = [_vectors(value, name) for name, value in given.items()]
    try:
        arrays = np.broadcast_arrays(*arrays)
    except ValueError:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in zip(given, arrays, strict=True))
        raise SceneError(f"the shapes of points and normals must fit each other; given {shapes}") from None
    points, normals, *rest = (np.ascontiguousarray(array.reshape(-1, 3)) for array in arrays)
    largest = np.abs(normals).max(axis=1, keepdims=True, initial=0.0)
    if (largest == 0.0).any():
        raise SceneError("normals must have a length; given a zero vector")
    # Dividing by the largest component first keeps the squares from over- and underflowing.
    normals = normals / largest
    normals = normals / np.sqrt((normals * normals).sum(axis=1, keepdims=True))
    return points, normals, rest[0] if rest else None, arrays[0].shape


def _vectors(value, name) -> np.ndarray:
    """An array (..., 3) of finite float64."""
    try:
        array = plain_array(value)
        array = array.astype(np.float64) if array.dtype.kind in "fiu" else np.empty(0)
    except SceneError:
        raise
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.ndim == 0 or array.shape[-1] != 3 or not np.isfinite(array).all():
        raise SceneError(f"{name} must be (..., 3) finite numbers; given {shown(value)}")
    return array


def _look_from(viewer, toward_viewer):
    """The view, as far as lighting reads it, and whether the viewer has a place."""
    if (viewer is None) == (toward_viewer is None):
        raise SceneError("give either viewer (a place, or a Camera) or toward_viewer (a direction)")
    if isinstance(viewer, Camera):
        return viewer.view(), viewer.is_perspective
    axes = np.eye(3)
    if viewer is not None:
        return View(np.array(vector3(viewer, "the viewer")), axes[0], axes[1], -axes[2]), True
    back = np.array(unit3(toward_viewer, "the direction toward_viewer"))
    return View(np.zeros(3), axes[0], axes[1], -back), False


# ---------------------------------------------------------------- one light, and one reflection model
#
# What arrives of a light at points, and what a material reflects there, by the compiled functions alone, in float64: so
# registration compares them with the reference (agreement.py).


def light_at(part: Any, points: NDArray, normals: NDArray, view: View) -> tuple[NDArray | None, NDArray]:
    """Return what arrives of a light that has a function, computed in float64.

    Parameters
    ----------
    part : one of what `LightEntry.expand` returns
    points, normals : (n, 3) float64, world space, n <= BATCH_SIZE; the normals are unit vectors

    Returns
    -------
    light_dirs : (n, 3) float64, unit vectors to the light; None of an ambient share
    strength : (n,) float64

    Raises
    ------
    SceneError : the function can't be compiled
    """
    entry, row = light_table.entry_of(part), np.zeros(N_LIGHT_COEFFICIENT)
    function = entry.function(part)
    entry.write(row, part, view, row.dtype)
    # A function that says it needs no position, and reads it, gets no number.
    position = points - view.eye if entry.needs_position else np.full(points.shape, np.nan)
    light_dir = [f.LIGHT_DIR + k * f.NEXT for k in range(3)]
    found = _evaluate(function, row, {f.NORMAL: normals, f.POSITION: position}, [f.STRENGTH, *light_dir])
    return None if entry.is_share else found[:, 1:], found[:, 0]


def reflected_at(material: Any, normals: NDArray, light_dirs: NDArray, view_dirs: NDArray) -> NDArray[np.float64]:
    """Return D and S (n, 2) of a material for a light of strength 1, computed in float64; the vectors are (n, 3)
    float64, unit length.

    Raises
    ------
    SceneError : the function can't be compiled
    """
    entry, row = reflection_table.entry_of(material), np.zeros(m.N_MATERIAL_COEFFICIENT)
    row[m.SHININESS], row[m.ROUGHNESS], row[m.TOON_LEVELS] = material.shininess, material.roughness, material.levels
    row[m.OWN_NUMBERS : m.OWN_NUMBERS + len(material.numbers or ())] = material.numbers or ()
    put = {
        f.NORMAL: normals,
        f.LIGHT_DIR: light_dirs,
        # A function that says it needs no direction to the viewer, and reads it, gets no number.
        f.VIEW_DIR: view_dirs if entry.needs_view else np.full(view_dirs.shape, np.nan),
        f.N_DOT_L: (normals * light_dirs).sum(axis=1),
        f.N_DOT_V: (normals * view_dirs).sum(axis=1),
        f.STRENGTH: np.ones(len(normals)),
        f.SPECULAR: np.zeros(len(normals)),  # stays where there is no highlight
    }
    return _evaluate(entry.function(material), row, put, [f.DIFFUSE, f.SPECULAR])


def _evaluate(function: Any, row: NDArray, put: dict[int, NDArray], asked: list[int]) -> NDArray[np.float64]:
    """Call a batch function, and return the quantities that are asked for, (n, n_asked).

    Parameters
    ----------
    row : the coefficients that it reads
    put : by quantity numbers (n,), or vectors (n, 3), that it finds in its batch
    """
    from numba.core.errors import NumbaError

    batch, n = np.zeros(f.BATCH_SHAPE), len(put[f.NORMAL])
    for quantity, values in put.items():
        for k, column in enumerate(values.T if values.ndim == 2 else [values]):
            batch[int(quantity + k * f.NEXT) :][:n] = column
    try:
        compiled = batch_function(function, batch.dtype)
    except NumbaError as fault:
        lines = [line.strip() for line in str(fault).splitlines() if line.strip()]
        what = f"{function.__module__}.{function.__name__}"
        raise SceneError(f"{what} can't be compiled for {batch.dtype}: {' '.join(lines[:4])}") from fault
    compiled(batch.ctypes.data, n, row.ctypes.data)
    return np.stack([batch[int(quantity) :][:n] for quantity in asked], axis=1)
