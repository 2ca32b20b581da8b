"""Layers: what is seen through transparent surfaces, for scenes that have any. It takes the place of the scan stage's one pass.

In:  the band's list of triangles, which of them are opaque.
Out: every sample's colour, weighted by its opacity, and its opacity: all surfaces that are seen there, nearest first, up to the
     first opaque one.

The layers are peeled off one by one (Everitt 2001, "Interactive order-independent transparency"; Mammen 1989): each pass finds,
at every sample, the nearest surface behind the one before. Words hold depth above the triangle's number, so they order all
surfaces at a sample, whatever their order in the file: at equal depth the lower number lies in front, as everywhere.

    color += transmitted · a · c      opacity += transmitted · a      transmitted *= 1 - a
                                                        nearest first (Porter & Duff 1984, `over`)

The opacity is summed up by itself: 1 - transmitted has no digits left where surfaces are next to clear, and colours are divided
by it.
"""

from typing import NamedTuple

import numpy as np

from .._kernel import borrow, helper, kernel
from .block import (
    BLOCK,
    BOTTOM,
    IS_SLIVER,
    LEFT,
    RIGHT,
    TOP,
    Block,
    borrow_polygons,
    gather_attributes,
    gather_vertices,
    order_vertices,
    set_up_boxes,
    set_up_depths,
)
from .records import FACE, IS_EXACT, IS_ID, RECORD_MASK, borrow_records, write_exact
from .scan import CLEAR, GROUP_SHIFT, Canvas, depths_of, fill, fill_spans, note_extent, plane_of, triangle_of
from .transform import Vertices

IN_FRONT_OF_ALL, BEHIND_ALL = np.int64(-1), np.int64(2**63 - 1)


class Layers(NamedTuple):
    """What is kept between the passes over a band, a value a sample; nothing where the scene is opaque."""

    opaque: np.ndarray  # (rows * pitch,) int64: the words of the opaque surfaces; CLEAR where the sample is done
    floor: np.ndarray  # (rows * pitch,) int64: the word of the layer before
    transmitted: np.ndarray  # (rows * pitch,): the part of the light from behind that arrives
    opacity: np.ndarray  # (rows * pitch,): the rest of it
    color: np.ndarray  # (n_channel, rows * pitch)


class Opacity(NamedTuple):
    """How transparent the materials are."""

    opacity: np.ndarray  # (n_material,) float64
    is_opaque: np.ndarray  # (n_material,) bool: also the texture is


@kernel
def scan_opaque(faces, polygons, vertices, attributes, coding, y_start, y_stop, block, canvas, records, opacity, material):
    """Write an exact record for every triangle, its number the place in the list; draw those that are opaque."""
    faces, attributes, records = borrow(faces), borrow(attributes), borrow_records(records)
    vertices, polygons, canvas, block = borrow_all(vertices, polygons, canvas, block)
    for first in range(0, len(faces), BLOCK):
        some = faces[np.uint64(first) : np.uint64(min(first + BLOCK, len(faces)))]
        gather_vertices(some, polygons, vertices, block)
        order_vertices(block)
        gather_attributes(len(some), attributes, block)
        set_up_boxes(y_start, y_stop, canvas.width, block)
        set_up_depths(block)
        for k in range(np.uint64(len(some))):
            write_exact(records, first + np.int64(k), k, some[k], attributes.shape[2], coding, block)
            left, right, top, bottom = box_of(k, block)
            if left < right and top < bottom and opacity.is_opaque[material_of(some[k], material)]:
                note_extent(canvas, left, right, top - y_start, bottom - y_start)
                payload = (IS_ID | IS_EXACT | (first + np.int64(k)), np.int64(0), np.int64(0))
                fill(canvas, (left, right, top, bottom, (top - y_start) * canvas.pitch), k, payload, block)


@kernel
def scan_layer(faces, polygons, vertices, y_start, y_stop, block, canvas, floor, opacity, material):
    """Draw the transparent triangles that lie behind the layer before and before what stands in the canvas."""
    faces, floor = borrow(faces), borrow(floor)
    vertices, polygons, canvas, block = borrow_all(vertices, polygons, canvas, block)
    for first in range(0, len(faces), BLOCK):
        some = faces[np.uint64(first) : np.uint64(min(first + BLOCK, len(faces)))]
        gather_vertices(some, polygons, vertices, block)
        order_vertices(block)
        set_up_boxes(y_start, y_stop, canvas.width, block)
        set_up_depths(block)
        for k in range(np.uint64(len(some))):
            left, right, top, bottom = box_of(k, block)
            if left < right and top < bottom and not opacity.is_opaque[material_of(some[k], material)]:
                note_extent(canvas, left, right, top - y_start, bottom - y_start)
                box = (left, right, top, bottom, (top - y_start) * canvas.pitch)
                payload = (IS_ID | IS_EXACT | (first + np.int64(k)), np.int64(0), np.int64(0))
                plane, is_sliver = plane_of(k, payload, block), block.ints[IS_SLIVER + k] != 0
                fill_spans(canvas, box, triangle_of(k, block), plane, is_sliver, depths_of(k, block), payload[0], floor)


@helper
def borrow_all(vertices, polygons, canvas, block):
    """The arrays of these, without counted references."""
    return (
        Vertices(borrow(vertices.x), borrow(vertices.y), borrow(vertices.z)),
        borrow_polygons(polygons),
        Canvas(borrow(canvas.words), canvas.pitch, canvas.width, borrow(canvas.left), borrow(canvas.right)),
        Block(borrow(block.ints), borrow(block.longs), borrow(block.reals)),
    )


@helper
def box_of(k, block):
    """The box of triangle k of the block, clipped to the band."""
    return (
        np.int64(block.ints[LEFT + k]), np.int64(block.ints[RIGHT + k]),
        np.int64(block.ints[TOP + k]), np.int64(block.ints[BOTTOM + k]),
    )  # fmt: skip


@helper
def material_of(face, material):
    """The material of a triangle; `material` is empty where there is one."""
    return material[face] if len(material) > 0 else np.uint32(0)


@kernel
def open_layers(canvas, layers):
    """Begin with the opaque surfaces in the canvas, and with all light transmitted."""
    words = borrow(canvas.words)
    opaque, floor, transmitted = borrow(layers.opaque), borrow(layers.floor), borrow(layers.transmitted)
    total = borrow(layers.opacity)
    zero, one = layers.color.dtype.type(0), layers.color.dtype.type(1)
    for k in range(np.uint64(len(words))):
        opaque[k], floor[k], transmitted[k], total[k] = words[k], IN_FRONT_OF_ALL, one, zero
    for channel in range(np.uint64(layers.color.shape[0])):
        for k in range(np.uint64(len(words))):
            layers.color[channel, k] = zero


@kernel
def composite(canvas, records, n_row, layers, radiance, texels, opacity, material):
    """Put the layer in the canvas behind those before; make the canvas ready for the next pass; return whether one is needed."""
    words, left, right = borrow(canvas.words), borrow(canvas.left), borrow(canvas.right)
    records, material, opaque, floor = borrow_records(records), borrow(material), borrow(layers.opaque), borrow(layers.floor)
    transmitted, color, radiance = borrow(layers.transmitted), borrow(layers.color), borrow(radiance)
    texels, total = borrow(texels), borrow(layers.opacity)
    number = transmitted.dtype.type
    is_more = False
    for j in range(n_row):
        group = np.uint64(j) >> np.uint64(GROUP_SHIFT)
        for k in range(np.uint64(j * canvas.pitch + left[group]), np.uint64(j * canvas.pitch + max(left[group], right[group]))):
            word = words[k]
            if word >= CLEAR:
                continue
            alpha = number(1)
            if word != opaque[k]:
                face = np.uint64(records.integers[np.uint64(word & RECORD_MASK), np.uint64(FACE)])
                alpha = number(opacity.opacity[material_of(face, material)])
                if texels.shape[0] > 0:
                    alpha *= texels[3, k]
            share = transmitted[k] * alpha
            total[k] += share
            for channel in range(np.uint64(color.shape[0])):
                color[channel, k] += share * radiance[channel, k]
            transmitted[k] *= number(1) - alpha
            is_done = word == opaque[k] or transmitted[k] == number(0)
            opaque[k] = CLEAR if is_done else opaque[k]
            floor[k] = BEHIND_ALL if is_done else word
            words[k] = opaque[k]
            is_more |= not is_done
    return is_more
