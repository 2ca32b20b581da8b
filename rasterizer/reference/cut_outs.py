"""Cut-outs: points of faces that are not there, because opacity times the alpha of a texture is below a cutoff."""

import numpy as np
from numpy.typing import NDArray

from ..scene.material import Material
from .surface import Surface
from .textures import alpha_of_picture, without_repeats
from .vectors import blend

NEAR_CUTOFF = 1e-9  # of alpha: nearer to the cutoff rounding decides


def are_there(
    surface: Surface, palette: tuple[Material, ...], face: NDArray, weights: NDArray
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Tell which points of faces are there, and where rounding decides that.

    Parameters
    ----------
    palette : the materials, as `surface.material` numbers them
    face : (n,) int
    weights : (n, 3) float64, of the points on the corners of the faces

    Returns
    -------
    (n,) bool, and (n,) bool
    """
    is_there, is_near, material = np.ones(len(face), bool), np.zeros(len(face), bool), surface.material[face]
    for number in np.unique(material):
        paint = palette[number]
        if paint.alpha_cutoff is not None:
            at, texture = material == number, paint.texture
            alpha = np.ones(int(at.sum()))
            if texture is not None:
                corners = without_repeats(surface.uv[face[at]][..., :2], texture.wrap)
                alpha = alpha_of_picture(texture, blend(weights[at], corners))
            is_there[at] = paint.opacity * alpha >= paint.alpha_cutoff
            is_near[at] = abs(paint.opacity * alpha - paint.alpha_cutoff) < NEAR_CUTOFF
    return is_there, is_near
