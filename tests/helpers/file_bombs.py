"""Small files that ask for much, of every container.

    python -m helpers.file_bombs NAME ...         these bombs, each in a process of its own: a line of JSON for each

A line says which file it was, how many megabytes and seconds of the processor `load` took, what became of it, and how
long the longest message was.
"""

import io
import json
import os
import re
import resource
import struct
import sys
import tempfile
import time
import warnings
import zipfile
import zlib
from pathlib import Path

import numpy as np
import PIL.Image
import trimesh  # noqa: F401 - which would count, were it imported by the first file

import rasterizer as rz
from helpers import gltf
from helpers.file_grammar import picture
from helpers.model_bytes import CORE, MATERIALS, relationships, threemf, zipped
from helpers.other_models import INSTANCE, REP, SHOWN, XAML, dae, threedxml

ADDRESSES = 4 * 2**30  # bytes of address space: what asks for more fails, instead of the machine

# --- pieces ---------------------------------------------------------------------------------------------------------

TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes()
FACE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
POSITIONS = {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}
PRIMITIVE = {"attributes": {"POSITION": 0}}
PLY = "ply\nformat {}\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
MESH = {"vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "faces": [[0, 1, 2]]}
ENTITIES = "".join(f'<!ENTITY {chr(98 + k)} "{f"&{chr(97 + k)};" * 10}">' for k in range(8))
LAUGHS = f'<!DOCTYPE a [<!ENTITY a "{"a" * 1000}">{ENTITIES}]>'


def glb(data=TRIANGLE, *lengths, **tree):
    """A GLB file; views of its buffer have the lengths, one behind the other."""
    lengths = lengths or (len(data),)
    ends = np.cumsum(lengths).tolist()
    views = [{"buffer": 0, "byteOffset": b - a, "byteLength": a} for a, b in zip(lengths, ends, strict=True)]
    usual = {"asset": {"version": "2.0"}, "buffers": [{"byteLength": len(data)}], "bufferViews": views,
             "accessors": [POSITIONS], "meshes": [{"primitives": [PRIMITIVE]}], "nodes": [{"mesh": 0}]}  # fmt: skip
    return {"a.glb": gltf.glb(usual | tree, data)}


def indexed(n, count, of_mesh=1, **tree):
    """A GLB file of `n` accessors to the same `count` indices, each used by a primitive."""
    indices = (np.arange(count, dtype="<u4") % 3).tobytes()
    accessors = [POSITIONS] + [{"bufferView": 1, "componentType": 5125, "count": count, "type": "SCALAR"}] * n
    primitives = [PRIMITIVE | {"indices": 1 + k} for k in range(n)] * of_mesh
    return glb(TRIANGLE + indices, 36, len(indices), accessors=accessors, meshes=[{"primitives": primitives}], **tree)


def textured(data, n=1):
    """A GLB file of `n` triangles, each with a texture of its own of the same picture."""
    accessors = [POSITIONS, POSITIONS | {"bufferView": 1, "type": "VEC2"}]
    attributes = {"POSITION": 0, "TEXCOORD_0": 1}
    return glb(
        TRIANGLE + bytes(24) + data, 36, 24, len(data), accessors=accessors,
        images=[{"bufferView": 2, "mimeType": "image/png"}] * n, textures=[{"source": k} for k in range(n)],
        materials=[{"pbrMetallicRoughness": {"baseColorTexture": {"index": k}}} for k in range(n)],
        meshes=[{"primitives": [{"attributes": attributes, "material": k} for k in range(n)]}],
    )  # fmt: skip


def plain(format, mode="RGB", size=(8192, 4096), **options):
    """A picture of one colour."""
    stream = io.BytesIO()
    PIL.Image.new(mode, size).save(stream, format, **options)
    return stream.getvalue()


def scanned():
    """A progressive JPEG whose last scan is repeated."""
    data = plain("JPEG", "L", (4096, 2048), progressive=True)
    last = data[data.rfind(b"\xff\xda") : -2]
    return data[:-2] + last * (700_000 // len(last)) + data[-2:]


def with_text():
    """A PNG with fields of text that unpack to a megabyte each."""
    text = b"zTXtComment\0\0" + zlib.compress(bytes(10**6), 9)
    data = plain("PNG", size=(1, 1))
    chunk = struct.pack(">I", len(text) - 4) + text + struct.pack(">I", zlib.crc32(text))
    return data[:33] + chunk * 600 + data[33:]


VERTICES = '<vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/><vertex x="0" y="1" z="0"/></vertices>'
SHAPE = f'<mesh>{VERTICES}<triangles><triangle v1="0" v2="1" v3="2"/></triangles></mesh></object>'
PLAIN, PAINTED = f'<object id="9">{SHAPE}', f'<object id="9" pid="6" pindex="0">{SHAPE}'


def model(resources, items='<item objectid="9"/>', **options):
    """A 3MF file."""
    head = f'<model unit="inch" xmlns="{CORE}" xmlns:m="{MATERIALS}"><resources>'
    return {"a.3mf": threemf(f"{head}{resources}</resources><build>{items}</build></model>", **options)}


def layered(kind, names, row, n_layer, n_row):
    """A 3MF file of many layers, and rows of which each is in all of them."""
    texture = '<m:texture2d id="3" path="/3D/a.png" contenttype="image/png"/>'
    groups = texture + '<m:texture2dgroup id="4" texid="3"><m:tex2coord u="0" v="0"/></m:texture2dgroup>'
    groups += '<basematerials id="1"><base name="a" displaycolor="#805020"/></basematerials>'
    group = f'<m:{kind} id="6" {names}="{"4 " * n_layer}">{row * n_row}</m:{kind}>'
    return model(groups + group + PAINTED, **{"3D/a.png": picture()})


def overlapping(n=8000):
    """A zip file whose directory names the same member again and again (Fifield 2019, A better zip bomb, WOOT)."""
    zeros = bytes(2**24)
    pack = zlib.compressobj(9, wbits=-15)
    body, name = pack.compress(zeros) + pack.flush(), b"3D/3dmodel.model"
    sizes = zlib.crc32(zeros), len(body), len(zeros), len(name)
    data = struct.pack("<IHHHHHIIIHH", 0x04034B50, 20, 0, 8, 0, 0, *sizes, 0) + name + body
    entry = struct.pack("<IHHHHHHIIIHHHHHII", 0x02014B50, 20, 20, 0, 8, 0, 0, *sizes, 0, 0, 0, 0, 0, 0) + name
    end = struct.pack("<IHHHHIIH", 0x06054B50, 0, 0, n, n, n * len(entry), len(data), 0)
    return {"a.3mf": data + entry * n + end}


def lying(method=zipfile.ZIP_DEFLATED, n=2**27, stated=None):
    """A scene whose vertices are packed in an .npz file; `stated` is their length as the directory has it."""
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(head, {"descr": "<f8", "fortran_order": False, "shape": (n // 24, 3)})
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", method) as archive:
        archive.writestr("mesh0_vertices.npy", head.getvalue() + bytes(n // 24 * 24))
        if stated is not None:
            archive.getinfo("mesh0_vertices.npy").file_size = stated
        faces = io.BytesIO()
        np.save(faces, np.arange(3)[None])
        archive.writestr("mesh0_faces.npy", faces.getvalue())
    return {"a.json": json.dumps({"meshes": [{"arrays": "a.npz", "mesh": 0}]}), "a.npz": stream.getvalue()}


def uses(n, *, of, **more):
    """A scene that uses a model of `of` objects `n` times."""
    part = FACE + "o a\nf 1 2 3\n" * of
    return {"a.json": json.dumps({"meshes": [{"file": "a.obj"} | more] * n}), "a.obj": part}


# --- bombs: what is loaded is the first of the files ----------------------------------------------------------------

NAME = "n" * 500_000
LIGHTS = {"KHR_lights_punctual": {"lights": [{"type": "point"}]}}
NOWHERE = {"componentType": 5126, "count": 2**25 // 3 - 2, "type": "VEC3"}  # in no buffer
EVERYWHERE = {"bufferView": 0, "componentType": 5126, "count": 699_988, "type": "VEC3"}  # a row at every byte
ALL = {"attributes": dict.fromkeys(("POSITION", "NORMAL", "COLOR_0", "TEXCOORD_0"), 0)}
STRIDE = [{"buffer": 0, "byteLength": 700_000, "byteStride": 1}]
DOUBLED = "".join(f'<node id="n{k}">{f"""<instance_node url="#n{k + 1}"/>""" * 2}</node>' for k in range(30))
COMPONENTS = "".join(
    f'<object id="{10 + k}"><components>{f"""<component objectid="{9 + k}"/>""" * 10}</components></object>'
    for k in range(12)
)
BOMBS = {
    "glTF: nodes": lambda: glb(nodes=[{"mesh": 0}] * 85_000),
    "glTF: nodes x primitives": lambda: glb(meshes=[{"primitives": [PRIMITIVE] * 2000}], nodes=[{"mesh": 0}] * 2000),
    "glTF: name x primitives": lambda: glb(meshes=[{"name": NAME, "primitives": [PRIMITIVE] * 7000}]),
    "glTF: accessors to the same indices": lambda: indexed(2000, 120_000),
    "glTF: primitives of the same indices": lambda: indexed(1, 120_000, 2000),
    "glTF: copies": lambda: indexed(1, 200_000, nodes=[{"mesh": 0, "translation": [k, 0, 0]} for k in range(1000)]),
    "glTF: rows in no buffer": lambda: glb(accessors=[NOWHERE]),
    "glTF: rows at every byte": lambda: glb(
        bytes(range(1, 65)) * 10_938, bufferViews=STRIDE, accessors=[EVERYWHERE], meshes=[{"primitives": [ALL]}]
    ),
    "glTF: lights": lambda: glb(extensions=LIGHTS, nodes=[{"mesh": 0}, *[{"extensions": {
        "KHR_lights_punctual": {"light": 0}}}] * 15_000]),
    "glTF: extensions": lambda: glb(extensionsUsed=["X" * 3000, *(f"e{k}" for k in range(40_000))]),
    "glTF: textures of one picture": lambda: textured(plain("PNG", size=(2048, 2048)), 2000),
    "glTF: targets": lambda: glb(meshes=[{"weights": [1] * 30_000, "primitives": [
        PRIMITIVE | {"targets": [{"POSITION": 0}] * 30_000}]}]),
    "3MF: a large member": lambda: model(PLAIN + " " * 2**25),
    "3MF: bzip2": lambda: model(PLAIN + " " * 2**27, method=zipfile.ZIP_BZIP2),
    "3MF: LZMA": lambda: model(PLAIN + " " * 2**26, method=zipfile.ZIP_LZMA),
    "3MF: overlapping members": overlapping,
    "3MF: relationships": lambda: model(
        PLAIN, **{"_rels/.rels": relationships(**{"3dmodel": "/3D/3dmodel.model"}) + " " * 2**25}
    ),
    "3MF: entities": lambda: model(PLAIN, **{"_rels/.rels": LAUGHS + "<Relationships>&i;</Relationships>"}),
    "3MF: components": lambda: model(PLAIN + COMPONENTS, '<item objectid="21"/>'),
    "3MF: items": lambda: model(PLAIN, '<item objectid="9"/>' * 11_000),
    "3MF: layers": lambda: layered("multiproperties", "pids", '<m:multi pindices=""/>', 8000, 60_000),
    "3MF: composites": lambda: layered("compositematerials", 'matid="1" matindices', '<m:composite values=""/>', 8000,
                                       60_000),
    "ZAE: elements": lambda: {"a.zae": zipped({"a.dae": dae(more="<node/>" * 10**6)})},
    "ZAE: entities": lambda: {"a.zae": zipped({"a.dae": dae().replace("<COLLADA", f"{LAUGHS}<COLLADA")})},
    "DAE: nodes": lambda: {"a.dae": dae(nodes="<node/>" * 100_000)},
    "DAE: instances": lambda: {"a.dae": dae(nodes=f"<node>{SHOWN * 5000}</node>")},
    "DAE: corners": lambda: {"a.dae": dae().replace("<vcount>4<", "<vcount>10000000<")},
    "DAE: nodes that double": lambda: {"a.dae": dae(nodes=DOUBLED + f'<node id="n30">{SHOWN}</node>')},
    "3DXML: faces": lambda: {"a.3dxml": threedxml(**{"a.3DRep": REP.replace("<Face ", "<Face/>" * 10**6 + "<Face ")})},
    "3DXML: instances": lambda: {"a.3dxml": threedxml(
        "".join(INSTANCE.format(id=5 + k, above=1, below=2, x=k) for k in range(60_000)))},
    "XAML: entities": lambda: {"a.xaml": LAUGHS + XAML},
    "npz: zeros": lying,
    "npz: a lying directory": lambda: lying(n=2**22, stated=1000),
    "npz: LZMA": lambda: lying(zipfile.ZIP_LZMA),
    "npz: bzip2": lambda: lying(zipfile.ZIP_BZIP2),
    "scene: uses": lambda: uses(45_000, of=1),
    "scene: uses x objects": lambda: uses(9000, of=1000, transform={"scale": 2}),
    "scene: names": lambda: {"a.json": json.dumps({"materials": {f"{'m' * 3000}{k}": {} for k in range(100)},
                                                   "meshes": [MESH | {"material": "q"}]})},
    "scene: textures": lambda: {
        "a.json": json.dumps({"materials": {f"m{k}": {"texture": {"file": f"{'./' * k}t.png"}} for k in range(600)},
                              "meshes": [MESH]}), "t.png": plain("PNG", size=(2048, 2048))},
    "scene: subdivided": lambda: {"a.json": json.dumps({"meshes": [MESH], "subdivide": 15})},
    "scene: a large picture": lambda: {"a.json": json.dumps({"meshes": [MESH], "options": {"size": [65536, 65536]}})},
    "scene: shadows": lambda: {"a.json": json.dumps({"meshes": [MESH], "shadows": True, "lights": [
        {"kind": "directional", "direction": [0, 0, -1]}] * 2000})},
    "OBJ: objects": lambda: {"a.obj": FACE + "o a\nf 1 2 3\n" * 80_000},
    "OBJ: names": lambda: {"a.obj": f"mtllib {'m' * 3000}\no {NAME}\n{FACE}vt 0 0\nusemtl {'u' * 4000}\nf 1 2 3\n"},
    "OBJ: one library under many names": lambda: {
        "a.obj": "".join(f"mtllib {'./' * k}a.mtl\n" for k in range(256)) + FACE + "usemtl 1\nf 1 2 3\n",
        "a.mtl": "".join(f"newmtl {k}\nKd 1 0 0\n" for k in range(20_000))},
    "STL: solids": lambda: {"a.stl": "solid\n" + (
        "vertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop endsolid\n" * 17_000)},
    "PLY: pictures": lambda: {"a.ply": PLY.format("ascii 1.0").replace(
        "element", "comment TextureFile a\n" * 40_000 + "element", 1) + "property float s\nproperty float t\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0 0 0\n1 0 0 0 0\n0 1 0 0 0\n3 0 1 2"},
    "OFF: a polygon": lambda: {"a.off": f"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n480000 {'0 1 2 ' * 160_000}"},
    "PNG": lambda: textured(plain("PNG")), "WEBP": lambda: textured(plain("WEBP", lossless=True)),
    "JPEG: scans": lambda: textured(scanned()), "PNG: text": lambda: textured(with_text()),
}  # fmt: skip
QUICK = (  # those that the default run makes
    "glTF: nodes x primitives", "glTF: accessors to the same indices", "glTF: primitives of the same indices",
    "glTF: copies", "glTF: rows in no buffer", "glTF: rows at every byte", "glTF: extensions", "glTF: targets",
    "3MF: a large member", "3MF: overlapping members", "3MF: components", "3MF: layers", "3MF: composites",
    "ZAE: entities", "DAE: instances", "DAE: corners", "DAE: nodes that double", "3DXML: faces",
    "XAML: entities", "scene: names",
    "npz: a lying directory", "OBJ: objects", "OBJ: names", "STL: solids", "PLY: pictures", "JPEG: scans", "PNG: text",
)  # fmt: skip


# --- runs -----------------------------------------------------------------------------------------------------------


def run(name, files) -> None:
    """Load the first of some files in a child, which prints what it took."""
    with tempfile.TemporaryDirectory() as folder:
        for each, content in files.items():
            Path(folder, each).write_bytes(content if isinstance(content, bytes) else content.encode())
        first = os.path.join(folder, next(iter(files)))
        size = max(path.stat().st_size for path in Path(folder).iterdir())
        files.clear()
        child = os.fork()
        if child == 0:
            resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES, ADDRESSES))
            resource.setrlimit(resource.RLIMIT_CPU, (60, 60))
            print(json.dumps({"name": name, "bytes": size} | _measured(first, folder)), flush=True)
            os._exit(0)
        if os.waitpid(child, 0)[1]:
            print(json.dumps({"name": name, "bytes": size, "outcome": "died"}), flush=True)


def _measured(path, folder) -> dict:
    Path("/proc/self/clear_refs").write_text("5")  # the peak begins anew
    before, start, outcome = _peak(), time.process_time(), "drawn"
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            rz.load(path)
        except (rz.ModelError, rz.SceneError) as fault:
            outcome = str(fault)
        except Exception as fault:
            outcome = f"internal error: {type(fault).__name__}: {fault}"
    seconds, megabytes = time.process_time() - start, (_peak() - before) / 1024
    texts = [text.replace(folder + os.sep, "") for text in (outcome, *(str(each.message) for each in caught))]
    return {"megabytes": round(megabytes), "seconds": round(seconds, 1), "outcome": texts[0], "n_warning": len(caught),
            "longest": max(map(len, texts)), "lines": max(len(text.splitlines()) for text in texts)}  # fmt: skip


def _peak() -> int:
    return int(re.search(r"VmHWM:\s+(\d+)", Path("/proc/self/status").read_text())[1])


if __name__ == "__main__":
    rz.load((FACE + "f 1 2 3\n").encode(), format="obj")  # what is imported then doesn't count
    for name, make in BOMBS.items():
        if name in sys.argv:
            run(name, make())
