"""Engine and reference compared, for what registries.py registers: at points that never change.

In:  a class whose word stands in the tables already.
Out: nothing, or a SceneError that names the first place at which both disagree, and both values.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .engine.lights import entry_of
from .engine.point_lighting import light_at, reflected_at
from .errors import SceneError
from .reference.lamp import lamp_type_of, make_lamps
from .reference.reflection import REFERENCE_MODELS, read_materials
from .scene.camera import Camera
from .scene.lights import Field
from .scene.material import Material

PlaceOf = Callable[[int], str]  # from the row of an array to the words for where that is

N_POINT = 96
BUDGET = 1e-9  # of the largest value, or of 1 where all are smaller


def check_same(whose: str, found: NDArray, expected: NDArray, place_of: PlaceOf, words: str) -> None:
    """Refuse a row in which two arrays differ by more than `BUDGET` of the largest number.

    Parameters
    ----------
    whose : what is registered, as text
    found, expected : (n, ...) numbers, by the engine and by the reference
    words : with braces for both values
    """
    found, expected = (np.reshape(part, (len(part), -1)).astype(float) for part in (found, expected))
    scale = max(1.0, float(np.abs(expected[np.isfinite(expected)]).max(initial=0.0)))
    is_near = np.isclose(found, expected, rtol=0.0, atol=BUDGET * scale, equal_nan=True)
    for k in np.flatnonzero(~is_near.all(axis=1)).tolist():
        values = words.format(_numbers(found[k]), _numbers(expected[k]))
        raise SceneError(f"{whose}: engine and reference disagree {place_of(k)}: {values}")


# ---------------------------------------------------------------- lights


def make_examples(cls: type, described: dict[str, Field]) -> list[Any]:
    """Make up to four lights of a class, with defaults and with all fields that can be made up.

    Raises SceneError where none can be made.
    """
    dice, found, fault = np.random.default_rng(7), [], None
    for attempt in range(64):
        settings = {
            name: _make_up(field, dice)
            for name, field in described.items()
            if field.holds != "shadow" and (field.is_needed or attempt % 4 > 0)
        }
        try:
            found.append(cls(**settings))
        except SceneError as refused:
            fault = refused
    if not found:
        what = "can be made up to compare engine and reference with"
        raise SceneError(f"no {cls.__name__} {what}: give examples ({fault})")
    return found[:4]


def _make_up(field: Field, dice: np.random.Generator) -> Any:
    """Return a value that a field may hold."""
    triple = tuple(dice.uniform(0.1, 1.0, 3).tolist())
    made = {
        "number": float(dice.uniform(0.3, 2.0)),
        "whole": int(dice.integers(1, 5)),
        "flag": bool(dice.integers(2)),
        "text": "",
        "vector": tuple(dice.normal(size=3).tolist()),
        "cells": (2, 3),
        "color": triple,
        "attenuation": triple,
    }
    return dice.choice(field.words).item() if field.holds == "word" else made[field.holds]


def compare_light(word: str, examples: Iterable[Any]) -> None:
    """Compare what arrives of lights."""
    whose, view = f"the light {word!r}", Camera.perspective((1.5, -2.0, 4.0), (0.2, 0.1, -0.3)).view()
    dice = np.random.default_rng(11)
    points, normals = spread_points(dice)
    for light in examples:

        def place_of(k: int, light: Any = light) -> str:
            return f"at the point {_numbers(points[k])} with the normal {_numbers(normals[k])} of {light}"

        here = [
            (color, light_dirs, np.ones(len(points)) if strength is None else strength[:, 0])
            for lamp in make_lamps([light], view, np.array)
            for color, light_dirs, strength in lamp_type_of(light).arrivals(lamp, points, normals, np.array)
        ]
        parts = [(part.color, *light_at(part, points, normals, view)) for part in entry_of(light).expand(light)]
        names = ("ambient share", "light that arrives")
        for name, found, expected in zip(names, _sums(parts), _sums(here), strict=True):
            words = f"the {name} is {{}} by the engine, {{}} by the reference"
            check_same(whose, found, expected, place_of, words)


def _sums(arrivals: list[tuple]) -> tuple[NDArray, NDArray]:
    """Return the ambient share (n, 3), and strength times direction times colour (n, 3, 3), of what arrives."""
    share, directed = np.zeros((N_POINT, 3)), np.zeros((N_POINT, 3, 3))
    for color, light_dirs, strength in arrivals:
        color = strength[:, None] * np.array(color, float)
        if light_dirs is None:
            share += color
        else:
            directed += light_dirs[:, :, None] * color[:, None]
    return share, directed


# ---------------------------------------------------------------- reflection models


def compare_reflection(word: str, cls: Any) -> None:
    """Compare D and S of a reflection model."""
    whose, dice = f"the reflection model {word!r}", np.random.default_rng(13)
    _, normals = spread_points(dice)
    light_dirs, view_dirs = _units(dice), _units(dice)
    light_dirs *= np.where((light_dirs * normals).sum(axis=1) < 0.1, -1.0, 1.0)[:, None]  # most are before the surface
    view_dirs *= np.where((view_dirs * normals).sum(axis=1) < 0.0, -1.0, 1.0)[:, None]
    vectors = normals, light_dirs, view_dirs
    n_dot_l = (normals * light_dirs).sum(axis=1)
    for roughness, shininess, levels in ((1.0, 32.0, 4), (max(0.3, cls.model.min_roughness), 5.5, 2)):
        material = Material(reflection=word, roughness=roughness, shininess=shininess, levels=levels, specular=0.5)
        numbers = [shininess / 32.0 * each for each in material.numbers or ()] or None  # the defaults, then others
        material = replace(material, numbers=numbers)
        settings = f"shininess {shininess:g}, roughness {roughness:g}"

        def place_of(k: int, settings: str = settings) -> str:
            return f"at {', '.join(f'{x} = {_numbers(v[k])}' for x, v in zip('NLV', vectors, strict=True))}, {settings}"

        here = _reflected(material, *vectors)
        found, expected = reflected_at(material, *vectors), np.where(n_dot_l > 0.0, here.T, 0.0).T
        check_same(whose, found, expected, place_of, "D and S are {} by the engine, {} by the reference")


def _reflected(material: Material, *vectors: NDArray) -> NDArray:
    """Return D and S (n, 2) by the reference; `vectors` are N, L and V, (n, 3) each."""
    scene: Any = SimpleNamespace(meshes=[SimpleNamespace(palette=(material,))], lights=())
    records, function = np.repeat(read_materials(scene), N_POINT), REFERENCE_MODELS[material.reflection].function
    diffuse, specular, _ = function(records, *vectors, np.zeros((N_POINT, 3)))
    return np.stack([np.broadcast_to(part, N_POINT) for part in (diffuse, specular)], axis=1)


# ---------------------------------------------------------------- what all of them use


def spread_points(dice: np.random.Generator) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return points (n, 3) at many distances from the origin, and unit normals (n, 3), also along the axes."""
    points = _units(dice) * np.geomspace(0.05, 50.0, N_POINT)[:, None]
    return dice.permutation(points), np.concatenate([np.eye(3), -np.eye(3), _units(dice)[6:]])


def _units(dice: np.random.Generator) -> NDArray[np.float64]:
    """Return unit vectors (n, 3)."""
    vectors = dice.normal(size=(N_POINT, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def _numbers(values: Sequence[float] | NDArray) -> str:
    """Return one number, or some in brackets, as text."""
    flat = np.ravel(values)
    text = ", ".join(f"{value:.6g}" for value in flat)
    return text if len(flat) == 1 else f"({text})"
