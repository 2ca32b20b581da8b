"""Draw a work by OpenGL without a GPU: Mesa's llvmpipe, through moderngl and EGL.

Shaders do what we do: ambient and directional light, Phong's or Blinn's reflection, once a face, a vertex or a pixel.
A picture of one grey has one channel of light here, too. Of ways to write the same, the fastest is taken that was
found:

- The shader encodes sRGB where a pixel has one sample: a framebuffer that does takes up to 19 % longer. With more
  samples it is the framebuffer, so that they are averaged as linear light.
- An exponent that is a power of two is written as multiplications: `pow` takes up to 35 % longer.
"""

import math

import moderngl
import numpy as np

from bench import peers_work
from bench.peers_work import Setup, Work

GL_SRGB8_ALPHA8 = 0x8C43
GL_FRAMEBUFFER_SRGB = 0x8DB9

# What a point reflects: x is multiplied by the texture, y isn't.
LIGHT = """#version VERSION
uniform vec3 eye; uniform vec3 light_dir; uniform float ambient; uniform float light;
uniform float diffuse; uniform float specular; uniform float shininess;
POWER
vec2 reflected(vec3 p, vec3 normal) {
    float n_dot_l = dot(normal, light_dir);
    vec3 view_dir = normalize(eye - p);
    float cosine = COSINE;
    float lit = n_dot_l > 0.0 ? light : 0.0;
    return vec2(diffuse * (ambient + lit * n_dot_l), lit * specular * power(max(cosine, 0.0)));
}
"""
COSINES = {"phong": "dot(2.0 * n_dot_l * normal - light_dir, view_dir)",
           "blinn": "dot(normal, normalize(light_dir + view_dir))"}  # fmt: skip
VERTEX = """
uniform mat4 clip_from_world;
in vec3 position; in vec3 in_normal; in vec2 in_uv; in vec3 in_center;
EACH out vec3 p; EACH out vec3 normal; EACH out vec2 uv; EACH FLAT out vec2 reflection;
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
EACH in vec3 p; EACH in vec3 normal; EACH in vec2 uv; EACH FLAT in vec2 reflection;
out vec4 color;
void main() {
    vec2 both = LIGHT_PIXEL;
    color = vec4(vec3(COLOR), 1.0);
}
"""


class Painter:
    """Draw the same picture whenever asked to; `rgba` is the last one."""

    def __init__(self, work: Work):
        setup = work.setup
        self.context = context = moderngl.create_context(standalone=True, backend="egl")
        self.version = "{GL_RENDERER}, {GL_VERSION}".format(**context.info)
        if "llvmpipe" not in self.version:
            raise RuntimeError(f"this OpenGL is {self.version}")
        self.program = context.program(*_shaders(work))
        _set_uniforms(self.program, setup)
        self.array = self._make_array(work)
        if work.is_textured:
            self._make_texture(work)
        self.target, self.picture = self._make_targets(setup)
        self.bytes = np.empty((setup.size[1], setup.size[0], 4), np.uint8)
        self.rgba = self.bytes[::-1]  # OpenGL's first row is the lowest one
        context.enable(moderngl.DEPTH_TEST)
        if setup.samples > 1:
            context.enable_direct(GL_FRAMEBUFFER_SRGB)
        if setup.cull == "back":
            context.enable(moderngl.CULL_FACE)

    @staticmethod
    def adapt(work: Work) -> tuple[Setup, str]:
        """Return what both sides can draw alike, and what differs nevertheless."""
        setup = work.setup
        differences = ["other sample positions"] if setup.samples > 1 else []
        differences += ["light and texture once a pixel"] if differences and not setup.is_lit_per_sample else []
        return setup, "; ".join(differences)

    def _make_array(self, work: Work):
        """Load the mesh; with flat shading each face has corners of its own, and its centroid and normal."""
        columns = {"position": work.positions, "in_normal": work.normals, "in_uv": work.uv}
        faces = work.faces
        if work.setup.shading == "flat":
            corners = faces.ravel()
            centers, normals = peers_work.face_points(work)
            columns = {"position": work.positions[corners], "in_uv": work.uv[corners] if work.is_textured else work.uv,
                       "in_normal": normals.repeat(3, axis=0), "in_center": centers.repeat(3, axis=0)}  # fmt: skip
            faces = np.arange(len(corners), dtype=np.uint32)
        used = {name: column for name, column in columns.items() if name in self.program}
        rows = np.ascontiguousarray(np.concatenate(list(used.values()), axis=1))
        layout = " ".join(f"{column.shape[1]}f" for column in used.values())
        content = [(self.context.buffer(rows), layout, *used)]
        return self.context.vertex_array(self.program, content, self.context.buffer(np.ascontiguousarray(faces)))

    def _make_texture(self, work: Work) -> None:
        """Load the texture and its mipmaps, made from linear light."""
        levels = peers_work.mipmaps(work)
        size = work.texels.shape[1::-1]
        self.texture = self.context.texture(size, 4, internal_format=GL_SRGB8_ALPHA8)
        self.texture.build_mipmaps()
        for k, level in enumerate(levels):
            opaque = np.concatenate([level, np.full_like(level[..., :1], 255)], axis=2)
            self.texture.write(np.ascontiguousarray(opaque[::-1]), level=k)  # v grows upwards
        self.texture.filter = moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR
        self.texture.repeat_x = self.texture.repeat_y = True
        self.texture.use()

    def _make_targets(self, setup: Setup):
        """Make what is drawn into, and what is read: with one sample they are the same."""
        color = self.context.texture(setup.size, 4, internal_format=GL_SRGB8_ALPHA8)
        if setup.samples == 1:
            one = self.context.framebuffer(color, self.context.depth_renderbuffer(setup.size))
            return one, one
        many = self.context.texture(setup.size, 4, samples=setup.samples, internal_format=GL_SRGB8_ALPHA8)
        depth = self.context.depth_renderbuffer(setup.size, samples=setup.samples)
        return self.context.framebuffer(many, depth), self.context.framebuffer(color)

    def draw(self) -> None:
        """Draw a frame, and read it into memory."""
        self.target.use()
        self.context.clear()
        self.array.render()
        if self.picture is not self.target:
            self.context.copy_framebuffer(self.picture, self.target)
        self.picture.read_into(self.bytes, components=4)  # waits until everything is drawn


def _shaders(work: Work) -> tuple[str, str]:
    """Write the two shaders: where the light is evaluated depends on the shading."""
    setup = work.setup
    is_phong = setup.shading == "phong"
    # Derivatives are those from pixel to pixel; of 4 samples two stand side by side.
    finer = f", {-0.5 * math.log2(setup.samples)}" if setup.is_lit_per_sample else ""
    color = f"both.x * texture(texels, uv{finer}).rgb + both.y" if work.is_textured else "both.x + both.y"
    words = {
        "VERSION": "400" if setup.is_lit_per_sample else "330",
        "COSINE": COSINES[setup.reflection],
        "POWER": _power(setup.shininess),
        "FLAT": "flat" if setup.shading == "flat" else "",
        "EACH": "sample" if setup.is_lit_per_sample else "",
        "LIGHT_VERTEX": {"flat": "reflection = reflected(in_center, in_normal);",
                         "gouraud": "reflection = reflected(position, in_normal);",
                         "phong": "p = position; normal = in_normal;"}[setup.shading],
        "LIGHT_PIXEL": "reflected(p, normalize(normal))" if is_phong else "reflection",
        "COLOR": f"encoded({color})" if setup.samples == 1 else color,
    }  # fmt: skip
    shaders = [LIGHT + VERTEX, LIGHT + FRAGMENT]
    for word, meaning in words.items():
        shaders = [text.replace(word, meaning) for text in shaders]
    return shaders[0], shaders[1]


def _power(shininess: float) -> str:
    """Write the function x^shininess."""
    mantissa, exponent = math.frexp(shininess)
    if mantissa == 0.5 and 1 <= exponent <= 11:  # 2^0 to 2^10
        return f"float power(float x) {{ {'x *= x; ' * (exponent - 1)}return x; }}"
    return "float power(float x) { return pow(x, shininess); }"


def _set_uniforms(program, setup: Setup) -> None:
    """Give the shaders the numbers that they use."""
    values = {name: getattr(setup, name) for name in
              ("eye", "light_dir", "ambient", "light", "diffuse", "specular", "shininess")}  # fmt: skip
    values["clip_from_world"] = tuple(peers_work.clip_from_world(setup).T.ravel())
    for name, value in values.items():
        if name in program:
            program[name].value = value
