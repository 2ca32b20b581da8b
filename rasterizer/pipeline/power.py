"""Powers of cosines, valid whatever they are given, and how near to 0 a cosine counts as 0.

Highlights and spot lights are made of them. A number that leaves them is within 0..1: what is written into visibility
packed samples and setups relies on it. Each has a form for float32 and one for float64; the compiler takes that of the
argument's type, as plain Python does.
"""

import numpy as np

from ..compiler.kernels import by_type, helper


@helper
def grazing_single(cosine):
    """See `grazing`."""
    return np.float32(2.0**-20)


@helper
def grazing_double(cosine):
    """Return the largest cosine that counts as 0 where a step lies at 0: 2^-40 in float64, 2^-20 in float32.

    A light that is exactly parallel to a face has N·L = 0, and rounding must not decide for each sample by itself which
    side of the step it is on. With u the unit roundoff that of the normal is 2 u, that of the light's direction u, that
    of the product 3 u; errors of the vectors' lengths don't count. In float32 that makes 6·2^-24, and 10 are left for
    the position of a light. In float64 the normal's own rounding counts most: 2^-53 times the ratio of the coordinates
    to the face's size, which may be 2^10 here. No more than that, because what really grazes the surface is lit in
    float64, and by the formula.

    `cosine` is any number of the type that is asked for.
    """
    return 2.0**-40


grazing = by_type(grazing_single, grazing_double)


@helper
def power_double(base, exponent):
    """Return base ** exponent of a cosine, within 0..1, for any positive exponent.

    It is 0 where base <= 0 or no number, and 1 where base >= 1 by a rounding error. Float32: see `power_single`.
    """
    return min(base, 1.0) ** exponent if base > 0.0 else 0.0


@helper
def power_single(base, exponent):
    """Return base ** exponent in float32, as 2 ** (exponent·log2 base), without a branch: so loops of it vectorise.

    Whatever the arguments are, what comes out is a number from 0 to 1: the base is a cosine, above 1 only by rounding,
    and with a base of 1 + 2^-23 an exponent of 1e11 would shift 2^y into the sign bit. So y is kept within -126..0,
    also where it is no number, and no conversion to an integer is ever out of its range.

    log2 m = 2/ln 2 · artanh t, t = (m-1)/(m+1), for a mantissa m in [√½, √2]: |t| < 0.1716, the series to t^9 leaves
    2/ln 2 · t^11/11 < 1.1e-9. 2^f for |f| <= ½: the series to f^7 leaves (f·ln 2)^8/8! < 5.2e-9. Above that comes the
    rounding of float32: 2^-24 · (4 + 3·exponent·|log2 base|) of the result. Results below 2^-126 are 0: denormals would
    slow the loop down.
    """
    one, low, high = np.float32(1), np.float32(-126), np.float32(0)
    safe = base if base > np.float32(1e-30) else np.float32(1e-30)
    safe = safe if safe < one else one
    bits = np.float32(safe).view(np.int32)
    # The exponent of two, rounded so that the mantissa is in [√½, √2).
    octave = np.int32(np.int32(bits - np.int32(0x3F3504F3)) >> np.int32(23))
    mantissa = np.int32(bits - np.int32(octave << np.int32(23))).view(np.float32)
    t = (mantissa - one) / (mantissa + one)
    square = t * t
    series = np.float32(0.41219858) + square * np.float32(0.32059890)
    series = np.float32(0.57707802) + square * series
    series = np.float32(0.96179669) + square * series
    series = np.float32(2.8853900) + square * series
    y = exponent * (np.float32(octave) + t * series)
    y = y if y > low else low
    y = y if y < high else high
    return power_of_two(y) if (base > 0) & (y > low) else np.float32(0)


power = by_type(power_single, power_double)


@helper
def exponential_double(x):
    """Return e ** x for x <= 0. Float32: see `exponential_single`."""
    return np.exp(x)


@helper
def exponential_single(x):
    """Return e ** x in float32 for x <= 0, as 2 ** (x·log2 e), without a branch.

    The error is 2^-24·(2 + |x|)·2 of the result. It is 0 below 2^-60, so that products of it are no denormal numbers,
    and where x is no number.
    """
    low, high = np.float32(-60), np.float32(0)
    y = x * np.float32(1.4426950)
    y = y if y > low else low
    y = y if y < high else high
    return power_of_two(y) if y > low else np.float32(0)


exponential = by_type(exponential_single, exponential_double)


@helper
def power_of_two(y):
    """Return 2 ** y in float32 for -126 <= y < 128, with the series of `power_single`."""
    whole = np.float32(np.rint(y))
    f = y - whole
    series = np.float32(0.00015403530) + f * np.float32(0.000015252734)
    series = np.float32(0.0013333558) + f * series
    series = np.float32(0.0096181291) + f * series
    series = np.float32(0.055504109) + f * series
    series = np.float32(0.24022651) + f * series
    series = np.float32(0.69314718) + f * series
    result = np.float32(1.0) + f * series
    two_to_whole = np.int32(np.int32(np.int32(whole) + np.int32(127)) << np.int32(23)).view(np.float32)
    return result * two_to_whole
