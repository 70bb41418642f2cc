"""A data set from the variables of a CSV file: its conventions turned into the project's."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from pbrdf.data import conventions
from pbrdf.data.build import assemble
from pbrdf.data.covariance import square
from pbrdf.data.formats.csv_table.columns import CHANNELS, COVARIANCES, ELEMENTS, Column
from pbrdf.data.formats.csv_table.header import Header
from pbrdf.data.formats.csv_table.ratios import (
    already_divided,
    gather_ratios,
    swap_sp_of_ratios,
    without_derived,
)
from pbrdf.data.formats.csv_table.values import Values
from pbrdf.data.schema import NORMALISED, RATIOS, std_name
from pbrdf.errors import DataError
from pbrdf.files.delimited import Table
from pbrdf.optics.stokes import STOKES

__all__ = ["to_dataset"]

#: Variables whose sign depends on what Q > 0 means.
_SIGNED = {"Q", "U", "aolp", "mueller", "Q_over_I", "U_over_I", "mueller_over_m00"}


def to_dataset(
    table: Table,
    header: Header,
    columns: list[Column],
    read: Values,
    ignored: list[str],
    assumed: list[str],
) -> xr.Dataset:
    """Assemble what the columns hold.

    Parameters
    ----------
    table
        The file's text, for messages.
    header
        The file's conventions.
    columns
        The columns that were understood.
    read
        Their values, as :func:`pbrdf.data.formats.csv_table.values.values_of` gives them.
    ignored
        Names of the columns left out.
    assumed
        Sentences on what the names of the columns left open.

    Returns
    -------
    xarray.Dataset
        In the project's conventions, not yet validated; the attribute ``assumptions`` says what the file left open.

    Raises
    ------
    DataError
        If a side is not clear, or the variables do not fit together.
    """
    values = dict(read.arrays)
    assumptions = [*_directions(table, header, columns, values), *assumed, *read.assumptions]

    channels = {name: values[name] for name in CHANNELS if name in values}
    if not channels:
        raise DataError(
            f"{table.path}: no column holds values; name one, for example with column={{'I': …}}. The columns are "
            f"{', '.join(table.names)}"
        )
    std = {name: values[std_name(name)] for name in CHANNELS if std_name(name) in values}
    channels, std = (gather_ratios(_gather_mueller(part)) for part in (channels, std))
    if header.quantity == NORMALISED:
        try:
            channels, std = already_divided(channels, std)
        except DataError as error:
            raise DataError(f"{table.path}: {error}") from None
    assumptions += without_derived(channels, std)
    covariance = _gather_covariance(values)
    if "stokes" in header.unstated and channels.keys() & _SIGNED:
        assumptions.append("the file does not say what Q > 0 means; Q = I_p - I_s was assumed")
    illumination = header.illumination
    if not header.p_minus_s:
        illumination = conventions.stokes_swap_sp(illumination).tolist()
        channels = swap_sp_of_ratios(_swap_sp(channels))
        covariance = None if covariance is None else conventions.covariance_swap_sp(covariance)
    if header.cosine_weighted:
        for part in (channels, std):
            for name in part.keys() - set(RATIOS):
                part[name] = conventions.remove_cosine_weight(part[name], values["theta_r"])
        if covariance is not None:
            for _ in range(2):
                covariance = conventions.remove_cosine_weight(covariance, values["theta_r"])

    if covariance is not None:
        for i, name in enumerate(STOKES):
            if COVARIANCES[i, i] not in values and name in std:
                covariance[:, i, i] = square(std[name])
    extra: dict[str, Any] = {"ignored_columns": ignored} if ignored else {}
    if assumptions:
        extra["assumptions"] = assumptions
    coordinates = {name: values.get(name) for name in ("theta_i", "theta_r", "phi", "wavelength", "group")}
    if read.scale is not None:
        extra.setdefault("scale", header.attrs.get("scale", read.scale))
    attrs = {
        **header.attrs,
        "quantity": read.quantity,
        "illumination": illumination,
        **extra,
    }
    try:
        return assemble(coordinates, channels, std, attrs, covariance)
    except DataError as error:
        raise DataError(f"{table.path}: {error}") from None


def _directions(
    table: Table, header: Header, columns: list[Column], values: dict[str, NDArray[Any]]
) -> list[str]:
    """Bring the directions in `values` to θ ≥ 0 and φ = 0 forward; sentences on what was assumed."""
    assumptions = []
    theta_i, theta_r = values["theta_i"], values["theta_r"]
    stated = "azimuth" not in header.unstated
    by_variable = {column.variable: column for column in columns}
    if "phi" not in values and _in_mirror_direction(columns):
        turned = theta_i < 0
        if "group" not in values and turned.any() and not turned.all():
            values["group"] = np.where(turned, "negative side", "positive side")
        values["theta_i"] = values["theta_r"] = np.abs(theta_i)
        values["phi"] = np.zeros_like(theta_i)
        return [
            "theta_i and theta_r are the same column; the viewer was taken in the mirror direction (phi = 0), and "
            "the sign as the side of the normal on which the source stands"
        ]
    if "phi" in values:
        phi = values["phi"]
        if "phi_i" in by_variable:
            if not stated:
                assumptions.append(
                    "the file does not say how its two azimuths are counted; phi is forward where they differ by 180 "
                    "degrees, as for directions that point away from the surface"
                )
            # with both azimuths a negative zenith angle has one meaning on either side
            phi = _turned(phi, theta_i < 0)
            theta_i = np.where(theta_i < 0, -theta_i, theta_i)
        elif not stated and by_variable["phi"].index is not None:
            assumptions.append("the file does not say where phi = 0 lies; the forward half-plane was assumed")
        values["phi"] = _turned(phi, theta_r < 0)
    else:
        if not stated:
            _require_positive_incidence(table, theta_i, columns)
            assumptions.append(
                "the file has no azimuth; theta_r >= 0 was taken as forward, theta_r < 0 as backward"
            )
        # of a signed scan the specular side is that of equal signs, or of opposite ones where forward is 180
        same_side = (theta_r < 0) == (theta_i < 0)
        forward = same_side if header.forward_at_zero else ~same_side
        values["phi"] = np.where(forward | (theta_r == 0), 0.0, np.pi)
        theta_i = np.where(theta_i < 0, -theta_i, theta_i)
    values["theta_i"] = theta_i
    # Not abs(), which would lose the sign of −0.0 that a round trip has to keep.
    values["theta_r"] = np.where(theta_r < 0, -theta_r, theta_r)
    return assumptions


def _in_mirror_direction(columns: list[Column]) -> bool:
    """Whether one column of the file holds both zenith angles."""
    found = {column.variable: column.index for column in columns}
    return found["theta_i"] is not None and found["theta_i"] == found["theta_r"]


def _turned(phi: NDArray[np.float64], where: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Azimuths on the opposite side."""
    return np.where(where, phi + np.where(phi > 0, -np.pi, np.pi), phi)


def _require_positive_incidence(table: Table, theta_i: NDArray[np.float64], columns: list[Column]) -> None:
    negative = np.flatnonzero(theta_i < 0)
    if negative.size:
        index = next(column.index for column in columns if column.variable == "theta_i") or 0
        raise DataError(
            f"{table.place(int(negative[0]), index)}: a negative theta_i without an azimuth column could "
            "mean either side; count theta_i from 0 to 90 and give theta_r the sign, or add phi, or say which side is "
            "specular: azimuth='forward=0' where theta_i and theta_r have the same sign there, azimuth='forward=180' "
            "where they have opposite ones"
        )


def _gather_mueller(values: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Replace the columns m00 … m33 by one array (N, 4, 4); elements without a column are NaN."""
    elements = {name: value for name, value in values.items() if name in ELEMENTS}
    rest = {name: value for name, value in values.items() if name not in ELEMENTS}
    if elements:
        missing = np.full(len(next(iter(elements.values()))), np.nan)
        stacked = np.stack([elements.get(name, missing) for name in ELEMENTS], axis=-1)
        rest["mueller"] = stacked.reshape(-1, 4, 4)
    return rest


def _gather_covariance(values: Mapping[str, NDArray[Any]]) -> NDArray[np.float64] | None:
    """The covariance, shape (N, 4, 4), from its columns, NaN where there is none; None without any."""
    if not values.keys() & set(COVARIANCES.values()):
        return None
    matrix = np.full((len(values["theta_i"]), 4, 4), np.nan)
    for (i, j), name in COVARIANCES.items():
        if name in values:
            matrix[:, i, j] = matrix[:, j, i] = values[name]
    return matrix


def _swap_sp(channels: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    swapped = dict(channels)
    for name in swapped.keys() & {"Q", "U"}:
        swapped[name] = -swapped[name]
    if "aolp" in swapped:
        swapped["aolp"] = conventions.aolp_swap_sp(swapped["aolp"])
    if "mueller" in swapped:
        swapped["mueller"] = conventions.mueller_swap_sp(swapped["mueller"])
    return swapped
