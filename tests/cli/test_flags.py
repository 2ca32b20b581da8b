"""The flags of the command line: options, cameras, lights, and that each of them reaches the picture."""

import numpy as np
import pytest
from helpers.command import CUBE, loaded

import rasterizer as rz
from rasterizer import choices
from rasterizer.cli.parser import make_command_parser

pytestmark = pytest.mark.usefixtures("folder")


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


# --- what `raster render` has, other commands that draw have, too ------------------------------------------------

ARRAYS = "array scale min-opacity format colorbar seed"  # what writes pictures alone has no flags of arrays
LACKING = {
    "batch": "", "turntable": f"{ARRAYS} processes view", "sheet": f"{ARRAYS} processes",
    "demo": f"{ARRAYS} processes input-format recursive drop-bad-faces allow-outside",  # there is one model
    "compare": f"{ARRAYS} processes shading samples tolerance edges edge-color edge-width ground no-ground",
    "view": f"{ARRAYS} output size skip-existing processes json",  # pictures are shown, and as large as the page
}  # fmt: skip


def flags_of(name):
    actions = make_command_parser(name)._actions  # noqa: SLF001 - argparse has no public list
    return {flag for action in actions for flag in action.option_strings if flag.startswith("--")}


def test_a_command_that_draws_lacks_no_other_flag_of_render():
    for name, flags in LACKING.items():
        wrong = (flags_of("render") - flags_of(name)) ^ {f"--{flag}" for flag in flags.split()}
        assert not wrong, f"raster {name} lacks, or doesn't lack, {sorted(wrong)}"
