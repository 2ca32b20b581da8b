"""bench/peers.py compares what is the same work: everybody gets the same arrays, and draws the same picture.

Peers that aren't installed, or find no driver, are left out here as there. What starts processes runs at night.
"""

import importlib.util
import json

import numpy as np
import pytest

import rasterizer as rz
from bench import peers, peers_compare, peers_process, peers_work
from bench.peers_ours import SPECK, SPECKS, Painter
from bench.peers_process import Failure, Process
from bench.peers_work import Setup, make_work

SIZE = (96, 72)
QUICK = ["--pairs", "1", "--frames", "3", "--seconds", "0.01", "--size", "96x72", "--threads", "1"]


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
    assert -1 <= z.min() and z.max() <= 1, "near and far clip something away"


def test_the_work_is_the_same_in_every_process(tmp_path):
    work = make_work("knot", True, Setup(size=SIZE, shading="phong", samples=4))
    work.save(tmp_path / "work.npz")
    again = peers_work.Work.load(tmp_path / "work.npz", Setup.from_json(work.setup.to_json()))
    assert again.setup == work.setup and again.is_textured
    for name in ("positions", "normals", "faces", "uv", "texels"):
        assert np.array_equal(getattr(again, name), getattr(work, name)), name
        assert getattr(again, name).dtype == getattr(work, name).dtype, name


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
    ours, peer = picture_of(), picture_of()
    ours["depth"][:, 45:] += np.float32(2.0)
    peer["rgba"][:, 45] += np.uint8([9, 9, 9, 0])  # where the peer sees the other surface
    found = peers_compare.compare(ours, peer, setup)
    assert found["max"] == 0, f"a jump of depth is a silhouette: {found['max']} levels > 0"
    found = peers_compare.compare(picture_of(), {"rgba": np.zeros((60, 80, 4), np.uint8)}, setup)
    assert found["covered_peer"] == 0 and found["max"] is None and len(peers_compare.warnings_of(found)) == 2


def test_without_a_peer_the_script_says_how_to_install_it(monkeypatch, capsys):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)  # nothing is installed
    assert peers.main(["--cases", "textured", *QUICK]) == 0
    out = capsys.readouterr().out
    for peer in peers_process.PEERS:
        assert f"{peer} is left out: " in out and "pip install" in out
    assert json.loads(out.splitlines()[-1])["rows"] == []


@pytest.mark.nightly
def test_a_renderer_that_fails_says_why(tmp_path):
    work = make_work("cube", False, Setup(size=SIZE, shading="flat", threads=1))
    with pytest.raises(Failure, match="ours can't draw it: FileNotFoundError"):
        Process("ours", tmp_path / "work.npz", work.setup)
    work.save(tmp_path / "work.npz")
    with pytest.raises(Failure, match="SceneError: tolerance must be"):
        Process("ours", tmp_path / "work.npz", work.setup, {"tolerance": -1})


@pytest.mark.nightly
def test_specks_are_a_few_pixels_in_a_corner(capsys):
    pictures = {}
    for speck in ("", *SPECKS):
        painter = Painter(make_work("torus", False, Setup(size=(160, 120), shading="phong", threads=1, speck=speck)))
        painter.draw()
        pictures[speck] = painter.rgba.astype(int)
        rows, columns = np.nonzero((pictures[""] != pictures[speck]).any(axis=2))
        assert not speck or (len(rows) == SPECK**2 and rows.max() < 24 and columns.max() < 24), speck
    assert peers.main(["--cases", "specks", "--model", "torus", *QUICK]) == 0
    rows = json.loads(capsys.readouterr().out.splitlines()[-1])["rows"]
    assert {row["speck"] for row in rows} == set(SPECKS)
    assert all(row["ratio"] > 0 and row["ratio_of_best"] > 0 and row["ratio_of_cpu"] > 0 for row in rows)


@pytest.mark.nightly
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
