"""`raster demo`: the model that comes with the package, drawn as `raster render` draws any other."""

from ..io.demo import demo_model
from .render_command import render_models


def draw_demo(arguments, messages) -> tuple[list, int]:
    """Draw the model; parameters, result and errors are those of `render_models`."""
    arguments.models = [str(demo_model())]
    found = render_models(arguments, messages)
    messages.detail(f"the model is {arguments.models[0]}; raster render MODEL draws one of yours")
    return found
