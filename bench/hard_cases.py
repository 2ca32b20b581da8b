"""What happens in hard cases, and is it right?

    python bench/hard_cases.py                       all of them: a minute or two
    python bench/hard_cases.py --small               small versions, as the tests draw them
    python bench/hard_cases.py --only perspective 10 --save pictures

Each case is drawn with the default tolerance or its own, with tolerance 0 and, but where that would take minutes, by
the float64 reference. The table names the paths that drew it, which must be those that the case is about. The scenes
are in hard_scenes.py. The exit code is 1 where anything is wrong.
"""

import sys
import warnings
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # a checkout need not be installed
from bench import hard_scenes, margins, measure
from bench.hard_scenes import Refused
from rasterizer import RasterizerError, Renderer, reference

EXACT = 1e-6  # of full scale: what tolerance 0 promises
STORED = 2.0**-23  # relative, of an intensity that is kept as float32
DEPTH = 1e-6  # relative
PATHS = ("packed", "planes", "exact")  # as `stats.plan.paths` counts them


def add_arguments(parser) -> None:
    """Describe the command line."""
    parser.add_argument("--small", action="store_true", help="small versions of the large ones")
    parser.add_argument("--only", nargs="+", metavar="WORD", help="cases whose names have one of these words")
    parser.add_argument("--save", metavar="FOLDER", help="where pictures are written of what can be seen")


def measure_cases(args):
    """Yield a row for each case."""
    for case in hard_scenes.CASES:
        if args.only and not any(word in case.name for word in args.only):
            continue
        row, frame = measure_case(case, args.small)
        if args.save and case.is_shown and frame is not None:
            Path(args.save).mkdir(exist_ok=True)
            frame.save(Path(args.save) / f"{slug(case.name)}.png")
        yield row


def measure_case(case, is_small) -> tuple[dict, object]:
    """Draw a case and compare it; return its row, and the frame; None where it is refused."""
    made = case.make(is_small)
    if isinstance(made, Refused):
        return refuse(case, made), None
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        frame, exact = (draw(made, **tolerance) for tolerance in ({}, {"tolerance": 0.0}))
    texts = [str(each.message) for each in caught]
    faults = [f"a warning: {text}" for text in texts if not made.warning or made.warning not in text]
    faults += [f"no warning of {made.warning}"] * (bool(made.warning) and not texts)
    row = {"case": case.name, "why": case.why, "seen": int((frame.face >= 0).sum()), "bound": frame.stats.error_bound,
           "steps": [step[0] for step in frame.stats.steps]}  # fmt: skip
    if not np.isfinite(frame.color).all() or (frame.has("depth") and np.isnan(frame.depth).any()):
        faults.append("a colour or a depth isn't finite")
    if made.expect is not None and made.expect(frame):
        faults.append(made.expect(frame))
    row["path"] = ", ".join(name for name, n in zip(PATHS, frame.stats.plan.paths, strict=True) if n)
    if row["path"] != case.path:
        faults.append(f"it is drawn by {row['path']}, not by {case.path}")
    if made.has_reference:
        expected = reference_picture(made)
        row |= compare(made, frame, exact, faults, expected, case.why.startswith("A limit"))
        row["figure"] = "" if made.figure is None else made.figure(frame, expected)
    row["faults"] = faults
    row["result"] = "; ".join(faults) or ("right, but next to steps" if row.get("is_at_step") else "right")
    return row, frame


def refuse(case, made) -> dict:
    """Try what must be refused; return the row."""
    faults = []
    for name, call in made.calls.items():
        try:
            call()
        except RasterizerError:
            continue
        faults.append(f"{name} are not refused")
    return {"case": case.name, "why": case.why, "seen": 0, "bound": None, "steps": [], "path": "", "faults": faults,
            "result": "; ".join(faults) or "refused"}  # fmt: skip


def draw(made, **options):
    """Draw a scene with all that is compared."""
    settings = {"shading": "gouraud", "outputs": ("color", "depth", "face")} | made.options | options
    with Renderer(made.scene, made.size, **{"samples": 1} | settings) as renderer:
        return renderer.render()


def reference_picture(made):
    """The reference's picture of a scene."""
    settings = {"shading": "gouraud"} | {k: v for k, v in made.options.items() if k not in ("outputs", "tolerance")}
    with np.errstate(all="ignore"):
        return reference.render(made.scene, made.size, **settings)


def compare(made, frame, exact, faults, expected, is_limit=False) -> dict:
    """Compare both frames with the reference's picture; add what is wrong to the faults.

    A pixel in which two surfaces are nearer to each other than depth can tell is unclear: counted, not compared.
    Errors above their bounds are no faults of a limit, if the frame says that its illumination has steps.
    """
    resolution = margins.depth_resolution(made.scene, made.size, expected.depth)
    is_hit, is_clear = expected.face >= 0, expected.margin > resolution
    wrong = int(((frame.face >= 0) != is_hit).sum() + (is_clear & is_hit & (frame.face != expected.face)).sum())
    if wrong:
        faults.append(f"{wrong} samples show what they should not")
    is_same = is_hit & (frame.face == expected.face) & is_clear
    scale = max(float(np.abs(expected.color).max(initial=0.0)), 1.0)
    depth = 0.0
    if frame.has("depth"):
        depth = np.abs(frame.depth[is_same] / expected.depth[is_same] - 1.0).max(initial=0.0)
    errors = {name: np.abs(one.color[is_same] - expected.color[is_same]).max(initial=0.0)
              for name, one in (("error", frame), ("exact", exact))}  # fmt: skip
    stored = STORED * np.abs(expected.color).max(initial=0.0)
    bound = np.inf if frame.stats.error_bound is None else frame.stats.error_bound
    is_over = errors["error"] > bound + stored or errors["exact"] > EXACT * scale + stored
    if depth > DEPTH:
        faults.append(f"depths are off by {depth:.1e}")
    if is_over and not (is_limit and frame.stats.steps):
        faults.append("an error is above its bound")
    of_bound = errors["error"] / max(bound + stored, np.finfo(float).tiny)
    return {"wrong": wrong, "unclear": int((is_hit & ~is_clear).sum()), "depth": float(depth),
            "exact": float(errors["exact"]), "error": float(errors["error"]), "of_bound": float(of_bound),
            "is_at_step": bool(is_over)}  # fmt: skip


def slug(name) -> str:
    """A name as that of a file."""
    return "-".join("".join(c if c.isalnum() else " " for c in name).split())


main = measure.script("hard_cases", __doc__, add_arguments, measure_cases)

if __name__ == "__main__":
    sys.exit(main())
