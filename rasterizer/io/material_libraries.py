"""Find the material libraries (MTL files) that an OBJ file names, and the materials that it uses."""

from itertools import chain

from ..errors import warn_caller
from ..scene.material import Material
from ..scene.triangulation import listed
from .files import OutsideError
from .model_file import ModelFile
from .mtl import LONGEST_NAME, Maps, read_materials

MOST_LIBRARIES = 256  # material files that an OBJ file may name


def find_materials(model: ModelFile, libraries: list[str], names: list[str]) -> dict[str, Material]:
    """Read the MTL files that an OBJ file names.

    Parameters
    ----------
    model : the OBJ file
    libraries : what stands on its `mtllib` lines: a name, which may hold blanks, or several
    names : those of the materials that it uses, each once

    Returns
    -------
    dict, name to Material, of those that were found

    Warns
    -----
    UserWarning : files or materials that are missing
    """
    materials, missing, maps = {}, [], Maps(model.log)
    wanted = list(dict.fromkeys(libraries))[:MOST_LIBRARIES]
    # A name with blanks is written like several names; what was read to find out is not read again.
    found = {name: _library(model, name) for name in wanted if len(name) < 256}
    named = list(dict.fromkeys(chain(*([name] if found.get(name) else name.split() for name in wanted))))
    if len(named) > MOST_LIBRARIES:
        warn_caller(f"{model.name}: names {len(named)} material files; the first {MOST_LIBRARIES} are looked for")
    for name in named[:MOST_LIBRARIES]:
        library = found[name] if name in found else _library(model, name)
        if library is None:
            missing.append(name)
        else:
            materials |= read_materials(library, set(names), maps)
    unknown = [name for name in names if name not in materials]
    if missing:
        files = listed([f"'{name[:80]}'" for name in missing])
        warn_caller(f"{model.name}: material file {files} not found; the default material is used")
    elif unknown:
        unknown = listed([f"'{name[:80]}'" for name in unknown])
        warn_caller(f"{model.name}: no definition of material {unknown}; the default is used")
    return materials


def _library(model, name) -> ModelFile | None:
    """Return an MTL file beside the model, or None."""
    if len(name) > LONGEST_NAME:
        return None
    try:
        path = model.beside.find_alike(name)
        data = model.beside.read_bytes(path)
    except OutsideError as fault:
        if model.folder is not None:
            warn_caller(f"{model.name}: material file '{name}' {fault}")
        return None
    except (OSError, ValueError):
        return None
    return ModelFile(str(path), "mtl", data, path.parent, model.log, model.beside.below(path.parent))
