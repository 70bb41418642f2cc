"""Data sets as CSV tables."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from pbrdf.data.covariance import derived_variance
from pbrdf.data.degrees import exact_degrees
from pbrdf.data.formats.attributes import encode_attribute, plain_attributes
from pbrdf.data.formats.csv_table.columns import COVARIANCES, ELEMENTS
from pbrdf.data.formats.csv_table.ratios import RATIO_ELEMENTS
from pbrdf.data.schema import COVARIANCE, NATURAL_LIGHT, VARIABLES, std_name, with_group
from pbrdf.data.validation import validate
from pbrdf.files.delimited import table_text, write_table
from pbrdf.optics.stokes import STOKES

__all__ = ["csv_text", "write_csv"]


def write_csv(ds: xr.Dataset, path: str | Path) -> None:
    """Write a data set as a CSV table that is read back bit for bit.

    Angles are written in degrees; a column with an angle that no number of degrees stands for exactly is
    written in radians, as its name then says. The file appears under its name only when it is complete.

    Parameters
    ----------
    ds
        A valid data set.
    path
        The file; replaced if it exists.

    Raises
    ------
    DataError
        If `ds` does not follow the schema or the file cannot be written.
    """
    columns, statements = _parts(ds)
    write_table(Path(path), columns, zip(*columns.values(), strict=True), statements)


def csv_text(ds: xr.Dataset) -> str:
    """What :func:`write_csv` writes."""
    columns, statements = _parts(ds)
    return table_text(columns, zip(*columns.values(), strict=True), statements)


def _parts(ds: xr.Dataset) -> tuple[dict[str, list[str]], dict[str, str]]:
    """Cells by the names of the columns, and what is stated above."""
    validate(ds)
    ds = with_group(ds)
    header = {"azimuth": "forward=0", "stokes": "p-s"}
    for name, value in plain_attributes(ds.attrs).items():
        if name == "illumination":
            header[name] = "natural" if tuple(value) == NATURAL_LIGHT else ",".join(map(repr, value))
        elif name != "stokes_convention":
            header[name] = encode_attribute(name, value)
    statements = {name: header[name] for name in sorted(header, key=lambda name: name != "quantity")}
    return dict(_text_columns(ds)), statements


def _text_columns(ds: xr.Dataset) -> Iterator[tuple[str, list[str]]]:
    for name in ("theta_i", "theta_r", "phi"):
        yield _text_angle(ds, name)
    if "wavelength" in ds.coords:
        yield "wavelength_nm", _text(ds["wavelength"].values)
    yield "group", [str(label) for label in ds["group"].values]
    for channel in VARIABLES:
        for name in (channel, std_name(channel)):
            if name not in ds.data_vars:
                continue
            if channel == "aolp":
                yield _text_angle(ds, name)
            elif channel in ("mueller", "mueller_over_m00"):
                flat = ds[name].values.reshape(-1, 16)
                for position, element in enumerate(ELEMENTS if channel == "mueller" else RATIO_ELEMENTS):
                    yield element + name.removeprefix(channel), _text(flat[:, position])
            else:
                yield name, _text(ds[name].values)
    if COVARIANCE in ds.data_vars:
        for i, j in _covariances_written(ds):
            yield COVARIANCES[i, j], _text(ds[COVARIANCE].values[:, i, j])


def _covariances_written(ds: xr.Dataset) -> list[tuple[int, int]]:
    """Entries that a file needs: those between what was measured, and variances other than exactly std²."""
    matrix = ds[COVARIANCE].values
    written = []
    for i, j in COVARIANCES:
        if i == j:
            needed = not np.array_equal(matrix[:, i, i], derived_variance(ds, STOKES[i]), equal_nan=True)
        else:
            needed = STOKES[i] in ds.data_vars and STOKES[j] in ds.data_vars
        if needed:
            written.append((i, j))
    return written or [(0, 0)]


def _text_angle(ds: xr.Dataset, name: str) -> tuple[str, list[str]]:
    radians = ds[name].values
    degrees = exact_degrees(radians)
    return (f"{name}_rad", _text(radians)) if degrees is None else (f"{name}_deg", _text(degrees))


def _text(values: NDArray[np.float64]) -> list[str]:
    return [repr(float(value)) for value in values]
