"""Why a pixel is what it is: the reference's account of it, and where the picture parts from that.

Where both differ by more than is stated, the stages are gone through in order: what the samples see, where, with which
normal; then light and textures, of which one thing after the other is left out of both, until they agree.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..appearance import Appearance
from ..engine.domains import TEXTURED
from ..engine.sample_path import DrawnSample, draw_sample
from ..errors import SceneError
from ..frame import Frame
from ..io.camera_file import viewpoint_of
from ..io.loader import FileLike
from ..keywords import divided, takes_words
from ..options import Options
from ..reference import explain as explaining
from ..reference.explain import Explanation, Row
from ..renderer import load_with_appearance, render
from ..scene.camera import Camera
from ..scene.lights import light_type_of, without_shadows
from ..scene.scene import Scene, SceneLike
from ..viewpoint import Viewpoint

if TYPE_CHECKING:
    from ..keywords import Unpack
    from ..words import RenderWords

_OVER_SURFACES = ("edges", "edge_color", "edge_width", "ground")  # what no surface is, and isn't explained

_NEAR = 1e-3  # that positions and normals may differ by, of the distance and of 1, before they count as others
_MANY = 16  # lights: more are not left out one by one


@takes_words(Viewpoint, Appearance, Options, but=("size", *_OVER_SURFACES))
def explain(
    scene: SceneLike | FileLike | Frame,
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
    scene : Scene, or anything that `load` takes; or a Frame, a picture that was drawn in this process, which is
        explained as it was drawn
    x, y : column and row of the pixel, from the upper left, whole numbers
    size, options, words : those of the picture, as for `render`, but edges and the ground. Of several samples each is
        explained, and the pixel's value is their mean. `color_range` "global" takes the largest value of the whole
        picture, which is then drawn, slowly. `outputs` and `threads` are of no effect, `tolerance` on the last rows

    Returns
    -------
    Explanation, which prints as text. The last rows are the picture's own: its "picture" value, linear, the largest
    "difference" of a channel from the reference's, where they "part", how the nearest opaque surface of the sample
    nearest to the pixel's centre was "drawn", and the bytes of a "frame" that was given

    Raises
    ------
    SceneError : a pixel outside the picture, an option that is not legal; words beside a Frame, or one that
        doesn't know its scene, as after it was pickled
    ModelError : a mesh that is not legal
    """
    if TYPE_CHECKING:  # how Jedi finds the words
        render("", **words)
    source = scene._source if isinstance(scene, Frame) else None
    if isinstance(scene, Frame):
        if words or options is not None or size is not None:
            raise SceneError("a frame is explained as it was drawn; other options and words go with its scene")
        if source is None:
            raise SceneError("this frame doesn't know its scene any more: explain that")
        told, made, camera = source.scene, replace(source.options, edges=(), ground=False), source.camera
    else:
        view_words, others = divided(words, Viewpoint)
        viewpoint = viewpoint_of(view_words)
        told, made, framing, _ = load_with_appearance(scene, others, size, options, viewpoint.of_file)
        camera = viewpoint.over(framing).camera_of(told, made.size)
    found, drawn, difference = _ask_both(told, made, camera, x, y)
    rows: list[Row] = [("picture", tuple(drawn.color.tolist())), ("difference", difference)]
    rows.append(("part", where_they_part(told, made, camera, (x, y), found, drawn, difference)))
    rows += [] if drawn.path is None else [("drawn", drawn.path)]
    if source is not None and isinstance(scene, Frame) and scene.has("rgb"):
        rows.append(("frame", _about_frame(scene.rgba[y, x], drawn.rgba, source.options)))
    return replace(found, rows=(*found.rows, *rows))


def _ask_both(scene: Scene, options: Options, camera: Camera, x: int, y: int) -> tuple[Explanation, DrawnSample, float]:
    """Return what the reference says of a pixel, what the picture does, and how far they are apart."""
    found = explaining.explain(replace(scene, camera=camera), x, y, options)
    drawn = draw_sample(scene, replace(options, outputs=("color", "rgb")), camera, x, y)
    return found, drawn, float(np.abs(drawn.color - dict(found.rows)["linear"]).max())


def _about_frame(shown: np.ndarray, drawn: np.ndarray, options: Options) -> str:
    """Say whether a frame's bytes are those that are drawn now."""
    told = str(tuple(shown.tolist()))
    if (shown == drawn).all():
        return f"{told}, as it is drawn"
    over = [name for name in ("edges", "ground") if getattr(options, name)]
    over += ["the colour range of the whole picture"] if options.color_range == "global" else []
    return f"{told}, drawn are {tuple(drawn.tolist())}: {' or '.join(over) or 'it was changed since'}"


# --- where they part -----------------------------------------------------------------------------------------


def where_they_part(
    scene: Scene,
    options: Options,
    camera: Camera,
    pixel: tuple[int, int],
    found: Explanation,
    drawn: DrawnSample,
    difference: float,
) -> str:
    """Name the first stage in which the picture and the reference differ."""
    rows: dict[str, Any] = dict(found.rows)
    largest = max(1.0, *np.abs(rows["linear"]))  # bounds are of full scale
    bound = largest * (max(options.tolerance, TEXTURED) if drawn.bound is None else drawn.bound) + 1e-7
    if difference <= bound:
        levels = np.abs(drawn.rgba[:3] - np.array(rows["sRGB"], float)).max()
        if levels > 1.0 and options.color_range != "global" and rows["alpha"] > 0.0:
            return f"in clamping and encoding: the bytes are {tuple(drawn.rgba.tolist())}"
        stated = "what it may be, though no bound is stated" if drawn.bound is None else "the bound that is stated"
        return f"nowhere: the difference is within {stated}, {bound:.2g}"
    for k, sample in enumerate(found.samples):
        if surface := _other_surface(dict(reversed(sample.rows)), drawn, divmod(k, options.factor)):
            return surface
    for what, simpler, chosen in _simpler(scene, replace(options, color_range="clamp")):
        if _ask_both(simpler, chosen, camera, *pixel)[2] <= bound:
            return f"in {what}, without which they agree"
    return "in the light, or in what lies behind the nearest surfaces"


def _other_surface(told: dict, drawn: DrawnSample, at: tuple[int, int]) -> str:
    """Say how what a sample sees differs from what the reference tells of it; nothing where it doesn't."""
    face = int(told["layer 1"].split()[1].rstrip(":")) if "layer 1" in told else -1
    where = f"{told['sample'].partition(' px')[0]} px"
    if face != drawn.faces[at]:
        names = [f"face {each}" if each >= 0 else "nothing" for each in (drawn.faces[at], face)]
        return f"in what is seen: {where} the picture has {names[0]}, the reference {names[1]}"
    if face < 0:
        return ""
    distances = {"position": max(1e-300, abs(told["depth"])), "normal": 1.0}
    for (name, scale), values in zip(distances.items(), (drawn.positions[at], drawn.normals[at]), strict=True):
        if not np.abs(values - told[name]).max() <= _NEAR * scale:
            return f"in the {name}: {where} the picture has {tuple(values.tolist())}"
    return ""


def _simpler(scene: Scene, options: Options) -> Iterator[tuple[str, Scene, Options]]:
    """Yield pictures that leave something out, and its name."""
    if options.tolerance > 0.0:
        yield f"the tolerance of {options.tolerance:g}", scene, replace(options, tolerance=0.0)
    if any(getattr(light, "shadow", None) for light in scene.lights):
        yield "shadows", replace(scene, lights=without_shadows(scene.lights)), options
    if scene.depth_cue is not None:
        yield "the depth cue", replace(scene, depth_cue=None), options
    if any(material.textures for material in scene.materials):
        yield "textures", Appearance(material={"texture": None, "metallic_roughness": None}).change(scene), options
    yield "highlights", Appearance(material={"specular": 0}).change(scene), options
    for k, light in enumerate(scene.lights if len(scene.lights) <= _MANY else ()):
        others = scene.lights[:k] + scene.lights[k + 1 :]
        yield f"light {k}, {light_type_of(light)}", replace(scene, lights=others), options
