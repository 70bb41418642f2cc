"""Mueller matrices of ellipsometers as J. A. Woollam's programs (WVASE, CompleteEASE) write them, ``.dat``.

Text: the sample's name; ``VASEmethod[key=value, ...]``; ``Original[...]``; the unit of wavelengths, ``nm``, ``um`` or
``eV``; then rows of a tag, the wavelength, the angle of incidence in degrees, and numbers. ``E`` rows hold Ψ and Δ,
``dPolE`` the depolarisation, ``mm11`` the reflectance, and ``mm12`` … ``mm44`` the elements divided by ``mm11``: the
value, twice in some versions, and its standard error as often. ``TransmissionMeas=1`` marks transmission. As a reader
of such exports describes it (Yb:YAG on an RC2; ``read_dat``); Physics::Ellipsometry::VASE and the NOMAD readers have
the same header.

The light is the specular beam: θ_r = θ_i, φ = 0. The reflectance of the beam is no BRDF, so only the ratios are read.
Isotropic samples have the matrix (1, −N, 0, 0; −N, 1, 0, 0; 0, 0, C, S; 0, 0, −S, C), N = cos 2Ψ, C = sin 2Ψ cos Δ,
S = sin 2Ψ sin Δ, and tan Ψ e^{iΔ} = r_p/r_s for e^{+iωt} and n − iκ, r_p/r_s = −1 at the normal. So Q = I_p − I_s as
here; M[2, 3] of the project is −S, so V changes sign. Where there are ``E`` rows, the signs are compared with them.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from pbrdf.data.build import assemble
from pbrdf.data.conventions import mueller_flip_v
from pbrdf.data.formats.declaration import Reader
from pbrdf.data.formats.number_lines import NumberLines, parsed_number
from pbrdf.data.formats.scalar_rows import incidence_groups
from pbrdf.data.schema import NATURAL_LIGHT
from pbrdf.data.select import match_wavelengths
from pbrdf.data.validation import validate
from pbrdf.errors import DataError
from pbrdf.files.text import first_bytes

__all__ = ["READER", "read_woollam"]

#: Nanometres in the units of wavelengths; of photon energies hc is divided by them.
_UNITS = {"nm": 1.0, "um": 1e3, "µm": 1e3, "micron": 1e3, "microns": 1e3, "angstroms": 0.1, "å": 0.1}
_HC = 1239.841984
_ELEMENT = re.compile(r"mm([1-4])([1-4])", re.IGNORECASE)
_IGNORED = re.compile(r"E|dPolE|uR|uT|pR|sR|pT|sT|dPolR|dPolT", re.IGNORECASE)


def read_woollam(path: str | Path, *, wavelength: float | Sequence[float] | None = None) -> xr.Dataset:
    """Read normalised Mueller matrices of specular reflection from a Woollam ``.dat`` file.

    Parameters
    ----------
    path
        The file.
    wavelength
        Wavelength or wavelengths to take, in nm; all if None.

    Returns
    -------
    xarray.Dataset
        ``mueller_over_m00`` and its standard uncertainties, NaN where there is no element, at θ_r = θ_i, φ = 0;
        ``group`` is θ_i in whole degrees.

    Raises
    ------
    DataError
        Names the file and the line; if there are no Mueller elements, it is about transmission, or its signs
        contradict its Δ.
    """
    path = Path(path)
    lines = NumberLines(path, comment=None)
    title, unit = _header(lines)
    rows: dict[tuple[float, float], tuple[NDArray[np.float64], int]] = {}
    agreement = 0.0
    angles: dict[tuple[float, float], tuple[float, float]] = {}
    while lines.peek() is not None:
        tag, *cells = lines.text("a row").split()
        found = _ELEMENT.fullmatch(tag)
        if parsed_number(tag) is not None:
            raise lines.error("a row without a tag: this file holds Ψ and Δ only; export the Mueller matrix")
        if found is None and not _IGNORED.fullmatch(tag):
            raise lines.error(f"{tag!r} is not a tag of a Mueller matrix file (mm11 … mm44, E, dPolE)")
        numbers = [lines.number_in(cell, tag) for cell in cells]
        if len(numbers) < 3:
            raise lines.error(f"{tag}: wavelength, angle and a value are needed")
        at = (numbers[0], numbers[1])
        if found is None:
            if tag.lower() == "e" and len(numbers) >= 4:
                angles[at] = (numbers[2], numbers[3])
            continue
        matrix, _ = rows.setdefault(at, (np.full((2, 4, 4), np.nan), lines.read_line))
        i, j = int(found[1]) - 1, int(found[2]) - 1
        values = numbers[2:]
        # one value and its error, or both of them twice
        error = values[2] if len(values) >= 4 else values[1] if len(values) >= 2 else np.nan
        matrix[:, i, j] = values[0], error if error > 0 else np.nan
    if not rows:
        raise DataError(
            f"{path}: there are no Mueller elements (mm12 …) in this file; export the Mueller matrix"
        )
    for at, (psi, delta) in angles.items():
        if at in rows and np.isfinite(rows[at][0][0, 2, 3]):
            agreement += rows[at][0][0, 2, 3] * np.sin(2 * np.deg2rad(psi)) * np.sin(np.deg2rad(delta))
    if agreement < 0:
        raise DataError(
            f"{path}: mm34 has the sign of −sin 2Ψ sin Δ: its handedness is another than Woollam's"
        )
    energies, incidence = np.array(list(rows)).T
    if (energies <= 0).any():
        raise DataError(f"{path}: a wavelength or energy is not positive")
    nanometres = np.round(_HC / energies if unit == "ev" else energies * _UNITS[unit], 6)
    available = np.unique(nanometres)
    keep = np.isin(nanometres, available[match_wavelengths(available, wavelength, str(path))])
    values, errors = np.stack([matrix for matrix, _ in rows.values()], axis=1)[:, keep]
    values[:, 0, 0], errors[:, 0, 0] = 1.0, np.nan
    theta = np.deg2rad(incidence[keep])
    ds = assemble(
        {
            "theta_i": theta,
            "theta_r": theta,
            "phi": np.zeros_like(theta),
            "wavelength": nanometres[keep],
            "group": incidence_groups(theta),
        },
        {"mueller_over_m00": mueller_flip_v(values)},
        {"mueller_over_m00": errors} if np.isfinite(errors).any() else {},
        {
            "quantity": "normalised",
            "illumination": list(NATURAL_LIGHT),
            "simulated": 0,
            "source": path.name,
            **({"title": title} if title else {}),
        },
    )
    numbers_of_lines = np.array([line for _, line in rows.values()])[keep].tolist()
    validate(ds, origin=str(path), lines=numbers_of_lines)
    return ds


def _header(lines: NumberLines) -> tuple[str, str]:
    """The sample's name and the unit of wavelengths, in lower case."""
    title, method = "", None
    while True:
        text = lines.text("a line with the unit of wavelengths (nm)")
        if text.lower() in (*_UNITS, "ev"):
            if method is None:
                raise lines.error("there is no line 'VASEmethod[...]' before the unit of wavelengths")
            return title, text.lower()
        if text.startswith("VASEmethod["):
            method = text
            if re.search(r"TransmissionMeas\s*=\s*1", text):
                raise lines.error("this is transmission (TransmissionMeas=1); only reflection is understood")
        elif not text.startswith("Original[") and not title and method is None:
            title = text
        elif _ELEMENT.match(text):
            raise lines.error("the unit of wavelengths (nm, um or eV) is missing before the rows")


def _has_mueller_elements(path: Path) -> bool:
    head = first_bytes(path, 2**14)
    return b"VASEmethod[" in head


READER = Reader("woollam", read_woollam, extensions=(".dat", ".txt"), sniff=_has_mueller_elements)
