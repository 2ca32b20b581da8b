"""`raster completion`: the scripts know every command and flag, and shells complete by them."""

import shutil
import subprocess

import pytest

from rasterizer.cli import completion_command, main
from rasterizer.cli.commands import COMMANDS

SHELLS = {"bash": ["-n"], "zsh": ["-n"], "fish": ["-n"]}


def script(shell, capsys) -> str:
    assert main(["completion", shell]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    return out


def needs(shell):
    return pytest.mark.skipif(shutil.which(shell) is None, reason=f"{shell} is not installed")


@pytest.mark.parametrize("shell", [pytest.param(shell, marks=needs(shell)) for shell in SHELLS])
def test_the_shell_can_read_it(shell, capsys, tmp_path):
    path = tmp_path / "script"
    path.write_text(script(shell, capsys))
    done = subprocess.run([shell, *SHELLS[shell], str(path)], capture_output=True, text=True)
    assert done.returncode == 0 and done.stderr == ""


@pytest.mark.parametrize("shell", SHELLS)
def test_every_command_and_flag_is_there(shell, capsys):
    text = script(shell, capsys)
    commands = completion_command.list_commands()
    assert [command.name for command in commands] == list(COMMANDS)
    for command in commands:
        assert command.name in text
        for flag in command.flags:
            for name in flag.names:
                assert (name if shell != "fish" else name.lstrip("-")) in text


@needs("bash")
@pytest.mark.parametrize(
    ("words", "completed"),
    [
        (["re"], ["render"]),
        (["render", "--shading", ""], ["flat", "lambert", "gouraud", "phong"]),
        (["render", "x.obj", "--shading", "=", "g"], ["gouraud"]),
        (["render", "--up", "="], ["auto", "x", "y", "z", "-x", "-y", "-z"]),
        (["compare", "--view", "b"], ["back", "bottom"]),
        (["info", "--js"], ["--json"]),
        (["completion", ""], ["bash", "zsh", "fish"]),
        (["render", "-o", ""], []),  # a file
        (["render", "mod"], []),
        (["qwertz", "--x"], []),
    ],
)
def test_bash_completes(words, completed, capsys, tmp_path):
    path = tmp_path / "script"
    path.write_text(script("bash", capsys))
    code = 'source "$0"; COMP_WORDS=(raster "$@"); COMP_CWORD=$#; _raster; printf "%s\\n" "${COMPREPLY[@]}"'
    done = subprocess.run(["bash", "-c", code, str(path), *words], capture_output=True, text=True, check=True)
    assert done.stdout.split() == completed and done.stderr == ""


@needs("fish")
@pytest.mark.parametrize(
    ("line", "completed"),
    [
        ("raster rend", ["render"]),
        ("raster render --shading ", ["flat", "gouraud", "lambert", "phong"]),
        ("raster info --js", ["--json"]),
        ("raster completion ", ["bash", "fish", "zsh"]),
    ],
)
def test_fish_completes(line, completed, capsys, tmp_path):
    path = tmp_path / "script"
    path.write_text(script("fish", capsys))
    code = f"source {path}; complete -C '{line}'"
    done = subprocess.run(["fish", "-N", "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path)
    found = [each.partition("\t")[0] for each in done.stdout.splitlines()]
    assert [word for word in found if word != "script"] == completed


def test_another_shell_is_refused(capsys):
    assert main(["completion", "tcsh"]) == 2 and main(["completion"]) == 2
    assert "choose from" in capsys.readouterr().err
