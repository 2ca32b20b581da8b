"""One look at a scene: events move the camera, pictures at rest are the renderer's own, clicks tell what is seen."""

import io
import itertools
import shlex

import numpy as np
import pytest
from helpers.arrays import deviations, differences
from helpers.command import raster
from helpers.processes import at_once
from helpers.raster import ROOT
from helpers.viewing import SIZE, click, drag, key, message, rest, switch, zoom
from PIL import Image

import rasterizer as rz
from rasterizer.viewer.controls import describe_pick
from rasterizer.viewer.orbit import camera_flags
from rasterizer.viewer.session import BUDGET, DIVISORS, Resolution, Session

CUBE = str(ROOT / "models" / "cube.obj")


@pytest.fixture(scope="module")
def scene():
    return rz.load(CUBE)


@pytest.fixture
def session(scene):
    session = Session(scene, title="cube.obj", threads=1)
    yield session
    session.close()


def pixels(reply) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(reply.content)).convert("RGB"))


def expected(session, background="#ffffff", size=SIZE, **options) -> np.ndarray:
    scene = rz.Scene(session.scene.meshes, options.pop("lights", session.scene.lights), background=background)
    options = {"shading": "phong", "samples": 4, "outputs": "rgb", **options}
    with rz.Renderer(scene, size, **options) as renderer:
        return renderer.render(session.camera).rgb


def test_a_picture_at_rest_is_the_renderers_own(session):
    reply = rest(session)
    assert reply.media_type == "image/png" and reply.status["is_full"]
    assert not differences(pixels(reply), expected(session))
    assert session.camera == session.scene.camera_for(SIZE)


def test_whatever_moves_the_camera_the_picture_is_what_it_sees(session):
    before = pixels(rest(session))
    for events in (
        [drag(13, -7), drag(4, 9, "pan")],
        [drag(0, 20, "zoom"), zoom(1.7, 10, 20)],
        [key("ArrowLeft"), key("ArrowUp", True), key("+")],
        [key("5")],
        [key("o"), drag(5, 5)],
    ):
        found = pixels(rest(session, *events))
        assert np.array_equal(found, expected(session)) and not np.array_equal(found, before), events
        before = found


def test_while_something_moves_pictures_are_jpeg_and_close_to_those_at_rest(session):
    reply = session.answer(message(drag(5, 5)))
    assert reply.media_type == "image/jpeg" and not reply.status["is_full"]
    difference = np.abs(pixels(reply).astype(int) - expected(session, samples=1))
    assert difference.mean() < 3, difference.mean()


def test_slow_pictures_become_smaller_while_something_moves_and_whole_at_rest(session, monkeypatch):
    clock = itertools.count(0.0, 0.5)  # on which a picture takes half a second
    monkeypatch.setattr("rasterizer.viewer.session.perf_counter", lambda: next(clock))
    replies = [session.answer(message(drag(1, 0))) for _ in range(20)]
    sizes = [Image.open(io.BytesIO(reply.content)).size for reply in replies]
    assert sizes[0] == SIZE and sizes[-1] == (10, 8)
    assert replies[-1].status["divisor"] == 8 and replies[-1].status["milliseconds"] == 500.0
    assert pixels(rest(session)).shape == (60, 80, 3)
    assert [rest(session).status["milliseconds"] for _ in range(2)] == [500.0, 500.0], (
        "a picture that is kept took time"
    )


def test_the_first_view_comes_back_and_follows_the_shape_of_the_page(session):
    first = rest(session).content
    rest(session, drag(9, 9), zoom(2.0))
    assert rest(session, key("0")).content == first
    rest(session, size=(30, 60))
    assert session.camera == session.scene.camera_for((30, 60))


def test_on_a_ground_its_shadow_is_framed_too(scene):
    for pressed, words in (([], {}), ([key("1")], {"view": "front"})):
        session = Session(scene, threads=1, ground=True, shading="gouraud")
        rest(session, *pressed)
        assert session.camera == rz.render(scene, SIZE, ground=True, threads=1, **words).camera, words
        session.close()


def test_a_given_camera_is_looked_through_first(scene):
    camera = rz.Camera.perspective((3, 1, 2), fov=50)
    session = Session(scene, camera=camera, threads=1)
    assert not differences(pixels(rest(session)), expected(session)) and session.camera is camera


def test_switches_choose_shading_lights_and_projection(session):
    reply = rest(
        session, switch("shading", "flat"), switch("lights", "headlight"), switch("projection", "orthographic")
    )
    assert reply.status["switches"] == {"shading": "flat", "lights": "headlight", "projection": "orthographic"}
    assert reply.status["said"] == "shading: flat. lights: headlight. projection: orthographic"
    assert not differences(pixels(reply), expected(session, shading="flat", lights=rz.headlight()))
    assert not session.camera.is_perspective


def test_keys_go_through_the_switches_and_come_back(session):
    seen = [rest(session, key("s")).status["switches"]["shading"] for _ in range(3)]
    assert seen == ["flat", "gouraud", "phong"]
    seen = [rest(session, key("l")).status["switches"]["lights"] for _ in range(3)]
    assert seen == ["studio", "headlight", "own"]


def test_what_means_nothing_does_nothing(session):
    first = rest(session)
    assert rest(session, key("q"), switch("shading", "wood"), switch("__class__", "x")).content == first.content


def test_the_background_is_the_pages_own_unless_the_scene_has_one(session, scene):
    assert tuple(pixels(rest(session, background="#16181b"))[0, 0]) == (0x16, 0x18, 0x1B)
    own = Session(rz.Scene(scene.meshes, background="#102030"), threads=1)
    assert tuple(pixels(rest(own))[0, 0]) == (0x10, 0x20, 0x30)


def test_a_click_tells_face_object_position_and_normal(session):
    reply = session.answer(message(click(40.4, 30.9)))
    picked = session.picked
    assert reply.status["is_full"] and (picked.x, picked.y) == (40, 30)
    assert picked.face == session.frame.face[30, 40] == picked.object_face
    mesh = session.scene.meshes[picked.object]
    corners = mesh.vertices[mesh.faces[picked.face]]
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    normal /= np.linalg.norm(normal)
    assert abs((np.array(picked.position) - corners[0]) @ normal) <= 1e-5
    assert abs(np.dot(picked.normal, normal)) == pytest.approx(1, abs=1e-6)
    assert reply.status["picked"] == describe_pick(picked) == reply.status["said"]
    assert not deviations(reply.status["marker"], (40.5, 30.5), atol=0.001)


def test_an_object_is_told_by_its_name_and_its_own_face(session):
    names = ("left", "rïght 'x'")
    triangle = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.0]])
    meshes = [rz.Mesh(triangle + 2 * k, [[0, 1, 2], [1, 3, 2]], name=name) for k, name in enumerate(names)]
    camera = rz.Camera.perspective((2.5, 2.5, 9), (2.5, 2.5, 2))
    session = Session(rz.Scene(meshes), camera=camera, threads=1)
    session.answer(message(click(40, 30)))
    assert session.picked.object == 1 and session.picked.face == 2 + session.picked.object_face
    assert repr(names[1]) in describe_pick(session.picked)


def test_beside_the_object_nothing_is_picked(session):
    for at in ((0, 0), (-5, 3), (79.99, 1e5)):
        session.answer(message(click(40, 30)))
        reply = session.answer(message(click(*at)))
        assert session.picked is None and reply.status["marker"] is None, at
        assert reply.status["said"] == "nothing is there", at


def test_a_picked_point_stays_marked_while_the_camera_moves_and_escape_forgets_it(session):
    session.answer(message(click(40, 30)))
    marker = rest(session, drag(10, 0, "pan")).status["marker"]
    assert not deviations(marker, (50.5, 30.5), atol=4.0)  # it is nearer than the pivot, and moves further
    assert rest(session, key("Escape")).status["picked"] is None


def test_a_double_click_turns_about_the_point(session):
    session.answer(message(click(50, 35, True)))
    position = session.picked.position
    marker = rest(session, drag(30, 12)).status["marker"]
    assert not deviations(marker, (40, 30), atol=0.001)
    assert not deviations(session.camera.target, position)


def test_the_keyboard_picks_what_is_in_the_middle(session):
    session.answer(message(key("Enter")))
    assert (session.picked.x, session.picked.y) == (40, 30)


def test_the_flags_of_a_view_draw_the_same_picture(session, folder):
    for events in ([], [drag(13, 5), zoom(1.3)], [key("l"), key("o"), drag(5, 5)]):
        rest(session, *events)
        flags = shlex.split(session.answer(message()).status["camera"])
        argv = ["render", CUBE, "-s", "80x60", "--background", "white", "-o", "x.png", *flags]
        assert raster(*argv, "-q") == 0
        found = np.asarray(Image.open("x.png").convert("RGB")).astype(int)
        lights = rz.studio() if session.answer(message()).status["switches"]["lights"] == "studio" else None
        difference = np.abs(found - expected(session, **({"lights": lights} if lights else {}))).max()
        assert difference <= 1, f"{events}: {difference} levels > 1"


def test_no_flags_are_told_for_a_camera_that_they_cannot_say():
    assert camera_flags(rz.Camera.perspective((5, 4, 3), up=(1, 1, 0)), "y") == ""
    assert camera_flags(rz.Camera.perspective((5, 4, 3), near=1), "y") == ""
    assert camera_flags(rz.Camera.perspective((0, 0, 3)), "y") == (
        "--eye 0.0,0.0,3.0 --target 0.0,0.0,0.0 --up y --fov 45.0"
    )


def test_threads_that_share_a_session_take_turns(session):
    def ask(k):
        for _ in range(5):
            session.answer(message(drag(k, 1), is_rest=k % 2 == 0))

    at_once(ask, 4)


def test_options_that_are_not_legal_are_told_at_once(scene):
    for options in ({"shading": "wood"}, {"samples": 3}, {"tolerance": -1}):
        with pytest.raises(rz.SceneError, match=next(iter(options))):
            Session(scene, **options)


# ── how many pixels a picture has while something moves ────────────────────────────────────────────────────


def run(time_of, n=60) -> list[int]:
    """The divisors of pictures that take `time_of(divisor)` milliseconds."""
    resolution, found = Resolution(), []
    for _ in range(n):
        found.append(resolution.divisor)
        resolution.note(time_of(resolution.divisor))
    return found


def test_slow_pictures_become_smaller_until_they_are_in_time():
    for whole in (2, 4, 8, 64):
        found = run(lambda divisor, whole=whole: whole * BUDGET / divisor**2)
        expected = next((each for each in DIVISORS if whole / each**2 <= 1.25), DIVISORS[-1])
        assert found[-1] == expected, f"{whole} times the budget: divided by {found[-1]}, not {expected}"


def test_sizes_do_not_alternate_whatever_part_of_the_time_pixels_take():
    for of_vertices in (0, 10, 29, 31, 60):
        for of_pixels in (10, 50, 200, 1000):
            found = run(lambda divisor, v=of_vertices, p=of_pixels: v + p / divisor**2)
            assert len(set(found[20:])) == 1, f"{of_vertices} and {of_pixels} ms: {found}"


def test_a_smaller_picture_covers_the_whole_one_and_is_never_empty():
    resolution = Resolution()
    for _ in range(3):
        resolution.note(1e4)
    assert resolution.divisor == 8 and resolution.size_of((801, 1)) == (101, 1)
