"""How long does a person wait for a picture of a model, beside f3d on the same machine?

    python bench/whole.py                                  all models but the largest
    python bench/whole.py --models teapot scan.obj --runs 9
    python bench/whole.py --models 10m-stl                 ten million triangles: some minutes

`raster MODEL -o out.png` and `f3d MODEL --output out.png` take turns, each a process of its own, from its start to its
end, with its default look. f3d draws by OpenGL, which Mesa computes on the processor; where there is no display, Xvfb
makes one. Models are made here: a rough torus in four formats; one in OBJ with normals, texture coordinates and twenty
materials, one of half a million quads; three million triangles in any order that share no corner; GLB files with a
thousand small meshes, with four textures of 2048×2048, also with holes and as metals, and with eight blended layers.
Of our time and f3d's the best is compared; of memory and processor time the medians.
"""

import contextlib
import os
import shutil
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path

import numpy as np
import trimesh
from PIL import Image
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # a checkout need not be installed
from bench import measure, scenes

SIZE = "640x480"
N_TEXTURE, TEXTURE_SIZE = 4, 2048
N_LAYER, N_MATERIAL = 8, 20
N_MESH, N_LOOSE = 1000, 3_000_000
MILLION, TEN_MILLIONS = (1000, 500), (2500, 2000)  # rings and sides of a torus: half as many as its triangles


def add_arguments(parser) -> None:
    """Describe the command line."""
    parser.add_argument("--models", nargs="+", default=["teapot", *USUAL], metavar="MODEL",
                        help=f"names or paths of model files, or {', '.join(MADE)}")  # fmt: skip
    parser.add_argument("--runs", type=int, default=5, help="processes of each program (default: %(default)s)")


def measure_models(args):
    """Yield a row for each model: the best and the median of both programs, and ratios of ours over f3d's."""
    with tempfile.TemporaryDirectory() as folder, a_display() as display, measure.Launcher() as launcher:
        lacks = [what for what, is_there in (("f3d", shutil.which("f3d")), ("a display, or Xvfb", display))
                 if not is_there]  # fmt: skip
        if lacks and args.json:
            raise measure.MissingError(f"there isn't {lacks[0]}")
        if lacks:
            print(f"f3d is left out: there isn't {lacks[0]}")
        for name in args.models:
            path = MADE[name](Path(folder, name)) if name in MADE else scenes.find_file(name)
            picture = str(Path(folder, "picture.png"))
            programs = {"ours": [*measure.RASTER, "render", str(path), "-s", SIZE, "-q", "-o", picture]}
            if not lacks:
                programs["f3d"] = ["env", f"DISPLAY={display}", "LIBGL_ALWAYS_SOFTWARE=1", "f3d", str(path),
                                   "--output", picture, "--resolution", SIZE.replace("x", ",")]  # fmt: skip
            row = {"model": name}
            for program, found in launcher.run_turns(programs, args.runs).items():
                row[f"{program}_ms"] = float(found["ms"].min())
                for figure, key in (("median", "ms"), ("cpu", "cpu_ms"), ("mib", "peak_mib")):
                    row[f"{program}_{figure}"] = float(np.median(found[key]))
            if not lacks:
                row["ratio"] = row["ours_ms"] / row["f3d_ms"]
                row |= {f"{key}_ratio": row[f"ours_{key}"] / row[f"f3d_{key}"] for key in ("median", "cpu", "mib")}
            if name in MADE:
                path.unlink()
            yield row


@contextlib.contextmanager
def a_display():
    """Yield the name of a display for OpenGL, "" where there is none."""
    if os.environ.get("DISPLAY") or shutil.which("Xvfb") is None:
        yield os.environ.get("DISPLAY", "")
        return
    reader, writer = os.pipe()
    server = subprocess.Popen(["Xvfb", "-displayfd", str(writer), "-screen", "0", "1280x1024x24", "-nolisten", "tcp"],
                              pass_fds=[writer], stderr=subprocess.DEVNULL)  # fmt: skip
    os.close(writer)
    with os.fdopen(reader) as answer:
        number = answer.readline().strip()  # once the server is ready; nothing where it can't start
    yield f":{number}" if number else ""
    server.terminate()
    server.wait()


# --- models -----------------------------------------------------------------------------------------------------------


def write_torus(path: Path, suffix: str, shape=MILLION) -> Path:
    """Write a torus as rough as a scan."""
    vertices, faces = scenes.torus(*shape)
    rough = np.random.default_rng(1).uniform(0.998, 1.002, (len(vertices), 1))
    return _write(trimesh.Trimesh(vertices * rough, faces, process=False), path, suffix)


def write_materials(path: Path) -> Path:
    """Write a torus with normals, texture coordinates and materials of its parts, as modellers do."""
    vertices, faces = scenes.torus(*MILLION)
    normals = trimesh.Trimesh(vertices, faces, process=False).vertex_normals
    looks = [f"newmtl part{k}\nKd {k / N_MATERIAL:.2f} 0.5 0.5\n" for k in range(N_MATERIAL)]
    path.with_suffix(".mtl").write_text("".join(looks))
    with open(path.with_suffix(".obj"), "w") as file:
        file.write(f"mtllib {path.name}.mtl\n")
        for keyword, rows in (("v", vertices), ("vt", vertices[:, :2] / 3.0 + 0.5), ("vn", normals)):
            file.writelines(f"{keyword} {' '.join(f'{number:.6f}' for number in row)}\n" for row in rows.tolist())
        for k, part in enumerate(np.array_split(faces + 1, N_MATERIAL)):
            file.write(f"usemtl part{k}\n")
            file.writelines(f"f {a}/{a}/{a} {b}/{b}/{b} {c}/{c}/{c}\n" for a, b, c in part.tolist())
    return path.with_suffix(".obj")


def write_quads(path: Path) -> Path:
    """Write a torus of quads."""
    n_ring, n_side = MILLION
    vertices, _ = scenes.torus(*MILLION)
    corners = np.arange(n_ring * n_side).reshape(MILLION)
    ahead = np.roll(corners, -1, 0)
    quads = np.stack([corners, ahead, np.roll(ahead, -1, 1), np.roll(corners, -1, 1)], axis=-1).reshape(-1, 4) + 1
    with open(path.with_suffix(".obj"), "w") as file:
        file.writelines(f"v {x:.6f} {y:.6f} {z:.6f}\n" for x, y, z in vertices.tolist())
        file.writelines(f"f {a} {b} {c} {d}\n" for a, b, c, d in quads.tolist())
    return path.with_suffix(".obj")


def write_loose(path: Path) -> Path:
    """Write small triangles anywhere in a cube, none of which shares a corner with another one."""
    random = np.random.default_rng(3)
    corners = random.uniform(-1.0, 1.0, (N_LOOSE, 1, 3)) + random.uniform(-0.01, 0.01, (N_LOOSE, 3, 3))
    faces = np.arange(3 * N_LOOSE).reshape(-1, 3)
    return _write(trimesh.Trimesh(corners.reshape(-1, 3), faces, process=False), path, ".stl")


def write_meshes(path: Path) -> Path:
    """Write a cube of small spheres, each a mesh of its own."""
    scene, side = trimesh.Scene(), round(N_MESH ** (1 / 3))
    vertices, faces = scenes.icosphere(1)
    for place in np.ndindex(side, side, side):
        scene.add_geometry(trimesh.Trimesh(vertices + 3.0 * np.array(place), faces, process=False))
    return _write(scene, path, ".glb")


def write_textured(path: Path, look: str = "matt") -> Path:
    """Write four tori with a texture of 2048×2048 each: of matt colours, with holes, or of metals that vary."""
    scene, random = trimesh.Scene(), np.random.default_rng(2)
    vertices, faces = scenes.torus(96, 48)
    for k in range(N_TEXTURE):
        coarse = Image.fromarray(random.integers(0, 256, (64, 64, 4 if look == "cut-out" else 3), np.uint8))
        texture = coarse.resize((TEXTURE_SIZE, TEXTURE_SIZE), Image.Resampling.BICUBIC)
        surface = {
            "matt": {"metallicFactor": 0.0},
            "cut-out": {"metallicFactor": 0.0, "alphaMode": "MASK"},
            "metal": {"metallicRoughnessTexture": texture},
        }[look]
        material = TextureVisuals(vertices[:, :2] / 3.0 + 0.5, PBRMaterial(baseColorTexture=texture, **surface))
        place = (0.0, 1.2 * k, 0.0)
        scene.add_geometry(trimesh.Trimesh(vertices + place, faces, visual=material, process=False))
    return _write(scene, path, ".glb")


def write_layers(path: Path) -> Path:
    """Write blended squares, one behind the other."""
    scene = trimesh.Scene()
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
    glass = PBRMaterial(baseColorFactor=(204, 77, 51, 102), metallicFactor=0.0, alphaMode="BLEND", doubleSided=True)
    for k in range(N_LAYER):
        vertices = corners + (0.1 * k, 0.05 * k, -0.2 * k)
        look = TextureVisuals(material=glass)
        scene.add_geometry(trimesh.Trimesh(vertices, [[0, 1, 2], [0, 2, 3]], visual=look, process=False))
    return _write(scene, path, ".glb")


def _write(model, path: Path, suffix: str) -> Path:
    """Write what trimesh holds; return the path with its suffix."""
    path = path.with_suffix(suffix)
    model.export(path)
    return path


MADE = {
    **{f"1m-{name}": partial(write_torus, suffix=f".{name}") for name in ("obj", "ply", "stl", "glb")},
    "1m-materials": write_materials,
    "quads": write_quads,
    "loose": write_loose,
    "meshes": write_meshes,
    "textured": write_textured,
    "cut-out": partial(write_textured, look="cut-out"),
    "metal": partial(write_textured, look="metal"),
    "layers": write_layers,
    "10m-stl": partial(write_torus, suffix=".stl", shape=TEN_MILLIONS),
}
USUAL = [name for name in MADE if name != "10m-stl"]


main = measure.script("whole", __doc__, add_arguments, measure_models)

if __name__ == "__main__":
    sys.exit(main())
