"""What is said to somebody who mistypes, or leaves out the command."""

import os

import pytest
from helpers.command import CUBE, SMALL, assert_refused, one_error, raster
from PIL import Image

pytestmark = pytest.mark.usefixtures("folder")


def test_the_word_that_is_meant_is_named(capsys):
    """A flag by its nearest or by a word of other programs; of other words all that are legal are listed."""
    meant = {
        "render x.obj --exposur 1": "did you mean --exposure?",
        "render x.obj --bg=white": "did you mean --background?",
        "render x.obj --resolution 80": "did you mean --size?",
        "x.obj --versoin": "raster render --help",
        "rendr x.obj": "render",
        "render x.obj --shading gourad": "gouraud",
        "render x.obj --view Top": "top",
        "render x.obj --reflection blin": "blinn",
        "bench x.obj --shadings flat,fong": "phong",
        f"render {CUBE} --material shine=9": "shininess",
        f"render {CUBE} --light pont:1,2,3": "point",
        f"render {CUBE} --light spot:1,2,3,fall=2": "falloff",
    }
    assert_refused(capsys, [(argv.split(), word) for argv, word in meant.items()])
    assert_refused(capsys, [(["qwertz"], "there is no command and no file 'qwertz' (commands are render, ")])
    assert raster("render", "x.obj", "--qwertz") == 2 and "did you mean" not in one_error(capsys)


def test_models_without_a_command_are_drawn(capsys):
    for argv in ([CUBE, *SMALL], [*SMALL, CUBE], [*SMALL, "--", CUBE]):
        assert raster(*argv) == 0 and Image.open("cube.png").size == (24, 16), argv
        os.unlink("cube.png")
    assert_refused(capsys, [(["nope.stl"], "raster: error: nope.stl: no such file\n")], code=3)
    assert_refused(capsys, [(["draw"], "raster --help"), (["--foo"], "raster render --help"),
                            (["-q"], "raster render --help")])  # fmt: skip


def test_help_is_printed_for_the_program_and_for_a_command(capsys):
    for argv, start in (([], "usage: raster "), (["help"], "usage: raster "), (["help", "info"], "usage: raster info")):
        with pytest.raises(SystemExit) as stop:
            raster(*argv)
        out, err = capsys.readouterr()
        assert stop.value.code == 0 and err == "" and out.startswith(start), argv
        assert argv[1:] or ("commands:" in out and "warmup" in out), argv
