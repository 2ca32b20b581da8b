"""Engine and reference compared, for what registries.py registers: at points and on meshes that never change.

In:  a class whose word stands in the tables already.
Out: nothing, or a SceneError that names the first point at which both disagree, and both values; or the bound that does
     not hold, and where.
"""

from collections.abc import Iterable, Sequence
from types import SimpleNamespace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .engine.formulas import light_at, reflected_at
from .engine.lights import entry_of
from .errors import SceneError
from .reference.lamp import lamp_type_of, make_lamps
from .reference.reflection import REFERENCE_MODELS, read_materials
from .scene.camera import Camera, View
from .scene.lights import Field
from .scene.material import Material
from .scene.mesh import Mesh

Array: TypeAlias = NDArray[np.float64]

N_POINT = 96
BUDGETS = {"float64": 1e-9, "float32": 2e-3}  # of the largest value, or of 1 where all are smaller
STEP = 1e-5  # radians and scene units, by which points are turned and moved where a bound is looked at
SLACK = 1e-3  # of a bound: what differences of values err by


# ---------------------------------------------------------------- lights


def make_examples(cls: type, described: dict[str, Field], n: int = 4) -> list[Any]:
    """Make lights of a class: the first with its defaults, the others with all fields that can be made up.

    Raises SceneError where none can be made.
    """
    dice, found, fault = np.random.default_rng(7), [], None
    for attempt in range(16 * n):
        is_plain = attempt < 8 and not found
        settings = {
            name: _make_up(field, dice)
            for name, field in described.items()
            if field.holds != "shadow" and (field.is_needed or not is_plain)
        }
        try:
            found.append(cls(**settings))
        except SceneError as refused:
            fault = refused
        if len(found) == n:
            break
    if not found:
        raise SceneError(
            f"no {cls.__name__} can be made up to compare engine and reference with: give examples ({fault})"
        )
    return found


def _make_up(field: Field, dice: np.random.Generator) -> Any:
    """Return a value that a field may hold."""
    made = {
        "number": lambda: float(dice.uniform(0.3, 2.0)),
        "whole": lambda: int(dice.integers(1, 5)),
        "flag": lambda: bool(dice.integers(2)),
        "text": lambda: "",
        "word": lambda: field.words[dice.integers(len(field.words))],
        "vector": lambda: tuple(dice.normal(size=3).tolist()),
        "cells": lambda: (2, 3),
        "color": lambda: tuple(dice.uniform(0.1, 1.0, 3).tolist()),
        "attenuation": lambda: tuple(dice.uniform(0.1, 1.0, 3).tolist()),
    }
    return made[field.holds]()


def compare_light(word: str, examples: Iterable[Any]) -> None:
    """Compare what arrives of lights."""
    view = Camera.perspective((1.5, -2.0, 4.0), (0.2, 0.1, -0.3)).view()
    dice = np.random.default_rng(11)
    points, normals = spread_points(dice)
    for light in examples:
        expected = _sums(_arrivals(light, points, normals, view), len(points))
        for dtype, budget in BUDGETS.items():
            found = _engine_sums(light, points, normals, view, np.dtype(dtype))
            for name in ("ambient share", "light that arrives"):
                at = _first_difference(found[name], expected[name], budget)
                if at is not None:
                    raise SceneError(
                        f"the light {word!r}: engine and reference disagree at {_place(points[at], normals[at])} of "
                        f"{light}: the {name} is {_numbers(found[name][at])} by the engine in {dtype}, "
                        f"{_numbers(expected[name][at])} by the reference"
                    )
        _check_light_bound(word, light, points, normals, view, dice)


def spread_points(dice: np.random.Generator) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return points (n, 3) at many distances from the origin, and unit normals (n, 3), also along the axes."""
    points, normals = dice.normal(size=(2, N_POINT, 3))
    points *= (np.geomspace(0.05, 50.0, N_POINT) / np.linalg.norm(points, axis=1))[:, None]
    normals[:6] = [*np.eye(3), *-np.eye(3)]
    return dice.permutation(points), normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _engine_sums(light: Any, points: Array, normals: Array, view: View, dtype: np.dtype) -> dict[str, Array]:
    """Return what arrives of all parts of a light, by the compiled formulas."""
    parts = []
    for part in entry_of(light).expand(light):
        light_dirs, strength = light_at(part, points, normals, view, dtype)
        parts.append((np.array(part.color, np.float64), light_dirs, strength.astype(np.float64)))
    return _sums(parts, len(points))


def _sums(arrivals: list[tuple], n: int) -> dict[str, Array]:
    """Return the ambient share (n, 3), and strength times direction times colour (n, 3, 3), of what arrives."""
    sums = {"ambient share": np.zeros((n, 3)), "light that arrives": np.zeros((n, 3, 3))}
    for color, light_dirs, strength in arrivals:
        if light_dirs is None:
            sums["ambient share"] += strength[:, None] * color
        else:
            sums["light that arrives"] += strength[:, None, None] * light_dirs[:, :, None] * color
    return sums


def _arrivals(light: Any, points: Array, normals: Array, view: View) -> list[tuple]:
    """Return colour (3,), directions (n, 3) or None, and strength (n,) of what arrives of a light, by the reference."""

    def channels(color: object) -> NDArray:
        return np.array(color, np.float64)

    found = []
    for lamp in make_lamps([light], view, channels):
        for color, light_dirs, strength in lamp_type_of(light).arrivals(lamp, points, normals, channels):
            found.append((color, light_dirs, np.ones(len(points)) if strength is None else strength[:, 0]))
    return found


def _check_light_bound(
    word: str, light: Any, points: Array, normals: Array, view: View, dice: np.random.Generator
) -> None:
    """Refuse a bound that the reference goes beyond: at the points, and where they are moved or turned a little."""
    bound = light.bound()
    if bound is None:
        return
    here = _arrivals(light, points, normals, view)
    moved = _arrivals(light, points + STEP * _units(dice), normals, view)
    turned = _arrivals(light, points, _turned(normals, dice), view)
    for (_, light_dirs, strength), (_, dirs_moved, strength_moved), (_, _, strength_turned) in zip(
        here, moved, turned, strict=True
    ):
        slopes = [
            ("strength", strength, bound.strength),
            ("normal", np.abs(strength_turned - strength) / STEP, bound.normal),
            ("position", np.abs(strength_moved - strength) / STEP, bound.position * bound.strength),
        ]
        if light_dirs is not None:
            slopes.append(("position", np.linalg.norm(dirs_moved - light_dirs, axis=1) / STEP, bound.position))
        for name, found, stated in slopes:
            at = int(np.argmax(found))
            if found[at] > stated * (1.0 + SLACK) + SLACK * (name != "strength"):
                raise SceneError(
                    f"the light {word!r}: the bound says {name}={stated:.6g}; at {_place(points[at], normals[at])} of "
                    f"{light} it is {found[at]:.6g}"
                )


# ---------------------------------------------------------------- reflection models


def compare_reflection(word: str, cls: Any) -> None:
    """Compare D and S of a reflection model."""
    dice = np.random.default_rng(13)
    _, normals = spread_points(dice)
    light_dirs, view_dirs = _units(dice), _units(dice)
    light_dirs *= np.where((light_dirs * normals).sum(axis=1) < 0.1, -1.0, 1.0)[:, None]  # most are before the surface
    view_dirs *= np.where((view_dirs * normals).sum(axis=1) < 0.0, -1.0, 1.0)[:, None]
    least = max(0.3, cls.model.least_roughness)
    for roughness, shininess, levels in ((1.0, 32.0, 4), (least, 5.5, 2)):
        material = Material(reflection=word, roughness=roughness, shininess=shininess, levels=levels, specular=0.5)
        expected = _reference_reflection(word, material, normals, light_dirs, view_dirs)
        n_dot_l = (normals * light_dirs).sum(axis=1)
        expected = np.where(n_dot_l[:, None] > 0.0, expected, 0.0)
        for dtype, budget in BUDGETS.items():
            found = reflected_at(material, normals, light_dirs, view_dirs, np.dtype(dtype))
            at = _first_difference(found, expected, budget)
            if at is not None:
                raise SceneError(
                    f"the reflection model {word!r}: engine and reference disagree at N = {_numbers(normals[at])}, "
                    f"L = {_numbers(light_dirs[at])}, V = {_numbers(view_dirs[at])}, shininess {shininess:g}, "
                    f"roughness {roughness:g}: D and S are {_numbers(found[at])} by the engine in {dtype}, "
                    f"{_numbers(expected[at])} by the reference"
                )
        if cls.bound is not None:
            _check_reflection_bound(word, cls.bound, material, expected, (normals, light_dirs, view_dirs), dice)


def _reference_reflection(word: str, material: Material, *vectors: Array) -> Array:
    """Return D and S (n, 2) by the reference; `vectors` are N, L and V, (n, 3) each."""
    scene: Any = SimpleNamespace(meshes=[SimpleNamespace(palette=(material,))], lights=())
    n = len(vectors[0])
    diffuse, specular, _ = REFERENCE_MODELS[word].function(
        np.repeat(read_materials(scene), n), *vectors, np.zeros((n, 3))
    )
    return np.stack([np.broadcast_to(part, n) for part in (diffuse, specular)], axis=1)


def _check_reflection_bound(
    word: str, bound: Any, material: Material, here: Array, vectors: Sequence[Array], dice: np.random.Generator
) -> None:
    """Refuse a bound that the reference goes beyond; `here` is D and S at N, L and V."""
    normals, light_dirs, view_dirs = vectors
    n_dot_l = (normals * light_dirs).sum(axis=1)
    turned = (
        _reference_reflection(word, material, _turned(normals, dice), light_dirs, view_dirs),
        _reference_reflection(word, material, normals, _turned(light_dirs, dice), view_dirs),
    )
    is_lit = (n_dot_l > 2.0 * STEP)[:, None]
    slopes = np.max([np.abs(part - here) / STEP for part in turned], axis=0)
    for name, found, stated in (
        ("D <= 1", here[:, :1], 1.0),
        (f"highlight={bound.highlight:g}", here[:, 1:], bound.highlight),
        (f"turn={bound.turn:g}", slopes, bound.turn),
    ):
        largest = np.where(is_lit, found, 0.0).max(axis=1)
        at = int(np.argmax(largest))
        if largest[at] > stated * (1.0 + SLACK):
            raise SceneError(
                f"the reflection model {word!r}: the bound says {name}; at N = {_numbers(normals[at])}, "
                f"L = {_numbers(light_dirs[at])}, V = {_numbers(view_dirs[at])} it is {largest[at]:.6g}"
            )


# ---------------------------------------------------------------- buffers


def compare_buffer(name: str, buffer: Any) -> None:
    """Compare a buffer's values on small meshes, open, closed and curved; one with a kernel of its own in a picture."""
    if buffer.write is not None:
        _compare_pixels(name, buffer)
        return
    for what, mesh in make_meshes().items():
        found, expected = buffer.values_of(mesh), buffer.reference_values_of(mesh)
        found = found.reshape(expected.shape)
        at = _first_difference(found.reshape(mesh.n_face, -1), expected.reshape(mesh.n_face, -1), BUDGETS["float64"])
        if at is None:
            continue
        where = f"face {at}"
        if not buffer.is_label:
            corner = int(np.argmax(np.abs(found[at] - expected[at]).max(axis=-1)))
            where += f", corner {corner}, at {_numbers(mesh.vertices[mesh.faces[at, corner]])}"
            found, expected = found[:, corner], expected[:, corner]
        raise SceneError(
            f"the buffer {name!r}: engine and reference disagree on {what}, {where}: values gives "
            f"{_numbers(found[at])}, reference_values {_numbers(expected[at])}"
        )


def make_meshes() -> dict[str, Mesh]:
    """Make the meshes that buffers are compared on."""
    dice = np.random.default_rng(17)
    tetrahedron = Mesh([(1, 1, 1), (-1, -1, 1), (-1, 1, -1), (1, -1, -1)], [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])
    u, v = np.meshgrid(np.arange(5.0), np.arange(4.0), indexing="ij")
    sheet = np.stack([u, v, dice.normal(scale=0.4, size=u.shape)], axis=-1).reshape(-1, 3)
    corner = (4 * np.arange(4)[:, None] + np.arange(3)).ravel()
    squares = np.stack([corner, corner + 4, corner + 5, corner + 1], axis=1)
    triangles = np.concatenate([squares[:, [0, 1, 2]], squares[:, [0, 2, 3]]])
    angles, rings = np.arange(8) * np.pi / 4, np.arange(1, 6) * np.pi / 6
    round_about = [(np.sin(r) * np.cos(a), np.cos(r), np.sin(r) * np.sin(a)) for r in rings for a in angles]
    ball = np.array([(0, 1, 0), *round_about, (0, -1, 0)], float)
    belt = [
        (8 * r + a + 1, 8 * r + (a + 1) % 8 + 1, 8 * (r + 1) + (a + 1) % 8 + 1, 8 * (r + 1) + a + 1)
        for r in range(4) for a in range(8)
    ]  # fmt: skip
    caps = [(0, (a + 1) % 8 + 1, a + 1) for a in range(8)] + [(41, 33 + a, 33 + (a + 1) % 8) for a in range(8)]
    halves = [half for a, b, c, d in belt for half in ((a, b, c), (a, c, d))]
    return {"a tetrahedron": tetrahedron, "a sheet": Mesh(sheet, triangles), "a ball": Mesh(ball, caps + halves)}


def _compare_pixels(name: str, buffer: Any) -> None:
    """Compare a buffer in a small picture."""
    from .reference import render as render_slowly
    from .renderer import render
    from .scene.scene import Scene

    camera = Camera.perspective((3.0, 2.0, 4.0))
    scene = Scene([make_meshes()["a ball"]], camera=camera)
    found = render(scene, size=(24, 18), shading="flat", outputs=(name,), samples=1, threads=1).array(name)
    expected = np.asarray(buffer.reference_pixels(render_slowly(scene, (24, 18), shading="flat")))
    shape = found.shape
    if expected.shape != shape:
        raise SceneError(f"the buffer {name!r}: reference_pixels must be {shape}; given {expected.shape}")
    at = _first_difference(found.reshape(18 * 24, -1), expected.reshape(18 * 24, -1), 1e-6)
    if at is not None:
        row, column = divmod(at, 24)
        raise SceneError(
            f"the buffer {name!r}: engine and reference disagree at pixel ({column}, {row}) of a ball: "
            f"{_numbers(found[row, column])} by the engine, {_numbers(expected[row, column])} by the reference"
        )


# ---------------------------------------------------------------- what all of them use


def _first_difference(found: NDArray, expected: NDArray, budget: float) -> int | None:
    """Return the first row in which two arrays differ by more than `budget` of the largest number; None without one."""
    flat, other = found.reshape(len(found), -1).astype(float), expected.reshape(len(expected), -1).astype(float)
    finite = np.abs(other[np.isfinite(other)])
    scale = max(1.0, float(finite.max(initial=0.0)))
    is_near = np.isclose(flat, other, rtol=0.0, atol=budget * scale, equal_nan=True)
    differs = np.flatnonzero(~is_near.all(axis=1))
    return int(differs[0]) if len(differs) else None


def _units(dice: np.random.Generator) -> NDArray[np.float64]:
    """Return unit vectors (n, 3)."""
    vectors = dice.normal(size=(N_POINT, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def _turned(vectors: NDArray, dice: np.random.Generator) -> NDArray[np.float64]:
    """Return unit vectors (n, 3) turned by STEP, each to some side."""
    side = np.cross(vectors, _units(dice))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    return vectors * np.cos(STEP) + side * np.sin(STEP)


def _place(point: NDArray, normal: NDArray) -> str:
    """Return a point with its normal, as text."""
    return f"the point {_numbers(point)} with the normal {_numbers(normal)}"


def _numbers(values: Sequence[float] | NDArray | float) -> str:
    """Return one number, or some in brackets, as text."""
    flat = np.ravel(values)
    text = ", ".join(f"{value:.6g}" for value in flat)
    return text if len(flat) == 1 else f"({text})"
