"""Draw a work by Panda3D's software renderer, tinydisplay.

It lights vertices, with Blinn's reflection, has one sample a pixel, and draws with one thread: `adapt` asks for that on
both sides, and says what it does otherwise. Two of its ways are avoided:

- With a viewer that is near, its highlights lie further from where they belong than with one infinitely far away.
- Its flat shading is white. Corners of faces are lit instead, each with the normal of its face.
"""

from dataclasses import replace

import numpy as np
from panda3d import core

from bench import peers_work
from bench.peers_work import Setup, Unable, Work
from rasterizer.scene.color import linear_from_srgb

SETTINGS = "audio-library-name null\ncoordinate-system yup-right\nsync-video 0\n"
BACKGROUND = (1.0, 0.0, 1.0)  # a grey picture doesn't have it: it tells which pixels are covered
BACKGROUND_BYTES = (255, 0, 255)


class Painter:
    """Draw the same picture whenever asked to; `rgba` is the last one."""

    def __init__(self, work: Work):
        setup = work.setup
        core.load_prc_file_data("", SETTINGS)
        self.version = f"Panda3D {core.PandaSystem.get_version_string()}, tinydisplay"
        self.engine = core.GraphicsEngine.get_global_ptr()
        self.window = self._open(setup)
        self.copy = core.Texture()
        self.window.add_render_texture(self.copy, core.GraphicsOutput.RTM_copy_ram, core.GraphicsOutput.RTP_color)
        self.root = core.NodePath("root")
        mesh = self.root.attach_new_node(_make_mesh(work))
        mesh.set_material(_make_material(setup))
        mesh.set_two_sided(setup.cull == "none")
        if work.is_textured:
            mesh.set_texture(_make_texture(work))
        self._add_lights(setup)
        self._add_camera(setup)

    @staticmethod
    def adapt(work: Work) -> tuple[Setup, str]:
        """Return what both sides can draw alike, and what differs nevertheless.

        Raises Unable for Phong's shading, and several samples.
        """
        setup = work.setup
        if setup.shading == "phong":
            raise Unable("it lights vertices, never pixels")
        if setup.samples > 1:
            raise Unable("it has one sample a pixel")
        differences = ["1 thread, Blinn", "vertices on whole pixels", "affine colours", "viewer at infinity"]
        differences += ["faces lit at their corners"] if setup.shading == "flat" else []
        differences += ["8-bit linear texture, on highlights, too"] if work.is_textured else []
        return replace(setup, reflection="blinn", threads=1), "; ".join(differences)

    def _open(self, setup: Setup):
        """Make a picture in memory."""
        pipe = core.GraphicsPipeSelection.get_global_ptr().make_module_pipe("p3tinydisplay")
        if pipe is None:
            raise RuntimeError("this panda3d has no p3tinydisplay")
        wanted = core.FrameBufferProperties()
        wanted.set_rgba_bits(8, 8, 8, 8)
        wanted.set_depth_bits(24)
        wanted.set_srgb_color(True)
        size = core.WindowProperties.size(*setup.size)
        window = self.engine.make_output(pipe, "picture", 0, wanted, size, core.GraphicsPipe.BF_refuse_window)
        if window is None:
            raise RuntimeError("tinydisplay opens no picture in memory")
        window.set_clear_color((*BACKGROUND, 1.0))
        return window

    def _add_lights(self, setup: Setup) -> None:
        """Put the ambient and the directional light into the scene."""
        ambient = core.AmbientLight("ambient")
        ambient.set_color((*[setup.ambient] * 3, 1.0))
        self.root.set_light(self.root.attach_new_node(ambient))
        sun = core.DirectionalLight("sun")
        sun.set_color((*[setup.light] * 3, 1.0))
        sun.set_specular_color((*[setup.light] * 3, 1.0))
        sun.set_direction(core.LVector3(*(-np.array(setup.light_dir))))
        self.root.set_light(self.root.attach_new_node(sun))

    def _add_camera(self, setup: Setup) -> None:
        """Put the camera into the scene."""
        lens = core.PerspectiveLens()
        height = 2.0 * np.tan(np.radians(setup.fov) / 2.0)
        lens.set_film_size(height * setup.size[0] / setup.size[1], height)
        lens.set_focal_length(1.0)
        lens.set_near_far(setup.near, setup.far)
        camera = self.root.attach_new_node(core.Camera("camera", lens))
        rows = (*setup.right, 0, *setup.up, 0, *(-axis for axis in setup.forward), 0, *setup.eye, 1)
        camera.set_mat(core.LMatrix4(*rows))  # of row vectors: the camera's axes and its position in the world
        self.window.make_display_region().set_camera(camera)

    def draw(self) -> None:
        """Draw a frame, and read it into memory."""
        self.engine.render_frame()
        self.bytes = np.frombuffer(self.copy.get_ram_image(), np.uint8)

    @property
    def rgba(self) -> np.ndarray:
        """The last picture, (height, width, 4) uint8; alpha is 0 where nothing is."""
        bgra = self.bytes.reshape(self.copy.get_y_size(), self.copy.get_x_size(), -1)
        rgb = bgra[::-1, :, 2::-1]
        alpha = np.where((rgb == BACKGROUND_BYTES).all(axis=2), 0, 255).astype(np.uint8)
        return np.concatenate([np.where(alpha[..., None], rgb, 0), alpha[..., None]], axis=2).astype(np.uint8)


def _make_mesh(work: Work):
    """Load the mesh; with flat shading each face has corners of its own with its normal."""
    columns, faces = [work.positions, work.normals, work.uv], work.faces
    if work.setup.shading == "flat":
        corners = faces.ravel()
        _, normals = peers_work.face_points(work)
        columns = [
            work.positions[corners],
            normals.repeat(3, axis=0),
            work.uv[corners] if work.is_textured else work.uv,
        ]
        faces = np.arange(len(corners), dtype=np.uint32)
    layout = core.GeomVertexFormat.get_v3n3t2() if work.is_textured else core.GeomVertexFormat.get_v3n3()
    rows = np.concatenate([column for column in columns if len(column)], axis=1)
    data = core.GeomVertexData("mesh", layout, core.Geom.UH_static)
    data.unclean_set_num_rows(len(rows))
    memoryview(data.modify_array(0)).cast("B")[:] = np.ascontiguousarray(rows, np.float32).tobytes()
    triangles = core.GeomTriangles(core.Geom.UH_static)
    triangles.set_index_type(core.GeomEnums.NT_uint32)
    indices = triangles.modify_vertices()
    indices.unclean_set_num_rows(faces.size)
    memoryview(indices).cast("B")[:] = np.ascontiguousarray(faces, np.uint32).tobytes()
    geom = core.Geom(data)
    geom.add_primitive(triangles)
    node = core.GeomNode("mesh")
    node.add_geom(geom)
    return node


def _make_material(setup: Setup):
    """Make the material; Panda3D's ambient coefficient is of its own."""
    material = core.Material()
    material.set_ambient((*[setup.diffuse] * 3, 1.0))
    material.set_diffuse((*[setup.diffuse] * 3, 1.0))
    material.set_specular((*[setup.specular] * 3, 1.0))
    material.set_shininess(setup.shininess)
    material.set_local(False)  # the viewer is infinitely far away
    return material


def _make_texture(work: Work):
    """Load the texture in 8 bits of linear light, since tinydisplay knows no sRGB textures; it makes the mipmaps."""
    texture = core.Texture("texels")
    height, width = work.texels.shape[:2]
    texture.setup_2d_texture(width, height, core.Texture.T_unsigned_byte, core.Texture.F_rgb)
    linear = np.rint(255.0 * linear_from_srgb(work.texels / 255.0)).astype(np.uint8)
    texture.set_ram_image(np.ascontiguousarray(linear[::-1, :, ::-1]).tobytes())  # BGR, v grows upwards
    texture.set_minfilter(core.SamplerState.FT_linear_mipmap_linear)
    texture.set_magfilter(core.SamplerState.FT_linear)
    texture.set_wrap_u(core.SamplerState.WM_repeat)
    texture.set_wrap_v(core.SamplerState.WM_repeat)
    return texture
