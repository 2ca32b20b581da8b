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


class Way(NamedTuple):
    """A path, and the edits (file below the package's folder, old text, new text) that leave it out."""

    name: str
    edits: tuple


PATHS = (
    Way("clusters", (("engine/prepared_scene.py", "is_used = self.uses_clusters\n", "return None\n"),)),
    Way(
        "covered bits of small boxes",
        (
            ("pipeline/scan.py", "if covered > 0 and not", "if covered > 2**28 and not"),
            ("pipeline/setup.py", "index(BLOCK if n_small >= LEAST_SMALL else 0)", "index(0)"),
        ),
    ),
    Way(
        "cull: small boxes without a sample",
        (("pipeline/cull.py", "(is_large | is_any_covered(triangle, rows[SIDE + k], left, top))", "True"),),
    ),
    Way("small boxes filled whole", (("pipeline/scan.py", "elif is_small and not", "elif False and not"),)),
    Way(
        "by hand: merge_box",
        (("pipeline/simd.py", '@spelled_out("build_merge_box")', "@helper"),),
    ),
    Way(
        "by hand: planes",
        (
            ("pipeline/simd.py", '@spelled_out("build_evaluate_planes")\ndef evaluate_planes(', "@helper\ndef evaluate_planes("),
            ("pipeline/simd.py", '@spelled_out("build_evaluate_values")\ndef evaluate_values(', "@helper\ndef evaluate_values("),
        ),
    ),
    Way(
        "by hand: planes with slopes",
        (
            ("pipeline/screen_points.py", '@spelled_out("build_evaluate_with_slopes")', "@helper"),
            ("pipeline/texture_planes.py", '@spelled_out("build_evaluate_slopes")\ndef evaluate_slopes(', "@helper\ndef evaluate_slopes("),
        ),
    ),
    Way(
        "limits of lights",
        (
            ("pipeline/lighting.py", "lighting.has_limits and not is_within", "False and not is_within"),
            ("pipeline/lighting.py", "n if lighting.has_limits else 0", "0"),
        ),
    ),
    Way("lights behind a batch", (("pipeline/lighting.py", "if is_behind(batch, n):", "if False:"),)),
    Way(
        "light sets",
        (
            (
                "engine/light_sets.py",
                "if not (any(has_end) or (cones is not None and lights)) or not math.isfinite(diagonal):",
                "if True:",
            ),
        ),
    ),
    Way("distant twins of reflection functions", (("engine/uniforms.py", "function.distant or function.evaluate", "function.evaluate"),)),
    Way("grey sums over lights", (("engine/uniforms.py", "if (colors == greys).all():", "if False:"),)),
    Way("plain bytes", (
        ("pipeline/resolve.py", "if factor == 1 and is_plain", "if False and is_plain"),
        ("pipeline/resolve.py", "is_direct = factor == 1 and", "is_direct = False and"),
    )),
    Way("one sample a pixel", (
        ("pipeline/resolve.py", "if factor == 1 and is_plain", "if False and is_plain"),
        ("pipeline/resolve.py", "is_direct = factor == 1 and", "is_direct = False and"),
        ("pipeline/resolve.py", "    if factor == 1:\n", "    if False:\n"),
        ("pipeline/box_filter.py", "average_single if len(grid[0]) == 1 else", "average_several if len(grid[0]) == 1 else"),
    )),
    Way("pixels covered as a whole", (("pipeline/box_filter.py", "if n_opaque == np.int64(n_here * factor * factor):", "if n_opaque < 0:"),)),
    Way("grey encoding", (("engine/coding.py", "is_grey = bool(np.ptp(plan.tint) == 0.0 and np.ptp(behind) == 0.0)", "is_grey = False"),)),
    Way("common tint", (
        ("engine/plan.py", "    if sources.products is not None or material.texture is not None:\n        return None\n", "    return None\n"),
    )),
    Way("packed entries", (("pipeline/gradients.py", "ints[s.HAS_PLANES + k] & is_good & (way == IN_ENTRIES)", "0"),)),
    Way("planes", (
        ("pipeline/gradients.py", "ints[s.HAS_PLANES + k] & is_good & (way == IN_ENTRIES)", "0"),
        ("pipeline/gradients.py", "ints[s.HAS_PLANES + k] &= way != EXACT", "ints[s.HAS_PLANES + k] = 0"),
        ("pipeline/gradients.py", "ints[s.HAS_PLANES + k] &= ints[s.WAY + k] == IN_PLANES", "ints[s.HAS_PLANES + k] = 0"),
    )),
    Way("float32", (("engine/material_plans.py", "needs = g.NEEDS_DOUBLE if is_double else g.NEEDS_SINGLE", "is_double = True; needs = g.NEEDS_DOUBLE"),)),
    Way("pieces of mixed batches", (("pipeline/shade.py", "is_mixed = has_weighted or (has_affine and band.counts.n_level > 0)", "is_mixed = False"),)),
    Way("extents of rows", (
        ("pipeline/visibility.py", "min(visibility.left[strip], left)", "np.int64(0) if visibility.width else min(visibility.left[strip], left)"),
        ("pipeline/visibility.py", "max(visibility.right[strip], right)", "max(visibility.right[strip], right, np.int64(visibility.width))"),
    )),
    Way("stretches of one material", (("pipeline/visibility.py", "    if material >= 0:\n        return end, material\n", "    if material > -2:\n        return end, np.int64(-1)\n"),)),
    Way("busiest bands first", (("engine/draw.py", 'np.argsort(-n_in_band, kind="stable").tolist()', "list(range(len(n_in_band)))"),)),
    Way("polynomials of powers", (
        ("pipeline/power.py", "power_single if is_single(base) else power_double", "power_libm if is_single(base) else power_double"),
        ("pipeline/power.py", "def power_double(", "def power_libm(base, exponent):\n    return np.float32(min(base, np.float32(1)) ** exponent) if base > 0 else np.float32(0)\n\n\ndef power_double("),
    )),
    Way("casters that a map can't show", (("engine/shadow_maps.py", "        if planes is not None:\n            seen", "        if False:\n            seen"),)),
    Way("buffers from a picture's entries", (("engine/passes.py", "render_pass.opacity is None and counts.n_level == 0", "False"),)),
    Way("blocks of one material", (
        ("pipeline/setup.py", "    if others == 0:\n", "    if others == 1 << 30:\n"),
        ("pipeline/setup.py", "    if n_double == 0:", "    if n_double < 0:"),
    )),
    Way("triangles in parallel on few cores", (("engine/draw.py", "is_long = n_face", "is_long = True or n_face"),)),
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
SCENES = ("scan", "dense", "textured", "room", "look", "quads", "buffers")
SIZE = (1920, 1080)


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
    elif name == "textured":
        scene = scenes.build("globe", SIZE, "studio", "own")
    elif name == "room":  # lamps with shadows, glass, a texture
        scene, options["samples"] = rz.load(scenes.MODELS / "room.json"), 4
        options["exposure"] = 0.2
    elif name == "look":  # several samples, lights that are grey
        scene, options["samples"] = scenes.build(scan, SIZE, "studio", "mono"), 4
    elif name == "quads":  # large triangles in colour
        scene, options["shading"] = scenes.build("quads-front", SIZE, "one", "rgb"), "gouraud"
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
        if self._process.stdout.readline().strip() != "ready":
            raise SystemExit(f"the package in {folder} can't draw these scenes")

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


def leave_out(path: Way, folder: Path) -> None:
    """Copy the package into a folder and leave a path out of the copy."""
    shutil.copytree(ROOT / "rasterizer", folder / "rasterizer", ignore=shutil.ignore_patterns("__pycache__", "kernels"))
    for file, old, new in path.edits:
        target = folder / "rasterizer" / file
        text = target.read_text(encoding="utf-8")
        if text.count(old) != 1:
            raise SystemExit(f"{path.name}: {old!r} stands {text.count(old)} times in {file}")
        target.write_text(text.replace(old, new), encoding="utf-8")


def compare(path: Way, args) -> list[dict]:
    """Draw frames with and without a path in turns; return the medians of each scene."""
    names = args.scenes.split(",")
    arguments = args.scenes, args.scan, args.threads
    with tempfile.TemporaryDirectory() as folder:
        leave_out(path, Path(folder))
        with_it, without = Drawer(ROOT, arguments), Drawer(folder, arguments)
        rows = []
        for k, name in enumerate(names):
            found = [(with_it.draw(k), without.draw(k)) for _ in range(args.frames)]
            times = np.array([[milliseconds for milliseconds, _ in pair] for pair in found])
            ratio = float(np.median(times[:, 1] / times[:, 0]))
            is_same = all(one == other for (_, one), (_, other) in found)
            rows.append({"path": path.name, "scene": name, "ms_with": float(np.median(times[:, 0])),
                         "ms_without": float(np.median(times[:, 1])), "ratio": ratio,
                         "bytes": "same" if is_same else "differ"})  # fmt: skip
        with_it.close()
        without.close()
    return rows


def main(argv=None) -> int:
    """Run the script; the arguments are those of the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("paths", nargs="*", metavar="PATH", help=f"of {', '.join(path.name for path in PATHS)}")
    parser.add_argument("--scan", default="teapot", metavar="FILE", help="a scan (default: the teapot)")
    parser.add_argument("--scenes", default=",".join(SCENES), help="(default: %(default)s)")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--frames", type=int, default=20, help="of each scene (default: %(default)s)")
    measure.add_output(parser)
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
