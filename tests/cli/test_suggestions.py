"""What is said to somebody who mistypes, or leaves out the command."""

import pytest
from helpers.command import CUBE, SMALL, one_error
from PIL import Image

from rasterizer.cli import main

pytestmark = pytest.mark.usefixtures("folder")


@pytest.mark.parametrize(
    ("argv", "meant"),
    [
        (["rendr", "x.obj"], "render"),
        (["render", "x.obj", "--shading", "gourad"], "gouraud"),
        (["render", "x.obj", "--view", "Top"], "top"),
        (["render", "x.obj", "--exposur", "1"], "--exposure"),
        (["render", "x.obj", "--back", "white"], "--background"),
        (["render", "x.obj", "--bg=white"], "--background"),
        (["render", "x.obj", "--resolution", "80"], "--size"),
        (["render", "x.obj", "--reflection", "blin"], "blinn"),
        (["bench", "x.obj", "--shadings", "flat,fong"], "phong"),
        (["render", CUBE, "--material", "diffus=0.5"], "diffuse"),
        (["render", CUBE, "--material", "shine=9"], "shininess"),
        (["render", CUBE, "--light", "pont:1,2,3"], "point"),
        (["render", CUBE, "--light", "spot:1,2,3,fall=2"], "falloff"),
        (["--versoin"], "--version"),
    ],
)
def test_the_nearest_is_named(argv, meant, capsys):
    assert main(argv) == 2
    assert f"did you mean {meant}?" in one_error(capsys)


def test_nothing_is_named_where_nothing_is_near(capsys):
    assert main(["render", "x.obj", "--qwertz"]) == 2 and "did you mean" not in one_error(capsys)
    assert main(["qwertz"]) == 2
    assert "there is no command and no file 'qwertz' (commands are render, " in one_error(capsys)


@pytest.mark.parametrize("argv", [[CUBE, *SMALL], [*SMALL, CUBE], [*SMALL, "--", CUBE]])
def test_models_without_a_command_are_drawn(argv):
    assert main([*argv]) == 0
    assert Image.open("cube.png").size == (24, 16)


def test_a_file_named_like_no_command_is_drawn_and_one_that_is_missing_is_told(folder, capsys):
    assert main(["nope.stl"]) == 3 and one_error(capsys) == "raster: error: nope.stl: no such file\n"
    assert main(["-s", "64", "compare", CUBE]) == 2
    assert "the command comes first: raster compare -s ..." in one_error(capsys)


@pytest.mark.parametrize("argv", [[], ["help"], ["--help"]])
def test_bare_raster_prints_the_help(argv, capsys):
    with pytest.raises(SystemExit) as stop:
        main(argv)
    out, err = capsys.readouterr()
    assert stop.value.code == 0 and err == "" and "commands:" in out and "warmup" in out


def test_help_takes_a_command(capsys):
    with pytest.raises(SystemExit) as stop:
        main(["help", "info"])
    assert stop.value.code == 0 and capsys.readouterr().out.startswith("usage: raster info")
