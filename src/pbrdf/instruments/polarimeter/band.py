"""Polarimeters that see a band of wavelengths instead of one.

A detector adds up the intensities of all wavelengths that the filter lets through, so the analyser vectors of the band
are the averages of the monochromatic ones, weighted by what reaches the detector (filter × source × response). The
phase of a retarder is δ(λ) = δ(λ₀) · (λ₀/λ) · B(λ)/B(λ₀) with the birefringence B: a wide band blurs it and lowers the
contrast. The Stokes vector is taken as the same all over the band.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from pbrdf.errors import DataError
from pbrdf.files.delimited import read_table
from pbrdf.instruments.polarimeter.polarimeter import Polarimeter, from_settings

__all__ = ["Band", "cauchy", "gaussian_band", "in_band", "read_band", "tabulated_band", "top_hat_band"]

_COLUMNS = ("wavelength_nm", "transmission")
_SAMPLES = 32
_FWHM = 2.0 * np.sqrt(2.0 * np.log(2.0))
_DISPERSIVE = ("retardances", "retardance")

#: Birefringence against wavelength in nm; only its ratios count.
Birefringence = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Band:
    """Wavelengths of a band and their weights: a rule for averages over it.

    Attributes
    ----------
    wavelengths
        nm, shape (K,).
    weights
        Shape (K,), of sum 1.

    Raises
    ------
    DataError
        If a wavelength is not positive, a weight is negative, or all weights are 0.
    """

    wavelengths: np.ndarray
    weights: np.ndarray

    def __post_init__(self) -> None:
        wavelengths = np.atleast_1d(np.asarray(self.wavelengths, dtype=float))
        weights = np.atleast_1d(np.asarray(self.weights, dtype=float))
        if wavelengths.ndim != 1 or wavelengths.shape != weights.shape or not wavelengths.size:
            raise DataError("band: give as many weights as wavelengths, at least one")
        if not (np.isfinite(wavelengths).all() and (wavelengths > 0.0).all()):
            raise DataError(
                "band: a wavelength is not a positive number: the band is too wide for its centre"
            )
        if not (np.isfinite(weights).all() and (weights >= 0.0).all() and weights.any()):
            raise DataError("band: the transmission must be 0 or more, and not 0 everywhere")
        object.__setattr__(self, "wavelengths", wavelengths)
        object.__setattr__(self, "weights", weights / weights.sum())

    @property
    def center(self) -> float:
        """Mean wavelength, nm."""
        return float(self.weights @ self.wavelengths)


def top_hat_band(center: float, width: float) -> Band:
    """A filter that lets everything pass within `width` about `center` (nm); width 0 is a single wavelength."""
    nodes, weights = np.polynomial.legendre.leggauss(_SAMPLES)
    return _band(center, width, 0.5 * nodes, weights)


def gaussian_band(center: float, width: float) -> Band:
    """A Gaussian filter, `width` its full width at half maximum (nm); width 0 is a single wavelength."""
    nodes, weights = np.polynomial.hermite.hermgauss(_SAMPLES)
    return _band(center, width, np.sqrt(2.0) / _FWHM * nodes, weights)


def _band(center: float, width: float, nodes: np.ndarray, weights: np.ndarray) -> Band:
    if not (np.isfinite(width) and width >= 0.0):
        raise DataError(f"band: its width is {width!r}, it must be a number of 0 or more")
    return Band(np.array([center]), np.ones(1)) if width == 0.0 else Band(center + width * nodes, weights)


def tabulated_band(wavelengths: ArrayLike, transmission: ArrayLike) -> Band:
    """A band from a table, taken as straight lines between its points.

    Parameters
    ----------
    wavelengths
        nm, ascending, shape (K,), K ≥ 2.
    transmission
        Of the filter, times the spectrum of the source and the response of the detector if they are known; any scale.

    Raises
    ------
    DataError
        If the table is not like this.
    """
    x, y = np.asarray(wavelengths, dtype=float), np.asarray(transmission, dtype=float)
    if x.ndim != 1 or x.shape != y.shape or len(x) < 2 or not (np.diff(x) > 0.0).all():
        raise DataError(
            "band: the table needs two or more wavelengths, ascending, with one transmission each"
        )
    if not (y >= 0.0).all():
        raise DataError("band: a transmission is negative or not a number")
    nodes, weights = np.polynomial.legendre.leggauss(4)
    steps = np.diff(x)[:, None]
    inside = x[:-1, None] + 0.5 * steps * (nodes + 1.0)
    return Band(inside.ravel(), (0.5 * steps * weights * np.interp(inside, x, y)).ravel())


def read_band(path: str | Path) -> Band:
    """A tabulated band from a CSV file with the columns ``wavelength_nm`` and ``transmission``, see `tabulated_band`.

    :mod:`pbrdf.files.delimited` says how columns may be separated.

    Raises
    ------
    DataError
        If the file cannot be read or does not hold that; names the file, the line and the column.
    """
    path = Path(path)
    table = read_table(path)
    wavelengths, transmission = (table.numbers(table.column(name)) for name in _COLUMNS)
    try:
        return tabulated_band(wavelengths, transmission)
    except DataError as error:
        raise DataError(f"{path}: {error}") from error


def cauchy(*coefficients: float) -> Birefringence:
    """Birefringence A + B/λ² + C/λ⁴ + …, λ in micrometres as in tables; only ratios of the coefficients count."""
    return lambda nm: np.polynomial.polynomial.polyval(
        (np.asarray(nm, dtype=float) / 1000.0) ** -2, coefficients
    )


def in_band(
    polarimeter: Polarimeter,
    band: Band,
    *,
    reference: float | None = None,
    birefringence: Birefringence | None = None,
) -> Polarimeter:
    """The polarimeter as it answers to light of a whole band.

    Parameters
    ----------
    polarimeter
        Made by its settings (retardances, angles); polarisers without retarder do not change.
    band
        Wavelengths and weights.
    reference
        Wavelength at which the retardances hold, nm; by default the band's mean.
    birefringence
        Of all retarders, against the wavelength in nm; by default the same everywhere, δ ∝ 1/λ.

    Returns
    -------
    Polarimeter
        With averaged analyser vectors; the settings in `details` are those at the reference wavelength.

    Raises
    ------
    DataError
        If the polarimeter is known by its analyser vectors alone: nothing says how they change with the wavelength.
    """
    settings = polarimeter.details
    if not polarimeter.is_described:
        raise DataError(
            f"{polarimeter.name} is known by its analyser vectors alone: a band average needs its retardances"
        )
    dispersive = [key for key in _DISPERSIVE if key in settings]
    if not dispersive:
        return polarimeter
    at = band.center if reference is None else float(reference)
    if not (np.isfinite(at) and at > 0.0):
        raise DataError(
            f"band: the reference wavelength is {reference!r}, it must be a positive number of nm"
        )
    scale = at / band.wavelengths
    if birefringence is not None:
        ratio = np.asarray(birefringence(band.wavelengths)) / np.asarray(birefringence(np.array([at])))
        if not (np.isfinite(ratio).all() and (ratio > 0.0).all()):
            raise DataError("band: the birefringence changes sign or is not a number within the band")
        scale = scale * ratio
    key = dispersive[0]
    average = sum(
        weight * from_settings({**settings, key: np.multiply(settings[key], factor)}).analyzer
        for factor, weight in zip(scale, band.weights, strict=True)
    )
    note = {"center": band.center, "reference": at, "samples": len(band.wavelengths)}
    return replace(polarimeter, analyzer=average, details={**settings, "band": note})
