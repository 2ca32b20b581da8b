"""The flags of the command line: options, cameras, lights, and that each of them reaches the picture."""

import inspect
import re
from dataclasses import dataclass, fields, replace
from typing import get_args

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.command import CUBE, PLAIN, assert_refused, errors, loaded, picture, request_of, run
from helpers.raster import ROOT

import rasterizer as rz
from rasterizer import choices
from rasterizer.choices import AZIMUTH, ELEVATION, FOV
from rasterizer.cli.parser import make_command_parser, parse
from rasterizer.options import Options
from rasterizer.scene import lights, material, mesh
from rasterizer.scene import lights as light_presets
from rasterizer.scene.lights import Cells, Color, Vector, describe_fields

pytestmark = pytest.mark.usefixtures("folder")


def test_every_option_is_a_flag():
    assert {field.name for field in fields(Options)} <= vars(parse(["render", "x.obj"])).keys()
    for argv, expected in (
        ([], {"outputs": "rgb"}),
        (["--array", "face"], {"outputs": "face"}),
        (["-o", "x.npy"], {"outputs": "color"}),
    ):
        found = request_of("x.obj", *argv).options
        assert found == Options(**expected), f"{argv}: {found}"


def test_words_and_numbers_of_the_help_are_those_of_the_scene():
    framing = inspect.signature(rz.Camera.framing).parameters
    numbers = [framing[name].default for name in ("azimuth", "elevation", "fov")]
    assert numbers == [AZIMUTH, ELEVATION, FOV]
    assert tuple(choices.AXES) == get_args(choices.Axis)
    assert choices.REFLECTIONS == tuple(material.REFLECTION_MODELS) and choices.WEIGHTINGS == mesh.WEIGHTINGS
    assert choices.DISTRIBUTIONS == material.DISTRIBUTIONS
    assert choices.LIGHT_TYPES == tuple(lights.LIGHT_TYPES) and choices.PRESETS == tuple(light_presets.PRESETS)
    text = make_command_parser("render").format_help()
    for kind, cls in lights.LIGHT_TYPES.items():
        (line,) = re.findall(rf"^ +{kind}:.*(?:\n {{10}}.*)*", text, re.MULTILINE)
        if "as for point" in line:
            line += re.search(r"^ +point:.*(?:\n {10}.*)*", text, re.MULTILINE)[0]
        first, *names = describe_fields(cls)
        assert all(f"{name}=" in line for name in names), kind


# --- cameras and lights ---------------------------------------------------------------------------------------------


def camera_of(*argv):
    """The camera that the arguments make for the cube."""
    found = loaded(CUBE, "-s", "300x200", *argv)
    return found.request.camera_of(found.request.views[0], found.scene)


def test_cameras():
    cube, steep = rz.load(CUBE), 3**-0.5
    forwards = {
        "front": (0, 0, -1), "back": (0, 0, 1), "left": (1, 0, 0), "right": (-1, 0, 0), "top": (0, -1, 0),
        "bottom": (0, 1, 0), "iso": (-steep, -steep, -steep),
    }  # fmt: skip
    assert set(choices.VIEWS) == set(forwards)
    for view, forward in forwards.items():
        found = camera_of("--view", view).view().forward
        assert found == pytest.approx(forward, abs=1e-12), f"--view {view} looks along {found}"
    for argv, expected in (
        ("", rz.Camera.framing(cube, aspect=1.5)),
        ("--azimuth -30 --elevation -10 --fov 50 --up -z", rz.Camera.framing(cube, -30, -10, 50, "-z", aspect=1.5)),
        ("--view left --elevation 5", rz.Camera.framing(cube, -90, 5, aspect=1.5)),
        ("--margin 20% --ortho", rz.Camera.framing(cube, margin=0.2, orthographic=True, aspect=1.5)),
        ("--eye -3,2,4 --fov 40", rz.Camera.perspective((-3, 2, 4), fov=40)),
        ("--eye 0,0,4 --target -.5,0,0 --up x --fov 60", rz.Camera.perspective((0, 0, 4), (-0.5, 0, 0), "x", 60)),
    ):
        assert (got := camera_of(*argv.split())) == expected, f"{argv}: {got} != {expected}"


def test_zoom_enlarges_and_orthographic_keeps_the_size_of_the_target():
    def scale(*argv):
        return camera_of(*argv).projection((300, 200)).scale_y

    for flags in ([], ["--ortho"], ["--eye", "3,2,5"], ["--ortho", "--eye", "3,2,5"]):
        wide, near = camera_of(*flags), camera_of(*flags, "--zoom", "2.5")
        assert near.position == wide.position and wide.is_perspective == ("--ortho" not in flags), flags
        assert scale(*flags, "--zoom", "2.5") == pytest.approx(2.5 * scale(*flags)), flags
    place = ["--eye", "3,2,5", "--target", "0,1,0"]
    assert scale(*place, "--ortho") == pytest.approx(scale(*place) / np.linalg.norm((3, 1, 5)))


def lights_of(*argv):
    return loaded(CUBE, *argv).scene.lights


def test_lights():
    spot = "spot:1,2,3,direction=0/-1/0,inner=10,outer=20,exponent=2,falloff=.5,attenuation=1/d^2,range=9,amplify=yes"
    area = "area:1,2,3,edge_u=1/0/0,edge_v=0/0/-1,resolution=8/4,attenuation=1/(d+2),color=0.5"
    for text, expected in (
        ("ambient:0.2", rz.AmbientLight(0.2)),
        ("ambient:color=#fff", rz.AmbientLight(1.0)),
        ("directional:-1,-1,0,color=orange,attached=camera", rz.DirectionalLight((-1, -1, 0), "orange", "camera")),
        (spot, rz.SpotLight((1, 2, 3), (0, -1, 0), 1, 10, 20, 2, "1/d^2", "world", True, 9, falloff=0.5)),
        (area, rz.AreaLight((1, 2, 3), (1, 0, 0), (0, 0, -1), 0.5, (8, 4), (2, 1, 0))),
        ("point:1,2,3", rz.PointLight((1, 2, 3))),
        ("point:1,2,3,attenuation=1/0.5/.25,color=3e-1", rz.PointLight((1, 2, 3), 0.3, (1, 0.5, 0.25))),
    ):
        assert (got := lights_of("--light", text)) == (expected,), f"{text}: {got} != {(expected,)}"
    assert lights_of() == lights_of("--preset", "studio") == rz.studio()
    both = lights_of("--preset", "headlight", "--light", "ambient:1/0.5/0", "--light", "point:1,2,3")
    assert both == (*rz.headlight(), rz.AmbientLight((1, 0.5, 0)), rz.PointLight((1, 2, 3)))


@dataclass(frozen=True)
class Slab:
    """A light that is no kind of the package."""

    corner: Vector
    extent: Cells
    strength: float = 1.0
    color: Color = 1.0
    is_soft: bool = False
    shadow: rz.Shadow | None = None


def test_a_kind_of_light_that_is_added_can_be_written_at_once(monkeypatch, capsys):
    assert_refused(capsys, [([CUBE, "--light", "slab:1,2,3,extent=2/3"], "area:...; given 'slab:")], "render")
    monkeypatch.setitem(lights.LIGHT_TYPES, "slab", Slab)
    text = "slab:1,2,3,extent=2/3,color=rgb(255, 0, 0),is_soft=yes,shadow=64"
    assert lights_of("--light", text) == (Slab((1, 2, 3), (2, 3), 1.0, "rgb(255, 0, 0)", True, rz.Shadow(64)),)
    faults = {
        "slab:1,2,3": "a slab light needs extent=M/N",
        "slab:1,2,3,extent=2/3,strength=big": "strength: a finite number is needed; given 'big'",
        "slab:1,2,3,size=3": "a slab light takes corner=..., extent=..., strength=...",
    }
    assert_refused(capsys, [([CUBE, "--light", text], words) for text, words in faults.items()], "render")


# --- what reaches the picture ---------------------------------------------------------------------------------------

# A small size, because each is drawn; every two must differ.
LOOKS = """
--shading flat | --shading gouraud | --samples 1 | --ground
--crease-angle 1 | --material shininess=2 | --color orange | --reflection blinn
--preset tabletop | --preset headlight | --light directional:0,-1,0,color=orange --color teal
--light directional:0,-1,0,color=orange --color teal --spectral 5 | --light directional:-1,-0.4,-0.2
--light directional:-1,-0.4,-0.2 --shadows | --light directional:-1,-0.4,-0.2 --shadows --shadow-size 16
--light directional:-1,-0.4,-0.2 --shadows --shadow-filter 9 | --background 0.2/0.1/0 | --depth-cue 2
--exposure 1.5 | --exposure 3 --color teal | --exposure 3 --color teal --color-range local
--exposure 3 --color teal --color-range global | --threads 2 --margin 0.2
--eye 1,0,0 --target 1,0,5 | --eye 1,0,0 --target 1,0,5 --cull back
--edges all | --edges all --edge-color red | --edges all --edge-width 3 | --zoom 2 | --ortho | --fov 60
--azimuth 70 | --elevation 60 | --view top | --up z | --eye 3,2,4 | --eye 3,2,4 --target 0,0.5,0
"""


def test_every_flag_of_the_look_changes_the_picture(capsys):
    looks, drawn = ["", *(each.strip() for each in LOOKS.replace("\n", "|").split("|") if each.strip())], {}
    for look in looks:
        assert run(ROOT / "models" / "torus.obj", "-o", "x.png", "-s", "48x36", *look.split()) == 0
        other = drawn.setdefault(picture("x.png").tobytes(), look)
        assert other is look, f"'{look}' draws what '{other}' draws"
    capsys.readouterr()


def test_materials_and_backgrounds_are_those_of_the_library(capsys):
    scene = rz.load(CUBE, background=(0.2, 0.1, 0))
    (cube,) = scene.meshes
    scene = replace(scene, meshes=[replace(cube, material=replace(cube.material, reflection="blinn"))])
    assert run(CUBE, "-o", "x.png", *PLAIN, "--reflection", "blinn", "--background", "0.2/0.1/0") == 0
    assert not differences(picture("x.png"), rz.render(scene, (24, 16), samples=4, shading="gouraud").rgb)
    assert errors(capsys) == ""


def test_edges_are_drawn_in_their_colour_and_width(capsys):
    flags = ["-s", "60", "--edges", "crease,silhouette", "--edge-color", "red", "--edge-width", "3"]
    assert run(CUBE, "-o", "edges.png", *flags) == 0
    assert (picture("edges.png") == (255, 0, 0, 255)).all(axis=2).sum() > 300
    assert run(CUBE, "-o", "wire.npy", "--edges", "all", "-s", "60") == 0
    assert np.load("wire.npy").shape == (60, 60, 3) and errors(capsys) == ""


# --- what `raster render` has, other commands that draw have, too ------------------------------------------------

NO_ARRAYS = {
    "--array": "it writes pictures",
    "--scale": "of arrays",
    "--min-opacity": "of arrays",
    "--colorbar": "it stands beside a picture alone",
    "--seed": "datasets are made by render and batch",
}
ONE_PROCESS = {"--processes": "one model follows the other: `raster batch` draws in several"}
LACKING = {
    "batch": {},
    "turntable": NO_ARRAYS | ONE_PROCESS | {"--view": "--azimuth says where it begins"},
    "sheet": NO_ARRAYS | ONE_PROCESS,
    "demo": NO_ARRAYS | dict.fromkeys(("--processes", "--input-format", "--recursive"), "there is one model"),
    "compare": NO_ARRAYS
    | ONE_PROCESS
    | dict.fromkeys(("--shading",), "--methods says it")
    | dict.fromkeys(("--samples",), "methods are compared on one sample a pixel")
    | {"--tolerance": "methods are compared as exact as they are"}
    | dict.fromkeys(("--edges", "--edge-color", "--edge-width"), "it compares how surfaces are shaded")
    | dict.fromkeys(("--ground", "--no-ground"), "it compares how surfaces are shaded"),
    "view": NO_ARRAYS
    | dict.fromkeys(("--output", "--size", "--skip-existing"), "its pictures are shown, and as large as the page")
    | dict.fromkeys(("--processes", "--json"), "there is one model, and a page")
}  # fmt: skip


def flags_of(name):
    actions = make_command_parser(name)._actions  # noqa: SLF001 - argparse has no public list
    return {flag for action in actions for flag in action.option_strings if flag.startswith("--")}


def test_a_command_that_draws_lacks_a_flag_of_render_only_for_a_reason():
    for name, reasons in LACKING.items():
        found = flags_of("render") - flags_of(name)
        assert found == set(reasons), f"raster {name} lacks {sorted(found ^ set(reasons))}"
