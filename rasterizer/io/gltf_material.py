"""Materials of a glTF file: coefficients, textures with their samplers, and where on a texture a primitive lies.

    baseColorFactor      diffuse and F0, linear, see `gltf_surface`; its alpha: see alphaMode
    baseColorTexture     texture
    emissiveFactor       emissive, linear; with an emissiveTexture nothing
    alphaMode OPAQUE     opacity 1; the texture's alpha is not looked at
              BLEND      opacity = alpha of the factor; the texture's own alpha multiplies it
              MASK       alpha of factor and texture together at least alphaCutoff: 1, else 0
    magFilter, minFilter NEAREST: "nearest"; without mipmaps: "bilinear"; else "trilinear"
    wrapS, wrapT         "repeat", "clamp" or "mirror"
    doubleSided          not looked at: both sides are lit and drawn, unless faces seen from behind are culled

Textures of metallic and roughness count by their means; all others are left out.
Format: Khronos, glTF 2.0 Specification, 2021, 3.8 and 3.9; KHR_texture_transform.
"""

import math
from io import BytesIO
from typing import NamedTuple

import numpy as np

from ..errors import ModelError, warn_caller
from ..scene.material import Material
from ..scene.texture import Budget, Texture, read_picture
from .gltf_arrays import Buffers, item
from .gltf_surface import base_of, emission_of, is_unlit, lit_fields, metallic_unless_given, unlit_fields

_NEAREST, _LINEAR = 9728, 9729
_WRAPS = {10497: "repeat", 33071: "clamp", 33648: "mirror"}


class Paint(NamedTuple):
    """A material, and how texture coordinates of the file become those of its texture."""

    material: Material
    uv_set: int = 0  # which TEXCOORD_n
    uv_matrix: np.ndarray | None = None  # (2, 3) float64, new from old; None = as they are
    colored: Material | None = None  # the one for meshes with colours of vertices; None = the same


class Pictures:
    """The textures of one file; each is made once for every way in which materials use it.

    Parameters
    ----------
    buffers : Buffers of the file
    """

    def __init__(self, buffers: Buffers):
        self.model, self.tree, self._buffers = buffers.model, buffers.tree, buffers
        self._pixels, self._textures, self._budget = {}, {}, Budget()

    def texture(self, number: int, alpha_mode: str, alpha: float, cutoff: float) -> Texture | None:
        """Return a texture for a material's alphaMode and the alpha of its factor; None, and a UserWarning, if it is
        missing."""
        key = (number, alpha_mode, alpha if alpha_mode == "MASK" else 1.0, cutoff if alpha_mode == "MASK" else 0.0)
        if key not in self._textures:
            self._textures[key] = self._make(*key)
        return self._textures[key]

    def _make(self, number, alpha_mode, alpha, cutoff) -> Texture | None:
        """Make a texture; where alpha decides, it does so before mipmaps are made."""
        source, image = self._source(number)
        pixels = self._read(image)
        if pixels is None:
            return None
        sampler = item(self.tree, "samplers", source["sampler"]) if "sampler" in source else {}
        self._budget.take(math.prod(pixels.shape[:2]), f"{self.model.name}: texture '{self._label(image)}'")
        texture = Texture(pixels, filter=_filter(sampler), wrap=_wrap(sampler), name=self._label(image))
        if alpha_mode == "BLEND":
            return texture
        rgba = np.array(texture.image)
        with np.errstate(over="ignore"):  # of an alpha that is none; it is more than the cutoff then
            rgba[..., 3] = rgba[..., 3] * alpha >= cutoff if alpha_mode == "MASK" else 1.0
        return Texture(rgba, texture.filter, texture.wrap, texture.name)

    def _source(self, number) -> tuple[dict, int | None]:
        """Return a texture of the tree, and the number of its image."""
        source = item(self.tree, "textures", number)
        extensions = source.get("extensions", {}).values()
        return source, next((each["source"] for each in extensions if "source" in each), source.get("source"))

    def mean(self, use: dict) -> np.ndarray | None:
        """Return the mean (4,) of the texels of a texture of numbers, within 0..1; None, and a UserWarning, if it is
        missing."""
        pixels = self._read(self._source(use["index"])[1])
        if pixels is None:
            return None
        mean = np.atleast_1d(pixels.mean(axis=(0, 1), dtype=np.float64)) / 255.0
        alpha = mean[-1] if len(mean) in (2, 4) else 1.0
        return np.array([*np.broadcast_to(mean[:1] if len(mean) < 3 else mean[:3], 3), alpha])

    def _label(self, number) -> str:
        """What an image is called in reports."""
        image = item(self.tree, "images", number)
        uri = str(image.get("uri", ""))
        return str(image.get("name") or (uri if uri and not uri.startswith("data:") else f"image {number}"))[:80]

    def _read(self, number) -> np.ndarray | None:
        """Return the pixels of an image, read at most once; None, and a warning, where that fails."""
        if number not in self._pixels:
            try:
                if number is None:
                    raise self.model.error("the texture has no image")
                self._pixels[number] = read_picture(BytesIO(self._bytes(number)), f"image {number}", self._budget)
            except (ModelError, LookupError, TypeError, ValueError) as fault:
                reason = str(fault).removeprefix(f"{self.model.name}: ")
                what = "a texture" if number is None else f"texture '{self._label(number)}'"
                warn_caller(f"{self.model.name}: {what}: {reason}; its materials keep their plain colour")
                self._pixels[number] = None
        return self._pixels[number]

    def _bytes(self, number) -> bytes:
        """Return the file that an image is: part of a buffer, written into the tree, or beside the model."""
        image = item(self.tree, "images", number)
        return (
            bytes(self._buffers.view(image["bufferView"])) if "bufferView" in image else self._buffers.uri(image["uri"])
        )


def read_paint(source: dict, pictures: Pictures) -> Paint:
    """Turn a material of the tree into a `Paint`.

    Parameters
    ----------
    source : dict, one of the tree's materials
    pictures : Pictures of the file

    Raises
    ------
    ModelError : a value that is not legal
    TypeError, AttributeError, LookupError, ValueError : a tree that is none of glTF
    """
    (red, green, blue, alpha), use = base_of(source)
    mode, cutoff = source.get("alphaMode", "OPAQUE"), float(source.get("alphaCutoff", 0.5))
    if mode not in ("OPAQUE", "MASK", "BLEND"):
        raise pictures.model.error(f"alphaMode must be OPAQUE, MASK or BLEND; given {mode!r}")
    texture = None if use is None else pictures.texture(use["index"], mode, alpha, cutoff)
    # With a texture, MASK has been decided texel by texel.
    opacity = {"OPAQUE": 1.0, "BLEND": alpha, "MASK": 1.0 if texture is not None else float(alpha >= cutoff)}[mode]
    common = {"opacity": opacity, "texture": texture, "name": str(source.get("name", ""))}
    place = () if texture is None else _placement(use)
    base = (red, green, blue)
    if is_unlit(source):
        plain, colored = (Material(**common | unlit_fields(base, many)) for many in (texture is not None, True))
        return Paint(plain, *place)._replace(colored=colored)
    mean_color = (1.0, 1.0, 1.0) if texture is None else texture.image[..., :3].mean(axis=(0, 1), dtype=np.float64)
    with np.errstate(all="ignore"):  # what isn't finite is refused by Material
        fields = lit_fields(source, base, mean_color, pictures.mean, metallic_unless_given(pictures.tree))
    return Paint(Material(emissive=emission_of(source), **common, **fields), *place)


def _placement(use) -> tuple[int, np.ndarray | None]:
    """Return which texture coordinates a texture is laid by, and the matrix that KHR_texture_transform applies to them.

    Scale, then rotation, then offset. The rotation is counter-clockwise as seen with v pointing down, as the sample
    model of the extension and its implementations have it; the listing in its text turns the other way
    (KhronosGroup/glTF, issue 1563).
    """
    change = use.get("extensions", {}).get("KHR_texture_transform", {})
    uv_set = change.get("texCoord", use.get("texCoord", 0))
    if not {"offset", "rotation", "scale"} & change.keys():
        return int(uv_set), None
    angle = float(change.get("rotation", 0.0))
    c, s = math.cos(angle), math.sin(angle)
    (x, y), (a, b) = change.get("offset", (0.0, 0.0)), change.get("scale", (1.0, 1.0))
    return int(uv_set), np.array([[c * a, s * b, x], [-s * a, c * b, y]], np.float64)


def uv_from_gltf(values, matrix) -> np.ndarray:
    """Turn texture coordinates of glTF, whose v points down, into ours.

    Parameters
    ----------
    values : (n, 2) float, or the integers of a normalised accessor
    matrix : (2, 3) float64, applied before v is turned round; or None

    Returns
    -------
    (n, 2) float64
    """
    uv = linear_values(values)
    if matrix is not None:
        uv = uv @ matrix[:, :2].T + matrix[:, 2]
    return np.stack([uv[:, 0], 1.0 - uv[:, 1]], axis=1)


def linear_values(values) -> np.ndarray:
    """Return the values of an accessor as float64; integers are normalised."""
    values = np.asarray(values)
    scale = np.iinfo(values.dtype).max if values.dtype.kind in "ui" else 1.0
    return (
        np.maximum(values.astype(np.float64) / scale, -1.0)
        if values.dtype.kind == "i"
        else values.astype(np.float64) / scale
    )


def _filter(sampler) -> str:
    """Return the filter that stands for a sampler's two."""
    large, small = sampler.get("magFilter"), sampler.get("minFilter")
    if large == _NEAREST or (large is None and small == _NEAREST):
        return "nearest"
    return "bilinear" if small in (_NEAREST, _LINEAR) else "trilinear"


def _wrap(sampler) -> tuple[str, str]:
    """Return what lies outside a texture, for u and v."""
    return _WRAPS[sampler.get("wrapS", 10497)], _WRAPS[sampler.get("wrapT", 10497)]
