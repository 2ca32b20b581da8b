"""The flags of the command line: options, cameras, lights, and that the look reaches the picture."""

import inspect
import re
from dataclasses import dataclass, fields, replace
from typing import get_args

import numpy as np
import pytest
from helpers.command import CUBE, errors, picture, run
from helpers.raster import ROOT

import rasterizer as rz
from rasterizer import choices
from rasterizer.cli import arguments, defaults, help_texts, render_command
from rasterizer.cli.arguments import make_command_parser
from rasterizer.cli.commands import COMMANDS
from rasterizer.options import Options
from rasterizer.scene import light_presets, lights, material, mesh
from rasterizer.scene.fields import Cells, Color, Vector, describe_fields

pytestmark = pytest.mark.usefixtures("folder")


def test_every_option_is_a_flag():
    defaults = vars(arguments.parse(["render", "x.obj"]))
    for field in fields(Options):
        assert field.name in defaults
        # The first two depend on whether a picture or an array is written; a picture is to show highlights.
        if field.name not in ("samples", "outputs", "shading"):
            assert defaults[field.name] == field.default, field.name
    assert render_command.make_options(arguments.parse(["render", "x.obj"])) == Options(
        samples=4, outputs="rgb", shading="phong"
    )
    assert render_command.make_options(arguments.parse(["render", "x.obj", "--array", "face"])) == Options(
        outputs="face", shading="phong"
    )
    assert render_command.make_options(arguments.parse(["render", "x.obj", "-o", "x.npy"])) == Options(
        samples=1, shading="phong"
    )


def test_words_and_numbers_of_the_help_are_those_of_the_scene():
    framing = inspect.signature(rz.Camera.framing).parameters
    assert [framing[name].default for name in ("azimuth", "elevation", "fov")] == [
        defaults.AZIMUTH,
        defaults.ELEVATION,
        defaults.FOV,
    ]
    assert tuple(choices.AXES) == get_args(choices.Axis)
    assert choices.REFLECTIONS == tuple(material.REFLECTION_MODELS)
    assert choices.LIGHT_KINDS == tuple(lights.LIGHT_KINDS) and choices.PRESETS == tuple(light_presets.PRESETS)
    assert choices.WEIGHTINGS == mesh.WEIGHTINGS


def test_the_help_names_every_field_of_every_light():
    text = help_texts.RENDER
    for kind, cls in lights.LIGHT_KINDS.items():
        (line,) = re.findall(rf"^  {kind}:.*", text, re.MULTILINE)
        line += re.search(r"^  point:.*", text, re.MULTILINE)[0] if "as for point" in line else ""
        first, *names = describe_fields(cls)
        assert all(f"{name}=" in line for name in names), kind


def camera_of(*argv, aspect=1.5):
    """The camera that the arguments make for the cube."""
    from rasterizer.cli.cameras_lights import check_camera, make_camera

    parsed = arguments.parse(["render", CUBE, "-s", "300x200", *argv])
    check_camera(parsed)
    scene = rz.load(CUBE)
    view = parsed.views[0] if parsed.views else None
    return make_camera(parsed, view, scene, scene.bounds, parsed.up or "y")


@pytest.mark.parametrize(
    ("view", "forward"),
    [
        ("front", (0, 0, -1)),
        ("back", (0, 0, 1)),
        ("left", (1, 0, 0)),
        ("right", (-1, 0, 0)),
        ("top", (0, -1, 0)),
        ("bottom", (0, 1, 0)),
        ("iso", (-(3**-0.5), -(3**-0.5), -(3**-0.5))),
    ],
)
def test_views(view, forward):
    assert camera_of("--view", view).view().forward == pytest.approx(forward, abs=1e-12)
    assert set(defaults.VIEWS) == {"front", "back", "left", "right", "top", "bottom", "iso"}


def test_cameras():
    assert camera_of() == rz.Camera.framing(rz.load(CUBE), aspect=1.5)
    assert camera_of("--azimuth", "-30", "--elevation", "-10", "--fov", "50", "--up", "-z") == rz.Camera.framing(
        rz.load(CUBE), -30, -10, 50, "-z", aspect=1.5
    )
    assert camera_of("--view", "left", "--elevation", "5") == rz.Camera.framing(rz.load(CUBE), -90, 5, aspect=1.5)
    assert camera_of("--eye", "-3,2,4", "--fov", "40") == rz.Camera.perspective((-3, 2, 4), fov=40)
    eye = camera_of("--eye", "0,0,4", "--target", "-.5,0,0", "--up", "x", "--fov", "60")
    assert eye == rz.Camera.perspective((0, 0, 4), (-0.5, 0, 0), "x", 60)


@pytest.mark.parametrize("lens", [[], ["--ortho"]])
@pytest.mark.parametrize("place", [[], ["--eye", "3,2,5"]])
def test_zoom_enlarges(lens, place):
    wide, near = camera_of(*lens, *place), camera_of(*lens, *place, "--zoom", "2.5")
    assert near.position == wide.position and wide.is_perspective == (not lens)
    assert near.projection((300, 200)).scale_y == pytest.approx(2.5 * wide.projection((300, 200)).scale_y)


def test_orthographic_keeps_the_size_of_the_target():
    place = ["--eye", "3,2,5", "--target", "0,1,0"]
    with_perspective, without = camera_of(*place), camera_of(*place, "--ortho")
    distance = np.linalg.norm(np.subtract((3, 2, 5), (0, 1, 0)))
    assert without.projection((300, 200)).scale_y == pytest.approx(
        with_perspective.projection((300, 200)).scale_y / distance
    )


def lights_of(*argv):
    from rasterizer.cli.cameras_lights import make_lights

    return make_lights(arguments.parse(["render", CUBE, *argv]))


def test_lights():
    assert lights_of() is None and lights_of("--preset", "studio") == rz.studio()
    assert lights_of("--preset", "headlight") == rz.headlight()
    assert lights_of("--light", "ambient:0.2") == (rz.AmbientLight(0.2),)
    assert lights_of("--light", "ambient:color=#fff") == (rz.AmbientLight(1.0),)
    assert lights_of("--preset", "headlight", "--light", "ambient:1/0.5/0") == (
        *rz.headlight(),
        rz.AmbientLight((1, 0.5, 0)),
    )
    assert lights_of("--light", "directional:-1,-1,0,color=orange,attached=camera") == (
        rz.DirectionalLight((-1, -1, 0), "orange", "camera"),
    )
    assert lights_of(
        "--light",
        "spot:1,2,3,direction=0/-1/0,inner=10,outer=20,exponent=2,falloff=.5,attenuation=1/d^2,range=9,amplify=yes",
    ) == (rz.SpotLight((1, 2, 3), (0, -1, 0), 1, 10, 20, 2, "1/d^2", "world", True, 9, falloff=0.5),)  # fmt: skip
    assert lights_of(
        "--light", "area:1,2,3,edge_u=1/0/0,edge_v=0/0/-1,resolution=8/4,attenuation=1/(d+2),color=0.5"
    ) == (rz.AreaLight((1, 2, 3), (1, 0, 0), (0, 0, -1), 0.5, (8, 4), (2, 1, 0)),)
    assert lights_of("--light", "point:1,2,3", "--light", "point:1,2,3,attenuation=1/0.5/.25,color=3e-1") == (
        rz.PointLight((1, 2, 3)),
        rz.PointLight((1, 2, 3), 0.3, (1, 0.5, 0.25)),
    )


def test_the_look_reaches_the_picture(capsys):
    looks = {
        "default": [],
        "flat": ["--shading", "flat"],
        "crease": ["--crease-angle", "1"],
        "blinn": ["--reflection", "blinn", "--preset", "studio"],
        "studio": ["--preset", "studio"],
        "no ground": ["--no-ground"],
        "gouraud": ["--shading", "gouraud"],
        "light": ["--light", "directional:0,-1,0"],
        "background": ["--background", "0.2/0.1/0"],
        "samples": ["--samples", "1"],
    }
    torus = ROOT / "models" / "torus.obj"
    for name, flags in looks.items():
        assert run(torus, "-o", f"{name}.png", *flags) == 0
    assert errors(capsys) == ""
    assert len({picture(f"{name}.png").tobytes() for name in looks}) == len(looks)
    scene = rz.load(torus)
    mesh = scene.meshes[0]
    scene = replace(scene, meshes=[replace(mesh, material=replace(mesh.material, reflection="blinn"))])
    assert np.array_equal(picture("blinn.png"), rz.render(scene, (24, 16), shading="phong", samples=4))
    corner = picture("background.png")[0, 0].tolist()
    assert corner == rz.render(rz.load(CUBE, background=(0.2, 0.1, 0)), 8, samples=1).rgb[0, 0].tolist()


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
    assert run(CUBE, "--light", "slab:1,2,3,extent=2/3") == 2
    assert "area:...; given 'slab:" in errors(capsys)
    monkeypatch.setitem(lights.LIGHT_KINDS, "slab", Slab)
    text = "slab:1,2,3,extent=2/3,color=rgb(255, 0, 0),is_soft=yes,shadow=64"
    assert lights_of("--light", text) == (Slab((1, 2, 3), (2, 3), 1.0, "rgb(255, 0, 0)", True, rz.Shadow(64)),)
    for text, words in (
        ("slab:1,2,3", "a slab light needs extent=M/N"),
        ("slab:1,2,3,extent=2/3,strength=big", "strength: a finite number is needed; given 'big'"),
        ("slab:1,2,3,size=3", "a slab light takes corner=..., extent=..., strength=..."),
    ):
        assert run(CUBE, "--light", text) == 2 and words in errors(capsys)


# --- what `raster render` has, other commands that draw have, too ------------------------------------------------

NO_ARRAYS = {"--array": "it writes pictures", "--scale": "of arrays"}
ONE_PROCESS = {"--processes": "one model follows the other: `raster batch` draws in several"}
SHOWN_ELSEWHERE = {"--preview": "a terminal is too small for what it makes"}
LACKING = {
    "batch": {"--preview": "its processes have no terminal"},
    "turntable": NO_ARRAYS | ONE_PROCESS | SHOWN_ELSEWHERE | {"--view": "--azimuth says where it begins"},
    "sheet": NO_ARRAYS | ONE_PROCESS | SHOWN_ELSEWHERE,
    "demo": NO_ARRAYS | dict.fromkeys(("--processes", "--input-format", "--recursive"), "there is one model"),
    "compare": NO_ARRAYS
    | ONE_PROCESS
    | SHOWN_ELSEWHERE
    | dict.fromkeys(("--shading",), "--methods says it")
    | dict.fromkeys(("--samples", "--antialias"), "methods are compared on one sample a pixel")
    | {"--tolerance": "methods are compared as exact as they are"}
    | dict.fromkeys(("--edges", "--edge-color", "--edge-width"), "it compares how surfaces are shaded")
    | dict.fromkeys(("--ground", "--no-ground"), "it compares how surfaces are shaded"),
    "view": NO_ARRAYS
    | dict.fromkeys(("--output", "--size", "--skip-existing"), "its pictures are shown, and as large as the page")
    | dict.fromkeys(("--processes", "--json", "--preview"), "there is one model, and a page")
    | dict.fromkeys(("--ground", "--no-ground"), "what is turned by hand is seen from below, too"),
}  # fmt: skip


def flags_of(name):
    actions = make_command_parser(COMMANDS[name])._actions
    return {flag for action in actions for flag in action.option_strings if flag.startswith("--")}


@pytest.mark.parametrize("name", LACKING)
def test_a_command_that_draws_lacks_a_flag_of_render_only_for_a_reason(name):
    assert flags_of("render") - flags_of(name) == set(LACKING[name])
