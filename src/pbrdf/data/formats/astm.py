"""BRDF files with the header of ASTM E1392, as Cornell University and others publish them (``.astm``).

Text: lines of a key in capitals and its value (``LAB_NAME``, ``SAMPLE_NAME``, ``MEAS_NAME``, ``NUM_POINTS`` …), the
last of them ``VARS`` with the names of the columns, separated by commas; then so many rows of numbers separated by
commas. Four columns are ``theta_i, phi_i, theta_s, phi_s``; the others are BRDF values in 1/sr: at a wavelength where
the name is like ``465nm``, else of a colour (``R,G,B`` or ``X,Y,Z``) or an average (``Integrated …``).

Sources: ``AstmReader.cpp`` of KimuraRyo/libbsdf, ``data_io/astm.cpp`` of belcour/alta. Angles are in **radians** (in
degrees only where they are larger than radians can be, which is said); directions point away from the surface, so
forward is ``phi_s`` − ``phi_i`` = π, as in Cornell's other format; the reader moves it to 0. Negative polar angles
are the other side of the normal. Files of the standard's own kind, over differences of direction cosines from the
specular direction, are not read: no sample of one was found.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from pbrdf.data.conventions import azimuth_forward_pi_to_zero
from pbrdf.data.formats.declaration import Reader
from pbrdf.data.formats.number_lines import NumberLines, begins_with, parsed_number
from pbrdf.data.formats.scalar_rows import incidence_groups, scalar_rows
from pbrdf.data.select import match_wavelengths
from pbrdf.errors import DataError
from pbrdf.files.text import first_bytes

__all__ = ["READER", "read_astm"]

_ANGLES = ("theta_i", "phi_i", "theta_s", "phi_s")
_SPECTRAL = re.compile(r"(\d+\.?\d*)\s*nm", re.IGNORECASE)


def read_astm(path: str | Path, *, wavelength: float | Sequence[float] | None = None) -> xr.Dataset:
    """Read a scalar BRDF from a file with an ASTM header.

    Parameters
    ----------
    path
        The file.
    wavelength
        Wavelength or wavelengths to take, in nm, where the columns have some; all if None.

    Returns
    -------
    xarray.Dataset
        ``I`` as a BRDF in 1/sr under natural light; ``group`` is θ_i in whole degrees, or the name of the column where
        there are several that are no wavelengths.

    Raises
    ------
    DataError
        Names the file and the line.
    """
    path = Path(path)
    lines = NumberLines(path)
    header: dict[str, str] = {}
    while "VARS" not in header:
        key, _, value = lines.text("a key of the header, VARS at its end").partition(" ")
        if not re.fullmatch(r"[A-Z][A-Z0-9_]*", key):
            raise lines.error(f"{key!r} is not a key of an ASTM header, which ends with VARS")
        header[key] = value.strip().strip('"')
    names = [name.strip() for name in header["VARS"].split(",")]
    where_names = lines.read_line
    missing = [name for name in _ANGLES if names.count(name) != 1]
    channels = [name for name in names if name not in _ANGLES]
    if missing or not channels:
        raise lines.error(f"VARS has no column {missing[0]}" if missing else "VARS has no column of values")
    rows, where = [], []
    while lines.peek() is not None:
        cells = [cell.strip() for cell in lines.text("a row").split(",")]
        if len(cells) != len(names):
            raise lines.error(f"there are {len(cells)} cells; VARS names {len(names)} columns")
        rows.append([lines.number_in(cell, name) for name, cell in zip(names, cells, strict=True)])
        where.append(lines.read_line)
    assumptions = _count_checked(path, header, len(rows))
    table = np.array(rows)
    theta_i, phi_i, theta_s, phi_s = (table[:, names.index(name)] for name in _ANGLES)
    if max(np.abs(theta_i).max(), np.abs(theta_s).max()) > np.pi / 2 + 0.01:
        theta_i, phi_i, theta_s, phi_s = (np.deg2rad(a) for a in (theta_i, phi_i, theta_s, phi_s))
        assumptions.append("polar angles are larger than a quarter turn in radians; degrees were assumed")
    phi = phi_s - phi_i + np.pi * (theta_i < 0) + np.pi * (theta_s < 0)
    spectral = [_SPECTRAL.fullmatch(name) for name in channels]
    nanometres = np.array([float(found[1]) for found in spectral if found])
    if nanometres.size not in (0, len(channels)):
        raise lines.error(f"VARS mixes wavelengths and others: {', '.join(channels)}", where_names)
    if not nanometres.size and wavelength is not None:
        raise DataError(
            f"{path}: the columns {', '.join(channels)} are of no wavelength: leave the option out"
        )
    chosen = match_wavelengths(nanometres, wavelength, str(path)) if nanometres.size else range(len(channels))
    k = len(chosen)
    return scalar_rows(
        path,
        {
            "theta_i": np.repeat(np.abs(theta_i), k),
            "theta_r": np.repeat(np.abs(theta_s), k),
            "phi": np.repeat(azimuth_forward_pi_to_zero(phi), k),
            "wavelength": np.tile(nanometres[list(chosen)], len(rows)) if nanometres.size else None,
            "group": np.tile(channels, len(rows))
            if not nanometres.size and k > 1
            else np.repeat(incidence_groups(np.abs(theta_i)), k),
        },
        table[:, [names.index(channels[c]) for c in chosen]].ravel(),
        np.repeat(where, k),
        attrs={"title": header.get("SAMPLE_NAME", ""), "instrument": header.get("SYSTEM_NAME", "")},
        assumptions=assumptions,
    )


def _count_checked(path: Path, header: dict[str, str], rows: int) -> list[str]:
    """Raise if rows are missing; a sentence if there are more than stated."""
    stated = parsed_number(header.get("NUM_POINTS", str(rows)))
    if stated is None or not rows or rows < stated:
        raise DataError(
            f"{path}: NUM_POINTS is {header.get('NUM_POINTS')}, but there are {rows} rows: is the file truncated?"
        )
    return (
        [] if rows == stated else [f"NUM_POINTS is {stated:g}, but the {rows} rows that are there were read"]
    )


def _begins_as_astm(path: Path) -> bool:
    return (
        begins_with(path, r"[A-Z][A-Z0-9_]+\s+\S")
        and re.search(rb"^VARS\s+\S*theta_i", first_bytes(path, 4096), re.MULTILINE) is not None
    )


READER = Reader("astm", read_astm, extensions=(".astm", ".txt", ".dat", ".brdf"), sniff=_begins_as_astm)
