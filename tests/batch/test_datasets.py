"""Whole datasets: several files of one frame, the manifest, random views and lights, whoever draws."""

import json
import os
import sys
import warnings
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.raster import ROOT
from PIL import Image

import rasterizer as rz
from rasterizer.batch.annotations import box_of, decode_mask, encode_mask
from rasterizer.batch.manifest import read_manifest

CUBE, CONE, TABLE, TORUS = (
    str(ROOT / "models" / name) for name in ("cube.obj", "cone.obj", "still_life.obj", "torus.glb")
)
SIZE = (48, 36)
SMALL = {"size": SIZE}

pytestmark = pytest.mark.usefixtures("folder")


def draw(tasks, **settings):
    """All records, in the order of the tasks; a thread of this process draws."""
    with ThreadPoolExecutor(settings.pop("n", 1)) as executor:
        return sorted(rz.render_many(tasks, executor, **settings), key=lambda record: record.index)


def files_below(folder=".") -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in Path(folder).rglob("*") if path.is_file()}


# --- several files of one frame -------------------------------------------------------------------------------


def test_one_frame_makes_all_files_of_a_task_and_the_record_lists_them():
    output = {"rgb": "a.png", "depth": Path("deep/a.depth.png"), "object": "a.mask.png", "normal": "a.normal.exr"}
    output |= {"rgba": "a.rgba.npy", "alpha": "a.alpha.png"}
    (record,) = draw([rz.RenderTask(CUBE, output, "iso", options=SMALL, scale=0.0005)])
    assert record.status == "drawn" and record.output == "a.png"
    assert record.files == tuple(map(str, output.values())) == tuple(record.as_dict()["files"])
    outputs = ("rgb", "depth", "object", "normal")
    frame = rz.render(CUBE, SIZE, azimuth=45, elevation=35.264389682754654, outputs=outputs)
    for name, path in output.items():
        scale = {"scale": 0.0005} if name == "depth" else {}
        assert Path(path).read_bytes() == frame.save(f"one{Path(path).suffix}", array=name, **scale).read_bytes(), name
    assert record.stats.samples == 4 * SIZE[0] * SIZE[1], "the picture keeps its samples"
    depth = np.asarray(Image.open("deep/a.depth.png"))
    assert depth.dtype == np.uint16 and np.abs(depth[depth > 0] * 0.0005 - frame.depth[depth > 0]).max() <= 0.000251


def test_all_files_of_a_task_appear_or_none(folder):
    (folder / "kept.npy").write_bytes(b"kept")
    os.chmod("kept.npy", 0o444)
    (folder / "taken.npy").mkdir()
    tasks = [
        rz.RenderTask(CUBE, {"rgb": "0.png", "depth": "kept.npy"}, options=SMALL),
        rz.RenderTask(CUBE, {"rgb": "1.png", "depth": "taken.npy", "face": "1.npy"}, options=SMALL),
        rz.RenderTask(CUBE, {"rgb": "2.png", "depth": "kept.npy/below.npy"}, options=SMALL),
        rz.RenderTask(CUBE, {"rgb": "3.png", "depth": "3.depth.png"}, options=SMALL, scale=1e-9),
        rz.RenderTask(CUBE, {"rgb": "4.png", "depth": "4.npy"}, options=SMALL),
        rz.RenderTask(CONE, {"depth": "5.npy", "rgb": "4.png"}, options=SMALL),
    ]
    records = draw(tasks)
    assert [record.status for record in records] == ["failed"] * 4 + ["drawn", "failed"]
    said = (
        "can't write kept.npy: the file",
        "can't write taken.npy: ",
        "kept.npy/below.npy",
        "with scale",
        "",
        "task 4",
    )
    for record, words in zip(records, said, strict=True):
        assert words in str(record.error or ""), record.error
    assert sorted(files_below()) == ["4.npy", "4.png", "kept.npy"] and (folder / "kept.npy").read_bytes() == b"kept"
    assert records[1].files == ("1.png", "taken.npy", "1.npy")


# --- what fails -----------------------------------------------------------------------------------------------


def test_a_batch_of_which_all_fails_says_so_at_its_end():
    batch = rz.render_many((rz.RenderTask(f"nope{k}.obj", f"{k}.png") for k in range(3)), n_process=1)
    with pytest.raises(
        rz.RasterizerError, match=r"^3 of 3 tasks failed; the first: nope\d.obj: no such file$"
    ) as found:
        list(batch)
    assert isinstance(found.value.__cause__, rz.ModelError) and list(batch) == []
    assert str(batch.summary).startswith("0 pictures drawn, 3 failed in ")
    assert "; the first failure: nope" in str(batch.summary)
    tasks = [rz.RenderTask("nope.obj", "a.png"), rz.RenderTask(CUBE, "b.png", options=SMALL)]
    for status in ("drawn", "skipped"):  # one of several, which is no fault of all
        assert [record.status for record in draw(tasks, existing="skip")] == ["failed", status]


def test_a_batch_that_nobody_asked_says_that_nothing_was_drawn():
    with pytest.warns(UserWarning, match="nothing was drawn") as found:
        rz.render_many([rz.RenderTask(CUBE, "a.png", options=SMALL)])
    assert found[0].filename == __file__ and not os.path.exists("a.png")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert list(rz.render_many([])) == []


# --- the manifest ---------------------------------------------------------------------------------------------


def dataset(folder="data", n=6, models=(TABLE, TORUS)):
    for k in range(n):
        output = {"rgb": f"{folder}/{k}.png", "depth": f"{folder}/{k}.depth.png", "object": f"{folder}/{k}.mask.png"}
        view = {"distance": (0.5, 1.5), "roll": (0, 360)}
        yield rz.RenderTask(models[k % len(models)], output, view, options=SMALL, seed=k, lights="random")


def test_the_manifest_says_what_the_files_show():
    assert {record.status for record in draw(dataset(), manifest="data/m.jsonl")} == {"drawn"}
    lines = read_manifest("data/m.jsonl")
    assert [line["index"] for line in lines] == list(range(6)) == [line["seed"] for line in lines]
    partly, cut = 0, 0
    for line, task in zip(lines, dataset(), strict=True):
        assert line["files"] == {name: os.path.basename(path) for name, path in task.output.items()}
        assert line["model"] == task.source and line["size"] == list(SIZE) and line["depth_scale"] == 0.001
        scene = rz.load(task.source)
        camera = rz.Camera.random(scene, task.seed, size=SIZE, **task.view)
        for found, value in zip(line["camera"]["opencv"].values(), camera.to_opencv(SIZE), strict=True):
            assert np.array_equal(found, value)
        opengl = line["camera"]["opengl"]
        assert np.array_equal(opengl["pose"], camera.pose)
        back = np.linalg.inv(opengl["pose"])
        assert np.allclose(opengl["R"], back[:3, :3]) and np.allclose(opengl["t"], back[:3, 3])
        ids = np.asarray(Image.open(task.output["object"])).astype(int) - 1
        assert len(line["objects"]) == len(scene.meshes)
        for k, (each, mesh) in enumerate(zip(line["objects"], scene.meshes, strict=True)):
            alone = rz.render(rz.Scene(mesh), SIZE, camera=camera, outputs="mask").mask
            seen, said = decode_mask(each["mask"]), each["mask_alone"]
            assert np.array_equal(seen, ids == k) and np.array_equal(decode_mask(said) if said else seen, alone)
            assert each["name"] == mesh.name and each["pixels"] == seen.sum() and each["pixels_alone"] == alone.sum()
            assert each["visible"] == (seen.sum() / alone.sum() if alone.any() else 0.0) and each["box"] == box_of(seen)
            wide = rz.Camera.from_opencv(*widened(camera), tuple(3 * n for n in SIZE))
            whole = rz.render(rz.Scene(mesh), tuple(3 * n for n in SIZE), camera=wide, outputs="mask").mask
            assert each["pixels_whole"] == whole.sum()
            left, top, *size = box_of(whole)
            assert each["box_whole"] == [left - SIZE[0], top - SIZE[1], *size]
            partly += 0 < each["visible"] < 1
            cut += each["pixels_whole"] > each["pixels_alone"]
    assert partly and cut, "some hide others, and some reach beyond the border"


def widened(camera):
    K, R, t = camera.to_opencv(SIZE)
    K[:2, 2] += SIZE
    return K, R, t


def test_a_mask_is_written_as_run_lengths():
    rng = np.random.default_rng(3)
    for shape in ((1, 1), (3, 5), (17, 4)):
        for share in (0.0, 0.1, 0.5, 1.0):
            mask = rng.random(shape) < share
            written = json.loads(json.dumps(encode_mask(mask)))
            assert np.array_equal(decode_mask(written), mask) and sum(written["counts"]) == mask.size
    assert encode_mask(np.array([[1, 0], [1, 1]], bool)) == {"size": [2, 2], "counts": [0, 2, 1, 1]}
    assert box_of(np.array([[0, 0, 0], [0, 1, 1]], bool)) == [1, 1, 2, 1] and box_of(np.zeros((2, 2), bool)) is None


def test_the_bytes_are_the_same_whoever_draws_and_in_however_many_parts():
    assert {record.status for record in draw(dataset("a"), manifest="a/m.jsonl")} == {"drawn"}
    list(rz.render_many(dataset("b"), n_process=2, manifest="b/m.jsonl"))
    expected = files_below("a")
    assert files_below("b") == expected and len(expected) == 19
    with ThreadPoolExecutor(1) as executor, rz.render_many(dataset("c"), executor, manifest="c/m.jsonl") as batch:
        taken = [next(batch).index for _ in range(3)]
    assert sorted(os.listdir("c"))[-1] == "m.jsonl.partial" and len(taken) == 3
    with open("c/m.jsonl.partial", "ab") as stream:
        stream.write(b'{"index": 5, "files"')  # half a line, as a machine leaves that stops
    gone, empty, _ = taken
    os.unlink(f"c/{gone}.png")
    open(f"c/{empty}.depth.png", "w").close()  # no picture, beside those that are whole
    records = draw(dataset("c"), existing="skip", manifest="c/m.jsonl")
    assert files_below("c") == expected
    assert sum(record.status == "skipped" for record in records) == 1
    assert {record.status for record in draw(dataset("c"), existing="skip", manifest="c/m.jsonl")} == {"skipped"}
    assert files_below("c") == expected
    os.unlink("c/m.jsonl")
    assert {record.status for record in draw(dataset("c"), existing="skip", manifest="c/m.jsonl")} == {"drawn"}
    assert files_below("c") == expected, "what the manifest doesn't know is drawn again"
    first = next(dataset("c"))
    Path("c/more.npy").write_bytes(b"not an array of this run")
    more = replace(first, output=first.output | {"face": "c/more.npy"})
    assert [record.status for record in draw([more], existing="skip", manifest="c/m.jsonl")] == ["drawn"]


def test_the_manifest_leaves_out_what_failed_and_refuses_what_is_not_legal(folder):
    camera, arrays = rz.Camera.orthographic((0, 0, 5), height=4), SMALL | {"outputs": ("depth", "object")}
    tasks = [*dataset("d", 1), rz.RenderTask("nope.obj", "d/x.png"), rz.RenderTask(CUBE, "d/m.jsonl.partial")]
    tasks += [rz.RenderTask(CUBE, "d/9.npz", (np.int64(3), 4), options=arrays)]
    tasks += [rz.RenderTask(CUBE, "d/8.jpg", camera=camera, options=SMALL)]
    assert [record.status for record in draw(tasks, manifest="d/m.jsonl")] == [
        "drawn",
        "failed",
        "failed",
        "drawn",
        "drawn",
    ]
    lines = read_manifest("d/m.jsonl")
    assert [line["index"] for line in lines] == [0, 3, 4] and lines[1]["view"] == [3, 4] and lines[1]["seed"] is None
    assert lines[1]["files"] == {"depth": "9.npz", "object": "9.npz"} and lines[1]["depth_scale"] is None
    assert lines[2]["files"] == {"rgb": "8.jpg"} and lines[2]["camera"]["opencv"] is None
    assert lines[2]["camera"]["height"] == 4
    for value in (5, "", b"x"):
        with pytest.raises(rz.SceneError, match="manifest must be a path"):
            rz.render_many([], manifest=value)
    with pytest.raises(rz.OutputError, match="can't write"):
        list(rz.render_many(dataset(), n_process=1, manifest="d/8.jpg/m.jsonl"))
    for text in ("", "{}\n", "nonsense\n"):
        (folder / "no.jsonl").write_text(text)
        with pytest.raises(rz.SceneError, match="is no manifest"):
            read_manifest("no.jsonl")


# --- random views and lights ----------------------------------------------------------------------------------


def test_random_views_are_even_on_the_sphere_and_the_same_for_a_seed():
    scene = rz.load(CUBE)
    cameras = [rz.Camera.random(scene, seed) for seed in range(500)]
    away = np.array([np.subtract(camera.position, camera.target) for camera in cameras])
    away /= np.linalg.norm(away, axis=1)[:, None]
    # The mean of n unit vectors has a deviation of 1/sqrt(3 n) an axis, that of squares of 2/sqrt(45 n); six of each.
    assert np.abs(away.mean(axis=0)).max() < 6 / np.sqrt(3 * 500)
    assert np.abs((away**2).mean(axis=0) - 1 / 3).max() < 6 * 2 / np.sqrt(45 * 500)
    assert rz.Camera.random(scene, 7) == cameras[7] != cameras[8]
    assert cameras[0].fov == 30 and np.allclose(cameras[1].position, (4.834862, 4.052406, 1.050808))


def test_random_views_stay_within_their_ranges():
    scene = rz.load(CUBE)
    for seed in range(50):
        near, far = (rz.Camera.random(scene, seed, elevation=(20, 40), distance=d, fov=(20, 60)) for d in (1, (2, 3)))
        away, further = (np.subtract(camera.position, camera.target) for camera in (near, far))
        assert 20 - 1e-9 <= np.degrees(np.arcsin(away[1] / np.linalg.norm(away))) <= 40 + 1e-9
        assert 2 <= np.linalg.norm(further) / np.linalg.norm(away) <= 3 and 20 <= near.fov == far.fov <= 60
        rolled = rz.Camera.random(scene, seed, roll=90)
        level = rz.Camera.random(scene, seed)
        assert np.allclose(rolled.view().right, level.view().up) and np.allclose(rolled.view().up, -level.view().right)
    for wrong, words in (
        ({"seed": -1}, "seed must be a whole number"), ({"seed": 1, "distance": 0}, "distance must be a range within"),
        ({"seed": 1, "fov": (50, 20)}, "fov must be a range"), ({"seed": 1, "elevation": "up"}, "must be a number or"),
        ({"seed": 1, "roll": (1, 2, 3)}, "roll must be a number or a pair"),
    ):  # fmt: skip
        with pytest.raises(rz.SceneError, match=words):
            rz.Camera.random(scene, **wrong)


def test_random_lights_are_within_their_ranges_and_the_same_for_a_seed():
    counts = set()
    for seed in range(200):
        ambient, *others = rz.random_lights(
            seed, n=(0, 2), elevation=(30, 60), intensity=(0.5, 0.6), up="z", shadow=True, fill=0
        )
        counts.add(len(others))
        assert 0.05 <= ambient.color[0] <= 0.2
        for light in others:
            assert 0.5 <= light.color[0] == light.color[2] <= 0.6 and light.shadow == rz.Shadow()
            assert 0.5 - 1e-9 <= -light.direction[2] <= np.sqrt(0.75) + 1e-9
    assert rz.random_lights() == rz.random_lights(0)
    assert counts == {0, 1, 2} and rz.random_lights(5) == rz.random_lights(5) != rz.random_lights(6)
    with pytest.raises(rz.SceneError, match=r"n must be a range within 0\.\.100"):
        rz.random_lights(1, n=(1, 200))


def test_random_lights_leave_no_side_dark_that_a_random_view_sees():
    """The mean brightness of what is seen, of 0 to 1 in sRGB: on a flat side, and on a round body."""
    means = []
    for scene in (rz.load(CUBE), rz.load(TORUS)):
        with rz.Renderer(scene, (32, 24), outputs="rgb", samples=1) as renderer:
            for seed in range(200):
                with renderer.in_lights(rz.random_lights(seed, up=scene.up)) as lit:
                    frame = lit.render(rz.Camera.random(scene, seed, size=(32, 24)))
                means.append(frame.rgb[frame.alpha > 0].mean() / 255)
    assert min(means) > 0.25


def test_lights_of_a_task_take_the_place_of_those_of_its_model():
    lights = (rz.AmbientLight(0.4), rz.DirectionalLight((0, -1, 0)))
    tasks = [
        rz.RenderTask(CUBE, "0.png", (20, 30), options=SMALL, lights=lights),
        rz.RenderTask(CUBE, "1.png", (20, 30), options=SMALL),
        rz.RenderTask(CUBE, "2.png", (20, 30), options=SMALL, lights={"n": 2}, seed=4),
        rz.RenderTask(CUBE, "3.png", np.array([20, 30]), options=SMALL, lights="random", seed=5),
    ]
    assert [record.error for record in draw(tasks)] == [None] * 4
    expected = (lights, None, rz.random_lights(4, n=2), rz.random_lights(5))
    scene = rz.load(CUBE)
    for k, each in enumerate(expected):
        lit = scene if each is None else replace(scene, lights=each)
        frame = rz.render(lit, SIZE, azimuth=20, elevation=30, outputs="rgb")
        assert Path(f"{k}.png").read_bytes() == frame.encode("PNG"), k


# --- what others read -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A dataset of a still life and a torus, in a folder of its own."""
    folder = tmp_path_factory.mktemp("made")
    draw(dataset(folder / "data"), manifest=folder / "data" / "m.jsonl")
    return folder


def test_pycocotools_reads_the_masks_of_the_object_buffer(made, capsys):
    coco = pytest.importorskip("pycocotools.coco", reason="the extra dataset is not installed")
    ids = rz.write_coco(made / "data" / "m.jsonl", made / "annotations" / "all.json")
    assert (
        list(ids) == sorted(ids) and list(ids.values()) == list(range(1, len(ids) + 1)) and {"torus", "ball"} < set(ids)
    )
    found = coco.COCO(str(made / "annotations" / "all.json"))
    assert (
        found.getImgIds() == list(range(6))
        and {each["name"]: each["id"] for each in found.loadCats(found.getCatIds())} == ids
    )
    for line in read_manifest(made / "data" / "m.jsonl"):
        (image,) = found.loadImgs(line["index"])
        picture = Image.open(made / "annotations" / image["file_name"])
        assert picture.size == (image["width"], image["height"]) == SIZE
        buffer = np.asarray(Image.open(made / "data" / line["files"]["object"])).astype(int) - 1
        annotations = found.loadAnns(found.getAnnIds(line["index"]))
        seen = [k for k in range(len(line["objects"])) if (buffer == k).any()]
        assert len(annotations) == len(seen)
        for k, annotation in zip(seen, annotations, strict=True):
            mask = found.annToMask(annotation).astype(bool)
            assert (
                np.array_equal(mask, buffer == k)
                and annotation["area"] == mask.sum()
                and annotation["bbox"] == box_of(mask)
            )
            name = line["objects"][k]["name"] if len(line["objects"]) > 1 else "torus"
            assert annotation["category_id"] == ids[name] and annotation["iscrowd"] == 0


def test_a_bop_scene_has_what_the_format_says(made):
    folder, lines = made / "train_pbr" / "000000", read_manifest(made / "data" / "m.jsonl")
    ids = rz.write_bop(made / "data" / "m.jsonl", folder, unit=100)
    models, lens = (json.loads((made / name).read_text()) for name in ("models/models_info.json", "camera.json"))
    assert sorted(map(str, ids.values())) == sorted(models) and (lens["width"], lens["height"]) == SIZE
    cameras, poses, infos = (
        json.loads((folder / f"scene_{name}.json").read_text()) for name in ("camera", "gt", "gt_info")
    )
    assert list(cameras) == list(poses) == list(infos) == [str(k) for k in range(6)]
    for line in lines:
        key = str(line["index"])
        scene, camera, said = rz.load(line["model"]), cameras[key], line["camera"]["opencv"]
        assert set(camera) == {"cam_K", "depth_scale", "cam_R_w2c", "cam_t_w2c"}
        assert (folder / "rgb" / f"{key:0>6}.png").read_bytes() == (made / "data" / line["files"]["rgb"]).read_bytes()
        millimetres = np.asarray(Image.open(folder / "depth" / f"{key:0>6}.png")) * camera["depth_scale"]
        # A corner that is seen: K (R x + t), in mm, leads to the pixel that has its depth.
        K, R, t = (
            np.reshape(camera[name], shape)
            for name, shape in (("cam_K", (3, 3)), ("cam_R_w2c", (3, 3)), ("cam_t_w2c", 3))
        )
        size = line["size"]
        taken = rz.render(
            scene, size, camera=rz.Camera.from_opencv(said["K"], said["R"], said["t"], size), outputs="position"
        )
        rows, columns = np.nonzero(millimetres)
        middle = len(rows) // 2
        x = R @ (taken.position[rows[middle], columns[middle]] * 100) + t
        assert np.allclose((K @ x)[:2] / x[2], (columns[middle], rows[middle]), atol=0.01)
        assert abs(x[2] - millimetres[rows[middle], columns[middle]]) < 0.5 * camera["depth_scale"] + 0.5
        assert len(poses[key]) == len(infos[key]) == len(line["objects"])
        for k, (pose, info, each) in enumerate(zip(poses[key], infos[key], line["objects"], strict=True)):
            assert pose["obj_id"] == ids[each["name"] if len(line["objects"]) > 1 else "torus"]
            (model,) = rz.load(made / "models" / f"obj_{pose['obj_id']:06d}.ply").meshes
            assert np.allclose(model.bounds.sum(axis=0), 0, atol=1e-3), "about the middle of its box"
            low, size_mm = ([models[str(pose["obj_id"])][f"{k}_{axis}"] for axis in "xyz"] for k in ("min", "size"))
            assert np.allclose(model.bounds[0], low) and np.allclose(np.ptp(model.bounds, axis=0), size_mm)
            posed = rz.Camera.from_opencv(K, np.reshape(pose["cam_R_m2c"], (3, 3)), pose["cam_t_m2c"], size)
            drawn = rz.render(rz.Scene(model), size, camera=posed, outputs="mask").mask
            mask, visib = (
                np.asarray(Image.open(folder / name / f"{key:0>6}_{k:06d}.png")) for name in ("mask", "mask_visib")
            )
            assert set(np.unique(mask)) | set(np.unique(visib)) <= {0, 255} and mask.shape == visib.shape == tuple(
                size[::-1]
            )
            assert (drawn != (mask > 0)).sum() <= 2, "the model by its pose and K is the mask, but for rounding"
            assert (info["px_count_all"], info["px_count_valid"]) == (each["pixels_whole"], (mask > 0).sum())
            assert info["px_count_visib"] == (visib > 0).sum() == each["pixels"] and not (visib > mask).any()
            assert info["visib_fract"] == (each["pixels"] / each["pixels_whole"] if each["pixels_whole"] else 0)
            box = box_of(visib > 0)
            assert info["bbox_visib"] == ([-1] * 4 if box is None else [*box[:2], box[2] - 1, box[3] - 1])
            assert len(info["bbox_obj"]) == 4


def placed(mesh, rng):
    """The mesh, turned and moved anyhow."""
    pose = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    pose *= np.sign(np.linalg.det(pose))
    return mesh.transformed(np.block([[pose, rng.uniform(-2, 2, (3, 1))], [np.zeros((1, 3)), 1.0]]))


def test_objects_of_bop_are_told_apart_by_their_triangles_and_have_their_own_poses(folder):
    rng = np.random.default_rng(4)
    cone, cube = (replace(rz.load(path).meshes[0], name="part") for path in (CONE, CUBE))
    scenes = [rz.Scene([placed(mesh, rng) for mesh in (cube, cone, cube)]) for _ in range(2)]
    scenes.append(rz.Scene([placed(cone, rng), cone.scaled((1, 1, 2)), cone.scaled((-1, 1, 1))]))
    tasks = [
        rz.RenderTask(s, {"rgb": f"{k}.png", "depth": f"{k}.d.png"}, "random", options=SMALL, scale="auto")
        for k, s in enumerate(scenes)
    ]
    assert [record.seed for record in draw(tasks, manifest="m.jsonl")] == [0, 1, 2]
    with pytest.raises(rz.SceneError, match="tasks="):
        rz.write_bop("m.jsonl", "set/train/000000")
    with pytest.raises(rz.SceneError, match="its model has 1"):
        rz.write_bop("m.jsonl", "set/train/000000", tasks=[rz.RenderTask(CUBE, "a.png")] * 3)
    names = rz.write_bop("m.jsonl", "set/train/000000", unit=1, tasks=iter(tasks))
    assert list(names.values()) == [1, 2, 3, 4], "a mirrored cone is another one"
    before = files_below("set/models")
    assert rz.write_bop("m.jsonl", "set/train/000001", unit=1, tasks=tasks[:3]) == names
    assert files_below("set/models") == before, "another scene of the dataset has the same objects"
    found = json.loads(Path("set/train/000000/scene_gt.json").read_text())
    assert [[each["obj_id"] for each in line] for line in found.values()] == [[1, 2, 1], [1, 2, 1], [2, 3, 4]]
    infos = json.loads(Path("set/models/models_info.json").read_text())
    for key, (line, scene) in enumerate(zip(read_manifest("m.jsonl"), scenes, strict=True)):
        depth, stored = line["depth_scale"], np.asarray(Image.open(line["files"]["depth"]))
        assert 60000 < stored.max() <= 65535 and depth == float(Image.open(line["files"]["depth"]).text["scale"])
        R, t = (np.array(line["camera"]["opencv"][name]) for name in "Rt")
        for each, mesh in zip(found[str(key)], scene.meshes, strict=True):
            model = rz.load(f"set/models/obj_{each['obj_id']:06d}.ply").meshes[0]
            seen = model.vertices @ np.reshape(each["cam_R_m2c"], (3, 3)).T + each["cam_t_m2c"]
            assert np.abs(seen - (mesh.vertices @ R.T + t)).max() < 1e-5
            far = np.linalg.norm(model.vertices[:, None] - model.vertices, axis=2).max()
            assert np.isclose(infos[str(each["obj_id"])]["diameter"], far)


def test_a_task_says_the_category_of_its_model(folder):
    pytest.importorskip("pycocotools", reason="the extra dataset is not installed")
    given = (None, "fruit", {"ball": "toy"}, 7)
    tasks = [rz.RenderTask(TABLE, f"{k}.png", options=SMALL, category=each) for k, each in enumerate(given)]
    *_, wrong = draw(tasks, manifest="m.jsonl")
    assert "category must be text" in str(wrong.error)
    own, fruit, toy = ([each["category"] for each in line["objects"]] for line in read_manifest("m.jsonl"))
    names = [mesh.name for mesh in rz.load(TABLE).meshes]
    assert own == names and set(fruit) == {"fruit"}
    assert toy == ["toy" if name == "ball" else name for name in names]
    assert {"fruit", "toy", "ball"} <= set(rz.write_coco("m.jsonl", "coco.json"))


def test_what_no_dataset_can_be_made_of_is_refused(folder):
    pytest.importorskip("pycocotools", reason="the extra dataset is not installed")
    camera = rz.Camera.orthographic((0, 0, 5), height=4)
    draw([rz.RenderTask(CUBE, "a.npz", options=SMALL)], manifest="arrays.jsonl")
    draw([rz.RenderTask(CUBE, "b.png", camera=camera, options=SMALL)], manifest="flat.jsonl")
    for function, words in ((rz.write_coco, "COCO needs pictures"), (rz.write_bop, "BOP needs pictures")):
        with pytest.raises(rz.SceneError, match=words):
            function("arrays.jsonl", "out")
        with pytest.raises(rz.SceneError, match="nope.jsonl is no manifest: No such file"):
            function("nope.jsonl", "out")
    with pytest.raises(rz.SceneError, match="perspective alone"):
        rz.write_bop("flat.jsonl", "out")
    with pytest.raises(rz.SceneError, match="unit must be above 0"):
        rz.write_bop("flat.jsonl", "out", unit=0)
    named = replace(rz.load(CUBE).meshes[0], name="box")
    draw(
        [rz.RenderTask(mesh, f"{k}.png", options=SMALL) for k, mesh in enumerate((named, rz.load(CONE)))],
        manifest="own.jsonl",
    )
    assert list(rz.write_coco("own.jsonl", "own.json")) == ["box", rz.load(CONE).meshes[0].name or "model-0"]
    os.unlink("b.png")
    rz.write_coco("flat.jsonl", "out.json")  # which has no need to read it
    draw([rz.RenderTask(CUBE, "c.png", options=SMALL)], manifest="gone.jsonl")
    os.unlink("c.png")
    with pytest.raises(rz.OutputError, match="can't copy"):
        rz.write_bop("gone.jsonl", "out")


@pytest.mark.parametrize("look", [{}, {"shading": "gouraud"}, {"ground": True}])
def test_a_renderer_in_other_lights_draws_as_a_new_one(look):
    """Also once the first one is closed."""
    scene = rz.load(TABLE)
    first = rz.Renderer(scene, SIZE, outputs=("color", "face"), **look)
    before = first.render()
    for lights in (rz.random_lights(3, shadow=True), rz.headlight(), rz.studio()):
        with first.in_lights(lights) as other:
            first.close()
            frame = other.render()
        expected = rz.render(replace(scene, lights=lights), SIZE, outputs=("color", "face"), **look)
        assert np.array_equal(frame.color, expected.color) and np.array_equal(frame.face, expected.face)
        assert np.array_equal(frame.rgba, expected.rgba)
    assert np.array_equal(before.rgba, rz.render(scene, SIZE, **look).rgba)
    with pytest.raises(rz.SceneError, match="light"):
        first.in_lights("sun")


@pytest.mark.skipif(sys.platform == "win32", reason="locks of POSIX")
def test_two_batches_do_not_write_one_manifest(folder):
    tasks = [rz.RenderTask(CUBE, f"{k}.png", options={"size": 8}) for k in range(3)]
    with rz.render_many(tasks, ThreadPoolExecutor(1), manifest="m.jsonl") as first:
        next(first)
        with pytest.raises(rz.OutputError, match="another batch"):
            next(rz.render_many(tasks, ThreadPoolExecutor(1), manifest="m.jsonl"))
        assert len(list(first)) == 2
    assert len(rz.read_manifest("m.jsonl")) == 3
    assert len(list(rz.render_many(tasks, ThreadPoolExecutor(1), manifest="m.jsonl", existing="skip"))) == 3
