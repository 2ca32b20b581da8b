"""What does each path of the renderer earn? The frame with it and without it.

    python bench/paths.py --scan path/to/scan.obj
    python bench/paths.py "packed entries" "common tint" --scenes dense,quads --threads 2

A path is anything that does, only faster, what the rest of the renderer could do as well: a special case, a cheaper
representation, vector instructions by hand. To leave one out, a copy of the package gets a small edit. Two processes,
the package as it is and the copy, draw the same frames in turns; only one of them works at a time. A ratio is the time
without the path over the time with it: 1.25 says that without it a frame takes a quarter longer.

A path that saves less than a tenth on all scenes isn't worth its lines. rasterizer/README.md has the figures of those
that are kept, under Decisions.
"""

import argparse
import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))  # a checkout need not be installed
from bench import measure


class Variant(NamedTuple):
    """A path, and the edits (file below the package's folder, old text, new text) that leave it out."""

    name: str
    edits: tuple


PATHS = (
    Variant("packed entries", (("pipeline/gradients.py", "    if n_in_entries > 0:", "    if False:"),)),
    Variant("spans in pieces", (("pipeline/gradients.py", "if count_left(block) > 0:", "if False:"),)),
    Variant(
        "planes",
        (
            ("pipeline/gradients.py", "&= ints[s.PATH + k] != EXACT", "= 0"),
            ("pipeline/gradients.py", "&= ints[s.PATH + k] == IN_PLANES", "= 0"),
        ),
    ),
    Variant(
        "float32",
        (
            (
                "engine/plan.py",
                "np.array([*map(bool, reasons)])",
                "np.ones(len(reasons), np.bool_)",
            ),
        ),
    ),
    Variant(
        "one channel",
        (("engine/scene_tables.py", "if is_spectral or self.has_texture[k]", "if True or self.has_texture[k]"),),
    ),
    Variant("boxes filled whole", (("pipeline/scan.py", "if is_small and not", "if False and not"),)),
    Variant("spans: by hand", (("pipeline/scan.py", '@spelled_out("build_fill_span")', "@helper"),)),
    Variant("boxes: by hand", (("pipeline/scan.py", '@spelled_out("build_merge_box")', "@helper"),)),
    Variant("planes: by hand", (("pipeline/samples.py", '@spelled_out("build_planes_of_row")', "@helper"),)),
    Variant("planes in ranges: by hand", (("pipeline/samples.py", '@spelled_out("build_values_of_row")', "@helper"),)),
    Variant("passes that look away", (("pipeline/cull.py", "if n_left > 0:", "if True:"),)),
    Variant("light of what is seen", (("engine/lit_points.py", "np.flatnonzero(seen)", "np.arange(len(seen))"),)),
    Variant(
        "slopes: by hand",
        (
            ("pipeline/samples.py", '@spelled_out("build_slopes_of_row")', "@helper"),
            ("pipeline/samples.py", '@spelled_out("build_both_of_row")', "@helper"),
        ),
    ),
    Variant(
        "texels: by hand",
        (
            ("pipeline/texture_lookup.py", '@spelled_out("build_fetch_texels")', "@helper"),
            ("pipeline/texture_lookup.py", '@spelled_out("build_blend_texels")', "@helper"),
            ("pipeline/texture_lookup.py", '@spelled_out("build_blend_mip_levels")', "@helper"),
        ),
    ),
    Variant(
        "cull: boxes without a sample",
        (("pipeline/cull.py", "(is_large | is_any_covered(triangle, rows[SIDE + k], left, top))", "True"),),
    ),
    Variant("lights that don't arrive", (("pipeline/lighting.py", "if arrives(batch, n):", "if True:"),)),
    Variant(
        "pixels covered as a whole",
        (("pipeline/resolve.py", "if n_opaque == np.int64(n_here * factor * factor):", "if n_opaque < 0:"),),
    ),
    Variant(
        "one sample a pixel",
        (("pipeline/resolve.py", "if factor_of(grid) == 1:", "if False:"),),
    ),
    Variant(
        "grey encoding",
        (("engine/uniforms.py", "bool(np.ptp(plan.tint) == 0.0 and np.ptp(behind) == 0.0)", "False"),),
    ),
    Variant(
        "extents of rows",
        (
            (
                "pipeline/visibility.py",
                "min(visibility.left[strip], left)",
                "np.int64(0) if visibility.width else min(visibility.left[strip], left)",
            ),
            (
                "pipeline/visibility.py",
                "max(visibility.right[strip], right)",
                "max(visibility.right[strip], right, np.int64(visibility.width))",
            ),
        ),
    ),
    Variant(
        "strips of one material",
        (
            (
                "pipeline/visibility.py",
                "    left, right = visibility.other_left[strip], visibility.other_right[strip]\n    if left <= first",
                "    left, right = np.int64(0), end\n    if left <= first",
            ),
        ),
    ),
    Variant(
        "blocks of one material",
        (("pipeline/setup.py", "    if others == 0:\n", "    if others == 1 << 30:\n"),),
    ),
    Variant(
        "busiest bands first",
        (
            (
                "engine/draw.py",
                'np.argsort(-np.diff(lists.starts), kind="stable").tolist()',
                "range(len(lists.starts) - 1)",
            ),
        ),
    ),
    Variant(
        "polynomials of powers",
        (
            (
                "pipeline/power.py",
                "power = by_type(power_single,",
                "power = by_type(power_libm,",
            ),
            (
                "pipeline/power.py",
                "def power_double(",
                "def power_libm(base, exponent):\n"
                "    return np.float32(min(base, np.float32(1)) ** exponent) if base > 0 else np.float32(0)\n\n\n"
                "@helper\ndef power_double(",
            ),
        ),
    ),
    Variant(
        "exponents by squaring",
        (("pipeline/reflection.py", "if shininess == np.floor(shininess) and", "if False and"),),
    ),
    Variant(
        "casters that a map can't show",
        (
            (
                "engine/shadow_maps.py",
                "    if is_any_beyond:\n",
                "    if False:\n",
            ),
        ),
    ),
)

CHILD = """
import sys, time
import rasterizer as rz
from bench import paths, scenes
renderers = paths.make_renderers(sys.argv[1].split(","), sys.argv[2], int(sys.argv[3]))
for renderer in renderers:
    renderer.render()
print("ready", flush=True)
for line in sys.stdin:
    renderer = renderers[int(line)]
    start = time.perf_counter()
    frame = renderer.render()
    milliseconds = 1000 * (time.perf_counter() - start)
    print(milliseconds, paths.digest(frame), flush=True)
"""
SCENES = ("scan", "dense", "confetti", "teapot", "gear", "quad-torus", "textured", "room", "look", "quads", "buffers")
SIZE = (1920, 1080)
MAX_TIME = 4000  # milliseconds of the frames of a scene, unless three take longer


def make_renderers(names, scan, threads):
    """Return a renderer for each of the scenes' names."""
    return [make_renderer(name, scan, threads) for name in names]


def make_renderer(name, scan, threads):
    """Return the renderer of a scene: settings in which people draw such a thing."""
    import rasterizer as rz
    from bench import scenes

    options = {"outputs": ("rgb",), "threads": threads, "samples": 1, "shading": "phong"}
    if name == "scan":  # as it comes, by Phong's method
        scene = scenes.build(scan, SIZE, "one", "mono")
    elif name == "dense":  # small triangles, by Gouraud's
        scene, options["shading"] = scenes.build("dense", SIZE, "one", "mono"), "gouraud"
    elif name in ("confetti", "teapot", "quad-torus"):  # triangles of middle size, and quads
        scene, options["shading"] = scenes.build(name, SIZE, "one", "mono"), "gouraud"
    elif name == "gear":
        scene, options["shading"] = scenes.build(name, SIZE, "one", "mono"), "flat"
    elif name == "textured":
        scene = scenes.build("textured", SIZE)
    elif name == "room":  # lamps with shadows, glass, a texture
        scene, options["samples"] = scenes.build("room", SIZE), 4
        options["exposure"] = 0.2
    elif name == "look":  # several samples, lights that are grey
        scene, options["samples"] = scenes.build(scan, SIZE, "studio", "mono"), 4
    elif name == "quads":  # large triangles in colour, with several samples
        scene, options["shading"] = scenes.build("quads-front", SIZE, "one", "rgb"), "gouraud"
        options["samples"] = 4
    else:
        scene = scenes.build(scan, SIZE, "studio", "mono")
        options["outputs"] = ("rgb", "depth", "face", "normal")
    return rz.Renderer(scene, SIZE, **options)


def digest(frame) -> str:
    """Return what tells pictures of different bytes apart."""
    return hashlib.sha256(np.ascontiguousarray(frame.rgb).tobytes()).hexdigest()[:12]


class Drawer:
    """A process that draws a frame of a scene whenever it is asked to."""

    def __init__(self, folder, arguments):
        environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(folder), str(ROOT)])}
        self._process = subprocess.Popen([sys.executable, "-c", CHILD, *map(str, arguments)], env=environment,
                                         text=True, cwd=ROOT.anchor,
                                         stdin=subprocess.PIPE, stdout=subprocess.PIPE)  # fmt: skip
        self._folder = folder

    def wait(self) -> None:
        """Wait until all scenes are ready."""
        if self._process.stdout.readline().strip() != "ready":
            raise SystemExit(f"the package in {self._folder} can't draw these scenes")

    def draw(self, k) -> tuple[float, str]:
        """Milliseconds of one frame of scene number k, and what its bytes are."""
        self._process.stdin.write(f"{k}\n")
        self._process.stdin.flush()
        milliseconds, found = self._process.stdout.readline().split()
        return float(milliseconds), found

    def close(self) -> None:
        """End the process."""
        self._process.stdin.close()
        self._process.wait()


def leave_out(path: Variant, folder: Path) -> None:
    """Copy the package into a folder and leave a path out of the copy."""
    shutil.copytree(ROOT / "rasterizer", folder / "rasterizer", ignore=shutil.ignore_patterns("__pycache__", "kernels"))
    for file, old, new in path.edits:
        target = folder / "rasterizer" / file
        text = target.read_text(encoding="utf-8")
        if text.count(old) != 1:
            raise SystemExit(f"{path.name}: {old!r} stands {text.count(old)} times in {file}")
        target.write_text(text.replace(old, new), encoding="utf-8")


def compare(path: Variant, args) -> list[dict]:
    """Draw frames with and without a path in turns; return the medians of each scene."""
    names = args.scenes.split(",")
    arguments = args.scenes, args.scan, args.threads
    with tempfile.TemporaryDirectory() as folder:
        leave_out(path, Path(folder))
        with_it, without = Drawer(ROOT, arguments), Drawer(folder, arguments)
        with_it.wait()
        without.wait()
        rows = []
        for k, name in enumerate(names):
            n = max(3, min(args.frames, int(MAX_TIME / (with_it.draw(k)[0] + without.draw(k)[0]))))
            found = [(with_it.draw(k), without.draw(k)) for _ in range(n)]
            times = np.array([[milliseconds for milliseconds, _ in pair] for pair in found])
            ratio = float(np.median(times[:, 1] / times[:, 0]))
            is_same = all(one == other for (_, one), (_, other) in found)
            rows.append({"path": path.name, "scene": name, "ms_with": float(np.median(times[:, 0])),
                         "ms_without": float(np.median(times[:, 1])), "ratio": ratio,
                         "bytes": "same" if is_same else "differ"})  # fmt: skip
        with_it.close()
        without.close()
    return rows


def make_parser() -> argparse.ArgumentParser:
    """Describe the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("paths", nargs="*", metavar="PATH", help=f"of {', '.join(path.name for path in PATHS)}")
    parser.add_argument("--scan", default="teapot", metavar="FILE", help="a scan (default: the teapot)")
    parser.add_argument("--scenes", default=",".join(SCENES), help="(default: %(default)s)")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--frames", type=int, default=20, help="of each scene (default: %(default)s)")
    measure.add_output(parser)
    return parser


def main(argv=None) -> int:
    """Run the script; the arguments are those of the command line."""
    parser = make_parser()
    args = parser.parse_args(argv)
    args.scan = str(Path(args.scan).resolve()) if Path(args.scan).exists() else args.scan
    unknown = set(args.paths) - {path.name for path in PATHS}
    if unknown:
        parser.error(f"unknown paths: {', '.join(sorted(unknown))}")
    machine, rows = measure.Machine(), []
    table = measure.Table([("path                                  ", "path", ""), ("scene   ", "scene", ""),
                           ("   with", "ms_with", ".2f"), ("without", "ms_without", ".2f"), ("ratio", "ratio", ".3f"),
                           ("bytes ", "bytes", "")])  # fmt: skip
    for path in PATHS:
        if not args.paths or path.name in args.paths:
            for row in compare(path, args):
                table.print(row)
                rows.append(row)
    measure.print_json("paths", machine, args, rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
