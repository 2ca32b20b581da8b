"""FLIP: how different two pictures look when one is shown after the other, by its authors' own program.

Source: Andersson et al. 2020, "FLIP: A Difference Evaluator for Alternating Images", Proc. ACM Comput. Graph. Interact.
Tech. 3(2). The program is the package flip-evaluator.
"""

import numpy as np
from numpy.typing import NDArray

from .packages import require


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
