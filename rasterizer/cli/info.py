"""`raster info`: what is in a model, said without drawing it.

load ─ facts ─┬─ lines on stdout
              └─ a line of JSON
"""

import argparse
import os
from dataclasses import asdict
from time import perf_counter

from ..errors import collected_warnings, install_command
from ..io import formats
from .flags import add_json, add_messages, add_models
from .messages import STDIO, Failures, print_text

IMPORTS = ("models",)
_MANY = 12  # materials, and the like, that are listed
_FIRST = 18  # letters of the names of facts
_DESCRIPTION = """\
Say what is in each model, without drawing it.

  faces, vertices    triangles, and the different positions that they use
  bounds             lowest and highest corner, in scene units
  watertight         whether every edge has triangles on both sides, wound the
                     same way; edges that haven't are counted
  bodies             parts that share no edge
  up                 the axis that raster render takes
  up guess           the axis that the shape speaks for, and why
  not drawn          what the file holds and pictures don't show
"""
_EXAMPLES = """\
examples:
  raster info part.stl
  raster info 'parts/*.obj' --json                           a line a model
  cat part.stl | raster info - --input-format stl
"""


def add_flags(parser) -> None:
    """Add the flags to the command's parser, and what its help says."""
    parser.usage = "raster info MODEL... [options]"
    parser.description, parser.epilog = _DESCRIPTION, _EXAMPLES
    add_models(parser)
    output = parser.add_argument_group("output")
    output.add_argument(
        "--formats",
        action=_ListFormats,
        nargs=0,
        default=argparse.SUPPRESS,
        help="list the formats that can be loaded, and exit",
    )
    add_json(output, "print a line of JSON for each model")
    add_messages(output)


class _ListFormats(argparse.Action):
    """Print the formats that can be loaded, and end."""

    def __call__(self, parser, *_):
        for entry in formats.formats():
            suffixes, packages = " ".join(entry["suffixes"]), ", ".join(entry["needs"])
            line = f"{entry['name']:<6} {suffixes:<14} {entry['reads']:<6} read by {entry['by']}"
            print_text(line + (f"; needs {packages}: {install_command('formats')}" if packages else "") + "\n")
        parser.exit()


def run(request, messages) -> tuple[list, int]:
    """Describe every model; the result is that of `drawing.draw_models`."""
    from .models import list_models

    models = list_models(request)
    failures = Failures(messages, request.is_json)
    for number, model in enumerate(models):
        with failures.caught(model):
            facts = _describe(model, request.appearance, messages)
            if request.is_json:
                messages.record(facts)
            else:
                print_text(("\n" if number else "") + _text(facts))
    return failures, len(models)


def _describe(model, appearance, messages) -> dict:
    """Load a model, and return what is known of it: a record that JSON can say."""
    from ..analysis.mesh_topology import compute_topology
    from ..io.loader import load
    from ..scene.framing import guess_up
    from ..scene.lights import light_type_of
    from .models import source_of

    start = perf_counter()
    source = source_of(model, appearance.format)
    said, files_read = [], []
    with collected_warnings() as texts:
        scene = load(source, camera="file", **appearance.reading, log=said.append, files_read=files_read)
    for text in said:
        messages.detail(text)
    entry = formats.format_of(model, appearance.format)
    points, faces = _gather(scene)
    topology, (up, reason) = compute_topology(points, faces), guess_up(points, faces, scene.bounds)
    materials = {id(each): each for mesh in scene.meshes for each in mesh.palette}.values()
    textures = {id(texture): texture for each in materials for texture in each.textures}.values()
    low, high = scene.bounds
    return {
        "model": model,
        "format": entry.name,
        "bytes": len(source) if isinstance(source, bytes) else os.path.getsize(model),
        "faces": scene.n_face,
        "polygons": _count_polygons(scene),
        "vertices": topology.n_vertex,
        "edges": topology.n_edge,
        "meshes": [{"name": mesh.name, "faces": mesh.n_face} for mesh in scene.meshes],
        "bounds": [low.tolist(), high.tolist()],
        "extent": (high - low).tolist(),
        "watertight": topology.is_watertight,
        "open_edges": topology.n_open,
        "branching_edges": topology.n_branching,
        "turned_edges": topology.n_turned,
        "degenerate_faces": topology.n_degenerate,
        "bodies": topology.n_body,
        "area": topology.area,
        "volume": topology.volume,
        "up": scene.up,
        "up_guess": up,
        "up_reason": reason,
        "normals": _normals_of(scene),
        "materials": [_material(material) for material in materials],
        "textures": [_texture(texture) for texture in textures],
        "lights": [light_type_of(light) for light in scene.lights],
        "camera": None if scene.camera is None else asdict(scene.camera),
        "files_read": list(dict.fromkeys(files_read)),
        "not_drawn": _list_not_drawn(scene, said),
        "warnings": texts,
        "seconds": round(perf_counter() - start, 4),
    }


def _gather(scene):
    """The vertices and triangles of all meshes as one: (n_vertex, 3) float64, (n_face, 3) int64."""
    import numpy as np

    offsets = np.cumsum([0] + [len(mesh.vertices) for mesh in scene.meshes])
    points = np.concatenate([mesh.vertices for mesh in scene.meshes])
    faces = [mesh.faces.astype(np.int64) + offset for mesh, offset in zip(scene.meshes, offsets[:-1], strict=True)]
    return points, np.concatenate(faces)


def _count_polygons(scene) -> int:
    """Polygons as the file has them; a triangle is one."""
    import numpy as np

    return sum(
        mesh.n_face if mesh.polygons is None else int(np.count_nonzero(np.diff(mesh.polygons, prepend=-1)))
        for mesh in scene.meshes
    )


def _normals_of(scene) -> str:
    """Where normals come from: of the file, of its smoothing groups, or averaged; all that there are."""
    found = (
        "of the file" if mesh.normals is not None
        else "of smoothing groups" if mesh.smoothing is not None
        else "averaged"
        for mesh in scene.meshes
    )  # fmt: skip
    return ", ".join(dict.fromkeys(found))


def _material(material) -> dict:
    texture, metals = material.texture, material.metallic_roughness
    return {
        "name": material.name,
        "reflection": material.reflection,
        "diffuse": list(material.diffuse),
        "opacity": material.opacity,
        "metallic": material.metallic,
        "texture": None if texture is None else texture.name,
        "metallic_roughness": None if metals is None else metals.name,
    }


def _texture(texture) -> dict:
    height, width = texture.shape
    return {"name": texture.name, "size": [width, height], "alpha": texture.has_alpha}


def _list_not_drawn(scene, said) -> list[str]:
    """What a file holds and no picture shows, as its readers say; what they warn of is said elsewhere."""
    found = [what for text in said for what in getattr(text, "left_out", ())]
    if any(mesh.colors is not None and mesh.colors.shape[1] == 4 and mesh.colors[:, 3].min() < 1.0
           for mesh in scene.meshes):  # fmt: skip
        found.append("the alpha of vertex colours")
    return list(dict.fromkeys(found))


# --- what is printed ------------------------------------------------------------------------------------------------


def _text(facts) -> str:
    """The facts as lines; what there is none of is left out."""
    lines = ["stdin" if facts["model"] == STDIO else _words(facts["model"])]
    for name, value in facts.items():
        if name != "model" and value is not None and value != []:
            lines.append(f"  {name.replace('_', ' '):<{_FIRST}}{_words(value)}")
    return "\n".join(lines) + "\n"


def _words(value) -> str:
    """A fact as text."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, dict):
        return ", ".join(f"{name} {_words(each)}" for name, each in value.items() if each is not None)
    if isinstance(value, (list, tuple)):
        if isinstance(value[0], (int, float)):
            return f"({', '.join(map(_words, value))})"
        more = f"; and {len(value) - _MANY} more" if len(value) > _MANY else ""
        return "; ".join(map(_words, value[:_MANY])) + more
    return " ".join(str(value).split()) or "''"
