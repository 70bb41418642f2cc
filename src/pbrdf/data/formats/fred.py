"""Tabulated BSDF files of FRED (Photon Engineering).

Text: a line ``type bsdf_data``, a line ``format angles=deg bsdf=value scale=1``; then for each incident direction a
line of two numbers, its polar angle and azimuth in degrees, and under it lines of three: polar angle and azimuth of the
scattered ray, and the BSDF in 1/sr.

There is no public description. The format is as ua-loft/bsdf-tools write it (``write_fred.m``, ``save_as_fred`` and the
files in ``data/processed/fred``) and as FRED's own example script for VIAVI's diffusers does. The scattered azimuth is
counted from the direction in which the incident light **travels**: equal azimuths are the specular half-plane, our
φ = 0. In scans in the plane of incidence the polar angle is signed instead, the specular side positive: the files of
one black paint for FRED and for Zemax have their peaks on that side, and the azimuths of the tables with
``specAzi0d`` in their names say the same. Comments (``#``, ``//``, ``!``), blanks around ``=`` and commas between the
numbers, as files edited by hand have them, do not matter.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import xarray as xr

from pbrdf.data.formats.declaration import Reader
from pbrdf.data.formats.number_lines import NumberLines, begins_with
from pbrdf.data.formats.scalar_rows import incidence_groups, scalar_rows

__all__ = ["READER", "read_fred"]

_COMMENTS = ("#", "//", "!")
_ANGLES = {"deg": np.pi / 180.0, "degrees": np.pi / 180.0, "rad": 1.0, "radians": 1.0}


def read_fred(path: str | Path) -> xr.Dataset:
    """Read a scalar BRDF from a tabulated scatter file of FRED.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    xarray.Dataset
        ``I`` as a BRDF in 1/sr under natural light, in the order of the file; ``group`` is θ_i in whole degrees.
        The format states no wavelength.

    Raises
    ------
    DataError
        Names the file and the line.
    """
    path = Path(path)
    lines = NumberLines(path, comment=_COMMENTS)
    if lines.text("'type bsdf_data'").lower().split() != ["type", "bsdf_data"]:
        raise lines.error("the file does not begin with 'type bsdf_data'")
    unit, scale = _format(lines)
    rows: list[tuple[float, float, float, float, float]] = []
    where: list[int] = []
    incident: list[float] | None = None
    while lines.peek() is not None:
        numbers = [lines.number_in(cell, "an angle or a value") for cell in _cells(lines.text("a row"))]
        line = lines.read_line
        if len(numbers) == 2:
            incident = numbers
        elif len(numbers) != 3:
            raise lines.error(
                f"there are {len(numbers)} numbers; two (an incident direction) or three (polar angle, azimuth, "
                "BSDF) are needed"
            )
        elif incident is None:
            raise lines.error("a row of three stands before the incident direction it belongs to")
        else:
            rows.append((incident[0], incident[1], numbers[0], numbers[1], numbers[2]))
            where.append(line)
    if not rows:
        raise lines.error("there are no rows of polar angle, azimuth and BSDF: is the file truncated?")
    theta_i, phi_i, theta_s, phi_s, values = np.array(rows).T
    # a negative polar angle is the same direction half a turn further
    turn = (phi_s - phi_i) * unit + np.pi * (theta_s < 0) + np.pi * (theta_i < 0)
    return scalar_rows(
        path,
        {
            "theta_i": np.abs(theta_i) * unit,
            "theta_r": np.abs(theta_s) * unit,
            "phi": turn,
            "group": incidence_groups(np.abs(theta_i) * unit),
        },
        values * scale,
        where,
        attrs={"title": "; ".join(filter(None, lines.comments))},
    )


def _cells(line: str) -> list[str]:
    """Numbers between blanks, commas, or both."""
    return re.split(r"\s*,\s*|\s+", line)


def _format(lines: NumberLines) -> tuple[float, float]:
    """Radians in a unit of the angles, and the factor of the values."""
    line = lines.text("a line 'format angles=deg bsdf=value scale=1'")
    words = re.sub(r"\s*=\s*", "=", line).split()
    if words[0].lower() != "format":
        raise lines.error("a line 'format angles=deg bsdf=value scale=1' was expected")
    stated = {}
    for word in words[1:]:
        key, _, value = word.lower().partition("=")
        if key not in ("angles", "bsdf", "scale") or not value:
            raise lines.error(f"{word!r} is not understood; angles=deg, bsdf=value and scale=1 are")
        stated[key] = value
    if stated.get("angles", "deg") not in _ANGLES:
        raise lines.error(f"angles={stated['angles']} is not understood; angles=deg and angles=rad are")
    if stated.get("bsdf", "value") != "value":
        raise lines.error(f"bsdf={stated['bsdf']} is not understood; bsdf=value is")
    scale = lines.number_in(stated.get("scale", "1"), "scale")
    if not scale > 0:
        raise lines.error(f"scale={scale:g} is not a positive factor")
    return _ANGLES[stated.get("angles", "deg")], scale


def _begins_as_fred(path: Path) -> bool:
    return begins_with(path, r"type\s+bsdf_data\b", comment=_COMMENTS)


READER = Reader("fred", read_fred, extensions=(".txt", ".dat", ".bsdf", ".csv"), sniff=_begins_as_fred)
