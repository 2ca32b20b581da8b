"""Bands of scenes with transparent surfaces: the A-buffer takes the place of the one scan (pipeline/a_buffer.py)."""

import numpy as np

from ..pipeline.a_buffer import (
    FEW,
    Fragments,
    composite,
    divide_room,
    in_order_of_depth,
    open_layers,
    ranges_of,
    scan_opaque,
    show_first,
    take_fragments,
)
from ..pipeline.scan import Canvas
from .passes import Band, Pass


def draw_transparent_band(band: Band, drawn, render_pass: Pass, workspace) -> int:
    """Draw the opaque triangles of a band, list the fragments of the transparent ones before them at every sample, and
    composite what each sample shows; return the number of records, one for every triangle.

    `drawn` holds the triangles (draw.py).
    """
    transparent = np.empty(len(band.faces), np.int64)  # where they stand in band.faces
    n_transparent = scan_opaque(
        band.faces, drawn.polygons, drawn.vertices, render_pass.attributes, render_pass.coding, band.y_start,
        band.y_end, workspace.block, workspace.canvas, workspace.records, render_pass.opacity,
        drawn.face_table.materials, transparent,
    )  # fmt: skip
    transparent = count_fragments(band, drawn, workspace, transparent[:n_transparent])
    lengths = workspace.layers.start[: band.n_row * workspace.canvas.pitch + 1]
    for first, last in ranges_of(lengths, workspace.canvas.pitch):
        composite_range(band, drawn, render_pass, workspace, transparent, (first, last))
    return len(band.faces)


def count_fragments(band: Band, drawn, workspace, transparent) -> np.ndarray:
    """Count the fragments of each sample and divide the room among their lists; return the transparent triangles in the
    order in which the lists are filled."""
    layers, n_sample = workspace.layers, band.n_row * workspace.canvas.pitch
    counting = Fragments(0, n_sample, np.empty(0, np.int64), layers.cursor, layers.start, True)
    open_layers(layers)
    take_fragments(
        band.faces, transparent, drawn.polygons, drawn.vertices, band.y_start, 0, band.n_row, workspace.block,
        workspace.canvas, counting,
    )  # fmt: skip
    n_fragment, n_list = divide_room(layers, n_sample)
    if n_fragment > FEW * n_list:
        return in_order_of_depth(transparent, band.faces, drawn.polygons, drawn.vertices)
    return transparent


def composite_range(band: Band, drawn, render_pass: Pass, workspace, transparent, samples) -> None:
    """Fill the lists of the samples first..last of a band, then shade one layer after the other, nearest first, and sum
    them up."""
    canvas, layers, (first, last) = workspace.canvas, workspace.layers, samples
    first_row, end_row = first // canvas.pitch, -(-last // canvas.pitch)
    n_row = end_row - first_row
    words = np.empty(layers.start[last] - layers.start[first], np.int64)
    fragments = Fragments(first, last, words, layers.cursor, layers.start, False)
    take_fragments(
        band.faces, transparent, drawn.polygons, drawn.vertices, band.y_start, first_row, end_row, workspace.block,
        canvas, fragments,
    )  # fmt: skip
    show_first(canvas, layers, fragments, first_row, n_row)
    shown = workspace._replace(canvas=Canvas(layers.words, canvas.pitch, canvas.width, layers.left, layers.right))
    rows = Band(band.faces, band.y_start + first_row, band.y_start + end_row)
    n_composited, is_more = 0, True
    while is_more:
        render_pass.shade(shown, rows, len(band.faces), drawn.face_table)
        is_more = composite(
            canvas, workspace.records, layers, fragments, first_row, n_row, n_composited, workspace.radiance,
            workspace.texels, render_pass.opacity, drawn.face_table.materials,
        )  # fmt: skip
        n_composited += 1
