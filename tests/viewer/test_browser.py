"""The viewer's page in a real browser: what hands do changes the picture, and the picture is the renderer's own."""

import re
import threading
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest
from helpers.arrays import deviations, differences
from helpers.browser import browser, canvas_pixels, missing, page_in, screen_pixels, wait_for_picture, wait_for_rest
from helpers.raster import ROOT

import rasterizer as rz
from rasterizer.viewer.controls import describe_pick
from rasterizer.viewer.server import Server
from rasterizer.viewer.session import Session

REASON = missing()
pytestmark = [
    pytest.mark.nightly,  # a browser is started
    pytest.mark.skipif(REASON is not None, reason=str(REASON)),
]


@pytest.fixture(scope="module")
def program():
    with browser() as program:
        yield program


@contextmanager
def serving(session):
    """A server of a session inside a `with` block."""
    server = Server(session)
    thread = threading.Thread(target=server.serve)
    thread.start()
    try:
        yield server
    finally:
        server.shutdown()
        server.server_close()
        thread.join(10)


@pytest.fixture
def server():
    scene = rz.load(str(ROOT / "models" / "teapot.obj"))
    with serving(Session(scene, title="teapot.obj", threads=1)) as server:
        yield server


@pytest.fixture
def page(program, server):
    with page_in(program) as page:
        page.goto(server.url)
        wait_for_rest(page)
        yield page
        assert not page.complaints


def expected(session, background="#ffffff", **options) -> np.ndarray:
    """What the renderer draws through the session's camera."""
    height, width = session.frame.rgb.shape[:2]
    scene = rz.Scene(session.scene.meshes, session.scene.lights, background=background)
    options = {"shading": "phong", "samples": 4, "outputs": "rgb", "threads": 1, **options}
    with rz.Renderer(scene, (width, height), **options) as renderer:
        return renderer.render(session.camera).rgb


def middle(page) -> tuple[float, float]:
    box = page.locator("canvas").bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def do_drag(page, **_):
    x, y = middle(page)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 90, y + 25, steps=6)
    page.mouse.up()


def do_drag_with_shift(page):
    page.keyboard.down("Shift")
    do_drag(page)
    page.keyboard.up("Shift")


def do_drag_with_the_right_button(page):
    x, y = middle(page)
    page.mouse.move(x, y)
    page.mouse.down(button="right")
    page.mouse.move(x - 60, y, steps=4)
    page.mouse.up(button="right")


def do_wheel(page):
    page.mouse.move(*middle(page))
    page.mouse.wheel(0, -300)


def do_keys(page):
    page.locator("canvas").focus()
    for key in ("ArrowLeft", "ArrowUp", "+", "Shift+ArrowRight"):
        page.keyboard.press(key)


GESTURES = [do_drag, do_drag_with_shift, do_drag_with_the_right_button, do_wheel, do_keys]


def test_the_first_picture_is_the_renderers_own_on_the_canvas_and_on_the_screen(page, server):
    assert server.session.camera == server.session.scene.camera_for(server.session.frame.size)
    assert not differences(canvas_pixels(page), expected(server.session))
    seen, drawn = screen_pixels(page.locator("canvas")), expected(server.session)
    rows, columns = (min(sides) for sides in zip(seen.shape[:2], drawn.shape[:2], strict=True))
    difference = np.abs(seen[:rows, :columns].astype(int) - drawn[:rows, :columns]).mean()
    assert difference < 2, f"{difference:.2f} levels: the canvas is stretched, or its colours are"


@pytest.mark.parametrize("gesture", GESTURES, ids=lambda gesture: gesture.__name__)
def test_what_hands_do_changes_the_picture_to_what_the_camera_sees(page, server, gesture):
    before, camera = canvas_pixels(page), server.session.camera
    gesture(page)
    after = wait_for_picture(page, before)
    assert server.session.camera != camera
    assert not differences(after, expected(server.session))


def test_a_drag_turns_by_the_way_of_the_pointer(page, server):
    def azimuth():
        eye, target = np.subtract(server.session.camera.position, 0), server.session.camera.target
        x, _, z = eye - target
        return np.degrees(np.arctan2(x, z))

    before, start, height = canvas_pixels(page), azimuth(), server.session.frame.size[1]
    do_drag(page)
    wait_for_picture(page, before)
    assert start - azimuth() == pytest.approx(180 * 90 / height, abs=180 * 5 / height)  # CLICK is lost


@pytest.mark.parametrize(
    ("size", "name"), [((480, 420), "teapot"), *(((w, w * 7 // 10), "a name of some length " * 8) for w in (300, 1000))]
)
def test_a_click_leaves_the_picture_as_large_as_it_is(program, size, name):
    """However much is told of the point that is picked."""
    (mesh,) = rz.load(str(ROOT / "models" / "teapot.obj")).meshes
    session = Session(rz.Scene([replace(mesh, name=name)]), threads=1)
    with serving(session) as server, page_in(program, size) as page:
        page.goto(server.url)
        wait_for_rest(page)
        before, box = session.frame, page.locator("canvas").bounding_box()
        page.mouse.click(*middle(page))
        page.wait_for_selector(".raster-mark:not([hidden])")
        page.wait_for_timeout(100)
        wait_for_rest(page)
        assert session.picked.object_name == name and name[:20] in page.locator(".raster-status").text_content()
        assert page.locator("canvas").bounding_box() == box and session.frame is before
        for numbers in ("", "1 face, 9×9, 1.0 ms", "1,310,720 faces, 1920×1080, 1/8 size, 12345.6 ms"):
            page.locator(".raster-numbers").evaluate("(element, text) => { element.textContent = text }", numbers)
            assert page.locator("canvas").bounding_box() == box, "nor with what else is told"


def test_a_click_tells_what_is_seen_and_marks_it(page, server):
    page.mouse.click(*middle(page))
    page.wait_for_selector(".raster-mark:not([hidden])")
    picked = server.session.picked
    assert picked.face == server.session.frame.face[picked.y, picked.x]
    text = page.locator(".raster-status").text_content()
    assert text == describe_pick(picked) == page.locator("[role=status]").text_content()
    mark, (x, y) = page.locator(".raster-mark").bounding_box(), middle(page)
    assert abs(mark["x"] + mark["width"] / 2 - x) < 2 and abs(mark["y"] + mark["height"] / 2 - y) < 2
    page.locator("canvas").press("Escape")
    page.wait_for_selector(".raster-mark", state="hidden")


def test_a_double_click_turns_about_the_point(page, server):
    x, y = middle(page)
    page.mouse.dblclick(x + 40, y + 20)
    page.wait_for_timeout(300)  # the first click may be answered before the second one comes
    wait_for_rest(page)
    assert not deviations(server.session.camera.target, server.session.picked.position)


def test_switches_change_the_picture_and_keys_change_the_switches(page, server):
    before = canvas_pixels(page)
    page.get_by_label("Shading").select_option("flat")
    after = wait_for_picture(page, before)
    assert not differences(after, expected(server.session, shading="flat"))
    page.locator("canvas").press("s")
    wait_for_picture(page, after)
    assert page.get_by_label("Shading").input_value() == "gouraud"
    page.get_by_label("Projection").select_option("orthographic")
    page.wait_for_timeout(300)
    wait_for_rest(page)
    assert not server.session.camera.is_perspective
    page.get_by_role("button", name="First view").click()
    page.wait_for_timeout(300)
    wait_for_rest(page)
    assert server.session.camera.is_perspective


def test_the_picture_has_as_many_pixels_as_its_window(page, server):
    before = canvas_pixels(page)
    page.set_viewport_size({"width": 640, "height": 380})
    after = wait_for_picture(page, before)
    assert after.shape[1] == 640 and not differences(after, expected(server.session))


def test_a_dark_page_has_a_dark_picture_and_text_that_can_be_read(program, server):
    for scheme, paper in (("dark", "#16181b"), ("light", "#ffffff")):
        with page_in(program, color_scheme=scheme) as page:
            page.goto(server.url)
            wait_for_rest(page)
            assert not differences(canvas_pixels(page), expected(server.session, paper))
            for selector in (".raster-title", ".raster-numbers", ".raster-help summary", ".raster-bar label"):
                assert contrast(page, selector) >= 4.5, f"{scheme}: {selector}"


def contrast(page, selector) -> float:
    """How text stands out from what is behind it. Source: WCAG 2.2, contrast ratio."""
    script = """element => {
        const ink = getComputedStyle(element).color;
        while (getComputedStyle(element).backgroundColor === "rgba(0, 0, 0, 0)") element = element.parentElement;
        return [ink, getComputedStyle(element).backgroundColor];
    }"""
    lights = []
    for color in page.eval_on_selector(selector, script):
        levels = np.array([float(each) for each in re.findall(r"[\d.]+", color)[:3]]) / 255
        linear = np.where(levels <= 0.04045, levels / 12.92, ((levels + 0.055) / 1.055) ** 2.4)
        lights.append(linear @ (0.2126, 0.7152, 0.0722))
    return (max(lights) + 0.05) / (min(lights) + 0.05)


def test_everything_is_reached_by_the_keyboard_and_has_a_name(page):
    page.locator("body").press("Tab")
    reached = []
    for _ in range(7):
        reached.append(page.evaluate("document.activeElement.tagName"))
        page.keyboard.press("Tab")
    assert [name for name in reached if name != "BODY"] == ["SELECT", "SELECT", "SELECT", "BUTTON", "CANVAS", "SUMMARY"]
    page.locator("canvas").focus()
    page.keyboard.press("ArrowLeft")
    outline = page.eval_on_selector("canvas", "canvas => getComputedStyle(canvas).outlineStyle")
    assert outline == "solid", "where the keys go is seen"
    canvas = page.locator("canvas")
    assert canvas.get_attribute("aria-label") == "3-D view of teapot.obj"
    described = canvas.get_attribute("aria-describedby")
    assert "arrow keys" in page.locator(f"#{described}").text_content()


def test_the_page_says_that_the_program_has_ended(program):
    server = Server(Session(rz.load(str(ROOT / "models" / "cube.obj")), threads=1))
    thread = threading.Thread(target=server.serve)
    thread.start()
    with page_in(program) as page:
        page.goto(server.url)
        wait_for_rest(page)
        server.shutdown()
        server.server_close()
        page.wait_for_selector("canvas[data-state=ended]")
        assert "has ended" in page.locator(".raster-status").text_content()
    thread.join(10)
