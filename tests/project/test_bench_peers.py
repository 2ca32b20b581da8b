"""bench/peers.py compares what is the same work: everybody gets the same arrays, and draws the same picture.

Peers that aren't installed, or find no driver, are left out here as there. What starts processes runs at night.
"""

import importlib.util
import json
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from helpers.raster import ROOT

import rasterizer as rz
from bench import peers, peers_compare, peers_process, peers_work, scenes
from bench.peers_ours import SPECK, SPECKS, Painter
from bench.peers_process import Failure, Process
from bench.peers_work import Setup, make_work

SIZE = (96, 72)
nightly = pytest.mark.nightly
QUICK = ["--pairs", "1", "--frames", "3", "--seconds", "0.01", "--size", "96x72", "--threads", "1"]


@pytest.fixture
def arrays(tmp_path):
    """The file that carries a work from process to process."""
    return tmp_path / "work.npz"


# ---------------------------------------------------------------- the work


def test_the_matrix_puts_points_where_our_camera_puts_them():
    work = make_work("torus", False, Setup(size=SIZE, shading="gouraud"))
    setup = work.setup
    clip = np.column_stack([work.positions, np.ones(len(work.positions))]) @ peers_work.clip_from_world(setup).T
    x, y, z = (clip[:, :3] / clip[:, 3:]).T
    pixels = np.column_stack([0.5 * SIZE[0] * (1 + x), 0.5 * SIZE[1] * (1 - y)])
    target = np.array(setup.eye) + np.array(setup.forward)
    camera = rz.Camera.perspective(setup.eye, target=target, up=setup.up, fov=setup.fov)
    view, projection = camera.view(), camera.projection(SIZE)
    relative = work.positions - view.eye
    distance = relative @ view.forward
    x, y = relative @ view.right / distance, relative @ view.up / distance
    expected = [projection.center_x + projection.scale_x * x, projection.center_y - projection.scale_y * y]
    error = np.abs(pixels - np.column_stack(expected)).max()
    assert error < 1e-9, f"{error:.2g} px > 1e-9 px"
    used = np.unique(work.faces)
    assert -1 <= z[used].min() and z[used].max() <= 1, "near and far clip something away"


def test_the_work_is_the_same_in_every_process(arrays):
    work = make_work("knot", True, Setup(size=SIZE, shading="phong", samples=4))
    work.save(arrays)
    again = peers_work.Work.load(arrays, Setup.from_json(work.setup.to_json()))
    assert again.setup == work.setup and again.is_textured
    for name in ("positions", "normals", "faces", "uv", "texels"):
        assert np.array_equal(getattr(again, name), getattr(work, name)), name
        assert getattr(again, name).dtype == getattr(work, name).dtype, name


@nightly
@pytest.mark.parametrize("name", peers_work.MESHES)
def test_generated_meshes_are_closed_and_their_normals_look_outwards(name):
    positions, faces, normals, _ = peers_work.MESHES[name]()
    place = np.round(positions, 5) + 0.0  # vertices that are there twice are one, and -0 is 0
    _, joined = np.unique(place, axis=0, return_inverse=True)
    a, b, c = joined.reshape(-1)[faces].astype(np.int64).T
    edges = np.concatenate([a << 32 | b, b << 32 | c, c << 32 | a])
    assert np.array_equal(np.sort(edges), np.sort((edges & 0xFFFFFFFF) << 32 | edges >> 32))
    assert np.allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-5)
    a, b, c = positions[faces].astype(float).transpose(1, 0, 2)
    assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), normals[faces[:, 0]]) > 0).all()


@nightly
def test_a_model_file_is_drawn_with_its_texture_and_its_texture_coordinates():
    work = make_work(str(ROOT / "models/globe.obj"), True, Setup(size=SIZE, shading="phong"))
    own = rz.load(ROOT / "models/globe.obj").meshes[0].palette[0].texture
    assert work.texels.shape == (*own.image.shape[:2], 3) and work.uv.shape == (len(work.positions), 2)
    decoded = rz.Texture(work.texels).image[..., :3]
    assert np.array_equal(decoded, own.image[..., :3])
    assert [level.shape for level in peers_work.mipmaps(work)] == [
        (*level.shape[:2], 3) for level in own.pyramid
    ]  # fmt: skip
    with pytest.raises(SystemExit, match="no texture coordinates"):
        make_work("cube", True, Setup(size=SIZE, shading="phong"))


@nightly
def test_our_picture_is_that_of_the_scene_that_others_bench():
    """The arrays lose nothing: as frame.py draws it, but for light and material."""
    work = make_work("torus", False, Setup(size=SIZE, shading="phong"))
    painter = Painter(work)
    painter.draw()
    scene = scenes.build("torus", SIZE)
    frame = rz.render(replace(scene, lights=painter.scene.lights, meshes=[
        replace(mesh, polygons=None, material=painter.scene.meshes[0].material) for mesh in scene.meshes
    ]), SIZE, shading="phong", cull="back", outputs=("rgb",), samples=1)  # fmt: skip
    levels = np.abs(frame.rgba.astype(int) - painter.rgba).max(axis=2)
    assert (levels > 1).sum() <= 3, f"{(levels > 1).sum()} pixels differ > 3"  # vertices in float32 move a silhouette


@nightly
@pytest.mark.parametrize("speck", SPECKS)
def test_a_speck_is_a_few_pixels_in_a_corner(speck):
    work = make_work("torus", False, Setup(size=(160, 120), shading="phong", threads=1))
    pictures = []
    for each in ("", speck):
        painter = Painter(replace(work, setup=replace(work.setup, speck=each)))
        painter.draw()
        pictures.append(painter.rgba.astype(int))
    rows, columns = np.nonzero((pictures[0] != pictures[1]).any(axis=2))
    assert len(rows) == SPECK**2 and rows.max() < 24 and columns.max() < 24


# ---------------------------------------------------------------- the comparison


def picture_of(level=100, shift=0):
    """A disc of one level on nothing, with its depth."""
    y, x = np.indices((60, 80))
    is_inside = (x - 40 - shift) ** 2 + (y - 30) ** 2 < 20**2
    rgba = np.where(is_inside[..., None], np.uint8([level, level, level, 255]), np.uint8(0))
    return {"rgba": rgba, "depth": np.where(is_inside, 5.0, np.inf).astype(np.float32)}


def test_pictures_are_compared_away_from_silhouettes():
    setup = Setup(size=(80, 60), shading="flat")
    same = peers_compare.compare(picture_of(), picture_of(), setup)
    assert same["max"] == 0 and same["rms"] == 0 and same["over_one"] == 0 and not peers_compare.warnings_of(same)
    # A disc a pixel further on the right differs in its silhouette alone, and covers as much.
    moved = peers_compare.compare(picture_of(), picture_of(shift=1), setup)
    assert moved["max"] == 0 and moved["covered"] == moved["covered_peer"] and moved["compared"] < same["compared"]
    brighter = peers_compare.compare(picture_of(), picture_of(level=103), setup)
    assert brighter["max"] == 3 and brighter["rms"] == 3.0 and brighter["over_one"] == 1.0
    assert "100.0% of the pixels differ by more than one level, up to 3" in peers_compare.warnings_of(brighter)[0]


def test_a_jump_of_depth_is_a_silhouette():
    setup = Setup(size=(80, 60), shading="flat")
    ours, peer = picture_of(), picture_of()
    ours["depth"][:, 45:] += np.float32(2.0)
    peer["rgba"][:, 45] += np.uint8([9, 9, 9, 0])  # where the peer sees the other surface
    found = peers_compare.compare(ours, peer, setup)
    assert found["max"] == 0, f"{found['max']} levels > 0"


def test_what_covers_otherwise_is_warned_of():
    empty = {"rgba": np.zeros((60, 80, 4), np.uint8)}
    found = peers_compare.compare(picture_of(), empty, Setup(size=(80, 60), shading="flat"))
    assert found["covered_peer"] == 0 and found["max"] is None
    assert len(peers_compare.warnings_of(found)) == 2


# ---------------------------------------------------------------- processes and the script


@nightly
def test_a_renderer_that_fails_says_why(arrays):
    work = make_work("cube", False, Setup(size=SIZE, shading="flat", threads=1))
    with pytest.raises(Failure, match="ours can't draw it: FileNotFoundError"):
        Process("ours", arrays, work.setup)
    work.save(arrays)
    with pytest.raises(Failure, match="SceneError: tolerance must be"):
        Process("ours", arrays, work.setup, {"tolerance": -1})


@nightly
def test_a_process_that_has_ended_is_a_failure(arrays):
    work = make_work("cube", False, Setup(size=SIZE, shading="flat", threads=1))
    work.save(arrays)
    with closing(Process("ours", arrays, work.setup)) as process:
        assert min(process.draw()) > 0 and process.picture()["rgba"].shape == (SIZE[1], SIZE[0], 4)
        process._process.kill()
        with pytest.raises(Failure, match="exit code -9"):
            process.draw()


def test_without_a_peer_the_script_says_how_to_install_it(monkeypatch, capsys):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert peers.main(["--cases", "textured", *QUICK]) == 0
    out = capsys.readouterr().out
    for peer in peers_process.PEERS:
        assert f"{peer} is left out: " in out and "pip install" in out
    assert json.loads(out.splitlines()[-1])["rows"] == []


@nightly
def test_specks(capsys):
    assert peers.main(["--cases", "specks", "--model", "torus", *QUICK]) == 0
    rows = json.loads(capsys.readouterr().out.splitlines()[-1])["rows"]
    assert [row["speck"] for row in rows[: len(SPECKS)]] == list(SPECKS)
    assert all(row["ratio"] > 0 and row["ratio_of_best"] > 0 and row["ratio_of_cpu"] > 0 for row in rows)


def test_options_are_numbers_or_words():
    assert peers.read_option("tolerance=0") == ("tolerance", 0)
    assert peers.read_option("antialias=shade-once") == ("antialias", "shade-once")


@nightly
@pytest.mark.parametrize("peer", peers_process.PEERS)
def test_a_peer_draws_the_same(peer, tmp_path, capsys):
    """Every shading, a texture, and four samples: as many pixels are covered, and colours are the same."""
    if peers_process.find_missing(peer):
        pytest.skip(peers_process.find_missing(peer))
    cases = ["textured", "model-512-gouraud", "model-1080p-flat", "model-1080p-phong", "model-1080p-phong-4"]
    arguments = ["--only", peer, "--cases", *cases, "--model", "torus", *QUICK, "--save", str(tmp_path)]
    assert peers.main(arguments) == 0
    out = capsys.readouterr().out
    rows = json.loads(out.splitlines()[-1])["rows"]
    if not rows:
        pytest.skip(next(line for line in out.splitlines() if "can't draw it" in line))
    assert len(list(tmp_path.glob("*.png"))) == len(rows) == (2 if peer == "tinydisplay" else len(cases))
    for row in rows:
        if peer == "tinydisplay":  # with vertices on whole pixels
            assert row["difference"] and abs(row["covered"] / row["covered_peer"] - 1) < 0.05, row
            continue
        assert abs(row["covered"] - row["covered_peer"]) <= 8, f"{row['covered']}, {row['covered_peer']}: {row['case']}"
        if not row["difference"]:
            assert row["over_one"] <= 0.01, f"{row['case']}: {row['over_one']:.2%} of the pixels differ > 1 %"
