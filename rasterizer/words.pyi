"""The keywords of `render`, for type checkers: tests/project/make_words.py makes them of fields."""

import os
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal, TypedDict

from numpy.typing import ArrayLike

from .choices import Axis, ColorRange, Cull, EdgeType, Output, Preset, Samples, Shading, ViewName, Weighting
from .scene.arrays import VectorLike
from .scene.camera import Camera
from .scene.color import ColorLike
from .scene.lights import Light, Shadow
from .scene.material import Material
from .scene.scalars import Colormap
from .scene.scene import DepthCue

class OptionWords(TypedDict, total=False):
    """Fields of `Options`."""

    shading: Shading
    tolerance: float
    samples: Samples
    outputs: Output | Sequence[Output]
    cull: Cull
    color_range: ColorRange
    exposure: float
    spectral: int | None
    threads: int | None
    edges: EdgeType | Sequence[EdgeType] | None
    edge_color: ColorLike
    edge_width: float
    ground: bool
    min_opacity: float

class AppearanceWords(TypedDict, total=False):
    """Fields of `Appearance`."""

    lights: Light | Iterable[Any] | None
    preset: Preset | None
    shadows: bool | Shadow
    material: Material | str | Mapping[str, Any] | None
    color: ColorLike | None
    reflection: str | None
    background: ColorLike | None
    depth_cue: DepthCue | float | Literal["none"] | None
    up: Axis | Literal["auto"] | None
    format: str | None
    crease_angle: float | None
    weighting: Weighting | None
    subdivide: int
    scalars: ArrayLike | str | None
    cmap: Colormap | None
    clim: Sequence[float] | None
    drop_bad_faces: bool
    allow_outside: bool

class ViewpointWords(TypedDict, total=False):
    """Fields of `Viewpoint`."""

    view: ViewName | Sequence[float] | None
    azimuth: float | None
    elevation: float | None
    fov: float | None
    ortho: bool
    zoom: float
    margin: float | None
    eye: VectorLike | None
    target: VectorLike | None

class ViewWords(ViewpointWords, total=False):
    """All fields of `Viewpoint`."""

    camera: Camera | str | os.PathLike[str] | None

class SceneWords(AppearanceWords, OptionWords, total=False):
    """What `Renderer` takes."""

class RenderWords(ViewWords, SceneWords, total=False):
    """What `render` takes."""
