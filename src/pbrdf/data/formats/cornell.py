"""BRDF files of the Cornell University Program of Computer Graphics.

Lines that begin with ``#`` are comments. The numbers follow one another, however the lines break: how many
wavelengths there are, the wavelengths in nm, and then for each pair of directions ``theta_i phi_i theta_s
phi_s`` in **radians** and one BRDF value in 1/sr per wavelength. Directions point away from the surface, so
forward is ``phi_s`` − ``phi_i`` = π; the reader moves it to 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from pbrdf.data.build import assemble
from pbrdf.data.conventions import azimuth_forward_pi_to_zero
from pbrdf.data.formats.declaration import Reader
from pbrdf.data.select import match_wavelengths
from pbrdf.data.validation import validate
from pbrdf.errors import DataError
from pbrdf.files.plain_numbers import number_from_text
from pbrdf.files.text import read_lines

__all__ = ["READER", "read_cornell"]

#: What the format's files write above the number of wavelengths.
_HEADING = "num wls"


def read_cornell(path: str | Path, *, wavelength: float | Sequence[float] | None = None) -> xr.Dataset:
    """Read a scalar BRDF from a Cornell ``.brdf`` file.

    Parameters
    ----------
    path
        The file.
    wavelength
        Wavelength or wavelengths to take, in nm; all if None.

    Returns
    -------
    xarray.Dataset
        ``I`` as a BRDF in 1/sr under natural light, ordered by direction, then by wavelength; ``group`` is
        θ_i in whole degrees; ``title`` is the comment at the top of the file.

    Raises
    ------
    DataError
        Names the file and the line.
    """
    path = Path(path)
    text = read_lines(path)
    numbers: list[float] = []
    lines: list[int] = []
    for line, content in enumerate(text, start=1):
        for cell in content.partition("#")[0].split():
            try:
                numbers.append(number_from_text(cell))
            except ValueError:
                raise DataError(f"{path}: line {line}: {cell!r} is not a number") from None
            lines.append(line)

    count = int(numbers[0]) if numbers and numbers[0].is_integer() else 0
    width = 4 + count
    body = len(numbers) - 1 - count
    if count < 1 or body <= 0:
        raise DataError(
            f"{path}: the number of wavelengths, the wavelengths and rows of values were expected"
        )
    if body % width:
        start = lines[len(numbers) - body % width]
        raise DataError(
            f"{path}: line {start}: the last row has {body % width} numbers; four angles and {count} values "
            "are needed"
        )
    available = np.array(numbers[1 : 1 + count])
    rows = np.array(numbers[1 + count :]).reshape(-1, width)
    chosen = match_wavelengths(available, wavelength, str(path))

    theta_i, phi_i, theta_s, phi_s = np.repeat(rows[:, :4], len(chosen), axis=0).T
    ds = assemble(
        {
            "theta_i": theta_i,
            "theta_r": theta_s,
            "phi": azimuth_forward_pi_to_zero(phi_s - phi_i),
            "wavelength": np.tile(available[chosen], len(rows)),
            "group": np.round(np.rad2deg(theta_i)).astype(np.int64),
        },
        {"I": rows[:, 4:][:, chosen].ravel()},
        {},
        {
            "quantity": "brdf",
            "illumination": [1.0, 0.0, 0.0, 0.0],
            "simulated": 0,
            "title": _title(text),
            "source": path.name,
        },
    )
    validate(ds, origin=str(path), lines=np.repeat(lines[1 + count :: width], len(chosen)).tolist())
    return ds


def _title(text: list[str]) -> str:
    """The block of comments at the top, as one line, without the format's own heading."""
    sentences = []
    for content in text:
        if not content.startswith("#"):
            break
        sentences.append(content.lstrip("# ").rstrip())
    return "; ".join(sentence for sentence in sentences if sentence not in ("", _HEADING))


READER = Reader("cornell", read_cornell, extensions=(".brdf",))
