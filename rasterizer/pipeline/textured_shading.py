"""Stage 6, shade, of textured surfaces by flat shading and Gouraud's method: intensities of vertices times texels.

In:  the band's visibility entries and records. Attributes 0-2 of a textured surface are what a black one gives off, 3-5
     what the whole one gives off.
Out: `radiance` of the samples that show a textured surface. shade.py has filled that of the others.

    I = I_rest + texel · (I_whole - I_rest)
"""

import numpy as np

from ..compiler.kernels import choice, helper, index, kernel
from . import fragments as f
from .fragments import BATCH_SIZE, get_vector
from .gradients import NEEDS_TEXTURE, LevelCoding
from .interpolate import corner_values, has_exact, has_planes, mean, next_exact_run, row_extent
from .records import ATTRIBUTE, BEHIND_VALUES, PLAIN_GROUP, VALUES, material_of, plane_group
from .screen_points import evaluate_values, samples_from, skip_to
from .shade import fill_weights
from .texture_sampling import BARYCENTRIC, fill_barycentric
from .texturing import evaluate_texcoords, fill_texels, keep_exact
from .visibility import CLEAR, IS_ID, record_of, stretch_of, strip_of

REST, WHOLE = f.NORMAL, f.VIEW_DIR  # where planes' intensities stand in a batch


@kernel
def shade_textured(band, texturing, batch, out_radiance):
    """Interpolate the light that a texture weakens and the rest apart, for the samples that show a texture.

    Parameters
    ----------
    band : ScannedBand
    texturing : Texturing, after `sample_textures`
    batch : see fragments.py, float32
    out_radiance : (3, n_row * pitch) float32 or float64, linear
    """
    visibility = band.visibility
    for j in range(band.n_row):
        y, (first, right) = band.y_start + j, row_extent(visibility, j)
        while first < right:
            start = index(j * visibility.pitch + first)
            end, material = stretch_of(visibility, strip_of(j), first, right, band.counts.material)
            n = min(end - first, BATCH_SIZE)
            if material < 0:
                n, material = run_of_texture(visibility.entries[start : start + index(n)], band)
            elif not band.coding.needs[material] & NEEDS_TEXTURE:
                n, material = end - first, np.int64(-1)
            if material >= 0:
                entries = visibility.entries[start : start + index(n)]
                where = samples_from(band.points, (first, y), start, index(n))
                shade_planes(entries, band, where, material, texturing, start, batch, out_radiance)
                if has_exact(entries):
                    shade_exact(entries, band.records, where, texturing, start, out_radiance)
            first += n


@helper
def run_of_texture(entries, band):
    """Return the length of a run of samples, and the one textured material that it shows; -1 where it shows none."""
    material = np.int64(-1)
    for k in range(index(len(entries))):
        if entries[k] < CLEAR:  # samples that show nothing belong to any run: their entries read as record 0
            here = np.int64(-1)
            if entries[k] & IS_ID:
                here = material_of(entries[k], band.records)
                here = here if band.coding.needs[here] & NEEDS_TEXTURE else np.int64(-1)
            if here != material:
                if k > 0:
                    return np.int64(k), material
                material = here
    return np.int64(len(entries)), material


def choose_shading(entries, band, first, material, texturing, start, batch, out_radiance):
    """Return what is compiled in the place of `shade_planes`: nothing where all records are exact."""
    coding = dict(zip(band.fields, band.types, strict=True))["coding"]
    return evaluate_textured if coding.instance_class is LevelCoding else leave_textured


@choice(choose_shading)
def shade_planes(entries, band, first, material, texturing, start, batch, out_radiance):
    """Fill the intensities of samples that show planes; of exact records anything is written.

    `first` says where the samples lie (screen_points.py), `start` is the index of the first in the band.
    """
    if isinstance(band.coding, LevelCoding):
        evaluate_textured(entries, band, first, material, texturing, start, batch, out_radiance)


@helper
def leave_textured(entries, band, first, material, texturing, start, batch, out_radiance):
    """Do nothing."""


@helper
def evaluate_textured(entries, band, first, material, texturing, start, batch, out_radiance):
    """See `shade_planes`. Of exact records, texels are looked up or kept for `shade_exact`."""
    shows_planes = has_planes(entries)
    if shows_planes:
        evaluate_texcoords(entries, band, first, material, BEHIND_VALUES, texturing, batch)
    if fill_texels(entries, band, first, material, texturing, start, batch, f.TEXEL):
        keep_exact(entries, texturing.texels, start, batch, f.TEXEL)
    if shows_planes:
        mix_values(entries, band, first, start, batch, out_radiance)


@helper
def mix_values(entries, band, first, start, batch, out_radiance):
    """Evaluate the planes of intensities, and mix them by the texels that the batch holds."""
    records, n = band.records, index(len(entries))
    fill_weights(entries, band.coding.depths, batch)
    evaluate_values(entries, plane_group(records, VALUES), first, batch, REST, f.NEXT, f.WEIGHT)
    group = plane_group(records, BEHIND_VALUES + PLAIN_GROUP)
    evaluate_values(entries, group, first, batch, WHOLE, f.NEXT, f.WEIGHT)
    for channel in range(index(3)):
        step, out = channel * f.NEXT, out_radiance[channel, start : start + n]
        for k in range(n):
            rest, whole = batch[REST + step + k], batch[WHOLE + step + k]
            out[k] = rest + batch[f.TEXEL + step + k] * (whole - rest)


@helper
def shade_exact(entries, records, first, texturing, start, out_radiance):
    """Fill the intensities of exact records; `first` says where the samples lie (screen_points.py), `start` is the
    index of the first in the band.

    Channel by channel over weights that are known: so each loop becomes vector instructions.
    """
    batch, (k, end) = texturing.double_batch, next_exact_run(entries, index(0))
    while k < end:
        record, n = record_of(entries[k]), end - k
        fill_barycentric(records, record, skip_to(first, k), n, batch)
        for channel in range(index(3)):
            column = index(ATTRIBUTE) + index(3) * channel
            of_rest = corner_values(records.reals, record, column)
            of_whole = corner_values(records.reals, record, column + index(9))
            texels = texturing.texels[channel, start + k : start + end]
            out = out_radiance[channel, start + k : start + end]
            for i in range(n):
                p = get_vector(batch, BARYCENTRIC, i)
                rest, whole = mean(of_rest, p), mean(of_whole, p)
                out[i] = rest + (whole - rest) * texels[i]
        k, end = next_exact_run(entries, end)
