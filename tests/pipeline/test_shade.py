"""Check the shade stage: exact interpolation, light, and that batches and neighbours don't change a bit."""

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.pairs import pairs
from helpers.stages import (
    band_of,
    covered,
    exact_means,
    plain_coding,
    plain_screen,
    random_triangles,
    scan_alone,
    slivers,
)

from rasterizer.pipeline.fragments import BATCH_SIZE
from rasterizer.pipeline.gradients import EXACT
from rasterizer.pipeline.shade import shade_interpolated

SIZE, WIDE = (120, 90), (3 * BATCH_SIZE + 50, 12)
DEPTHS = (1.0, 4.0)
DTYPES = [np.float32, np.float64]
WHITE = np.ones(3, np.float32)


def shade(scanned, coding, size, n_channel):
    """Intensities (n_channel, rows, columns) of a band of packed samples, planes or exact setups."""
    workspace, counts = scanned
    workspace.radiance[:] = np.nan
    band = band_of(workspace, coding, counts, size[1])
    shade_interpolated(band, WHITE, workspace.batch, workspace.radiance[:n_channel])
    return workspace.radiance[:n_channel].reshape(n_channel, size[1], -1)[:, :, : size[0]]


def exact_coding(base, screen, n_attributes, dtypes, **options):
    """A coding under which all setups are exact: in float32 that of intensities ("values") or of normals, as scenes
    have it."""
    if dtypes is np.float64:
        return plain_coding("exact", screen, n_attributes, dtypes, **options)
    coding = plain_coding(base, screen, n_attributes, dtypes, **options)
    return coding._replace(paths=np.full_like(coding.paths, EXACT))


SHAPES = {
    "small": lambda rng: random_triangles(rng, 12, SIZE, 6.0),
    "large": lambda rng: random_triangles(rng, 3, SIZE, 60.0),
    "far out": lambda rng: random_triangles(rng, 8, SIZE, 2.0**18).clip(-(2**28), 2**28),
    "sliver": lambda rng: slivers(rng, 80, SIZE, 500, 4),
    "needle": lambda rng: slivers(rng, 400, SIZE, 2**19, 1).clip(-(2**28), 2**28),
}


@pytest.mark.parametrize(
    "shape, n_channel, is_perspective, dtype",
    pairs(shape=SHAPES, n_channel=(1, 3), is_perspective=(True, False), dtype=DTYPES),
)
def test_exact_interpolation_is_that_of_rational_numbers(shape, n_channel, is_perspective, dtype):
    rng, screen = np.random.default_rng(1), plain_screen(is_perspective, DEPTHS)
    coding = exact_coding("values", screen, n_channel, dtype)
    worst, n_sample = 0.0, 0
    for triangle in SHAPES[shape](rng):
        rows, columns, edges = covered(triangle, SIZE)
        if not len(rows) or n_sample > 1000:
            continue
        depth, values = rng.uniform(*DEPTHS, 3), rng.random((3, n_channel)).astype(dtype)
        values[:, 0] = values[0, 0] if len(rows) % 2 else values[:, 0]  # a constant stays one
        scanned = scan_alone([triangle], depth[None], values[None], coding, screen, SIZE)
        found = shade(scanned, coding, SIZE, n_channel)[:, rows, columns]
        assert not differences(found >= values.min(axis=0)[:, None], True)
        assert not differences(found <= values.max(axis=0)[:, None], True)
        some = rng.permutation(len(rows))[:20]
        n_sample += len(some)
        for channel in range(n_channel):
            expected = exact_means(edges[:, some], depth, values[:, channel], is_perspective)
            worst = max(worst, np.abs(found[channel, some] - expected).max())
    budget = 16 * np.finfo(dtype).eps / 2
    assert n_sample > 30 and worst <= budget, f"{worst:.3g} > {budget:.3g}, {n_sample} samples"
