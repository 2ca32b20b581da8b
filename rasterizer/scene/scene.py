"""A scene: meshes, lights, a camera, a background and a depth cue, checked and ready to be drawn."""

from collections.abc import Iterable, Sequence
from dataclasses import KW_ONLY, dataclass, field
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..choices import AXES, Axis
from ..errors import SceneError, counted, shown
from ..keywords import checked_fields
from ..locks import cached_property
from .arrays import fixed
from .camera import Camera
from .color import RGB, ColorLike, linear_rgb
from .lights import Light, checked_lights, light_type_of, studio
from .material import Material
from .mesh import MAX_FACES, Mesh, MeshLike, is_one_mesh, meshes_from
from .validate import choice, items_of, number, picture_size, store, value_class


@value_class
@dataclass(frozen=True)
class DepthCue:
    """Let what is seen fade with its depth d: s·I + (1 - s)·`color`, with s = scale / (scale + max(d - start, 0)).

    That is the fall-off 1/(d + d0) by the viewer's distance of the textbooks (Rogers 1985, section 5.2), d0 being
    `scale`, and 1 where it begins. It tells parallel surfaces of one material apart that all light falls on alike. The
    depth is that of `Frame.depth`: the distance from the camera along the viewing axis. Everything that a surface sends
    out fades, ambient and emissive light too; the background does not. Exposure has no part in `color`.

    Parameters
    ----------
    scale : number above 0, scene units: at the depth start + scale half of the surface's own light is left
    start : number, at least 0, scene units: nothing nearer fades
    color : colour as of a background, usually the same: a number, three linear numbers, hex or CSS text, or a Spectrum

    Raises
    ------
    SceneError : a value that is not legal
    """

    scale: float
    start: float = 0.0
    color: ColorLike = 0.0

    def __post_init__(self) -> None:
        store(
            self,
            scale=number(self.scale, "the depth cue's scale", above=0),
            start=number(self.start, "the depth cue's start", low=0),
            color=linear_rgb(self.color, "the depth cue's color"),
        )


def checked_cue(cue: DepthCue | float | None) -> DepthCue | None:
    """Return a DepthCue, of a number alone the one with that scale; None stays None.

    Raises SceneError for anything else.
    """
    if cue is None or isinstance(cue, DepthCue):
        return cue
    if isinstance(cue, (int, float, np.integer, np.floating)) and not isinstance(cue, bool):
        return DepthCue(cue)
    raise SceneError(f"the depth cue must be a DepthCue, a number (its scale), or None; given {shown(cue)}")


@checked_fields
@dataclass(frozen=True, eq=False, repr=False)
class Scene:
    """Hold what is drawn.

    Parameters
    ----------
    meshes : one mesh or a sequence of them, each anything that `Mesh.from_any` takes; stored as a tuple of
        Mesh
    lights : one light or a sequence of them; None = `studio()`; stored as a tuple. Without any only emissive
        colours are seen
    camera : Camera; None = framed when the picture's size is known
    background : colour as `linear_rgb` reads it, stored linear; None = transparent
    depth_cue : DepthCue, or a number, its scale; None = nothing fades with depth
    up : "x", "y", "z", "-x", "-y", "-z": the axis that points upwards where the scene is framed

    Raises
    ------
    SceneError : no meshes, or a light, camera, background, depth cue or axis that is not legal; more than 16384 lights,
        or more than 4096 that cast shadows, where the cells of area lights count one by one
    ModelError : a mesh that is not legal
    """

    meshes: tuple[Mesh, ...]
    lights: tuple[Light, ...] = None  # type: ignore[assignment]  # never None once it is made
    camera: Camera | None = None
    background: RGB | None = None
    _: KW_ONLY
    depth_cue: DepthCue | None = None
    up: Axis = "y"
    _framed: dict[float, Camera] = field(init=False, default_factory=dict)

    if TYPE_CHECKING:  # more may be given than is stored

        def __init__(
            self,
            meshes: MeshLike | Iterable[Any],
            lights: Light | Iterable[Any] | None = ...,
            camera: Camera | None = ...,
            background: ColorLike | None = ...,
            *,
            depth_cue: DepthCue | float | None = ...,
            up: Axis = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        given: Any = self.meshes
        meshes = [given] if is_one_mesh(given) or isinstance(given, str) else [*items_of(given)]
        if not meshes:
            raise SceneError(f"meshes must be a mesh or a sequence of at least one mesh; given {shown(given)}")
        lights = studio() if self.lights is None else checked_lights(self.lights)
        store(self, meshes=tuple(meshes_from(meshes, {})), lights=lights, depth_cue=checked_cue(self.depth_cue))
        if self.n_face > MAX_FACES:
            raise SceneError(f"a scene may have up to {MAX_FACES} faces; given {self.n_face}")
        if self.camera is not None and not isinstance(self.camera, Camera):
            raise SceneError(f"the scene's camera must be a Camera or None; given {shown(self.camera)}")
        if self.background is not None:
            store(self, background=linear_rgb(self.background, "the background"))
        choice(self.up, AXES, "the scene's up")

    def __repr__(self) -> str:
        lights = ", ".join(map(light_type_of, self.lights)) or "none"
        camera = "framed" if self.camera is None else "given"
        size = f"{counted(len(self.meshes), 'mesh')}, {counted(self.n_face, 'face')}"
        return f"Scene({size}, lights: {lights}, camera: {camera})"

    @property
    def n_face(self) -> int:
        """Number of triangles of all meshes."""
        return int(self.face_offsets[-1])

    @cached_property
    def materials(self) -> tuple[Material, ...]:
        """The different materials of all meshes, in the order in which they first come; equal ones count once."""
        return tuple(dict.fromkeys(material for mesh in self.meshes for material in mesh.palette))

    @cached_property
    def face_offsets(self) -> NDArray[np.int64]:
        """(n_mesh + 1,) int64: face f of mesh m has the index face_offsets[m] + f in the scene."""
        return fixed(np.cumsum([0] + [mesh.n_face for mesh in self.meshes], dtype=np.int64))

    @cached_property
    def bounds(self) -> NDArray[np.float64]:
        """Lowest and highest corner (2, 3) float64 of the box round all used vertices, scene units."""
        corners = np.stack([mesh.bounds for mesh in self.meshes])
        return fixed(np.stack([corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)]))

    def framed(self, aspect: float) -> Camera:
        """Return a perspective camera that shows the whole scene from the default side.

        The same camera is returned every time; looking at all vertices takes a while for large scenes.

        Parameters
        ----------
        aspect : width / height of the picture, finite, above 0

        Returns
        -------
        Camera, as `Camera.framing` makes it

        Raises
        ------
        SceneError : another aspect
        """
        if number(aspect, "the aspect (width / height)") not in self._framed:
            self._framed[aspect] = Camera.framing(self, up=self.up, aspect=aspect)
        return self._framed[aspect]

    def camera_for(self, size: Sequence[int]) -> Camera:
        """Return the scene's own camera, else one that frames it.

        Parameters
        ----------
        size : (width, height) of the picture, pixels

        Returns
        -------
        Camera

        Raises
        ------
        SceneError : a size that is not legal, where there is no camera
        """
        if self.camera is not None:
            return self.camera
        width, height = picture_size(size)
        return self.framed(width / height)


SceneLike: TypeAlias = Scene | MeshLike | Sequence[Any]  # what is drawn, as a caller may give it
