"""The table of commands: what `raster --help` says of each, who adds its flags, and who runs it.

A new command is one entry. Nothing that an entry names is imported before the command is called, so that the help of
the program is printed at once.
"""

from collections import namedtuple
from importlib import import_module


class Command(namedtuple("Command", ("name", "summary", "flags", "function"))):
    """Describe a command.

    Parameters
    ----------
    name : text in lower case, what the user writes
    summary : text, its line in `raster --help`
    flags : text "module:function"; the function adds the flags to the parser that it is given
    function : text "module:function"; the function takes the arguments and the Messages, and returns the failures, one
        error for each model that failed, and the number of models
    """

    __slots__ = ()

    def add_flags(self, parser) -> None:
        """Add the command's flags to its parser."""
        _imported(self.flags)(parser)

    def load(self):
        """Return the function that runs the command; its modules are imported."""
        return _imported(self.function)


def _imported(name):
    module, _, function = name.partition(":")
    return getattr(import_module(f"{__package__}.{module}"), function)


COMMANDS = {
    each.name: each
    for each in (
        Command(
            "render",
            "draw models, one picture a file",
            "render_flags:add_flags",
            "render_command:render_models",
        ),
        Command(
            "batch",
            "draw many models in several processes, or on many machines",
            "batch_flags:add_flags",
            "batch_command:draw_batch",
        ),
        Command(
            "compare",
            "show flat, Gouraud's and Phong's shading beside the reference, with error maps",
            "compare_flags:add_flags",
            "compare_command:compare_models",
        ),
        Command(
            "bench",
            "measure time against error of each way to draw a model, on this machine",
            "bench_flags:add_flags",
            "bench_command:bench_models",
        ),
        Command(
            "turntable",
            "turn models round, in a moving picture: GIF, WebP, APNG, MP4",
            "turntable_flags:add_flags",
            "turntable_command:turn_models",
        ),
        Command(
            "sheet",
            "lay views of a model, or many models, on one labelled picture",
            "sheet_flags:add_flags",
            "sheet_command:lay_out_models",
        ),
        Command(
            "info",
            "say what is in models: faces, bounds, materials, whether they are watertight",
            "info_flags:add_flags",
            "info_command:describe_models",
        ),
        Command(
            "doctor",
            "say what is installed, and where compiled kernels are kept",
            "doctor_flags:add_flags",
            "doctor_command:examine",
        ),
        Command(
            "view",
            "turn a model in a page of your browser, and pick its faces",
            "view_flags:add_flags",
            "view_command:view_model",
        ),
        Command(
            "demo",
            "draw the model that comes with the package",
            "demo_flags:add_flags",
            "demo_command:draw_demo",
        ),
        Command(
            "completion",
            "print what a shell needs to complete commands, flags and values",
            "completion_flags:add_flags",
            "completion_command:print_completion",
        ),
        Command(
            "warmup",
            "compile all kernels now, so that the first picture doesn't wait for it",
            "warmup_flags:add_flags",
            "warmup_command:run_warmup",
        ),
    )
}
