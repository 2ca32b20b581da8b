"""Recipes that can't be run whole: the image for Docker, and the GitHub Action. What they call is legal, and the
Action's steps that are ours do what the page says."""

import re
import shlex
import shutil
import subprocess
import sys

import numpy as np
import pytest
from helpers.pages import blocks, shell_lines
from helpers.raster import ROOT
from PIL import Image

from rasterizer.cli import main
from rasterizer.cli.arguments import parse

PAGE = "rasterizer/batch/README.md"
INSTRUCTIONS = {"FROM", "COPY", "RUN", "USER", "ENTRYPOINT", "CMD", "ENV", "WORKDIR"}


def dockerfile() -> list[tuple[str, str]]:
    (text,) = blocks(PAGE, "dockerfile")
    return [tuple(line.split(" ", 1)) for line in text.splitlines()]


def test_the_image_is_made_of_instructions_and_commands_that_there_are():
    lines = dockerfile()
    assert {word for word, _ in lines} <= INSTRUCTIONS and lines[0][0] == "FROM"
    runs = [shlex.split(part) for word, rest in lines if word == "RUN" for part in rest.split(" && ")]
    assert {words[0] for words in runs} == {"pip", "rm", "raster"}
    (warmup,) = [words for words in runs if words[0] == "raster"]
    arguments = parse(warmup[1:])
    assert arguments.command == "warmup" and arguments.cpu == "x86-64-v3"
    assert ("ENTRYPOINT", '["raster"]') in lines
    (user,) = [rest for word, rest in lines if word == "USER"]
    assert all(int(part) > 0 for part in user.split(":")), "root"
    assert [word for word, _ in lines].index("USER") > max(k for k, (word, _) in enumerate(lines) if word == "RUN")


def test_its_kernels_lie_where_the_package_looks_for_them():
    """The folder that the image names is the one that is looked into before the user's own."""
    from rasterizer.compiler.store import SHIPPED

    (line,) = [rest for word, rest in dockerfile() if rest.startswith("raster warmup")]
    code = re.search(r"\$\(python -c '(.+?)'\)/kernels", line)[1]
    made = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert f"{made.strip()}/kernels" == str(SHIPPED)


def test_containers_are_started_with_commands_that_there_are():
    runs = [shlex.split(line) for line in shell_lines(PAGE) if line.startswith("docker run")]
    assert len(runs) == 2
    for words in runs:
        arguments = parse(words[words.index("raster") + 1 :])
        assert arguments.command in ("batch", "doctor")
        assert "--read-only" in words
        mounted = {word.split(":")[1] for word in words if word.count(":") and word.startswith("$PWD")}
        assert arguments.command == "doctor" or mounted >= {*arguments.models, arguments.output.rstrip("/")}


# --- the Action ---------------------------------------------------------------------------------------------


@pytest.fixture
def repository(folder):
    """A repository with two models, and the script of the page."""
    (script,) = [text for text in blocks(PAGE, "python") if text.startswith("# compare_pictures.py\n")]
    (folder / "compare_pictures.py").write_text(script)
    (folder / "models" / "small").mkdir(parents=True)
    shutil.copy(ROOT / "models" / "gear.stl", folder / "models" / "small")
    shutil.copy(ROOT / "models" / "cube.obj", folder / "models")
    return folder


def steps() -> list[dict]:
    yaml = pytest.importorskip("yaml", reason="YAML needs PyYAML (the extra `distributed` brings it)")
    (text,) = blocks(PAGE, "yaml")
    (job,) = yaml.safe_load(text)["jobs"].values()
    assert set(job["env"]) == {"RASTER_STORE"} and job["timeout-minutes"] > 0
    return job["steps"]


def test_each_step_of_the_action_runs_or_uses_one_thing():
    found = steps()
    assert all(("run" in step) != ("uses" in step) for step in found)
    assert all(re.fullmatch(r"actions/[\w-]+@v\d+", step["uses"]) for step in found if "uses" in step)
    (cache,) = [step["with"] for step in found if step.get("uses", "").startswith("actions/cache")]
    assert cache["key"].startswith(cache["restore-keys"]) and cache["path"] == ".kernels"


def test_the_action_finds_what_has_changed(repository):
    """The models are drawn and approved; then one changes, one is new, and one is gone."""
    runs = [shlex.split(step["run"]) for step in steps() if "run" in step]
    (draw,) = [words for words in runs if words[0] == "raster"]
    (compare,) = [words for words in runs if words[0] == "python"]
    assert runs.index(draw) < runs.index(compare)

    def answer():
        done = subprocess.run([sys.executable, *compare[1:]], capture_output=True, text=True, check=False)
        return done.returncode, done.stdout.strip(), done.stderr

    assert main(draw[1:]) == 0
    shutil.copytree("drawn", "pictures")
    assert answer() == (0, "nothing has changed", "")

    kept = np.asarray(Image.open("pictures/cube.png").convert("RGBA")).copy()
    kept[0, :3, :3] += 2  # what another processor may do
    Image.fromarray(kept).save("pictures/cube.png")
    assert answer()[0] == 0
    kept[100:130, 100:130, :3] ^= 64
    Image.fromarray(kept).save("pictures/cube.png")
    (repository / "pictures" / "small" / "gear.png").rename("pictures/old.png")
    code, said, _ = answer()
    assert code == 1
    assert [line.split(":")[0] for line in said.splitlines()] == ["cube.png", "old.png", "small/gear.png"]
    assert "old.png: gone" in said and "gear.png: new" in said
