"""Cameras in the files of NeRF and COLMAP: by their formulas, there and back; and where a camera sees a point."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.raster import ROOT

import rasterizer as rz

SIZE = (64, 48)
K = [[90.0, 0.0, 30.0], [0.0, 95.0, 25.0], [0.0, 0.0, 1.0]]
MODEL = str(ROOT / "models" / "still_life.obj")

pytestmark = pytest.mark.usefixtures("folder")


def cameras(n=5):
    scene = rz.load(MODEL)
    return {f"images/{k}.png": rz.Camera.random(scene, k, roll=(0, 360), size=SIZE) for k in range(n)}


def assert_alike(found, expected):
    assert list(found) == list(expected)
    for name, camera in found.items():
        for one, other in zip(camera.to_opencv(SIZE), expected[name].to_opencv(SIZE), strict=True):
            assert np.allclose(one, other, atol=1e-9)


@pytest.mark.parametrize(
    "camera",
    [
        rz.Camera.look_at((3, 2, 5), (0, 0.5, 0), fov=40),
        rz.Camera.look_at((3, 2, 5), (0, 0.5, 0), height=4),
        rz.Camera.from_pose(rz.Camera.look_at((3, 2, 5), (0, 0.5, 0)).pose, K=K, size=SIZE),
        rz.Camera.from_opencv(np.add(K, [[0, 7, 0], [0, 0, 0], [0, 0, 0]]), np.diag([1, -1, -1]), (0, 0.5, 5), SIZE),
        rz.Camera.perspective((3, 2, 5), fov_x=50, size=(40, 90)),
    ],
)
def test_a_frame_knows_its_camera_which_projects_points_to_their_pixels(camera):
    frame = rz.render(MODEL, SIZE, camera=camera, outputs=("position", "depth", "mask"))
    assert frame.camera == camera
    rows, columns = np.nonzero(frame.mask)
    pixels, depth = frame.camera.project(frame.position[rows, columns], SIZE)
    assert len(rows) > 100 and np.abs(pixels - 0.5 - np.stack([columns, rows], axis=1)).max() < 0.01
    off = np.abs(
        depth - frame.depth[rows, columns]
    )  # vertices are rounded to 1/256 px: most where a side is seen askew
    assert np.median(off) < 3e-4 and off.max() < 0.02
    assert np.isnan(camera.project(camera.pose[:3, 2] * 9 + camera.position, SIZE)[0]).all() == camera.is_perspective
    with pytest.raises(rz.SceneError, match=r"shape \(\.\.\., 3\)"):
        camera.project([1, 2], SIZE)


def test_a_pose_takes_k_or_a_horizontal_field_of_view():
    for frame, turn in (("opengl", np.eye(4)), ("opencv", np.diag([1, -1, -1, 1]))):
        for camera in cameras().values():
            found = rz.Camera.from_pose(camera.pose @ turn, frame=frame, K=K, size=SIZE)
            for one, other in zip(found.to_opencv(SIZE), (K, *camera.to_opencv(SIZE)[1:]), strict=True):
                assert np.allclose(one, other, atol=1e-9)
            wide = rz.Camera.from_pose(camera.pose @ turn, frame=frame, fov_x=70, size=(90, 40))
            assert np.isclose(wide.to_opencv((90, 40))[0][0, 0], 45 / np.tan(np.radians(35)))
    pose = np.eye(4)
    for words, said in (
        ({"K": K}, "K needs size"), ({"fov_x": 40}, "fov_x needs size"), ({"size": SIZE}, "size goes with"),
        ({"K": K, "fov": 40, "size": SIZE}, "K says"), ({"fov_x": 40, "fov": 40, "size": SIZE}, "given two"),
    ):  # fmt: skip
        with pytest.raises(rz.SceneError, match=said):
            rz.Camera.from_pose(pose, **words)


def test_nerfs_file_is_what_its_formulas_say_and_comes_back():
    given = cameras()
    rz.write_nerf("data/transforms.json", given, SIZE)
    said = json.loads(Path("data/transforms.json").read_text())
    assert (said["w"], said["h"], said["cx"], said["cy"]) == (64, 48, 32, 24)
    assert np.isclose(said["fl_x"], 32 / np.tan(said["camera_angle_x"] / 2)) and said["fl_x"] == said["fl_y"]
    for frame, (name, camera) in zip(said["frames"], given.items(), strict=True):
        assert frame["file_path"] == name and set(frame) == {"file_path", "transform_matrix"}
        matrix = np.array(frame["transform_matrix"])
        assert np.allclose(matrix[:3, 3], camera.position)
        assert np.allclose(-matrix[:3, 2], np.subtract(camera.target, camera.position) / np.linalg.norm(
            np.subtract(camera.target, camera.position)))  # fmt: skip
    assert_alike(rz.read_nerf("data/transforms.json"), given)
    own = given | {"k.png": rz.Camera.from_pose(np.eye(4), K=K, size=SIZE)}
    rz.write_nerf("own.json", own, SIZE)
    assert_alike(rz.read_nerf("own.json"), own)
    assert_alike(rz.read_nerf("own.json", size=SIZE), own)
    plain = {"camera_angle_x": said["camera_angle_x"], "frames": said["frames"]}  # as NeRF's own data has it
    Path("plain.json").write_text(json.dumps(plain))
    assert_alike(rz.read_nerf("plain.json", size=SIZE), given)
    for change, words in (({}, "give size"), ({"w": 64, "h": 48, "k1": 0.1}, r"cv2\.undistort")):
        Path("plain.json").write_text(json.dumps(plain | change))
        with pytest.raises(rz.ModelError, match=f"^plain.json: can't be read as transforms.json: .*{words}"):
            rz.read_nerf("plain.json")
    faults = [plain | {"w": 64, "h": 48} | change for change in (
        {"camera_angle_x": 0}, {"camera_angle_x": 10**400}, {"fl_x": 1e400}, {"w": 64.5}, {"w": 0}, {"h": "48"},
        {"w": float("inf")}, {"cx": [1]}, {"frames": [said["frames"][0] | {"file_path": None}]},
    )]  # fmt: skip
    texts = [
        "[]",
        "{}",
        "nonsense",
        '{"frames": [{}]}',
        '{"frames": [{"file_path": "a", "w": 2, "h": 2}]}',
        "[" * 10**5,
    ]
    for text in (*texts, *map(json.dumps, faults)):
        Path("no.json").write_text(text)
        with pytest.raises(rz.ModelError, match="can't be read as transforms.json"):
            rz.read_nerf("no.json")


def test_colmaps_files_are_what_their_formulas_say_and_come_back():
    given = cameras() | {"k.png": rz.Camera.from_pose(np.eye(4), K=K, size=SIZE)}
    rz.write_colmap("sparse/0", given, SIZE)
    lenses = [row.split() for row in Path("sparse/0/cameras.txt").read_text().splitlines()[1:]]
    assert [row[:4] for row in lenses] == [["1", "PINHOLE", "64", "48"], ["2", "PINHOLE", "64", "48"]]
    assert lenses[1][4:] == ["90.0", "95.0", "30.5", "25.5"], "from the picture's corner"
    rows = Path("sparse/0/images.txt").read_text().splitlines()[1:]
    assert rows[1::2] == [""] * 6 and Path("sparse/0/points3D.txt").exists()
    point = np.array([0.3, -0.2, 0.4])
    for row, (name, camera) in zip(rows[::2], given.items(), strict=True):
        _, *numbers, number, named = row.split()
        w, *v = map(float, numbers[:4])
        # A unit quaternion turns p into p + 2 w (v × p) + 2 v × (v × p).
        turned = point + 2 * w * np.cross(v, point) + 2 * np.cross(v, np.cross(v, point))
        x = turned + [float(value) for value in numbers[4:]]
        fx, fy, cx, cy = map(float, lenses[int(number) - 1][4:])
        assert named == name and np.isclose(np.hypot(w, np.linalg.norm(v)), 1)
        pixels, depth = camera.project(point, SIZE)
        assert np.isclose(x[2], depth)
        if depth > 0:
            assert np.allclose((fx * x[0] / x[2] + cx, fy * x[1] / x[2] + cy), pixels)
    assert_alike(rz.read_colmap("sparse/0"), given)
    for model in (
        "SIMPLE_RADIAL 64 48 90 32 24 0",
        "SIMPLE_PINHOLE 64 48 90 32 24",
        "OPENCV 64 48 90 90 32 24 0 0 0 0",
    ):
        Path("sparse/0/cameras.txt").write_text(f"# cameras\n1 {model}\n2 {model}\n")
        camera = rz.read_colmap("sparse/0")["images/0.png"]
        assert np.allclose(camera.to_opencv(SIZE)[0], [[90, 0, 31.5], [0, 90, 23.5], [0, 0, 1]])
    for model in ("SIMPLE_RADIAL 64 48 90 32 24 0.1", "OPENCV_FISHEYE 64 48 90 90 32 24 0 0 0 0"):
        Path("sparse/0/cameras.txt").write_text(f"1 {model}\n")
        with pytest.raises(rz.ModelError, match=r"undistort the pictures, by cv2\.undistort"):
            rz.read_colmap("sparse/0")
    lens, pose = "1 PINHOLE 64 48 90 90 32 24", "1 1 0 0 0 0 0 5 1 a.png\n\n"
    for lens_text, pose_text in (
        ("1 PINHOLE 64", pose), ("2 PINHOLE 64 48 1 1 1 1", pose), ("1 PINHOLE 64.5 48 90 90 32 24", pose),
        ("1 PINHOLE 64 48 9_0 90 32 24", pose), ("1 PINHOLE 64 48 nan 90 32 24", pose), (lens, "1 0 0 0 0 0 0 5 1 a\n"),
        (lens, "1 1 inf 0 0 0 0 5 1 a\n"), (lens, "1 1e308 1e308 1e308 1e308 0 0 5 1 a\n"), (lens, "1 1 0 0 0 0 0 5\n"),
    ):  # fmt: skip
        Path("sparse/0/cameras.txt").write_text(lens_text)
        Path("sparse/0/images.txt").write_text(pose_text)
        with pytest.raises(rz.ModelError, match="can't be read as cameras.txt"):
            rz.read_colmap("sparse/0")


def test_cameras_that_neither_file_can_hold_are_refused():
    camera = rz.Camera.look_at((0, 0, 5))
    skewed = replace(camera, fov=None, intrinsics=(90, 90, 32, 24), size=SIZE, skew=3)
    for write in (rz.write_nerf, rz.write_colmap):
        for given, words in (
            ({}, "must be a dict"), ([camera], "must be a dict"), ({"a.png": camera}, r"size=\(width, height\)"),
            ({"a.png": skewed}, "without skew"),
        ):  # fmt: skip
            with pytest.raises(rz.SceneError, match=words):
                write("out", given)
        with pytest.raises(rz.SceneError, match="perspective"):
            write("out", {"a.png": rz.Camera.look_at((0, 0, 5), height=3)}, SIZE)
