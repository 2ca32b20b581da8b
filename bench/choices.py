"""What do shading, subdivision, samples, shadows, textures and spectra cost, and what do they buy?

    python bench/choices.py                                            the scenes of the page: two minutes
    python bench/choices.py path/to/scan.obj room --seconds 60

What `raster bench` and axes.py measure of one model is measured of some that differ: time and error of every method,
and of what else a scene has. `raster bench --help` explains the figures; the last line is JSON.
"""

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # a checkout need not be installed
import rasterizer as rz
from bench import measure, scenes
from bench.axes import measure_axes
from rasterizer.analysis import speed_error_plot
from rasterizer.analysis.speed_error import Errors, Method, Row, list_methods, study

MODELS = ("teapot", "knot", "globe", "room", "table")
WITH_AXES = ("globe", "room", "table")  # of the others only the methods are measured
ONLY_AXES = ("room", "table")
OF_AXES = 0.4  # of the time of a scene that has both

COLUMNS = [
    ("model     ", "model", ""), ("what          ", "what", ""), ("value" + " " * 26, "value", ""),
    ("     ms", "ms", ".2f"), ("rms err", "rms", ".1e"), ("max err", "max", ".2f"), ("   ΔE", "delta_e", ".3f"),
    ("of method", "of_method", ".1e"), ("of sampling", "of_sampling", ".1e"), ("against", "against", ""),
]  # fmt: skip


def main(argv=None) -> int:
    """Run the script; the arguments are those of the command line."""
    args = make_parser().parse_args(argv)
    machine, table, rows = measure.Machine(), measure.Table(COLUMNS), []
    for model in args.models:
        for row in measure_model(model, args):
            rows.append({"model": Path(model).stem} | row)
            table.print(rows[-1])
    measure.write_plot(args.plot, plot, rows)
    measure.print_json("choices", machine, args, rows)
    return 0


def make_parser() -> argparse.ArgumentParser:
    """Describe the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("models", nargs="*", default=MODELS, metavar="MODEL", help="a model file, or a name in models/")
    parser.add_argument("--size", type=scenes.size_of, default=(640, 480), help="default: 640x480")
    parser.add_argument("--threads", type=int, default=1, help="default: %(default)s")
    parser.add_argument("--seconds", type=float, default=25.0, help="time limit of a scene (default: %(default)s)")
    measure.add_output(parser, "time against error of the first scene")
    return parser


def measure_model(model, args):
    """Yield a row for each method, and for each value of what else a scene has."""
    scene = make_scene(model)
    options, axes_seconds = {"threads": args.threads}, OF_AXES * args.seconds if model in WITH_AXES else 0.0
    if model not in ONLY_AXES:
        methods = list_methods(("flat", "gouraud", "phong"), (0, 1, 2), (1, 4, 16), (1 / 4096,))
        found = study(scene, args.size, methods, args.seconds - axes_seconds, lambda *_: None, **options)
        for row in found.rows:
            yield {"what": "method", "value": str(row.method), "triangles": scene.n_face * 4**row.method.subdivisions,
                   **row.method._asdict(), "ms": row.ms, **errors_of(row.error), "of_method": row.of_method,
                   "of_sampling": row.of_sampling, "is_beaten": row.is_beaten}  # fmt: skip
    if axes_seconds:
        for row in measure_axes(scene, args.size, axes_seconds, lambda *_: None, **options).rows:
            yield {"what": row.axis, "value": row.value, "ms": row.ms, "ratio": row.ratio,
                   **(errors_of(row.error) if row.error else {}), "against": row.against}  # fmt: skip


def make_scene(model):
    """Load a scene; the table gets two lights with shadows."""
    if model == "room":
        return rz.load(scenes.MODELS / "room.json")
    scene = rz.load(scenes.find_file(model))
    if model == "table":
        lights = (rz.AmbientLight(0.15), rz.DirectionalLight((-1, -1.2, -0.4), 0.5, shadow=True),
                  rz.PointLight((1.6, 2.2, 1.2), 0.4, shadow=True))  # fmt: skip
        return rz.Scene(scene.meshes, lights, rz.Camera.framing(scene, elevation=35))
    return scene


def plot(rows, suffix) -> bytes:
    """Plot time against error of the first scene of which methods were measured."""
    rows = [row for row in rows if row["what"] == "method"]
    rows = [row for row in rows if row["model"] == rows[0]["model"]]
    found = []
    for row in rows:
        errors = Errors(row["max"], row["rms"], 0, row["over_one"], row["delta_e"])
        method = Method(*(row[name] for name in Method._fields))
        found.append(Row(method, row["ms"], errors, row["of_method"], row["of_sampling"], row["is_beaten"]))
    return speed_error_plot.plot(found, f"{rows[0]['model']}: time against error", suffix)


def errors_of(error) -> dict:
    """The figures of an `Errors` that are kept."""
    return {"rms": error.rms, "max": error.max, "delta_e": error.delta_e, "over_one": error.over_one}


if __name__ == "__main__":
    sys.exit(main())
