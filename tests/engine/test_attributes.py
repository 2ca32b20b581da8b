"""Check how the points that are lit before anything is drawn are shared out to threads."""

import numpy as np

from rasterizer.engine.attributes import Group, bundle, intersect


def test_groups_and_runs_meet_where_both_have_points():
    rng = np.random.default_rng(1)
    for _ in range(200):
        cuts = np.unique(rng.integers(0, 60, 12)).tolist()
        groups = [Group(k % 3, a, b) for k, (a, b) in enumerate(zip(cuts[:-1], cuts[1:], strict=True))]
        ends = np.unique(rng.integers(0, 60, 2 * int(rng.integers(1, 6)) + 2)).tolist()
        runs = list(zip(ends[::2], ends[1::2], strict=False))
        needed = {p for first, last in runs for p in range(first, last)}
        expected = {(g, p) for g in groups for p in range(g.start, g.end) if p in needed}
        found = [(g, p) for g, (first, last) in intersect(groups, runs) for p in range(first, last)]
        assert len(found) == len(set(found)) and set(found) == expected


def test_shares_keep_the_order_and_are_worth_a_thread():
    sizes = np.random.default_rng(2).integers(1, 2000, 100).tolist()
    ends = np.cumsum(sizes).tolist()
    pieces = [Group(0, end - size, end) for size, end in zip(sizes, ends, strict=True)]
    shares = bundle(pieces, 1000)
    assert [piece for share in shares for piece in share] == pieces
    assert all(sum(p.end - p.start for p in share) >= 1000 for share in shares[:-1])
    assert all(sum(p.end - p.start for p in share[:-1]) < 1000 for share in shares)
    assert bundle([], 1000) == []
