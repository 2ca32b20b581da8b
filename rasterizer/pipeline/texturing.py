"""Stage 6, shade, of textured surfaces: what their textures show, and intensities of vertices times texels.

In:  the band's visibility entries and records: the paths by which texture coordinates come are planes, and exact.
Out: of a run of samples that show one material, four quantities of a batch of fragments: red, green, blue and alpha
     (`fill_texels`), by which Phong's method multiplies its albedo. By flat shading and Gouraud's method `radiance` of
     the samples that show a textured surface; shade.py has filled that of the others.

Planes are looked up in float32 (texture_lookup.py). So are exact records, such as those of large triangles, where exact
texture coordinates make that good enough (`TextureCoding.is_exact_looked_up`); else in float64 (texture_sampling.py).

Attributes 0-2 of a textured surface are what a black one gives off, 3-5 what the whole one gives off:

    I = I_rest + texel · (I_whole - I_rest)
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import choice, class_of, field_of, helper, index, is_none, kernel
from . import fragments as f
from .fragments import BATCH_SIZE, get_vector
from .gradients import HAS_TEXTURE, IS_TRANSPARENT, LevelCoding
from .interpolate import corner_values, exact_triangle, has_exact, has_planes, mean, next_exact_run, row_extent
from .power import is_single
from .records import ATTRIBUTE, BEHIND_VALUES, PLAIN_GROUP, VALUES, material_of, plane_group
from .samples import (
    evaluate_planes,
    evaluate_slopes,
    evaluate_values,
    skip_to,
)
from .shade import fill_weights
from .texture_lookup import (
    IS_DOUBTFUL,
    MIP_LEVEL,
    S_PLANE,
    S,
    T,
    clear_texcoords,
    coarsest_level,
    compute_texcoords,
    from_bits,
    mip_level,
    read_texels,
)
from .texture_sampling import (
    BARYCENTRIC,
    TEXCOORD_S,
    TEXCOORD_T,
    corner_texcoords,
    fill_barycentric,
    fill_squares,
    fill_texcoords,
    sample_run,
)
from .texture_sampling import MIP_LEVEL as DOUBLE_MIP_LEVEL
from .textures import FILTER_TRILINEAR, FIRST_TEXCOORD, Textures, packed_texture
from .visibility import CLEAR, IS_ID, is_exact, next_stretch, record_of, stretch_of, strip_of


class Texturing(NamedTuple):
    """The textures of a scene, and memory for looking them up."""

    textures: Textures
    lookup_batch: np.ndarray  # see texture_lookup.py
    double_batch: np.ndarray  # see texture_sampling.py
    texels: np.ndarray  # (4, n_row * pitch) float64: those of exact records; the alpha of all, for transparent surfaces
    of_metals: np.ndarray | None  # (n_material,) int64, the metallic-roughness texture of each, -1 for none, whose
    # texels stand behind the others, (8, n_row * pitch); None where there are none: then they are not compiled


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
            n = index(min(end - first, BATCH_SIZE))
            n, is_blank = next_stretch(visibility.entries[start : start + n])
            if is_blank:
                material = np.int64(-1)
            elif material < 0:
                n, material = run_of_texture(visibility.entries[start : start + index(n)], band)
            elif not band.coding.features[material] & HAS_TEXTURE:
                n, material = end - first, np.int64(-1)
            if material >= 0:
                entries = visibility.entries[start : start + index(n)]
                where = first, y
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
                here = here if band.coding.features[here] & HAS_TEXTURE else np.int64(-1)
            if here != material:
                if k > 0:
                    return np.int64(k), material
                material = here
    return np.int64(len(entries)), material


@choice
def shade_planes(entries, band, first, material, texturing, start, batch, out_radiance):
    """Fill the intensities of samples that show planes; of exact records anything is written.

    `first` says where the samples lie (samples.py), `start` is the index of the first in the band.
    """
    return evaluate_textured if class_of(field_of(band, "coding")) is LevelCoding else leave_textured


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
    """Fill the intensities of exact records; `first` says where the samples lie (samples.py), `start` is the
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


# ---------------------------------------------------------------- what a texture shows


@helper
def put_in_metals(of_metals, texels, material, start, n, batch):
    """Put in what the metallic-roughness texture of a material shows, if it has one."""
    if of_metals is not None:
        if of_metals[material] >= 0:
            for k in range(n):
                batch[f.ROUGHNESS + k] = texels[5, start + k]  # green
                batch[f.METALLIC + k] = texels[6, start + k]  # blue


@helper
def fill_texels(entries, band, first, material, texturing, start, batch, quantity):
    """Fill four quantities with what the texture of a material shows at samples that show it: after
    `evaluate_texcoords`, or what does the same.

    Parameters
    ----------
    entries : (n,) int64, n <= BATCH_SIZE; what doesn't show the material gets anything
    band : ScannedBand
    first : where they lie (samples.py)
    start : index of the first entry's sample in the band
    quantity : the first of the four, such as TEXEL

    Returns
    -------
    whether exact records of the material were looked up, too, which `sample_textures` has left out then
    """
    with_exact = look_up_planes(entries, band, first, material, texturing, start, batch, quantity)
    if not with_exact and band.counts.n_exact > 0 and has_exact(entries):
        put_in_exact(entries, texturing.texels, start, batch, quantity)
    if band.coding.features[material] & IS_TRANSPARENT:
        for k in range(index(len(entries))):
            texturing.texels[3, start + k] = batch[quantity + f.NEXT + f.NEXT + f.NEXT + k]
    return with_exact


@helper
def put_in_exact(entries, texels, start, batch, quantity):
    """Put in what textures show at the samples of exact records; `start` is the index of the first in the band."""
    first, end = next_exact_run(entries, index(0))
    while first < end:
        for channel in range(index(4)):
            for k in range(first, end):
                batch[quantity + channel * f.NEXT + k] = batch.dtype.type(texels[channel, start + k])
        first, end = next_exact_run(entries, end)


@helper
def keep_exact(entries, texels, start, batch, quantity):
    """Keep what textures show at the samples of exact records, where `put_in_exact` finds it."""
    first, end = next_exact_run(entries, index(0))
    while first < end:
        for channel in range(index(4)):
            source, kept = quantity + channel * f.NEXT, texels[channel, start + first : start + end]
            for k in range(end - first):
                kept[k] = float(batch[source + first + k])
        first, end = next_exact_run(entries, end)


def has_texcoord_planes(band, batch) -> bool:
    """Tell by their types whether texture coordinates stand in planes: not where a batch is of float64."""
    return is_single(batch.dtype) and not is_none(field_of(field_of(band, "coding"), "textures"))


@choice
def evaluate_texcoords(entries, band, first, material, group_column, texturing, batch):
    """Evaluate the planes of texture coordinates into the batch of `texturing`, with their slopes where it needs them.

    group_column : where they begin in records
    batch : see fragments.py; its type alone counts
    """
    return gather_texcoords if has_texcoord_planes(band, batch) else leave_texcoords


@helper
def leave_texcoords(entries, band, first, material, group_column, texturing, batch):
    """Do nothing."""


@helper
def gather_texcoords(entries, band, first, material, group_column, texturing, batch):
    """See `evaluate_texcoords`."""
    coding, rows, group = band.coding.textures, texturing.lookup_batch, plane_group(band.records, group_column)
    texture = coding.of_materials[material]
    if texture < 0:  # computed in float64: all of its records are exact
        return
    if coding.packed.filters[index(texture)] == FILTER_TRILINEAR:
        evaluate_slopes(entries, group, first, rows, S_PLANE, index(BATCH_SIZE))
    else:
        evaluate_planes(entries, group, first, rows, S_PLANE, index(BATCH_SIZE))


@choice
def look_up_planes(entries, band, first, material, texturing, start, batch, quantity):
    """Fill the quantities of samples whose texture coordinates stand in planes, or are exact and looked up as these;
    tell whether the latter are."""
    return look_up if has_texcoord_planes(band, batch) else leave_lookup


@helper
def leave_lookup(entries, band, first, material, texturing, start, batch, quantity):
    """Do nothing."""
    return False


@helper
def look_up(entries, band, first, material, texturing, start, batch, quantity):
    """See `look_up_planes`."""
    coding, rows, n = band.coding.textures, texturing.lookup_batch, len(entries)
    if coding.of_materials[material] < 0:  # computed in float64: all of its records are exact
        return False
    texture, with_exact = index(coding.of_materials[material]), coding.is_exact_looked_up[material]
    packed = packed_texture(coding.packed, texture)
    if band.counts.n_exact == 0 or has_planes(entries):
        compute_texcoords(rows, n, packed)
    elif with_exact:
        clear_texcoords(rows, n)
    else:
        return False
    if with_exact and band.counts.n_exact > 0 and has_exact(entries):
        put_in_exact_texcoords(entries, band.records, first, material, packed, texturing.double_batch, rows)
    if read_texels(rows, n, packed, batch, quantity, f.NEXT):
        look_up_doubtful(entries, band, first, texture, texturing, start, batch, quantity)
    return with_exact


@helper
def put_in_exact_texcoords(entries, records, first, material, texture, double_batch, rows):
    """Put in texture coordinates and mip levels of a material's exact records, as they are looked up in float32.

    A coordinate within the picture is a fraction of 2^32: what it loses, and what the mip level does, is what those of
    planes lose beside their own errors (textures.py).
    """
    coarsest, size = coarsest_level(texture), (texture.width, texture.height)
    start, end = next_exact_run(entries, index(0))
    while start < end:
        if material_of(entries[start], records) != material:
            start, end = next_exact_run(entries, end)
            continue
        n, record, where = end - start, record_of(entries[start]), skip_to(first, start)
        corners = corner_texcoords(records, record, FIRST_TEXCOORD)
        fill_barycentric(records, record, where, n, double_batch)
        fill_texcoords(corners, n, texture.wraps, double_batch)
        for k in range(n):
            rows[S + start + k] = from_bits(fixed_point(double_batch[TEXCOORD_S + k]))
            rows[T + start + k] = from_bits(fixed_point(double_batch[TEXCOORD_T + k]))
        if texture.filter == FILTER_TRILINEAR:
            fill_squares(exact_triangle(records, record), corners, n, size, double_batch)
            for k in range(n):
                rows[MIP_LEVEL + start + k] = mip_level(np.float32(double_batch[DOUBLE_MIP_LEVEL + k]), coarsest)
        start, end = next_exact_run(entries, end)


@helper
def fixed_point(x):
    """Return a number within 0..1 as a whole number, 2^32 for 1; but 1 itself is the largest below."""
    return np.int32(np.int64(min(x * 2.0**32, 2.0**32 - 1.0)))


@helper
def look_up_doubtful(entries, band, first, texture, texturing, start, batch, quantity):
    """Look up exactly what lies next to the border of two texels that are not blended: its record has corners, too."""
    for k in range(index(len(entries))):
        is_doubtful = texturing.lookup_batch[IS_DOUBTFUL + k] != np.float32(0)
        if is_doubtful and entries[k] & IS_ID and not is_exact(entries[k]):
            sample, record = skip_to(first, k), record_of(entries[k])
            texels = texturing.texels[:, start + k : start + k + index(1)]
            sample_run(band.records, record, sample, texturing.textures, texture, texturing.double_batch, texels)
            for channel in range(index(4)):
                batch[quantity + channel * f.NEXT + k] = np.float32(texels[channel, 0])
