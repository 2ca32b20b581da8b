"""`raster demo`: the model that comes with the package, drawn as `raster render` draws any other."""

from dataclasses import replace

from .flags import add_appearance, add_camera, add_output

IMPORTS = ("drawing",)
_SIZE = (800, 500)
_EXAMPLES = """\
examples:
  raster demo                                                demo.png, here
  raster demo --shading flat --background white -o flat.jpg
"""


def add_flags(parser) -> None:
    """Add the flags to the command's parser, and what its help says."""
    parser.usage = "raster demo [-o OUT] [options]"
    parser.description = "Draw the model that comes with the package, so that there is a picture at once."
    parser.epilog = _EXAMPLES
    parser.set_defaults(models=())
    add_output(parser, "demo", _SIZE)
    add_camera(parser)
    add_appearance(parser)


def run(request, messages) -> tuple[list, int]:
    """Draw the model; parameters, result and errors are those of `drawing.draw_models`."""
    from ..io.loader import demo_model
    from .render import run as render

    model = str(demo_model())
    found = render(replace(request, models=(model,)), messages)
    messages.detail(f"the model is {model}; raster render MODEL draws one of yours")
    return found
