"""`raster batch` and `raster render -j`: models drawn in other processes."""

import json
import os
import re
import shutil
import time
from pathlib import Path

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.command import CUBE, GEAR, assert_refused, errors, picture, raster
from helpers.raster import ROOT
from PIL import Image

import rasterizer as rz
from rasterizer.choices import VIEWS

pytestmark = pytest.mark.usefixtures("folder")

CONE = str(ROOT / "models" / "cone.obj")
SIZE = ["-s", "24x16", "--no-ground"]


def batch(*argv) -> int:
    return raster("batch", *SIZE, "-j", "1", *argv)


def summary_of(err) -> str:
    (line,) = [line for line in err.splitlines() if " drawn" in line]
    return re.sub(r" in .*", "", line.removeprefix("raster: "))


def test_the_files_are_those_of_render(capsys):
    look = ["--view", "iso", "--view", "top", "--material", "gold", "--shading", "phong", "-o", "{stem}-{view}.png"]
    assert raster("render", *SIZE, CUBE, CONE, "-q", *look) == 0
    found = {name: open(name, "rb").read() for name in os.listdir()}
    assert set(found) == {"cube-iso.png", "cube-top.png", "cone-iso.png", "cone-top.png"}
    for command, n in (("batch", "1"), ("render", "2")):
        assert raster(command, *SIZE, CUBE, CONE, "-q", *look, "-j", n) == 0
        assert found == {name: open(name, "rb").read() for name in os.listdir()}, command
    assert errors(capsys) == ""


def test_a_process_reads_a_model_once(folder, capsys):
    text = open(CUBE).read()
    (folder / "warned.obj").write_text(f"mtllib missing.mtl\nusemtl x\n{text}")
    views = "front,back,left,right,top,bottom,iso"
    assert raster("batch", *SIZE, "warned.obj", "-j", "2", "--view", views, "-o", "{view}.png") == 0
    err = errors(capsys)  # a warning each time that it is read, of three jobs
    assert summary_of(err) == "7 pictures drawn" and 1 <= err.count("missing.mtl") <= 2


def test_one_bad_model_does_not_stop_the_rest(folder, capsys):
    (folder / "bad.obj").write_text("v 1 2\n")
    assert batch(CUBE, "bad.obj", "nope.stl", GEAR, "--json") == 1
    out, err = capsys.readouterr()
    assert "bad.obj:1" in err and "nope.stl: no such file" in err
    assert summary_of(err) == "2 pictures drawn, 2 failed"
    assert {"cube.png", "gear.png"} <= set(os.listdir())
    *lines, last = map(json.loads, out.splitlines())
    assert "bad.obj:1" in last.pop("first_error")
    assert last | {"seconds": 0} == {"status": "done", "drawn": 2, "skipped": 0, "failed": 2, "seconds": 0}
    assert sorted(line["model"] for line in lines) == sorted([CUBE, "bad.obj", "nope.stl", GEAR])


def test_where_nothing_is_drawn_the_exit_code_says_why(folder, capsys):
    (folder / "cube.png").write_bytes(b"old")
    os.chmod("cube.png", 0o444)
    for model, code in (("nope.stl", 3), (CUBE, 4)):
        assert batch(model) == code
        assert summary_of(errors(capsys)) == "0 pictures drawn, 1 failed"
    assert (folder / "cube.png").read_bytes() == b"old"


def test_folders_are_made_again_and_what_is_there_is_skipped(folder, capsys):
    for path in ("parts/a/model.obj", "parts/ü b/model.obj", "parts/model.obj", "parts/.hidden/model.obj"):
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(open(CUBE, "rb").read())
    (folder / "parts" / "notes.txt").write_text("no model")
    parts = ["parts", "-o", "thumbs/"]

    def done(*flags):
        assert batch(*parts, *flags) == 0
        return summary_of(errors(capsys))

    assert done() == "3 pictures drawn"
    found = sorted(str(path.relative_to(folder)) for path in folder.glob("thumbs/**/*.png"))
    assert found == ["thumbs/a/model.obj.png", "thumbs/model.obj.png", "thumbs/ü b/model.obj.png"]
    os.unlink("thumbs/model.obj.png")
    assert done("--changed") == "1 picture drawn, 2 skipped"
    later = time.time() + 10
    os.utime("parts/a/model.obj", (later, later))
    assert done("--skip-existing") == "0 pictures drawn, 3 skipped"
    assert done("--changed") == "1 picture drawn, 2 skipped", "one is older than its model"
    np.save("values.npy", np.arange(8.0))
    os.utime("values.npy", (2 * later, 2 * later))
    for _ in range(2):
        assert batch(CUBE, "-o", "cube.png", "--scalars", "values.npy", "--changed") == 0
        assert summary_of(errors(capsys)) == "1 picture drawn", "it is older than its scalars"


def test_what_is_not_legal_is_told_before_a_model_is_loaded(capsys):
    assert_refused(capsys, [
        ([CUBE, "-j", "0"], "1 to 1024 processes"), ([CUBE, "-j", "two"], "1 to 1024 processes"),
        (["-", "--input-format", "obj"], "there is raster render"), ([CUBE, "-o", "-"], "there is raster render"),
        ([CUBE, "--scheduler", "here"], "tcp://"), ([CUBE, "--zoom", "0"], "--zoom"),
    ], "batch")  # fmt: skip
    for command in ("render", "batch"):
        assert_refused(capsys, [
            (["nope.obj", CUBE, "--scale", "1"], "--scale is that of depth in a PNG file"),
            (["nope.obj", CUBE, "--array", "depth", "--scale", "-1", "-o", "{stem}.png"], "--scale must be a number"),
            (["nope.obj", CUBE, "--samples", "3"], "argument --samples"),
            (["nope.obj", CUBE, "--exposure", "1e9"], "exposure"),
        ], command)  # fmt: skip


# --- datasets ---------------------------------------------------------------------------------------------------------


def test_arrays_of_one_frame_go_into_files_of_their_own(folder, capsys):
    look = ["--view", "iso,top", "-q"]
    names = ["--array", "rgb", "--array", "depth", "--array", "object"]
    for command, n in (("render", []), ("batch", ["-j", "1"])):
        assert raster(command, *SIZE, *n, CUBE, *look, *names, "-o", f"{command}/{{stem}}-{{view}}.{{array}}.png") == 0
        parts = ["--array", "rgb", "-o", f"{command}/{{view}}.jpg", "-o", f"{command}/{{view}}.png", "--scale", "0.01"]
        parts += ["--array", "depth", "-o", f"{command}/{{view}}.d.png", "--array", "uv", "--array", "face"]
        assert raster(command, *SIZE, *n, CUBE, *look, *parts, "-o", f"{command}/{{view}}.npz") == 0
    made = {name: (folder / "render" / name).read_bytes() for name in os.listdir("render")}
    assert made == {name: (folder / "batch" / name).read_bytes() for name in os.listdir("batch")} and len(made) == 14
    scene = rz.load(CUBE)
    camera = rz.Camera.framing(scene, *VIEWS["top"], aspect=24 / 16)
    frame = rz.render(scene, (24, 16), camera=camera, outputs=("rgb", "depth", "object", "uv", "face"))
    for name, array, settings in (
        ("cube-top.rgb.png", "rgb", {}), ("cube-top.depth.png", "depth", {}), ("cube-top.object.png", "object", {}),
        ("top.d.png", "depth", {"scale": 0.01}), ("top.npz", ("uv", "face"), {}), ("top.png", None, {}),
        ("top.jpg", None, {"quality": 92}),
    ):  # fmt: skip
        assert made[name] == frame.save(f"one{Path(name).suffix}", array=array, **settings).read_bytes(), name
    os.unlink("render/cube-iso.depth.png")
    assert raster("render", *SIZE, CUBE, "--view", "iso,top", *names, "--skip-existing", "-o",
                  "render/{stem}-{view}.{array}.png", "--json") == 0  # fmt: skip
    (line,) = capsys.readouterr().out.splitlines()
    assert json.loads(line)["arrays"] == ["depth"] and (folder / "render" / "cube-iso.depth.png").exists()


def test_outputs_that_several_arrays_can_not_have(capsys):
    for command in ("render", "batch"):
        assert_refused(capsys, [
            (["nope.obj", *words.split()], said) for words, said in (
                ("--array rgb --array depth -o a.png", "{array} in its name makes a file of each"),
                ("--array rgb -o a.png -o b.npz", "given none before -o b.npz"),
                ("--array rgb -o a.png --array uv -o b.npy --array face", "given one after -o b.npy"),
                ("--array rgb -o a.png --array depth -o a.png", "{stem}, {view}, {ext}, {folder} or {array}"),
                ("--array rgb -o a.png --array depth -o b.npy --scale 1", "--scale is that of depth"),
                ("--array uv --array depth -o {array}.png", "uv.png: a PNG file can't hold 'uv'"),
                ("-o {array}.png", "-o may hold"),
            )
        ], command)  # fmt: skip
    assert_refused(capsys, [([CUBE, "--array", "rgb", "-o", "-", "-o", "a.png"], "stdout takes one picture")], "render")
    assert_refused(capsys, [
        ([CUBE, "--coco", "a.json"], "give --manifest FILE, too"), ([CUBE, "--bop", "a"], "give --manifest FILE, too"),
    ], "batch")  # fmt: skip
    assert_refused(capsys, [([CUBE, "--manifest", "cube.png"], "it is the manifest")], "batch", code=4)


def test_no_manifest_takes_the_place_of_what_is_none(folder, capsys):
    """A model, by its name or by a link, or any other file; in its own place, or in that of the unfinished one."""
    shutil.copy(CUBE, "a.obj")
    Path("link").symlink_to("a.obj")
    Path("notes.txt").write_text("mine")
    Path("b.partial").write_text("mine")
    Path("folder").mkdir()
    before = sorted(os.listdir())
    for name in ("a.obj", "link", "notes.txt", "b", "folder"):
        assert batch("a.obj", "--manifest", name) == 4
        assert "something else is there, no manifest" in errors(capsys), name
    assert sorted(os.listdir()) == before and Path("a.obj").read_bytes() == Path(CUBE).read_bytes()
    assert Path("notes.txt").read_text() == Path("b.partial").read_text() == "mine"
    for torn in ("", '{"ind', '{"index":0,"fi'):
        Path("m.jsonl").write_text(torn)
        assert batch("a.obj", "--manifest", "m.jsonl") == 0 and len(Path("m.jsonl").read_text().splitlines()) == 1
    capsys.readouterr()


def test_annotations_take_no_place_of_what_is_read_or_written(folder, capsys):
    pytest.importorskip("pycocotools", reason="the extra dataset is not installed")
    shutil.copy(CUBE, "a.obj")
    for name, is_what in (("a.obj", "it is a.obj"), ("a.png", "it is a.png"), ("./m.jsonl", "it is the manifest")):
        assert batch("a.obj", "--manifest", "m.jsonl", "--coco", name) == 4
        assert is_what in errors(capsys)
    assert os.listdir() == ["a.obj"] and Path("a.obj").read_bytes() == Path(CUBE).read_bytes()


def test_a_dataset_has_a_manifest_and_what_is_made_of_it(folder, capsys):
    pytest.importorskip("pycocotools", reason="the extra dataset is not installed")
    arrays = ["--array", "rgb", "--array", "depth", "--array", "object", "--view", "iso,top"]
    made = ["--manifest", "set/m.jsonl", "--coco", "set/coco.json", "--bop", "set/train/000000", "--unit", "10"]
    output = ["-o", "set/{stem}-{view}.{array}.png"]
    assert batch(CUBE, "nope.obj", GEAR, *arrays, *output, *made) == 1
    lines = [json.loads(line) for line in open("set/m.jsonl")]
    assert [(line["index"], line["view"]) for line in lines] == [(0, "iso"), (1, "top"), (4, "iso"), (5, "top")]
    tasks = [
        rz.RenderTask(model, {name: f"lib/{stem}-{view}.{name}.png" for name in ("rgb", "depth", "object")}, view,
                      options={"size": (24, 16)})
        for model, stem in ((CUBE, "cube"), ("nope.obj", "nope"), (GEAR, "gear")) for view in ("iso", "top")
    ]  # fmt: skip
    list(rz.render_many(tasks, n_process=1, manifest="lib/m.jsonl"))
    assert open("set/m.jsonl", "rb").read() == open("lib/m.jsonl", "rb").read(), "the library writes the same"
    whole = json.loads((folder / "set" / "coco.json").read_text())
    assert [image["id"] for image in whole["images"]] == [0, 1, 4, 5] and len(whole["annotations"]) == 4
    assert (
        json.loads((folder / "set" / "train" / "000000" / "scene_camera.json").read_text())["0"]["depth_scale"] == 0.01
    )
    assert len(json.loads((folder / "set" / "models" / "models_info.json").read_text())) == 2
    before = {path: path.read_bytes() for path in folder.glob("set/**/*.*")}
    os.unlink("set/cube-top.object.png")
    os.unlink("set/m.jsonl")
    (folder / "set" / "m.jsonl.partial").write_bytes(
        before[folder / "set" / "m.jsonl"][:-9]
    )  # as if it were interrupted
    assert batch(CUBE, "nope.obj", GEAR, *arrays, *output, *made, "--changed") == 1
    assert "6 files drawn, 6 skipped, 6 failed" in errors(capsys)
    assert {path: path.read_bytes() for path in folder.glob("set/**/*.*")} == before


def test_depths_have_a_scale_that_follows_the_picture(folder, capsys):
    arrays = ["--array", "depth", "-o", "{stem}.png", "--scale", "auto"]
    assert batch(CUBE, GEAR, *arrays, "--manifest", "m.jsonl") == 0
    for line, path in zip(open("m.jsonl"), (CUBE, GEAR), strict=True):
        said, image = json.loads(line), Image.open(Path(path).stem + ".png")
        assert said["depth_scale"] == float(image.text["scale"]) and 59000 < np.asarray(image).max() <= 65535
        content = Path(image.filename).read_bytes()
        assert raster("render", *SIZE, path, *arrays) == 0 and Path(image.filename).read_bytes() == content
    capsys.readouterr()
    assert_refused(capsys, [([CUBE, *arrays[:-1], "automatic"], "a finite number is needed")], "render")


def test_the_manifest_has_no_line_of_a_file_that_is_not_written(folder, capsys):
    """What an earlier model has read stays."""
    for name in ("globe.obj", "globe.mtl", "globe.png"):
        shutil.copy(ROOT / "models" / name, folder / name.replace(".obj", "-of-earth.obj"))
    (folder / "models").mkdir()
    shutil.copy(CUBE, folder / "models" / "globe.obj")
    shutil.copy(CUBE, folder / "models" / "late.obj")
    shutil.copy(CUBE, folder / "late.png")
    texture = (folder / "globe.png").read_bytes()
    models = ["globe-of-earth.obj", "models/globe.obj", "models/late.obj"]
    assert batch(*models, "-o", "{stem}.png", "--allow-outside", "--manifest", "m.jsonl") == 1
    assert "can't write globe.png: it is globe.png, which is read" in errors(capsys)
    lines = [json.loads(line) for line in (folder / "m.jsonl").read_text().splitlines()]
    assert [line["files"]["rgb"] for line in lines] == ["globe-of-earth.png", "late.png"]
    assert (folder / "globe.png").read_bytes() == texture
    assert (folder / "late.png").read_bytes()[:4] == b"\x89PNG"


def test_random_views_and_lights_are_those_of_the_library(folder, capsys):
    """The same bytes for any number of processes, and one view alone; an interrupted set goes on."""
    arrays = ["--array", "rgb", "--array", "depth", "-o", "{stem}-{view}.{array}.png"]
    words = ["--view", "iso,random:3", "--seed", "9998", "--light", "random", *arrays]
    names = ("iso", "random-9998", "random-9999", "random-10000")
    tasks = [
        rz.RenderTask(
            model, {name: f"lib/{stem}-{view}.{name}.png" for name in ("rgb", "depth")},
            "random" if seed else "iso", options={"size": (24, 16)}, lights="random", seed=seed or 9998,
        )
        for model, stem in ((CUBE, "cube"), (GEAR, "gear"))
        for view, seed in zip(names, (None, 9998, 9999, 10000), strict=True)
    ]  # fmt: skip
    list(rz.render_many(tasks, n_process=1, manifest="lib/m.jsonl"))
    expected = {path.name: path.read_bytes() for path in (folder / "lib").iterdir()}
    assert len(expected) == 17 and len({*expected.values()}) == 17

    def draw(*argv):
        assert raster(*argv, *SIZE, CUBE, GEAR, *words) == 0
        return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}

    pictures = {name: content for name, content in expected.items() if name != "m.jsonl"}
    assert draw("render") == pictures
    os.unlink("gear-iso.depth.png")
    assert draw("batch", "-j", "1", "--skip-existing", "--manifest", "m.jsonl") == expected
    os.unlink("cube-random-9999.rgb.png")
    assert draw("batch", "-j", "2", "--skip-existing", "--manifest", "m.jsonl") == expected
    capsys.readouterr()
    assert (
        raster("render", *SIZE, CUBE, "--view", "random", "--seed", "9999", "--zoom", "2", "-o", "x.png", "--json") == 0
    )
    line = json.loads(capsys.readouterr().out)
    assert (line["view"], line["seed"]) == ("random", 9999)
    scene = rz.load(CUBE)
    camera = rz.Camera.random(scene, 9999, size=(24, 16))
    assert not differences(picture("x.png"), rz.render(scene, (24, 16), camera=camera, zoom=2).rgba)
    for flags, said in (
        ("--seed 3", "--seed needs something that is random"),
        ("--view random:0 --seed 3", "random:N makes 1 to"), ("--view random:x --seed 3", "random:20"),
        ("--view random:2 --seed -3", "a whole number of at least 0"),
        ("--view random --seed 1 --azimuth 3", "given --view random, --azimuth"),
        ("--view random --seed 1 --light random --light ambient:1", "takes the place of all lights"),
        ("--view random:2 --seed 1 -o a.png", "a template with"),
    ):  # fmt: skip
        assert_refused(capsys, [([CUBE, *flags.split()], said)], "render")
    shutil.copy(CONE, "cone.obj")
    assert raster("render", *SIZE, CUBE, "--view", "random:2,random", "--seed", "7", "-o", "v/{view}.png") == 0
    assert sorted(os.listdir("v")) == [f"random-000{k}.png" for k in (7, 8, 9)]
    twice = ["--view", "random,random", "--view", "top", "--view", "top"]
    assert raster("render", *SIZE, CUBE, *twice, "-o", "w/{view}.png") == 0
    assert sorted(os.listdir("w")) == ["random-0000.png", "random-0001.png", "top.png"]
    (folder / "lit.json").write_text('{"meshes": [{"file": "cone.obj"}], "preset": "headlight"}')
    for model, flags, words in (
        (CONE, "--shadows --ground", {"shadows": True, "ground": True}),
        (CONE, "--preset headlight --color teal", {"preset": "headlight", "color": "teal"}),
        ("lit.json", "", {}),  # whose preset goes, as lights do that a model brings
    ):
        options = {"size": (24, 16)} | words
        task = rz.RenderTask(model, "lib.png", "random", options=options, lights="random", seed=4)
        assert [record.error for record in rz.render_many([task], n_process=1)] == [None]
        random = ["--view", "random", "--light", "random", "--seed", "4"]
        assert raster("render", "-s", "24x16", model, *flags.split(), *random, "-o", "cli.png") == 0
        assert (folder / "cli.png").read_bytes() == (folder / "lib.png").read_bytes(), flags
    capsys.readouterr()
    assert batch(CUBE, "--view", "random:2", "-o", "{view}.png", "--manifest", "0.jsonl") == 0
    assert "seed 0" in errors(capsys) and Path("random-0001.png").exists()
    assert [json.loads(line)["seed"] for line in open("0.jsonl")] == [0, 1]
    assert_refused(capsys, [([CUBE, "--view", "random"], "one or several of iso")], "sheet")
    assert_refused(capsys, [([CUBE, "--light", "random"], "a light is one of")], "turntable")


def test_a_folder_that_changes_is_drawn_every_night(folder, capsys):
    """What is new, what has changed, and what a model names: nothing else, with the exit code of what is there."""
    (folder / "models" / "a").mkdir(parents=True)
    cube = open(CUBE).read()
    textured = "\n".join(["mtllib look.mtl", "vt 0 0", "usemtl m", "v 0 0 0", "v 1 0 0", "v 0 1 0", "f 1/1 2/1 3/1"])
    Image.new("RGB", (2, 2), "red").save(folder / "models" / "a" / "paint.png")
    (folder / "models" / "a" / "look.mtl").write_text("newmtl m\nmap_Kd paint.png\n")
    (folder / "models" / "a" / "card.obj").write_text(textured)
    (folder / "models" / "cube.obj").write_text(cube)
    clock = [time.time() - 10_000]

    def night():
        """A run, an hour after what was done; return its exit code, and what became of each picture."""
        code = batch("models", "-o", "thumbs/", "--format", "webp", "-s", "16", "--changed", "--json", "-q")
        lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
        clock[0] += 100
        for path in folder.glob("thumbs/**/*.webp"):
            if path.stat().st_mtime > clock[0]:
                os.utime(path, (clock[0], clock[0]))
        found = {line["output"][len("thumbs/") :]: line["status"] for line in lines[:-1] if "output" in line}
        return code, found, sum(line["status"] == "failed" for line in lines[:-1])

    def touch(*names):
        clock[0] += 100
        for name in names:
            os.utime(folder / "models" / name, (clock[0], clock[0]))

    touch("a/paint.png", "a/look.mtl", "a/card.obj", "cube.obj")
    assert night() == (0, {"a/card.obj.webp": "drawn", "cube.obj.webp": "drawn"}, 0)
    kept = {"a/card.obj.webp": "skipped", "cube.obj.webp": "skipped"}
    assert night() == (0, kept, 0)
    for name in ("a/paint.png", "a/look.mtl", "a/card.obj"):
        touch(name)
        assert night() == (0, kept | {"a/card.obj.webp": "drawn"}, 0), name
        assert night() == (0, kept, 0), name
    (folder / "models" / "notes.txt").write_text("nothing that a model names")
    touch("notes.txt")
    assert night() == (0, kept, 0)
    (folder / "models" / "cube.stl").write_text("solid nothing")  # a neighbour of that name, which is broken
    touch("cube.stl")
    for _ in range(2):  # the same code, night after night
        assert night() == (1, kept, 1)
    os.unlink(folder / "models" / "cube.stl")
    assert night() == (0, kept, 0)
    os.mkdir(folder / "empty")
    assert batch("empty", "-o", "thumbs/") == 0
