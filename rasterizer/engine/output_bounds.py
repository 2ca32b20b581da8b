"""How far each output of a frame may be from the exact one: the record `Stats.error_bounds`.

The colour's bound is that of view_plans.py. The others follow from it, or from float64 and one rounding to float32:

rgb     The sRGB curve is steepest at black: 12.92·255 levels for an intensity of 1. Two numbers that lie d levels apart
        are rounded to levels that lie ⌈d⌉ apart at most. Where colours are divided by the largest one of the picture or
        the pixel, M >= 1, both M and the colour c <= M err by e: (c + e)/(M - e) - c/M, less than 2 e/(M - e).
depth   A depth is the mean of those of the corners, exactly interpolated (pipeline/buffers.py), and rounded to float32:
        u₃₂ of it. A corner's depth is a product of three terms, of differences that are rounded: 5 u√3 < 9 u of its
        distance, F at most; u is float64's. The mean errs by 11 u S with S = |offset| + 2^38 |step| of the line that
        depths, or their inverses in perspective, are of z. Without perspective S is at most 3 F, measured from the
        plane of the eye. With it the line is 1/w, S is at most 3/near with the nearest depth `near` that the z-buffer
        has room for, and d errs by d·(9 F/near + 33 d/near) u.
normal  A component is rounded to float32, u₃₂/2 of 1 where it is next to 1. The mean of the corners' normals turns by
        CORNERS u over its length, and by what 1/w errs, twice; a unit vector adds 10 u (error_bounds.py).
face    An integer: exact, where depth tells which surface is in front.

What shadow maps and texture filters add has no place in these: they are other pictures than those of rays, and of
textures averaged over pixels. It is stated by itself, as lengths next to edges, and as intensities.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from ..pipeline.transform import Screen
from .error_bounds import CORNERS, LEAST_NORMAL, furthest_over_nearest, straight_rounding
from .plan import Plan
from .rounding import DOUBLE, SINGLE

STEEPEST = 12.92 * 255.0  # levels of 8 bits for an intensity of 1, of the sRGB curve at black
MOST_LEVELS = 255


class ShadowBound(NamedTuple):
    """What the shadow maps of a kind of light add to a bound: next to an edge of a shadow there is none.

    Parameters
    ----------
    light : name of the kind; the cells of an area light are point lights
    texel : the largest side of a texel, scene units, on a surface that faces the light, where the scene is furthest
        from it; on one that is turned away from it, as much longer as it is seen shorter from there
    near : how near to an edge of a shadow the bound of the colours doesn't hold, scene units along each side of a
        texel, on such a surface
    """

    light: str
    texel: float
    near: float


class FilterBound(NamedTuple):
    """What a texture filter may add: how far its picture may be from one of the texture averaged over each pixel.

    Parameters
    ----------
    filter : "nearest", "bilinear" or "trilinear"
    most : linear intensity. Each filter shows a mean of texels; so does the average
    near : texels; next to the border between texels that are not blended, the bound of the colours doesn't hold. 0
        where they are blended
    """

    filter: str
    most: float
    near: float


class ErrorBounds(NamedTuple):
    """The largest error of each output of one frame; None for those that were not asked for.

    All but `shadows` and `filters` are errors against the exact evaluation of the same faces at the same samples. A
    buffer of one's own (registries.py) has no bound here.

    Parameters
    ----------
    color : linear intensity where 1 is white; the same number as `Stats.error_bound`. Premultiplied, where surfaces let
        light through and there is no background
    rgb : levels of 8 bits, an integer; of pixels whose alpha is 1
    depth : scene units, at most anywhere in the picture
    depth_share : the same as a share of the depth itself; infinite without perspective where depths may be 0
    normal : of each component of the unit vector
    face : 0, exact: where surfaces lie further apart than depth can tell
    shadows : tuple of ShadowBound, one for each kind of light that casts shadows: what is no part of `color`
    filters : tuple of FilterBound, one for each filter in use: likewise
    """

    color: float | None = None
    rgb: int | None = None
    depth: float | None = None
    depth_share: float | None = None
    normal: float | None = None
    face: int | None = None
    shadows: tuple[ShadowBound, ...] = ()
    filters: tuple[FilterBound, ...] = ()

    def as_json(self) -> dict[str, Any]:
        """Return what was asked for as names and plain numbers; what is infinite as None."""
        asked = {name: value for name, value in self._asdict().items() if value is not None and value != ()}
        return {
            name: [_plain(note) for note in value] if isinstance(value, tuple) else _finite(value)
            for name, value in asked.items()
        }


def _plain(note: ShadowBound | FilterBound) -> dict:
    """Return a note as names and plain numbers."""
    return {name: _finite(value) for name, value in note._asdict().items()}


def _finite(value):
    """Return None for a number that isn't finite: JSON has none."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def bound_levels(error: float, color_range: str) -> int:
    """Return how many levels of 8 bits an error of a linear intensity moves a byte at most."""
    if color_range != "clamp":
        error = 2.0 * error / (1.0 - error) if error < 1.0 else math.inf
    return min(math.ceil(STEEPEST * error), MOST_LEVELS) if math.isfinite(error) else MOST_LEVELS


def bound_depths(screen: Screen, furthest: float, nearest: float) -> tuple[float, float]:
    """Return the largest error of a depth, as a share of the depth and in scene units.

    Parameters
    ----------
    screen : that of the buffers
    furthest : distance of the furthest point from the eye, scene units
    nearest : the least depth of the boxes round the meshes, scene units
    """
    if screen.is_perspective:
        share = SINGLE + 42.0 * DOUBLE * furthest_over_nearest(screen, furthest)
        return share, share * furthest
    shift, least = straight_rounding(furthest), max(nearest, screen.near)
    return SINGLE + shift / least if least > 0.0 else math.inf, SINGLE * furthest + shift


def bound_normals(screen: Screen, furthest: float, shortest: float) -> float:
    """Return the largest error of a component of a normal.

    Parameters
    ----------
    shortest : the least length of a mean of a face's normals; 1 for flat shading
    """
    deep = 4.0 * DOUBLE * furthest_over_nearest(screen, furthest) if screen.is_perspective else 0.0
    turned = (CORNERS * DOUBLE + deep) / max(shortest, LEAST_NORMAL) + 10.0 * DOUBLE
    return min(SINGLE / 2.0 + turned, 2.0)


def bound_filters(plan: Plan) -> tuple[FilterBound, ...]:
    """Return what the filters of a plan's textures may add: all that a texture can change of an intensity."""
    most: dict[str, float] = {}
    for material, bound in zip(plan.materials, plan.reflected.bounds.tolist(), strict=True):
        if material.texture is not None:
            name = material.texture.filter
            most[name] = max(most.get(name, 0.0), bound)
    return tuple(FilterBound(name, most[name], 2.0**-20 if name == "nearest" else 0.0) for name in sorted(most))


def furthest_of(bounds: np.ndarray, eye: np.ndarray) -> float:
    """Return the distance of the furthest corner of the box round all boxes, scene units, from the eye.

    Parameters
    ----------
    bounds : (n_mesh, 2, 3) float64, world space
    """
    return math.hypot(*np.abs(bounds - eye).max(axis=(0, 1)).tolist())
