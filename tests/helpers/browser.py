"""A real browser without a window: help for tests of what a page does.

Debian's chromium, driven by Playwright (the extra `browser`), whose own browsers aren't needed. CHROMIUM in the
environment names another one.
"""

import importlib.util
import io
import json
import os
import shutil
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from base64 import b64decode
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from PIL import Image

from helpers.raster import ROOT

NAMES = ("chromium", "chromium-browser", "google-chrome")
FLAGS = ("--no-sandbox", "--force-color-profile=srgb", "--disable-gpu", "--disable-dev-shm-usage")


def chromium() -> str | None:
    """Where the browser is; None if there is none."""
    return os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), None)


def missing(*modules) -> str | None:
    """Why tests with a browser can't run here, with these modules; None if they can."""
    for name in ("playwright", *modules):
        if importlib.util.find_spec(name) is None:
            return f"{name} is not installed: the extras notebook and browser bring it"
    if sys.platform.startswith("linux") and chromium() is None:
        return f"there is no browser: one of {', '.join(NAMES)}"
    return None


@contextmanager
def browser():
    """A browser inside a `with` block."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        program = playwright.chromium.launch(executable_path=chromium(), args=list(FLAGS))
        try:
            yield program
        finally:
            program.close()


@contextmanager
def page_in(program, size=(480, 420), **settings):
    """A page inside a `with` block; it must not have complained in its console when the block ends."""
    context = program.new_context(viewport=dict(zip(("width", "height"), size, strict=True)), **settings)
    page = context.new_page()
    complaints = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("console", lambda line: complaints.append(line.text) if line.type in ("error", "warning") else None)
    page.set_default_timeout(20_000)
    page.complaints = complaints
    try:
        yield page
    finally:
        context.close()


def wait_for_rest(page):
    """Wait until the picture is as good as it gets."""
    page.wait_for_selector("canvas[data-state=rest]")


def wait_for_picture(page, before) -> np.ndarray:
    """Wait until the picture is another one, and at rest; return it."""
    for _ in range(400):
        wait_for_rest(page)
        found = canvas_pixels(page)
        if found.shape != before.shape or not np.array_equal(found, before):
            page.wait_for_timeout(50)
            wait_for_rest(page)
            return canvas_pixels(page)
        page.wait_for_timeout(25)
    raise AssertionError("the picture didn't change")


def canvas_pixels(page) -> np.ndarray:
    """What the canvas holds: (height, width, 3) uint8."""
    address = page.eval_on_selector("canvas", "canvas => canvas.toDataURL('image/png')")
    return np.asarray(Image.open(io.BytesIO(b64decode(address.partition(",")[2]))).convert("RGB"))


def screen_pixels(locator) -> np.ndarray:
    """What the screen shows of an element: (height, width, 3) uint8."""
    return np.asarray(Image.open(io.BytesIO(locator.screenshot())).convert("RGB"))


# ── JupyterLab on this machine, with one notebook ──────────────────────────────────────────────────────────

# Whoever asks a notebook to run that has no kernel yet is asked for one.
RUN_CELLS = """async () => {
  const session = [...jupyterapp.shell.widgets("main")].find(widget => widget.sessionContext).sessionContext;
  await session.ready;
  await session.session.kernel.info;
  jupyterapp.commands.execute("notebook:run-all-cells");
}"""


def notebook_of(*cells: str) -> str:
    """A notebook of code cells, as the text of its file."""
    code = [
        {"cell_type": "code", "id": f"cell{k}", "execution_count": None, "metadata": {}, "outputs": [], "source": cell}
        for k, cell in enumerate(cells)
    ]
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    return json.dumps({"cells": code, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5})


@contextmanager
def jupyterlab(folder: Path):
    """The address of a JupyterLab that serves a folder, inside a `with` block; its settings are in the folder, too."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    own = folder / "jupyter"
    environment = os.environ | {
        "PYTHONPATH": str(ROOT),
        "JUPYTER_CONFIG_DIR": str(own / "config"),
        "JUPYTER_RUNTIME_DIR": str(own / "runtime"),
        "JUPYTERLAB_SETTINGS_DIR": str(own / "settings"),
        "JUPYTERLAB_WORKSPACES_DIR": str(own / "workspaces"),
        "IPYTHONDIR": str(own / "ipython"),
    }
    settings = own / "settings" / "@jupyterlab" / "apputils-extension" / "notification.jupyterlab-settings"
    settings.parent.mkdir(parents=True)
    settings.write_text('{"fetchNews": "false"}')
    no_build = own / "config" / "labconfig" / "page_config.json"  # extensions of other packages make it ask for one
    no_build.parent.mkdir(parents=True)
    no_build.write_text('{"buildAvailable": false, "buildCheck": false}')
    command = [sys.executable, "-m", "jupyterlab", "--no-browser", "--allow-root", "--ip=127.0.0.1", f"--port={port}",
               "--expose-app-in-browser",
               "--ServerApp.port_retries=0", "--IdentityProvider.token=secret", f"--ServerApp.root_dir={folder}",
               "--LabApp.check_for_updates_class=jupyterlab.NeverCheckForUpdate"]  # fmt: skip
    log = folder / "jupyter.log"
    with log.open("wb") as stream:
        process = subprocess.Popen(command, env=environment, stdout=stream, stderr=stream, cwd=folder)
    try:
        _wait_until_it_answers(process, f"http://127.0.0.1:{port}/api?token=secret", log)
        yield lambda name: f"http://127.0.0.1:{port}/lab/tree/{name}?token=secret&reset"
    finally:
        process.terminate()
        try:
            process.wait(20)
        except subprocess.TimeoutExpired:
            process.kill()


def _wait_until_it_answers(process, address, log):
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        assert process.poll() is None, log.read_text(errors="replace")[-1500:]
        try:
            with urllib.request.urlopen(address, timeout=5):
                return
        except (urllib.error.URLError, OSError):
            time.sleep(0.2)
    raise AssertionError(f"JupyterLab doesn't answer: {log.read_text(errors='replace')[-1500:]}")


def run_cells(page):
    """Run all cells of the notebook that is open, when its kernel is ready."""
    page.wait_for_selector(".jp-Notebook .jp-CodeCell")
    page.evaluate(RUN_CELLS)
