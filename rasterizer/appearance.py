"""How a model looks: words such as `shadows=True` or `material="gold"`, of a program or of the command line, change the
scene that is loaded."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Literal

from .choices import WEIGHTINGS, Axis, Preset, Weighting
from .errors import ModelError, SceneError, shown
from .keywords import checked_fields
from .options import Options
from .scene.color import linear_rgb
from .scene.lights import (
    PRESETS,
    Light,
    Shadow,
    checked_lights,
    on_tabletop,
    with_shadows,
    without_shadows,
)
from .scene.material import Material, named_fields
from .scene.mesh import MAX_SUBDIVISIONS, Mesh, checked_crease_angle
from .scene.scalars import ScalarWords
from .scene.scene import DepthCue, Scene, checked_cue
from .scene.validate import choice, flag, store, whole

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from .scene.color import ColorLike
    from .scene.scalars import Colormap

# The fields that say how a file or mesh is read; the others change its scene.
READING = (
    "format", "crease_angle", "weighting", "drop_bad_faces", "allow_outside", "up", "scalars", "cmap", "clim",
)  # fmt: skip
TEXTURES = ("texture", "metallic_roughness")  # fields of a material that may name a file


@checked_fields
@dataclass(frozen=True, kw_only=True)
class Appearance:
    """Hold how a model is read, and what is changed of its scene; `render` says what each field is.

    `material` is stored as a dict of the fields that every material gets, those of `color` and `reflection` among them.

    Raises
    ------
    SceneError : a value that is not legal
    ModelError : a material's texture that can't be read
    """

    lights: Light | Iterable[Any] | None = None
    preset: Preset | None = None
    shadows: bool | Shadow = False
    material: Material | str | Mapping[str, Any] | None = None
    color: ColorLike | None = None
    reflection: str | None = None
    background: ColorLike | None = None
    depth_cue: DepthCue | float | Literal["none"] | None = None
    up: Axis | Literal["auto"] | None = None
    format: str | None = None
    crease_angle: float | None = None
    weighting: Weighting | None = None
    subdivide: int = 0
    scalars: ArrayLike | str | None = None
    cmap: Colormap | None = None
    clim: Sequence[float] | None = None
    drop_bad_faces: bool = False
    allow_outside: bool = False

    def __post_init__(self) -> None:
        if self.preset is not None:
            choice(self.preset, PRESETS, "preset")
        if not isinstance(self.shadows, (bool, Shadow)):
            raise SceneError(f"shadows must be True, False or a Shadow; given {shown(self.shadows)}")
        if self.weighting is not None:
            choice(self.weighting, WEIGHTINGS, "weighting")
        flag(self.drop_bad_faces, "drop_bad_faces")
        checked_crease_angle(self.crease_angle)
        subdivide = whole(self.subdivide, "subdivide", 0, MAX_SUBDIVISIONS)
        store(self, subdivide=subdivide, material=self._material_fields())
        if self.scalars is not None and self.color is not None:
            raise SceneError("scalars are shown by the colours of cmap: give one of scalars and color")
        words = self.scalars, self.cmap, self.clim
        if any(word is not None for word in words):
            store(self, **vars(ScalarWords(*words)))

    @property
    def reading(self) -> dict[str, Any]:
        """The words that say how a file or mesh is read, as `load` takes them."""
        return dict(zip(READING, attrgetter(*READING)(self), strict=True))

    def over(self, other: Appearance | None) -> Appearance:
        """Return the appearance that a scene file asks for, if it does, changed by what this one says: its lights
        replace all others, of a material its fields those of the same names."""
        if other is None:
            return self
        given = {}
        for each in fields(Appearance):
            value = getattr(self, each.name)
            if value is not None and (each.default is None or value != each.default):
                given[each.name] = value
        lights = {"lights": self.lights, "preset": self.preset} if {"lights", "preset"} & {*given} else {}
        color = other.color if self.color is None and "diffuse" not in self.material else self.color
        material = {"material": other.material | self.material, "color": color, "reflection": None}
        return replace(other, **given | lights | material)

    def change(
        self,
        scene: Scene,
        shading: str = Options.shading,
        ground: bool = Options.ground,
        shadow_fields: Mapping[str, int] | None = None,
    ) -> Scene:
        """Return a scene with other lights, materials, background and finer meshes, as the words say.

        Parameters
        ----------
        scene : Scene
        shading, ground : options of the picture. A tabletop's key light casts shadows by Phong's method alone: by the
            others a polygon or a vertex lies in the shadow as a whole
        shadow_fields : fields of Shadow by name, of lights that cast one; but for `lights`, which have their own

        Raises
        ------
        SceneError : a value that is not legal
        ModelError : a mesh that can't take the texture, or would have too many faces
        """
        lights = self._change_lights(scene.lights, shading == "phong", ground, shadow_fields or {})
        changes: dict[str, Any] = {} if lights is scene.lights else {"lights": lights}
        if self.background is not None:
            is_none = isinstance(self.background, str) and self.background == "transparent"
            changes["background"] = None if is_none else linear_rgb(self.background, "the background")
        if self.depth_cue is not None:
            cue: Any = self.depth_cue
            changes["depth_cue"] = None if isinstance(cue, str) and cue == "none" else checked_cue(cue)
        if self.material or self.subdivide:
            changes["meshes"] = tuple(self._change_mesh(mesh) for mesh in scene.meshes)
        return replace(scene, **changes) if changes else scene

    def _change_lights(self, lights: Any, is_phong: bool, ground: bool, shadow_fields: Mapping[str, int]) -> Any:
        """Return the lights of a preset and those given, else a scene's own; with shadows where that is asked for."""
        takes_shadows, given = is_phong and not self.shadows, ()
        if self.preset is not None or self.lights is not None:
            lights = () if self.preset is None else PRESETS[self.preset]()
            lights = lights if takes_shadows else without_shadows(lights)
            given = () if self.lights is None else checked_lights(self.lights)
        if ground and not (lights and given):
            lights, given = on_tabletop(lights, takes_shadows), on_tabletop(given, takes_shadows)
        if shadow_fields:
            lights = with_shadows(lights, lambda own: replace(own, **shadow_fields) if own else own)
        if not self.shadows:
            return lights + given
        shadow = self.shadows if isinstance(self.shadows, Shadow) else Shadow()
        return with_shadows(lights + given, lambda own: shadow if own is None else own)

    def _material_fields(self) -> dict[str, Any]:
        """Return the fields that every material gets; textures are read once."""
        given, found = self.material, {} if self.reflection is None else {"reflection": self.reflection}
        if isinstance(given, Material):
            found |= {each.name: getattr(given, each.name) for each in fields(Material)}
        elif isinstance(given, str):
            found |= named_fields(given)
        elif isinstance(given, Mapping) and all(isinstance(name, str) for name in given):
            found |= given
        elif given is not None:
            legal = "a Material, the name of one, or a dict of some of its fields"
            raise SceneError(f"material must be {legal}; given {shown(given)}")
        if self.color is not None:
            found |= {"texture": found.get("texture"), "diffuse": linear_rgb(self.color, "the color")}
        elif found.get("texture") is not None:
            found.setdefault("diffuse", 1.0)
        if not found:
            return found
        made = Material(**found)
        return found | {name: getattr(made, name) for name in TEXTURES if name in found}

    def _change_mesh(self, mesh: Mesh) -> Mesh:
        """Return a mesh with other materials, and subdivided."""
        if self.material:
            for name in TEXTURES:
                if self.material.get(name) is not None and mesh.uv is None:
                    which = f"mesh {mesh.name!r}" if mesh.name else "a mesh"
                    raise ModelError(f"{which} has no texture coordinates (uv), which the material's {name} needs")
            # The ambient coefficient, and that of metal, follow the diffuse one unless they are given too.
            follows = {"ambient": None, "metal": None} if "diffuse" in self.material else {}
            materials = tuple(self._changed(material, follows) for material in mesh.palette)
            of_faces = {} if mesh.materials is None else {"materials": materials}
            colors = {} if self.color is None else {"colors": None, "face_colors": None}
            mesh = replace(mesh, material=materials[0], **of_faces, **colors)
        return mesh.subdivide(self.subdivide) if self.subdivide else mesh

    def _changed(self, material: Material, follows: dict[str, None]) -> Material:
        """Return a material with the fields asked for; one that shows its colour by emission alone goes on doing so."""
        made, plain = replace(material, **follows | self.material), vars(material)
        if self.color is None or "emissive" in self.material:
            return made
        if max(plain["diffuse"]) > 0.0 or max(plain["ambient"]) > 0.0 or max(plain["emissive"]) == 0.0:
            return made
        return replace(made, emissive=made.diffuse, diffuse=0.0, ambient=0.0)
