"""The kernels of pictures as they were recorded, so that those of a picture are compiled in one round.

recorded_kernels.json has them: tests/helpers/record_kernels.py draws pictures of every kind and notes which kernels
each calls, with which signatures. A new picture takes those of the recorded one that is most like it. What it needs
beside them is compiled when it is met: so what is wrong here costs time, and nothing else.
"""

import importlib
import json
from pathlib import Path
from typing import NamedTuple

from ..compiler.kernels import Job
from ..geometry.weld import FEW
from ..options import Options
from ..scene.lights import light_type_of
from ..scene.scene import Scene

FILE = Path(__file__).with_suffix(".json")
# Words that decide which kernels all stages take; the others are about one or two kernels each.
MAIN_WORDS = frozenset((
    "flat shading", "gouraud shading", "phong shading", "tolerance 0", "picture", "shadows", "transparent", "texture",
))  # fmt: skip


class Record(NamedTuple):
    """What recorded_kernels.json holds."""

    kernels: list[Job]  # each once
    pictures: list[tuple[frozenset[str], list[Job]]]  # what a picture is like, and its kernels


def list_all_kernels() -> list[Job]:
    """List the kernels of all recorded pictures, and those that read files, each once."""
    return read().kernels


def list_kernels(scene: Scene, options: Options) -> list[Job]:
    """List the kernels of the recorded picture that is most like one of a scene: the fewest main words tell them apart,
    and of such the fewest words."""
    words = words_of(scene, options)

    def difference(picture):
        return len((picture[0] ^ words) & MAIN_WORDS), len(picture[0] ^ words)

    return min(read().pictures, key=difference)[1]


def words_of(scene: Scene, options: Options) -> frozenset[str]:
    """Say in words what decides which kernels a picture takes."""
    materials = [material for mesh in scene.meshes for material in mesh.palette]
    textures = [texture for material in materials for texture in material.textures]
    of_options = {
        f"{'flat' if options.is_flat else options.shading} shading": True,
        f"{options.samples} samples": True,
        "tolerance 0": options.tolerance == 0.0,
        "picture": not {"color", "rgb"}.isdisjoint(options.outputs),
        **dict.fromkeys(set(options.outputs) - {"color", "rgb"}, True),
        "all sides": options.cull != "auto",
        "global range, or background": options.color_range == "global" or scene.background is not None,
        "edges": bool(options.edges),
        "ground": options.ground,
    }
    of_scene = {
        "depth cue": scene.depth_cue is not None,
        "parallel": scene.camera is not None and not scene.camera.is_perspective,
        "shadows": any(getattr(light, "shadow", None) is not None for light in scene.lights),
        **{light_type_of(light): True for light in scene.lights},
        "polygons": any(mesh.polygons is not None for mesh in scene.meshes),
        "many faces": any(3 * mesh.n_face >= FEW for mesh in scene.meshes),
        "own normals": any(mesh.normals is not None for mesh in scene.meshes),
        "colors": any(mesh.colors is not None or mesh.face_colors is not None for mesh in scene.meshes),
    }
    of_materials = {
        **{material.reflection: True for material in materials},
        "opaque": any(material.is_opaque for material in materials),
        "transparent": not all(material.is_opaque for material in materials),
        "cut-outs": any(material.is_cut_out for material in materials),
        "brushed": any(material.is_anisotropic for material in materials),
        "own colour of F0": any(material.fresnel is not None for material in materials),
        "texture": bool(textures),
        "mip levels": any(texture.n_level > 1 for texture in textures),
        "texture's alpha": any(texture.has_alpha for texture in textures),
        "metallic-roughness": any(material.metallic_roughness is not None for material in materials),
    }
    return frozenset(word for word, is_so in (of_options | of_scene | of_materials).items() if is_so)


def read() -> Record:
    """Read what was recorded; without functions that are gone since."""
    stored = json.loads(FILE.read_text(encoding="utf-8"))
    jobs = [job_of(*row) for row in stored["kernels"]]
    pictures = [
        (frozenset(words), [job for job in (jobs[k] for k in used) if job is not None])
        for words, used in stored["pictures"]
    ]
    return Record([job for job in jobs if job is not None], pictures)


def job_of(module: str, name: str, signature: list | tuple) -> Job | None:
    """Return a kernel as it is compiled; None where the function is gone."""
    function = getattr(importlib.import_module(module), name, None)
    return None if function is None else (getattr(function, "py_func", function), _as_tuples(signature))


def _as_tuples(value):
    return tuple(map(_as_tuples, value)) if isinstance(value, (list, tuple)) else value
