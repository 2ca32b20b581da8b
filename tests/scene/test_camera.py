"""Cameras: axes, pixels, refusals, OpenCV, poses."""

import math
import pickle

import numpy as np
import pytest
from helpers.pixels import AXIS, project
from helpers.refusals import assert_refused
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from rasterizer.errors import SceneError
from rasterizer.scene.camera import Camera

_coordinate = st.floats(-10.0, 10.0).map(lambda x: round(x, 4))
_points = st.lists(st.tuples(_coordinate, _coordinate, _coordinate), min_size=3, max_size=3).map(np.array)
NAN = math.nan


@given(_points)
@settings(max_examples=30)
def test_axes_are_a_right_handed_frame(points):
    assume(np.linalg.norm(points[0] - points[1]) > 1e-3 and np.linalg.norm(points[2]) > 1e-3)
    _, right, up, forward = Camera.perspective(points[0], points[1], points[2]).view()
    frame = np.stack([right, up, -forward])
    assert frame @ frame.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.cross(right, up) == pytest.approx(-forward, abs=1e-12)
    assert forward == pytest.approx((points[1] - points[0]) / np.linalg.norm(points[1] - points[0]), abs=1e-12)
    assert up @ points[2] >= -1e-9  # up is upwards


def test_up_parallel_to_the_view_is_the_orbit_at_azimuth_0():
    """Looking along `up` gives the picture that framing gives at an elevation of ±90: a map, for z up."""
    for up in AXIS:
        for side in (1.0, -1.0):
            straight = Camera.perspective(np.array(AXIS[up]) * 7.0 * side, up=up).view()
            framed = Camera.framing([[-1, -1, -1], [1, 1, 1]], azimuth=0, elevation=90 * side, up=up).view()
            for a, b in zip(straight[1:], framed[1:], strict=True):
                assert np.abs(a - b).max() < 1e-15, f"{up}, {side}: {a} != {b}"
    view = Camera.orthographic((2, 3, 9), (2, 3, 0), up=(0, 0, 1)).view()
    assert list(view.right) == [1, 0, 0] and list(view.up) == [0, 1, 0]
    assert list(Camera.perspective((0, 5, 0)).view().up) == [0, 0, -1]


@given(st.sampled_from(["fov", "height"]), st.floats(0.05, 20.0), st.integers(1, 300), st.integers(1, 300))
@settings(max_examples=60)
def test_a_picture_of_any_shape_shows_all_of_a_cameras_frame(lens, aspect, width, height):
    """It touches the picture's border in height, or in width where the picture is narrower; without aspect it may be
    cropped."""
    camera = Camera(position=(3, 2, 9), up=(0.1, 1, 0), aspect=aspect, **{lens: 40.0})
    eye, right, up, forward = camera.view()
    half = math.tan(math.radians(20)) if lens == "fov" else 20.0
    signs = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    corners = eye + forward + half * (aspect * signs[:, :1] * right + signs[:, 1:] * up)
    pixels, _ = project(camera, corners, (width, height))
    outside = np.maximum(-pixels, pixels - (width, height))
    assert outside.max() == pytest.approx(0, abs=1e-9 * max(width, height))
    fits = width >= height * aspect
    assert outside[:, 1 if fits else 0] == pytest.approx(np.zeros(4), abs=1e-9 * max(width, height))
    if camera.is_perspective:
        focal = camera.to_opencv((width, height))[0][1, 1]
        assert 2 * focal * half == pytest.approx(height if fits else width / aspect)


def test_illegal_cameras_are_refused():
    place, unit = {"position": (0, 0, 1)}, {"intrinsics": (1, 1, 1, 1), "size": (4, 3)}
    skewed = r"skew goes with its intrinsics; given 0\.1"
    cases = [
        ({"position": (0, 0, 0), "fov": 45}, "position and target must differ"),
        ({"position": (0, 0, NAN), "fov": 45}, "camera's position"),
        *((place | {"up": up, "fov": 45}, "camera's up") for up in ((0, 0, 0), "north")),
        *((place | {"fov": fov}, "camera's fov") for fov in (0, 180, "wide")),
        *((place | {"height": height}, "camera's height") for height in (0, -1)),
        *((place | {"fov": 9, "aspect": aspect}, r"aspect \(width / height\) must") for aspect in (0, NAN, "wide")),
        (place | unit | {"aspect": 1.5}, "has the aspect of their size"),
        *((place | lens, "either fov") for lens in ({"height": 1, "fov": 45}, {})),
        (place | {"fov": 45, "near": 0}, "near must be above 0 with perspective"),
        (place | {"fov": 45, "near": 2, "far": 2}, "near must be below"),
        *((place | unit | {"intrinsics": given}, "focal") for given in ((0, 1, 1, 1), (1, -1, 1, 1))),
        (place | {"intrinsics": (1, 1, 1, 1)}, "size"),
        (place | {"fov": 45, "size": (4, 3)}, "size"),
        (place | {"fov": 45, "skew": 0.1}, skewed),
        *((place | unit | {"skew": skew}, "skew") for skew in (NAN, None)),
    ]
    assert_refused(lambda options: Camera(**options), cases, SceneError)
    sizes = [(0, 1), (1.5, 2), (1, 2, 3), 7, None, ("a", "b"), (NAN, 1), (math.inf, 1)]
    assert_refused(Camera.perspective((0, 0, 1)).projection, [(size, "size") for size in sizes], SceneError)


# --- OpenCV -------------------------------------------------------------------------------------------------


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
    again = Camera.from_opencv(np.float32(K), np.eye(3), [0, 0, 4], (640, 480))
    assert pickle.loads(pickle.dumps(camera)) == camera == again
    plain = Camera.from_opencv(np.diag([500, 400, 1]), np.eye(3), [0, 0, 4], (640, 480))
    assert plain != camera and plain.skew == 0.0 and "skew" not in repr(plain)


def test_rays_go_through_their_pixels():
    """Projection.ray_axes is the inverse of what K does."""
    for skew in (-70.0, 0.0, 1e-3, 3000.0):
        camera = Camera.from_opencv([[500, skew, 300], [0, 400, 200], [0, 0, 1]], np.eye(3), [1, 2, 4], (640, 480))
        view, projection = camera.view(), camera.projection((640, 480))
        right, up = projection.ray_axes(view)
        places = np.random.default_rng(3).uniform(-500, 900, (20, 2))
        x, y = (places[:, :1] - projection.center_x) / 500, (projection.center_y - places[:, 1:]) / 400
        points = view.eye + 3.0 * (x * right + y * up + view.forward)
        off = np.abs(project(camera, points, (640, 480))[0] - places).max()
        assert off < 1e-9, f"skew {skew}: {off:.3g} > 1e-9 pixels"


@given(st.integers(0, 10_000), st.sampled_from([1e-6, 1.0, 1e6]))
@settings(max_examples=30, deadline=None)
def test_opencv_round_trip(seed, scale):
    rng = np.random.default_rng(seed)
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    R = q * np.sign(np.diag(r))
    R = R if np.linalg.det(R) > 0 else -R
    t = rng.normal(size=3) * scale
    skew = rng.choice([0.0, 1e-12, rng.normal(0, 200)])
    K = np.array([[rng.uniform(100, 900), skew, rng.uniform(-50, 700)], [0, rng.uniform(100, 900), 33.25], [0, 0, 1]])
    camera = Camera.from_opencv(K, R, t, (640, 480))
    back_K, back_R, back_t = camera.to_opencv((640, 480))
    assert back_K == pytest.approx(K, rel=1e-12)
    assert back_R == pytest.approx(R, abs=1e-12)
    assert back_t == pytest.approx(t, rel=1e-9, abs=1e-12 * scale)
    points = rng.normal(size=(5, 3))
    seen = points @ R.T + t
    assume((np.abs(seen[:, 2]) > 1e-3).all())
    pixels, depth = project(camera, points, (640, 480))
    uvw = seen @ K.T
    assert depth == pytest.approx(seen[:, 2], rel=1e-9, abs=1e-9)
    assert pixels == pytest.approx(uvw[:, :2] / uvw[:, 2:] + 0.5, rel=1e-6, abs=1e-6)
    larger, _ = project(camera, points, (1280, 1440))  # another size scales the picture
    assert larger == pytest.approx(pixels * (2, 3), rel=1e-9)


def test_illegal_calibrations_are_refused():
    legal = {"K": np.diag([500.0, 500.0, 1.0]), "R": np.eye(3), "t": [0, 0, 1], "size": (640, 480)}
    matrix = r"K must be \[\[fx, skew, cx\]"
    cases = [
        ({"K": [[500, 0, 0], [1, 500, 0], [0, 0, 1]]}, matrix),
        ({"K": [[500, 512001, 0], [0, 500, 0], [0, 0, 1]]}, r"skew must be at most 1024 times its fx, 500\.0 pixels"),
        ({"K": np.diag([-500, 500, 1])}, "focal"),
        ({"R": np.diag([1, 1, -1])}, "rotation"),
        ({"R": np.full((3, 3), NAN)}, "R must be"),
        ({"t": [1, 2]}, "t must be"),
        ({"size": (0, 480)}, "size"),
    ]
    assert_refused(lambda changes: Camera.from_opencv(**(legal | changes)), cases, SceneError)
    R = np.round([[0.8660254, -0.5, 0], [0.5, 0.8660254, 0], [0, 0, 1]], 4)  # of a few digits: taken
    back = Camera.from_opencv(legal["K"], R, [0, 0, 1], (640, 480)).to_opencv((640, 480))[1]
    assert back == pytest.approx(R, abs=1e-4) and back @ back.T == pytest.approx(np.eye(3), abs=1e-14)


# --- poses --------------------------------------------------------------------------------------------------


def random_pose(rng, scale=1.0):
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = q * np.sign(np.linalg.det(q)), rng.normal(size=3) * scale
    return pose


def test_a_pose_comes_back():
    rng = np.random.default_rng(7)
    for scale in (1.0, 1e-6, 1e6):
        for _ in range(10):
            pose = random_pose(rng, scale)
            camera = Camera.from_pose(pose, fov=50)
            off = np.abs(camera.pose - pose).max()
            assert camera.fov == 50 and off <= 4e-15 * max(scale, 1.0), f"{scale}: {off:.3g}"
    assert Camera.from_pose(pose, height=2.0).height == 2.0


def test_the_frame_of_opencv_is_turned_over():
    pose = random_pose(np.random.default_rng(8))
    flipped = pose @ np.diag([1.0, -1.0, -1.0, 1.0])
    turned = Camera.from_pose(flipped, frame="opencv")
    assert np.abs(turned.pose - pose).max() < 1e-14
    _, R, t = turned.to_opencv((64, 48))
    assert np.abs(np.column_stack([R.T, -R.T @ t]) - flipped[:3]).max() < 1e-14


def test_illegal_poses_are_refused():
    cases = [
        *((pose, r"the pose must be finite numbers of the shape \(4, 4\)") for pose in (np.eye(3), None, "pose")),
        (np.eye(4) * NAN, "the pose must be finite"),
        (np.diag([1.0, 1, 1, 2]), r"the pose's last row must be \(0, 0, 0, 1\); given"),
        (np.diag([2.0, 2, 2, 1]), r"the pose's upper left \(3, 3\) must be a rotation"),
        (np.diag([1.0, 1, -1, 1]), "must be a rotation"),
    ]
    assert_refused(Camera.from_pose, cases, SceneError)
    with pytest.raises(SceneError, match="the pose's frame must be one of 'opengl', 'opencv'; given 'gl'"):
        Camera.from_pose(np.eye(4), frame="gl")


def test_look_at_is_with_perspective_unless_a_height_is_given():
    assert Camera.look_at((1, 2, 3)) == Camera.perspective((1, 2, 3))
    assert Camera.look_at((1, 2, 3), (0, 1, 0), "z", height=4) == Camera.orthographic((1, 2, 3), (0, 1, 0), "z", 4)
    with pytest.raises(SceneError, match="either fov"):
        Camera.look_at((1, 2, 3), fov=30, height=4)
