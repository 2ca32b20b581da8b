"""`raster completion`: the scripts know every command and flag, and shells complete by them."""

import shutil
import subprocess

import pytest
from helpers.command import assert_refused, raster

from rasterizer.cli import completion_command
from rasterizer.cli.commands import COMMANDS

pytestmark = pytest.mark.usefixtures("folder")


def script(shell, capsys) -> str:
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


def test_every_command_and_flag_is_there(capsys):
    commands = completion_command.list_commands()
    assert [command.name for command in commands] == list(COMMANDS)
    for shell in ("bash", "zsh", "fish"):
        text = script(shell, capsys)
        for command in commands:
            names = [name for flag in command.flags for name in flag.names]
            lacking = [name for name in names if (name if shell != "fish" else name.lstrip("-")) not in text]
            assert command.name in text and not lacking, f"{shell}, {command.name}: {lacking}"
    assert_refused(capsys, [(["tcsh"], "choose from"), ([], "")], "completion")


@needs("bash")
def test_bash_completes(capsys, folder):
    cases = {
        "re": "render",
        "render --shading ''": "flat lambert gouraud phong",
        "render x.obj --shading = g": "gouraud",
        "render --up =": "auto x y z -x -y -z",
        "compare --view b": "back bottom",
        "info --js": "--json",
        "completion ''": "bash zsh fish",
        "render -o ''": "",  # a file
        "render mod": "",
        "qwertz --x": "",
    }
    lines = [script("bash", capsys)]
    for words in cases:
        lines.append(f'set -- {words}; COMP_WORDS=(raster "$@"); COMP_CWORD=$#; COMPREPLY=(); _raster')
        lines.append('echo "${COMPREPLY[*]}"')
    (folder / "script").write_text("\n".join(lines))
    done = subprocess.run(["bash", "script"], capture_output=True, text=True, check=True)
    assert done.stderr == "" and dict(zip(cases, done.stdout.splitlines(), strict=True)) == cases


@needs("fish")
def test_fish_completes(capsys, folder):
    (folder / "script").write_text(script("fish", capsys))
    for line, completed in (
        ("raster rend", ["render"]),
        ("raster render --shading ", ["flat", "gouraud", "lambert", "phong"]),
        ("raster info --js", ["--json"]),
        ("raster completion ", ["bash", "fish", "zsh"]),
    ):
        code = f"source script; complete -C '{line}'"
        done = subprocess.run(["fish", "-N", "-c", code], capture_output=True, text=True, check=True)
        found = [each.partition("\t")[0] for each in done.stdout.splitlines()]
        assert (got := [word for word in found if word != "script"]) == completed, f"{line}: {got} != {completed}"
