"""The picture that is approximated, and how far another one is from it.

The ground truth is Phong's shading at 64 samples a pixel with tolerance 0: nothing is saved. What a picture's error
consists of is found by comparing pictures that save one thing less:

    error     = against the ground truth                             all of it
    method    = against Phong, same samples, tolerance 0             where light is evaluated: polygons, vertices
    sampling  = Phong, same samples, against the ground truth        edges, highlights and textures between samples

Pictures are compared as light on black: colours times the share of a pixel that is covered.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..renderer import Renderer
from ..scene.scene import Scene
from .comparison import delta_e_2000, lab_from_linear, levels_from_linear, root_mean_square
from .packages import require

# ----------------------------------------------------------------
# FLIP: how different two pictures look when one is shown after the other, by its authors' own program.
# Source: Andersson et al. 2020, "FLIP: A Difference Evaluator for Alternating Images", Proc. ACM Comput. Graph.
# Interact.
# Tech. 3(2). The program is the package flip-evaluator.


def check_flip() -> None:
    """Raise SceneError where flip-evaluator isn't installed."""
    require("flip_evaluator", "flip-evaluator", "FLIP")


def flip_map(found: NDArray, expected: NDArray) -> NDArray[np.float32]:
    """Compute FLIP of every pixel, at 67 pixels a degree: a display of 0.7 m and 3840 pixels seen from 0.7 m.

    Parameters
    ----------
    found, expected : (height, width, 3) linear, clamped to 0..1

    Returns
    -------
    (height, width) float32 within 0..1

    Raises
    ------
    SceneError : flip-evaluator isn't installed
    """
    check_flip()
    import flip_evaluator

    pictures = (np.clip(picture, 0.0, 1.0).astype(np.float32) for picture in (expected, found))
    errors, _, _ = flip_evaluator.evaluate(
        *pictures, "LDR", inputsRGB=False, applyMagma=False, computeMeanError=False, parameters={}
    )
    return errors[..., 0]


_FINER = 2  # pixels along each axis of a pixel, of 16 samples each: a grid of 8 x 8


class Light(NamedTuple):
    """A picture as the light that it sends out."""

    color: NDArray[np.float64]  # (height, width, 3) linear; 0 where nothing is
    alpha: NDArray[np.float64]  # (height, width) covered share


class Errors(NamedTuple):
    """How far a picture is from another one, over the pixels that either covers.

    Attributes
    ----------
    max, rms : largest, and root mean square, difference of a channel, in linear intensity where 1 is white
    levels : largest difference of an 8-bit value
    over_one : share of the 8-bit values that are more than one level off
    delta_e : mean colour difference (CIEDE2000); about 1 is just noticed
    flip : mean FLIP, 0 to 1; None where it wasn't asked for
    """

    max: float
    rms: float
    levels: int
    over_one: float
    delta_e: float
    flip: float | None = None


def draw_light(scene: Scene, size: tuple[int, int], **options: Any) -> Light:
    """Draw a scene; options are those of `rasterizer.render`."""
    with Renderer(scene, size, outputs=("color",), **options) as renderer:
        frame = renderer.render()
    alpha = frame.alpha.astype(np.float64)
    return Light(frame.color * alpha[..., None], alpha)


def draw_ground_truth(scene: Scene, size: tuple[int, int], **options: Any) -> Light:
    """Draw a scene by Phong's shading at 64 samples a pixel with tolerance 0.

    Parameters
    ----------
    scene : Scene
    size : (width, height) in pixels
    options : those of `rasterizer.render`, but for shading, samples and tolerance
    """
    width, height = size
    options = options | {"shading": "phong", "samples": 16, "tolerance": 0.0}
    fine = draw_light(scene, (_FINER * width, _FINER * height), **options)
    return Light(_averaged(fine.color), _averaged(fine.alpha))


def _averaged(values: NDArray) -> NDArray:
    """The means of squares of pixels."""
    height, width, *rest = values.shape
    return values.reshape(height // _FINER, _FINER, width // _FINER, _FINER, *rest).mean(axis=(1, 3))


def measure_errors(found: Light, expected: Light, with_flip: bool = False) -> Errors:
    """Measure how far one picture is from another one of the same size.

    Raises SceneError where FLIP is asked for and flip-evaluator isn't installed.
    """
    is_drawn = _drawn_by_either(found, expected)
    if not is_drawn.any():
        return Errors(0.0, 0.0, 0, 0.0, 0.0, 0.0 if with_flip else None)
    found_color, expected_color = found.color[is_drawn], expected.color[is_drawn]
    difference = np.abs(found_color - expected_color)
    levels = np.abs(levels_from_linear(found_color).astype(np.int16) - levels_from_linear(expected_color))
    delta_e = delta_e_2000(lab_from_linear(found_color), lab_from_linear(expected_color))
    return Errors(
        max=float(difference.max()),
        rms=root_mean_square(difference),
        levels=int(levels.max()),
        over_one=float(np.mean(levels > 1)),
        delta_e=float(delta_e.mean()),
        flip=float(flip_map(found.color, expected.color)[is_drawn].mean()) if with_flip else None,
    )


def rms_error(found: Light, expected: Light) -> float:
    """The `rms` of `measure_errors` alone, which is quicker."""
    is_drawn = _drawn_by_either(found, expected)
    return root_mean_square(found.color[is_drawn] - expected.color[is_drawn])


def _drawn_by_either(found: Light, expected: Light) -> NDArray[np.bool_]:
    """The pixels of which one picture or the other covers a part, (height, width)."""
    return (found.alpha > 0.0) | (expected.alpha > 0.0)
