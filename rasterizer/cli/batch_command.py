"""`raster batch`: many models in several processes, or on many machines."""

from time import perf_counter

from ..batch.rendering import is_there
from ..errors import SceneError
from .processes import draw_models_apart, may_be_drawn_apart
from .render_command import check_options, render_model
from .targets import plan_targets


def draw_batch(arguments, messages) -> tuple[list, int]:
    """Draw every model; parameters, result and errors are those of `render_models`."""
    start = perf_counter()
    check_options(arguments)
    if not may_be_drawn_apart(arguments):
        raise SceneError("raster batch reads and writes files; for stdin and stdout there is raster render")
    plan = plan_targets(arguments)
    left = [[target for target in targets if not _is_left_out(target, arguments)] for targets in plan]
    n_target, n_left = sum(map(len, plan)), sum(map(len, left))
    left = [targets for targets in left if targets]
    failures, n_model, summary = draw_models_apart(arguments, messages, left, render_model, arguments.scheduler)
    summary.skipped, summary.seconds = n_target - n_left, perf_counter() - start
    messages.notice(str(summary))
    if arguments.json:
        messages.record(vars(summary) | {"seconds": round(summary.seconds, 4)}, False)
    return failures, n_model


def _is_left_out(target, arguments) -> bool:
    """Tell whether a picture is there already, and shall stay."""
    if arguments.skip_existing:
        return is_there(target.output, None)
    return arguments.is_resumed and is_there(target.output, target.model)
