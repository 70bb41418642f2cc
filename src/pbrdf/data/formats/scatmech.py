"""Mueller-matrix tables in the layout of NIST's SCATMECH data.

T. A. Germer published the BRDF of sintered PTFE so (Applied Optics 56, 9333 (2017)). Columns: ``lambda`` in
µm; ``thetai``, ``phi`` (or ``phii``), ``thetar``, ``phir`` in degrees; ``f_r11`` in 1/sr; and
``f_rij/f_r11`` (or ``mij``) for the other fifteen elements, counted from 1.

``thetai`` is negative with ``phi`` = 0: the source stands at azimuth 180° and forward is ``phir`` = 0. The
polarisation is given in SCATMECH's ``xyxy`` frame of the sample, with Q = |E_y|² − |E_x|², where y is s and x
is p in the plane of incidence. The reader turns the outgoing frame to s and p and then swaps Q to I_p − I_s.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from pbrdf.data.build import assemble
from pbrdf.data.conventions import mueller_xyxy_to_sp
from pbrdf.data.convert import from_scatmech_mueller
from pbrdf.data.formats.declaration import Reader
from pbrdf.data.select import match_wavelengths
from pbrdf.data.validation import validate
from pbrdf.errors import DataError
from pbrdf.files.delimited import column_names, read_table

__all__ = ["READER", "read_scatmech"]

_INDICES = [(i, j) for i in range(1, 5) for j in range(1, 5)]
_COLUMNS = {
    "lambda": ("lambda",),
    "thetai": ("thetai",),
    "phi": ("phi", "phii"),
    "thetar": ("thetar",),
    "phir": ("phir",),
    **{f"m{i}{j}": (f"f_r{i}{j}/f_r11", f"m{i}{j}") for i, j in _INDICES[1:]},
    "f_r11": ("f_r11", "fr11"),
}


def read_scatmech(path: str | Path, *, wavelength: float | Sequence[float] | None = None) -> xr.Dataset:
    """Read a Mueller-matrix table in SCATMECH's layout.

    Parameters
    ----------
    path
        The file.
    wavelength
        Wavelength or wavelengths to take, in nm; all if None.

    Returns
    -------
    xarray.Dataset
        ``mueller`` as a BRDF in 1/sr, project's conventions; ``group`` is θ_i in whole degrees.

    Raises
    ------
    DataError
        Names the file, the line and the column.
    """
    path = Path(path)
    table = read_table(path)
    names = [name.lower() for name in table.names]
    columns = {}
    for key, spellings in _COLUMNS.items():
        found = [names.index(spelling) for spelling in spellings if spelling in names]
        if not found:
            raise DataError(
                f"{path}: line {table.names_line}: there is no column {' or '.join(map(repr, spellings))}"
            )
        columns[key] = np.array(table.numbers(found[0]))
    table.require_rows()

    micrometres, which = np.unique(columns["lambda"], return_inverse=True)
    # Round: 0.351 µm times 1000 is not 351 in binary.
    available = np.round(micrometres * 1000, 6)
    keep = np.isin(which, match_wavelengths(available, wavelength, str(path)))
    columns = {key: values[keep] for key, values in columns.items()}
    kept_lines = np.array(table.lines)[keep].tolist()
    _require_known_source(path, columns["thetai"], columns["phi"], kept_lines)

    phi = np.deg2rad(columns["phir"])
    elements = [np.ones_like(phi), *(columns[f"m{i}{j}"] for i, j in _INDICES[1:])]
    normalized = np.stack(elements, axis=-1).reshape(-1, 4, 4)
    mueller = from_scatmech_mueller(mueller_xyxy_to_sp(normalized, phi))
    ds = assemble(
        {
            "theta_i": np.deg2rad(-columns["thetai"]),
            "theta_r": np.deg2rad(columns["thetar"]),
            "phi": phi,
            "wavelength": available[which[keep]],
            "group": np.round(-columns["thetai"]).astype(np.int64),
        },
        {"mueller": columns["f_r11"][:, np.newaxis, np.newaxis] * mueller},
        {},
        {"quantity": "brdf", "illumination": [1.0, 0.0, 0.0, 0.0], "simulated": 0, "source": path.name},
    )
    validate(ds, origin=str(path), lines=kept_lines)
    return ds


def _require_known_source(path: Path, theta_i: np.ndarray, phi_i: np.ndarray, lines: list[int]) -> None:
    odd = np.flatnonzero((theta_i > 0) | (phi_i != 0))
    if odd.size:
        row = odd[0]
        raise DataError(
            f"{path}: line {lines[row]}: thetai = {theta_i[row]:g}, phi = {phi_i[row]:g}; only thetai <= 0 "
            "with phi = 0 is understood, where forward is phir = 0 and the polarisation axes are certain"
        )


def _has_the_columns(path: Path) -> bool:
    names = {name.lower() for name in column_names(path)}
    return not names.isdisjoint(_COLUMNS["f_r11"]) and not names.isdisjoint(("lambda", "thetai"))


READER = Reader(
    "scatmech", read_scatmech, extensions=(".csv", ".tsv", ".txt", ".dat"), sniff=_has_the_columns
)
