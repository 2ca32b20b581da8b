"""Layouts that others read, made of a manifest and its files: COCO's annotations, and BOP's folders of a dataset.

In:  the manifest of a batch        Out: files

COCO's categories are those of the manifest, and have the numbers 1, 2 … in the order of their names. BOP's objects are
told apart by their triangles, whatever they are called: see bop_models.py.

Sources: COCO, cocodataset.org/#format-data. BOP, the page on the format of datasets in github.com/thodan/bop_toolkit;
what that doesn't say is as its script does it that counts pixels.
"""

import json
import os
import shutil
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..choices import ARRAY_SUFFIXES
from ..errors import OutputError, SceneError, import_extra, shown
from ..io.array_files import DEFAULT_SCALE
from ..io.files import are_same, checked_path, make_folder_of, write_whole
from ..io.png import encode_png
from ..keywords import checked_keywords
from ..scene.validate import items_of
from ..scene.validate import number as checked_number
from .annotations import decode_mask
from .bop_models import BopModels
from .manifest import as_seen_from, categories_of, read_manifest
from .tasks import RenderTask

_NOWHERE = [-1, -1, -1, -1]  # BOP's box of what isn't seen


@checked_keywords
def write_coco(manifest: str | os.PathLike[str], path: str | os.PathLike[str]) -> dict[str, int]:
    """Write annotations as COCO has them: of each picture and object that is seen its box, area, and mask.

    Parameters
    ----------
    manifest : path of a manifest, as `render_many(manifest=...)` writes it, whose tasks have written "rgb" pictures
    path : of the JSON file; names of pictures in it are as seen from its folder. `image_id` is the index of the task.
        Boxes are [left, top, width, height] in pixels, masks are compressed run lengths; `visible` is the manifest's

    Returns
    -------
    dict of the categories' names and numbers

    Raises
    ------
    RasterizerError : pycocotools, the extra `dataset`, is not installed
    SceneError : what is no manifest, or has no pictures
    OutputError : the file can't be written, or is the manifest
    """
    masks = import_pycocotools()
    lines, path = read_manifest(manifest), checked_path(path, "path")
    if are_same(path, os.fspath(manifest)):
        raise OutputError(f"can't write {path}: it is the manifest")
    categories = _categories(lines)
    images: list[dict[str, Any]] = []
    annotations: list[dict[str, Any]] = []
    for line in lines:
        width, height = line["size"]
        name = as_seen_from(path, _picture(line, manifest))
        images.append({"id": line["index"], "file_name": name, "width": width, "height": height})
        for each, category in zip(line["objects"], categories_of(line), strict=True):
            if not each["pixels"]:
                continue
            mask = masks.frPyObjects(each["mask"], height, width)
            found = {"id": len(annotations) + 1, "image_id": line["index"], "category_id": categories[category]}
            found |= {"bbox": each["box"], "area": each["pixels"], "iscrowd": 0, "visible": each["visible"]}
            annotations.append(found | {"segmentation": {"size": mask["size"], "counts": mask["counts"].decode()}})
    named = [{"id": number, "name": name} for name, number in categories.items()]
    _write_json(path, {"info": {}, "images": images, "categories": named, "annotations": annotations})
    return categories


@checked_keywords
def write_bop(
    manifest: str | os.PathLike[str],
    folder: str | os.PathLike[str],
    *,
    unit: float = 1000.0,
    tasks: Iterable[RenderTask] | None = None,
) -> dict[str, int]:
    """Write a scene of a BOP dataset: cameras, poses, boxes and visible shares, pictures, depths and masks; and the
    dataset's models and camera.

    Parameters
    ----------
    manifest : path of a manifest, as `render_many(manifest=...)` writes it, whose tasks have written pictures as "rgb",
        or PNG files of the depth, or both
    folder : of the scene, such as "set/train_pbr/000000"; it gets scene_camera.json, scene_gt.json, scene_gt_info.json,
        and the folders rgb, depth, mask and mask_visib. Pictures and depths are copied. The number of a picture is the
        index of its task. The dataset gets camera.json and the folder models, with models_info.json: two folders above
        a scene that is called by a number, so here in "set", else in the folder of the scene
    unit : millimetres that a scene unit has; 1000 = it is a metre
    tasks : those that the batch was given, in their order, whose models are loaded once more; None = the models are
        read by their paths in the manifest. Needed where tasks have meshes or scenes, or `load`

    Returns
    -------
    dict of the objects' names and their numbers (`obj_id`)

    An object is what has the same triangles, moved and turned: one mesh in several tasks, or at several places of a
    scene, is one object, and two meshes of one name are two. Its own frame has its origin in the middle of its box, and
    the axes that the world has where it is met first. R and t lead from there to the camera. Objects that the
    folder models has already keep their numbers, as those of another scene; without the folder they are numbered anew.

    Silhouettes are counted in a picture larger by its own size to each side, as BOP's tools do it; the width of a box
    is that from the middle of its first pixel to that of its last, as with them.

    Raises
    ------
    SceneError : what is no manifest, has neither pictures nor depths, or a camera without perspective; tasks that are
        needed, or not those of the manifest
    ModelError : a model that can't be read any more
    OutputError : a file can't be read or written
    """
    unit = checked_number(unit, "unit")
    if unit <= 0:
        raise SceneError(f"unit must be above 0, the millimetres of a scene unit; given {shown(unit)}")
    lines, folder = read_manifest(manifest), Path(checked_path(folder, "folder"))
    root = folder.parent.parent if folder.name.isdigit() else folder
    models = BopModels(root / "models", unit)
    given = None if tasks is None else items_of(tasks)
    cameras: dict[str, Any] = {}
    poses: dict[str, Any] = {}
    infos: dict[str, Any] = {}
    for line in lines:
        key, calibration = str(line["index"]), line["camera"]["opencv"]
        if calibration is None:
            raise SceneError(f"BOP has cameras with perspective alone; that of task {key} has none")
        K, R, t = (np.array(calibration[name]) for name in "KRt")
        cameras[key] = {"cam_K": K.ravel().tolist(), "cam_R_w2c": R.ravel().tolist(), "cam_t_w2c": (t * unit).tolist()}
        cameras[key] |= {"depth_scale": line["depth_scale"] * unit} if line["depth_scale"] else {}
        poses[key] = []
        for number, turn, place in models.find(line, given):
            pose = {"cam_R_m2c": (R @ turn).ravel().tolist(), "cam_t_m2c": (R @ place + t * unit).tolist()}
            poses[key].append({"obj_id": number} | pose)
        infos[key] = [_bop_info(each) for each in line["objects"]]
        _write_files(line, manifest, folder)
    for name, content in (("camera", cameras), ("gt", poses), ("gt_info", infos)):
        _write_json(folder / f"scene_{name}.json", content)
    K, size = np.array(lines[0]["camera"]["opencv"]["K"]), lines[0]["size"]
    lens = {"fx": K[0, 0], "fy": K[1, 1], "cx": K[0, 2], "cy": K[1, 2], "width": size[0], "height": size[1]}
    _write_json(root / "camera.json", lens | {"depth_scale": (lines[0]["depth_scale"] or DEFAULT_SCALE) * unit})
    _write_json(root / "models" / "models_info.json", models.infos)
    return models.names


def import_pycocotools() -> Any:
    """Return `pycocotools.mask`; raises RasterizerError, which names the extra, where it is missing."""
    return import_extra("pycocotools.mask", "dataset", "an annotation file of COCO")


def _bop_info(each: dict[str, Any]) -> dict[str, Any]:
    """What BOP says of an object in a picture. All pixels of the picture that it may have show a depth: of its own, or
    of what hides it."""
    n_whole = each["pixels_whole"]
    return {
        "px_count_all": n_whole,
        "px_count_valid": each["pixels_alone"],
        "px_count_visib": each["pixels"],
        "visib_fract": each["pixels"] / n_whole if n_whole else 0.0,
        "bbox_obj": _bop_box(each["box_whole"] if each["pixels"] else None),
        "bbox_visib": _bop_box(each["box"]),
    }


def _bop_box(box: list[int] | None) -> list[int]:
    """A box as BOP's tools count it."""
    return _NOWHERE if box is None else [box[0], box[1], box[2] - 1, box[3] - 1]


def _write_files(line: dict[str, Any], manifest: str | os.PathLike[str], folder: Path) -> None:
    """Copy the pictures of a line into the folders of a BOP scene, and write its masks there."""
    number = f"{line['index']:06d}"
    picture, depth = _path(line, manifest, ("rgb", "rgba")), _path(line, manifest, ("depth",))
    sources = {"rgb": picture, "depth": depth if line["depth_scale"] else None}
    if not any(sources.values()):
        raise SceneError(f"BOP needs pictures, or the depth in PNG files; task {number} has written {line['files']}")
    for name, source in sources.items():
        if source is not None:
            target = folder / name / (number + source.suffix.lower())
            make_folder_of(str(target))
            try:
                shutil.copyfile(source, target)
            except OSError as fault:
                raise OutputError(f"can't copy {source} to {target}: {fault.strerror or fault}") from fault
    for k, each in enumerate(line["objects"]):
        for name, mask in (("mask", each["mask_alone"] or each["mask"]), ("mask_visib", each["mask"])):
            target = folder / name / f"{number}_{k:06d}.png"
            make_folder_of(str(target))
            write_whole(target, encode_png(np.where(decode_mask(mask), np.uint8(255), np.uint8(0))[..., None]))


def _picture(line: dict[str, Any], manifest: str | os.PathLike[str]) -> Path:
    """Return the path of a line's picture; SceneError where it has none."""
    path = _path(line, manifest, ("rgb", "rgba"))
    if path is None:
        raise SceneError(f"COCO needs pictures; task {line['index']} has written {line['files']}")
    return path


def _path(line: dict[str, Any], manifest: str | os.PathLike[str], names: Sequence[str]) -> Path | None:
    """Return the path of a picture by the first of some names that a line has; None where it has none."""
    for name in names:
        path = Path(os.path.abspath(manifest)).parent / line["files"].get(name, "")
        if name in line["files"] and path.suffix.lower()[1:] not in ARRAY_SUFFIXES:
            return path
    return None


def _categories(lines: list[dict[str, Any]]) -> dict[str, int]:
    """Return the number of each category by its name."""
    return {name: k + 1 for k, name in enumerate(sorted({name for line in lines for name in categories_of(line)}))}


def _write_json(path: str | os.PathLike[str], content: dict[str, Any]) -> None:
    """Write a JSON file."""
    make_folder_of(os.fspath(path))
    write_whole(path, json.dumps(content).encode())
