"""The table that says which light an instrument was calibrated with.

A CSV file with one row for each series of frames, for example::

    series,angle_deg,ellipticity_deg,handedness
    linear0,0,,
    linear45,45,,
    left,,45,left
    right,,45,right

Angles are counted in the instrument's axes, from x towards y. ``angle_deg`` is the angle of the polariser, or of the
long axis of the ellipse; ``ellipticity_deg`` its ellipticity, tan of it the ratio of the short axis to the long one: 0
is linear (the default), 45 circular. ``handedness`` is left (V > 0) or right; with it an empty ellipticity is 45;
without it a positive ellipticity is left. ``dop`` is the degree of polarisation (default 1; 0: natural light, which
needs no angle). ``intensity`` is relative to the other rows (default 1; 0: the light shut out), and so is ``exposure``,
the exposure time.

Or the Stokes vectors themselves: ``series,I,Q,U,V`` (without I: 1 everywhere). :mod:`pbrdf.files.delimited` says how
columns may be separated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pbrdf.errors import DataError
from pbrdf.files.delimited import Row, read_table, write_table
from pbrdf.instruments.frames.frames import named
from pbrdf.optics.stokes import STOKES

__all__ = ["InputTable", "ellipse", "read_input_table", "write_input_table"]

_ELLIPSE = ("angle_deg", "ellipticity_deg", "handedness", "dop", "intensity")
#: A Stokes vector may be more than fully polarised by this share: rounding of what someone typed.
_ROUNDING = 1e-3


@dataclass(frozen=True, eq=False)
class InputTable:
    """Known light of K series of frames.

    Attributes
    ----------
    names
        Of the series, no name twice.
    stokes
        In the instrument's axes, shape (4, K), relative to each other; what the detector collects, exposure included.

    Raises
    ------
    DataError
        If the shapes do not fit, a name comes twice, or a Stokes vector is not one of light.
    """

    names: tuple[str, ...]
    stokes: np.ndarray

    def __post_init__(self) -> None:
        S = np.asarray(self.stokes, dtype=float)
        object.__setattr__(self, "names", tuple(map(str, self.names)))
        object.__setattr__(self, "stokes", S)
        if S.shape != (4, len(self.names)):
            raise DataError(
                f"input table: Stokes vectors {S.shape} for {len(self.names)} series: give (4, K)"
            )
        for k, name in enumerate(self.names):
            if name in self.names[:k]:
                raise DataError(f"input table: the series {name!r} stands there twice")
            polarised = float(np.linalg.norm(S[1:, k]))
            if not (np.isfinite(S[:, k]).all() and polarised <= (1.0 + _ROUNDING) * S[0, k]):
                raise DataError(
                    f"input table: series {name!r}: I = {S[0, k]:g} with √(Q² + U² + V²) = {polarised:g} is no light: "
                    "Q, U and V are in the unit of I"
                )
        if not (S[0] > 0.0).any():
            raise DataError("input table: all inputs are dark")

    def rows(self, names: Sequence[str]) -> InputTable:
        """The rows of these series, in this order.

        Raises
        ------
        DataError
            Names the series that only one side has.
        """
        missing = [name for name in names if name not in self.names]
        if missing:
            raise DataError(f"the input table has no row for {named(missing)}; it has {named(self.names)}")
        unseen = [name for name in self.names if name not in names]
        if unseen:
            raise DataError(f"the input table has rows for {named(unseen)}, of which there are no frames")
        return InputTable(tuple(names), self.stokes[:, [self.names.index(name) for name in names]])


def ellipse(angle: float, ellipticity: float = 0.0, dop: float = 1.0) -> np.ndarray:
    """Stokes vector of intensity 1, shape (4,).

    Parameters
    ----------
    angle, ellipticity
        Of the polarisation ellipse, radians; ellipticity in [−π/4, π/4], positive: left, V > 0.
    dop
        Degree of polarisation.
    """
    flat = math.cos(2.0 * ellipticity)
    polarised = (flat * math.cos(2.0 * angle), flat * math.sin(2.0 * angle), math.sin(2.0 * ellipticity))
    return np.array([1.0, *(dop * part for part in polarised)])


def read_input_table(path: str | Path) -> InputTable:
    """Read the CSV table that the module's text describes.

    Raises
    ------
    DataError
        Names the file, and the line and the column where there is one.
    """
    path = Path(path)
    table = read_table(path)
    _require_columns(path, table.names)
    table.require_rows()
    names, vectors = [], []
    for row in table:
        names.append(row.text("series"))
        vector = _stokes(row) if "Q" in table.names else _ellipse(row)
        vectors.append(vector * _number(row, "exposure", 1.0, low=0.0))
    try:
        return InputTable(tuple(names), np.array(vectors).T)
    except DataError as error:
        raise DataError(f"{path}: {error}") from None


def write_input_table(table: InputTable, path: str | Path) -> None:
    """Write the Stokes vectors of a table as :func:`read_input_table` reads them; raises DataError if it cannot."""
    rows = zip(table.names, table.stokes.T.tolist(), strict=True)
    write_table(Path(path), ["series", *STOKES], ([name, *map(repr, S)] for name, S in rows))


def _require_columns(path: Path, header: Sequence[str]) -> None:
    vectors = any(name in STOKES for name in header)
    known = ("series", *(STOKES if vectors else _ELLIPSE), "exposure")
    needed = ("series", *(STOKES[1:] if vectors else ()))
    for name in header:
        if name not in known:
            raise DataError(
                f"{path}: the column {name!r} is not known; use series, {', '.join(_ELLIPSE)}, exposure, or series, "
                "I, Q, U, V, exposure"
            )
        if header.count(name) > 1:
            raise DataError(f"{path}: two columns are called {name}")
    missing = [name for name in needed if name not in header]
    if not vectors and not {"angle_deg", "handedness"} & set(header):
        missing.append("angle_deg")
    if missing:
        raise DataError(f"{path}: there is no column {missing[0]}; the columns are {', '.join(header)}")


def _number(
    row: Row, name: str, default: float | None, low: float = -math.inf, high: float = math.inf
) -> float:
    """The number in a cell; the default, where there is one, if it is empty or there is no such column."""
    if not row.get(name) and default is not None:
        return default
    value = row.number(name)
    if not (math.isfinite(value) and low <= value <= high):
        limits = f"from {low:g} to {high:g}" if math.isfinite(high) else f"of {low:g} or more"
        raise DataError(f"{row.place(name)}: {row.get(name)} is not a number {limits}")
    return value


def _stokes(row: Row) -> np.ndarray:
    first = _number(row, "I", 1.0)
    return np.array([first, *(_number(row, name, None) for name in STOKES[1:])])


def _ellipse(row: Row) -> np.ndarray:
    hand = row.get("handedness").lower()
    if hand not in ("", "left", "right"):
        raise DataError(f"{row.place('handedness')}: {hand!r}: use left (V > 0), right, or leave it empty")
    intensity = _number(row, "intensity", 1.0, low=0.0)
    dop = _number(row, "dop", 1.0, low=0.0, high=1.0)
    chi = _number(row, "ellipticity_deg", 45.0 if hand else 0.0, low=-45.0, high=45.0)
    if hand:
        if chi < 0.0 and hand == "left":
            raise DataError(f"{row.line}: a negative ellipticity is right-handed, but handedness is left")
        chi = abs(chi) if hand == "left" else -abs(chi)
    needs_angle = abs(chi) < 45.0 and dop > 0.0 and intensity > 0.0
    if needs_angle and not row.get("angle_deg"):
        raise DataError(f"{row.line}, column 'angle_deg': give the angle, or dop = 0 for natural light")
    angle = _number(row, "angle_deg", 0.0)
    return intensity * ellipse(math.radians(angle), math.radians(chi), dop)
