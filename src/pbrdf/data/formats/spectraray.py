"""Text files of SENTECH's SpectraRay: normalised Mueller matrices, or ψ and Δ, of an ellipsometer.

A first line ``; WAVELENGTH`` with the angle of incidence of each column in degrees, then a line for each wavelength in
nm. A Mueller matrix has sixteen columns, row by row, divided by its first element; ψ and Δ have two. Several angles
stand side by side. The layout is that of two public files of pyElli (PyEllips/pyElli on GitHub: ``examples/SiO2_Si
Mueller Matrix/Wafer_MM_70.txt``, ``tests/test_spectraray/Si_SiO2_theta_50_60_70.txt``).

The geometry is that of the mirror: θ_r = θ_i, φ = 0. Q is I_p − I_s, and tan ψ e^{iΔ} = r_p/r_s with r_p = −r_s at
normal incidence, for fields e^{+iωt}, as here. Their Mueller matrix counts V the other way round: M34 = +sin 2ψ sin Δ,
which is −m23. The file of a film of SiO2 (104 nm) on silicon at 70.2° decides it: with this sign the elements fit to
0.02, with the other they do not for any thickness (``tests/data/formats/test_spectraray.py``).

ψ and Δ tell the matrix of a sample that is isotropic and does not depolarise: m01 = −cos 2ψ, m22 = sin 2ψ cos Δ, m23 =
−sin 2ψ sin Δ. The other elements, which follow from these, stay open: they are no further measurements.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from pbrdf.data.build import assemble
from pbrdf.data.conventions import mueller_flip_v
from pbrdf.data.formats.declaration import Reader
from pbrdf.data.schema import NATURAL_LIGHT
from pbrdf.data.validation import validate
from pbrdf.errors import DataError
from pbrdf.files.text import first_bytes, read_lines

__all__ = ["READER", "read_spectraray"]

_FIRST_LINE = re.compile(r";\s*WAVELENGTH((?:\s+[\d.,]+)+)\s*")
#: Columns of an angle: of a Mueller matrix, of ψ and Δ.
_MUELLER, _PSI_DELTA = 16, 2


def read_spectraray(path: str | Path) -> xr.Dataset:
    """Read a text file of SpectraRay.

    Returns
    -------
    xarray.Dataset
        ``mueller_over_m00`` in the direction of the mirror, a row for each wavelength and angle; of ψ and Δ only the
        elements m01, m22, m23.

    Raises
    ------
    DataError
        If it is not such a file, or a cell is not a number; names the line.
    """
    path = Path(path)
    lines = read_lines(path)
    header = _FIRST_LINE.fullmatch(lines[0].strip())
    if header is None:
        raise DataError(
            f"{path}: line 1: a text file of SpectraRay begins with '; WAVELENGTH' and the angles"
        )
    incidence = [_number(path, 1, text) for text in header[1].split()]
    blocks = [angle for i, angle in enumerate(incidence) if i == 0 or angle != incidence[i - 1]]
    width = len(incidence) // len(blocks)
    if width not in (_MUELLER, _PSI_DELTA) or incidence != [angle for angle in blocks for _ in range(width)]:
        raise DataError(
            f"{path}: line 1: each angle of incidence has {_MUELLER} columns (a Mueller matrix) or {_PSI_DELTA} "
            f"(psi and delta), here are {len(incidence)} columns at {len(blocks)} angles"
        )
    rows, numbers = [], []
    for number, line in enumerate(lines[1:], 2):
        cells = line.split()
        if not cells:
            continue
        if len(cells) != len(incidence) + 1:
            raise DataError(
                f"{path}: line {number}: {len(cells)} numbers; a line has a wavelength and {len(incidence)} columns"
            )
        rows.append([_number(path, number, cell) for cell in cells])
        numbers.append(number)
    if not rows:
        raise DataError(f"{path}: there are no lines of data under the angles")
    values = np.array(rows)
    content = values[:, 1:].reshape(-1, width)
    if width == _MUELLER:
        matrices = mueller_flip_v(content.reshape(-1, 4, 4))
        matrices[:, 0, 0] = 1.0
    else:
        matrices = _of_psi_delta(*content.T)
    theta = np.tile(np.deg2rad(blocks), len(values))
    ds = assemble(
        {
            "theta_i": theta,
            "theta_r": theta,
            "phi": np.zeros_like(theta),
            "wavelength": np.repeat(values[:, 0], len(blocks)),
            "group": None,
        },
        {"mueller_over_m00": matrices},
        {},
        {
            "quantity": "normalised",
            "illumination": list(NATURAL_LIGHT),
            "simulated": 0,
            "source": path.name,
        },
    )
    validate(ds, origin=str(path), lines=np.repeat(numbers, len(blocks)).tolist())
    return ds


def _of_psi_delta(psi: NDArray[np.float64], delta: NDArray[np.float64]) -> NDArray[np.float64]:
    """Normalised matrices of ψ and Δ in degrees, shape (N, 4, 4)."""
    double, phase = 2.0 * np.deg2rad(psi), np.deg2rad(delta)
    matrices = np.full((len(psi), 4, 4), np.nan)
    matrices[:, 0, 0] = 1.0
    matrices[:, 0, 1] = -np.cos(double)
    matrices[:, 2, 2] = np.sin(double) * np.cos(phase)
    matrices[:, 2, 3] = -np.sin(double) * np.sin(phase)
    return matrices


def _number(path: Path, line: int, text: str) -> float:
    try:
        value = float(text.replace(",", "."))
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise DataError(f"{path}: line {line}: {text!r} is not a number")
    return value


def _has_the_first_line(path: Path) -> bool:
    line = first_bytes(path, 2**14).decode("utf-8-sig", errors="replace").partition("\n")[0]
    return _FIRST_LINE.fullmatch(line.strip()) is not None


READER = Reader("spectraray", read_spectraray, extensions=(".txt", ".dat"), sniff=_has_the_first_line)
