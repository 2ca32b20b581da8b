"""The kernels that do for one number of samples a pixel what others do for another: `raster warmup` compiles all."""

from ..compiler.signatures import signature_of
from ..pipeline.sample_grid import MOST_FACTOR, make_grid


def list_variants(signature: tuple) -> list[tuple]:
    """Return the signatures of the kernels that do for several samples a pixel, of any number, what the one with this
    signature does for another number; the signature alone where no SampleGrid is among its arguments."""
    grids = [signature_of((make_grid(factor),))[0] for factor in range(1, MOST_FACTOR + 1)]
    if not any(part in grids for part in signature):
        return [signature]
    return [tuple(grid if part in grids else part for part in signature) for grid in grids[1:]]
