"""What does each path of the renderer earn? The frame with it and without it.

    python bench/paths.py --scan path/to/scan.obj
    python bench/paths.py "packed samples" "spans in pieces" --scenes dense,quads --threads 2

A path is anything that does, only faster, what the rest of the renderer could do as well: a special case, a cheaper
representation, vector instructions by hand. To leave one out, a copy of the package gets a small edit. Two processes,
the package as it is and the copy, draw the same frames in turns; only one of them works at a time. A ratio is the time
without the path over the time with it: 1.25 says that without it a frame takes a quarter longer.

A path that saves less than a tenth on all scenes isn't worth its lines. rasterizer/README.md has the figures of those
that are kept, under Decisions.
"""

import shutil
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # a checkout need not be installed
from bench import measure, scenes


class Variant(NamedTuple):
    """A path, and the edits (file below the package's folder, old text, new text) that leave it out."""

    name: str
    edits: tuple


# fmt: off
PATHS = (
    Variant("packed samples", (("pipeline/gradients.py", "    if n_in_packed > 0:", "    if False:"),)),
    Variant("spans in pieces", (("pipeline/gradients.py", "if count_left(block) > 0:", "if False:"),)),
    Variant("planes", (
        ("pipeline/gradients.py", "&= ints[s.PATH + k] != EXACT", "= 0"),
        ("pipeline/gradients.py", "&= ints[s.PATH + k] == IN_PLANES", "= 0"),
    )),
    Variant("float32", (("engine/plan.py", "np.array([*map(bool, reasons)])", "np.ones(len(reasons), np.bool_)"),)),
    Variant("one channel", (
        ("engine/scene_tables.py", "if is_spectral or self.has_texture[k]", "if True or self.has_texture[k]"),
    )),
    Variant("boxes filled whole", (("pipeline/scan.py", "if is_small and not", "if False and not"),)),
    Variant("spans: by hand", (("pipeline/scan.py", '@spelled_out("build_fill_span")', "@helper"),)),
    Variant("boxes: by hand", (("pipeline/scan.py", '@spelled_out("build_merge_box")', "@helper"),)),
    Variant("planes: by hand", (("pipeline/samples.py", '@spelled_out("build_planes_of_row")', "@helper"),)),
    Variant("planes in ranges: by hand", (("pipeline/samples.py", '@spelled_out("build_values_of_row")', "@helper"),)),
    Variant("passes that look away", (("pipeline/cull.py", "if n_left > 0:", "if True:"),)),
    Variant("light of what is seen", (("engine/lit_points.py", "np.flatnonzero(seen)", "np.arange(len(seen))"),)),
    Variant("slopes: by hand", (
        ("pipeline/samples.py", '@spelled_out("build_slopes_of_row")', "@helper"),
        ("pipeline/samples.py", '@spelled_out("build_both_of_row")', "@helper"),
    )),
    Variant("texels: by hand", (
        ("pipeline/texture_lookup.py", '@spelled_out("build_fetch_texels")', "@helper"),
        ("pipeline/texture_lookup.py", '@spelled_out("build_blend_texels")', "@helper"),
        ("pipeline/texture_lookup.py", '@spelled_out("build_blend_mip_levels")', "@helper"),
    )),
    Variant("cull: boxes without a sample", (
        ("pipeline/cull.py", "(is_large | is_any_covered(triangle, rows[SIDE + k], left, top))", "True"),
    )),
    Variant("lights that don't arrive", (("pipeline/lighting.py", "if arrives(batch, n):", "if True:"),)),
    Variant("pixels covered as a whole", (
        ("pipeline/resolve.py", "if n_opaque == np.int64(n_here * factor * factor):", "if n_opaque < 0:"),
    )),
    Variant("one sample a pixel", (
        ("pipeline/resolve.py",
         "if grid is None:\n        return average_single",
         "if False:\n        return average_single"),
    )),
    Variant("grey encoding", (
        ("engine/uniforms.py", "bool(np.ptp(plan.tint) == 0.0 and np.ptp(behind) == 0.0)", "False"),
    )),
    Variant("extents of rows", (
        ("pipeline/visibility.py",
         "min(visibility.left[strip], left)",
         "np.int64(0) if visibility.width else min(visibility.left[strip], left)"),
        ("pipeline/visibility.py",
         "max(visibility.right[strip], right)",
         "max(visibility.right[strip], right, np.int64(visibility.width))"),
    )),
    Variant("strips of one material", (
        ("pipeline/visibility.py",
         "    left, right = visibility.other_left[strip], visibility.other_right[strip]\n    if left <= first",
         "    left, right = np.int64(0), end\n    if left <= first"),
    )),
    Variant("blocks of one material", (("pipeline/setup.py", "    if others == 0:\n", "    if others == 1 << 30:\n"),)),
    Variant("busiest bands first", (
        ("engine/draw.py",
         'np.argsort(-np.diff(lists.starts), kind="stable").tolist()',
         "range(len(lists.starts) - 1)"),
    )),
    Variant("polynomials of powers", (
        ("pipeline/power.py", "power = by_type(power_single,", "power = by_type(power_libm,"),
        ("pipeline/power.py",
         "def power_double(",
         "def power_libm(base, exponent):\n"
         "    return np.float32(min(base, np.float32(1)) ** exponent) if base > 0 else np.float32(0)\n\n\n"
         "@helper\ndef power_double("),
    )),
    Variant("exponents by squaring", (
        ("pipeline/reflection.py", "if shininess == np.floor(shininess) and", "if False and"),
    )),
    Variant("casters that a map can't show", (
        ("engine/shadow_maps.py", "    if is_any_beyond:\n", "    if False:\n"),
    )),
)
# fmt: on
# What is measured where nothing else is asked for. A path takes half a minute, most of it for compiling.
TOLD = (
    "packed samples",
    "planes",
    "float32",
    "one channel",
    "boxes filled whole",
    "boxes: by hand",
    "planes: by hand",
    "texels: by hand",
    "grey encoding",
    "lights that don't arrive",
)  # fmt: skip
TOLD_SCENES = "scan,dense,confetti,textured,room,quads"
SIZE = (1920, 1080)
# Settings in which people draw such a thing; a scan takes the place of "".
WORKS = {
    "scan": {"case": ""},
    "dense": {"case": "dense", "options": {"shading": "gouraud"}},
    "confetti": {"case": "confetti", "options": {"shading": "gouraud"}},
    "teapot": {"case": "teapot", "options": {"shading": "gouraud"}},
    "gear": {"case": "gear", "options": {"shading": "flat"}},
    "quad-torus": {"case": "quad-torus", "options": {"shading": "gouraud"}},
    "textured": {"case": "textured"},
    "room": {"case": "room", "options": {"samples": 4, "exposure": 0.2}},  # lamps with shadows, glass, a texture
    "look": {"case": "", "lights": "studio", "options": {"samples": 4}},
    "quads": {"case": "quads-front", "channels": "rgb", "options": {"shading": "gouraud", "samples": 4}},
    "buffers": {"case": "", "lights": "studio", "options": {"outputs": ("rgb", "depth", "face", "normal")}},
}


def add_arguments(parser) -> None:
    """Describe the command line."""
    names = [path.name for path in PATHS]
    parser.add_argument("paths", nargs="*", default=TOLD, metavar="PATH",
                        help=f"of {', '.join(names)} (default: {', '.join(TOLD)})")  # fmt: skip
    parser.add_argument("--scan", type=scenes.find_name, default="teapot", metavar="FILE", help="default: the teapot")
    parser.add_argument("--scenes", default=TOLD_SCENES, help=f"of {','.join(WORKS)} (default: %(default)s)")
    measure.add_turns(parser, frames=60, seconds=2.0)


def leave_out(path: Variant, folder: Path) -> Path:
    """Copy the package into a folder, and leave a path out of the copy."""
    shutil.copytree(
        measure.ROOT / "rasterizer", folder / "rasterizer", ignore=shutil.ignore_patterns("__pycache__", "kernels")
    )
    for file, old, new in path.edits:
        target = folder / "rasterizer" / file
        text = target.read_text(encoding="utf-8")
        if text.count(old) != 1:
            raise SystemExit(f"{path.name}: {old!r} stands {text.count(old)} times in {file}")
        target.write_text(text.replace(old, new), encoding="utf-8")
    return folder


def measure_paths(args):
    """Yield a row for each path and scene."""
    of_name = {path.name: path for path in PATHS}
    if unknown := set(args.paths) - of_name.keys():
        raise SystemExit(f"unknown paths: {', '.join(sorted(unknown))}")
    works = {}
    for name in args.scenes.split(","):
        options = {"shading": "phong", "threads": args.threads} | WORKS[name].get("options", {})
        works[name] = {"size": SIZE, **WORKS[name], "case": WORKS[name]["case"] or args.scan, "options": options}
    for path in args.paths:
        with tempfile.TemporaryDirectory() as folder:
            other = leave_out(of_name[path], Path(folder))
            found = measure.compare(list(works.values()), {}, {"folder": other}, args)
            for scene, row in zip(works, found, strict=True):
                yield {"path": path, "scene": scene, "ms_with": row["ms_first"], "ms_without": row["ms_second"],
                       "ratio": row["ratio"], "bytes": row["bytes"]}  # fmt: skip


main = measure.script("paths", __doc__, add_arguments, measure_paths)

if __name__ == "__main__":
    sys.exit(main())
