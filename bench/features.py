"""What does each thing that a scene may use cost?

    python bench/features.py                       lights, materials, shadows, textures, layers, spectra; buffers
    python bench/features.py --model path/to/scan.obj --size 1080p

Light and material: a square that fills the picture, Phong's shading, so that every pixel is lit. Buffers: those of a
model without its backs, and of quads as large as the picture, alone and beside a picture. One thread.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # a checkout need not be installed
import rasterizer as rz
from bench import measure, scenes

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


def add_arguments(parser) -> None:
    """Describe the command line."""
    add = parser.add_argument
    add("--model", default="dense-torus", help="whose buffers are drawn (default: %(default)s)")
    add("--size", type=scenes.size_of, default=(1920, 1080), help="default: 1080p")
    add("--seconds", type=float, default=20.0, help="time limit of each table (default: %(default)s)")
    add("--frames", type=int, default=25, help="most of each (default: %(default)s)")


def measure_features(args):
    """Yield a row for each feature, then for each set of buffers of a model, and of quads as large as the picture."""
    features = list_features()
    pictures = {name: (scene, args.size, {"shading": "phong"} | options)
                for name, (scene, options, _) in features.items()}  # fmt: skip
    ms = measure.medians(pictures, args.seconds, args.frames)
    for name, (_, _, count) in features.items():
        more = 1e6 * (ms[name] - ms["plain"]) / count / (args.size[0] * args.size[1])
        with rz.Renderer(*pictures[name][:2], outputs=("rgb",), **{"samples": 1} | pictures[name][2]) as renderer:
            dtype = str(renderer.plan.dtype)
        yield {"feature": name, "ms": ms[name], "ns_more": more if name != "plain" else None, "dtype": dtype}
    for name in (args.model, "quads-back"):
        scene, cull = scenes.build(name, args.size, "one", "mono"), "none" if "quads" in name else "back"
        pictures = {what: (scene, args.size, {"shading": shading, "outputs": outputs, "cull": cull})
                    for what, (shading, outputs) in BUFFERS.items()}  # fmt: skip
        ms = measure.medians(pictures, args.seconds / 2, args.frames)
        for what in BUFFERS:
            yield {"scene": Path(name).stem, "outputs": what, "ms_1": ms[what], "ratio_1": ms[what] / ms["Gouraud"]}


main = measure.script("features", __doc__, add_arguments, measure_features)

if __name__ == "__main__":
    sys.exit(main())
