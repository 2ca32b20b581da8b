"""Stage 6, shade: the intensities of a band's visible samples, and how they fade with depth.

In:  the band's packed samples and setups (scan.py, triangle_setups.py).
Out: `radiance`, linear intensities, a plane a channel; samples where nothing is visible hold anything.

`shade_interpolated` serves flat shading and Gouraud's method: intensities stand in the packed samples or are
interpolated. Phong's method, `shade_lit`, is in phong_shading.py: normals are interpolated, and the illumination
equation is evaluated at every visible sample. Both work on a batch of a row's samples at a time. What packed samples
and planes hold is evaluated in one loop without branches, whatever the samples show; exact setups, if the band has any,
are then put in run by run.

A band may show materials of one channel and of three. Then it has three, and what has one is multiplied by the
picture's tint, as the resolve stage does where a band needs no more than one.

Letters: q_i perspective weights of a triangle's corners, p_i the same with Σ p_i = 1 (interpolate.py); r = w_0/w, the
inverted distance along the viewing axis (gradients.py).
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, kernel
from ..geometry.vectors import scale
from . import fragments as f
from .fragments import BATCH_SIZE
from .gradients import HAS_COLORS
from .interpolate import (
    corner_values,
    corner_weights,
    depth_at,
    exact_triangle,
    has_exact,
    mean,
    needs_decoding,
    next_exact_run,
    row_extent,
)
from .samples import evaluate_planes, evaluate_values
from .setup import inverse_sum
from .triangle_setups import ATTRIBUTE, VALUES, material_of, plane_group
from .visibility import CLEAR, INTENSITY_BITS, INTENSITY_MASK, IS_ID, IS_WEIGHTED, PAYLOAD_BITS, is_exact, setup_of


@kernel
def shade_interpolated(band, tint, batch, out_radiance):
    """Turn packed samples and setups into intensities.

    Parameters
    ----------
    band : ScannedBand
    tint : (3,) float32, the colour of what has one channel, where the band has three
    batch : see fragments.py, float32
    out_radiance : (n_channel, n_row * pitch) float32 or float64, linear
    """
    visibility, setups = band.visibility, band.setups
    for j in range(band.n_row):
        y, (left, right) = band.y_start + j, row_extent(visibility, j)
        for first in range(left, right, BATCH_SIZE):
            start, n = j * visibility.pitch + first, min(right - first, BATCH_SIZE)
            packed = visibility.packed[start : start + n]
            if band.counts.n_exact == 0 or needs_decoding(packed):
                decode_batch(packed, band, (first, y), tint, batch, out_radiance, start)
            if band.counts.n_exact > 0 and has_exact(packed):
                interpolate_intensities(packed, setups, (first, y), band.coding.features, tint, out_radiance, start)


@helper
def decode_batch(packed, band, first, tint, batch, out_radiance, start):
    """Fill intensities that stand in packed samples and in planes; `first` is the sample (x, y) of the first packed
    sample, `start` its number in the band."""
    step, n_channel, n = np.float32(1.0 / band.coding.intensity_scale), out_radiance.shape[0], len(packed)
    has_affine, has_weighted = find_planes(packed) if band.counts.n_plane > 0 else (False, False)
    if not has_affine and not has_weighted:
        for channel in range(n_channel):
            # An intensity step times the tint, as the resolve stage multiplies it: rounded twice.
            factor = tint[channel] if n_channel > 1 else np.float32(1)
            decode_intensities(packed, step, factor, out_radiance[channel, start : start + n])
        return
    if has_weighted:
        fill_weights(packed, band.coding.depths, batch)
        evaluate_values(packed, plane_group(band.setups, VALUES), first, batch, f.NORMAL, f.WEIGHT)
    else:
        evaluate_planes(packed, plane_group(band.setups, VALUES), first, batch, f.NORMAL)
    if band.counts.n_level == 0 and all_have_colors(band.coding.features):
        for channel in range(n_channel):
            out, source = out_radiance[channel, start : start + n], f.NORMAL + channel * f.NEXT
            for k in range(n):
                out[k] = batch[source + k]
    elif n_channel == 1:
        merge_intensities(packed, step, batch[f.NORMAL : f.NORMAL + n], out_radiance[0, start : start + n])
    else:
        merge_colors(packed, band, step, tint, batch, out_radiance[:, start : start + n])


# ---------------------------------------------------------------- intensity steps of packed samples


@helper
def decode_intensities(packed, intensity_step, tint, out):
    """Fill intensities that stand in the packed samples."""
    for k in range(len(packed)):
        out[k] = np.float32(np.int32(packed[k] & INTENSITY_MASK)) * intensity_step * tint


@helper
def merge_intensities(packed, intensity_step, values, out):
    """Fill the intensities of one channel: those of the packed samples, or `values` where these hold indices."""
    for k in range(len(packed)):
        intensity = np.float32(np.int32(packed[k] & INTENSITY_MASK)) * intensity_step
        out[k] = values[k] if packed[k] & IS_ID else intensity


@helper
def merge_colors(packed, band, intensity_step, tint, batch, out):
    """Fill the intensities of three channels; those of the planes are in the batch."""
    for k in range(len(packed)):
        red, green, blue = batch[f.NORMAL + k], batch[f.NORMAL + f.NEXT + k], batch[f.NORMAL + f.NEXT + f.NEXT + k]
        if not packed[k] & IS_ID:
            red = np.float32(np.int32(packed[k] & INTENSITY_MASK)) * intensity_step
        if not packed[k] & IS_ID or not band.coding.features[material_of(packed[k], band.setups)] & HAS_COLORS:
            red, green, blue = red * tint[0], red * tint[1], red * tint[2]
        out[0, k], out[1, k], out[2, k] = red, green, blue


@helper
def all_have_colors(features):
    """Tell whether all materials have three channels."""
    common = HAS_COLORS
    for k in range(len(features)):
        common &= features[k]
    return common != 0


# ---------------------------------------------------------------- planes


@helper
def find_planes(packed):
    """Tell whether any packed sample holds the index of affine planes, or of an exact setup; and of weighted ones."""
    affine = weighted = 0
    for k in range(len(packed)):
        is_id = packed[k] >> (INTENSITY_BITS - 1)  # IS_ID at the place of IS_WEIGHTED
        affine |= is_id & ~packed[k]
        weighted |= is_id & packed[k]
    return affine & IS_WEIGHTED != 0, weighted & IS_WEIGHTED != 0


@helper
def fill_weights(packed, depths, batch):
    """Fill 1/r, by which the values of weighted planes are multiplied, see gradients.py; 1 for others."""
    offset, step = depths.ratio_offset, depths.ratio_scale
    for k in range(len(packed)):
        ratio = np.float32(offset + step * float(packed[k] >> PAYLOAD_BITS))
        batch[f.WEIGHT + k] = np.float32(1) / (ratio if packed[k] & IS_WEIGHTED else np.float32(1))


# ---------------------------------------------------------------- exact setups


@helper
def interpolate_intensities(packed, setups, first, features, tint, out_radiance, start):
    """Put in the intensities of exact setups; `first` is the sample (x, y) of the first packed sample, `start` its
    number in the band."""
    last_setup, n_channel = len(setups.integers) - 1, out_radiance.shape[0]
    k, end = next_exact_run(packed, 0)
    while k < end:
        # Where intensity steps stand in packed samples, a setup's number is a matter of arithmetic: whatever it is,
        # nothing else is read.
        setup = min(setup_of(packed[k]), last_setup)
        is_colored = bool(features[material_of(packed[k], setups)] & HAS_COLORS)
        for channel in range(n_channel):
            out, attribute = out_radiance[channel, start + k : start + end], channel if is_colored else 0
            interpolate_channel(setups, setup, attribute, (first[0] + k, first[1]), out)
            if n_channel > 1 and not is_colored:
                for i in range(end - k):
                    out[i] = out[i] * tint[channel]
        k, end = next_exact_run(packed, end)


@helper
def interpolate_channel(setups, setup, attribute, first, out):
    """Fill one channel of a run of samples that show one exact setup.

    The weights are computed anew for each channel: in vector instructions that takes less time than three channels
    together, sample by sample, and less to compile.
    """
    triangle = exact_triangle(setups, setup)
    of_corners = corner_values(setups.reals, setup, ATTRIBUTE + 3 * attribute)
    for k in range(len(out)):
        q = corner_weights(triangle, first[0] + k, first[1])
        out[k] = mean(of_corners, scale(q, inverse_sum(q)))


# ---------------------------------------------------------------- depth cueing

# What is further away fades towards a colour C: by the depth d of a sample its intensity I becomes
#
#     I' = s·I + (1 - s)·C      s = d0 / (d0 + max(d - start, 0))
#
# Source of the mix: Foley, van Dam, Feiner & Hughes 1990, section 16.1.3; of s: the attenuation 1/(d + d0) by the
# viewer's distance, Rogers 1985, section 5.2, scaled to 1 where it begins.
#
# The depth of what has an exact setup is found from it, in float64, as that of the depth buffer is: 1/w errs by about
# 2^-52 of the nearest one's. Elsewhere it is that of the packed sample, which errs by DEPTH_ERROR of itself at most
# (with perspective: see `check_distances` in gradients.py). A relative error e of d moves s by no more than
#
#     d·|ds/dd|·e = d·d0/(d0 + d - start)²·e <= (1/4 + start/d0)·e
#
# since with t = d - start >= 0 the quotient is t d0/(d0 + t)² + start d0/(d0 + t)². It moves I' by as much of |I - C|.

DEPTH_ERROR = 10 * 2.0**-24  # with perspective: how far off the depth of a packed sample may be, of itself


class Cue(NamedTuple):
    """How a picture fades with depth."""

    scale: float  # d0, scene units: s is 1/2 at start + scale
    start: float  # scene units
    color: np.ndarray  # (n_channel,) float64, linear


@kernel
def fade(band, depths, is_perspective, cue, out_radiance):
    """Fade the samples of a band; those that show nothing are left alone.

    Parameters
    ----------
    band : ScannedBand, whose coding is not read
    depths : DepthScale
    is_perspective : bool
    cue : Cue
    out_radiance : (n_channel, n_row * pitch) float64, linear, changed
    """
    color = cue.color
    visibility, setups = band.visibility, band.setups
    for j in range(band.n_row):
        left, right = row_extent(visibility, j)
        for i in range(left, right):
            sample = j * visibility.pitch + i
            packed = visibility.packed[sample]
            if packed >= CLEAR:
                continue
            if is_exact(packed):
                setup = setup_of(packed)
                triangle = exact_triangle(setups, setup)
                q = corner_weights(triangle, i, band.y_start + j)
                depth = depth_at(setups, setup, triangle, q, is_perspective)
            else:
                z = float(packed >> PAYLOAD_BITS)
                inverse = depths.inv_w_offset + depths.inv_w_scale * z
                depth = 1.0 / inverse if is_perspective else depths.depth_offset + depths.depth_scale * z
            share = cue.scale / (cue.scale + max(depth - cue.start, 0.0))
            for channel in range(out_radiance.shape[0]):
                out_radiance[channel, sample] = share * out_radiance[channel, sample] + (1.0 - share) * color[channel]
