"""`raster batch --tiles`: one picture after the other, each drawn by all processes."""

from copy import copy
from functools import partial

from ..batch.rendering import make_crew
from ..batch.tasks import RenderSummary, RenderTask
from ..batch.tiles import TiledRenderer
from ..options import Options
from .processes import tell_of_compiling
from .render_command import draw_models, render_model


def draw_models_tiled(arguments, messages, plan, executor=None) -> tuple[list, int, RenderSummary]:
    """Draw the pictures of a plan, as `plan_targets` returns it, one after the other, in tiles.

    Returns
    -------
    the failures, one error for each model that failed; the number of models; and what was done
    """
    renderers, arguments = [], copy(arguments)
    arguments.threads = arguments.threads or 1

    def make_renderer(scene, **options) -> TiledRenderer:
        options = Options(**options)
        task = RenderTask(scene, "picture", options=options)
        crew = make_crew(executor, arguments.n_process)
        tell_of_compiling(crew, messages)
        renderers.append(TiledRenderer(task, options, crew))
        return renderers[-1]

    draw = partial(render_model, make_renderer=make_renderer)
    failures, n_model = draw_models(arguments, messages, draw, plan=plan) if plan else ([], 0)
    n_drawn = sum(renderer.n_drawn for renderer in renderers)
    return failures, n_model, RenderSummary(n_drawn, 0, sum(map(len, plan)) - n_drawn)
