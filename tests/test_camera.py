"""Cameras: axes, pixels, framing, OpenCV."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from rasterizer.errors import SceneError
from rasterizer.scene.camera import Camera

AXIS = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}
AXIS |= {f"-{name}": tuple(-c for c in axis) for name, axis in AXIS.items()}
_coordinate = st.floats(-10.0, 10.0).map(lambda x: round(x, 4))
_points = st.lists(st.tuples(_coordinate, _coordinate, _coordinate), min_size=1, max_size=12).map(np.array)


def project(camera, points, size):
    """Return (n, 2) pixels and (n,) depths of points, straight from the definitions."""
    eye, right, up, forward = camera.view()
    scale_x, scale_y, center_x, center_y, is_perspective = camera.projection(size)
    r = np.asarray(points, dtype=np.float64) - eye
    depth = r @ forward
    w = depth if is_perspective else np.ones(len(r))
    return np.stack([center_x + scale_x * (r @ right) / w, center_y - scale_y * (r @ up) / w], axis=1), depth


def margins(camera, points, size):
    """Return the empty shares of the picture: (left, top), (right, bottom)."""
    pixels, depth = project(camera, points, size)
    assert (depth > 0.0).all()
    return pixels.min(axis=0) / size, 1.0 - pixels.max(axis=0) / size


def assert_framed(camera, points, size, margin=0.05, tight=1e-6, centered=1e-3):
    """Check that the points keep the margin, reach it in one direction, and are centred."""
    low, high = margins(camera, points, size)
    assert min(low.min(), high.min()) == pytest.approx(margin, abs=tight), (low, high)
    assert np.abs(low - high).max() <= centered


def test_look_at_axes():
    view = Camera.perspective((0, 0, 5)).view()
    assert [list(axis) for axis in view] == [[0, 0, 5], [1, 0, 0], [0, 1, 0], [0, 0, -1]]
    view = Camera.perspective((10, 0, 0), up="z").view()
    assert [list(axis) for axis in view[1:]] == [[0, 1, 0], [0, 0, 1], [-1, 0, 0]]


@given(_points.filter(lambda p: len(p) >= 3))
@settings(max_examples=50)
def test_axes_are_a_right_handed_frame(points):
    assume(np.linalg.norm(points[0] - points[1]) > 1e-3 and np.linalg.norm(points[2]) > 1e-3)
    _, right, up, forward = Camera.perspective(points[0], points[1], points[2]).view()
    frame = np.stack([right, up, -forward])
    assert frame @ frame.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.cross(right, up) == pytest.approx(-forward, abs=1e-12)
    assert forward == pytest.approx(
        (points[1] - points[0]) / np.linalg.norm(points[1] - points[0]), abs=1e-12
    )
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
    ("up", "azimuth", "towards"),
    [
        ("y", 0, "z"),
        ("y", 90, "x"),
        ("y", 180, "-z"),
        ("y", -90, "-x"),
        ("z", 0, "-y"),
        ("z", 90, "x"),
        ("-y", 0, "-z"),
        ("-y", 90, "x"),
        ("-z", 0, "y"),
        ("-z", 90, "x"),
        ("x", 0, "z"),
        ("x", 90, "-y"),
        ("-x", 90, "y"),
    ],
)
def test_azimuth(up, azimuth, towards):
    view = Camera.framing([[-1, -1, -1], [1, 1, 1]], azimuth=azimuth, elevation=0, up=up).view()
    assert tuple(-view.forward) == AXIS[towards]
    assert tuple(view.up) == AXIS[up]


@pytest.mark.parametrize("up", AXIS)
def test_elevation_rises_towards_up(up):
    for elevation in (-90, -30, 0, 30, 90):
        view = Camera.framing([[-1, -1, -1], [1, 1, 1]], elevation=elevation, up=up).view()
        assert -view.forward @ AXIS[up] == pytest.approx(math.sin(math.radians(elevation)), abs=1e-12)
        assert view.up @ AXIS[up] == pytest.approx(math.cos(math.radians(elevation)), abs=1e-12)


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("size", [(640, 480), (300, 900), (1000, 100), (1, 1)])
@pytest.mark.parametrize("elevation", [-90, -20, 0, 25, 90])
def test_framing_is_tight_and_centred(orthographic, size, elevation):
    points = np.random.default_rng(7).normal(size=(500, 3)) * (1.0, 2.0, 0.3)
    aspect = size[0] / size[1]
    camera = Camera.framing(points, elevation=elevation, orthographic=orthographic, aspect=aspect)
    assert_framed(camera, points, size, centered=1e-9)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("offset", [0.0, 1e6])
@pytest.mark.parametrize("orthographic", [False, True])
def test_framing_at_any_scale_and_offset(scale, offset, orthographic):
    points = np.random.default_rng(3).uniform(-1, 1, (200, 3)) * scale + offset
    camera = Camera.framing(points, orthographic=orthographic)
    # the eye's own coordinates are rounded: what that is in shares of the subject
    rounding = 8 * np.spacing(offset + scale) / scale
    assert_framed(camera, points, (640, 480), tight=1e-6 + rounding, centered=1e-3 + rounding)


@given(
    _points,
    st.floats(-360, 360),
    st.floats(-90, 90),
    st.floats(1, 120),
    st.floats(0.1, 10),
    st.floats(0, 0.45),
    st.sampled_from(sorted(AXIS)),
    st.booleans(),
)
@settings(max_examples=200, deadline=None)
def test_framing_anything(points, azimuth, elevation, fov, aspect, margin, up, orthographic):
    mesh = SimpleNamespace(vertices=points)  # two bare points would be bounds
    camera = Camera.framing(mesh, azimuth, elevation, fov, up, margin, orthographic, aspect)
    size = (1000 * aspect, 1000)
    view, scale = camera.view(), camera.projection((1000, 1000)).scale_x
    r = points - view.eye
    w = r @ view.forward if camera.is_perspective else np.ones(len(r))
    assert (w > 0.0).all()
    pixels = np.stack([scale * (r @ view.right) / w, scale * (r @ view.up) / w], axis=1) / size + 0.5
    low, high = pixels.min(axis=0), 1.0 - pixels.max(axis=0)
    assert np.abs(low - high).max() <= 1e-6
    assert min(low) >= margin - 1e-6
    # a needle that points at the eye keeps its distance; a line seen as a point fills nothing
    size_along_axes = np.linalg.norm(np.ptp(r @ np.stack(view[1:]).T, axis=0))
    is_needle = camera.is_perspective and w.min() <= 0.0101 * size_along_axes
    is_point = (np.ptp(pixels, axis=0) < 1e-6).all()
    if not is_needle and not is_point:
        assert min(low) == pytest.approx(margin, abs=1e-6)


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("point", [(0, 0, 0), (1e6, -1e6, 3), (1e-6, 0, 0), (1e12, 0, 0)])
def test_framing_a_single_point_puts_it_in_the_middle(orthographic, point):
    camera = Camera.framing(np.array([point]), orthographic=orthographic)
    pixels, depth = project(camera, [point], (640, 480))
    assert depth[0] > 0.0
    assert pixels[0] == pytest.approx((320, 240), abs=0.5)


@pytest.mark.parametrize("orthographic", [False, True])
def test_framing_flat_meshes_and_lines(orthographic):
    square = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]) + 5.0
    for azimuth, elevation in ((0, 0), (90, 0), (0, 90), (35, 25)):  # head on, edge on twice, slanting
        camera = Camera.framing(square, azimuth, elevation, orthographic=orthographic)
        assert_framed(camera, square, (640, 480), centered=1e-9)
    line = np.array([(0, 0, -1), (0, 0, 1)])[[0, 1, 1]]
    camera = Camera.framing(line, 0, 0, orthographic=orthographic)  # the line is seen as a point
    pixels, depth = project(camera, line, (640, 480))
    assert (depth > 0.0).all() and pixels == pytest.approx(np.array([(320, 240)] * 3))


def test_framing_a_needle_keeps_a_distance():
    needle = np.array([(0, 0, 10), (0.1, 0, 0), (-0.1, 0, 0), (0, 0.1, 0), (0, -0.1, 0)])
    camera = Camera.framing(needle, 0, 0, fov=90)
    low, high = margins(camera, needle, (640, 480))
    assert low == pytest.approx(high) and min(low) > 0.05
    assert project(camera, needle, (640, 480))[1].min() == pytest.approx(0.1, rel=0.01)


def test_framing_is_smallest():
    """Any step nearer pushes a vertex over the margin."""
    points = np.random.default_rng(5).normal(size=(100, 3))
    camera = Camera.framing(points)
    forward = camera.view().forward
    nearer = replace(camera, position=np.array(camera.position) + 1e-3 * forward)
    low, high = margins(nearer, points, (640, 480))
    assert min(low.min(), high.min()) < 0.05 - 1e-5


def test_framing_takes_bounds_meshes_and_scenes():
    corners = np.array([(x, y, z) for x in (0, 1) for y in (0, 2) for z in (0, 3)], dtype=np.float32)
    expected = Camera.framing(corners)
    assert_framed(expected, corners, (640, 480))
    assert Camera.framing([[0, 0, 0], [1, 2, 3]]).position == pytest.approx(expected.position)
    assert Camera.framing(SimpleNamespace(vertices=corners)).position == expected.position
    halves = [SimpleNamespace(used_vertices=half) for half in (corners[:3], corners[3:])]
    assert Camera.framing(SimpleNamespace(meshes=halves)).position == pytest.approx(expected.position)
    two = SimpleNamespace(vertices=corners[[0, 7]])  # two vertices of a mesh are no bounds
    assert_framed(Camera.framing(two, azimuth=-60), corners[[0, 7]], (640, 480))


def test_framing_many_points_goes_by_chunks():
    points = np.random.default_rng(1).normal(size=(100_000, 3))
    assert_framed(Camera.framing(points), points, (640, 480), centered=1e-9)


@pytest.mark.parametrize(
    "wrong", [np.zeros((0, 3)), [[1, 2]], "cube", None, [["a", "b", "c"]], np.zeros(3), 5]
)
def test_framing_needs_points(wrong):
    with pytest.raises(SceneError, match="what is framed"):
        Camera.framing(wrong)


@pytest.mark.parametrize("where", [0, 3, 40_000, 49_999])
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_framing_refuses_points_that_are_not_finite(where, bad):
    points = np.random.default_rng(1).normal(size=(50_000, 3))
    points[where, 1] = bad
    with np.errstate(invalid="ignore"), pytest.raises(SceneError, match="finite"):
        Camera.framing(points)


@pytest.mark.parametrize(
    "options",
    [
        {"azimuth": math.nan},
        {"elevation": 91},
        {"fov": 0},
        {"fov": 180},
        {"up": "w"},
        {"up": (0, 1, 0)},
        {"margin": 0.5},
        {"margin": -0.1},
        {"aspect": 0},
        {"aspect": math.inf},
    ],
)
def test_framing_refuses_illegal_options(options):
    with pytest.raises(SceneError, match=next(iter(options))):
        Camera.framing([[0, 0, 0], [1, 1, 1]], **options)


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
    ],
)
def test_illegal_cameras_are_refused(options, message):
    with pytest.raises(SceneError, match=message):
        Camera(**options)


def test_orthographic_depths_may_be_behind():
    camera = Camera.orthographic((0, 0, 1), height=1, near=-5, far=5)
    assert (camera.near, camera.far) == (-5.0, 5.0)


@pytest.mark.parametrize(
    "size", [(0, 1), (1.5, 2), (1, 2, 3), 7, None, ("a", "b"), (math.nan, 1), (math.inf, 1)]
)
def test_illegal_sizes_are_refused(size):
    with pytest.raises(SceneError, match="size"):
        Camera.perspective((0, 0, 1)).projection(size)


def test_cameras_are_comparable():
    assert Camera.perspective((0, 0, 1)) == Camera.perspective(np.array([0, 0, 1.0]))
    assert len({Camera.perspective((0, 0, 1)), Camera.orthographic((0, 0, 1))}) == 2


def test_opencv_by_hand():
    """A camera at (0, 0, -4) that looks along +z with y down is OpenCV's identity rotation with t = (0, 0, 4)."""
    K = [[500, 0, 319.5], [0, 400, 200], [0, 0, 1]]
    camera = Camera.from_opencv(K, np.eye(3), [0, 0, 4], (640, 480))
    view = camera.view()
    assert [list(axis) for axis in view] == [[0, 0, -4], [1, 0, 0], [0, -1, 0], [0, 0, 1]]
    # OpenCV: u = 500 * 1/5 + 319.5 = 419.5, v = 400 * 2/5 + 200 = 360, counted from the first pixel's centre
    pixels, depth = project(camera, [(1, 2, 1)], (640, 480))
    assert pixels[0] == pytest.approx((420.0, 360.5)) and depth[0] == 5.0
    assert camera.fov == pytest.approx(math.degrees(2 * math.atan(240 / 400)))


def test_opencv_turned_by_hand():
    """A quarter turn: the camera's z is the world's x, its x is the world's -y... and its y the world's -z."""
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
    K = np.array(
        [[rng.uniform(100, 900), 0, rng.uniform(-50, 700)], [0, rng.uniform(100, 900), 33.25], [0, 0, 1]]
    )
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
        ({"K": [[500, 1, 0], [0, 500, 0], [0, 0, 1]]}, "skew"),
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
