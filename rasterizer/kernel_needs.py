"""Which kernels a picture needs, found out before it is drawn: so they are compiled at once, in several processes."""

import logging
from dataclasses import fields
from typing import TYPE_CHECKING

from .compiler.kernels import noting_needs
from .engine.given_plan import declare_lights, declare_seen_casters, follow, leaves_out, measure_lights, view_whole
from .errors import RasterizerError
from .scene.camera import Camera
from .scene.sample import SIZE, choose_meshes, sample_scene, sample_views

if TYPE_CHECKING:
    from .renderer import Renderer


def list_needs(renderer: "Renderer", camera: Camera | None, is_prepared: bool = True) -> dict:
    """Return the kernels that a picture through a camera needs, {(function, signature): True}.

    They are found out by drawing small ones in Python, of a sample of the scene: by the plan that the whole scene has
    in that view, or, before it is prepared, by the sample's own with all lights. What only the whole scene needs is
    compiled when it is met.

    Parameters
    ----------
    camera : Camera; None = the scene's own
    is_prepared : whether the renderer's scene is
    """
    scene, options = renderer.scene, renderer.options
    given = {field.name: getattr(options, field.name) for field in fields(options)}
    draws_color = bool({"color", "rgb"} & set(options.outputs))
    # By compiled kernels, not in Python: it looks at all points. Most are there: the sample of an unprepared scene has
    # needed them.
    seen_by = renderer._checked_camera(camera)
    whole = view_whole(renderer._prepared, seen_by) if is_prepared and draws_color else None
    looks_away = leaves_out(scene, seen_by) if whole is None else whole.leaves_casters_out
    with noting_needs() as needs:
        try:
            kind = None if whole is None else whole.kind
            origins = choose_meshes(scene, kind)
            sample = sample_scene(scene, kind, origins)
            with type(renderer)(sample, **given | {"size": SIZE, "threads": 1}) as small:
                prepared, view = small._prepared, small._checked_camera(None)
                prepared.is_thorough = True
                if draws_color:
                    measure_lights(prepared, view)
                    if whole is None or not follow(prepared, whole, origins):
                        declare_lights(prepared, view)
                    if looks_away:
                        declare_seen_casters(prepared)
                kind = None if whole is None else whole.kind_in(sample, origins)
                for view in sample_views(sample, scene, camera, kind):
                    small.render(view)
        except RasterizerError as fault:  # what was noted until then is of use
            logging.getLogger("rasterizer").info("not all kernels that the picture needs are known ahead: %s", fault)
    return needs
