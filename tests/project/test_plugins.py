"""A plug-in that is built, installed, and then known in the shell, in scene files, in programs and in their workers."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers.raster import ROOT

PLUGIN = Path(__file__).parent / "plugin"
PROGRAM = """
import sys
import numpy as np
import rasterizer as rz
from rasterizer import reference
from rasterizer.registries import class_of_light

Hemisphere = class_of_light("hemisphere")
assert "sky_and_moon" in sys.modules
light, mesh = Hemisphere(color="skyblue", ground="sienna"), rz.load({cube!r}).meshes[0]
scenes = []
for k in (0.6, 1.0, 1.8):
    material = rz.Material(reflection="minnaert", numbers=k)
    scenes.append(rz.Scene(mesh.with_material(material), [light, rz.DirectionalLight((-1, -2, -1.5), 0.7)]))
    frame = rz.render(scenes[-1], (48, 36), samples=1, shading="phong")
    error = np.abs(frame.color - reference.render(scenes[-1], (48, 36), shading="phong").color).max()
    assert error < 1e-6, (k, error)
options = {{"size": (48, 36), "samples": 1}}
tasks = [rz.RenderTask(scene, f"many-{{k}}.png", options=options) for k, scene in enumerate(scenes)]
records = [*rz.render_many(tasks, n_process=2)]
assert not any(record.error for record in records), records
for k, scene in enumerate(scenes):
    rz.render(scene, (48, 36), samples=1, threads=1).save(f"one-{{k}}.png")
for word in ("broken", "absent"):
    try:
        rz.Material(reflection=word)
    except rz.SceneError as fault:
        assert "plug-in" in str(fault) and word in str(fault), fault
    else:
        raise AssertionError(word)
"""


@pytest.fixture(scope="module")
def environment(tmp_path_factory):
    """What a process sees that has the plug-in installed."""
    built = tmp_path_factory.mktemp("plugin")
    installed = built / "installed"
    (built / "source").mkdir()
    for path in PLUGIN.iterdir():
        if path.is_file():
            (built / "source" / path.name).write_bytes(path.read_bytes())
    options = ["--quiet", "--no-index", "--no-deps", "--no-build-isolation", "--target", str(installed)]
    subprocess.run([sys.executable, "-m", "pip", "install", *options, str(built / "source")], check=True, timeout=300)
    return os.environ | {"PYTHONPATH": os.pathsep.join([str(installed), str(ROOT)])}


def run(environment, folder, *command):
    return subprocess.run([sys.executable, *command], cwd=folder, env=environment, capture_output=True, text=True,
                          timeout=300)  # fmt: skip


def test_a_plug_in_is_known_in_every_process(environment, tmp_path):
    cube = str(ROOT / "models" / "cube.obj")
    made = run(environment, tmp_path, "-c", PROGRAM.format(cube=cube))
    assert made.returncode == 0, made.stderr
    for k in range(3):
        assert (tmp_path / f"one-{k}.png").read_bytes() == (tmp_path / f"many-{k}.png").read_bytes()
    light = "hemisphere:color=skyblue,ground=sienna"
    flags = ["-s", "48x36", "--array", "color", "-o"]
    shell = [["--light", light, "--material", "reflection=minnaert,numbers=1.8"], ["--light", light]]
    (tmp_path / "scene.json").write_text(json.dumps({
        "meshes": [{"file": "cube.obj", "material": {"reflection": "minnaert", "numbers": [1.8]}}],
        "lights": [{"kind": "hemisphere", "color": "skyblue", "ground": "sienna"}],
    }))  # fmt: skip
    (tmp_path / "cube.obj").write_bytes(Path(cube).read_bytes())
    main = ("-m", "rasterizer", "render")
    for arguments in (["cube.obj", *shell[0], *flags, "a.npy"], ["scene.json", *flags, "b.npy"],
                      ["cube.obj", "scene.json", *shell[1], "-j", "2", *flags, "{stem}.npy"]):  # fmt: skip
        made = run(environment, tmp_path, *main, *arguments)
        assert made.returncode == 0, made.stderr
    pictures = [np.load(tmp_path / name) for name in ("a.npy", "b.npy", "scene.npy", "cube.npy")]
    assert np.array_equal(pictures[0], pictures[1]) and np.array_equal(pictures[1], pictures[2])
    assert np.ptp(pictures[3]) > 0.1


def test_a_fault_of_a_plug_in_is_told_as_its_own(environment, tmp_path):
    (tmp_path / "cube.obj").write_bytes((ROOT / "models" / "cube.obj").read_bytes())
    for flags, word in (
        (["--light", "hasty:color=red"], "HastyLight"),
        (["--reflection", "broken"], "the moon is down"),
        (["--light", "absent:color=red"], "no_such_module"),
        (["--material", "reflection=minnaert,numbers=1/2"], "numbers"),
        (["--light", "hemisphere:up=0/0/0"], "up"),
    ):
        made = run(environment, tmp_path, "-m", "rasterizer", "render", "cube.obj", "-o", "x.png", *flags)
        assert made.returncode in (1, 2) and word in made.stderr, (flags, made.returncode, made.stderr)
        assert "Traceback" not in made.stderr and "internal" not in made.stderr
        assert not (tmp_path / "x.png").exists()
    made = run(os.environ, tmp_path, "-m", "rasterizer", "render", "cube.obj", "--reflection", "minnaert")
    assert made.returncode == 2 and "minnaert" in made.stderr
