"""`raster compare`: the sheet, the table, the record, and what is refused."""

import io
import json
import subprocess
import sys

import numpy as np
import pytest
from helpers.raster import ROOT
from PIL import Image

import rasterizer as rz
from rasterizer.analysis.contact_sheet import GAP, label_width
from rasterizer.cli import compare_command, main
from rasterizer.cli.defaults import COMPARED_SIZE

BALL, CUBE = (str(ROOT / "models" / name) for name in ("sphere.obj", "cube.obj"))

pytestmark = pytest.mark.usefixtures("folder")


def run(*argv) -> int:
    return main(["compare", "-s", "48x36", *map(str, argv)])


def test_sheet_and_table(folder, capsys):
    assert run(BALL) == 0
    out, err = capsys.readouterr()
    assert err == "" and [path.name for path in folder.iterdir()] == ["sphere-compare.png"]
    image = Image.open("sphere-compare.png")
    assert image.mode == "RGB" and image.width == 4 * 48 + 5 * 8
    title, head, *rows = out.splitlines()
    assert title == f"{BALL}: sphere-compare.png"
    assert head.split("  ")[-1].strip() == "slope rms" and head.split()[:3] == ["ms", "max", "rms"]
    cells = {row.split()[0]: row.split()[1:] for row in rows}
    assert list(cells) == ["flat", "gouraud", "phong", "reference"]
    scene = rz.load(BALL)
    frames = {s: rz.render(scene, (48, 36), shading=s, tolerance=0, samples=1) for s in ("flat", "gouraud", "phong")}
    for shading, (ms, most, rms, over_one, *_) in ((s, cells[s]) for s in frames):
        assert float(ms) > 0
        expected = rz.compare(frames[shading].color, frames["phong"].color)
        assert float(most) == pytest.approx(expected.max, rel=0.01, abs=1e-6)
        assert float(rms) == pytest.approx(expected.rms, rel=0.01, abs=1e-6)
        assert int(over_one) == rz.compare(frames[shading].rgb, frames["phong"].rgb).over_one
    assert cells["reference"][:4] == ["-"] * 4


def test_methods_of_the_command_line(capsys):
    """Gouraud's method on a finer model comes nearer to Phong's; in the order given."""
    assert run(BALL, "--no-reference", "--methods", "phong,gouraud,gouraud+1,gouraud+2", "--json") == 0
    record = json.loads(capsys.readouterr().out)
    methods = record["methods"]
    assert record["against"] == "phong" and list(methods) == ["phong", "gouraud", "gouraud+1", "gouraud+2"]
    errors = [methods[name]["rms"] for name in ("gouraud", "gouraud+1", "gouraud+2")]
    assert errors[0] > 2 * errors[1] > 4 * errors[2], errors
    assert all(of["ms"] > 0 for of in methods.values())
    assert run(BALL, "--no-reference", "--methods", "flat,gouraud", "--json") == 0
    assert json.loads(capsys.readouterr().out)["against"] == "gouraud", "the last, without Phong's"


@pytest.mark.parametrize("size", [8, 30, 100, 150, 229, 231])
def test_labels_fit_small_pictures(size):
    """Every label lies within its picture and half of the gaps beside it."""
    for method in ("flat", "gouraud", "gouraud+2", "reference"):
        name = compare_command._name_of(method)
        label = compare_command._label([f"{name}, slope jump 0.0012 a pixel", name, method, ""], (size, size))
        assert label_width(label) <= size + GAP and (label or size < 60), f"{method} at {size}"
    assert main(["compare", "-s", f"{size}", CUBE, "--no-reference", "--methods", "flat,gouraud+1"]) == 0
    assert Image.open("cube-compare.png").width == 2 * size + 3 * GAP


def test_the_sheet_shows_the_methods_in_order():
    assert run(BALL, "--background", "#fff") == 0
    image = np.asarray(Image.open("sphere-compare.png"))
    scene = rz.load(BALL, background="#fff")
    for k, shading in enumerate(("flat", "gouraud", "phong", "phong")):
        frame = rz.render(scene, (48, 36), shading=shading, tolerance=0, samples=1)
        shown = image[8:44, 8 + 56 * k : 56 + 56 * k]
        assert np.abs(shown.astype(int) - frame.rgb).max() <= 1, shading
    maps = image[52:, 8:].astype(int).sum(axis=2)
    dark = [(maps[:44, 56 * k : 56 * k + 48] < 60).sum() for k in range(3)]
    assert dark[0] < dark[1] < dark[2], "errors get smaller from flat to Phong"


def test_json_without_reference(capsys):
    assert run(BALL, "--no-reference", "--json", "-o", "x.jpg") == 0
    out, err = capsys.readouterr()
    record = json.loads(out)
    assert err == "" and Image.open("x.jpg").width == 3 * 48 + 4 * 8
    assert (record["path"], record["output"], record["size"], record["faces"]) == (BALL, "x.jpg", [48, 36], 5120)
    assert record["against"] == "phong" and list(record["methods"]) == ["flat", "gouraud", "phong"]
    assert record["methods"]["phong"]["max"] is None and record["methods"]["flat"]["max"] > 0.01
    assert set(record["methods"]["flat"]) == {"ms", "max", "rms", "over_one", "value_jump", "slope_jump", "slope_rms"}
    assert record["scale"] > 0 and record["warnings"] == []


def test_views_models_and_folders(folder, capsys):
    assert run(CUBE, BALL, "--view", "iso", "--view", "top", "-q", "--no-reference") == 0
    assert capsys.readouterr() == ("", "")
    names = {f"{stem}-compare-{view}.png" for stem in ("cube", "sphere") for view in ("iso", "top")}
    assert {path.name for path in folder.iterdir()} == names
    assert run(CUBE, "nope.obj", "-q", "--no-reference") == 1
    assert capsys.readouterr().err == "raster: error: nope.obj: no such file\n"


def test_figures_go_to_stderr_with_a_picture_on_stdout(capfdbinary):
    assert run(CUBE, "-o", "-") == 0
    out, err = capfdbinary.readouterr()
    assert Image.open(io.BytesIO(out)).format == "PNG" and b"slope jump" in err


@pytest.mark.parametrize("scale", [0.0, 1e-9, 0.013, 0.2, 0.21, 0.5, 0.7, 3.0])
def test_scales_are_round_and_reach(scale):
    rounded = compare_command._rounded_up(scale)
    assert max(scale, 1e-6) <= rounded <= 2.5 * max(scale, 1e-6)
    assert f"{rounded:.0e}"[0] in "125"


def test_the_reference_is_announced_where_it_is_slow(capsys, monkeypatch):
    monkeypatch.setattr(compare_command, "_SLOW", 10)
    assert run(CUBE) == 0 and "--no-reference" in capsys.readouterr().err
    assert run(CUBE, "--no-reference") == 0 and capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        (["-o", "x.npy"], "no arrays"),
        (["-o", "x.nope"], "x.nope"),
        (["-o", f"{CUBE}/x.png"], "no folder"),
        (["--shading", "flat"], "--shading"),
        (["--methods", "flat+1"], "gouraud+N"),
        (["--methods", "gouraud+16"], "gouraud+N"),
        (["--eye", "0,0,9"], "empty"),
    ],
)
def test_what_is_refused(folder, capsys, argv, message):
    code = run(CUBE, *argv, *(["--target", "0,0,18"] if "--eye" in argv else []))
    err = capsys.readouterr().err
    assert message in err and err.startswith("raster: ") and err.count("\n") == 1
    assert code == (0 if message == "empty" else 4 if message == "no folder" else 2)
    assert code == 0 or list(folder.iterdir()) == []


def test_help(capsys):
    with pytest.raises(SystemExit):
        main(["compare", "--help"])
    text = capsys.readouterr().out
    assert "x".join(map(str, COMPARED_SIZE)) in text and "MODEL-compare.png" in text
    for flag in ("--no-reference", "--light", "--view", "--crease-angle", "--json", "--cull"):
        assert flag in text
    for flag in ("--shading", "--samples", "--array", "--tolerance"):
        assert flag not in text


def test_help_imports_nothing_heavy():
    code = (
        "import sys; from rasterizer.cli import main\n"
        "try: main(['compare', '--help'])\n"
        "except SystemExit: pass\n"
        "print(sorted({'numpy', 'numba', 'trimesh', 'PIL'} & set(sys.modules)), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True)
    assert done.stderr.strip() == "[]"
