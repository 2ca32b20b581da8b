"""The viewer in a cell of JupyterLab, in a real browser."""

import pytest
from helpers.arrays import differences
from helpers.browser import (
    browser,
    canvas_pixels,
    jupyterlab,
    missing,
    notebook_of,
    page_in,
    run_cells,
    wait_for_picture,
    wait_for_rest,
)
from helpers.raster import ROOT

import rasterizer as rz

REASON = missing("jupyterlab", "ipykernel", "anywidget")
pytestmark = [
    pytest.mark.nightly,  # JupyterLab and a browser are started
    pytest.mark.skipif(REASON is not None, reason=str(REASON)),
]
MODEL = ROOT / "models" / "teapot.obj"
CELLS = (
    f"import rasterizer as rz\nviewer = rz.view({str(MODEL)!r}, (480, 360), threads=1)\nviewer",
    "viewer.on_msg(lambda *_: open('camera.txt', 'w').write(repr(viewer.camera)))",
)


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = tmp_path_factory.mktemp("notebooks")
    (folder / "view.ipynb").write_text(notebook_of(*CELLS))
    with jupyterlab(folder) as address, browser() as program, page_in(program, (1000, 900)) as page:
        page.set_default_timeout(40_000)
        page.goto(address("view.ipynb"))
        run_cells(page)
        wait_for_rest(page)
        page.folder = folder
        yield page


def camera_of(page) -> rz.Camera:
    """The widget's camera, as the kernel has it."""
    names = {name: getattr(rz, name) for name in ("Camera",)}
    return eval((page.folder / "camera.txt").read_text(), names)


def test_a_cell_shows_the_renderers_own_picture(page):
    found = canvas_pixels(page)
    assert abs(found.shape[1] - 480) <= 2 and abs(found.shape[0] / found.shape[1] - 3 / 4) < 0.01
    scene = rz.load(str(MODEL))
    paper = "#" + bytes(found[0, 0]).hex()
    scene = rz.Scene(scene.meshes, scene.lights, background=paper)
    expected = rz.render(scene, found.shape[1::-1], shading="phong", samples=4, outputs="rgb").rgb
    assert not differences(found, expected)


def test_drags_keys_and_switches_change_it_and_jupyter_keeps_its_hands_off(page):
    n_cell = page.locator(".jp-Cell").count()
    before = canvas_pixels(page)
    box = page.locator("canvas").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 80, y + 10, steps=5)
    page.mouse.up()
    after = wait_for_picture(page, before)
    # Save, restart the kernel, delete, cut and change the cell: Jupyter's shortcuts where a cell has the focus.
    for selector in ("canvas", ".raster-bar select >> nth=0", ".raster-help summary"):
        page.locator(selector).focus()
        for key in "s00ddxm":
            page.keyboard.press(key)
    page.wait_for_timeout(500)
    assert page.locator(".jp-Cell").count() == n_cell and not page.locator(".jp-Dialog").count()
    page.get_by_label("Lights").select_option("headlight")
    wait_for_picture(page, after)


def test_a_click_picks_and_a_wheel_scrolls_until_then(page):
    page.locator("canvas").press("Escape")
    page.evaluate("document.activeElement.blur()")
    box = page.locator("canvas").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.wait_for_timeout(400)
    wait_for_rest(page)
    before = canvas_pixels(page)
    page.mouse.wheel(0, 5)
    page.wait_for_timeout(400)
    assert not differences(canvas_pixels(page), before)
    box = page.locator("canvas").bounding_box()  # the notebook may have been scrolled
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.click(x, y)
    page.wait_for_selector(".raster-mark:not([hidden])")
    assert "position" in page.locator(".raster-status").text_content()
    page.mouse.wheel(0, -200)
    wait_for_picture(page, before)


def test_a_dark_theme_has_a_dark_picture(page):
    before = canvas_pixels(page)
    page.evaluate("() => jupyterapp.commands.execute('apputils:change-theme', {theme: 'JupyterLab Dark'})")
    page.wait_for_selector("body[data-jp-theme-light=false]", state="attached")
    after = wait_for_picture(page, before)
    assert before[0, 0].min() > 200 and after[0, 0].max() < 60
