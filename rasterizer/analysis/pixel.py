"""Why a pixel is what it is: the reference's account of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..engine.sample_path import draw_sample
from ..io.camera_file import viewpoint_of
from ..io.loader import FileLike
from ..keywords import divided, takes_words
from ..look import Look
from ..options import Options
from ..reference import explain as explaining
from ..reference.explain import Explanation, Row
from ..renderer import load_look, render
from ..scene.scene import SceneLike
from ..viewpoint import Viewpoint

if TYPE_CHECKING:
    from ..keywords import Unpack
    from ..words import RenderWords

_OVER_SURFACES = ("edges", "edge_color", "edge_width", "ground")  # what no surface is, and isn't explained


@takes_words(Viewpoint, Look, Options, but=("size", *_OVER_SURFACES))
def explain(
    scene: SceneLike | FileLike,
    x: int,
    y: int,
    size: int | Sequence[int] | None = None,
    *,
    options: Options | None = None,
    **words: Unpack[RenderWords],
) -> Explanation:
    """Explain a pixel of a picture: what its samples see, and what each light adds, as the reference computes it; and
    what the picture shows.

    Parameters
    ----------
    scene : Scene, or anything that `load` takes
    x, y : column and row of the pixel, from the upper left, whole numbers
    size, options, words : those of the picture, as for `render`, but edges and the ground. Of several samples each is
        explained, and the pixel's value is their mean. `color_range` "global" takes the largest value of the whole
        picture, which is then drawn, slowly. `outputs` and `threads` are of no effect, `tolerance` on the last rows

    Returns
    -------
    Explanation, which prints as text. The last rows are the picture's own: its "picture" value, linear, the largest
    "difference" of a channel from the reference's, and how the nearest opaque surface of the sample nearest to the
    pixel's centre was "drawn"

    Raises
    ------
    SceneError : a pixel outside the picture, or an option that is not legal
    ModelError : a mesh that is not legal
    """
    if TYPE_CHECKING:  # how Jedi finds the words
        render(scene, **words)
    view_words, others = divided(words, Viewpoint)
    viewpoint = viewpoint_of(view_words)
    scene, options, framing, _ = load_look(scene, others, size, options, viewpoint.of_file)
    camera = viewpoint.over(framing).camera_of(scene, options.size)
    found = explaining.explain(replace(scene, camera=camera), x, y, options)
    drawn = draw_sample(scene, replace(options, outputs=("color", "rgb")), camera, x, y)
    difference = float(np.abs(drawn.color - dict(found.rows)["linear"]).max())
    rows: list[Row] = [("picture", tuple(drawn.color.tolist())), ("difference", difference)]
    rows += [] if drawn.path is None else [("drawn", drawn.path)]
    return replace(found, rows=(*found.rows, *rows))
