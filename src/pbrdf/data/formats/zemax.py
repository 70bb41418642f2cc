"""Tabular BSDF files of Zemax OpticStudio, first written by Radiant Imaging's scatterometers.

Text; ``#`` begins a comment. A header of key and value, one a line: ``Source``, ``Symmetry`` (``PlaneSymmetrical``,
``Asymmetrical``, ``Asymmetrical4D``), ``SpectralContent`` (``Monochrome`` or ``XYZ``), ``ScatterType`` (``BRDF`` or
``BTDF``), then ``SampleRotation``, ``AngleOfIncidence``, ``ScatterAzimuth`` and ``ScatterRadial``, each with a count
and, on the next line, as many angles in degrees. Then the blocks ``Monochrome`` or ``TristimulusX`` … ``Z``, between
``DataBegin`` and ``DataEnd``: for each rotation and angle of incidence a line ``TIS number``, and for each azimuth a
line of BSDF values in 1/sr, one for each radial angle.

Source: "Zemax Tabular BSDF data file format" (R. Rykowski, Zemax knowledge base 50076). The **radial angle** is that
between the scattered ray and the **specular** one, and the **azimuth** turns about the specular ray: 0 points from it
towards the normal, and grows anticlockwise as seen against the rays. So radial 0 is θ_r = θ_i at φ = 0, azimuth 0
leads towards the normal (and past it to the side of the source), azimuth 180 away from it to the horizon. The angles
are those on the sphere, not differences of direction cosines.

The format knows no wavelength; where the comments name one, as converters (``Wavelength (nm) = 550``) and laboratories
(``red laser (650 nm, 3.5mm spot)``) do, it is that.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from pbrdf.data.formats.declaration import Reader
from pbrdf.data.formats.number_lines import NumberLines, begins_with
from pbrdf.data.formats.scalar_rows import incidence_groups, scalar_rows
from pbrdf.data.formats.thinning import thinning, thinning_in_words
from pbrdf.errors import DataError
from pbrdf.files.text import first_bytes

__all__ = ["READER", "from_specular_frame", "read_zemax"]

_WORDS = {
    "symmetry": ("planesymmetrical", "asymmetrical", "asymmetrical4d"),
    "spectralcontent": ("monochrome", "xyz"),
    "scattertype": ("brdf", "btdf"),
}
_AXES = ("samplerotation", "angleofincidence", "scatterazimuth", "scatterradial")
_BLOCKS = {"monochrome": "", "tristimulusx": "X", "tristimulusy": "Y", "tristimulusz": "Z"}
_NANOMETRES = re.compile(r"(?<![\w.])(\d+\.?\d*)\s*(nm|[uµ]m)\b", re.IGNORECASE)
_STATED = re.compile(r"wavelength\W*\(?(nm|[uµ]m)\)?\W*?(\d+\.?\d*)", re.IGNORECASE)
_LIGHT = re.compile(r"wavelength|lambda|λ|laser|light|lamp|\bled\b", re.IGNORECASE)
#: Comments become a title up to so many characters.
_LONGEST_TITLE = 200


@dataclass(frozen=True)
class _Header:
    words: dict[str, str]
    axes: dict[str, NDArray[np.float64]]


def from_specular_frame(
    theta_i: ArrayLike, azimuth: ArrayLike, radial: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Zenith angle and azimuth of the directions around the specular one.

    Parameters
    ----------
    theta_i
        Angle of incidence, which is that of the specular direction, too.
    azimuth
        About the specular direction, 0 towards the normal.
    radial
        From the specular direction. All in radians; they broadcast.

    Returns
    -------
    theta_r, phi
        θ_r in [0, π], above π/2 below the surface; φ = 0 forward.
    """
    theta_i, azimuth, radial = np.broadcast_arrays(
        *(np.asarray(a, dtype=np.float64) for a in (theta_i, azimuth, radial))
    )
    towards_normal = np.sin(radial) * np.cos(azimuth)
    along = np.cos(radial)
    x = np.sin(theta_i) * along - np.cos(theta_i) * towards_normal
    y = -np.sin(radial) * np.sin(azimuth)
    z = np.cos(theta_i) * along + np.sin(theta_i) * towards_normal
    return np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)


def read_zemax(path: str | Path, *, every: int | None = None) -> xr.Dataset:
    """Read a scalar BRDF from a tabular ``.bsdf`` file.

    Parameters
    ----------
    path
        The file.
    every
        Take one node in this many along the angle of incidence, the azimuth and the radial angle; all if None.

    Returns
    -------
    xarray.Dataset
        ``I`` as a BRDF in 1/sr under natural light. ``group`` is θ_i in whole degrees; the sample's rotation in
        degrees where there are several; ``"X"``, ``"Y"``, ``"Z"`` of tristimulus files. Cells below the horizon, and
        those that hold 0, are left out.

    Raises
    ------
    DataError
        Names the file and the line; if the file is about transmission.
    """
    path = Path(path)
    lines = NumberLines(path)
    header = _header(lines)
    if header.words["scattertype"] == "btdf":
        raise DataError(
            f"{path}: ScatterType BTDF: this is transmission; only reflection (BRDF) is understood"
        )
    rotation, incidence, azimuth, radial = (header.axes[name] for name in _AXES)
    blocks: dict[str, tuple[NDArray[np.float64], NDArray[np.int64]]] = {}
    while (text := lines.peek()) is not None:
        label = lines.text("Monochrome or TristimulusX, Y, Z").lower()
        if label not in _BLOCKS or _BLOCKS[label] in blocks:
            raise lines.error(f"{text!r}: a block Monochrome or TristimulusX, Y, Z was expected")
        blocks[_BLOCKS[label]] = _block(lines, len(rotation) * len(incidence), len(azimuth), len(radial))
    if not blocks:
        raise lines.error("the file ends before its data: is it truncated?", lines.line)
    wanted = 1 if header.words["spectralcontent"] == "monochrome" else 3
    if len(blocks) != wanted:
        raise lines.error(
            f"SpectralContent is {header.words['spectralcontent']}, but there are {len(blocks)} blocks of data: "
            "is the file truncated?",
            lines.line,
        )
    shape = (len(rotation), len(incidence), len(azimuth), len(radial))
    step = 1 if every is None else thinning(shape[1:], every, str(path))
    parts = []
    for label, (values, rows) in blocks.items():
        turned, theta_i, alpha, rho = np.meshgrid(rotation, incidence, azimuth, radial, indexing="ij")
        where = np.broadcast_to(rows.reshape(*shape[:3], 1), shape)
        thinned = (slice(None), *(slice(None, None, step),) * 3)
        columns = (turned, theta_i, alpha, rho, values.reshape(shape), where)
        parts.append((label, [a[thinned].ravel() for a in columns]))
    turned, theta_i, alpha, rho, values, where = (
        np.concatenate([columns[k] for _, columns in parts]) for k in range(6)
    )
    theta_r, phi = from_specular_frame(np.deg2rad(theta_i), np.deg2rad(alpha), np.deg2rad(rho))
    if header.words["symmetry"] == "planesymmetrical":
        # the other half of the azimuths is the mirror image: which side is φ > 0 does not matter
        phi = np.abs(phi)
    nanometres = _wavelength(lines.comments)
    group: NDArray[np.int64] | NDArray[np.str_]
    if wanted == 3:
        group = np.repeat([label for label, _ in parts], len(values) // 3)
    elif len(rotation) > 1:
        group = np.array([f"{angle:g}" for angle in turned])
    else:
        group = incidence_groups(np.deg2rad(theta_i))
    return scalar_rows(
        path,
        {
            "theta_i": np.deg2rad(theta_i),
            "theta_r": theta_r,
            "phi": phi,
            "wavelength": None if nanometres is None else np.full(len(values), nanometres),
            "group": group,
        },
        values,
        where,
        grid=True,
        attrs={
            "title": _title(lines.comments),
            "source": path.name + thinning_in_words(step),
        },
    )


def _header(lines: NumberLines) -> _Header:
    words: dict[str, str] = {}
    axes: dict[str, NDArray[np.float64]] = {}
    while (text := lines.peek()) is not None and text.lower() not in _BLOCKS:
        lines.text("the header")
        key, *rest = text.split()
        name = key.lower()
        if name in axes or name in words:
            raise lines.error(f"{key} is stated twice")
        if name in _AXES:
            count = lines.count_in(" ".join(rest), key)
            axes[name] = np.array(lines.numbers(count, key))
            if not np.isfinite(axes[name]).all():
                raise lines.error(f"{key}: an angle is not a number")
        elif name in _WORDS:
            words[name] = " ".join(rest).lower()
            if words[name] not in _WORDS[name]:
                raise lines.error(f"{key} is {' '.join(rest)!r}, not one of {', '.join(_WORDS[name])}")
        elif name != "source":
            raise lines.error(f"{key!r} is not a key of a Zemax BSDF header")
    for name in (*_WORDS, *_AXES):
        if name not in words and name not in axes:
            raise lines.error(f"the header does not state {name}: is the file truncated?", lines.line)
    theta_i = axes["angleofincidence"]
    if (theta_i < 0).any() or (theta_i >= 90).any():
        raise DataError(f"{lines.path}: AngleOfIncidence: {theta_i.max():g}° is outside [0°, 90°)")
    return _Header(words, axes)


def _block(
    lines: NumberLines, tables: int, azimuths: int, radials: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Values of one spectral block, shape (tables, azimuths, radials), and the line of each row."""
    if lines.text("DataBegin").lower() != "databegin":
        raise lines.error("DataBegin was expected")
    values, where = [], []
    for _ in range(tables):
        key, *rest = lines.text("TIS and its value").split()
        if key.lower() != "tis" or len(rest) != 1:
            raise lines.error("TIS and its value was expected: the table before it has too many rows")
        lines.number_in(rest[0], "TIS")
        for _ in range(azimuths):
            where.append(lines.line)
            values.append(lines.numbers(radials, "a row of BSDF values"))
    end = lines.peek()
    if end is not None and end.lower() == "dataend":
        lines.text("DataEnd")
    elif end is not None and end.lower() not in _BLOCKS:
        raise lines.error("there are more rows than the header announces; DataEnd was expected", lines.line)
    return np.array(values), np.array(where)


def _wavelength(comments: list[str]) -> float | None:
    """The one wavelength that the comments name, nm; None if they name none or several."""
    named = set()
    for comment in comments:
        found = [(number, unit) for unit, number in _STATED.findall(comment)]
        if not found and _LIGHT.search(comment):
            found = _NANOMETRES.findall(comment)
        named |= {float(number) * (1.0 if unit.lower() == "nm" else 1000.0) for number, unit in found}
    return named.pop() if len(named) == 1 else None


def _title(comments: list[str]) -> str:
    """The comments in one line, without those that only draw one."""
    sentences = "; ".join(comment for comment in comments if re.search(r"\w", comment))
    return sentences if len(sentences) <= _LONGEST_TITLE else f"{sentences[: _LONGEST_TITLE - 2]} …"


def _begins_as_zemax(path: Path) -> bool:
    first = r"(source|symmetry|spectralcontent|scattertype|samplerotation|angleofincidence)\s+\w+$"
    return begins_with(path, first) and b"angleofincidence" in first_bytes(path, 4096).lower()


READER = Reader("zemax", read_zemax, extensions=(".bsdf", ".txt", ".dat"), sniff=_begins_as_zemax)
