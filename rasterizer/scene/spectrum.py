"""Spectra: colours as functions of the wavelength, their linear RGB, and the smoothest spectrum of an RGB colour.

Convention: every spectrum S is relative to daylight. A reflectance is just the reflectance; a light of spectrum 1 is
D65, white of intensity 1; light times reflectance is the product of their spectra. What the eye makes of it is

    X, Y, Z = k ∫ S(λ) D65(λ) (x(λ), y(λ), z(λ)) dλ,  380 to 780 nm, with k such that S = 1 has Y = 1

(CIE 15:2018, 7.1), and linear RGB is XYZ times the matrix of the sRGB primaries (IEC 61966-2-1:1999) and of the white
that S = 1 has in this very sum. So S = 1 is (1, 1, 1), and a grey surface under white light stays grey, however coarse
the sampling.

A spectrum sampled at n wavelengths is taken as linear between them. The integral is the trapezoid rule over the tables'
grid (every 5 nm), or over the n wavelengths where these are closer.

From RGB back to a spectrum there is no unique way (Smits 1999, J. Graphics Tools 4(4), 11-22; Mallett & Yuksel 2019,
EGSR, whose three basis curves add up to 1 as ours do). Here a colour gets the spectrum that varies least: see
`rgb_basis`.
"""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SceneError, shown
from .arrays import fixed, real_array
from .color import ColorLike, linear_rgb
from .validate import number

# The eye of the CIE's standard observer of 1931, and daylight; the file names its sources.
_TABLE = fixed(np.loadtxt(Path(__file__).with_name("cie_tables.txt"), encoding="utf-8"))

WAVELENGTHS = _TABLE[:, 0]  # (81,) nm, every 5 nm
MATCHING = _TABLE[:, 1:4]  # (81, 3) without unit, the curve of y has its peak of 1 at 555 nm
D65 = _TABLE[:, 4]  # (81,) power for each nm, relative
N_TABLE = len(WAVELENGTHS)
SHORTEST, LONGEST = float(WAVELENGTHS[0]), float(WAVELENGTHS[-1])
_MIN_KELVIN = 100.0  # kelvin: colder bodies give the eye less than 1e-70 of the light that they give at 1000 K

# Chromaticities x, y of the red, green and blue primaries: IEC 61966-2-1:1999, table 1.
_PRIMARIES = ((0.64, 0.33), (0.30, 0.60), (0.15, 0.06))
# Second radiation constant h c / k in nm K, exact since the SI of 2019 (CODATA 2018).
_C2 = 6.62607015e-34 * 299_792_458.0 / 1.380649e-23 * 1e9


class Spectrum(tuple[float, float, float]):
    """Hold a colour as a function of the wavelength, relative to D65: a reflectance, or the ratio of a light to white.

    As a tuple it is its linear RGB, three floats. Unlike those of other colours they may be negative: no display shows
    the pure colours of the spectrum. Between samples the spectrum is linear, beyond the first and the last constant. A
    picture sees it at `Options.spectral` wavelengths, and its RGB is computed from every 5 nm: lines that are narrower
    are lost or too strong, so average a finer measurement first. Two spectra are equal where their samples are,
    whatever their RGB.

    Parameters
    ----------
    wavelengths : (n,) numbers, nm, increasing, reaching into 380..780
    values : (n,) numbers, finite, at least 0

    Raises
    ------
    SceneError : samples that are not legal
    """

    _wavelengths: NDArray[np.float64]
    _values: NDArray[np.float64]
    _bytes: tuple[bytes, bytes]

    def __new__(cls, wavelengths: ArrayLike, values: ArrayLike) -> "Spectrum":  # noqa: D102
        return _spectrum(*_checked_samples(wavelengths, values, "the spectrum", "values"), cls)

    @property
    def wavelengths(self) -> NDArray[np.float64]:
        """(n,) float64, nm, increasing, read-only."""
        return self._wavelengths

    @property
    def values(self) -> NDArray[np.float64]:
        """(n,) float64, relative to D65, read-only."""
        return self._values

    @property
    def xyz(self) -> NDArray[np.float64]:
        """(3,) float64: X, Y and Z for the standard observer, of a surface in daylight, or of a lamp; white has
        Y = 1."""
        return np.interp(WAVELENGTHS, self._wavelengths, self._values) @ xyz_weights(N_TABLE)

    @classmethod
    def flat(cls, value: float) -> "Spectrum":
        """Return the spectrum that has one `value`, at least 0 (else SceneError): a grey, or white light."""
        value = number(value, "the flat spectrum's value")
        return cls((SHORTEST, LONGEST), (value, value))

    @classmethod
    def of_power(cls, wavelengths: ArrayLike, power: ArrayLike) -> "Spectrum":
        """Return the spectrum of a lamp whose power was measured, scaled to the luminance of a white light of 1.

        Parameters
        ----------
        wavelengths : (n,) numbers, nm, increasing, reaching into 380..780
        power : (n,) numbers, power for each nm of wavelength in any unit, at least 0; linear between, constant beyond
            the ends

        Returns
        -------
        Spectrum, the power divided by that of D65, at the wavelengths given within 380..780 nm and every 5 nm

        Raises
        ------
        SceneError : samples that are not legal, a lamp without visible light
        """
        wavelengths, power = _checked_samples(wavelengths, power, "the lamp", "power")
        is_seen = (wavelengths > SHORTEST) & (wavelengths < LONGEST)
        nodes = np.union1d(WAVELENGTHS, wavelengths[is_seen])
        ratio = np.interp(nodes, wavelengths, power) / np.interp(nodes, WAVELENGTHS, D65)
        luminance = np.interp(WAVELENGTHS, nodes, ratio) @ xyz_weights(N_TABLE)[:, 1]
        if not luminance > 0.0:
            raise SceneError(f"the lamp's power must be above 0 at some of 380, 385, .. 780 nm; given {shown(power)}")
        return cls(nodes, ratio / luminance)

    @classmethod
    def blackbody(cls, kelvin: float) -> "Spectrum":
        """Return the light of a glowing black body, scaled to the luminance of a white light of 1.

        Parameters
        ----------
        kelvin : number, temperature in kelvin, at least 100: 1900 is a candle, 2856 a light bulb, 6500 nearly white

        Returns
        -------
        Spectrum, every 5 nm

        Raises
        ------
        SceneError : a temperature that is not legal

        Source: Planck 1900, Verh. Dtsch. Phys. Ges. 2, 237-245: power ~ λ^-5 / (exp(h c / λ k T) - 1).
        """
        temperature = number(kelvin, "the black body's temperature", low=_MIN_KELVIN, unit=" kelvin")
        exponent = _C2 / WAVELENGTHS / temperature
        # In logarithms, log(e^x - 1) = x + log(1 - e^-x), as e^x overflows for a cold body.
        log_power = -5.0 * np.log(WAVELENGTHS) - exponent - np.log(-np.expm1(-exponent))
        return cls.of_power(WAVELENGTHS, np.exp(log_power - log_power.max()))

    @classmethod
    def of_rgb(cls, color: ColorLike) -> "Spectrum":
        """Return the spectrum of an RGB colour that varies least with the wavelength; a grey is flat.

        Its values may leave 0..1: those of red, green and blue lie within -0.18..1.09.

        Parameters
        ----------
        color : colour as `linear_rgb` reads it: a number (grey), three linear numbers, hex or CSS text

        Returns
        -------
        Spectrum, every 5 nm, whose RGB is that of the colour

        Raises
        ------
        SceneError : a colour that is not legal
        """
        red, green, blue = linear_rgb(color, "the spectrum's color")
        return _spectrum(WAVELENGTHS, samples_of((red, green, blue), N_TABLE), cls)

    def at(self, wavelengths: ArrayLike) -> NDArray[np.float64]:
        """Return the values (...) float64 at `wavelengths` (...), nm; SceneError for what are no finite numbers."""
        return np.interp(_numbers(wavelengths, "wavelengths"), self._wavelengths, self._values)

    def scaled(self, factor: float) -> "Spectrum":
        """Return the spectrum times `factor`, at least 0 (else SceneError): a brighter or darker one."""
        return _spectrum(self._wavelengths, self._values * number(factor, "the spectrum's factor", low=0), type(self))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, tuple):
            return NotImplemented
        return isinstance(other, Spectrum) and self._bytes == other._bytes

    def __ne__(self, other: object) -> bool:
        return not self == other  # a tuple has its own, by RGB

    def __hash__(self) -> int:
        return hash(self._bytes)

    def __reduce__(self) -> tuple[Any, ...]:
        return _spectrum, (self._wavelengths, self._values, type(self))

    def __repr__(self) -> str:
        red, green, blue = self
        where = f"{self._wavelengths[0]:g}..{self._wavelengths[-1]:g} nm, {len(self._values)} samples"
        return f"Spectrum({where}, RGB {red:.4g}, {green:.4g}, {blue:.4g})"


def _spectrum(wavelengths: NDArray, values: NDArray, cls: type[Spectrum]) -> Spectrum:
    """Make a spectrum of samples that are known to be legal, but for values below 0."""
    wavelengths, values = fixed(wavelengths + 0.0), fixed(values + 0.0)  # no -0: equal spectra have equal bytes
    rgb = rgb_of(np.interp(WAVELENGTHS, wavelengths, values))
    spectrum = tuple.__new__(cls, rgb.tolist())
    spectrum._wavelengths, spectrum._values = wavelengths, values
    spectrum._bytes = wavelengths.tobytes(), values.tobytes()  # equal where the samples are
    return spectrum


def _numbers(values: ArrayLike, what: str) -> NDArray[np.float64]:
    """Finite numbers of any shape as float64."""
    numbers = real_array(values)
    if numbers is None or not np.isfinite(numbers).all():
        raise SceneError(f"{what} must be finite numbers; given {shown(values)}")
    return numbers.astype(np.float64)


def _checked_samples(wavelengths: Any, values: Any, whose: str, name: str) -> tuple[NDArray, NDArray]:
    """Return samples as rows of float64; SceneError where they make no spectrum."""
    rows = []
    for given, what in ((wavelengths, f"{whose}'s wavelengths"), (values, f"{whose}'s {name}")):
        rows.append(_numbers(given, what))
        if rows[-1].ndim != 1 or rows[-1].size == 0:
            raise SceneError(f"{what} must be a row of numbers; given {shown(given)}")
    wavelengths, values = rows
    if len(wavelengths) != len(values):
        given = f"{len(values)} for {len(wavelengths)}"
        raise SceneError(f"a spectrum needs as many samples of {name} as wavelengths; given {given}")
    if not (np.diff(wavelengths) > 0.0).all():
        raise SceneError(f"the wavelengths of a spectrum must increase; given {shown(wavelengths.tolist())}")
    if wavelengths[0] > LONGEST or wavelengths[-1] < SHORTEST:
        where = f"{wavelengths[0]:g}..{wavelengths[-1]:g}"
        raise SceneError(f"the wavelengths of a spectrum must be in nm and reach into 380..780; given {where}")
    if values.min() < 0.0:
        k = int(values.argmin())
        raise SceneError(f"the {name} of a spectrum must be at least 0; given {values[k]:g} at {wavelengths[k]:g} nm")
    return wavelengths, values


def standard_observer(wavelengths: ArrayLike) -> NDArray[np.float64]:
    """Return the colour-matching functions of the CIE's standard observer of 1931, 2 degrees.

    Parameters
    ----------
    wavelengths : (...) numbers, nm

    Returns
    -------
    (..., 3) float64, x̄, ȳ and z̄, without unit; ȳ has its peak of 1 at 555 nm. Linear between every 5 nm, 0 outside of
    380..780

    Raises
    ------
    SceneError : what are no finite numbers

    Source: CIE 15:2018, table T.4; as `scene/cie_tables.txt` has it.
    """
    nodes = _numbers(wavelengths, "wavelengths")
    return np.stack([np.interp(nodes, WAVELENGTHS, curve, left=0.0, right=0.0) for curve in MATCHING.T], axis=-1)


def daylight(wavelengths: ArrayLike) -> NDArray[np.float64]:
    """Return the power of daylight, D65, for each nm of wavelength: what a `Spectrum` is relative to.

    So of a surface S in the light of a lamp L, both Spectrum, XYZ is the sum over the wavelengths of
    `S.at(nm) * L.at(nm) * daylight(nm) * standard_observer(nm).T`, divided by that of Y without S and L.

    Parameters
    ----------
    wavelengths : (...) numbers, nm

    Returns
    -------
    (...) float64, relative; linear between every 5 nm, constant outside of 380..780

    Raises
    ------
    SceneError : what are no finite numbers

    Source: CIE 15:2018, table T.1; as `scene/cie_tables.txt` has it.
    """
    return np.interp(_numbers(wavelengths, "wavelengths"), WAVELENGTHS, D65)


# --- sampled spectra ----------------------------------------------------------------------------------------


def sampling(n: int) -> NDArray[np.float64]:
    """Return n wavelengths, at least 2, evenly from 380 to 780 nm: (n,) float64."""
    return np.linspace(SHORTEST, LONGEST, n)


@cache
def xyz_weights(n: int) -> NDArray[np.float64]:
    """Return the weights of a spectrum's samples in its tristimulus values.

    Where n is less than 81 a sample stands for all of the curve around it: its weight is the integral of the hat that
    is 1 at it and 0 at its neighbours. So no part of the tables is missed, and the white of every such n is that of
    D65.

    Parameters
    ----------
    n : number of samples, as `sampling` has them

    Returns
    -------
    (n, 3) float64, read-only: X, Y, Z = samples @ weights, with Y = 1 where all samples are 1

    Source: CIE 15:2018, 7.1.
    """
    nodes = sampling(max(n, N_TABLE))
    curves = np.stack([np.interp(nodes, WAVELENGTHS, curve) for curve in MATCHING.T], axis=1)
    weights = curves * np.interp(nodes, WAVELENGTHS, D65)[:, None]
    weights[[0, -1]] *= 0.5  # the ends of the trapezoid rule
    if n < N_TABLE:
        hats = np.stack([np.interp(nodes, sampling(n), hat) for hat in np.eye(n)])
        weights = hats @ weights
    return fixed(weights / weights[:, 1].sum())


@cache
def rgb_weights(n: int) -> NDArray[np.float64]:
    """Return the weights of a spectrum's samples in its linear RGB.

    Parameters
    ----------
    n : number of samples, at least 3, as `sampling` has them

    Returns
    -------
    (n, 3) float64, read-only: RGB = samples @ weights; each column adds up to 1, but for rounding
    """
    xyz = xyz_weights(n)
    weights = xyz @ rgb_from_xyz(xyz.sum(axis=0)).T
    return fixed(weights / weights.sum(axis=0))


def rgb_from_xyz(white: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the matrix from XYZ to linear RGB with the sRGB primaries and a given white.

    Parameters
    ----------
    white : (3,) float64, XYZ of the white that becomes (1, 1, 1)

    Returns
    -------
    (3, 3) float64, RGB = matrix @ XYZ

    Source: SMPTE RP 177:1993. The columns of the inverse are the primaries, each with the strength that it has in
    white.
    """
    primaries = np.array([(x, y, 1.0 - x - y) for x, y in _PRIMARIES]).T
    strengths = np.linalg.solve(primaries, white)
    return np.linalg.inv(primaries * strengths)


def rgb_of(samples: ArrayLike) -> NDArray[np.float64]:
    """Return the linear RGB of sampled spectra.

    Parameters
    ----------
    samples : (..., n) float64, values at `sampling(n)`, n at least 3

    Returns
    -------
    (..., 3) float64, linear; negative where no display shows the colour, exactly neutral where the spectrum is flat
    """
    samples = np.asarray(samples, dtype=np.float64)
    # The weights add up to 1: taking the first sample out of the sum keeps greys from being rounded.
    first = samples[..., :1]
    return first + (samples - first) @ rgb_weights(samples.shape[-1])


@cache
def rgb_basis(n: int) -> NDArray[np.float64]:
    """Return the spectra of pure red, green and blue that vary least, as samples.

    Each minimises the sum of its squared first differences, |D s|², where its RGB is given, Wᵀ s = e. With Lagrange
    multipliers m that is one linear system for all three:

        ( DᵀD  W ) (s)   (0)
        ( Wᵀ   0 ) (m) = (e)

    The solution is linear in e, and the smoothest white is the constant 1: so the curves add up to 1, a grey is flat,
    and every colour is met. They leave 0..1: to -0.18 and 1.08 for n = 81, to -0.30 and 1.16 for n = 7, to -5.6 and 4.5
    for n = 3. Least second differences would go to -2.4 and 2.9 at the ends for n = 81, where the eye sees little and
    nothing else holds them.

    Parameters
    ----------
    n : number of samples, at least 3, as `sampling` has them

    Returns
    -------
    (n, 3) float64, read-only; the samples of a colour are `rgb_basis(n) @ rgb`
    """
    differences = np.diff(np.eye(n), axis=0)
    system = np.zeros((n + 3, n + 3))
    system[:n, :n] = differences.T @ differences
    system[:n, n:] = rgb_weights(n)
    system[n:, :n] = rgb_weights(n).T
    basis = np.linalg.solve(system, np.eye(n + 3)[:, n:])[:n].astype(np.float64, copy=False)
    basis[:, 2] = 1.0 - basis[:, 0] - basis[:, 1]  # the same but for rounding
    return fixed(basis)


def samples_of(color: tuple[float, float, float], n: int) -> NDArray[np.float64]:
    """Return a colour as samples of a spectrum.

    Parameters
    ----------
    color : Spectrum, or three linear numbers, which may be negative
    n : number of samples, at least 3, as `sampling` has them

    Returns
    -------
    (n,) float64: the values of a Spectrum, or for RGB the curve that varies least, with exactly this RGB at any n
    """
    if isinstance(color, Spectrum):
        return color.at(sampling(n))
    red, green, blue = color
    # Blue's curve is 1 - red's - green's; written so, a grey is flat to the last bit.
    basis = rgb_basis(n)
    return blue + (red - blue) * basis[:, 0] + (green - blue) * basis[:, 1]
