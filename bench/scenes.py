"""The scenes that the scripts of this folder draw, by name: models, files, dense spheres, stacked quads.

In: a name, which lights, which materials. Out: a `Scene` with its camera.
Generated arrays are float32 and uint32, so that ten million triangles need no more than they must.
"""

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

import rasterizer as rz

MODELS = Path(__file__).resolve().parents[1] / "models"
SUFFIXES = (".obj", ".ply", ".stl", ".glb")
MODEL_NAMES = ("teapot", "sphere", "torus", "gear", "knot", "still_life", "floor")
FOV = 40.0  # degrees
MARGIN = 0.025  # on each side: the object fits 95 % of the picture's height, or of its width where that is tighter
N_QUAD = 32
BEFORE_CAMERA = ("quads-", "confetti")  # how the names of what is made for one camera begin
SIZES = {"1080p": (1920, 1080), "4k": (3840, 2160)}


def size_of(text: str) -> tuple[int, int]:
    """Read a size: 512 (a square), 640x480, 1080p or 4k."""
    if text.lower() in SIZES:
        return SIZES[text.lower()]
    width, _, height = text.lower().partition("x")
    return int(width), int(height or width)


def build(name: str, size: tuple[int, int], lights="one", channels="mono") -> rz.Scene:
    """Build a scene with its camera.

    Parameters
    ----------
    name : one of GENERATED or WHOLE, "quads-front" or "quads-back" (the order in which 32 of them come), "confetti"
        (ten thousand triangles of middle size), the name of a file in models/, or the path of any model file
    size : (width, height) in pixels: the camera depends on their ratio
    lights : "one" directional light, or those of the default picture ("studio")
    channels : a grey material ("mono"), one that needs three channels ("rgb"), or the model's "own"
    """
    if name in WHOLE:
        return WHOLE[name](size)
    meshes, up = _meshes(name, channels, size[0] / size[1])
    lit = rz.studio() if lights == "studio" else rz.DirectionalLight((0.4, -0.5, -1.0), 1.0, "camera")
    if name.startswith(BEFORE_CAMERA):
        camera = rz.Camera.perspective((0, 0, 0), target=(0, 0, -1), fov=FOV)
        return rz.Scene(meshes, lit, camera)
    scene = rz.Scene(meshes, lit, up=up)
    camera = rz.Camera.framing(scene, fov=FOV, up=up, margin=MARGIN, aspect=size[0] / size[1])
    return replace(scene, camera=camera)


def material(channels: str) -> rz.Material:
    """The material that is painted over a scene; shininess 32, some gloss."""
    # A highlight of another colour than the surface: no picture of a single tint can show both.
    return rz.Material(diffuse=(0.8, 0.5, 0.3)) if channels == "rgb" else rz.Material()


@lru_cache(maxsize=1)
def _meshes(name: str, channels: str, aspect: float):
    """Return the meshes of a scene, and its up axis; the last ones are kept."""
    paint = material(channels)
    if name in GENERATED:
        return rz.Mesh(*GENERATED[name](), material=paint), "y"
    if name.startswith(BEFORE_CAMERA):
        shape = confetti(aspect) if name == "confetti" else stacked_quads(N_QUAD, aspect, name == "quads-front")
        vertices, faces, normals = shape
        return rz.Mesh(vertices, faces, normals=normals, material=paint), "y"
    scene = rz.load(find_file(name))
    if channels == "own":
        return scene.meshes, scene.up
    plain = {"material": paint, "materials": None, "face_material": None, "colors": None, "face_colors": None}
    return tuple(replace(mesh, **plain) for mesh in scene.meshes), scene.up


def find_file(name: str) -> Path:
    """Return the path of a model: a path as it is, or the name of one in models/."""
    if Path(name).is_file():
        return Path(name)
    found = [path for suffix in SUFFIXES if (path := MODELS / f"{name}{suffix}").is_file()]
    if not found:
        raise SystemExit(f"{name}: no such file, and no such name; names are {', '.join(all_names())}")
    return found[0]


def find_name(name: str) -> str:
    """Return the absolute path of a model file, which no working directory changes; another name as it is."""
    return str(Path(name).resolve()) if Path(name).is_file() else name


def all_names() -> list[str]:
    """Names of all scenes that `build` knows without a path."""
    models = {path.stem for path in MODELS.iterdir() if path.suffix in SUFFIXES}
    return [*sorted(models), "quads-front", "quads-back", "confetti", *GENERATED, *WHOLE]


# ── generated shapes ──────────────────────────────────────────────────────────────────────────────────────


def icosphere(n_division: int):
    """Divide an icosahedron's triangles in four, again and again: vertices (n, 3) float32, faces uint32.

    The four parts of a triangle follow one another, so faces near in the list are near in space.
    """
    golden = (1 + 5**0.5) / 2
    a, b = 1.0, golden
    vertices = np.array([(-a, b, 0), (a, b, 0), (-a, -b, 0), (a, -b, 0), (0, -a, b), (0, a, b),
                         (0, -a, -b), (0, a, -b), (b, 0, -a), (b, 0, a),
                         (-b, 0, -a), (-b, 0, a)])  # fmt: skip
    faces = np.array([(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4),
                      (11, 10, 2), (10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8),
                      (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)],
                     np.int64)  # fmt: skip
    vertices /= np.linalg.norm(vertices[0])
    for _ in range(n_division):
        ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1), axis=-1)  # edges ab bc ca
        keys, edge = np.unique(ends[..., 0] << 32 | ends[..., 1], return_inverse=True)
        middle = vertices[keys >> 32] + vertices[keys & 0xFFFFFFFF]
        ab, bc, ca = (edge.reshape(-1, 3) + len(vertices)).T
        vertices = np.concatenate([vertices, middle / np.linalg.norm(middle, axis=1, keepdims=True)])
        a, b, c = faces.T
        corners = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        faces = np.stack([np.stack(part, axis=1) for part in corners], axis=1).reshape(-1, 3)
    return vertices.astype(np.float32), faces.astype(np.uint32)


def uv_sphere(n_row: int, n_column: int):
    """Make a unit sphere about the y axis: vertices (n, 3) float32, 2 (n_row - 1) n_column faces uint32."""
    polar = np.linspace(0, np.pi, n_row + 1, dtype=np.float32)[1:-1]
    turn = np.arange(n_column, dtype=np.float32) * np.float32(2 * np.pi / n_column)
    vertices = np.empty(((n_row - 1) * n_column + 2, 3), np.float32)
    grid = vertices[1:-1].reshape(n_row - 1, n_column, 3)
    grid[..., 0] = np.sin(polar)[:, None] * np.sin(turn)
    grid[..., 1] = np.cos(polar)[:, None]
    grid[..., 2] = np.sin(polar)[:, None] * np.cos(turn)
    vertices[0], vertices[-1] = (0, 1, 0), (0, -1, 0)
    column = np.arange(n_column, dtype=np.uint32)
    following = np.roll(column, -1)
    faces = np.empty((2 * (n_row - 1) * n_column, 3), np.uint32)
    faces[:n_column] = np.stack([np.zeros_like(column), column + 1, following + 1], axis=1)
    last = np.uint32(len(vertices) - 1)
    faces[-n_column:] = np.stack([np.full_like(column, last), last - n_column + following, last - n_column + column], 1)
    quads = faces[n_column:-n_column].reshape(n_row - 2, n_column, 2, 3)
    upper = np.arange(n_row - 2, dtype=np.uint32)[:, None] * np.uint32(n_column) + np.uint32(1)
    lower = upper + np.uint32(n_column)
    quads[..., 0, 0], quads[..., 0, 1], quads[..., 0, 2] = upper + column, lower + column, lower + following
    quads[..., 1, 0], quads[..., 1, 1], quads[..., 1, 2] = (
        upper + column,
        lower + following,
        upper + following,
    )
    return vertices, faces


def torus(n_ring: int, n_tube: int, ring_radius=1.0, tube_radius=0.4):
    """Make a torus about the y axis: vertices (n_ring * n_tube, 3) float32, 2 n_ring n_tube faces uint32."""
    i, j = np.meshgrid(np.arange(n_ring), np.arange(n_tube), indexing="ij")
    angle, around = i * (2 * np.pi / n_ring), j * (2 * np.pi / n_tube)
    radius = ring_radius + tube_radius * np.cos(around)
    points = np.stack([radius * np.cos(angle), tube_radius * np.sin(around), radius * np.sin(angle)], axis=-1)
    here, right = i * n_tube + j, i * n_tube + (j + 1) % n_tube
    below, across = (i + 1) % n_ring * n_tube + j, (i + 1) % n_ring * n_tube + (j + 1) % n_tube
    faces = np.stack([here, right, across, here, across, below], axis=-1).reshape(-1, 3)
    return points.reshape(-1, 3).astype(np.float32), faces.astype(np.uint32)


def write_obj(path: Path, vertices, faces) -> Path:
    """Write a mesh as an OBJ file; return its path."""
    lines = [f"v {x:.6g} {y:.6g} {z:.6g}" for x, y, z in np.asarray(vertices).tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (np.asarray(faces, np.int64) + 1).tolist()]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def stacked_quads(n_quad: int, aspect: float, is_front_first: bool):
    """Stack quads before a camera in the origin that looks down -z, each as large as the picture.

    Vertices (4 n, 3), faces (2 n, 3), normals (4 n, 3) that lean outwards: there is something to interpolate.
    """
    depth = np.linspace(2.0, 4.0, n_quad)
    depth = depth if is_front_first else depth[::-1]
    corner = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], dtype=np.float64)
    half = np.tan(np.radians(FOV) / 2) * 1.001  # a little over, so that no pixel of the border stays empty
    points = np.empty((n_quad, 4, 3))
    points[..., :2] = depth[:, None, None] * half * corner * (aspect, 1.0)
    points[..., 2] = -depth[:, None]
    normals = np.tile(np.column_stack([0.5 * corner, np.ones(4)]), (n_quad, 1))
    faces = 4 * np.arange(n_quad)[:, None, None] + np.array([(0, 1, 2), (0, 2, 3)])
    return points.reshape(-1, 3), faces.reshape(-1, 3).astype(np.uint32), normals


def quad_torus(n_ring: int, n_tube: int):
    """Make the same torus of quads: n_ring * n_tube faces (n, 4) uint32."""
    vertices, faces = torus(n_ring, n_tube)
    triangles = faces.reshape(-1, 2, 3)
    return vertices, np.column_stack([triangles[:, 0], triangles[:, 1, 2]])


def confetti(aspect: float, n=10_000, areas=(30.0, 300.0)):
    """Scatter triangles before a camera in the origin that looks down -z, facing it: vertices, faces, normals.

    At a height of 1080 pixels each covers between `areas` pixels, all magnitudes alike; shapes and turns are random.
    """
    rng = np.random.default_rng(1971)
    depth = rng.uniform(2.0, 4.0, n)
    half = np.tan(np.radians(FOV) / 2)
    corners = rng.normal(size=(n, 3, 2))
    (ax, ay), (bx, by) = (corners[:, k].T - corners[:, 0].T for k in (1, 2))
    area = 0.5 * (ax * by - ay * bx)
    corners[area < 0, 1:] = corners[area < 0, :0:-1]
    wanted = np.exp(rng.uniform(*np.log(areas), n))
    corners *= np.sqrt(wanted / np.abs(area))[:, None, None] * 2 / 1080
    corners += (rng.uniform(-1, 1, (n, 2)) * (aspect, 1.0))[:, None]
    points = np.empty((n, 3, 3))
    points[..., :2] = corners * (half * depth)[:, None, None]
    points[..., 2] = -depth[:, None]
    normals = rng.normal(size=(3 * n, 3)) * 0.3 + (0.0, 0.0, 1.0)
    return points.reshape(-1, 3), np.arange(3 * n, dtype=np.uint32).reshape(-1, 3), normals


GENERATED = {
    "dense": lambda: icosphere(8),  # 1 310 720 triangles
    "dense-torus": lambda: torus(1024, 640),  # 1 310 720
    "quad-torus": lambda: quad_torus(800, 640),  # 512 000 quads
    "huge": lambda: uv_sphere(1582, 3162),  # 9 998 244
}

# Scenes with all that belongs to them: lights and channels are their own.
WHOLE = {
    "textured": lambda size: build("globe", size, "studio", "own"),
    "room": lambda size: rz.load(MODELS / "room.json"),
    "tabletop": lambda size: replace(build("teapot", size, "one", "own"), lights=rz.tabletop()),
}
