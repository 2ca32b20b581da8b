"""`raster compare`: the sheet, the table, the record, and what is refused."""

import io
import json
import os
import shutil

import numpy as np
import pytest
from helpers.command import CUBE, assert_refused, raster
from helpers.raster import ROOT
from PIL import Image

import rasterizer as rz
from rasterizer.analysis.contact_sheet import GAP
from rasterizer.cli.compare import SIZE

BALL = str(ROOT / "models" / "sphere.obj")
SHADINGS = ("flat", "gouraud", "phong")

pytestmark = pytest.mark.usefixtures("folder")


def run(*argv) -> int:
    return raster("compare", "-s", "48x36", *argv)


def record_of(capsys, *argv) -> dict:
    assert run(*argv, "--json") == 0
    out, err = capsys.readouterr()
    assert err == ""
    return json.loads(out)


def test_the_sheet_shows_the_methods_in_order_above_their_errors(folder, capsys):
    assert run(BALL, "--background", "#fff") == 0
    out, err = capsys.readouterr()
    assert err == "" and os.listdir(folder) == ["sphere-compare.png"]
    image = np.asarray(Image.open("sphere-compare.png"))
    assert image.shape[1:] == (4 * 48 + 5 * GAP, 3)
    scene = rz.load(BALL, background="#fff")
    frames = {s: rz.render(scene, (48, 36), shading=s, tolerance=0, samples=1) for s in SHADINGS}
    for k, shading in enumerate((*SHADINGS, "phong")):
        shown = image[8:44, 8 + 56 * k : 56 + 56 * k]
        assert np.abs(shown.astype(int) - frames[shading].rgb).max() <= 1, shading
    maps = image[52:, 8:].astype(int).sum(axis=2)
    dark = [(maps[:44, 56 * k : 56 * k + 48] < 60).sum() for k in range(3)]
    assert dark[0] < dark[1] < dark[2], "errors get smaller from flat to Phong"
    title, head, *rows = out.splitlines()
    assert title == f"{BALL}: sphere-compare.png"
    assert head.split("  ")[-1].strip() == "slope rms" and head.split()[:3] == ["ms", "max", "rms"]
    cells = {row.split()[0]: row.split()[1:] for row in rows}
    assert list(cells) == [*SHADINGS, "reference"] and cells["reference"][:4] == ["-"] * 4
    for shading, frame in frames.items():
        ms, most, rms, over_one, value, slope, slope_rms = cells[shading]
        expected = rz.compare(frame.color, frames["phong"].color)
        bands_of = rz.render(scene, (48, 36), shading=shading, tolerance=0, samples=1, outputs=("color", "face"))
        bands = rz.mach_bands(bands_of, scene)
        assert float(ms) > 0 and int(over_one) == rz.compare(frame.rgb, frames["phong"].rgb).over_one, shading
        assert [float(most), float(rms)] == pytest.approx([expected.max, expected.rms], rel=0.01, abs=1e-6), shading
        jumps = [bands.value_jump, bands.slope_jump, bands.slope_rms]
        told = [f"{jump:.3g}" for jump in jumps] if bands.n_place else ["-"] * 3
        assert (got := [value, slope, slope_rms]) == told, f"{shading}: {got} != {told}"


def test_methods_of_the_command_line(capsys):
    """Gouraud's method on a finer model comes nearer to Phong's; in the order given."""
    names = ["phong", "gouraud", "gouraud+1", "gouraud+2"]
    record = record_of(capsys, BALL, "--no-reference", "--methods", ",".join(names), "-o", "x.jpg")
    methods = record["methods"]
    assert record["against"] == "phong" and list(methods) == names and Image.open("x.jpg").width == 4 * 48 + 5 * GAP
    errors = [methods[name]["rms"] for name in names[1:]]
    assert errors[0] > 2 * errors[1] > 4 * errors[2], errors
    assert min(of["ms"] for of in methods.values()) > 0 and methods["phong"]["max"] is None
    assert (record["model"], record["output"], record["size"], record["faces"]) == (BALL, "x.jpg", [48, 36], 5120)
    assert set(methods["phong"]) == {"ms", "max", "rms", "over_one", "value_jump", "slope_jump", "slope_rms"}
    assert record["scale"] > 0 and record["warnings"] == []
    record = record_of(capsys, CUBE, "--no-reference", "--methods", "flat,gouraud", "--subdivide", "1")
    assert record["against"] == "gouraud" and record["faces"] == 48, "the last, without Phong's"


def test_a_scene_file_has_its_own_camera_and_look_but_not_its_own_size(folder, capsys):
    shutil.copy(CUBE, "cube.obj")
    camera = {"position": [3, 2, 5], "target": [0, 0, 1], "up": [0, 1, 0], "fov": 40}
    table = {"meshes": [{"file": "cube.obj"}], "camera": camera, "options": {"size": [20, 10], "exposure": 1.5}}
    (folder / "scene.json").write_text(json.dumps(table))
    flags = ["--no-reference", "--methods", "flat,phong", "--json"]
    assert raster("compare", "scene.json", *flags) == 0
    assert json.loads(capsys.readouterr().out)["size"] == list(SIZE)
    scene = rz.load(CUBE, camera=rz.Camera(**camera), background="white")
    expected = rz.render(scene, SIZE, shading="flat", tolerance=0, samples=1, exposure=1.5).rgb
    shown = np.asarray(Image.open("scene-compare.png"))[GAP : GAP + 240, GAP : GAP + 320]
    assert np.abs(shown.astype(int) - expected).max() <= 1


def test_labels_fit_small_pictures_and_scales_are_round(capsys):
    for size in (8, 30, 100, 231):
        flags = ["-s", str(size), "--no-reference", "--methods", "flat,gouraud+1"]
        scale = record_of(capsys, CUBE, *flags)["scale"]
        assert f"{scale:.0e}" in (f"{scale}", f"{scale:.0e}") and f"{scale:.0e}"[0] in "125", scale
        image = np.asarray(Image.open("cube-compare.png").convert("L"))
        assert image.shape[1] == 2 * size + 3 * GAP
        assert (image[:, [0, -1]] == 255).all(), f"a label of {size} pixels reaches the border"
        labels = image[GAP + size + 2 : GAP + size + 12]
        assert (labels < 255).any() or size < 60, "there is a label where there is room for one"


def test_views_models_and_what_fails(folder, capsys):
    assert run(CUBE, "nope.obj", "--view", "iso", "--view", "top", "-q", "--no-reference") == 1
    assert capsys.readouterr() == ("", "raster: error: nope.obj: no such file\n")
    assert sorted(os.listdir(folder)) == ["cube-compare-iso.png", "cube-compare-top.png"]
    assert run(CUBE, "--eye", "0,0,9", "--target", "0,0,18") == 0
    assert "the picture is empty" in capsys.readouterr().err


def test_figures_go_to_stderr_with_a_picture_on_stdout(capfdbinary):
    assert run(CUBE, "--no-reference", "-o", "-") == 0
    out, err = capfdbinary.readouterr()
    assert Image.open(io.BytesIO(out)).format == "PNG" and b"slope jump" in err


def test_what_is_refused(capsys):
    assert_refused(capsys, [([CUBE, *argv.split()], words) for argv, words in (
        ("-o x.npy", "no arrays"),
        ("-o x.nope", "x.nope"),
        ("-s 0", "size must be (width, height)"),
        ("--shading flat", "--shading"),
        ("--methods flat+1", "gouraud+N"),
        ("--methods gouraud+16", "gouraud+N"),
        ("--tolerance 0", "unrecognized arguments"),
    )], "compare")  # fmt: skip
    assert_refused(capsys, [([CUBE, "-o", f"{CUBE}/x.png"], "no folder")], "compare", code=4)
