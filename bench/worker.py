"""A process that draws frames whenever it is asked to; `measure.Worker` starts it.

    python bench/worker.py FOLDER PAINTER WORKS

The package is that of a folder, the scenes are those of this checkout. Works are a JSON list; each has a `case` of
scenes.py, a `size`, maybe `lights` and `channels`, `options` of our Renderer, the number of `cores`, a `texture`, a
`speck`. A line of the input is the number of a work, and maybe the name of a file for its arrays; answers are lines of
JSON. What libraries print goes to stderr.
"""

import hashlib
import json
import os
import sys
from dataclasses import replace
from pathlib import Path
from time import perf_counter, process_time

import numpy as np

SPECK = 16  # pixels along a side: 256 of the picture's two million at 1080p
# What a speck in a corner of the picture is made of; "plain" is what the mesh is made of.
SPECKS = {
    "plain": {},
    "textured": {"texture": np.tile(np.uint8([[255, 128], [128, 255]]), (32, 32))},
    "glass": {"opacity": 0.5},
    "toon": {"reflection": "toon"},
    "coloured": {"diffuse": (0.8, 0.5, 0.3)},
}


class Painter:
    """Draw the same picture whenever asked to, by this package; `rgba` and `depth` are those of the last one."""

    def __init__(self, work: dict):
        import rasterizer as rz

        self.scene, self.size = scene_of(work), tuple(work["size"])
        if work.get("speck"):
            self.scene = with_speck(self.scene, self.size, work["speck"])
        self.options = {"outputs": ("rgb",), "samples": 1, "threads": 1} | work.get("options", {})
        self.renderer = rz.Renderer(self.scene, self.size, **self.options)
        self.version = f"rasterizer {rz.__version__}"

    def draw(self) -> None:
        """Draw a frame."""
        self.frame = self.renderer.render()

    @property
    def rgba(self) -> np.ndarray:
        """(height, width, 4) uint8."""
        return self.frame.rgba

    @property
    def depth(self) -> np.ndarray:
        """Distances along the view in the centres of pixels, (height, width) float32."""
        import rasterizer as rz

        return rz.render(self.scene, self.size, **self.options | {"outputs": ("depth",)}).depth


def scene_of(work: dict):
    """Build the scene of a work. One with a `texture`, True or False, is for other renderers, too: all is grey but the
    texture."""
    import rasterizer as rz
    from bench import scenes

    size = tuple(work["size"])
    scene = scenes.build(work["case"], size, work.get("lights", "one"), work.get("channels", "mono"))
    if "texture" not in work:
        return scene
    look = rz.Material(diffuse=0.7, specular=0.2, shininess=32)
    if work["texture"]:
        look = replace(look, texture=rz.Texture(scenes.MODELS / "globe.png"))
    plain = {"material": look, "materials": None, "face_material": None, "colors": None, "face_colors": None}
    lights = (rz.AmbientLight(0.1), rz.DirectionalLight((0.4, -0.5, -1.0), 0.9, "camera"))
    return replace(scene, meshes=tuple(replace(mesh, **plain) for mesh in scene.meshes), lights=lights)


def with_speck(scene, size, speck: str):
    """Add a square of SPECK pixels in the upper left corner, as far away as the middle of the scene."""
    import rasterizer as rz

    view, look = scene.camera_for(size).view(), scene.meshes[0].palette[0]
    distance = (scene.bounds.mean(axis=0) - view.eye) @ view.forward
    pixel = 2.0 * distance * np.tan(np.radians(scene.camera_for(size).fov) / 2.0) / size[1]  # its width there
    across, down = pixel * view.right, -pixel * view.up
    corner = view.eye + distance * view.forward - (0.5 * size[0] - 4) * across - (0.5 * size[1] - 4) * down
    vertices = [corner + SPECK * (x * across + y * down) for x, y in ((0, 0), (0, 1), (1, 1), (1, 0))]
    square = rz.Mesh(vertices, [[0, 1, 2], [0, 2, 3]], np.tile(-view.forward, (4, 1)),
                     uv=[[0, 1], [0, 0], [1, 0], [1, 1]], material=replace(look, **SPECKS[speck]))  # fmt: skip
    return replace(scene, meshes=(*scene.meshes, square))


def main(folder: str, painter: str, works: str) -> None:
    """Draw, until nothing more is asked."""
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    works = json.loads(works)
    try:
        sys.path.insert(0, folder)
        import rasterizer  # noqa: F401  that of the folder, before this checkout comes in front

        sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
        if "cores" in works[0]:
            os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[: works[0]["cores"]])
            os.environ["LP_NUM_THREADS"] = str(works[0]["cores"])  # llvmpipe's
        if painter == "llvmpipe":
            from bench.peers_llvmpipe import Painter as Other
        painters = [(Other if painter == "llvmpipe" else Painter)(work) for work in works]
        for each in painters:
            for _ in range(3):  # shaders and kernels are compiled, memory is allocated
                each.draw()
    except Exception as fault:  # whatever a library raises where there is no driver, no display, no memory
        print(json.dumps({"failure": f"{type(fault).__name__}: {fault}".partition("\n")[0]}), file=answers)
        return
    print(json.dumps({"version": painters[0].version, "triangles": painters[0].scene.n_face}), file=answers)
    for line in sys.stdin:
        k, _, save = line.strip().partition(" ")
        each = painters[int(k)]
        start, start_cpu = perf_counter(), process_time()
        each.draw()
        cpu, wall = process_time() - start_cpu, perf_counter() - start
        digest = hashlib.sha256(np.ascontiguousarray(each.rgba).tobytes()).hexdigest()[:12]
        if save:
            np.savez(save, rgba=each.rgba, **({"depth": each.depth} if painter == "ours" else {}))
        print(json.dumps({"ms": 1000.0 * wall, "cpu_ms": 1000.0 * cpu, "digest": digest}), file=answers)


if __name__ == "__main__":
    main(*sys.argv[1:])
