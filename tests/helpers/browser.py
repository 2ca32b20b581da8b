"""A real browser without a window: help for tests of what a page does.

Debian's chromium, driven by Playwright (the extra `browser`), whose own browsers aren't needed. CHROMIUM in the
environment names another one.
"""

import importlib.util
import io
import os
import shutil
import sys
from base64 import b64decode
from contextlib import contextmanager

import numpy as np
from PIL import Image

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
