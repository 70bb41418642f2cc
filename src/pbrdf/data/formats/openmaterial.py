"""BRDF look-up tables of ASAM OpenMATERIAL 3D (``.xompt``).

JSON: ``metadata`` with ``name``, ``sources`` and more, and ``brdf`` with ``wavelengths`` and ``lookupTable``, rows of
five numbers: wavelength in **metres**, zenith angles of incidence and exit, azimuth of the exit, all in **radians**,
and the BRDF in 1/sr; null where there is none. Source: ``material_brdf_schema.json`` of asam-ev/OpenMATERIAL-3D.

The exit's azimuth is "relative to the incident azimuth angle", which is 0 "because the incident ray is used as the
reference" (issue 436). Both are those of directions on the hemisphere over the surface: azimuth 0 is back towards the
source and π the specular half-plane, as in the usual definition of a BRDF by two directions, which that issue agrees
to keep. The reader moves forward from π to 0; for files by another reading there is the option `azimuth`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from pbrdf.data.conventions import azimuth_forward_pi_to_zero
from pbrdf.data.formats.declaration import Reader
from pbrdf.data.formats.scalar_rows import incidence_groups, scalar_rows
from pbrdf.data.select import match_wavelengths
from pbrdf.errors import DataError
from pbrdf.files.text import first_bytes, read_lines

__all__ = ["READER", "read_openmaterial"]

_COLUMNS = (
    "the wavelength",
    "the incident zenith angle",
    "the exit zenith angle",
    "the exit azimuth",
    "the BRDF",
)
#: Wavelengths that the schema allows, m.
_RANGE = (1e-9, 0.01716)
_FORWARD = {"forward=180": True, "forward=0": False}
_LARGEST_HEAD = 2**16


def read_openmaterial(
    path: str | Path, *, wavelength: float | Sequence[float] | None = None, azimuth: str | None = None
) -> xr.Dataset:
    """Read a scalar BRDF from an OpenMATERIAL file.

    Parameters
    ----------
    path
        The file.
    wavelength
        Wavelength or wavelengths to take, in nm; all if None.
    azimuth
        ``"forward=180"`` (None) or ``"forward=0"``: the exit's azimuth in the specular half-plane.

    Returns
    -------
    xarray.Dataset
        ``I`` as a BRDF in 1/sr under natural light, in the order of the file; ``group`` is θ_i in whole degrees;
        ``simulated`` is 1 where ``sources`` says so. Rows without a BRDF are left out.

    Raises
    ------
    DataError
        Names the file and the row of the table.
    """
    path = Path(path)
    if azimuth is not None and azimuth not in _FORWARD:
        raise DataError(f"{path}: azimuth={azimuth!r} is not understood; use {' or '.join(_FORWARD)}")
    content = _json(path)
    metadata = content.get("metadata")
    metadata = metadata if isinstance(metadata, Mapping) else {}
    rows = _rows(path, content)
    metres, theta_i, theta_r, phi, values = rows.T
    # an azimuth means nothing at the normal
    phi = np.where(np.isnan(phi) & ((theta_i == 0) | (theta_r == 0)), np.pi, phi)
    for column, name in enumerate(_COLUMNS[:4]):
        missing = np.flatnonzero(np.isnan((metres, theta_i, theta_r, phi)[column]) & ~np.isnan(values))
        if missing.size:
            raise DataError(f"{path}: lookupTable, row {missing[0] + 1}: {name} is null")
    outside = np.flatnonzero((metres < _RANGE[0]) | (metres > _RANGE[1]))
    if outside.size:
        raise DataError(
            f"{path}: lookupTable, row {outside[0] + 1}: the wavelength is {metres[outside[0]]:g}; it must be in "
            "metres (9.05e-07 is 905 nm)"
        )
    # Round: 9.05e-07 times 1e9 is not 905 in binary.
    nanometres = np.round(metres * 1e9, 6)
    available = np.unique(nanometres[~np.isnan(values)])
    if not available.size:
        raise DataError(f"{path}: no row of the lookupTable has a BRDF")
    chosen = np.isin(nanometres, available[match_wavelengths(available, wavelength, str(path))])
    forward_is_pi = _FORWARD[azimuth or "forward=180"]
    sources = str(metadata.get("sources", ""))
    return scalar_rows(
        path,
        {
            "theta_i": theta_i[chosen],
            "theta_r": theta_r[chosen],
            "phi": azimuth_forward_pi_to_zero(phi[chosen]) if forward_is_pi else phi[chosen],
            "wavelength": nanometres[chosen],
            "group": incidence_groups(theta_i[chosen]),
        },
        values[chosen],
        None,
        attrs={
            "title": _line(metadata.get("name")),
            "source": f"{path.name}{': ' * bool(sources)}{_line(sources)}",
            "reference": _line(metadata.get("description")),
            "simulated": int("simulat" in sources.lower()),
        },
    )


def _json(path: Path) -> Mapping[str, Any]:
    text = "\n".join(read_lines(path))
    try:
        content = json.loads(text)
    except json.JSONDecodeError as error:
        raise DataError(
            f"{path}: line {error.lineno}: not JSON: {error.msg}; is the file truncated?"
        ) from error
    except (RecursionError, ValueError) as error:
        raise DataError(f"{path}: not JSON that can be read: {error}") from error
    if not isinstance(content, Mapping):
        raise DataError(
            f"{path}: this is not an OpenMATERIAL file: it is not an object with metadata and brdf"
        )
    return content


def _rows(path: Path, content: Mapping[str, Any]) -> np.ndarray:
    """The table, shape (N, 5), NaN for null."""
    brdf = content.get("brdf")
    table = brdf.get("lookupTable") if isinstance(brdf, Mapping) else None
    if not isinstance(table, list):
        kinds = ", ".join(key for key in content if key not in ("metadata", "$schema")) or "nothing"
        raise DataError(
            f"{path}: there is no brdf with a lookupTable in this OpenMATERIAL file; it holds {kinds}"
        )
    if not table:
        raise DataError(f"{path}: the lookupTable is empty")
    for number, row in enumerate(table, start=1):
        if not isinstance(row, list) or len(row) != len(_COLUMNS):
            raise DataError(f"{path}: lookupTable, row {number}: five numbers are needed, not {row!r:.60}")
        for name, cell in zip(_COLUMNS, row, strict=True):
            if cell is None:
                continue
            if isinstance(cell, bool) or not isinstance(cell, int | float) or not abs(cell) < 1e300:
                raise DataError(f"{path}: lookupTable, row {number}: {name} is {cell!r:.60}, not a number")
    return np.array(table, dtype=np.float64)


def _line(text: object) -> str:
    return " ".join(str(text).split()) if isinstance(text, str) else ""


def _is_a_lookup_table(path: Path) -> bool:
    head = first_bytes(path, _LARGEST_HEAD)
    return head.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"{") and (
        b'"lookupTable"' in head or b"material_brdf_schema" in head
    )


READER = Reader("openmaterial", read_openmaterial, extensions=(".xompt",), sniff=_is_a_lookup_table)
