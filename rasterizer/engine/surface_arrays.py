"""What surfaces are beside their illumination, as arrays that the pipeline reads: textures, opacities, depth cueing."""

import numpy as np

from ..pipeline import textures as texturing
from ..pipeline.depth_cueing import Cue
from ..pipeline.layers import Opacity
from ..pipeline.textures import Textures


def list_opacities(materials, least) -> Opacity:
    """How transparent the materials are; see pipeline/a_buffer.py for `least`."""
    return Opacity(
        np.array([material.opacity for material in materials]),
        np.array([material.is_opaque for material in materials], np.bool_),
        np.array([material.texture is not None for material in materials], np.bool_),
        least,
    )


def list_textures(materials) -> Textures:
    """Lay the textures of materials, at least one, behind each other; those that are shared, once."""
    different = {id(material.texture): material.texture for material in materials if material.texture is not None}
    number = {key: k for k, key in enumerate(different)}
    levels = [level for texture in different.values() for level in texture.pyramid]
    first = np.cumsum([0] + [level.shape[0] * level.shape[1] for level in levels])
    filters = {
        "nearest": texturing.FILTER_NEAREST,
        "bilinear": texturing.FILTER_BILINEAR,
        "trilinear": texturing.FILTER_TRILINEAR,
    }
    wraps = {"repeat": texturing.WRAP_REPEAT, "clamp": texturing.WRAP_CLAMP, "mirror": texturing.WRAP_MIRROR}
    return Textures(
        np.concatenate([level.ravel() for level in levels]),
        np.array(
            [(start, level.shape[1], level.shape[0]) for start, level in zip(first, levels, strict=False)], np.int64
        ),
        np.cumsum([0] + [len(texture.pyramid) for texture in different.values()]).astype(np.int64),
        np.array([filters[texture.filter] for texture in different.values()], np.int64),
        np.array([[wraps[word] for word in texture.wrap] for texture in different.values()], np.int64),
        np.array([number.get(id(material.texture), -1) for material in materials], np.int64),
    )


def brightest_texel(materials) -> float:
    """The largest component of any texture, at least 1."""
    images = [material.texture.image for material in materials if material.texture is not None]
    return max((float(image[..., :3].max()) for image in images), default=1.0)


def make_cue(cue, n_channel) -> Cue:
    """Depth cueing as the pipeline takes it; with one channel its colour is a multiple of the tint, whose largest
    component is 1."""
    return Cue(cue.scale, cue.start, np.array(cue.color if n_channel == 3 else [max(cue.color)], np.float64))
