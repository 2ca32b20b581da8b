"""`raster batch`: many models in several processes, or on many machines."""

from itertools import chain
from time import perf_counter

from ..errors import OutputError, SceneError
from ..options import Options
from . import values
from .flags import add_appearance, add_arrays, add_camera, add_models, add_output, add_processes

IMPORTS = ("drawing", "processes")
_EXAMPLES = """\
examples:
  raster batch 'parts/*.stl' -o 'thumbs/{stem}-{view}.png' --view front,top -j 4
  raster batch parts -o thumbs/ --format webp --changed    a folder, every night
  raster batch parts/*.stl --array rgb --array depth --array object
      -o 'data/{stem}-{view}.{array}.png' --view iso,top -b white
      --manifest data/manifest.jsonl --coco data/coco.json
  raster batch parts/*.stl -o '{stem}-{view}.png' --view random:20 --seed 0
  raster batch 'scans/*.obj' -o pictures/ --scheduler tcp://10.0.0.1:8786 --json

One picture that can't be drawn doesn't stop the others, whatever the reason. Files are never half
written, so a batch that was interrupted goes on with --changed or --skip-existing. These look at
names and times of files alone, not at the options that a file was drawn with. What is left out
counts as done. The last line on stderr, and with --json the last on stdout, counts what was drawn,
skipped and failed.

Of a folder all models in it and below are drawn. Their pictures stay in folders of these names, and
are called as the models: parts/a/gear.stl becomes thumbs/a/gear.stl.png.

A worker of Dask reads a model itself where it sees the same file, of the same length and time of change; otherwise the
model is loaded here and sent. Files are written here.
"""


def add_flags(parser) -> None:
    """Add the flags to the command's parser, and what its help says."""
    parser.usage = "raster batch MODEL... [-o OUT] [-j N] [options]"
    parser.description = "Draw many models in several processes, and write a picture of each, or arrays."
    parser.epilog = _EXAMPLES
    add_models(parser)
    parser.set_defaults(recursive=True, may_be_empty=True)
    add_output(parser, "{stem}", Options.size, has_arrays=True)
    add_arrays(parser)
    group = parser.add_argument_group("work")
    add_processes(group)
    add = group.add_argument
    add("--scheduler", metavar="ADDRESS",
        help="draw on the workers of this scheduler of Dask, tcp://HOST:PORT (extra distributed)")  # fmt: skip
    add("--changed", dest="is_changed", action="store_true",
        help="leave out pictures whose files are there, and no older than the model's file and those that it names, as "
        "textures and materials")  # fmt: skip
    add("--manifest", metavar="FILE",
        help="write a line of JSON for each picture: its files, its camera (K, R, t), and box, mask and visible share "
        "of each object; rz.render_many says more")  # fmt: skip
    add("--coco", metavar="FILE", help="annotations as COCO has them, made of the manifest (extra dataset)")
    add(
        "--bop",
        metavar="FOLDER",
        help="a scene of a BOP dataset, SET/SPLIT/000000, made of the manifest; SET gets the models",
    )
    add("--unit", type=values.number, metavar="MM", default=1000.0,
        help="millimetres of a scene unit, for --bop (default 1000)")  # fmt: skip
    add_camera(parser, has_seed=True)
    add_appearance(parser)


def run(request, messages, *, scheduler, is_changed, manifest, coco, bop, unit) -> tuple[list, int]:
    """Draw every model; parameters, result and errors are those of `drawing.draw_models`."""
    from ..batch.datasets import write_bop, write_coco
    from .outputs import check_scale, plan_targets
    from .processes import can_use_processes, draw_in_processes, shots_of
    from .render import render_view

    start = perf_counter()
    if request.files.scale is not None:
        check_scale(request.files)
    if not can_use_processes(request):
        raise SceneError("raster batch reads and writes files; for stdin and stdout there is raster render")
    if (coco or bop) and not manifest:
        raise SceneError("--coco and --bop are made of a manifest: give --manifest FILE, too")
    plan = plan_targets(request)
    existing = "skip" if request.files.skip_existing else "changed" if is_changed else "replace"
    made = _make_manifest(manifest, coco, plan, existing) if manifest else None
    failures, summary = draw_in_processes(request, messages, plan, render_view, scheduler, existing, made)
    if summary.drawn + summary.skipped and coco:
        write_coco(manifest, coco)
    if summary.drawn + summary.skipped and bop:
        write_bop(manifest, bop, unit=unit, tasks=shots_of(request, plan))
    summary.seconds = perf_counter() - start
    messages.notice(summary.describe("file" if request.files.holds_arrays else "picture"))
    if request.is_json:
        messages.record(vars(summary) | {"seconds": round(summary.seconds, 4)})
    return failures, len(plan)


def _make_manifest(path, coco, plan, existing):
    """Return the Manifest of a run; OutputError where it, or COCO's annotations, would replace another file."""
    from ..batch.datasets import import_pycocotools
    from ..batch.manifest import Manifest
    from ..io.files import are_same

    if coco:
        import_pycocotools()
    manifest = Manifest(path, existing != "replace")
    for target in chain.from_iterable(plan):
        if manifest.is_one_of(target.output):
            raise OutputError(f"can't write {target.output}: it is the manifest")
        for other in (target.output, target.model) if coco else ():
            if are_same(coco, other):
                raise OutputError(f"can't write {coco}: it is {other}; give another name with --coco")
    if coco and manifest.is_one_of(coco):
        raise OutputError(f"can't write {coco}: it is the manifest")
    return manifest
