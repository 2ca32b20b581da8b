"""`raster batch`: many models in several processes, or on many machines."""

from time import perf_counter

from ..choices import ARRAY_SUFFIXES, RANDOM
from ..errors import OutputError, SceneError
from ..options import Options
from . import values
from .flags import add_arrays, add_camera, add_look, add_models, add_output, add_processes

IMPORTS = ("drawing", "processes")
_EXAMPLES = """\
examples:
  raster batch 'parts/*.stl' -o 'thumbs/{stem}-{view}.png' --view front,top -j 4
  raster batch parts --recursive -o thumbs/ --skip-existing  below thumbs/
  raster batch parts/*.stl --array rgb --array depth --array object
      -o 'data/{stem}-{view}.{array}.png' --view iso,top -b white
      --manifest data/manifest.jsonl --coco data/coco.json
  raster batch parts/*.stl -o '{stem}-{view}.png' --view random:20 --seed 0
  raster batch 'scans/*.obj' -o pictures/ --scheduler tcp://10.0.0.1:8786 --json

One picture that can't be drawn doesn't stop the others, whatever the reason. A file appears whole or not at all, so a
batch that was interrupted goes on with --resume or --skip-existing; these don't ask how a file was made. The last line
on stderr, and with --json the last on stdout, counts what was drawn, skipped and failed.

Dask's workers read models themselves where they see the same file, of the same length and time of change; else it is
loaded here and sent. Files are written here.
"""


def add_flags(parser) -> None:
    """Add the flags to the command's parser, and what its help says."""
    parser.usage = "raster batch MODEL... [-o OUT] [-j N] [options]"
    parser.description = "Draw each model in one of several processes, and write a picture of it, or arrays."
    parser.epilog = _EXAMPLES
    add_models(parser)
    add_output(parser, "{stem}", Options.size, has_arrays=True)
    add_arrays(parser)
    group = parser.add_argument_group("work")
    add_processes(group)
    add = group.add_argument
    add("--scheduler", metavar="ADDRESS",
        help="draw on the workers of this scheduler of Dask, tcp://HOST:PORT (extra distributed)")  # fmt: skip
    add("--resume", dest="is_resumed", action="store_true",
        help="leave out pictures whose file is there and no older than the model's")  # fmt: skip
    add("--manifest", metavar="FILE",
        help="write a line of JSON for each picture: its files, its camera (K, R, t), and box, mask and visible share "
        "of each object; rz.render_many says more")  # fmt: skip
    add("--coco", metavar="FILE", help="annotations as COCO has them, made of the manifest (extra dataset)")
    add("--bop", metavar="FOLDER", help="a scene of a BOP dataset, made of the manifest")
    add("--unit", type=values.number, metavar="MM", default=1000.0,
        help="millimetres of a scene unit, for --bop (default 1000)")  # fmt: skip
    add_camera(parser, has_seed=True)
    add_look(parser)


def run(arguments, messages) -> tuple[list, int]:
    """Draw every model; parameters, result and errors are those of `drawing.draw_models`."""
    from ..batch.rendering import is_there
    from .drawing import make_settings
    from .outputs import by_view, check_scale, holds_arrays, plan_targets, without
    from .processes import can_use_processes, draw_in_processes
    from .render import render_model

    def is_left_out(target) -> bool:
        if arguments.skip_existing:
            return is_there(target.output, None)
        return arguments.is_resumed and is_there(target.output, target.model)

    start = perf_counter()
    settings = make_settings(arguments)
    check_scale(arguments)
    if not can_use_processes(arguments):
        raise SceneError("raster batch reads and writes files; for stdin and stdout there is raster render")
    if (arguments.coco or arguments.bop) and not arguments.manifest:
        raise SceneError("--coco and --bop are made of a manifest: give --manifest FILE, too")
    plan = plan_targets(arguments)
    if arguments.manifest:
        manifest = _Manifest(arguments, [view for targets in plan for view in by_view(targets)])
        plan, n_left_out = without(plan, manifest.left_out(is_left_out).__contains__)
    else:
        manifest, (plan, n_left_out) = None, without(plan, is_left_out)
    note = None if manifest is None else manifest.note
    try:
        failures, n_model, summary = draw_in_processes(
            arguments, settings, messages, plan, render_model, arguments.scheduler, note
        )
        if manifest is not None:
            manifest.finish()
    finally:
        if manifest is not None:
            manifest.close()
    summary.skipped, summary.seconds = n_left_out, perf_counter() - start
    messages.notice(summary.describe("file" if holds_arrays(arguments) else "picture"))
    if arguments.json:
        messages.record(vars(summary) | {"seconds": round(summary.seconds, 4)})
    return failures, n_model


class _Manifest:
    """The manifest of a run, and what is made of it.

    Parameters
    ----------
    arguments : those of the command
    views : lists of targets, the files of one picture each
    """

    def __init__(self, arguments, views):
        from ..batch.datasets import import_pycocotools
        from ..batch.manifest import Manifest
        from ..io.files import are_same

        self._arguments, self._views = arguments, views
        if arguments.coco:
            import_pycocotools()
        self._file = Manifest(arguments.manifest, arguments.skip_existing or arguments.is_resumed)
        self._numbers = {view[0].output: number for number, view in enumerate(views)}
        for target in (target for view in views for target in view):
            if self._file.is_one_of(target.output):
                raise OutputError(f"can't write {target.output}: it is the manifest")
            for path in (target.output, target.model) if arguments.coco else ():
                if are_same(arguments.coco, path):
                    raise OutputError(f"can't write {arguments.coco}: it is {path}; give another name with --coco")
        if arguments.coco and self._file.is_one_of(arguments.coco):
            raise OutputError(f"can't write {arguments.coco}: it is the manifest")
        self._file.open()
        self.close = self._file.close

    def left_out(self, is_left_out) -> set:
        """Return the targets that are left out: all of a view, where the manifest has its line, or none."""
        from .outputs import needed_outputs

        found, outputs = set(), needed_outputs(self._arguments)
        for number, view in enumerate(self._views):
            if all(map(is_left_out, view)) and self._file.keep(number, _named_files(view, outputs)):
                found.update(view)
        return found

    def note(self, view, said, outputs) -> None:
        """Add the line of a picture that was written."""
        from ..batch.manifest import depth_scale
        from .outputs import seed_of

        number = self._numbers[view[0].output]
        view, files = self._views[number], _named_files(self._views[number], outputs)
        scale = depth_scale(files, self._arguments.scale)
        name = view[0].view if seed_of(view[0].view) is None else RANDOM
        of_task = {"model": view[0].model, "seed": view[0].seed, "view": name, "depth_scale": scale}
        self._file.add(number, files, of_task | said)

    def finish(self) -> None:
        """Put the lines in order; make COCO's annotations and BOP's folders."""
        from ..batch.datasets import write_bop, write_coco

        has_lines = self._file.finish()
        if has_lines and self._arguments.coco:
            write_coco(self._arguments.manifest, self._arguments.coco)
        if has_lines and self._arguments.bop:
            write_bop(self._arguments.manifest, self._arguments.bop, unit=self._arguments.unit)


def _named_files(view, outputs) -> dict[str, str]:
    """Return the path of each array's file of a picture by its name, that of the picture itself as "rgb"; `outputs` are
    those of the frame."""
    from .outputs import suffix_of

    plain = outputs if suffix_of(view[0].output) in ARRAY_SUFFIXES else ("rgb",)
    return {name: target.output for target in view for name in target.arrays or plain}
