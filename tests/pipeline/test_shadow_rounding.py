"""How far rounding moves the limit of a shadow look-up, against decimal numbers of 60 digits."""

from decimal import Decimal, localcontext

import numpy as np
import pytest

from rasterizer.engine.domains import DOUBLE, SINGLE
from rasterizer.pipeline import fragments as f
from rasterizer.pipeline import shadow_lookup as lookup

N_POINT = 128
SIZE, FILTER = 64, 3
ZERO = Decimal(0)


def unit(vectors):
    """Unit vectors, float64."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def make_header(rng, dtype, is_perspective, distance):
    """The header of a light with one map, as the engine writes it, in float64 and in a type."""
    u = SINGLE if dtype == np.float32 else DOUBLE
    header = np.zeros(lookup.HEADER)
    axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    scale = SIZE / 4 if is_perspective else SIZE / 8.0  # half a map's angle has a tangent of 2; 8 units wide
    first = lookup.MAPS
    header[[lookup.N_MAP, lookup.SIZE, lookup.FILTER, lookup.IS_PERSPECTIVE]] = 1, SIZE, FILTER, is_perspective
    header[lookup.ORIGIN : lookup.ORIGIN + 3] = distance * unit(rng.normal(size=3))
    header[lookup.FILTER_RANGE] = (FILTER + 2) / scale
    header[first : first + 9] = axes.ravel()
    header[first + lookup.SCALE_X : first + lookup.CENTER_Y + 1] = scale, scale, SIZE / 2, SIZE / 2
    rounded = header.astype(dtype)
    return header, rounded, u


def random_points(rng, header, side):
    """Points of polygons whose longest sides are about `side`, before a light, float64: rows as a batch has them."""
    axes = header[lookup.MAPS : lookup.MAPS + 9].reshape(3, 3)
    depth = rng.uniform(1, 4, N_POINT)
    across = rng.uniform(-1.8, 1.8, (N_POINT, 2)) * (depth[:, None] if header[lookup.IS_PERSPECTIVE] else 2.0)
    position = depth[:, None] * axes[2] + across @ axes[:2] + header[lookup.ORIGIN : lookup.ORIGIN + 3]
    plane = unit(rng.normal(size=(N_POINT, 3)) - rng.uniform(-3, 3, (N_POINT, 1)) * axes[2])
    normal = unit(plane + 10.0 ** rng.uniform(-5, 0, (N_POINT, 1)) * rng.normal(size=(N_POINT, 3)))
    offset = (plane * position).sum(axis=1)
    moved = position + 2.0**-12 * rng.normal(size=(N_POINT, 1)) * plane  # by the rounding of the picture's vertices
    return np.column_stack([moved, normal, plane, offset, side * rng.uniform(0.1, 1, N_POINT)])


def dot(a, b):
    """Of decimal numbers."""
    return sum((x * y for x, y in zip(a, b, strict=True)), ZERO)


def find_exact(header, row, column, line):
    """The value that a point's plane has at the centre of a texel, 1/|c|, 1/w, the distances that rounding is counted
    in, and the sum of the slopes; None of a point that is always lit."""
    position, normal, plane = (tuple(map(Decimal, row[k : k + 3].tolist())) for k in (0, 3, 6))
    offset, side = Decimal(float(row[9])), Decimal(float(row[10]))
    numbers = list(map(Decimal, header[: lookup.MAPS + lookup.N_MAP_COLUMN].tolist()))
    origin, is_perspective = numbers[lookup.ORIGIN : lookup.ORIGIN + 3], numbers[lookup.IS_PERSPECTIVE] != 0
    right, up, forward = (numbers[lookup.MAPS + k : lookup.MAPS + k + 3] for k in (0, 3, 6))
    scale, center = numbers[lookup.MAPS + lookup.SCALE_X], numbers[lookup.MAPS + lookup.CENTER_X]
    agreement = dot(plane, normal)
    beyond = offset - dot(plane, origin) if is_perspective else dot(plane, forward)
    is_front = beyond * agreement < 0
    tilted = [b - a * agreement for a, b in zip(plane, normal, strict=True)]
    from_origin = [a - b for a, b in zip(position, origin, strict=True)]
    away = dot(from_origin, from_origin).sqrt() if is_perspective else Decimal(1)
    near = min(side, numbers[lookup.FILTER_RANGE] * away) if is_front else side
    back, lift = offset - dot(plane, position), dot(tilted, tilted).sqrt() * near
    point = [a + back * b + lift * c for a, b, c in zip(from_origin, plane, normal, strict=True)]
    compared = plane if is_front else normal
    depth, constant = dot(point, forward), dot(compared, point if is_perspective else forward)
    if (is_perspective and depth < Decimal("0.05")) or abs(constant) < Decimal("0.01"):
        return None
    a, b = (Decimal(column) + Decimal("0.5") - center) / scale, (center - Decimal(line) - Decimal("0.5")) / scale
    if is_perspective:
        value = (dot(compared, forward) + a * dot(compared, right) + b * dot(compared, up)) / constant
    else:
        value = -(dot(compared, point) - a * dot(compared, right) - b * dot(compared, up)) / constant
    slopes = (abs(dot(compared, right)) + abs(dot(compared, up))) / abs(constant) / scale
    length = sum(map(abs, point), ZERO) + sum(map(abs, origin), ZERO)
    magnification = 1 / depth if is_perspective else Decimal(1)
    nearness = sum(map(abs, point), ZERO) / abs(constant) if is_perspective else 1 / abs(constant)
    return value, magnification / abs(constant), length, near, slopes, nearness, 1 / abs(constant), scale


def count_roundings(rng, dtype, is_perspective, distance, side):
    """The largest error of a limit over what one of ROUNDINGS allows, and of how many points."""
    header, rounded, u = make_header(rng, dtype, is_perspective, distance)
    rows = random_points(rng, header, side)
    batch, n = f.make_batch(dtype), f.BATCH_SIZE
    worst, n_checked = 0.0, 0
    for start in range(0, N_POINT, int(n)):
        some = rows[start : start + int(n)]
        for k, quantity in enumerate(GIVEN):
            batch[quantity : quantity + len(some)] = some[:, k]
        lookup.move_points(batch, rounded, len(some))
        view = lookup.read_view(rounded, 0)._replace(slack=dtype(0), position_rounding=dtype(0), normal_error=dtype(0))
        lookup.compute_limits(batch, view, SIZE, FILTER >> 1, 0, len(some))
        for k in range(len(some)):
            limit = float(batch[lookup.LIMIT + k])
            texel = int(lookup.index_of(batch[lookup.TEXEL_IDX + k]))
            found = find_exact(header, some[k], texel % SIZE, texel // SIZE) if np.isfinite(limit) else None
            if found is None:
                continue
            value, share, length, near, slopes, nearness, inverse, scale = map(float, found)
            with localcontext() as context:
                context.prec = 60
                error = abs(float(Decimal(limit) - found[0]))
            of_normal = 8 * u * (0.5 + (FILTER >> 1)) * (nearness * slopes + inverse * 2 / scale)
            error -= 8 * u * (SIZE + SIZE / 2) * slopes + of_normal  # what SLACK and NORMAL_ERROR allow
            worst = max(worst, error / (u * share * (length + near)))
            n_checked += 1
    return worst, n_checked


GIVEN = [
    int(quantity) + axis * int(f.NEXT)
    for quantity, n in ((f.POSITION, 3), (f.NORMAL, 3), (f.FACE_NORMAL, 3), (f.FACE_OFFSET, 1), (f.FACE_SIDE, 1))
    for axis in range(n)
]


@pytest.mark.parametrize("is_perspective, dtype, side", [
    (True, np.float32, 0.01), (True, np.float32, 300.0), (False, np.float32, 3e4), (False, np.float64, 1.0),
    (True, np.float64, 3e4),
])  # fmt: skip
def test_a_limit_errs_by_no_more_than_its_roundings(is_perspective, dtype, side):
    """Polygons much smaller and much larger than the way to the light, eyes near by and far away; both sides."""
    rng = np.random.default_rng([int(is_perspective), int(100 * side)])
    with localcontext() as context, np.errstate(all="ignore"):
        context.prec = 60
        found = [count_roundings(rng, dtype, is_perspective, distance, side) for distance in (0.1, 3.0, 100.0)]
    worst, n = np.max(found, axis=0)
    assert n > 50 and worst <= lookup.ROUNDINGS, f"{worst:.3g} roundings > {lookup.ROUNDINGS}"
    assert worst > 1e-3 * lookup.ROUNDINGS, f"{worst:.3g} roundings: far fewer than are allowed"
