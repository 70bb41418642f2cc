"""Data files of ALTA, the library of BRDF fits of Inria (``.dat``, ``.alta``).

Lines that begin with ``#`` are the header: ``#DIM n m`` states how many numbers of a row are coordinates and how many
are values, ``#PARAM_IN`` what the coordinates are, ``#PARAM_OUT`` what the values are, ``#VS`` whether one (1) or two
(2) numbers of a confidence interval follow the values. Then one row a line, angles in radians; or, after ``#FORMAT
binary``, ``#SAMPLE_COUNT`` rows of float64 between ``#BEGIN_STREAM`` and ``#END_STREAM``.

Source: ``core/params.h``, ``core/params.cpp`` and ``core/data_storage.cpp`` of belcour/alta. The view vector V and
the light vector L both point away from the surface, so forward is where their azimuths differ by π; the reader moves
it to 0. Half and difference angles are Rusinkiewicz's (:mod:`pbrdf.optics.half_difference`) with V in the place of
his first vector. ``INV_STERADIAN_COSINE_FACTOR`` carries the cosine of the output direction, V. The confidence
intervals are not read: the format does not say how probable they are.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from pbrdf.data.conventions import azimuth_forward_pi_to_zero
from pbrdf.data.formats.declaration import Reader
from pbrdf.data.formats.number_lines import NumberLines
from pbrdf.data.formats.scalar_rows import incidence_groups, scalar_rows
from pbrdf.errors import DataError
from pbrdf.files.plain_numbers import count_from_text
from pbrdf.files.text import first_bytes
from pbrdf.optics.half_difference import directions

__all__ = ["READER", "read_alta"]

_Array = NDArray[np.float64]
#: θ_i, θ_r and φ (forward π) from the coordinates of a row.
_Conversion = Callable[..., tuple[_Array, _Array, _Array]]


def _from_half(theta_h: _Array, theta_d: _Array, phi_d: _Array) -> tuple[_Array, _Array, _Array]:
    theta_v, theta_l, phi = directions(theta_h, theta_d, phi_d)
    return theta_l, theta_v, phi + np.pi


def _from_projected(theta_l: _Array, x: _Array, y: _Array) -> tuple[_Array, _Array, _Array]:
    return theta_l, np.hypot(x, y), np.arctan2(y, x)


def _from_vectors(
    vx: _Array, vy: _Array, vz: _Array, lx: _Array, ly: _Array, lz: _Array
) -> tuple[_Array, _Array, _Array]:
    phi = np.arctan2(vy, vx) - np.arctan2(ly, lx)
    return np.arctan2(np.hypot(lx, ly), lz), np.arctan2(np.hypot(vx, vy), vz), phi


_PARAM_IN: dict[str, tuple[int, _Conversion]] = {
    "RUSIN_TH_TD": (2, lambda h, d: _from_half(h, d, np.full_like(h, np.pi / 2))),
    "COS_TH_TD": (2, lambda h, d: _from_half(np.arccos(h), np.arccos(d), np.zeros_like(h))),
    "ISOTROPIC_TV_PROJ_DPHI": (2, lambda x, y: _from_projected(np.zeros_like(x), x, y)),
    "RUSIN_TH_TD_PD": (3, _from_half),
    "ISOTROPIC_TV_TL_DPHI": (3, lambda tv, tl, phi: (tl, tv, phi)),
    "ISOTROPIC_TL_TV_PROJ_DPHI": (3, _from_projected),
    "RUSIN_TH_PH_TD_PD": (4, lambda h, _, d, phi: _from_half(h, d, phi)),
    "SPHERICAL_TL_PL_TV_PV": (4, lambda tl, pl, tv, pv: (tl, tv, pv - pl)),
    "CARTESIAN": (6, _from_vectors),
}
_PARAM_OUT = {
    "INV_STERADIAN": None,
    "INV_STERADIAN_COSINE_FACTOR": None,
    "RGB_COLOR": ("red", "green", "blue"),
    "XYZ_COLOR": ("X", "Y", "Z"),
}
_ASSUMED = "the file does not say what its values are; BRDF in 1/sr was assumed"
_KEY = re.compile(r"#\s*([A-Z_]+)\s*(.*?)\s*$")


def read_alta(path: str | Path) -> xr.Dataset:
    """Read a scalar BRDF from a data file of ALTA.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    xarray.Dataset
        ``I`` as a BRDF in 1/sr under natural light; ``group`` is θ_i in whole degrees, or the colour. Samples with a
        direction below the horizon are left out, as ALTA's parametrisations by half vectors hold such ones.

    Raises
    ------
    DataError
        Names the file and the line; if the parametrisation does not tell both directions.
    """
    path = Path(path)
    header, rows, lines = _binary(path) or _text(path)
    name, n, m, out = _understood(path, header)
    if not rows.size:
        raise DataError(f"{path}: there are no rows under the header: is the file truncated?")
    with np.errstate(invalid="ignore"):
        theta_i, theta_r, phi = _PARAM_IN[name][1](*rows[:, :n].T)
    phi = azimuth_forward_pi_to_zero(phi)
    values = rows[:, n : n + m]
    if out == "INV_STERADIAN_COSINE_FACTOR":
        cosine = np.cos(theta_r)[:, np.newaxis]
        values = np.divide(values, cosine, out=np.full_like(values, np.nan), where=cosine > 1e-6)
    colours = _PARAM_OUT.get(out) or (tuple(str(k + 1) for k in range(m)) if m > 1 else None)
    group = incidence_groups(np.nan_to_num(theta_i)) if colours is None else np.tile(colours, len(rows))
    above = np.repeat((theta_i < np.pi / 2 + 1e-9) & (theta_r < np.pi / 2 + 1e-9), m)
    return scalar_rows(
        path,
        {
            "theta_i": np.repeat(theta_i, m),
            "theta_r": np.repeat(theta_r, m),
            "phi": np.repeat(phi, m),
            "group": group,
        },
        np.where(above, values.ravel(), np.nan),
        None if lines is None else np.repeat(lines, m),
        assumptions=[_ASSUMED] if out not in _PARAM_OUT else [],
    )


def _understood(path: Path, header: dict[str, str]) -> tuple[str, int, int, str]:
    """Name of the parametrisation, counts of coordinates and values, and what the values are."""
    try:
        n, m = map(count_from_text, header.get("DIM", "").split())
    except ValueError:
        n = m = 0
    if not (n and m):
        raise DataError(f"{path}: the header states no '#DIM n m', two counts from 1")
    name = header.get("PARAM_IN", "UNKNOWN_INPUT")
    if name not in _PARAM_IN:
        raise DataError(
            f"{path}: PARAM_IN {name} does not tell both directions, or not certainly; those that do are "
            f"{', '.join(_PARAM_IN)}: convert the file with ALTA's data2data"
        )
    if n != _PARAM_IN[name][0]:
        raise DataError(f"{path}: DIM states {n} coordinates, but PARAM_IN {name} has {_PARAM_IN[name][0]}")
    out = header.get("PARAM_OUT", "UNKNOWN_OUTPUT")
    if out not in (*_PARAM_OUT, "UNKNOWN_OUTPUT"):
        raise DataError(f"{path}: PARAM_OUT {out} is not a BRDF; {', '.join(_PARAM_OUT)} are")
    colours = _PARAM_OUT.get(out)
    if colours and m != len(colours):
        raise DataError(f"{path}: DIM states {m} values, but PARAM_OUT {out} has {len(colours)}")
    return name, n, m, out


def _text(path: Path) -> tuple[dict[str, str], _Array, NDArray[np.int64]]:
    lines = NumberLines(path)
    header = _keys("#" + comment for comment in lines.comments)
    _, n, m, _ = _understood(path, header)
    interval = {"1": 1, "2": 2}.get(header.get("VS", "0"), 0)
    rows, where = [], []
    while lines.peek() is not None:
        cells = lines.text("a row").split()
        if len(cells) not in (n + m, n + m + interval):
            raise lines.error(f"there are {len(cells)} numbers; {n} coordinates and {m} values are needed")
        rows.append([lines.number_in(cell, "a coordinate or a value") for cell in cells[: n + m]])
        where.append(lines.read_line)
    return header, np.array(rows).reshape(-1, n + m), np.array(where, np.int64)


def _binary(path: Path) -> tuple[dict[str, str], _Array, None] | None:
    """As :func:`_text`, of a binary file; None if it is none."""
    head = first_bytes(path, 2**16)
    start = re.search(rb"^#\s*BEGIN_STREAM\r?\n", head, re.MULTILINE)
    if start is None:
        return None
    header = _keys(head[: start.start()].decode("latin-1").splitlines())
    _, n, m, _ = _understood(path, header)
    order = {"little": "<", "big": ">"}.get(header.get("ENDIAN", ""))
    try:
        count = count_from_text(header.get("SAMPLE_COUNT", ""))
    except ValueError:
        count = None
    if order is None or header.get("PRECISION") != "ieee754-double" or count is None:
        raise DataError(
            f"{path}: ENDIAN, PRECISION ieee754-double or SAMPLE_COUNT of the binary file is not stated"
        )
    width = n + m * (1 + {"1": 1, "2": 2}.get(header.get("VS", "0"), 0))
    body = path.read_bytes()[start.end() :]
    wanted = count * width * 8
    if len(body) < wanted:
        raise DataError(
            f"{path}: {count} samples are {wanted} bytes, but there are {len(body)}: it is truncated"
        )
    return header, np.frombuffer(body[:wanted], f"{order}f8").reshape(-1, width).astype(np.float64), None


def _keys(lines: Iterable[str]) -> dict[str, str]:
    found = (_KEY.match(line) for line in lines)
    return {match[1]: match[2] for match in found if match}


def _begins_as_alta(path: Path) -> bool:
    return re.search(rb"^#\s*DIM\s+\d+\s+\d+\s*$", first_bytes(path, 4096), re.MULTILINE) is not None


READER = Reader("alta", read_alta, extensions=(".alta", ".dat", ".txt"), sniff=_begins_as_alta)
