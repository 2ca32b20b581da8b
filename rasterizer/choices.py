"""The words that a user may write, each list once: the classes of a scene, the options and the command line check them.

A `Literal` is what editors and type checkers read; the tuple beside it is what messages list and checks compare with.
Only the standard library is imported, so that `raster --help` stays quick. Lights and reflection models can be added at
run time: what stands here are the built-in ones, which the help lists; `scene.lights.LIGHT_TYPES` and
`scene.material.REFLECTION_MODELS` know all.
"""

from collections.abc import Iterable
from typing import Literal, get_args

# --- options of a picture -----------------------------------------------------------------------------------

Shading = Literal["flat", "lambert", "gouraud", "phong"]
Buffer = Literal[
    "depth", "face", "normal", "mask", "object", "material", "uv", "barycentric", "position", "position_camera",
    "normal_camera",
]  # fmt: skip
Output = Literal["color", "rgb", Buffer]
SavedArray = Literal["color", "rgb", "rgba", "alpha", Buffer]
Scale = float | Literal["auto"] | None  # of depth in PNG files
Cull = Literal["auto", "none", "back"]
ColorRange = Literal["clamp", "global", "local"]
Samples = Literal[1, 4, 9, 16]
EdgeType = Literal["wire", "crease", "silhouette", "all"]

SHADINGS: tuple[str, ...] = get_args(Shading)
OUTPUTS: tuple[str, ...] = get_args(Output)  # built-in
BUFFERS: dict[str, str] = {  # what they hold
    "depth": "in scene units",
    "face": "the face's index or -1",
    "normal": "in world space",
    "mask": "whether something is there",
    "object": "the mesh's index or -1",
    "material": "the material's index or -1",
    "uv": "texture coordinates",
    "barycentric": "weights of the face's corners",
    "position": "in world space",
    "position_camera": "x right, y up, z backwards",
    "normal_camera": "the same axes",
}
SAVED_ARRAYS: tuple[str, ...] = get_args(SavedArray)
ARRAY_SUFFIXES = ("npy", "npz", "exr")  # of files that hold arrays and nothing else
CULLS: tuple[str, ...] = get_args(Cull)
COLOR_RANGES: tuple[str, ...] = get_args(ColorRange)
SAMPLES: tuple[int, ...] = get_args(Samples)
EDGE_TYPES: tuple[str, ...] = get_args(EdgeType)

# --- what a store of compiled kernels is made for -----------------------------------------------------------

ProcessorLevel = Literal["generic", "x86-64-v2", "x86-64-v3"]

PROCESSOR_LEVELS: tuple[str, ...] = get_args(ProcessorLevel)

# --- what a scene is made of --------------------------------------------------------------------------------

ViewName = Literal["iso", "front", "back", "left", "right", "top", "bottom"]
Axis = Literal["x", "y", "z", "-x", "-y", "-z"]
Weighting = Literal["angle", "area", "uniform"]
Filter = Literal["nearest", "bilinear", "trilinear"]
Wrap = Literal["repeat", "clamp", "mirror"]
Distribution = Literal["ggx", "beckmann"]
Attachment = Literal["world", "camera"]
PoseFrame = Literal["opengl", "opencv"]
Preset = Literal["studio", "headlight", "tabletop"]
Reflection = Literal["phong", "blinn", "lambert", "oren-nayar", "cook-torrance", "toon"]
LightType = Literal["ambient", "directional", "point", "spot", "area"]

AXES: dict[str, tuple[float, float, float]] = {
    "x": (1.0, 0.0, 0.0),
    "y": (0.0, 1.0, 0.0),
    "z": (0.0, 0.0, 1.0),
    "-x": (-1.0, 0.0, 0.0),
    "-y": (0.0, -1.0, 0.0),
    "-z": (0.0, 0.0, -1.0),
}
RANDOM = "random"  # a view, or lights, by a seed
# Views by name: (azimuth, elevation) in degrees; front is seen from +z with y up, from -y with z up.
VIEWS: dict[str, tuple[float, float]] = {
    "iso": (45.0, 35.264389682754654),  # atan(1/√2): the three axes look equally long
    "front": (0.0, 0.0),
    "back": (180.0, 0.0),
    "left": (-90.0, 0.0),
    "right": (90.0, 0.0),
    "top": (0.0, 90.0),
    "bottom": (0.0, -90.0),
}
AZIMUTH, ELEVATION, FOV = 35.0, 25.0, 30.0  # degrees, of a picture that is framed; those of Camera.framing
WEIGHTINGS: tuple[str, ...] = get_args(Weighting)
FILTERS: tuple[str, ...] = get_args(Filter)
WRAPS: tuple[str, ...] = get_args(Wrap)
DISTRIBUTIONS: tuple[str, ...] = get_args(Distribution)
ATTACHMENTS: tuple[str, ...] = get_args(Attachment)
POSE_FRAMES: tuple[str, ...] = get_args(PoseFrame)
PRESETS: tuple[str, ...] = get_args(Preset)
REFLECTIONS: tuple[str, ...] = get_args(Reflection)  # built-in
LIGHT_TYPES: tuple[str, ...] = get_args(LightType)  # built-in

# --- what somebody probably meant who wrote a word that isn't there ------------------------------------------

SYNONYMS = {  # what other programs call it, and the command line, or functions
    "aa": "samples", "alpha": "opacity", "anti_aliasing": "samples", "antialiasing": "samples", "array": "outputs",
    "azim": "azimuth", "background_color": "background", "base_color": "diffuse", "bg": "background",
    "buffers": "outputs", "camera_position": "eye", "color": "diffuse", "colour": "diffuse", "dimensions": "size",
    "elev": "elevation", "format": "input_format", "frames": "n_frame", "height": "size", "input_format": "format",
    "intensity": "color", "jobs": "threads", "look_at": "target", "mode": "shading", "msaa": "samples",
    "multisample": "samples", "orthographic": "ortho", "out": "output", "outfile": "output", "perspective": "fov",
    "position": "eye", "processes": "n_process", "res": "size", "resolution": "size", "shape": "size",
    "silent": "quiet", "smooth": "shading", "spp": "samples", "supersample": "samples", "supersampling": "samples",
    "vertex_colors": "colors", "width": "size", "workers": "threads",
}  # fmt: skip


def nearest_word(word: str, legal: Iterable[str]) -> str | None:
    """Return the legal word that is meant by another one: its synonym, or the nearest in letters; None where none is
    near."""
    from difflib import get_close_matches

    words, word = list(legal), word.lower()
    if SYNONYMS.get(word) in words:
        return SYNONYMS[word]
    return next(iter(get_close_matches(word, words, n=1)), None)
