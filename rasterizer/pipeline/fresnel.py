"""The specular reflection function W(θ) of highlights, and its second term where F0 is a colour or a spectrum.

W = F0 + (1 - F0)·s with s = (1 - cos θ)^5 is affine in F0, so

    ks·Ip·W·h = (ks·Ip·F0)·h + (ks·Ip·(1 - F0))·(s·h)

in every channel and for every wavelength: two sums whose colours geometry has no part in. The first is what the
material's reflection function writes with W = 1. The functions here follow it, as if the light were there once more,
and make s·h of the h that still stands in SPECULAR. With F0 within 0..1 neither term is negative, so nothing cancels.

Source: Schlick 1994, Computer Graphics Forum 13(3), 233-246.
"""

from ..compiler.kernels import as_array, helper, index
from ..geometry.vectors import add, length
from . import fragments as f
from .fragments import get_vector

LEAST_SINK = 2.0**-12  # the fifth power of less is taken for 0: invisible, and never a denormal number


@helper
def schlick(fresnel, cosine):
    """Return the specular reflection function W = F0 + (1 - F0)(1 - cos θ)^5."""
    real = type(cosine)
    sink = real(1) - cosine
    sink = sink if sink > real(LEAST_SINK) else real(0)
    square = sink * sink
    return fresnel + (real(1) - fresnel) * (square * square * sink)


def grazing_term(batch, n, material):
    """The second term of Phong's and Blinn's highlights: times s with cos θ = N·L."""
    batch = as_array(batch, f.BATCH_SHAPE)
    zero = batch.dtype.type(0)
    for k in range(index(n)):
        share = schlick(zero, max(batch[f.N_DOT_L + k], zero))
        # No product where nothing is left: the highlight may be infinite in the light itself.
        batch[f.SPECULAR + k] = batch[f.SPECULAR + k] * share if share > zero else zero
        batch[f.DIFFUSE + k] = zero


def grazing_term_of_mirrors(batch, n, material):
    """The second term of Cook-Torrance's: θ is the angle of incidence on the mirrors, cos θ = |L + V|/2."""
    batch = as_array(batch, f.BATCH_SHAPE)
    zero, two = batch.dtype.type(0), batch.dtype.type(2)
    for k in range(index(n)):
        half = add(get_vector(batch, f.LIGHT_DIR, k), get_vector(batch, f.VIEW_DIR, k))
        share = schlick(zero, length(half) / two)
        batch[f.SPECULAR + k] = batch[f.SPECULAR + k] * share if share > zero else zero
        batch[f.DIFFUSE + k] = zero


def no_second_term(batch, n, material):
    """The second term of a material whose F0 has no colour, in a scene where another one's has: nothing."""
    batch = as_array(batch, f.BATCH_SHAPE)
    zero = batch.dtype.type(0)
    for k in range(index(n)):
        batch[f.DIFFUSE + k] = batch[f.SPECULAR + k] = zero
