"""`raster completion`: the scripts know every command and flag, and shells complete by them."""

import shutil
import subprocess
import sys

import pytest
from helpers.command import assert_refused, one_error, raster
from helpers.raster import ROOT

from rasterizer.cli.completion import SHELLS
from rasterizer.cli.parser import COMMANDS, make_command_parser

pytestmark = pytest.mark.usefixtures("folder")


def script(shell, capsys) -> str:
    pytest.importorskip("shtab", reason="the extra completion is not installed")
    assert raster("completion", shell) == 0
    out, err = capsys.readouterr()
    assert err == ""
    return out


def needs(shell):
    return pytest.mark.skipif(shutil.which(shell) is None, reason=f"{shell} is not installed")


@pytest.mark.parametrize("shell", [pytest.param(shell, marks=needs(shell)) for shell in ("bash", "zsh", "fish")])
def test_the_shell_can_read_it(shell, capsys, folder):
    (folder / "script").write_text(script(shell, capsys))
    done = subprocess.run([shell, "-n", "script"], capture_output=True, text=True)
    assert done.returncode == 0 and done.stderr == ""


@pytest.mark.parametrize("shell", SHELLS)
def test_every_command_flag_and_word_is_there(shell, capsys):
    text = script(shell, capsys)
    for name in COMMANDS:
        actions = make_command_parser(name)._actions  # noqa: SLF001 - argparse has no public list
        flags = [flag for action in actions for flag in action.option_strings]
        lacking = [flag for flag in flags if (flag if shell != "fish" else flag.lstrip("-")) not in text]
        assert name in text and not lacking, f"{name}: {lacking}"
    for word in ("gouraud", "silhouette", "x86-64-v3", "bottom"):
        assert word in text, word


def test_what_is_no_shell_and_where_shtab_is_absent(capsys, monkeypatch):
    assert_refused(capsys, [(["cmd"], "choose from"), ([], "")], "completion")
    monkeypatch.setitem(sys.modules, "shtab", None)  # as where it isn't installed
    assert raster("completion", "bash") == 2
    assert f"completion needs shtab: pip install -e '{ROOT}[completion]'" in one_error(capsys)


@needs("bash")
def test_bash_completes(capsys, folder):
    (folder / "models").mkdir()
    (folder / "models" / "part.obj").write_text("")
    cases = {
        "re": "render",
        "render --shading ''": "flat lambert gouraud phong",
        "render x.obj --shading g": "gouraud",
        "render --up ''": "auto x y z -x -y -z",
        "render --view b": "back bottom",
        "render --edges cre": "crease",
        "render --reflection bl": "blinn",
        "info --js": "--json",
        "completion z": "zsh",
        "render models/": "models/part.obj",
        "render -o mod": "models",
        "view models/pa": "models/part.obj",
    }
    lines = [script("bash", capsys)]
    for words in cases:
        lines.append(f'set -- {words}; COMP_WORDS=(raster "$@"); COMP_CWORD=$#; COMPREPLY=(); _shtab_raster')
        lines.append('echo "${COMPREPLY[*]}"')
    (folder / "script").write_text("\n".join(lines))
    done = subprocess.run(["bash", "script"], capture_output=True, text=True, check=True)
    assert dict(zip(cases, done.stdout.splitlines(), strict=True)) == cases
