"""Draw a work by this package, from the same arrays as the others."""

from dataclasses import replace

import numpy as np

import rasterizer as rz
from bench.peers_work import Setup, Work

SPECK = 16  # pixels along a side: 256 of the picture's two million at 1080p
# What a speck in a corner of the picture is made of; "plain" is what the mesh is made of.
SPECKS = {
    "plain": {},
    "textured": {"texture": np.tile(np.uint8([[255, 128], [128, 255]]), (32, 32))},
    "glass": {"opacity": 0.5},
    "toon": {"reflection": "toon"},
    "coloured": {"diffuse": (0.8, 0.5, 0.3)},
}


class Painter:
    """Draw the same picture whenever asked to; `rgba` is the last one."""

    def __init__(self, work: Work, **options):
        self.work, self.options = (
            work,
            {key: getattr(work.setup, key) for key in ("size", "shading", "samples", "cull")},
        )
        self.options |= {"threads": work.setup.threads} | options
        self.scene = _make_scene(work)
        self.renderer = rz.Renderer(self.scene, outputs=("rgb",), **{"samples": 1} | self.options)
        self.version = f"rasterizer {rz.__version__}"

    @staticmethod
    def adapt(work: Work) -> tuple[Setup, str]:
        """Return what is drawn: all of it."""
        return work.setup, ""

    def draw(self) -> None:
        """Draw a frame."""
        self.frame = self.renderer.render()

    @property
    def rgba(self) -> np.ndarray:
        """The last picture, (height, width, 4) uint8."""
        return self.frame.rgba

    @property
    def depth(self) -> np.ndarray:
        """Distances along the view in the centres of pixels, (height, width) float32."""
        return rz.render(self.scene, outputs=("depth",), **{"samples": 1} | self.options).depth


def _make_scene(work: Work) -> rz.Scene:
    """Make the scene, and the speck where one is asked for."""
    setup = work.setup
    texture = (
        {
            "texture": rz.Texture(work.texels),
        }
        if work.is_textured
        else {}
    )
    look = rz.Material(diffuse=setup.diffuse, specular=setup.specular, shininess=setup.shininess,
                       reflection=setup.reflection)  # fmt: skip
    uv = {"uv": work.uv} if work.is_textured else {}
    meshes = [rz.Mesh(work.positions, work.faces, work.normals, material=replace(look, **texture), **uv)]
    if setup.speck:
        meshes.append(_make_speck(setup, replace(look, **{"ambient": None} | SPECKS[setup.speck])))
    lights = [rz.AmbientLight(setup.ambient),
              rz.DirectionalLight([-axis for axis in setup.light_dir], setup.light)]  # fmt: skip
    target = np.array(setup.eye) + np.array(setup.forward)
    camera = rz.Camera.perspective(setup.eye, target=target, up=setup.up, fov=setup.fov)
    return rz.Scene(meshes, lights, camera)


def _make_speck(setup: Setup, material: rz.Material) -> rz.Mesh:
    """Make a square of SPECK pixels in the upper left corner, as far away as the middle of the scene."""
    distance = 0.5 * (setup.near + setup.far)
    pixel = 2.0 * distance * np.tan(np.radians(setup.fov) / 2.0) / setup.size[1]  # its width there, scene units
    eye, right, up, forward = (np.array(axis) for axis in (setup.eye, setup.right, setup.up, setup.forward))
    corner = (
        eye + distance * forward - pixel * (0.5 * setup.size[0] - 4) * right + pixel * (0.5 * setup.size[1] - 4) * up
    )
    side = SPECK * pixel
    vertices = [corner, corner - side * up, corner + side * (right - up), corner + side * right]
    normals = np.tile(-forward, (4, 1))
    return rz.Mesh(vertices, [[0, 1, 2], [0, 2, 3]], normals, uv=[[0, 1], [0, 0], [1, 0], [1, 1]], material=material)
