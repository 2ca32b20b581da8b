"""What does each thing that a scene may use cost?

    python bench/features.py                       lights, materials, shadows, textures, layers, spectra; buffers
    python bench/features.py --model path/to/scan.obj --size 1080p

Light and material: a square that fills the picture, Phong's shading, so that every pixel is lit. Shadow maps: those of
a model, drawn anew for every frame, because their light moves with the camera. Buffers: those of the model, and of
quads as large as the picture, alone and beside a picture. Columns are explained in bench/README.md.
"""

import argparse
import sys
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # a checkout need not be installed
import rasterizer as rz
from bench import measure, scenes
from rasterizer.analysis.speed_error_plot import BLUE, ORANGE, check_plotting, figure_bytes
from rasterizer.analysis.timing import take_turns

LOOK = rz.Material(diffuse=0.6, specular=0.3, shininess=32)
SUN = rz.DirectionalLight((-0.3, -0.2, -1.0), 0.5)
MORE = 4  # lights added at once: what one of them costs is a quarter
EVERY = ("depth", "face", "normal")
# What is drawn, beside a picture or alone, against Gouraud's picture: (shading, outputs).
BUFFERS = {
    "Gouraud": ("gouraud", ("rgb",)),
    "depth": ("gouraud", ("depth",)),
    "face": ("gouraud", ("face",)),
    "normal": ("gouraud", ("normal",)),
    "depth, face, normal": ("gouraud", EVERY),
    "Gouraud and depth": ("gouraud", ("rgb", "depth")),
    "Gouraud and all": ("gouraud", ("rgb", *EVERY)),
    "Phong": ("phong", ("rgb",)),
    "Phong and depth": ("phong", ("rgb", "depth")),
    "Phong and all": ("phong", ("rgb", *EVERY)),
}
CAMERA = rz.Camera.perspective((0, 0, 1), (0, 0, 0), fov=40)


def square(material, **attributes):
    """A square that fills any picture, with normals that differ."""
    normals = [[0.1, 0, 0.99], [-0.1, 0, 0.99], [0, 0.2, 0.98], [0, -0.2, 0.98]]
    vertices = [[-4, -4, -1], [4, -4, -1], [4, 4, -1], [-4, 4, -1]]
    uv = [[0, 0], [4, 0], [4, 4], [0, 4]]
    return rz.Mesh(vertices, [[0, 1, 2], [0, 2, 3]], normals, uv=uv, material=material, **attributes)


def scene_of(material=LOOK, lights=(SUN,), n_layer=1):
    """The square, or several behind each other."""
    moved = [np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, -0.1 * k], [0, 0, 0, 1]], float) for k in range(n_layer)]
    return rz.Scene([square(material).transformed(matrix) for matrix in moved], lights, CAMERA)


def list_features() -> dict:
    """name -> (scene, options, how many of the thing are added to the plain square)."""
    checks = (np.indices((64, 64)).sum(axis=0) // 8 % 2 * 200 + 55).astype(np.uint8)
    suns = [rz.DirectionalLight((0.1 * k - 0.3, -0.2, -1.0), 0.1) for k in range(MORE)]
    lamps = [rz.PointLight((30 * k - 20, 20, 30), 0.1, (1, 0.01, 0)) for k in range(MORE)]
    spots = [rz.SpotLight((30 * k - 20, 20, 30), (-k, -1, -1), 0.1, 30, 60) for k in range(MORE)]
    features = {"plain": (scene_of(), {}, 1)}
    for name, lights in (("directional light", suns), ("point light", lamps), ("spot light", spots)):
        features[name] = (scene_of(lights=(SUN, *lights)), {}, MORE)
    for name in ("blinn", "lambert", "oren-nayar", "cook-torrance", "toon"):
        features[name] = (scene_of(replace(LOOK, reflection=name)), {}, 1)
    shaped = [replace(spot, falloff=2.0) for spot in spots]
    features["spot light, falloff 2"] = (scene_of(lights=(SUN, *shaped)), {}, MORE)
    features["coloured F0"] = (scene_of(replace(LOOK, fresnel=(1.0, 0.8, 0.3))), {}, 1)
    brushed = replace(LOOK, reflection="cook-torrance", roughness=(0.1, 0.4))
    for name, tangent in (("u", "u"), ("an axis", (0, 1, 0))):
        features[f"brushed along {name}"] = (scene_of(replace(brushed, tangent=tangent)), {}, 1)
    features["depth cue"] = (replace(scene_of(), depth_cue=2.0), {}, 1)
    for name in ("nearest", "bilinear", "trilinear"):
        features[f"texture, {name}"] = (scene_of(replace(LOOK, texture=rz.Texture(checks, filter=name))), {}, 1)
    features["4 samples"] = (scene_of(), {"samples": 4}, 1)
    features["float64"] = (scene_of(), {"tolerance": 0.0}, 1)
    features["spectrum, 81 samples"] = (scene_of(), {"spectral": 81}, 1)
    features["shadow, look-up"] = (scene_of(lights=(replace(SUN, shadow=True),)), {}, 1)
    features["shadow, filter 3"] = (scene_of(lights=(replace(SUN, shadow=rz.Shadow(filter=3)),)), {}, 1)
    lamp = rz.PointLight((0, 0, -0.5), 0.1, (1, 0.01, 0), shadow=True)
    features["shadow, six maps"] = (scene_of(lights=(SUN, lamp)), {}, 1)
    for n_layer in (1, 4):
        features[f"layers, {n_layer}"] = (scene_of(replace(LOOK, opacity=0.5), n_layer=n_layer), {}, n_layer)
    return features


def main(argv=None) -> int:
    """Run the script; the arguments are those of the command line."""
    args = make_parser().parse_args(argv)
    machine = measure.Machine()
    rows = [*measure_features(args), *measure_maps(args), *measure_buffers(args)]
    measure.write_plot(args.plot, plot, rows)
    measure.print_json("features", machine, args, rows)
    return 0


def make_parser() -> argparse.ArgumentParser:
    """Describe the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", default="dense-torus", help="whose shadow maps are drawn (default: %(default)s)")
    parser.add_argument("--size", default="1080p")
    parser.add_argument("--seconds", type=float, default=20.0, help="time limit of each table (default: %(default)s)")
    parser.add_argument("--frames", type=int, default=25)
    measure.add_output(parser, "what a pixel pays for each thing")
    return parser


def measure_features(args):
    """Frames of all features in turns, with one thread."""
    size = scenes.size_of(args.size)
    table = measure.Table([("feature               ", "feature", ""), ("    ms", "ms", ".2f"),
                           ("more ns/px", "ns_more", ".2f"),
                           ("dtype    ", "dtype", "")])  # fmt: skip
    with ExitStack() as stack:
        calls, dtypes, features = {}, {}, list_features()
        for name, (scene, options, _) in features.items():
            renderer = stack.enter_context(
                rz.Renderer(scene, size, shading="phong", outputs=("rgb",), threads=1, **{"samples": 1} | options)
            )
            renderer.render()
            calls[name], dtypes[name] = renderer.render, renderer.plan.dtype
        turns = take_turns(calls, args.seconds, args.frames)
    median = {name: float(np.median(times)) for name, (times, _) in turns.items()}
    for name, (_, _, count) in features.items():
        more = 1e6 * (median[name] - median["plain"]) / count / (size[0] * size[1])
        row = {"feature": name, "ms": median[name], "ns_more": more if name != "plain" else None, "dtype": dtypes[name]}
        table.print(row)
        yield row


def measure_maps(args):
    """Shadow maps of a model: of a directional light, and of a point light in its middle, which needs six."""
    table = measure.Table([("light          ", "light", ""), ("triangles", "triangles", "d"), ("texels", "texels", "d"),
                           (" ms 1T", "ms_1", ".2f"), (" ms 2T", "ms_2", ".2f")])  # fmt: skip
    size = scenes.size_of("64")
    meshes = scenes.build(args.model, size, "one", "mono").meshes
    # Lights of the camera are drawn anew for every picture; this one is in the middle of what the camera frames.
    scene = rz.Scene(meshes)
    inside = (0.0, 0.0, -float(np.linalg.norm(scene.bounds.mean(axis=0) - scene.camera_for(size).view().eye)))
    for name, light in (("directional", rz.DirectionalLight((-0.5, -1, -0.4), attached="camera", shadow=True)),
                        ("point, six maps", rz.PointLight(inside, attached="camera", shadow=True))):  # fmt: skip
        with ExitStack() as stack:
            calls = {}
            for n_thread in (1, 2):
                renderer = stack.enter_context(
                    rz.Renderer(rz.Scene(meshes, [light]), size, outputs=("rgb",), threads=n_thread, samples=1)
                )
                renderer.render()
                calls[n_thread] = renderer.render
            turns = take_turns(calls, args.seconds / 4, args.frames)
        ms = {n: float(np.median([stats.milliseconds["shadows"] for stats in turns[n][1]])) for n in calls}
        row = {"light": name, "triangles": sum(mesh.n_face for mesh in meshes), "texels": light.shadow.size}
        row |= {"ms_1": ms[1], "ms_2": ms[2]}
        table.print(row)
        yield row


def measure_buffers(args):
    """Depth, faces and normals of a model and of quads as large as the picture; back faces of the model are left
    out."""
    table = measure.Table([("scene       ", "scene", ""), ("outputs            ", "outputs", ""),
                           (" ms 1T", "ms_1", ".2f"), ("/Gouraud", "ratio_1", ".2f"),
                           (" ms 2T", "ms_2", ".2f"), ("/Gouraud", "ratio_2", ".2f")])  # fmt: skip
    size = scenes.size_of(args.size)
    for name in (args.model, "quads-back"):
        scene, cull, median = scenes.build(name, size, "one", "mono"), "none" if "quads" in name else "back", {}
        for n_thread in (1, 2):
            with ExitStack() as stack:
                calls = {}
                for what, (shading, outputs) in BUFFERS.items():
                    options = {"shading": shading, "outputs": outputs, "cull": cull, "threads": n_thread}
                    calls[what] = stack.enter_context(rz.Renderer(scene, size, **{"samples": 1} | options)).render
                    calls[what]()
                turns = take_turns(calls, args.seconds / 4, args.frames)
            median[n_thread] = {what: float(np.median(times)) for what, (times, _) in turns.items()}
        for what in BUFFERS:
            row = {"scene": Path(name).stem, "outputs": what}
            for n, ms in median.items():
                row |= {f"ms_{n}": ms[what], f"ratio_{n}": ms[what] / ms["Gouraud"]}
            table.print(row)
            yield row


def plot(rows, suffix) -> bytes:
    """Plot a bar for each thing: nanoseconds a pixel that it adds to the plain picture."""
    check_plotting()
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    rows = [row for row in rows if row.get("ns_more") is not None]
    rows = sorted(rows, key=lambda row: row["ns_more"])
    figure = Figure(figsize=(7.5, 0.27 * len(rows) + 1.0), layout="constrained")
    axes = figure.add_subplot()
    colors = [BLUE if row["dtype"] == "float32" else ORANGE for row in rows]
    bars = axes.barh([row["feature"] for row in rows], [row["ns_more"] for row in rows], color=colors)
    axes.bar_label(bars, fmt="%.1f", padding=3, fontsize=8)
    axes.set_xlabel("nanoseconds a pixel, more than the plain picture; for each thing added")
    axes.spines[["top", "right"]].set_visible(False)
    axes.margins(x=0.1, y=0.01)
    axes.legend(handles=[Patch(color=BLUE, label="float32"), Patch(color=ORANGE, label="float64")], loc="lower right")
    return figure_bytes(figure, suffix)


if __name__ == "__main__":
    sys.exit(main())
