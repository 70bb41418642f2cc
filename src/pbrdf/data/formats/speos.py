"""Text files of scatter functions for Ansys Speos: ``.anisotropicbsdf`` and ``.brdf``.

Sources: "Structure of Anisotropic BSDF Files", "Structure of BRDF files" and "Anisotropic BSDF Surface Overview" of
the Speos user guide, and the files that ansys/optical-automation writes. One statement a line:

=====================  ======================================================================================
both                   ``OPTIS - … surface file vN``; 0 for text, 1 for binary; comment; number of characters of
                       the description, and the description
``.anisotropicbsdf``   vector of anisotropy; ``1 0`` for reflection and transmission; 1 if the values are
                       proportional to the BSDF, 0 to the intensity; for reflection, then transmission: how many
                       anisotropy angles, these, and for each how many angles of incidence and these; then again
                       for both: angle of incidence and of anisotropy of the spectrum, its title, its count and lines
                       of wavelength (nm) and percentage; then the tables
``.brdf``              ``1 0``; 1 or 0; how many angles of incidence and wavelengths; these; the tables, each after a
                       line with its percentage, wavelength by wavelength of each incidence
table                  how many θ and φ; the φ; lines of θ and the values along φ
=====================  ======================================================================================

Angles are in degrees. θ and φ are those of the scattered ray about the **normal**, and "theoretical specular direction
is always (θ_i, 0)": φ = 0 is our forward. The values are only proportional to the BSDF. Speos multiplies them so that
the table's ∫ f cosθ dω is the percentage: for an anisotropic file one factor, that of the table whose angles the
spectrum was measured at (between two angles of incidence, of the two next to it by their distance), for a ``.brdf``
file one a table. So does this reader, by trapezoids between the nodes.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from pbrdf.data.formats.declaration import Reader
from pbrdf.data.formats.number_lines import NumberLines, begins_with, parsed_number
from pbrdf.data.formats.scalar_rows import incidence_groups, scalar_rows
from pbrdf.data.formats.thinning import thinning, thinning_in_words
from pbrdf.data.select import match_wavelengths

__all__ = ["READER", "read_speos"]

_FIRST = re.compile(
    r"OPTIS\s*-\s*(?P<kind>anisotropic bsdf|brdf) surface file v(?P<version>[0-9]{1,9})", re.IGNORECASE
)
#: Earlier versions stand for another order of the lines.
_OLDEST = 7
_Array = NDArray[np.float64]


@dataclass(frozen=True)
class _Table:
    """A table, with what it was measured at.

    Attributes
    ----------
    theta_i, anisotropy
        Degrees.
    theta, phi
        Nodes of the scattered ray, radians; shapes (T,) and (P,).
    values
        Proportional to the BSDF, shape (T, P).
    lines
        Of the file, shape (T,).
    """

    theta_i: float
    anisotropy: float
    theta: _Array
    phi: _Array
    values: _Array
    lines: NDArray[np.int64]

    def integral(self) -> float:
        """∫ f cosθ dω over the hemisphere."""
        weight = np.sin(self.theta) * np.cos(self.theta)
        over_theta = _trapezoids(self.values * weight[:, np.newaxis], self.theta)
        if len(self.phi) > 1 and abs(self.phi[-1] - self.phi[0] - np.pi) < 1e-6:
            # half of a function that is symmetric about the plane of incidence
            return float(2.0 * _trapezoids(over_theta, self.phi))
        over_theta = np.append(over_theta, over_theta[0])
        return float(_trapezoids(over_theta, np.append(self.phi, self.phi[0] + 2.0 * np.pi)))


def _trapezoids(values: _Array, at: _Array) -> _Array:
    """Integral over the first axis, by trapezoids between the nodes; to load SciPy for it takes longer than to read."""
    return 0.5 * np.diff(at) @ (values[1:] + values[:-1])


#: Tables with their spectra: wavelengths in nm (NaN: any) and what the values are multiplied with.
_Spectrum = list[tuple[float, float]]


def read_speos(
    path: str | Path, *, wavelength: float | Sequence[float] | None = None, every: int | None = None
) -> xr.Dataset:
    """Read a scalar BRDF from a text file for Speos.

    Parameters
    ----------
    path
        The file.
    wavelength
        Wavelength or wavelengths to take, in nm; all if None. Those of an anisotropic file differ only by a factor;
        where that is the same for all and none is asked for, the coordinate is left out.
    every
        Take one node in this many along θ and φ; all if None.

    Returns
    -------
    xarray.Dataset
        ``I`` as a BRDF in 1/sr under natural light; ``group`` is θ_i in whole degrees, or the angle of anisotropy where
        there are several. Cells that hold 0 are left out.

    Raises
    ------
    DataError
        Names the file and the line; if the file is binary, of an older version, or about transmission alone.
    """
    path = Path(path)
    lines = NumberLines(path, comment=None, keep_empty=True)
    first = _FIRST.match(lines.text("the name of the format"))
    if first is None:
        raise lines.error("the file does not begin with 'OPTIS - ... surface file vN'")
    if int(first["version"]) < _OLDEST:
        raise lines.error(
            f"version {first['version']} is a goniometer's export or an old file; open and save it with Speos' BSDF "
            f"viewer, which writes version {_OLDEST} or later"
        )
    if lines.text("0 for text or 1 for binary") != "0":
        raise lines.error("the file is in binary mode; save it as text with Speos' BSDF viewer")
    title = lines.text("the comment")
    _skip_description(lines)
    anisotropic = first["kind"].lower().startswith("anisotropic")
    tables = _anisotropic(lines, wavelength is None) if anisotropic else _iridescent(lines)
    available = np.unique([nanometres for _, spectrum in tables for nanometres, _ in spectrum])
    chosen = set(available[match_wavelengths(available, wavelength, str(path))])
    several = len({table.anisotropy for table, _ in tables}) > 1
    step = 1 if every is None else thinning((1,), every, str(path))
    parts: dict[str, list[NDArray[Any]]] = {
        name: [] for name in ("theta_i", "theta_r", "phi", "wavelength", "group", "values", "lines")
    }
    for table, spectrum in tables:
        # the rows on the horizon, at 90°, are only where the program's interpolation ends
        rows = np.flatnonzero(table.theta < np.pi / 2 - 1e-6)[::step]
        theta, phi = np.meshgrid(table.theta[rows], table.phi[::step], indexing="ij")
        theta_i = np.full(theta.size, np.deg2rad(table.theta_i))
        for nanometres, factor in spectrum:
            if np.isnan(nanometres) or nanometres in chosen:
                parts["theta_i"].append(theta_i)
                parts["theta_r"].append(theta.ravel())
                parts["phi"].append(phi.ravel())
                parts["wavelength"].append(np.full(theta.size, nanometres))
                label = f"{table.anisotropy:g}" if several else incidence_groups(theta_i)
                parts["group"].append(np.broadcast_to(label, theta.size))
                parts["values"].append(factor * table.values[rows, ::step].ravel())
                parts["lines"].append(np.repeat(table.lines[rows], theta.shape[1]))
    columns = {name: np.concatenate(arrays) for name, arrays in parts.items()}
    values, where = columns.pop("values"), columns.pop("lines")
    return scalar_rows(
        path,
        {**columns, "wavelength": None if np.isnan(available).any() else columns["wavelength"]},
        values,
        where,
        grid=True,
        attrs={"title": title, "source": path.name + thinning_in_words(step)},
    )


def _skip_description(lines: NumberLines) -> None:
    text = lines.text("how many characters the description has")
    left = parsed_number(text)
    if left is None or not 0 <= left < 10**7:
        raise lines.error(f"how many characters the description has is expected, not {text!r}")
    left -= len(lines.text("the description"))
    while left > 1:
        left -= len(lines.text("the description")) + 1


def _sides(lines: NumberLines) -> bool:
    """Whether there is transmission beside the reflection."""
    flags = lines.numbers(2, "1 or 0 for reflection and for transmission")
    if flags[0] != 1:
        raise lines.error("there is no reflection in this file, only transmission")
    return flags[1] == 1


def _proportional_to_bsdf(lines: NumberLines) -> bool:
    kind = lines.text("1 for values of the BSDF or 0 for intensities")
    if kind not in ("0", "1"):
        raise lines.error(f"1 for values of the BSDF or 0 for intensities is expected, not {kind!r}")
    return kind == "1"


def _incidences(lines: NumberLines, count: int) -> list[float]:
    angles = lines.numbers(count, "angles of incidence")
    if not all(0.0 <= angle < 90.0 for angle in angles):
        raise lines.error("an angle of incidence is outside [0°, 90°)")
    return angles


def _anisotropic(lines: NumberLines, achromatic: bool) -> list[tuple[_Table, _Spectrum]]:
    """Tables of an anisotropic file; a spectrum that is the same everywhere is (NaN, factor) if `achromatic`."""
    lines.numbers(3, "the vector of anisotropy")
    transmission = _sides(lines)
    bsdf = _proportional_to_bsdf(lines)
    measured: list[tuple[float, float]] = []
    for side in (True, False)[: 1 + transmission]:
        turns = lines.numbers(lines.count_in(lines.text("how many angles"), "angles of anisotropy"), "these")
        for turn in turns:
            count = lines.count_in(lines.text("how many angles of incidence"), "angles of incidence")
            incidences = _incidences(lines, count)
            measured += [(turn, angle) for angle in incidences if side]
    spectra = []
    for _ in range(1 + transmission):
        reference = lines.numbers(2, "angles of incidence and anisotropy of the spectrum")
        lines.text("the title of the spectrum")
        count = lines.count_in(lines.text("how many wavelengths"), "wavelengths")
        spectra.append(
            (reference, [lines.numbers(2, "a wavelength and its percentage") for _ in range(count)])
        )
    tables = [_table(lines, angle, turn, bsdf) for turn, angle in measured]
    (incidence, turn), spectrum = spectra[0]
    alike = [t for t in tables if t.anisotropy == turn] or [
        t for t in tables if t.anisotropy == tables[0].anisotropy
    ]
    alike.sort(key=lambda table: table.theta_i)
    reciprocal = [1.0 / _positive(lines, table.integral()) for table in alike]
    scale = float(np.interp(incidence, [table.theta_i for table in alike], reciprocal))
    factors = [(nanometres, percent / 100.0 * scale) for nanometres, percent in spectrum]
    if achromatic and len({factor for _, factor in factors}) == 1:
        factors = [(np.nan, factors[0][1])]
    return [(table, factors) for table in tables]


def _iridescent(lines: NumberLines) -> list[tuple[_Table, _Spectrum]]:
    """Tables of a ``.brdf`` file, each of one wavelength."""
    _sides(lines)
    bsdf = _proportional_to_bsdf(lines)
    counts = lines.text("how many angles of incidence and wavelengths").split()
    if len(counts) != 2:
        raise lines.error("how many angles of incidence and wavelengths is expected, two counts")
    angles, colors = (
        lines.count_in(text, what)
        for text, what in zip(counts, ("angles of incidence", "wavelengths"), strict=True)
    )
    incidences = _incidences(lines, angles)
    wavelengths = lines.numbers(colors, "wavelengths")
    tables: list[tuple[_Table, _Spectrum]] = []
    for angle in incidences:
        for nanometres in wavelengths:
            (percent,) = lines.numbers(1, "the percentage of a table")
            table = _table(lines, angle, 0.0, bsdf)
            tables.append((table, [(nanometres, percent / 100.0 / _positive(lines, table.integral()))]))
    return tables


def _table(lines: NumberLines, theta_i: float, anisotropy: float, bsdf: bool) -> _Table:
    counts = lines.text("how many theta and phi").split()
    if len(counts) != 2:
        raise lines.error("how many theta and phi is expected, two counts")
    rows, columns = (lines.count_in(text, "how many theta and phi") for text in counts)
    phi = np.deg2rad(lines.numbers(columns, "phi"))
    where, numbers = [], []
    for _ in range(rows):
        where.append(lines.line)
        numbers.append(lines.numbers(1 + columns, "theta and a value for each phi"))
    array = np.array(numbers)
    theta, values = np.deg2rad(array[:, 0]), array[:, 1:]
    if not (np.diff(theta) > 0).all() or not (np.diff(phi) > 0).all() or not 0 <= theta[0] <= theta[-1] < 3.2:
        raise lines.error("theta or phi do not ascend, or theta is outside [0°, 180°]", where[0])
    if not bsdf:
        cosine = np.cos(theta)[:, np.newaxis]
        values = np.divide(values, cosine, out=np.zeros_like(values), where=cosine > 1e-6)
    return _Table(theta_i, anisotropy, theta, phi, values, np.array(where))


def _positive(lines: NumberLines, integral: float) -> float:
    if not integral > 0:
        raise lines.error("the integral of the table is not positive: its scale cannot be found")
    return integral


def _begins_as_speos(path: Path) -> bool:
    return begins_with(path, _FIRST.pattern)


READER = Reader(
    "speos", read_speos, extensions=(".anisotropicbsdf", ".brdf", ".rtd", ".txt"), sniff=_begins_as_speos
)
