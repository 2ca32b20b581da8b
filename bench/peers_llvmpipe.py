"""Draw a work by OpenGL without a GPU: Mesa's llvmpipe, through moderngl and EGL. `worker.py` asks for it.

Shaders do what we do: ambient and directional light, Phong's reflection, once a vertex or a pixel. A picture of one
grey has one channel of light here, too. Of ways to write the same, the fastest is taken that was found:

- The shader encodes sRGB: a framebuffer that does takes up to 19 % longer.
- An exponent that is a power of two is written as multiplications: `pow` takes up to 35 % longer.
"""

import os

os.environ |= {"LIBGL_ALWAYS_SOFTWARE": "1", "GALLIUM_DRIVER": "llvmpipe"}  # Mesa draws without a GPU, if there is one

import moderngl
import numpy as np

from bench.worker import scene_of
from rasterizer.engine.points import gather_geometry
from rasterizer.scene.color import srgb_from_linear

GL_SRGB8_ALPHA8 = 0x8C43
# What a point reflects: x is multiplied by the texture, y isn't.
LIGHT = """#version 330
uniform vec3 eye; uniform vec3 light_dir; uniform float ambient; uniform float light;
uniform float diffuse; uniform float specular;
float power(float x) { x *= x; x *= x; x *= x; x *= x; x *= x; return x; }
vec2 reflected(vec3 p, vec3 normal) {
    float n_dot_l = dot(normal, light_dir);
    float cosine = dot(2.0 * n_dot_l * normal - light_dir, normalize(eye - p));
    float lit = n_dot_l > 0.0 ? light : 0.0;
    return vec2(diffuse * (ambient + lit * n_dot_l), lit * specular * power(max(cosine, 0.0)));
}
"""
VERTEX = """
uniform mat4 clip_from_world;
in vec3 position; in vec3 in_normal; in vec2 in_uv;
out vec3 p; out vec3 normal; out vec2 uv; out vec2 reflection;
void main() {
    gl_Position = clip_from_world * vec4(position, 1.0);
    LIGHT_VERTEX
    uv = in_uv;
}
"""
FRAGMENT = """
float encoded(float c) { return c > 0.0031308 ? 1.055 * pow(c, 1.0 / 2.4) - 0.055 : 12.92 * c; }
vec3 encoded(vec3 c) { return vec3(encoded(c.r), encoded(c.g), encoded(c.b)); }
uniform sampler2D texels;
in vec3 p; in vec3 normal; in vec2 uv; in vec2 reflection;
out vec4 color;
void main() {
    vec2 both = LIGHT_PIXEL;
    color = vec4(vec3(encoded(COLOR)), 1.0);
}
"""


class Painter:
    """Draw the same picture whenever asked to; `rgba` is the last one."""

    def __init__(self, work: dict):
        self.scene, size = scene_of(work), tuple(work["size"])
        scene = self.scene
        self.context = context = moderngl.create_context(standalone=True, backend="egl")
        self.version = "{GL_RENDERER}, {GL_VERSION}".format(**context.info)
        if "llvmpipe" not in self.version:
            raise RuntimeError(f"this OpenGL is {self.version}")
        is_phong, look = work["options"]["shading"] == "phong", scene.meshes[0].material
        words = {
            "LIGHT_VERTEX": "p = position; normal = in_normal;" if is_phong
                            else "reflection = reflected(position, in_normal);",
            "LIGHT_PIXEL": "reflected(p, normalize(normal))" if is_phong else "reflection",
            "COLOR": "both.x * texture(texels, uv).rgb + both.y" if look.texture else "both.x + both.y",
        }  # fmt: skip
        shaders = [LIGHT + VERTEX, LIGHT + FRAGMENT]
        for word, meaning in words.items():
            shaders = [text.replace(word, meaning) for text in shaders]
        self.program = context.program(*shaders)
        geometry = gather_geometry(scene.meshes, is_flat=False)
        points, faces = np.asarray(geometry.points, float), np.ascontiguousarray(geometry.corner.T, np.uint32)
        self._set_uniforms(scene, size, points[faces.ravel()], look)
        self._load(points, geometry, faces)
        if look.texture:
            self._make_texture(look.texture)
        color = context.texture(size, 4, internal_format=GL_SRGB8_ALPHA8)
        self.target = context.framebuffer(color, context.depth_renderbuffer(size))
        self.bytes = np.empty((size[1], size[0], 4), np.uint8)
        self.rgba = self.bytes[::-1]  # OpenGL's first row is the lowest one
        context.enable(moderngl.DEPTH_TEST | moderngl.CULL_FACE)

    def _set_uniforms(self, scene, size, points, look) -> None:
        """Give the shaders camera, light and material; depth goes from -1 to 1 over what is seen, y upwards."""
        camera, (ambient, sun) = scene.camera_for(size), scene.lights
        view = camera.view()
        distances = (points - view.eye) @ view.forward
        low, high = distances.min(), distances.max()
        margin = 0.01 * (high - low)  # so that rounding in float32 clips nothing away
        near, far = max(low - margin, 0.5 * low), high + margin
        axes = np.array([view.right, view.up, -view.forward])
        view_from_world, clip_from_view = np.eye(4), np.zeros((4, 4))
        view_from_world[:3, :3], view_from_world[:3, 3] = axes, -axes @ view.eye
        scale = 1.0 / np.tan(np.radians(camera.fov) / 2.0)
        clip_from_view[0, 0], clip_from_view[1, 1] = scale * size[1] / size[0], scale
        clip_from_view[2, 2:] = (near + far) / (near - far), 2.0 * near * far / (near - far)
        clip_from_view[3, 2] = -1.0
        to_light = -np.asarray(sun.direction, float) @ axes  # it is attached to the camera
        values = {
            "eye": tuple(view.eye), "light_dir": tuple(to_light / np.linalg.norm(to_light)),
            "ambient": float(np.mean(ambient.color)), "light": float(np.mean(sun.color)),
            "diffuse": float(np.mean(look.diffuse)), "specular": float(np.mean(look.specular)),
            "clip_from_world": tuple((clip_from_view @ view_from_world).T.ravel()),
        }  # fmt: skip
        for name, value in values.items():
            if name in self.program:
                self.program[name].value = value

    def _load(self, points, geometry, faces) -> None:
        """Load the mesh."""
        columns = {"position": points, "in_normal": geometry.normals, "in_uv": geometry.uv}
        used = {name: np.asarray(column, np.float32) for name, column in columns.items() if name in self.program}
        layout = " ".join(f"{column.shape[1]}f" for column in used.values())
        rows = self.context.buffer(np.ascontiguousarray(np.concatenate(list(used.values()), axis=1)))
        self.array = self.context.vertex_array(self.program, [(rows, layout, *used)], self.context.buffer(faces))

    def _make_texture(self, texture) -> None:
        """Load the texture and its mipmaps, means of linear light."""
        levels = [np.rint(255.0 * srgb_from_linear(level[..., :3].clip(0.0, 1.0))) for level in texture.pyramid]
        self.texture = self.context.texture(levels[0].shape[1::-1], 4, internal_format=GL_SRGB8_ALPHA8)
        self.texture.build_mipmaps()
        for k, level in enumerate(levels):
            opaque = np.dstack([level, np.full(level.shape[:2], 255)]).astype(np.uint8)
            self.texture.write(np.ascontiguousarray(opaque[::-1]), level=k)  # v grows upwards
        self.texture.filter = moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR
        self.texture.repeat_x = self.texture.repeat_y = True
        self.texture.use()

    def draw(self) -> None:
        """Draw a frame, and read it into memory."""
        self.target.use()
        self.context.clear()
        self.array.render()
        self.target.read_into(self.bytes, components=4)  # waits until everything is drawn
