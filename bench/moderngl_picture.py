"""What one would write with moderngl: read a model, draw it with 4 samples a pixel, save it. A yardstick of startup.py.

python bench/moderngl_picture.py MODEL OUTPUT WIDTH HEIGHT
"""

import sys

import moderngl
import numpy as np
import trimesh
from PIL import Image

VERTEX = """
#version 330
uniform vec3 middle; uniform float half_height; uniform float aspect;
in vec3 position; out vec3 p;
void main() {
    p = (position - middle) / half_height;
    gl_Position = vec4(p.x / aspect, p.y, -0.5 * p.z, 1.0);
}
"""
FRAGMENT = """
#version 330
in vec3 p; out vec4 color;
void main() {
    vec3 normal = normalize(cross(dFdx(p), dFdy(p)));
    color = vec4(vec3(0.1 + 0.7 * max(dot(normal, normalize(vec3(0.4, 0.5, 1.0))), 0.0)), 1.0);
}
"""


def main(path: str, output: str, width: int, height: int) -> None:
    """Draw facets, orthographic, from the front."""
    mesh = trimesh.load_mesh(path, process=False)
    low, high = mesh.bounds
    context = moderngl.create_context(standalone=True, **({"backend": "egl"} if sys.platform == "linux" else {}))
    context.enable(moderngl.DEPTH_TEST)
    program = context.program(vertex_shader=VERTEX, fragment_shader=FRAGMENT)
    program["middle"].value = tuple((low + high) / 2)
    program["half_height"].value = float(0.53 * np.max(high - low))
    program["aspect"].value = width / height
    vertices = context.buffer(np.ascontiguousarray(mesh.vertices, np.float32))
    faces = context.buffer(np.ascontiguousarray(mesh.faces, np.uint32))
    array = context.vertex_array(program, [(vertices, "3f", "position")], faces)
    size = (width, height)
    target = context.framebuffer(context.renderbuffer(size, samples=4), context.depth_renderbuffer(size, samples=4))
    target.use()
    target.clear()
    array.render()
    picture = context.framebuffer(context.renderbuffer(size))
    context.copy_framebuffer(picture, target)
    Image.frombytes("RGBA", size, picture.read(components=4)).transpose(Image.Transpose.FLIP_TOP_BOTTOM).save(output)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4]))
