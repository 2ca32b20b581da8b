"""One defect in every format that can hold it: all readers do the same with it.

What a defect comes to: drawn without a word, warned of once and drawn, or refused.
"""

import codecs
import re
import warnings
from pathlib import Path
from typing import NamedTuple

import pytest
from helpers import defects
from helpers.defects import PICTURE, Cannot, files_of, model
from helpers.other_models import png

import rasterizer as rz

INF, NAN = float("inf"), float("nan")
SQUARE = model()
POINTS, FACES = SQUARE["points"], SQUARE["faces"]
UV, UP = [(0, 0), (1, 0), (1, 1), (0, 1)], [(0, 0, 1)] * 4
RED = [(1, 0, 0), (0.5, 0, 0), (1, 0.25, 0), (1, 0, 0.75)]


class Defect(NamedTuple):
    """A model with a defect, and what becomes of it."""

    expected: str  # "drawn", "warned" or "refused"
    given: dict  # as `model` returns it
    said: str = ""  # in the warning or the error
    other: dict = {}  # what a format does that differs: lib3mf reads a texture coordinate that is infinite as 0
    files: dict = {}  # arguments of `files_of`
    load: dict = {}  # arguments of `load`
    n_face: int = 2


def _with(rows, place, row):
    return [*rows[:place], row, *rows[place + 1 :]]


def _laid(place):
    return model(uv=_with(UV, 1, place), picture=PICTURE)


TEXTURED = {"uv": UV, "picture": PICTURE}
BESIDE = {"beside": {PICTURE: png()}}
DEFECTS = {
    # --- what touches nothing
    "no defect": Defect("drawn", model()),
    "all parts, no defect": Defect("drawn", model(normals=UP, **TEXTURED), files=BESIDE),
    "infinite vertex, not used": Defect("warned", model(points=[*POINTS, (INF, 0, 0)]), "1 vertex used by no face"),
    "NaN vertex, not used": Defect("warned", model(points=[*POINTS, (0, NAN, 0)]), "1 vertex used by no face"),
    "vertex not used": Defect("drawn", model(points=[*POINTS, (0, 0, 9)])),
    "two equal vertices": Defect("drawn", model(points=[*POINTS, POINTS[0]], faces=[FACES[0], (4, 2, 3)])),
    "face without an area": Defect("drawn", model(faces=[*FACES, (0, 1, 1)]), n_face=3),
    "the same face twice": Defect("drawn", model(faces=[*FACES, FACES[0]]), n_face=3),
    # --- numbers
    "NaN texture coordinate": Defect("warned", _laid((NAN, 0)), "1 texture coordinate not", files=BESIDE),
    "infinite texture coordinate": Defect("warned", _laid((0, INF)), "1 texture coord", {"3mf": "drawn"}, BESIDE),
    "colour of 1.000001": Defect("warned", model(colors=_with(RED, 0, (1.000001, 0, 0.5))), "1 colour outside"),
    "colour of -1e-7": Defect("warned", model(colors=_with(RED, 0, (1, -1e-7, 0.5))), "1 colour outside"),
    "NaN colour": Defect("warned", model(colors=_with(RED, 0, (1, NAN, 0.5))), "1 colour outside"),
    "material of 1.000001": Defect("warned", model(material=(1.000001, 0.5, 0)), "1 colour outside|would reflect"),
    "material of -1e-7": Defect("warned", model(material=(1, -1e-7, 0)), "1 colour outside|a hair"),
    "opacity of 1.5": Defect("warned", model(opacity=1.5), ""),
    "all is invisible": Defect("warned", model(opacity=0.0), "invisible"),
    "zero normal": Defect("drawn", model(normals=_with(UP, 0, (0, 0, 0)))),
    "NaN normal": Defect("drawn", model(normals=_with(UP, 0, (0, NAN, 1)))),
    "normals of another length": Defect("drawn", model(normals=[(0, 0, 5)] * 4)),
    # --- what a face uses
    "NaN vertex of a face": Defect("refused", model(points=_with(POINTS, 3, (0, NAN, 0))), "--drop-bad-faces"),
    "infinite vertex of a face": Defect("refused", model(points=_with(POINTS, 3, (INF, 1, 0))), "--drop-bad-faces"),
    "NaN vertex, bad faces dropped":
        Defect("drawn", model(points=_with(POINTS, 3, (0, NAN, 0))), load={"drop_bad_faces": True}, n_face=1),
    "vertex that there isn't": Defect("refused", model(faces=[FACES[0], (0, 2, 9)]), "9|10"),
    "no face has an area": Defect("refused", model(points=[(k, k, k) for k in range(4)]), "zero area|no faces"),
    # --- what refers to something else
    "material that there isn't": Defect("warned", model(missing=True), ""),
    "picture that there isn't": Defect("warned", model(**TEXTURED), "wood|texture"),
    "picture that is none": Defect("warned", model(**TEXTURED), "wood", files={"beside": {PICTURE: b"no picture"}}),
    "texture without coordinates":
        Defect("warned", model(picture=PICTURE), "no texture coordinates|without texture", files=BESIDE),
    "picture named with a backslash": Defect("drawn", model(uv=UV, picture=f".\\{PICTURE}"), files=BESIDE),
    # --- nodes
    "a node of scale 0 beside another": Defect("warned", model(nodes=[1, 0]), "1 node of scale 0"),
    "two nodes of scale 0": Defect("warned", model(nodes=[0, 1, 0]), "2 nodes of scale 0"),
    "nothing but nodes of scale 0": Defect("refused", model(nodes=[0]), "scale 0"),
    # --- text
    "byte order mark": Defect("drawn", model(), files={"prefix": codecs.BOM_UTF8}),
    "lines of Windows": Defect("drawn", model(), files={"newline": "\r\n"}),
    "lines of old Macs": Defect("drawn", model(), files={"newline": "\r"}),
}  # fmt: skip


def outcome(folder, format, defect) -> tuple[str, str]:
    """Return what becomes of a defect in a format, and what is said."""
    files = files_of(format, defect.given, **defect.files)
    for name, data in files.items():
        (Path(folder) / name).write_bytes(data)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            scene = rz.load(Path(folder) / next(iter(files)), **defect.load)
        except rz.ModelError as fault:
            return "refused", str(fault)
    said = [str(each.message) for each in caught if issubclass(each.category, UserWarning)]  # deprecations are others'
    n_face = scene.n_face
    how = "drawn" if not said else "warned" if len(said) == 1 else f"{len(said)} warnings"
    return how if n_face == defect.n_face else f"{how}, {n_face} faces", "; ".join(said)


def cells():
    """Yield every defect with every format that can hold it."""
    for name, defect in DEFECTS.items():
        for format in defects.WRITERS:
            try:
                files_of(format, defect.given, **defect.files)
            except Cannot:
                continue
            yield name, format


@pytest.mark.parametrize(("name", "format"), cells())
def test_every_reader_does_the_same_with_a_defect(name, format, tmp_path):
    if format in ("dae", "3mf", "xaml"):
        for package in ("collada", "lib3mf", "lxml"):
            pytest.importorskip(package, reason="the extra formats is not installed")
    defect = DEFECTS[name]
    how, said = outcome(tmp_path, format, defect)
    assert how == defect.other.get(format, defect.expected), said
    if how == defect.expected:
        assert re.search(defect.said, said), said
    assert not re.search(r"(Attribute|Key|Type|Index)Error|object", said), said
