"""The models of a BOP dataset: which objects there are, their files, and where each stands in a scene.

In:  the lines of a manifest, whose models are loaded once more        Out: numbers and poses; models/obj_000001.ply …

Meshes of a scene lie in the world, wherever nodes of a file, or a program, have put them. One that has the same
triangles as another is the same object if a motion leads from the corners of one to those of the other.

Sources: BOP, the page on the format of datasets in github.com/thodan/bop_toolkit. The motion: Kabsch 1976, Acta
Crystallographica A32, 922-923.
"""

import json
import os
import pickle
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import OutputError, SceneError
from ..io.files import make_folder_of, write_whole
from ..io.loader import read_source
from ..scene.mesh import Mesh
from .manifest import categories_of
from .tasks import RenderTask

Array = NDArray[np.float64]
_SAME = 1e-4  # of its size: so far off may the corners of an object be at another place
_BLOCK = 1024  # points whose distances are taken at once


class Shape(NamedTuple):
    """The triangles of a mesh: the vertices that they use, and which three each has."""

    points: Array  # (n, 3), mm
    faces: NDArray[np.int32]

    @property
    def key(self) -> tuple[int, str]:
        """Equal for whatever may be one object."""
        return len(self.points), sha256(self.faces.tobytes()).hexdigest()


class BopModels:
    """Number the objects of a dataset.

    Parameters
    ----------
    folder : of the models; those that are there keep their numbers
    unit : millimetres of a scene unit

    Attributes
    ----------
    infos : what models_info.json says
    names : numbers of the objects that were asked for, by their names
    """

    def __init__(self, folder: Path, unit: float) -> None:
        self._folder, self._unit = folder, unit
        self._known: dict[tuple[int, str], list[tuple[int, Shape]]] = {}
        self._last: tuple[Any, bytes, list[Shape]] = None, b"", []  # a model, how it was loaded, and its meshes
        self.infos: dict[str, Any] = {}
        self.names: dict[str, int] = {}
        try:
            self.infos = json.loads((folder / "models_info.json").read_bytes())
            numbers = [int(number) for number in self.infos]
        except FileNotFoundError:
            return
        except (OSError, ValueError, TypeError) as fault:
            raise OutputError(f"can't read {folder / 'models_info.json'}: {fault}") from fault
        for number in numbers:
            shape = shape_of(read_source(str(self._file(number))).scene.meshes[0], 1.0)
            self._known.setdefault(shape.key, []).append((number, shape))

    def find(self, line: dict[str, Any], tasks: list[RenderTask] | None) -> list[tuple[int, Array, Array]]:
        """Return the number of each object of a line, and the R (3, 3) and t (3,), mm, that lead from its frame to the
        world's. New ones are written."""
        index, source, load = line["index"], line["model"], {}
        if tasks is not None:
            if not (index < len(tasks) and isinstance(tasks[index], RenderTask)):
                raise SceneError(f"tasks must be those of the batch, in their order; there is none for line {index}")
            source, load = tasks[index].source, tasks[index].loading
        if source is None:
            raise SceneError(f"task {index} has drawn no file: give write_bop the tasks of the batch, tasks=…")
        before, words, shapes = self._last
        is_same = source is before or (isinstance(source, (str, os.PathLike)) and source == before)
        if not is_same or words != pickle.dumps(load):
            shapes = [shape_of(mesh, self._unit) for mesh in read_source(source, **load).scene.meshes]
            self._last = source, pickle.dumps(load), shapes
        if len(shapes) != len(line["objects"]):
            drawn = f"task {index} has drawn {len(line['objects'])} meshes"
            raise SceneError(f"{drawn}, its model has {len(shapes)}: tasks=… says how it was loaded")
        return [self._find(shape, name) for shape, name in zip(shapes, categories_of(line), strict=True)]

    def _find(self, shape: Shape, name: str) -> tuple[int, Array, Array]:
        """Return what `find` does of one object."""
        alike = self._known.setdefault(shape.key, [])
        motions = ((number, motion_between(known.points, shape.points)) for number, known in alike)
        number, motion = next((each for each in motions if each[1] is not None), (0, None))
        if motion is None:
            number = 1 + max(map(int, self.infos), default=0)
            low, high = shape.points.min(axis=0), shape.points.max(axis=0)
            known = Shape((shape.points - 0.5 * (low + high)).astype("<f4").astype(np.float64), shape.faces)
            self._write(number, known)
            alike.append((number, known))
            motion = np.eye(3), 0.5 * (low + high)
        if number not in self.names.values():
            self.names[name if name not in self.names else f"{name}-{number}"] = number
        return number, *motion

    def _file(self, number: int) -> Path:
        return self._folder / f"obj_{number:06d}.ply"

    def _write(self, number: int, shape: Shape) -> None:
        """Write the file of a new object, and note its size."""
        low, size = shape.points.min(axis=0).tolist(), np.ptp(shape.points, axis=0).tolist()
        info = {"diameter": diameter_of(shape.points)}
        info |= {f"min_{axis}": value for axis, value in zip("xyz", low, strict=True)}
        self.infos[str(number)] = info | {f"size_{axis}": value for axis, value in zip("xyz", size, strict=True)}
        rows = np.empty(len(shape.faces), [("n", "u1"), ("corners", "<i4", 3)])
        rows["n"], rows["corners"] = 3, shape.faces
        lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(shape.points)}"]
        lines += [f"property float {axis}" for axis in "xyz"]
        lines += [f"element face {len(rows)}", "property list uchar int vertex_indices", "end_header", ""]
        make_folder_of(str(self._file(number)))
        points = shape.points.astype("<f4")
        write_whole(self._file(number), "\n".join(lines).encode() + points.tobytes() + rows.tobytes())


def shape_of(mesh: Mesh, unit: float) -> Shape:
    """Return the triangles of a mesh in mm."""
    used, corners = np.unique(mesh.faces, return_inverse=True)
    return Shape(mesh.vertices[used] * unit, corners.reshape(-1, 3).astype(np.int32))


def motion_between(points: Array, moved: Array) -> tuple[Array, Array] | None:
    """Return the rotation R (3, 3) and t (3,) of moved = R points + t; None where no motion does it.

    Source: Kabsch 1976: of the covariance U S Vᵀ the rotation V diag(1, 1, ±1) Uᵀ, its sign such that it is no mirror.
    """
    (a, b), allowed = (points.mean(axis=0), moved.mean(axis=0)), _SAME * float(np.ptp(points, axis=0).max())
    if np.abs(points - a - (moved - b)).max() <= allowed:
        return np.eye(3), b - a
    u, _, vt = np.linalg.svd((points - a).T @ (moved - b))
    turn = (vt.T * (1.0, 1.0, np.sign(np.linalg.det(vt) * np.linalg.det(u)))) @ u.T
    if np.abs((points - a) @ turn.T - (moved - b)).max() > allowed:
        return None
    return turn, b - turn @ a


def diameter_of(points: Array) -> float:
    """Return the largest distance of two points, (n, 3).

    It is at least that of the furthest point from any one to the furthest from it. Points that are nearer to the middle
    than that, less the largest distance from the middle, are no ends of it.
    """
    centered = np.unique(points, axis=0) - 0.5 * (points.min(axis=0) + points.max(axis=0))
    radii, at, least = np.linalg.norm(centered, axis=1), 0, 0.0
    for _ in range(4):
        away = np.linalg.norm(centered - centered[at], axis=1)
        at, least = int(away.argmax()), max(least, float(away.max()))
    ends = centered[radii + radii.max() >= least * (1.0 - 1e-12)]
    squares = (ends**2).sum(axis=1)
    blocks = (slice(k, k + _BLOCK) for k in range(0, len(ends), _BLOCK))
    found = max(float((squares[b, None] + squares - 2.0 * ends[b] @ ends.T).max()) for b in blocks)
    return max(least, float(np.sqrt(found)))
