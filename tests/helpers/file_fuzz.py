"""Damaged and generated files of every format, a seed each: loaded and drawn, one after the other, under caps of time
and memory.

    python -m helpers.file_fuzz FIRST COUNT       the seeds FIRST, FIRST + 1, ...: a line for each that fails, a summary
    python -m helpers.file_fuzz SEED 1 --keep D   one alone; its files are left in the folder D

A case is good if it draws a picture, or if it ends in an error of the package that names the file. Warnings must be
UserWarnings that name a file. Anything else is a fault: another exception, an internal error, a case that takes too
long or too much memory.
"""

import argparse
import io
import json
import logging
import os
import resource
import signal
import struct
import sys
import tempfile
import time
import warnings
import zipfile
from functools import cache
from pathlib import Path

import numpy as np
import trimesh
from numba.core import event
from PIL import Image

import rasterizer as rz
from helpers.model_bytes import (
    COLORED_THREEMF,
    GLB,
    PLY_HEADER,
    THREEMF,
    box,
    exported,
    gltf_with,
    metal_gltf,
    rich_gltf,
    threemf,
    zipped,
)  # fmt: skip
from helpers.other_models import XAML, dae, threedxml
from rasterizer.io.scene_file import read_scene
from rasterizer.scene.texture import ENVIRONMENT

SECONDS = 10  # that a case may take on a machine that does other things, too
MEGABYTES = 700  # that a case may add to the largest size of the process
ADDRESSES = 3 * 2**30  # bytes of address space beyond those of the start: what is asked for beyond fails at once
SIZE = (16, 12)


class Fault(Exception):
    """What must not happen."""


class TooLong(BaseException):
    """Raised by the alarm; no guard catches it."""


class Compiling(event.Listener):
    """Listen to the compiler: while it works, the time of a case doesn't count."""

    depth = 0

    def on_start(self, _event):
        self.depth += 1

    def on_end(self, _event):
        self.depth -= 1


def _alarm(compiling):
    def ring(*_):
        if compiling.depth:
            signal.setitimer(signal.ITIMER_REAL, SECONDS)
        else:
            raise TooLong

    return ring


def run_case(seed, folder) -> str:
    """Write the files of a case, load and draw them; return what became of it: "drawn", "empty" or "refused"."""
    name, files = make_case(np.random.default_rng(seed))
    for old in Path(folder).iterdir():
        old.unlink()
    for each, data in files.items():
        (Path(folder) / each).write_bytes(data)
    path = os.path.join(folder, name)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    signal.setitimer(signal.ITIMER_REAL, SECONDS)
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            outcome = _load_and_draw(path)
    except TooLong:
        raise Fault(f"takes more than {SECONDS} s") from None
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    if grown > MEGABYTES:
        raise Fault(f"takes {grown:.0f} MB")
    for warning in caught:
        if os.path.basename(os.path.dirname(warning.filename)) == "PIL":  # what Pillow thinks of a picture
            continue
        if warning.category is not UserWarning or not str(warning.message).startswith(folder):
            raise Fault(f"{warning.category.__name__}: {warning.message}")
    return outcome


def _load_and_draw(path) -> str:
    try:
        if path.endswith(".json"):
            read = read_scene(path)
            scene, options = read.finished_scene(), dict(read.options)
            rz.Options(**options)
            options |= {"size": SIZE, "samples": 1, "threads": 1}
        else:
            scene, options = rz.load(path), {"size": SIZE, "threads": 1}
        is_sane = _is_sane(scene)
        with warnings.catch_warnings():
            warnings.simplefilter("always" if is_sane else "ignore")
            frame = rz.render(scene, **{"samples": 1} | options | {"outputs": ("color", "depth", "face")})
    except (rz.ModelError, rz.SceneError) as fault:
        text = str(fault)
        is_ours = os.path.dirname(path) in text or (isinstance(fault, rz.SceneError) and not path.endswith(".json"))
        is_ours = is_ours or (isinstance(fault, rz.SceneError) and "options" in locals())
        if "internal error" in text or "more memory than" in text or not is_ours or len(text) > 2000:
            raise Fault(f"{type(fault).__name__}: {text[:500]}") from fault
        return "refused"
    if (frame.face >= scene.n_face).any() or (
        is_sane and not (np.isfinite(frame.color).all() and not np.isnan(frame.depth).any())
    ):
        raise Fault("the picture is not finite")
    return "drawn" if (frame.face >= 0).any() else "empty"


def _is_sane(scene) -> bool:
    """Tell whether float32 can hold all colours, and the square of all distances: beyond it pictures may be too bright
    to be told."""
    palette = [material for mesh in scene.meshes for material in mesh.palette]
    colors = [c for m in palette for c in (*m.ambient, *m.diffuse, *m.specular, *m.emissive)]
    colors += [c for light in scene.lights for c in light.color]
    lengths = np.abs(scene.bounds[1] - scene.bounds[0])
    return max(np.abs(colors)) < 1e10 and 1e-10 < lengths.max() < 1e10 and np.abs(scene.bounds).max() < 1e10


def main():
    """Run the seeds that the command line asks for."""
    parser = argparse.ArgumentParser()
    parser.add_argument("first", type=int)
    parser.add_argument("count", type=int)
    parser.add_argument("--keep", metavar="FOLDER")
    parser.add_argument("--traceback", action="store_true")
    given = parser.parse_args()
    os.environ[ENVIRONMENT] = str(2**18)  # so that no case decodes pictures for seconds
    compiling = Compiling()
    event.register("numba:compiler_lock", compiling)
    signal.signal(signal.SIGALRM, _alarm(compiling))
    rz.render(rz.load(Path(__file__).parents[2] / "models" / "cube.obj"), SIZE, threads=1, samples=1)
    used = (
        int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        if sys.platform == "linux"
        else 2**40
    )
    resource.setrlimit(resource.RLIMIT_AS, (used + ADDRESSES, resource.RLIM_INFINITY))
    counts, start = {"drawn": 0, "empty": 0, "refused": 0, "faults": 0}, time.perf_counter()
    with tempfile.TemporaryDirectory(dir="/dev/shm" if os.path.isdir("/dev/shm") else None) as temporary:
        folder = given.keep or temporary
        os.makedirs(folder, exist_ok=True)
        for seed in range(given.first, given.first + given.count):
            try:
                counts[run_case(seed, folder)] += 1
            except Exception as fault:
                counts["faults"] += 1
                text = " ".join(str(fault).replace(folder + os.sep, "").split())[:600]
                print(
                    f"seed {seed} (python {__file__} {seed} 1 --traceback): {type(fault).__name__}: {text}", flush=True
                )
                if given.traceback:
                    raise
    print(json.dumps(counts | {"seconds": round(time.perf_counter() - start, 1)}))
    return 1 if counts["faults"] else 0


# ── the files of a case: seeds of every format, and the ways in which they are damaged ─────────────────────


logging.getLogger("trimesh").addHandler(logging.NullHandler())  # it warns of packages that it would like to have

NUMBERS = (
    b"-1", b"0", b"1", b"2", b"3", b"255", b"65536", b"2147483647", b"4294967295", b"-2147483649",
    b"99999999999999999999", b"1e30",
    b"-1e308", b"1e-320", b"nan", b"inf", b"0.5", b"1e99", b"-0", b"007", b"1_0", b"0x10", b"1e", b"\xd9\xa3", b"",
)  # fmt: skip
VALUES = (
    None, True, False, -1, 0, 1, 2, 3, 2**31 - 1, 2**32, 2**63, 10**20, 10**400, 0.5, -1.5, 1e308, 1e-320,
    float("inf"), float("nan"),
    "", "a", "../x", "/dev/zero", "wood.png", "data:;base64,AAAA", "\ud800", "a" * 300, "\0", [], [0], [[0, 1, 2]], {},
    {"a": 1},
)  # fmt: skip
PICTURES = ("PNG", "JPEG", "WEBP", "BMP", "TGA", "TIFF", "GIF")
OBJ = b"""mtllib a.mtl
o first
v 0 0 0
v 1 0 0 1 0 0
v 1 1 0
v 0 1 0.5
vn 0 0 1
vt 0 0
vt 1 0
vt 1 1
usemtl a
s 1
f 1/1/1 2/2/1 3/3/1
f 1/1 3/3 4/2
o second
g part
usemtl b
f -1 -2 -3 -4
f 1//1 2//1 4//1
s off
f 2 3 4
"""
MTL = (
    b"newmtl a\nKa 1 1 1\nKd 0.5 0.6 0.7\nKs 0.2 0.2 0.2\nNs 30\nd 0.9\nmap_Kd -clamp on wood.png\nmap_d wood.png\n"
    b"newmtl b\nillum 0\nTr 0.2\nKe 0 1 0\n"
)
PLY_PICTURED = (
    PLY_HEADER.replace("ascii 1.0\n", "ascii 1.0\ncomment TextureFile wood.png\n").format(
        n_face=1, face_properties="property list uchar float texcoord\nproperty int texnumber\n"
    )
    + "3 0 1 2 6 0 0 1 0 1 1 0\n"
)
PLY_STRIPS = PLY_PICTURED.replace("end_header", "element tristrips 1\nproperty list int int a\nend_header")
TRIANGLE = {
    "vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], "faces": [[0, 1, 2], [0, 2, 3]],
    "uv": [[0, 0], [1, 0], [0, 1], [1, 1]],
}  # fmt: skip
SCENE = {
    "meshes": [
        TRIANGLE | {"normals": [[0, 0, 1]] * 4, "polygons": [0, 1], "smoothing": [1, 2], "material": "a", "name": "t",
                    "transform": {"scale": 1, "rotate": {"axis": [0, 0, 1], "angle": 3}, "translate": [0, 0, 1]}},
        TRIANGLE | {"materials": ["a", "b"], "face_material": [0, 1], "face_colors": [[1, 0, 0], [0, 1, 0]],
        "crease_angle": 20},
        {"arrays": "a.npz", "mesh": 0, "material": {"texture": {"arrays": "a.npz", "texture": 0}}},
        {"file": "part.obj", "transform": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], "material": "b"},
    ],
    "materials": {
        "a": {"diffuse": "red", "texture": {"file": "wood.png", "filter": "nearest", "wrap": ["clamp", "mirror"]},
        "opacity": 0.5},
        "b": {"diffuse": [0.1, 0.2, 0.3], "reflection": "cook-torrance", "roughness": 0.3, "fresnel": 0.1,
        "shininess": 5.5},
    },
    "lights": ["studio", {"kind": "spot", "position": [0, 0, 5], "direction": [0, 0, -1], "inner": 5, "outer": 30,
    "exponent": 2,
                          "attenuation": "1/(d+3)", "range": 50, "amplify": True},
               {"kind": "area", "corner": [1, 1, 3], "edge_u": [1, 0, 0], "edge_v": [0, 1, 0], "resolution": [2, 2],
                "shadow": {"size": 16, "filter": 3}},
               {"kind": "point", "position": [1, 2, 3],
               "color": {"wavelengths": [400, 500, 700], "values": [1, 0.5, 0.2]}}],
    "camera": {"azimuth": 20, "elevation": 30, "fov": 30, "margin": 0.1},
    "background": "white", "up": "z",
    "options": {"shading": "phong", "size": [16, 12], "samples": 1, "exposure": 0.5, "color_range": "local"},
}  # fmt: skip


def make_case(random) -> tuple[str, dict[str, bytes]]:
    """Return the name of the file that is loaded, and the bytes of all files by name."""
    kinds = list(MAKERS)
    weights = np.array([WEIGHTS.get(kind, 1.0) for kind in kinds])
    return MAKERS[kinds[random.choice(len(kinds), p=weights / weights.sum())]](random)


# --- ways to damage -----------------------------------------------------------------------------------------


def damaged(random, data) -> bytes:
    """Bytes with one to four faults."""
    data = bytearray(data)
    for _ in range(random.integers(1, 5)):
        at = int(random.integers(0, len(data) + 1))
        length = int(random.integers(1, 12))
        match random.integers(0, 9):
            case 0:
                del data[at:]
            case 1:
                del data[at : at + length]
            case 2 if at < len(data):
                data[at] ^= 1 << int(random.integers(0, 8))
            case 3:
                data[at : at + 4] = struct.pack("<q", int(random.choice([-1, 0, 1, 2**31 - 1, 2**16, 2**31, 2**24])))[
                    :4
                ]
            case 4:
                data[at:at] = data[int(random.integers(0, len(data) + 1)) :][: length * 8]
            case 5:
                data[at:at] = bytes(random.integers(0, 256, length, dtype=np.uint8))
            case 6:
                data[at : at + 8] = struct.pack("<d", float(random.choice([np.nan, np.inf, 1e300, -1e-310, 0.0])))
            case _:
                _other_number(random, data)
    return bytes(data)


def _other_number(random, data) -> None:
    """Put another number or word in place of one that is written as text."""
    words = [i for i, (a, b) in enumerate(zip(b" " + data, data, strict=False)) if a in b" \n/,[:" and b not in b" \n"]
    if words:
        start = words[int(random.integers(0, len(words)))]
        end = start
        while end < len(data) and data[end] not in b" \n/,]}":
            end += 1
        data[start:end] = NUMBERS[int(random.integers(0, len(NUMBERS)))]


def changed(random, tree):
    """A tree of JSON with one to three values replaced, repeated or taken out."""
    tree = json.loads(json.dumps(tree))
    for _ in range(random.integers(1, 4)):
        places = list(_places(tree))
        if not places:
            break
        holder, key = places[int(random.integers(0, len(places)))]
        match random.integers(0, 6):
            case 0:
                del holder[key]
            case 1 if isinstance(holder, list):
                holder.insert(key, holder[key])
            case 2 if isinstance(holder[key], (int, float)) and not isinstance(holder[key], bool):
                holder[key] = holder[key] * int(random.choice([-1, 2, 1000])) + int(random.integers(-1, 2))
            case 3:
                other, name = places[int(random.integers(0, len(places)))]
                is_there = name in (other if isinstance(other, dict) else range(len(other)))
                holder[key] = json.loads(json.dumps(other[name])) if is_there else 0
            case _:
                holder[key] = VALUES[int(random.integers(0, len(VALUES)))]
    return tree


def _places(tree):
    for key in list(tree) if isinstance(tree, dict) else range(len(tree)) if isinstance(tree, list) else ():
        yield tree, key
        yield from _places(tree[key])


# --- seeds --------------------------------------------------------------------------------------------------


@cache
def picture(format="PNG", mode="RGB", size=(5, 3)) -> bytes:
    """A small picture."""
    stream = io.BytesIO()
    pixels = np.random.default_rng(3).integers(0, 256, (size[1], size[0], 4), dtype=np.uint8)
    image = Image.fromarray(pixels).convert(mode)
    image.save(stream, format)
    return stream.getvalue()


@cache
def seeds() -> dict[str, list[bytes]]:
    """Good files by format."""
    quads = PLY_HEADER.format(
        n_face=2, face_properties="property uchar red\nproperty uchar green\nproperty uchar blue\n"
    )
    colored = box()
    colored.visual.vertex_colors = np.arange(32, dtype=np.uint8).reshape(8, 4) * 8
    return {
        "stl": [exported(box(), "stl"), exported(box(), "stl_ascii"), b"COLOR=abcd".ljust(84, b"\1")],
        "ply": [exported(colored, "ply", vertex_normal=True), exported(box(), "ply", encoding="ascii"),
                (PLY_STRIPS + "5 0 1 2 3 -1\n").encode(), PLY_PICTURED.encode(),
                (quads + "4 0 1 2 3 9 9 9\n3 0 1 2 1 2 3\n").encode()],
        "off": [exported(box(), "off"),
                b"OFF # c\n5 3 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n-1 0 0\n\n5 0 1 2 3 4\n3 0 1 2\n4 3 2 1 0\n"],
        "glb": [GLB, exported(trimesh.Scene([box(), colored]), "glb")],
        "gltf": [gltf_with(lambda tree, primitive: None), rich_gltf(), metal_gltf()],
        "3mf": [threemf(), threemf(COLORED_THREEMF, **{"3D/a.png": picture()})],
        "dae": [dae().encode(), dae(diffuse="<color>1 0 0 1</color>").encode()],
        "zae": [zipped({"a.dae": dae(), "wood.png": picture()})],
        "3dxml": [threedxml()],
        "xaml": [XAML.encode()],
    }  # fmt: skip


@cache
def arrays() -> dict[str, np.ndarray]:
    """The arrays of a mesh and a texture."""
    rng = np.random.default_rng(5)
    return {
        "mesh0_vertices": np.array(TRIANGLE["vertices"], float), "mesh0_faces": np.array(TRIANGLE["faces"], np.uint32),
        "mesh0_uv": np.array(TRIANGLE["uv"], float), "texture0": rng.random((4, 4, 3)),
    }  # fmt: skip


def npz(arrays, compress=False) -> bytes:
    """The arrays as an .npz file."""
    stream = io.BytesIO()
    (np.savez_compressed if compress else np.savez)(stream, **arrays)
    return stream.getvalue()


# --- cases --------------------------------------------------------------------------------------------------


def _plain(format):
    def make(random):
        choices = seeds()[format]
        return f"m.{format}", {f"m.{format}": damaged(random, choices[int(random.integers(0, len(choices)))])}

    return make


def _obj(random):
    return "m.obj", {"m.obj": damaged(random, OBJ), "a.mtl": MTL, "wood.png": picture()}


def _lines(random):
    """An OBJ file of random lines."""
    keys = ("v", "v", "v", "vn", "vt", "f", "f", "f", "f", "s", "g", "o", "usemtl", "mtllib", "l", "p", "#", "\\")
    words = [
        "1", "2", "3", "4", "-1", "1/1", "1//1", "2/2/1", "3/", "/", "0", "5", "a", "b", "a.mtl", "0.5", "1e3", "nan",
        "-2", "off", "\\",
    ]  # fmt: skip
    lines = ["v 0 0 0", "v 1 0 0", "v 0 1 0", "v 0 0 1", "vt 0 0", "vt 1 1", "vn 0 0 1"]
    for _ in range(random.integers(1, 20)):
        lines.append(" ".join([random.choice(keys), *random.choice(words, int(random.integers(0, 6)))]))
    return "m.obj", {"m.obj": "\n".join(lines).encode(), "a.mtl": MTL, "wood.png": picture()}


def _mtl(random):
    return "m.obj", {"m.obj": OBJ, "a.mtl": damaged(random, MTL), "wood.png": picture("PNG", "RGBA")}


def _texture(random):
    modes = {"JPEG": ("RGB", "L"), "BMP": ("RGB", "L", "P"), "GIF": ("P", "L"), "WEBP": ("RGB", "RGBA")}
    format = PICTURES[int(random.integers(0, len(PICTURES)))]
    some = modes.get(
        format, ("RGB", "RGBA", "L", "P", "LA") if format != "TIFF" else ("RGB", "RGBA", "L", "P", "1", "I;16"[:1])
    )
    data = picture(format, some[int(random.integers(0, len(some)))])
    return "m.obj", {"m.obj": OBJ, "a.mtl": MTL, "wood.png": damaged(random, data)}


def _tree(random):
    choices = seeds()["gltf"]
    tree = json.loads(choices[int(random.integers(0, len(choices)))])
    return "m.gltf", {"m.gltf": json.dumps(changed(random, tree)).encode(), "wood.png": picture()}


def _chunk(random):
    """A GLB file with a changed tree."""
    length = struct.unpack_from("<I", GLB, 12)[0]
    text = json.dumps(changed(random, json.loads(GLB[20 : 20 + length]))).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<5I", 0x46546C67, 2, 20 + len(text) + len(GLB) - 20 - length, len(text), 0x4E4F534A)
    return "m.glb", {"m.glb": head + text + GLB[20 + length :]}


def _xml(random):
    text = damaged(random, (THREEMF, COLORED_THREEMF)[int(random.integers(0, 2))].encode())
    return "m.3mf", {"m.3mf": threemf(text, **{"3D/a.png": picture()})}


def _rep(random):
    """A 3DXML file with a damaged document."""
    name = ("Manifest.xml", "p.3dxml", "a.3DRep")[int(random.integers(0, 3))]
    with zipfile.ZipFile(io.BytesIO(threedxml())) as archive:
        return "m.3dxml", {"m.3dxml": threedxml(**{name: damaged(random, archive.read(name))})}


def _scene_files():
    return {"a.npz": npz(arrays()), "wood.png": picture(), "part.obj": OBJ, "a.mtl": MTL}


def _json(random):
    return "m.json", _scene_files() | {"m.json": json.dumps(changed(random, SCENE)).encode()}


def _json_text(random):
    return "m.json", _scene_files() | {"m.json": damaged(random, json.dumps(SCENE).encode())}


def _npz(random):
    scene = {"meshes": [{"arrays": "a.npz", "mesh": 0, "material": {"texture": {"arrays": "a.npz", "texture": 0}}}]}
    files = dict(arrays())
    if random.integers(0, 2):
        data = damaged(random, npz(files, bool(random.integers(0, 2))))
    else:  # a sound zip file of damaged arrays
        stream = io.BytesIO()
        with zipfile.ZipFile(stream, "w") as archive:
            for name, array in files.items():
                content = io.BytesIO()
                np.save(content, array)
                entry = zipfile.ZipInfo(f"{name}.npy")  # of a fixed date
                archive.writestr(entry, damaged(random, content.getvalue()))
        data = stream.getvalue()
    return "m.json", {"m.json": json.dumps(scene).encode(), "a.npz": data}


_PLAIN = ("stl", "ply", "off", "glb", "gltf", "3mf", "dae", "zae", "3dxml", "xaml")
MAKERS = {format: _plain(format) for format in _PLAIN} | {
    "rep": _rep,
    "obj": _obj, "lines": _lines, "mtl": _mtl, "texture": _texture, "tree": _tree, "chunk": _chunk, "xml": _xml,
    "json": _json,
    "json text": _json_text, "npz": _npz,
}  # fmt: skip
WEIGHTS = {"stl": 0.5, "glb": 0.5, "3mf": 0.5, "zae": 0.3, "3dxml": 0.3, "json text": 0.5, "json": 2.0, "tree": 2.0}


if __name__ == "__main__":
    sys.exit(main())
