"""How bright and how steep the highlight of isotropic mirrors is: the paper behind the constants of
engine/reflections.py.

    S = D(δ)·f(N·L)·g(N·V)      GGX         D = α²/(α² cos²δ + sin²δ)²         f = x/(x + r(x))    g = 1/(x + r(x))
                                Beckmann    D = e^(-tan²δ/m²)/(m² cos⁴δ)       f = G1(x)           g = G1(x)/(4 x)

δ is the angle between N and H, r(x) = √(α² + (1 - α²) x²), G1 as in `beckmann_visible` (pipeline/reflection.py).
W(θ) <= 1 is a factor beside. The largest D, the largest g and the steepest f never meet in one point: D is large next
to δ = 0, f and g are steep where N·L and N·V are small. With cos θ = |L + V|/2 both cosines are at least cos(θ + δ),
because L and V are turned from H by θ, and H from N by δ.

So the range of δ is cut into cells. In each of them every factor is bounded by its largest value there: g and the
slopes of f and g fall with the cosines. The largest product over all cells is a bound that is true for every point, and
it approaches the largest value of S as cells become small.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

N_CELL = 96
FURTHEST_TAN = 7.5  # of Beckmann's tan δ/m in cells of one size; the last cell is all that is beyond
WHOLE = 1.6  # a = x/(m √(1 - x²)) from which Beckmann's G1 is 1
FRESNEL_SLOPE = 2.5  # of W(θ), for each radian that one of L and V turns: 5 for θ, of which H takes half
# In units of u, see the head of engine/bounds.py:
TURNED_NORMAL = 7  # N, and what is rounded in N×(L + V)
TURNED_SUM = 20  # L, V and their sum, over |L + V|
N_DOT_L, N_DOT_V = 16, 22  # the cosines: 6.5 of N, 6.5 of L or 12.5 of V, 3 of the product
PRODUCTS = 48  # relative errors: of D (4·9), f and g (2·4), W and the products (4)
EXPONENT = 24  # of tan²δ/m² (9 + 3 each of two squares) and of its exponential (2)


class LobeBounds(NamedTuple):
    """What a highlight with `specular` = 1 does at most, one value for each light."""

    peak: NDArray[np.float64]  # its largest value
    normal_slope: NDArray[np.float64]  # what it changes by for each radian that the normal turns
    light_slope: NDArray[np.float64]  # the same for the direction to the light
    rounding: NDArray[np.float64]  # what rounding adds, in units of u


class Factors(NamedTuple):
    """The largest values of the factors, and of the amounts of their slopes, in each cell."""

    d: NDArray[np.float64]  # (n_cell, 1)
    d_slope: NDArray[np.float64]
    exponent: NDArray[np.float64]  # tan²δ/m² of Beckmann's D; 0 of GGX
    f: float
    f_over_sum: NDArray[np.float64]  # (n_light,), f/|L + V|
    f_slope: NDArray[np.float64]  # (n_cell, n_light)
    g: NDArray[np.float64]
    g_slope: NDArray[np.float64]


def bound_lobe(distribution: str, roughness: float, least_sums: NDArray[np.float64]) -> LobeBounds:
    """Bound the highlight of mirrors.

    Parameters
    ----------
    distribution : "ggx" or "beckmann"
    roughness : α or m, above 0
    least_sums : (n_light,) float64, |L + V| is nowhere less, 0 to 2

    A turn of N by ε moves δ, N·L and N·V by ε at most. A turn of L moves δ by ε/|L + V|, N·L by ε, and θ by ε/2. What
    is divided by |L + V| is bounded because N·L + N·V = |L + V| cos δ: where no normal looks away from the viewer N·L
    is at most |L + V|, and f(x)/x falls.
    """
    factors_of = ggx_factors if distribution == "ggx" else beckmann_factors
    d, d_slope, exponent, f, f_over_sum, f_slope, g, g_slope = factors_of(roughness, np.asarray(least_sums, float))
    height = d * f * g
    lobe = LobeBounds(
        peak=height,
        normal_slope=d_slope * f * g + d * (f_slope * g + f * g_slope),
        light_slope=d_slope * f_over_sum * g + d * f_slope * g + FRESNEL_SLOPE * height,
        rounding=d_slope * g * (TURNED_NORMAL * f + TURNED_SUM * f_over_sum)
        + d * (N_DOT_L * f_slope * g + N_DOT_V * f * g_slope)
        + height * (PRODUCTS + EXPONENT * exponent + FRESNEL_SLOPE * TURNED_SUM),
    )
    return LobeBounds(*(values.max(axis=0) for values in lobe))


def ggx_factors(alpha: float, sums: NDArray[np.float64]) -> Factors:
    """Return the factors of GGX mirrors where |L + V| is at least `sums`, (n_light,).

    With b = 1 - α²: D falls with δ, |dD/dδ| = 4 α² b sin δ cos δ/(α² + b sin²δ)³, df/dx = α²/(r (x + r)²),
    |dg/dx| = (1 + b x/r)/(x + r)², and f <= 1/2.
    """
    share = 0.5 * np.pi * np.linspace(0.0, 1.0, N_CELL + 1)[:, None]
    delta = np.arctan2(alpha * np.sin(share), np.cos(share))  # steps of equal changes of D, about
    low, high = delta[:-1], delta[1:]
    square, rest = alpha * alpha, max(1.0 - alpha * alpha, 0.0)
    spread = square + rest * np.sin(low) ** 2
    x, nearest = _least_cosines(sums, high), np.minimum(sums, 1.0)
    r = np.sqrt(square + rest * x * x)
    return Factors(
        d=square / spread**2,
        d_slope=4.0 * square * rest * np.sin(high) * np.cos(low) / spread**3,
        exponent=np.zeros((N_CELL, 1)),
        f=0.5,
        f_over_sum=np.minimum(1.0 / (nearest + np.sqrt(square + rest * nearest**2)), 0.5 / np.maximum(sums, 1e-300)),
        f_slope=square / (r * (x + r) ** 2),
        g=1.0 / (x + r),
        g_slope=(1.0 + rest * x / r) / (x + r) ** 2,
    )


def beckmann_factors(m: float, sums: NDArray[np.float64]) -> Factors:
    """Return the factors of Beckmann's mirrors where |L + V| is at least `sums`, (n_light,).

    With t = tan²δ, D = e^(-t/m²) (1 + t)²/m² is largest where t = 2 m² - 1, and |d ln D/dδ| = 2 tan δ |(1 + t)/m² - 2|.
    In the last cell, from FURTHEST_TAN on, D and its slope fall.

    With a = x/(m √(1 - x²)), q = 1 + 2.276 a + 2.577 a²: G1 = a p, p = (3.535 + 2.181 a)/q, below a = WHOLE.

        dG1/da  = (3.535 + 4.362 a - 4.146 a²)/q²           <= (3.535 + 4.362 a)/q², which falls
        |dp/da| = (5.865 + 18.22 a + 5.621 a²)/q²           falls
        da/dx   = (1 + m² a²)^(3/2)/m                       <= c^(3/2)/m,   c = 1 + m² WHOLE²

    G1/x = p √(1 + m² a²)/m, so its slope is the difference of |dp/da| (1 + m² a²)²/m² and of p a (1 + m² a²) <= c, both
    positive. From a = WHOLE on G1 is 1, and the slope of 1/x is 1/x² <= c/(m WHOLE)².
    """
    tangent = m * FURTHEST_TAN * np.linspace(0.0, 1.0, N_CELL + 1)[:, None]
    low, high = tangent[:-1], tangent[1:]
    ends, square = np.stack([low, high]) ** 2, m * m
    t = np.clip(2.0 * square - 1.0, ends[0], ends[1])
    d = np.exp(-t / square) * (1.0 + t) ** 2 / square
    d_slope = d * 2.0 * high * np.abs((1.0 + ends) / square - 2.0).max(axis=0)
    beyond = np.pi / 2 * (np.arange(N_CELL)[:, None] == N_CELL - 1)
    x = _least_cosines(sums, np.maximum(np.arctan(high), beyond))
    a, q, visible = _visible(x, m)
    is_whole, most = a >= WHOLE, 1.0 + square * WHOLE**2
    rise = (5.865 + a * (18.22 + 5.621 * a)) / (q * q) * most**2 / square
    return Factors(
        d=d,
        d_slope=d_slope,
        exponent=ends[1] / square,
        f=1.0,
        f_over_sum=_visible(np.minimum(sums, 1.0), m)[2],
        f_slope=np.where(is_whole, 0.0, (3.535 + 4.362 * a) / (q * q) * most**1.5 / m),
        g=0.25 * visible,
        g_slope=0.25 * np.where(is_whole, visible**2, np.maximum(rise, most / min(1.0, square * WHOLE**2))),
    )


def _visible(x, m) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Beckmann's a, at most WHOLE, q, and G1/x at cosines x; the last one is 1/x at most."""
    a = np.minimum(x / (m * np.sqrt(np.maximum(1.0 - x * x, 1e-300))), WHOLE)
    q = 1.0 + a * (2.276 + 2.577 * a)
    visible = (3.535 + 2.181 * a) / q * np.sqrt(1.0 + (m * a) ** 2) / m
    return a, q, np.where(a < WHOLE, visible, 1.0 / np.maximum(x, 1e-300))


def _least_cosines(sums, delta) -> NDArray[np.float64]:
    """cos(θ + δ), at least 0, with the largest θ of each light."""
    return np.cos(np.minimum(np.arccos(np.minimum(sums, 2.0) / 2.0) + delta, 0.5 * np.pi))
