"""Why a pixel is what it is: the reference's account of it, and the path by which the renderer draws it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..choices import Antialias, ColorRange, Cull, Output, Samples, Shading
from ..engine.prepared import PreparedScene
from ..engine.scene_tables import SceneTables
from ..io.loader import FileLike, load
from ..keywords import checked_keywords
from ..options import Options
from ..reference import explain as explaining
from ..reference.explain import Explanation
from ..scene.camera import Camera
from ..scene.scene import SceneLike


@checked_keywords
def explain(
    scene: SceneLike | FileLike,
    x: int,
    y: int,
    size: int | Sequence[int] = Options.size,
    *,
    camera: Camera | None = None,
    shading: Shading = Options.shading,
    tolerance: float = Options.tolerance,
    samples: Samples = Options.samples,
    antialias: Antialias = Options.antialias,
    outputs: Output | Sequence[Output] = Options.outputs,
    cull: Cull = Options.cull,
    color_range: ColorRange = Options.color_range,
    exposure: float = Options.exposure,
    spectral: int | None = Options.spectral,
    threads: int | None = Options.threads,
) -> Explanation:
    """Explain a pixel of a picture: what its samples see, and what each light adds, as the reference computes it.

    Parameters
    ----------
    scene : Scene, or anything that `load` takes
    x, y : column and row of the pixel, from the upper left, whole numbers
    size : (width, height) in pixels, or one number for a square
    camera : Camera; None = that of the scene
    shading, samples, antialias, cull, color_range, exposure, spectral : the options of the picture, as for `render`. Of
        several samples each is explained, and the pixel's value is their mean. "global" takes the largest value of the
        whole picture, which is then drawn, slowly
    tolerance : decides the path that the renderer takes; the values are the reference's, which has no tolerance
    outputs, threads : of no effect. They are taken so that the options of a picture can be handed on as they are

    Returns
    -------
    Explanation, which prints as text

    Raises
    ------
    SceneError : a pixel outside the picture, or an option that is not legal
    ModelError : a mesh that is not legal
    """
    scene = load(scene)
    scene = scene if camera is None else replace(scene, camera=camera)
    options = Options(
        size=size, shading=shading, tolerance=tolerance, samples=samples, antialias=antialias, outputs=outputs,
        cull=cull, color_range=color_range, exposure=exposure, spectral=spectral, threads=threads,
    )  # fmt: skip
    found = explaining.explain(scene, x, y, options)
    prepared = PreparedScene(SceneTables(scene, options), options)
    paths = prepared.paths_at(scene.camera_for(options.size), (found.x, found.y))
    return replace(found, path=" and ".join(paths) or None)
