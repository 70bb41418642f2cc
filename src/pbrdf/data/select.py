"""Small questions asked of a data set, and its values on the scale of a BRDF."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from pbrdf.data.conventions import reflectance_factor_to_brdf, remove_cosine_weight
from pbrdf.data.covariance import derived_variance
from pbrdf.data.schema import COVARIANCE, NORMALISED, VARIABLES, std_name, variable_units
from pbrdf.errors import DataError
from pbrdf.optics.stokes import STOKES

__all__ = ["WAVELENGTH_TOLERANCE", "match_wavelengths", "measured_channels", "to_brdf_scale"]

#: Half the width within which a wavelength that was asked for meets one that was measured, nm.
WAVELENGTH_TOLERANCE = 0.5


def measured_channels(ds: xr.Dataset) -> tuple[str, ...]:
    """Names of the data variables with at least one value, in the order of the schema."""
    return tuple(
        name for name in VARIABLES if name in ds.data_vars and bool(np.any(~np.isnan(ds[name].values)))
    )


def to_brdf_scale(ds: xr.Dataset) -> xr.Dataset:
    """The same data as a BRDF, uncertainties and covariances included.

    A reflectance factor is divided by π, radiance and digital numbers by cos θ_i. The unknown factor of the
    last two stays in the values, which the attribute ``scale = "arbitrary"`` records unless they state ``"absolute"``.
    Ratios (degree and angle of polarisation, what is divided by I or m00) are not touched; data of ratios alone keep
    their quantity.

    Parameters
    ----------
    ds
        A valid data set; it is not changed.

    Returns
    -------
    xarray.Dataset
        A new data set with ``quantity = "brdf"``, or ``"normalised"`` as it was.
    """
    quantity = ds.attrs["quantity"]
    result = ds.copy(deep=True)
    if quantity in ("brdf", NORMALISED):
        return result

    def scaled(values: NDArray[np.float64]) -> NDArray[np.float64]:
        if quantity == "reflectance_factor":
            return reflectance_factor_to_brdf(values)
        return remove_cosine_weight(values, ds["theta_i"].values)

    def put(name: str, values: NDArray[np.float64]) -> None:
        result[name] = (ds[name].dims, values, {**ds[name].attrs, "units": variable_units(name, "brdf")})

    for channel in (*STOKES, "mueller"):
        for name in (channel, std_name(channel)):
            if name in ds.data_vars:
                put(name, scaled(ds[name].values))
    if COVARIANCE in ds.data_vars:
        covariance = scaled(scaled(ds[COVARIANCE].values))
        for i, channel in enumerate(STOKES):
            # once more the exact square of the standard uncertainty, which rounding made it miss
            known = np.isfinite(covariance[:, i, i])
            covariance[known, i, i] = derived_variance(result, channel)[known]
        put(COVARIANCE, covariance)
    result.attrs["quantity"] = "brdf"
    if quantity in ("radiance", "dn"):
        result.attrs.setdefault("scale", "arbitrary")
    return result


def match_wavelengths(
    available: NDArray[np.float64], wanted: float | Sequence[float] | None, origin: str
) -> list[int]:
    """Indices of the wanted wavelengths among those of a file, in the file's order.

    Parameters
    ----------
    available
        The file's wavelengths in nm, shape (N,).
    wanted
        One or several wavelengths in nm, met within 0.5 nm; None takes all.
    origin
        The file's name, for the message.

    Raises
    ------
    DataError
        If one was not measured; names those that were.
    """
    if wanted is None:
        return list(range(len(available)))
    found: set[int] = set()
    for value in np.atleast_1d(np.asarray(wanted, dtype=np.float64)):
        distance = np.abs(available - value)
        if not distance.min() <= WAVELENGTH_TOLERANCE:
            listed = ", ".join(f"{x:g}" for x in available)
            raise DataError(f"{origin}: {value:g} nm was not measured; there are {listed} nm")
        found.add(int(distance.argmin()))
    return sorted(found)
