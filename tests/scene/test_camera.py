"""Cameras: axes, pixels, refusals, OpenCV."""

import math
import pickle

import numpy as np
import pytest
from helpers.pixels import AXIS, project
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from rasterizer.errors import SceneError
from rasterizer.scene.camera import Camera

_coordinate = st.floats(-10.0, 10.0).map(lambda x: round(x, 4))
_points = st.lists(st.tuples(_coordinate, _coordinate, _coordinate), min_size=3, max_size=3).map(np.array)


def test_look_at_axes():
    view = Camera.perspective((0, 0, 5)).view()
    assert [list(axis) for axis in view] == [[0, 0, 5], [1, 0, 0], [0, 1, 0], [0, 0, -1]]
    view = Camera.perspective((10, 0, 0), up="z").view()
    assert [list(axis) for axis in view[1:]] == [[0, 1, 0], [0, 0, 1], [-1, 0, 0]]


@given(_points)
@settings(max_examples=50)
def test_axes_are_a_right_handed_frame(points):
    assume(np.linalg.norm(points[0] - points[1]) > 1e-3 and np.linalg.norm(points[2]) > 1e-3)
    _, right, up, forward = Camera.perspective(points[0], points[1], points[2]).view()
    frame = np.stack([right, up, -forward])
    assert frame @ frame.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.cross(right, up) == pytest.approx(-forward, abs=1e-12)
    assert forward == pytest.approx((points[1] - points[0]) / np.linalg.norm(points[1] - points[0]), abs=1e-12)
    assert up @ points[2] >= -1e-9  # up is upwards


@pytest.mark.parametrize("up", AXIS)
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_up_parallel_to_the_view_is_the_orbit_at_azimuth_0(up, side):
    """Looking along `up` gives the picture that framing gives at an elevation of ±90."""
    straight = Camera.perspective(np.array(AXIS[up]) * 7.0 * side, up=up).view()
    framed = Camera.framing([[-1, -1, -1], [1, 1, 1]], azimuth=0, elevation=90 * side, up=up).view()
    for a, b in zip(straight[1:], framed[1:], strict=True):
        assert a == pytest.approx(b, abs=1e-15)


def test_up_parallel_is_a_map_for_z_up():
    view = Camera.orthographic((2, 3, 9), (2, 3, 0), up=(0, 0, 1)).view()
    assert list(view.right) == [1, 0, 0] and list(view.up) == [0, 1, 0]
    assert list(Camera.perspective((0, 5, 0)).view().up) == [0, 0, -1]


def test_perspective_pixels():
    camera = Camera.perspective((0, 0, 10), fov=90)
    pixels, depth = project(camera, [(0, 0, 0), (10, 0, 0), (0, 10, 0), (-5, -5, 5)], (640, 480))
    assert pixels == pytest.approx(np.array([(320, 240), (560, 240), (320, 0), (80, 480)]))
    assert list(depth) == [10, 10, 10, 5]
    assert camera.projection((640, 480)).is_perspective and camera.is_perspective


def test_orthographic_pixels():
    camera = Camera.orthographic((0, 0, 10), height=4)
    pixels, _ = project(camera, [(0, 0, 0), (1, 2, 3), (-1, -2, -3)], (200, 100))
    assert pixels == pytest.approx(np.array([(100, 50), (125, 0), (75, 100)]))
    assert not camera.projection((200, 100)).is_perspective and not camera.is_perspective


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"position": (0, 0, 0), "fov": 45}, "position and target must differ"),
        ({"position": (0, 0, math.nan), "fov": 45}, "position"),
        ({"position": (0, 0, 1), "target": (1, 2), "fov": 45}, "target"),
        ({"position": (0, 0, 1), "up": (0, 0, 0), "fov": 45}, "up"),
        ({"position": (0, 0, 1), "up": "north", "fov": 45}, "up"),
        ({"position": (0, 0, 1), "fov": 180}, "fov"),
        ({"position": (0, 0, 1), "fov": "wide"}, "fov"),
        ({"position": (0, 0, 1), "height": 0}, "height"),
        ({"position": (0, 0, 1), "height": -1}, "height"),
        ({"position": (0, 0, 1), "height": 1, "fov": 45}, "either fov"),
        ({"position": (0, 0, 1)}, "either fov"),
        ({"position": (0, 0, 1), "fov": 45, "near": 0}, "near"),
        ({"position": (0, 0, 1), "fov": 45, "far": -1}, "far"),
        ({"position": (0, 0, 1), "fov": 45, "near": 2, "far": 2}, "near must be below"),
        ({"position": (0, 0, 1), "height": 1, "near": 2, "far": -2}, "near must be below"),
        ({"position": (0, 0, 1), "intrinsics": (1, 1, 1), "size": (4, 3)}, "intrinsics"),
        ({"position": (0, 0, 1), "intrinsics": 5, "size": (4, 3)}, "intrinsics"),
        ({"position": (0, 0, 1), "intrinsics": (0, 1, 1, 1), "size": (4, 3)}, "focal"),
        ({"position": (0, 0, 1), "intrinsics": (1, 1, 1, 1)}, "size"),
        ({"position": (0, 0, 1), "fov": 45, "size": (4, 3)}, "size"),
        ({"position": (0, 0, 1), "fov": 45, "skew": 0.1}, "skew goes with its intrinsics; given 0.1"),
        ({"position": (0, 0, 1), "height": 2, "skew": "much"}, "skew"),
        ({"position": (0, 0, 1), "intrinsics": (1, 1, 1, 1), "size": (4, 3), "skew": math.nan}, "skew"),
        ({"position": (0, 0, 1), "intrinsics": (1, 1, 1, 1), "size": (4, 3), "skew": None}, "skew"),
    ],
)
def test_illegal_cameras_are_refused(options, message):
    with pytest.raises(SceneError, match=message):
        Camera(**options)


def test_orthographic_depths_may_be_behind():
    camera = Camera.orthographic((0, 0, 1), height=1, near=-5, far=5)
    assert (camera.near, camera.far) == (-5.0, 5.0)


@pytest.mark.parametrize("size", [(0, 1), (1.5, 2), (1, 2, 3), 7, None, ("a", "b"), (math.nan, 1), (math.inf, 1)])
def test_illegal_sizes_are_refused(size):
    with pytest.raises(SceneError, match="size"):
        Camera.perspective((0, 0, 1)).projection(size)


def test_cameras_are_comparable():
    assert Camera.perspective((0, 0, 1)) == Camera.perspective(np.array([0, 0, 1.0]))
    assert len({Camera.perspective((0, 0, 1)), Camera.orthographic((0, 0, 1))}) == 2


def test_opencv_by_hand():
    """OpenCV's identity rotation and t = (0, 0, 4): at (0, 0, -4), looking along +z, y down."""
    K = [[500, 0, 319.5], [0, 400, 200], [0, 0, 1]]
    camera = Camera.from_opencv(K, np.eye(3), [0, 0, 4], (640, 480))
    view = camera.view()
    assert [list(axis) for axis in view] == [[0, 0, -4], [1, 0, 0], [0, -1, 0], [0, 0, 1]]
    # OpenCV: u = 500 * 1/5 + 319.5 = 419.5, v = 400 * 2/5 + 200 = 360, counted from the first pixel's centre
    pixels, depth = project(camera, [(1, 2, 1)], (640, 480))
    assert pixels[0] == pytest.approx((420.0, 360.5)) and depth[0] == 5.0
    assert camera.fov == pytest.approx(math.degrees(2 * math.atan(240 / 400)))


def test_skew_by_hand():
    """OpenCV: u = (500 * 1 + 40 * 2)/5 + 319.5 = 435.5, whole numbers or not; a larger picture has more of it."""
    K = [[500, 40, 319.5], [0, 400, 200], [0, 0, 1]]
    camera = Camera.from_opencv(K, np.eye(3, dtype=int), [0, 0, 4], (640, 480))
    assert project(camera, [(1, 2, 1)], (640, 480))[0][0] == pytest.approx((436.0, 360.5))
    assert camera.skew == 40.0 and camera.intrinsics == (500, 400, 319.5, 200) and "skew=40" in repr(camera)
    assert camera.projection((1280, 480)).skew == 80.0 and camera.projection((640, 960)).skew == 40.0
    assert camera.to_opencv((1280, 960))[0].tolist() == [[1000, 80, 639.5], [0, 800, 400.5], [0, 0, 1]]
    assert (
        pickle.loads(pickle.dumps(camera))
        == camera
        == Camera.from_opencv(np.float32(K), np.eye(3), [0, 0, 4], (640, 480))
    )
    plain = Camera.from_opencv(np.diag([500, 400, 1]), np.eye(3), [0, 0, 4], (640, 480))
    assert plain != camera and plain.skew == 0.0 and "skew" not in repr(plain)


@pytest.mark.parametrize("skew", [-70.0, 0.0, 1e-3, 3000.0])
def test_rays_go_through_their_pixels(skew):
    """Projection.ray_axes is the inverse of what K does."""
    camera = Camera.from_opencv([[500, skew, 300], [0, 400, 200], [0, 0, 1]], np.eye(3), [1, 2, 4], (640, 480))
    view, projection = camera.view(), camera.projection((640, 480))
    right, up = projection.ray_axes(view)
    places = np.random.default_rng(3).uniform(-500, 900, (20, 2))
    x, y = (places[:, :1] - projection.center_x) / 500, (projection.center_y - places[:, 1:]) / 400
    points = view.eye + 3.0 * (x * right + y * up + view.forward)
    assert project(camera, points, (640, 480))[0] == pytest.approx(places, abs=1e-9)


def test_opencv_turned_by_hand():
    """The camera's forward is the world's x, its right the world's -y, its down the world's -z."""
    R = np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]])
    camera = Camera.from_opencv([[100, 0, 50], [0, 100, 50], [0, 0, 1]], R, [[1], [2], [3]], (101, 101))
    view = camera.view()
    assert list(view.forward) == [1, 0, 0] and list(view.up) == [0, 0, 1] and list(view.right) == [0, -1, 0]
    assert view.eye == pytest.approx([-3, 1, 2])  # -Rᵀ t
    # x_cam = R (1, 2, 3) + t = (-2 + 1, -3 + 2, 1 + 3) = (-1, -1, 4)
    assert project(camera, [(1, 2, 3)], (101, 101))[0][0] == pytest.approx((25.5, 25.5))


@given(st.integers(0, 10_000), st.sampled_from([1e-6, 1.0, 1e6]))
@settings(max_examples=50, deadline=None)
def test_opencv_round_trip(seed, scale):
    rng = np.random.default_rng(seed)
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    R = q * np.sign(np.diag(r))
    R = R if np.linalg.det(R) > 0 else -R
    t = rng.normal(size=3) * scale
    skew = rng.choice([0.0, 1e-12, rng.normal(0, 200)])
    K = np.array([[rng.uniform(100, 900), skew, rng.uniform(-50, 700)], [0, rng.uniform(100, 900), 33.25], [0, 0, 1]])
    back_K, back_R, back_t = Camera.from_opencv(K, R, t, (640, 480)).to_opencv((640, 480))
    assert back_K == pytest.approx(K, rel=1e-12)
    assert back_R == pytest.approx(R, abs=1e-12)
    assert back_t == pytest.approx(t, rel=1e-9, abs=1e-12 * scale)
    points = rng.normal(size=(5, 3))
    seen = points @ R.T + t
    assume((np.abs(seen[:, 2]) > 1e-3).all())
    pixels, depth = project(Camera.from_opencv(K, R, t, (640, 480)), points, (640, 480))
    uvw = seen @ K.T
    assert depth == pytest.approx(seen[:, 2], rel=1e-9, abs=1e-9)
    assert pixels == pytest.approx(uvw[:, :2] / uvw[:, 2:] + 0.5, rel=1e-6, abs=1e-6)


def test_opencv_at_another_size_scales_the_picture():
    K = np.array([[500, 0, 300], [0, 450, 260], [0, 0, 1]])
    camera = Camera.from_opencv(K, np.eye(3), [0, 0, 4], (640, 480))
    points = np.random.default_rng(2).uniform(-1, 1, (10, 3))
    small, _ = project(camera, points, (640, 480))
    large, _ = project(camera, points, (1280, 1440))
    assert large == pytest.approx(small * (2, 3))
    assert camera.to_opencv((1280, 1440))[0][0] == pytest.approx([1000, 0, 300.5 * 2 - 0.5])


def test_own_cameras_have_an_opencv_form():
    camera = Camera.perspective((3, 2, 5), (0, 1, 0), fov=40)
    K, R, t = camera.to_opencv((640, 480))
    assert R @ R.T == pytest.approx(np.eye(3)) and np.linalg.det(R) == pytest.approx(1.0)
    assert (K[0, 2], K[1, 2]) == (319.5, 239.5) and K[0, 0] == K[1, 1]
    points = np.random.default_rng(2).uniform(-1, 1, (10, 3))
    uvw = (points @ R.T + t) @ K.T
    assert project(camera, points, (640, 480))[0] == pytest.approx(uvw[:, :2] / uvw[:, 2:] + 0.5)
    with pytest.raises(SceneError, match="orthographic"):
        Camera.orthographic((0, 0, 1)).to_opencv((640, 480))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"K": [[500, 0, 0], [1, 500, 0], [0, 0, 1]]}, r"K must be \[\[fx, skew, cx\]"),
        ({"K": [[500, 1, 0], [0, 500, 0], [0, 1, 1]]}, "K must be"),
        ({"K": [[500, 512001, 0], [0, 500, 0], [0, 0, 1]]}, "skew must be at most 1024 times its fx, 500.0 pixels"),
        ({"K": [[500, math.inf, 0], [0, 500, 0], [0, 0, 1]]}, "K must be"),
        ({"K": np.eye(4)}, "K must be"),
        ({"K": np.diag([500, 500, 2])}, "K must be"),
        ({"K": np.diag([-500, 500, 1])}, "focal"),
        ({"R": np.diag([1, 1, -1])}, "rotation"),
        ({"R": np.eye(3) * 1.1}, "rotation"),
        ({"R": np.full((3, 3), math.nan)}, "R must be"),
        ({"R": "identity"}, "R must be"),
        ({"t": [1, 2]}, "t must be"),
        ({"t": None}, "t must be"),
        ({"size": (0, 480)}, "size"),
    ],
)
def test_illegal_calibrations_are_refused(changes, message):
    legal = {"K": np.diag([500.0, 500.0, 1.0]), "R": np.eye(3), "t": [0, 0, 1], "size": (640, 480)}
    with pytest.raises(SceneError, match=message):
        Camera.from_opencv(**(legal | changes))


def test_rotations_of_a_few_digits_are_taken():
    R = np.round([[0.8660254, -0.5, 0], [0.5, 0.8660254, 0], [0, 0, 1]], 4)
    back = Camera.from_opencv(np.diag([500, 500, 1]), R, [0, 0, 1], (640, 480)).to_opencv((640, 480))[1]
    assert back == pytest.approx(R, abs=1e-4) and back @ back.T == pytest.approx(np.eye(3), abs=1e-14)


def test_no_zero_is_printed_with_a_sign():
    camera = Camera.from_opencv(np.eye(3), np.eye(3), [0, 0, 0], (10, 10))
    assert "up=(0, -1, 0)" in repr(camera) and "-0" not in repr(Camera.perspective((-0.0, 1, 5), fov=40))
