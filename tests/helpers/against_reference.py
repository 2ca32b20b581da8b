"""The fast path against the reference, pixel by pixel: help for the tests of the pipeline."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

import rasterizer as rz
from bench.margins import UNITS, clear_pixels, depth_resolution
from helpers.arrays import differences
from rasterizer import reference

EXACT = 1e-6  # promised with tolerance 0, in linear intensity
TEXTURED = 2e-5  # the same where something is textured
NORMAL = 2e-6  # normals are stored as float32
BUFFERS = ("color", "depth", "face", "normal")


class Comparison(NamedTuple):
    """What a comparison found."""

    color: float  # largest difference of linear intensity; premultiplied where surfaces let light through
    normal: float
    depth: float  # relative
    n_compared: int  # covered pixels
    n_ignored: int  # pixels in which two surfaces lie nearer to each other than depth can tell
    n_far: int  # compared pixels whose colour is further off than `limit`


@lru_cache(maxsize=4)
def reference_picture(scene, size, **options) -> reference.Picture:
    """Render the reference's picture; the last ones are kept, because every tolerance is compared with the same one."""
    return reference.render(scene, size, **options)


def compare_with_reference(scene, size, units=UNITS, limit=EXACT, **options) -> Comparison:
    """Render both ways; refuse any difference in coverage, face or depth.

    `units` is what planes of depth may be off, in steps of the z-buffer: half a step for each sample of the
    largest box. Where surfaces let light through, the order of all of them must be clear.
    """
    frame = rz.render(scene, size, outputs=BUFFERS, **{"samples": 1} | options)
    for name in ("tolerance", "threads"):
        options.pop(name, None)
    expected = reference_picture(scene, size, **options)
    is_covered = expected.face >= 0
    assert ((frame.face >= 0) == is_covered).all(), f"{((frame.face >= 0) != is_covered).sum()} samples covered wrongly"
    alpha, textures = (
        np.abs(frame.alpha - expected.alpha).max(),
        [m.texture for mesh in scene.meshes for m in mesh.palette],
    )
    allowed = TEXTURED if any(texture is not None and texture.has_alpha for texture in textures) else EXACT
    assert alpha <= allowed, f"alphas differ by {alpha:.3g} > {allowed:.3g}"

    is_clear = expected.margin > depth_resolution(scene, size, expected.depth, units)
    is_seen = is_covered & is_clear
    wrong = (frame.face != expected.face) & is_seen
    assert not wrong.any(), f"{wrong.sum()} pixels show the wrong face"
    is_safe, n_ignored = is_clear, int((~is_clear).sum())
    if options.get("samples", 1) > 1:
        one = {**options, "samples": 1}
        is_safe = clear_pixels(
            scene, size, options["samples"], lambda grid: reference_picture(scene, grid, **one), units
        )
        n_ignored = int((~is_safe).sum())
    color = color_errors(scene, frame, expected)[is_safe]
    normal = np.abs(frame.normal - expected.normal)[is_seen]
    depth = np.abs(frame.depth[is_seen] / expected.depth[is_seen] - 1)
    assert np.isfinite(frame.color).all(), "a colour is not finite"
    assert not differences(frame.normal[~is_covered], 0) and not differences(np.isinf(frame.depth[~is_covered]), True)
    n_compared = int((is_safe & (expected.alpha > 0)).sum())
    largest = (values.max(initial=0.0) for values in (color, normal, depth))
    return Comparison(*largest, n_compared, n_ignored, int((color > limit).any(axis=-1).sum()))


def color_errors(scene, frame, expected) -> np.ndarray:
    """Return the differences of linear intensity (h, w, 3).

    A straight colour is divided by its alpha, and what rounding did to it with it; and an alpha that is off moves it
    the other way. So where surfaces let light through, premultiplied colours are compared, each by its own alpha.
    """
    if all(material.is_opaque for mesh in scene.meshes for material in mesh.palette):
        return np.abs(frame.color - expected.color)
    frames = ((np.float64(each.color), np.float64(each.alpha)[..., None]) for each in (frame, expected))
    (color, alpha), (of_expected, alpha_of_expected) = frames
    return np.abs(color * alpha - of_expected * alpha_of_expected)


def assert_matches_reference(
    scene, size, budget, ignored=0.002, units=UNITS, normal=NORMAL, far=0.0, **options
) -> Comparison:
    """Refuse a picture whose colours are further than `budget` from the reference's.

    `ignored` is the share of the pixels that may be left out, `far` the share of those compared that may be further
    off: at the edges of shadows, which are drawn with shadow maps, and between texels where a filter jumps.
    """
    found = compare_with_reference(scene, size, units, limit=budget, **options)
    assert found.n_compared > 0, "nothing is covered"
    share = found.n_ignored / (size[0] * size[1])
    assert share <= ignored, f"{options}: {share:.4f} of the pixels ignored > {ignored}"
    message = (
        f"{options}: colours differ by {found.color:.3g} > {budget:.3g} in {found.n_far} of {found.n_compared} pixels"
    )
    assert found.n_far <= far * found.n_compared, message
    assert found.normal <= normal, f"{options}: normals differ by {found.normal:.3g} > {normal:.3g}"
    assert found.depth <= 1e-6, f"{options}: depths differ by {found.depth:.3g} > 1e-6"
    return found
