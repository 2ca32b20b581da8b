"""`--edges`, `--edge-color`, `--edge-width`."""

import numpy as np
import pytest
from helpers.command import CUBE, one_error, run
from PIL import Image

import rasterizer as rz


def test_edges_are_drawn_in_their_colour_and_width(folder):
    assert run(CUBE, "-o", "plain.png", "-s", "60") == 0
    assert (
        run(
            CUBE,
            "-o",
            "edges.png",
            "-s",
            "60",
            "--edges",
            "crease,silhouette",
            "--edge-color",
            "red",
            "--edge-width",
            "3",
        )
        == 0
    )
    plain, edges = (np.asarray(Image.open(name).convert("RGBA")) for name in ("plain.png", "edges.png"))
    is_red = (edges == (255, 0, 0, 255)).all(axis=2)
    assert is_red.sum() > 300 and not (plain == (255, 0, 0, 255)).all(axis=2).any()
    assert run(CUBE, "-o", "wire.npy", "--edges", "all", "-s", "60") == 0
    assert np.load("wire.npy").shape == (60, 60, 3)


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (("--edges", "outline"), "one or several of wire, crease, silhouette, all"),
        (("--edges", ""), "one or several of wire"),
        (("--edge-width", "0"), "edge_width must be above 0 to 256 px; given 0"),
        (("--edge-width", "wide"), "a finite number is needed"),
        (("--edges", "all", "--edge-color", "blurple"), "blurple"),
    ],
)
def test_what_is_no_edge_is_a_usage_error(folder, capsys, flags, message):
    assert run(CUBE, *flags) == 2
    assert message in one_error(capsys) and not list(folder.iterdir())


def test_a_scene_file_may_ask_for_edges(folder):
    scene = rz.load(CUBE)
    scene.save("scene.json")
    import json

    content = json.loads((folder / "scene.json").read_text())
    content["options"] = {"edges": ["wire"], "edge_color": "#00ff00", "edge_width": 4}
    (folder / "scene.json").write_text(json.dumps(content))
    assert run("scene.json", "-o", "a.png", "-s", "40") == 0
    assert (np.asarray(Image.open("a.png").convert("RGBA")) == (0, 255, 0, 255)).all(axis=2).sum() > 100
