"""The plan of a whole scene in one view, for drawing a sample of it (scene/sample.py): so the sample needs the kernels
that the whole picture needs, whatever of its lights, materials and distances it shows itself."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..geometry.points import Geometry, number_materials
from ..pipeline.lighting import Lighting
from ..pipeline.outcodes import list_seen_faces
from ..scene.camera import Camera
from ..scene.sample import Kind, kind_of, with_small_map
from ..scene.scene import Scene
from .light_table import shadow_of
from .plan import Plan, gather_sources, list_lights
from .shadow_maps import leaves_casters_out
from .shadow_views import corners_of
from .uniforms import list_materials, make_lighting
from .view_plans import ViewPlan

if TYPE_CHECKING:
    from .prepared_scene import PreparedScene


class GivenPlan:
    """What a PreparedScene asks its ViewPlans for, where all is known: the plan of another scene."""

    def __init__(self, view_plan: ViewPlan):
        lights = tuple(light if shadow_of(light) is None else with_small_map(light) for light in view_plan.plan.lights)
        self.plan = view_plan.plan._replace(lights=lights)
        self._view_plan = view_plan._replace(plan=self.plan)

    @property
    def casts_shadows(self) -> bool:
        """Some light casts shadows."""
        return self.plan.has_shadows

    def plan_for(self, view, screen) -> ViewPlan:
        """The plan that is given, in any view."""
        return self._view_plan

    def lighting_for(self, plan: Plan, view, screen, dtype: np.dtype, shadows) -> Lighting:
        """The illumination in one type; see `ViewPlans.lighting_for`."""
        return make_lighting(plan, view, dtype, shadows)


class WholeView(NamedTuple):
    """What the picture of a whole scene is drawn by in one view."""

    scene: Scene
    view_plan: ViewPlan
    leaves_casters_out: bool  # some shadow map doesn't look at all that casts shadows, or not in every view

    @property
    def kind(self) -> Kind:
        """What tells the kinds of the scene's materials apart."""
        return self._kind_of(number_materials(self.scene.meshes)[0], np.arange(len(self.view_plan.plan.materials)))

    def kind_in(self, sample: Scene, origins: list[int]) -> Kind:
        """Return what tells the kinds of a sample's materials apart; `origins` as `follow` takes them."""
        return self._kind_of(number_materials(sample.meshes)[0], match_materials(sample, self.scene, origins))

    def _kind_of(self, materials, numbers) -> Kind:
        """By what they are, and by their rows of the plan, which have `numbers`."""
        of_plan = self.view_plan.plan.of_materials
        rows = zip(of_plan.needs[numbers].tolist(), of_plan.ways[numbers].tolist(), strict=True)
        of_materials = dict(zip(materials, rows, strict=True))
        return lambda material: (*kind_of(material), *of_materials[material])


def view_whole(prepared: "PreparedScene", camera: Camera) -> WholeView:
    """Find what the picture through a camera is drawn by."""
    view_plan = prepared.plan_for(camera)
    has_shadows = view_plan.plan.has_shadows and prepared.shadows is not None
    looks_away = has_shadows and prepared.shadows.leaves_out(view_plan.plan, camera.view())
    return WholeView(prepared.scene, view_plan, looks_away)


def measure_lights(sample: "PreparedScene", camera: Camera) -> None:
    """Ask for what finds plans, of all lights of a sample, whether or not they reach anything of it."""
    sample.plan_for(camera)


def declare_lights(sample: "PreparedScene", camera: Camera) -> None:
    """Ask for the functions of all lights of a sample, and of how its materials reflect them, likewise."""
    plan = sample.plan_for(camera).plan
    is_lit = gather_sources(sample.scene, sample.options).is_lit
    for dtype in plan.dtypes if plan.is_lit.sum() < is_lit.sum() else ():
        list_materials(plan._replace(is_lit=is_lit), dtype)


def follow(sample: "PreparedScene", whole: WholeView, origins: list[int]) -> bool:
    """Let a sample be drawn by the plan of the whole scene; False where it lacks what that takes.

    Parameters
    ----------
    origins : which mesh of the scene each mesh of the sample is made of
    """
    plan, numbers = whole.view_plan.plan, match_materials(sample.scene, whole.scene, origins)
    geometry = renumber(sample.geometry, numbers, plan)
    if geometry is None:
        return False
    sample.be_drawn_by(geometry, GivenPlan(whole.view_plan))
    return True


def leaves_out(scene: Scene, camera: Camera) -> bool:
    """Tell whether some shadow map of a scene that isn't prepared may leave out what casts no shadow in it."""
    corners = corners_of(np.stack([mesh.bounds for mesh in scene.meshes]))
    return leaves_casters_out(list_lights(scene)[0], corners, camera.view())


def declare_seen_casters(sample: "PreparedScene") -> None:
    """Ask for what chooses the casters that a shadow map shows, which those of a sample may all be."""
    list_seen_faces(sample.geometry.positions, sample.geometry.vertex, np.zeros(3), np.zeros((1, 3)))


def match_materials(sample: Scene, scene: Scene, origins: list[int]) -> NDArray[np.int64]:
    """Return the number that each material of a sample has in the whole scene.

    Parameters
    ----------
    origins : which mesh of the scene each mesh of the sample is made of
    """
    materials, of_sample = number_materials(sample.meshes)
    of_scene, numbers = number_materials(scene.meshes)[1], np.zeros(len(materials), np.int64)
    for here, origin in zip(of_sample, origins, strict=True):
        numbers[here] = of_scene[origin]
    return numbers


def renumber(geometry: Geometry, numbers: NDArray[np.int64], plan: Plan) -> Geometry | None:
    """Return a sample's geometry with the materials of a plan; None where it lacks what they need of their surfaces.

    Parameters
    ----------
    numbers : (n_material,) what `match_materials` returns
    """
    has_all = (len(geometry.albedo) > 0) == plan.has_albedo and (len(geometry.uv) > 0) == (plan.textures is not None)
    if not has_all or (geometry.tangents.shape[1] > 0) != plan.has_tangents:
        return None
    face_material = geometry.face_material
    if len(plan.materials) > 1:
        old = face_material if len(face_material) else np.zeros(geometry.vertex.shape[1], np.uint32)
        face_material = numbers[old].astype(np.uint32)
    return geometry._replace(face_material=face_material, group_material=numbers[geometry.group_material])
