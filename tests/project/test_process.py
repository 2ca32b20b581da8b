"""The process belongs to the program: the library changes nothing that all of its threads share."""

import ast
import os
import signal
import sys
import threading
import warnings
from concurrent.futures import ThreadPoolExecutor
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from helpers.model_bytes import rich_gltf
from helpers.raster import ROOT
from PIL import Image

import rasterizer as rz

SWITCHES = {
    "catch_warnings", "simplefilter", "filterwarnings", "showwarning", "dup2", "setrlimit", "setlocale", "putenv",
    "unsetenv", "chdir", "umask", "setswitchinterval", "setrecursionlimit", "seterr", "setdefaulttimeout",
}  # fmt: skip
# What is a program itself, and processes that we have started.
OWN = {"cli/__init__.py", "cli/messages.py", "cli/warmup.py", "processes.py"}


def test_no_file_of_the_library_sets_a_switch_of_the_process():
    found = []
    for path in sorted((ROOT / "rasterizer").rglob("*.py")):
        name = path.relative_to(ROOT / "rasterizer").as_posix()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            is_switch = isinstance(node, ast.Attribute) and node.attr in SWITCHES
            if isinstance(node, ast.Attribute) and node.attr == "signal" and isinstance(node.value, ast.Name):
                is_switch = node.value.id == "signal"
            if isinstance(node, (ast.Assign, ast.Delete)):
                targets = node.targets
                is_switch |= any("os.environ" in ast.unparse(each) for each in targets)
            if isinstance(node, ast.Call) and ast.unparse(node.func).startswith("os.environ."):
                is_switch |= node.func.attr in ("update", "pop", "setdefault", "clear")
            if is_switch and name not in OWN:
                found.append(f"{name}:{node.lineno}: {ast.unparse(node)[:80]}")
    assert not found, found


def pictures_of(folder):
    """Files that are warned of, textures that are damaged, what other libraries read."""
    Image.new("RGB", (9, 9), "red").save(folder / "paint.tiff", compression="tiff_lzw")
    damaged = (folder / "paint.tiff").read_bytes()
    (folder / "bad.tiff").write_bytes(damaged[: len(damaged) // 2])
    (folder / "look.mtl").write_text("newmtl m\nmap_Kd paint.tiff\nnewmtl n\nmap_Kd bad.tiff\n")
    lines = ["mtllib look.mtl", "vt 0 0", "v 0 0 0", "v 1 0 0", "v 0 1 0", "usemtl m", "f 1/1 2/1 3/1", "usemtl n"]
    (folder / "card.obj").write_text("\n".join([*lines, "f 3/1 2/1 1/1", "usemtl gone", "f 1/1 2/1 3/1"]))
    (folder / "rich.gltf").write_bytes(rich_gltf())
    return [folder / "card.obj", folder / "rich.gltf", ROOT / "models" / "gear.stl", ROOT / "models" / "globe.obj"]


@pytest.mark.filterwarnings("ignore")
@pytest.mark.skipif(sys.platform == "win32", reason="descriptors of POSIX")
def test_nothing_that_threads_share_is_ever_changed(tmp_path):
    """Eight threads load and draw, and one watches: stderr, filters of warnings, signal handlers, the environment."""

    def state():
        descriptor = os.fstat(2)
        handlers = tuple(signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGCHLD))
        return (
            (descriptor.st_dev, descriptor.st_ino),
            tuple(warnings.filters),
            warnings.showwarning,
            handlers,
            dict(os.environ),
            os.getcwd(),
            np.geterr(),
            sys.stdout,
            sys.stderr,
        )

    models, before, changes, is_done = pictures_of(tmp_path), state(), [], threading.Event()

    def watch():
        while not is_done.is_set():
            if (now := state()) != before:
                changes.append(now)

    def work(number):
        for k in range(4):
            model = models[(number + k) % len(models)]
            rz.render(model, (32, 24), threads=1, samples=1, shading=("phong", "gouraud")[k % 2])
            rz.load(Path(model).read_bytes(), format=Path(model).suffix[1:])
            tasks = [rz.RenderTask(model, str(tmp_path / f"{number}-{k}.png"), options={"size": 16})]
            assert [each.status for each in rz.render_many(tasks, ThreadPoolExecutor(1))] == ["drawn"]
        with BytesIO() as stream:
            Image.new("L", (3, 3)).save(stream, "TIFF")
            rz.Texture(Image.open(BytesIO(stream.getvalue())))
        return number

    watcher = threading.Thread(target=watch)
    watcher.start()
    try:
        with ThreadPoolExecutor(8) as threads:
            assert sorted(threads.map(work, range(8))) == list(range(8))
    finally:
        is_done.set()
        watcher.join()
    assert not changes, changes[0]
