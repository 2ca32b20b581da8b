"""What is drawn for a comparison with other renderers: arrays, a camera and a light that all of them can be given.

In: a case of `peers.py`. Out: `Work`, plain arrays and numbers, which a file and a line of JSON carry from process to
process. Nobody gets anything that the others don't get.
"""

import json
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

import rasterizer as rz
from bench import scenes
from rasterizer.engine.points import gather_geometry
from rasterizer.scene.color import srgb_from_linear

LIGHT_IN_CAMERA = (0.4, -0.5, -1.0)  # as in scenes.py: from the upper left, over the viewer's shoulder
TEXELS = 1024  # along a side of the generated texture
FIELDS = 16  # along a side of it, each of a colour of its own


class Unable(Exception):
    """A renderer can't draw a work, or nothing like it; the message says why."""


@dataclass(frozen=True, kw_only=True)
class Setup:
    """All of a picture but its arrays: numbers and words that JSON holds; colours are linear and grey."""

    size: tuple[int, int]
    shading: str  # "flat", "gouraud" or "phong"
    samples: int = 1
    is_lit_per_sample: bool = False  # where a renderer would light several samples of a pixel at once
    cull: str = "back"
    reflection: str = "phong"  # or "blinn"
    threads: int = 1
    ambient: float = 0.1  # intensity of the ambient light
    light: float = 0.9  # that of the directional one
    diffuse: float = 0.7  # coefficients of the material; its ambient one is the diffuse one
    specular: float = 0.2
    shininess: float = 32.0
    fov: float = scenes.FOV  # vertical, degrees
    eye: tuple = (0.0, 0.0, 0.0)  # world space, as the four axes that follow
    right: tuple = (1.0, 0.0, 0.0)
    up: tuple = (0.0, 1.0, 0.0)
    forward: tuple = (0.0, 0.0, -1.0)
    light_dir: tuple = (0.0, 0.0, 1.0)  # unit, to the light
    near: float = 0.0  # distances along the view between which everything lies
    far: float = 0.0
    speck: str = ""  # what a few pixels in a corner are made of; "" = there are none

    def to_json(self) -> str:
        """Write it as JSON."""
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> "Setup":
        """Read what `to_json` has written."""
        return cls(
            **{name: tuple(value) if isinstance(value, list) else value for name, value in json.loads(text).items()}
        )


@dataclass(frozen=True)
class Work:
    """A picture to be drawn."""

    setup: Setup
    positions: np.ndarray  # (n_vertex, 3) float32, world space
    normals: np.ndarray  # (n_vertex, 3) float32, unit
    faces: np.ndarray  # (n_face, 3) uint32, counter-clockwise seen from outside
    uv: np.ndarray  # (n_vertex, 2) float32; (0, 2) without a texture
    texels: np.ndarray  # (h, w, 3) uint8, sRGB, first row on top; (0, 0, 3) without a texture

    @property
    def is_textured(self) -> bool:
        """Whether a texture multiplies the ambient and the diffuse light."""
        return len(self.uv) > 0

    def save(self, path: Path) -> None:
        """Write the arrays to a file."""
        np.savez(path, **{name: getattr(self, name) for name in ("positions", "normals", "faces", "uv", "texels")})

    @classmethod
    def load(cls, path: Path, setup: Setup) -> "Work":
        """Read the arrays that `save` has written."""
        with np.load(path) as arrays:
            return cls(setup, **arrays)


def make_work(mesh: str, is_textured: bool, setup: Setup) -> Work:
    """Make the work of a case; `mesh` is one of MESHES, a name of scenes.py, or the path of a model file."""
    arrays, up = _arrays_of(mesh, is_textured, setup.size)
    return Work(_placed(setup, mesh, arrays["positions"], arrays["faces"], up), **arrays)


def clip_from_world(setup: Setup) -> np.ndarray:
    """Return OpenGL's matrix, (4, 4) float64: depth from -1 at `near` to 1 at `far`, y upwards."""
    right, up, forward, eye = (np.array(axis) for axis in (setup.right, setup.up, setup.forward, setup.eye))
    view_from_world = np.eye(4)
    view_from_world[:3, :3] = right, up, -forward
    view_from_world[:3, 3] = -view_from_world[:3, :3] @ eye
    scale = 1.0 / np.tan(np.radians(setup.fov) / 2.0)
    near, far = setup.near, setup.far
    clip_from_view = np.zeros((4, 4))
    clip_from_view[0, 0], clip_from_view[1, 1] = scale * setup.size[1] / setup.size[0], scale
    clip_from_view[2, 2:] = (near + far) / (near - far), 2.0 * near * far / (near - far)
    clip_from_view[3, 2] = -1.0
    return clip_from_view @ view_from_world


def face_points(work: Work) -> tuple[np.ndarray, np.ndarray]:
    """Return what flat shading lights: centroids and unit normals of the faces, (n_face, 3) float32 each."""
    a, b, c = work.positions[work.faces].astype(np.float64).transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0.0)
    return ((a + b + c) / 3.0).astype(np.float32), normals.astype(np.float32)


def mipmaps(work: Work) -> list[np.ndarray]:
    """Return the texture and its mipmaps, (h, w, 3) uint8 sRGB each: means of linear light."""
    return [_srgb_bytes(level[..., :3]) for level in rz.Texture(work.texels).pyramid]


def _srgb_bytes(linear: np.ndarray) -> np.ndarray:
    """Encode linear colours as 8 bits."""
    return np.rint(255.0 * srgb_from_linear(linear.clip(0.0, 1.0))).astype(np.uint8)


# --- where things are ---------------------------------------------------------------------------------------


def _placed(setup: Setup, mesh: str, positions: np.ndarray, faces: np.ndarray, up: str) -> Setup:
    """Put the camera where scenes.py puts it, with the planes of OpenGL about what it sees, and the light beside it."""
    if mesh.startswith("quads-"):
        camera = rz.Camera.perspective((0, 0, 0), target=(0, 0, -1), fov=setup.fov)
    else:
        used = positions[np.unique(faces)]
        aspect = setup.size[0] / setup.size[1]
        camera = rz.Camera.framing(used, fov=setup.fov, up=up, margin=scenes.MARGIN, aspect=aspect)
    view = camera.view()
    distances = (positions[faces.ravel()].astype(np.float64) - view.eye) @ view.forward
    low, high = float(distances.min()), float(distances.max())
    margin = 0.01 * (high - low)  # so that rounding in float32 clips nothing away
    to_light = view.world_from_camera @ -np.array(LIGHT_IN_CAMERA)
    axes = {name: tuple(map(float, getattr(view, name))) for name in ("eye", "right", "up", "forward")}
    return replace(setup, **axes, near=max(low - margin, 0.5 * low), far=high + margin,
                   light_dir=tuple(map(float, to_light / np.linalg.norm(to_light))))  # fmt: skip


# --- meshes -------------------------------------------------------------------------------------------------


def _arrays_of(mesh: str, is_textured: bool, size: tuple[int, int]) -> tuple[dict, str]:
    """Return the arrays of `Work` by name, and the axis that points upwards."""
    if mesh in MESHES:
        positions, faces, normals, uv = MESHES[mesh]()
        return _as_arrays(positions, normals, faces, uv if is_textured else None, make_texels()), "y"
    scene = scenes.build(mesh, size, channels="own" if is_textured else "mono")
    if is_textured and any(part.uv is None for part in scene.meshes):
        raise SystemExit(f"{mesh} has no texture coordinates")
    own = [material.texture for part in scene.meshes for material in part.palette if material.texture is not None]
    if is_textured and not own:  # so that texture coordinates are gathered, too
        paint = rz.Material(texture=np.ones((1, 1, 3)))
        plain = {"material": paint, "materials": None, "face_material": None}
        scene = replace(scene, meshes=[replace(part, **plain) for part in scene.meshes])
    geometry = gather_geometry(scene.meshes, is_flat=False)
    uv = geometry.uv if is_textured else None
    # Of several textures the first one is laid over everything.
    texels = _srgb_bytes(own[0].image[..., :3]) if own and is_textured else make_texels()
    return _as_arrays(geometry.points, geometry.normals, geometry.corner.T, uv, texels), scene.up


def _as_arrays(positions, normals, faces, uv, texels) -> dict:
    """Return the arrays in the dtypes that renderers are given."""
    has_uv = uv is not None
    return {
        "positions": np.ascontiguousarray(positions, np.float32),
        "normals": np.ascontiguousarray(normals, np.float32),
        "faces": np.ascontiguousarray(faces, np.uint32),
        "uv": np.ascontiguousarray(uv, np.float32) if has_uv else np.empty((0, 2), np.float32),
        "texels": texels if has_uv else np.empty((0, 0, 3), np.uint8),
    }


def knot(n_along: int, n_around: int, tube_radius=0.35):
    """Make a trefoil knot with texture coordinates: (n_along + 1)(n_around + 1) vertices, 2 n_along n_around faces.

    Vertices where u or v begins anew are there twice. Returns positions, faces, normals, uv.
    """
    t = np.linspace(0.0, 2.0 * np.pi, n_along + 1)[:, None]
    around = np.linspace(0.0, 2.0 * np.pi, n_around + 1)[None, :, None]
    core = np.concatenate([np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -np.sin(3 * t)], 1)
    along = np.concatenate([np.cos(t) + 4 * np.cos(2 * t), -np.sin(t) + 4 * np.sin(2 * t), -3 * np.cos(3 * t)], 1)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(along, (0.0, 0.0, 1.0))  # the curve is nowhere parallel to z
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    upright = np.cross(across, along)
    normals = np.cos(around) * across[:, None] + np.sin(around) * upright[:, None]
    positions = core[:, None] + tube_radius * normals
    u, v = np.meshgrid(np.linspace(0, 8, n_along + 1), np.linspace(0, 1, n_around + 1), indexing="ij")
    i, j = np.meshgrid(np.arange(n_along), np.arange(n_around), indexing="ij")
    here, right = i * (n_around + 1) + j, i * (n_around + 1) + j + 1
    below, beside = here + n_around + 1, right + n_around + 1
    faces = np.stack([here, beside, right, here, below, beside], axis=-1).reshape(-1, 3)
    return positions.reshape(-1, 3), faces, normals.reshape(-1, 3), np.stack([u, v], axis=-1).reshape(-1, 2)


def _torus():
    """A torus as large as a common scan, 70 000 triangles, with the surface's own normals."""
    positions, faces = scenes.torus(250, 140)
    ring = positions * (1.0, 0.0, 1.0)
    normals = positions - ring / np.linalg.norm(ring, axis=1, keepdims=True)
    return positions, faces, normals / np.linalg.norm(normals, axis=1, keepdims=True), None


def _sphere():
    """A sphere of 1 310 720 triangles, with the surface's own normals."""
    positions, faces = scenes.icosphere(8)
    return positions, faces, positions, None


MESHES = {"knot": lambda: knot(200, 15), "torus-70k": _torus, "sphere-1.3M": _sphere}


def make_texels() -> np.ndarray:
    """Return a texture, (TEXELS, TEXELS, 3) uint8 sRGB: fields of different colours with finer ones on them."""
    rng = np.random.default_rng(7)
    texels = np.zeros((TEXELS, TEXELS, 3))
    for n_field, weight in ((FIELDS, 120.0), (4 * FIELDS, 60.0), (TEXELS // 4, 30.0)):
        fields = rng.random((n_field, n_field, 3))
        texels += weight * fields.repeat(TEXELS // n_field, axis=0).repeat(TEXELS // n_field, axis=1)
    return (45.0 + texels).astype(np.uint8)
