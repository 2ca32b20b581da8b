"""One small model in every format that is read, with what each can hold of its parts: for tests of what readers do with
a defect."""

import json
import re

import numpy as np

from helpers.gltf import add_array
from helpers.model_bytes import CORE, MATERIALS, threemf
from helpers.other_models import XAML

PICTURE = "wood.png"


class Cannot(Exception):
    """A format has no place for a part of a model."""


def model(**parts) -> dict:
    """Return a square of two triangles; colours are within 0..1, nodes have a scale each."""
    square = {
        "points": [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], "faces": [(0, 1, 2), (0, 2, 3)], "normals": None,
        "uv": None, "colors": None, "material": None, "opacity": None, "missing": False, "picture": None, "nodes": [1],
    }  # fmt: skip
    return square | parts


def _only(given, *keys) -> None:
    """Raise Cannot where a model has other parts than those named, and points and faces."""
    plain = model()
    for key in given:
        if key not in ("points", "faces", *keys) and given[key] != plain[key]:
            raise Cannot(key)


def _words(rows) -> list[str]:
    """Return numbers of rows as text: exactly those of their floats."""
    return [" ".join(f"{value:.9g}" for value in row) for row in rows]


def obj(given) -> dict[str, bytes]:
    _only(given, "normals", "uv", "colors", "material", "opacity", "missing", "picture")
    colors = given["colors"] or [()] * len(given["points"])
    lines = [f"v {row}" for row in _words((*a, *b) for a, b in zip(given["points"], colors, strict=True))]
    lines += [f"vt {row}" for row in _words(given["uv"] or ())] + [
        f"vn {row}" for row in _words(given["normals"] or ())
    ]
    has_material = given["material"] or given["missing"] or given["picture"] or given["opacity"] is not None
    corner = {(False, False): "{0}", (True, False): "{0}/{0}", (False, True): "{0}//{0}", (True, True): "{0}/{0}/{0}"}
    form = corner[given["uv"] is not None, given["normals"] is not None]
    lines += ["usemtl a"] * bool(has_material)
    lines += ["f " + " ".join(form.format(k + 1) for k in face) for face in given["faces"]]
    mtl = ["newmtl b" if given["missing"] else "newmtl a"]
    mtl += [f"Kd {row}" for row in _words([given["material"]] if given["material"] else ())]
    mtl += [f"d {given['opacity']}"] * (given["opacity"] is not None)
    mtl += [f"map_Kd {given['picture']}"] * bool(given["picture"])
    files = {"a.obj": "\n".join(["mtllib a.mtl"] * bool(has_material) + lines) + "\n"}
    return files | ({"a.mtl": "\n".join(mtl) + "\n"} if has_material else {})


def off(given) -> dict[str, bytes]:
    _only(given, "normals", "uv", "colors")
    head = "ST" * bool(given["uv"]) + "C" * bool(given["colors"]) + "N" * bool(given["normals"]) + "OFF"
    tables = [given[key] for key in ("points", "normals", "colors", "uv") if given[key]]
    rows = [sum(map(tuple, parts), ()) for parts in zip(*tables, strict=True)]
    faces = [f"{len(face)} {' '.join(map(str, face))}" for face in given["faces"]]
    return {"a.off": "\n".join([head, f"{len(rows)} {len(faces)} 0", *_words(rows), *faces]) + "\n"}


def ply(given) -> dict[str, bytes]:
    _only(given, "normals", "uv", "colors", "picture")
    names = {"points": "x y z", "normals": "nx ny nz", "colors": "red green blue", "uv": "s t"}
    used = [key for key in names if given[key]]
    rows = [sum(map(tuple, parts), ()) for parts in zip(*(given[key] for key in used), strict=True)]
    faces = [f"{len(face)} {' '.join(map(str, face))}" for face in given["faces"]]
    head = ["ply", "format ascii 1.0", *[f"comment TextureFile {given['picture']}"] * bool(given["picture"])]
    head += [f"element vertex {len(rows)}", *(f"property double {word}" for key in used for word in names[key].split())]
    head += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    return {"a.ply": "\n".join([*head, *_words(rows), *faces]) + "\n"}


def stl(given) -> dict[str, bytes]:
    _only(given)
    if len(given["points"]) > 4 or max(map(max, given["faces"])) > 3 or min(map(min, given["faces"])) < 0:
        raise Cannot("vertices")
    loops = []
    for face in given["faces"]:
        corners = [f"vertex {row}" for row in _words(given["points"][k] for k in face)]
        loops += ["facet normal 0 0 1", "outer loop", *corners, "endloop", "endfacet"]
    return {"a.stl": "\n".join(["solid a", *loops, "endsolid a"]) + "\n"}


def gltf(given) -> dict[str, bytes]:
    _only(given, "normals", "uv", "colors", "material", "opacity", "missing", "picture", "nodes")
    tree = {"asset": {"version": "2.0"}}
    keys = {"points": "POSITION", "normals": "NORMAL", "uv": "TEXCOORD_0", "colors": "COLOR_0"}
    used = {word: np.array(given[key], "<f4") for key, word in keys.items() if given[key]}
    primitive = {"attributes": {word: add_array(tree, rows) for word, rows in used.items()}}
    primitive["indices"] = add_array(tree, np.array([k & 0xFFFFFFFF for face in given["faces"] for k in face], "<u4"))
    if given["material"] or given["picture"] or given["opacity"] is not None or given["missing"]:
        opacity = 1.0 if given["opacity"] is None else given["opacity"]
        surface = {"baseColorFactor": [*(given["material"] or (1, 1, 1)), opacity]}
        if given["picture"]:
            surface["baseColorTexture"] = {"index": 0}
            tree["textures"], tree["images"] = [{"source": 0}], [{"uri": given["picture"]}]
        tree["materials"] = [{"pbrMetallicRoughness": surface, "alphaMode": "BLEND", "doubleSided": True}]
        primitive["material"] = 7 if given["missing"] else 0
    tree["meshes"] = [{"primitives": [primitive]}]
    tree["nodes"] = [{"mesh": 0, "scale": [scale] * 3} for scale in given["nodes"]]
    tree["scenes"] = [{"nodes": [*range(len(given["nodes"]))]}]
    return {"a.gltf": json.dumps(tree)}


def dae(given) -> dict[str, bytes]:
    _only(given, "normals", "uv", "colors", "material", "opacity", "missing", "picture", "nodes")
    inputs, sources = '<input semantic="VERTEX" source="#v" offset="0"/>', ""
    params = {"points": ("XYZ", "p", ""), "normals": ("XYZ", "n", "NORMAL"), "uv": ("ST", "u", "TEXCOORD")}
    for key, (letters, name, word) in (params | {"colors": ("RGB", "c", "COLOR")}).items():
        if not given[key]:
            continue
        numbers = " ".join(_words(given[key]))
        accessor = "".join(f'<param name="{letter}" type="float"/>' for letter in letters)
        sources += (
            f'<source id="{name}"><float_array id="{name}a" count="{len(numbers.split())}">{numbers}</float_array>'
        )
        sources += f'<technique_common><accessor source="#{name}a" count="{len(given[key])}" stride="{len(letters)}">'
        sources += f"{accessor}</accessor></technique_common></source>"
        inputs += f'<input semantic="{word}" source="#{name}" offset="0"/>' if word else ""
    corners = " ".join(str(k) for face in given["faces"] for k in face)
    color = " ".join(f"{value:.9g}" for value in given["material"] or (1, 1, 1))
    diffuse = '<texture texture="t" texcoord="UV"/>' if given["picture"] else f"<color>{color} 1</color>"
    opacity = "" if given["opacity"] is None else f"<transparency><float>{given['opacity']}</float></transparency>"
    used = given["material"] or given["picture"] or given["missing"] or opacity
    bound = '<instance_material symbol="m" target="#m"/>'
    bound = f"<bind_material><technique_common>{bound}</technique_common></bind_material>"
    shown = f'<instance_geometry url="#g">{bound if used else ""}</instance_geometry>'
    nodes = "".join(f"<node><scale>{scale} {scale} {scale}</scale>{shown}</node>" for scale in given["nodes"])
    images = f'<library_images><image id="i"><init_from>{given["picture"]}</init_from></image></library_images>'
    surface = '<newparam sid="s"><surface type="2D"><init_from>i</init_from></surface></newparam>'
    surface += '<newparam sid="t"><sampler2D><source>s</source></sampler2D></newparam>'
    effect = f'<technique sid="c"><phong><diffuse>{diffuse}</diffuse>{opacity}</phong></technique>'
    effect = f'<effect id="e"><profile_COMMON>{surface if given["picture"] else ""}{effect}</profile_COMMON></effect>'
    name = "o" if given["missing"] else "m"
    materials = f'<library_effects>{effect}</library_effects><library_materials><material id="{name}">'
    materials += '<instance_effect url="#e"/></material></library_materials>'
    libraries = (images if given["picture"] else "") + (materials if used else "")
    told = ' material="m"' if used else ""
    text = (
        '<?xml version="1.0" encoding="utf-8"?>\n<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" '
        f'version="1.4.1">\n<asset><up_axis>Y_UP</up_axis></asset>{libraries}<library_geometries>'
        f'<geometry id="g"><mesh>{sources}<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>'
        f'<triangles count="{len(given["faces"])}"{told}>{inputs}<p>{corners}</p></triangles></mesh></geometry>'
        f'</library_geometries><library_visual_scenes><visual_scene id="w">{nodes}</visual_scene>'
        '</library_visual_scenes><scene><instance_visual_scene url="#w"/></scene></COLLADA>\n'
    )
    return {"a.dae": text}


def threemf_of(given) -> dict[str, bytes]:
    _only(given, "uv", "missing", "picture", "nodes")
    if bool(given["uv"]) != bool(given["picture"]):
        raise Cannot("uv")
    points = "".join(f'<vertex x="{x:.9g}" y="{y:.9g}" z="{z:.9g}"/>' for x, y, z in given["points"])
    group = 77 if given["missing"] else 4
    look = f'pid="{group}" p1="{{}}" p2="{{}}" p3="{{}}"' if given["picture"] or given["missing"] else ""
    faces = "".join(
        '<triangle v1="{}" v2="{}" v3="{}" '.format(*face) + look.format(*face) + "/>" for face in given["faces"]
    )
    groups = ""
    if given["picture"]:
        uv = given["uv"] or [(0, 0)] * len(given["points"])
        places = "".join(f'<m:tex2coord u="{u:.9g}" v="{v:.9g}"/>' for u, v in uv)
        groups = f'<m:texture2d id="3" path="/3D/{PICTURE}" contenttype="image/png"/>'
        groups += f'<m:texture2dgroup id="4" texid="3">{places}</m:texture2dgroup>'
    items = "".join(f'<item objectid="9" transform="{s} 0 0 0 {s} 0 0 0 {s} 0 0 0"/>' for s in given["nodes"])
    text = (
        f'<?xml version="1.0" encoding="UTF-8"?>\n<model unit="millimeter" xmlns="{CORE}" xmlns:m="{MATERIALS}">\n'
        f'<resources>{groups}<object id="9"><mesh><vertices>{points}</vertices><triangles>{faces}</triangles></mesh>'
        f"</object></resources><build>{items}</build></model>"
    )
    return {"a.3mf": text}


def xaml(given) -> dict[str, bytes]:
    _only(given, "normals")
    numbers = {"Positions": given["points"], "Normals": given["normals"] or [(0, 0, 1)] * len(given["points"])}
    text = XAML
    for key, rows in numbers.items():
        words = " ".join(",".join(f"{value:.9g}" for value in row) for row in rows)
        text = re.sub(f'{key}="[^"]*"', f'{key}="{words}"', text)
    corners = " ".join(str(k) for face in given["faces"] for k in face)
    return {"a.xaml": re.sub('TriangleIndices="[^"]*"', f'TriangleIndices="{corners}"', text)}


WRITERS = {"obj": obj, "off": off, "ply": ply, "stl": stl, "gltf": gltf, "dae": dae, "3mf": threemf_of, "xaml": xaml}


def files_of(format, given, *, prefix=b"", newline="\n", beside=()) -> dict[str, bytes]:
    """Return the files of a model in a format by their names, the model's first; Cannot where it has no place for it.

    Parameters
    ----------
    prefix : bytes before the model's text
    newline : text, what ends its lines
    beside : dict of other files by name, packed into a 3MF file
    """
    files = {}
    for name, text in WRITERS[format](given).items():
        files[name] = prefix + text.replace("\n", newline).encode()
    if format == "3mf":
        inside = {f"3D/{name}": data for name, data in dict(beside).items()}
        return {"a.3mf": threemf(files["a.3mf"].decode("utf-8"), **inside)}
    return files | dict(beside)
