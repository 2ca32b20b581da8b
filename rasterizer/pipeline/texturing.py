"""Stage 6, shade, of textured surfaces: what their textures show, and intensities of vertices times texels.

In:  the band's packed samples and setups: the paths by which texture coordinates come are planes, and exact.
Out: of a run of samples that show one material, red, green, blue and alpha in the batch of Texturing, float32
     (`look_up_colors`), by which Phong's method multiplies its albedo; and how metallic and rough the surface is. By
     flat shading and Gouraud's method `radiance` of the samples that show a textured surface; shade.py has filled that
     of the others.

Attributes 0-2 of a textured surface are what a black one gives off, 3-5 what the whole one gives off:

    I = I_rest + texel · (I_whole - I_rest)
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, kernel
from . import fragments as f
from .fragments import BARYCENTRIC, BATCH_SIZE, get_vector
from .gradients import HAS_TEXTURE, IS_TRANSPARENT
from .interpolate import corner_values, has_exact, has_planes, mean, next_exact_run, row_extent
from .samples import evaluate_planes, evaluate_slopes, evaluate_values, skip_to
from .shade import fill_weights
from .texcoords import (
    S_PLANE,
    TEXEL,
    clear_texcoords,
    compute_texcoords,
    fill_barycentric,
    put_in_exact_texcoords,
)
from .texture_lookup import read_texels
from .textures import FILTER_TRILINEAR, Textures, texture_of
from .triangle_setups import ATTRIBUTE, BEHIND_VALUES, PLAIN_GROUP, VALUES, material_of, plane_group
from .visibility import CLEAR, IS_ID, next_stretch, setup_of, stretch_of, strip_of

RED, GREEN, BLUE, ALPHA = (TEXEL + BATCH_SIZE * k for k in range(4))  # rows of the batch of Texturing


class Texturing(NamedTuple):
    """The textures of a scene, and memory for looking them up."""

    textures: Textures | None  # of colours and alpha; None where no material has one
    metals: Textures | None  # that say how metallic and rough a surface is; None where there are none
    batch: np.ndarray  # see texcoords.py
    weights: np.ndarray  # the batch of float64, see fragments.py
    alphas: np.ndarray  # (n_row * pitch,) float32, written: of transparent surfaces; no rows where there are none


REST, WHOLE = f.NORMAL, f.VIEW_DIR  # where planes' intensities stand in a batch


@kernel
def shade_textured(band, texturing, batch, out_radiance):
    """Interpolate the light that a texture weakens and the rest apart, for the samples that show a texture.

    Parameters
    ----------
    band : ScannedBand
    texturing : Texturing
    batch : see fragments.py, float32
    out_radiance : (3, n_row * pitch) float32 or float64, linear
    """
    visibility = band.visibility
    for j in range(band.n_row):
        y, (first, right) = band.y_start + j, row_extent(visibility, j)
        while first < right:
            start = j * visibility.pitch + first
            end, material = stretch_of(visibility, strip_of(j), first, right, band.counts.material)
            n = min(end - first, BATCH_SIZE)
            n, is_blank = next_stretch(visibility.packed[start : start + n])
            if is_blank:
                material = -1
            elif material < 0:
                n, material = run_of_texture(visibility.packed[start : start + n], band)
            elif not band.coding.features[material] & HAS_TEXTURE:
                n, material = end - first, -1
            if material >= 0:
                packed = visibility.packed[start : start + n]
                where = first, y
                shows_planes = has_planes(packed)
                if shows_planes:
                    evaluate_texcoords(packed, band, where, material, texturing)
                look_up_colors(packed, band, where, material, texturing, start, shows_planes)
                if shows_planes:
                    shade_planes(packed, band, where, texturing, start, batch, out_radiance)
                if has_exact(packed):
                    shade_exact(packed, band.setups, where, texturing, start, out_radiance)
            first += n


@helper
def run_of_texture(packed, band):
    """Return the length of a run of samples, and the one textured material that it shows; -1 where it shows none."""
    material = -1
    for k in range(len(packed)):
        if packed[k] < CLEAR:  # samples that show nothing belong to any run: their packed samples read as setup 0
            here = -1
            if packed[k] & IS_ID:
                here = material_of(packed[k], band.setups)
                here = here if band.coding.features[here] & HAS_TEXTURE else -1
            if here != material:
                if k > 0:
                    return k, material
                material = here
    return len(packed), material


@helper
def evaluate_texcoords(packed, band, first, material, texturing):
    """Evaluate the planes of texture coordinates into the batch of `texturing`; with slopes where the filter needs
    them."""
    group = plane_group(band.setups, BEHIND_VALUES)
    if texture_of(texturing.textures, material).filter == FILTER_TRILINEAR:
        evaluate_slopes(packed, group, first, texturing.batch, S_PLANE)
    else:
        evaluate_planes(packed, group, first, texturing.batch, S_PLANE)


@helper
def shade_planes(packed, band, first, texturing, start, batch, out_radiance):
    """Fill the intensities of samples that show planes, by planes that are mixed by the texels; of exact setups
    anything is written.

    `first` says where the samples lie (samples.py), `start` is the index of the first in the band.
    """
    setups, rows, n = band.setups, texturing.batch, len(packed)
    fill_weights(packed, band.coding.depths, batch)
    evaluate_values(packed, plane_group(setups, VALUES), first, batch, REST, f.WEIGHT)
    group = plane_group(setups, BEHIND_VALUES + PLAIN_GROUP)
    evaluate_values(packed, group, first, batch, WHOLE, f.WEIGHT)
    for channel in range(3):
        step, out = channel * f.NEXT, out_radiance[channel, start : start + n]
        for k in range(n):
            rest, whole = batch[REST + step + k], batch[WHOLE + step + k]
            out[k] = rest + rows[RED + step + k] * (whole - rest)


@helper
def shade_exact(packed, setups, first, texturing, start, out_radiance):
    """Fill the intensities of exact setups; `first` says where the samples lie (samples.py), `start` is the
    index of the first in the band.

    Channel by channel over weights that are known: so each loop becomes vector instructions.
    """
    weights, (k, end) = texturing.weights, next_exact_run(packed, 0)
    while k < end:
        setup, n = setup_of(packed[k]), end - k
        fill_barycentric(setups, setup, skip_to(first, k), n, weights)
        for channel in range(3):
            column = ATTRIBUTE + 3 * channel
            of_rest = corner_values(setups.reals, setup, column)
            of_whole = corner_values(setups.reals, setup, column + 9)
            row, out = RED + channel * f.NEXT + k, out_radiance[channel, start + k : start + end]
            for i in range(n):
                p = get_vector(weights, BARYCENTRIC, i)
                rest, whole = mean(of_rest, p), mean(of_whole, p)
                out[i] = rest + (whole - rest) * texturing.batch[row + i]
        k, end = next_exact_run(packed, end)


# ---------------------------------------------------------------- what a texture shows


@helper
def look_up_colors(packed, band, first, material, texturing, start, is_in_planes):
    """Look up what the texture of a material shows at samples that show it, after the planes of its coordinates are
    evaluated; keep the alpha of what lets light through.

    Where a band is gone through in float32 and then in float64, samples of the second kind get anything first.

    Parameters
    ----------
    packed : (n,) int64, n <= BATCH_SIZE; what doesn't show the material gets anything
    band : ScannedBand
    first : where they lie (samples.py)
    start : index of the first packed sample's sample in the band
    is_in_planes : whether the batch of `texturing` holds texture coordinates as planes have them
    """
    look_up(packed, band, first, material, texturing.textures, is_in_planes, texturing)
    if band.coding.features[material] & IS_TRANSPARENT:
        for k in range(len(packed)):
            texturing.alphas[start + k] = texturing.batch[ALPHA + k]


@helper
def put_in_metals(metals, packed, band, first, material, texturing, batch):
    """Put in what the metallic-roughness texture of a material shows, if it has one: all of its setups are exact.

    metals : those of `texturing`; None where there are none: then they are not compiled
    """
    if metals is not None:
        if metals.of_materials[material] >= 0:
            look_up(packed, band, first, material, metals, False, texturing)
            for k in range(len(packed)):
                batch[f.ROUGHNESS + k] = texturing.batch[GREEN + k]
                batch[f.METALLIC + k] = texturing.batch[BLUE + k]


@helper
def look_up(packed, band, first, material, textures, is_in_planes, texturing):
    """Look up the texture that a material has among `textures`; see `look_up_colors`.

    is_in_planes : whether the batch holds texture coordinates as planes have them
    """
    rows, n, texture = texturing.batch, len(packed), texture_of(textures, material)
    if is_in_planes:
        compute_texcoords(rows, n, texture)
    else:
        clear_texcoords(rows, n)
    if band.counts.n_exact > 0 and has_exact(packed):
        put_in_exact_texcoords(packed, band.setups, first, material, textures.texcoord, texture, texturing.weights,
                               rows)  # fmt: skip
    read_texels(rows, n, texture)
