"""Measured scatter files of LightTools (Synopsys).

Text; ``#`` begins a comment. Keys and values: ``Symmetry Asymmetric``, ``SpectralContent`` (``Monochrome`` or
``XYZ``), ``ScatterAzimuth`` and ``ScatterRadial``, each with a count and as many angles in degrees; ``DataBegin``;
then blocks of ``AOI``, ``POI``, ``Side`` (``Front`` or ``Back``), ``Wavelength`` (nm), ``ScatterType`` (``BRDF`` or
``BTDF``), for XYZ ``TristimulusValue`` (``TrisX`` …), and ``TIS``, whose number the BSDF values in 1/sr follow,
azimuth by azimuth; ``DataEnd``.

Described by the reader ``LightToolsBsdfReader.cpp`` of KimuraRyo/libbsdf; no file of the program was at hand. Radial
and azimuth are those of the scattered ray about the **normal**, and "an incoming azimuthal angle of an isotropic
LightTools BSDF is 90 degrees": both directions point away from the surface, so forward is azimuth 270°, which the
reader moves to 0. That is said with the data, and the option `azimuth` turns it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import xarray as xr

from pbrdf.data.formats.declaration import Reader
from pbrdf.data.formats.number_lines import NumberLines
from pbrdf.data.formats.scalar_rows import incidence_groups, scalar_rows
from pbrdf.data.select import match_wavelengths
from pbrdf.errors import DataError
from pbrdf.files.text import first_bytes

__all__ = ["READER", "read_lighttools"]

#: Azimuth of the specular half-plane in the file, degrees, by the option `azimuth`.
_FORWARD = {"forward=180": 270.0, "forward=0": 90.0}
_HEADER = {"symmetry": ("asymmetric",), "spectralcontent": ("monochrome", "xyz")}
_AXES = ("scatterazimuth", "scatterradial")
_BLOCK = {
    "side": ("front", "back"),
    "scattertype": ("brdf", "btdf"),
    "tristimulusvalue": ("trisx", "trisy", "trisz"),
}
_NUMBERS = ("aoi", "poi", "wavelength")
_HEAD = 2**16


@dataclass
class _Block:
    words: dict[str, str] = field(default_factory=dict)
    numbers: dict[str, float] = field(default_factory=dict)
    values: list[float] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)


def read_lighttools(
    path: str | Path, *, wavelength: float | Sequence[float] | None = None, azimuth: str | None = None
) -> xr.Dataset:
    """Read a scalar BRDF from a measured scatter file of LightTools.

    Parameters
    ----------
    path
        The file.
    wavelength
        Wavelength or wavelengths to take, in nm; all if None.
    azimuth
        ``"forward=180"`` (None) where the specular half-plane is 180° from the incident azimuth of 90°,
        ``"forward=0"`` where it is that azimuth itself.

    Returns
    -------
    xarray.Dataset
        ``I`` as a BRDF in 1/sr under natural light, of the front side; ``group`` is θ_i in whole degrees, or X, Y, Z.
        Cells below the horizon, and those that hold 0, are left out.

    Raises
    ------
    DataError
        Names the file and the line; if there is no reflection from the front.
    """
    path = Path(path)
    if azimuth is not None and azimuth not in _FORWARD:
        raise DataError(f"{path}: azimuth={azimuth!r} is not understood; use {' or '.join(_FORWARD)}")
    lines = NumberLines(path)
    axes = _header(lines)
    blocks = _blocks(lines, len(axes["scatterazimuth"]), len(axes["scatterradial"]))
    wanted = [b for b in blocks if b.words.get("side") != "back" and b.words.get("scattertype") != "btdf"]
    if not wanted:
        raise DataError(f"{path}: there is no reflection (BRDF) from the front side in this file")
    if len({b.numbers.get("poi", 0.0) for b in wanted}) > 1:
        raise DataError(f"{path}: there are several POI: anisotropic files are not understood")
    said = []
    if len(wanted) < len(blocks):
        said.append(f"tables of the back side or of transmission were left out: {len(blocks) - len(wanted)}")
    if azimuth is None:
        said.append(
            "the file does not say where phi = 0 lies; azimuth 270 was taken as the forward half-plane"
        )
    stated = [b.numbers.get("wavelength", np.nan) for b in wanted]
    available = np.unique(stated)
    if wavelength is not None or not np.isnan(available).any():
        chosen = set(available[match_wavelengths(available, wavelength, str(path))])
        wanted = [block for block, nanometres in zip(wanted, stated, strict=True) if nanometres in chosen]
    phi, theta = np.meshgrid(
        np.deg2rad(axes["scatterazimuth"]), np.deg2rad(axes["scatterradial"]), indexing="ij"
    )
    count, forward = phi.size, np.deg2rad(_FORWARD[azimuth or "forward=180"])
    theta_i = np.repeat(np.deg2rad([b.numbers["aoi"] for b in wanted]), count)
    colours = [b.words.get("tristimulusvalue", "").removeprefix("tris").upper() for b in wanted]
    return scalar_rows(
        path,
        {
            "theta_i": theta_i,
            "theta_r": np.tile(theta.ravel(), len(wanted)),
            "phi": np.tile(phi.ravel(), len(wanted)) - forward,
            "wavelength": None
            if np.isnan(available).any()
            else np.repeat([b.numbers["wavelength"] for b in wanted], count),
            "group": np.repeat(colours, count) if any(colours) else incidence_groups(theta_i),
        },
        np.concatenate([b.values for b in wanted]),
        np.concatenate([b.lines for b in wanted]),
        grid=True,
        assumptions=said,
    )


def _header(lines: NumberLines) -> dict[str, list[float]]:
    axes: dict[str, list[float]] = {}
    while True:
        key, *rest = lines.text("a key of the header, or DataBegin").split()
        name = key.lower()
        if name == "databegin":
            break
        if name in _AXES:
            axes[name] = lines.numbers(lines.count_in(" ".join(rest), key), key)
        elif name in _HEADER and " ".join(rest).lower() not in _HEADER[name]:
            raise lines.error(f"{key} is {' '.join(rest)!r}; {' or '.join(_HEADER[name])} is understood")
    for name in _AXES:
        if name not in axes:
            raise lines.error(f"the header does not state {name}")
    return axes


def _blocks(lines: NumberLines, azimuths: int, radials: int) -> list[_Block]:
    blocks, block = [], _Block()
    while (text := lines.peek()) is not None and text.lower() != "dataend":
        lines.text("a block")
        key, *rest = text.split()
        name, value = key.lower(), " ".join(rest)
        if name in _NUMBERS:
            block.numbers[name] = lines.number_in(value, key)
        elif name in _BLOCK:
            block.words[name] = value.lower()
            if value.lower() not in _BLOCK[name]:
                raise lines.error(f"{key} is {value!r}, not one of {', '.join(_BLOCK[name])}")
        elif name == "tis":
            if not 0.0 <= block.numbers.get("aoi", np.nan) < 90.0 and block.words.get("side") != "back":
                raise lines.error("the table has no AOI in [0°, 90°)")
            lines.number_in(value, key)
            for _ in range(azimuths):
                block.lines += [lines.line] * radials
                block.values += lines.numbers(radials, "a row of BSDF values")
            blocks.append(block)
            block = _Block()
        else:
            raise lines.error(
                f"{key!r} is not a key of a table; there may be more rows than the header announces"
            )
    if not blocks or lines.peek() is None:
        raise lines.error("there is no table, or DataEnd is missing: is the file truncated?", lines.line)
    return blocks


def _looks_like_lighttools(path: Path) -> bool:
    head = first_bytes(path, _HEAD).lower()
    return all(
        re.search(word, head, re.MULTILINE) for word in (rb"^scatterradial\s", rb"^symmetry\s", rb"^aoi\s")
    )


READER = Reader(
    "lighttools", read_lighttools, extensions=(".bsdf", ".txt", ".dat"), sniff=_looks_like_lighttools
)
