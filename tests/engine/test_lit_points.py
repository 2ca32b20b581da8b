"""Check how the points that are lit before anything is drawn are shared out to threads."""

import numpy as np

from rasterizer.engine.lit_points import Group, bundles_of


def test_shares_keep_the_order_and_are_worth_a_thread():
    sizes = np.random.default_rng(2).integers(1, 2000, 100).tolist()
    ends = np.cumsum(sizes).tolist()
    pieces = [Group(0, end - size, end) for size, end in zip(sizes, ends, strict=True)]
    shares = bundles_of(pieces, 1000)
    assert [piece for share in shares for piece in share] == pieces
    assert all(sum(p.end - p.start for p in share) >= 1000 for share in shares[:-1])
    assert all(sum(p.end - p.start for p in share[:-1]) < 1000 for share in shares)
    assert bundles_of([], 1000) == []
