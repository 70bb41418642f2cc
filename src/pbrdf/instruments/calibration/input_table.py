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

How well the light is known stands in ``angle_std_deg``, ``ellipticity_std_deg``, ``dop_std`` and ``dolp_std``, or in
``Q_std``, ``U_std`` and ``V_std`` (in the unit of Q, U, V): standard uncertainties, which the calibration takes for
errors that all inputs share, such as that of a polariser's zero. An angle ψ ± σ of light of the degree p turns (Q, U)/I
by 2σ: its variance is (2σ p cos 2χ)² (sin² 2ψ, cos² 2ψ), and that of the ellipticity χ ± τ (2τ p)² (sin² 2χ cos² 2ψ,
sin² 2χ sin² 2ψ, cos² 2χ) of (Q, U, V)/I, to first order.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from pbrdf.data.schema import std_name
from pbrdf.errors import DataError
from pbrdf.files.delimited import Row, read_table, write_table
from pbrdf.instruments.frames.frames import named
from pbrdf.optics.stokes import STOKES

__all__ = ["InputTable", "ellipse", "read_input_table", "write_input_table"]

_ELLIPSE = ("angle_deg", "ellipticity_deg", "handedness", "dop", "intensity")
_ELLIPSE_STD = ("angle_std_deg", "ellipticity_std_deg", "dop_std", "dolp_std")
_VECTOR_STD = tuple(std_name(name) for name in STOKES[1:])
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
    ratio_std
        Standard uncertainties of Q/I, U/I and V/I of this light, shape (3, K); 0 where none is stated.

    Raises
    ------
    DataError
        If the shapes do not fit, a name comes twice, or a Stokes vector is not one of light.
    """

    names: tuple[str, ...]
    stokes: np.ndarray
    ratio_std: np.ndarray = field(default_factory=lambda: np.zeros((3, 1)))

    def __post_init__(self) -> None:
        S = np.asarray(self.stokes, dtype=float)
        object.__setattr__(self, "names", tuple(map(str, self.names)))
        object.__setattr__(self, "stokes", S)
        if S.shape != (4, len(self.names)):
            raise DataError(
                f"input table: Stokes vectors {S.shape} for {len(self.names)} series: give (4, K)"
            )
        object.__setattr__(self, "ratio_std", np.broadcast_to(self.ratio_std, (3, len(self.names))))
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
        order = [self.names.index(name) for name in names]
        return InputTable(tuple(names), self.stokes[:, order], self.ratio_std[:, order])

    @property
    def accuracy(self) -> tuple[float, float]:
        """What the uncertainty of the light leaves of that of Q/I and U/I, and of V/I, of fully polarised light.

        An error that all inputs share is no smaller for their number: the mean square over the inputs that are lit,
        for light that is polarised in part relative to the square of its degree of polarisation (linear: of linear
        polarisation, as circular light has no angle that could be wrong). For a polariser known to σ: 2σ/√2.
        """
        lit = self.stokes[0] > 0.0
        ratios = self.stokes[1:, lit] / self.stokes[0, lit]
        squares = (ratios**2).sum(axis=1)
        variance = (self.ratio_std[:, lit] ** 2).sum(axis=1)
        parts = (0.5 * variance[:2].sum(), squares[:2].sum()), (variance[2], squares.sum())
        linear, circular = (
            math.sqrt(spread / max(size, _ROUNDING**2)) if spread else 0.0 for spread, size in parts
        )
        return linear, circular


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
    names, vectors, spreads = [], [], []
    for row in table:
        names.append(row.text("series"))
        vector, spread = _stokes(row) if "Q" in table.names else _ellipse(row)
        vectors.append(vector * _number(row, "exposure", 1.0, low=0.0))
        spreads.append(spread)
    try:
        return InputTable(tuple(names), np.array(vectors).T, np.array(spreads).T)
    except DataError as error:
        raise DataError(f"{path}: {error}") from None


def write_input_table(table: InputTable, path: str | Path) -> None:
    """Write the Stokes vectors of a table as :func:`read_input_table` reads them; raises DataError if it cannot."""
    columns = table.stokes
    header = ["series", *STOKES]
    if table.ratio_std.any():
        columns = np.concatenate([columns, table.ratio_std * table.stokes[0]])
        header += _VECTOR_STD
    rows = zip(table.names, columns.T.tolist(), strict=True)
    write_table(Path(path), header, ([name, *map(repr, S)] for name, S in rows))


def _require_columns(path: Path, header: Sequence[str]) -> None:
    vectors = any(name in STOKES for name in header)
    known = ("series", *((*STOKES, *_VECTOR_STD) if vectors else (*_ELLIPSE, *_ELLIPSE_STD)), "exposure")
    needed = ("series", *(STOKES[1:] if vectors else ()))
    for name in header:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1, cutoff=0.75)
            raise DataError(
                f"{path}: the column {name!r} is not known{f' (perhaps {near[0]!r})' if near else ''}; use series, "
                f"{', '.join((*_ELLIPSE, *_ELLIPSE_STD))}, exposure, or series, I, Q, U, V, {', '.join(_VECTOR_STD)}, "
                "exposure"
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


def _stokes(row: Row) -> tuple[np.ndarray, np.ndarray]:
    """Stokes vector and standard uncertainties of Q/I, U/I, V/I."""
    first = _number(row, "I", 1.0)
    vector = np.array([first, *(_number(row, name, None) for name in STOKES[1:])])
    spread = np.array([_number(row, name, 0.0, low=0.0) for name in _VECTOR_STD])
    return vector, spread / first if first > 0.0 else np.zeros(3)


def _ellipse(row: Row) -> tuple[np.ndarray, np.ndarray]:
    """Likewise, of an ellipse in words."""
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
    spread = _ellipse_std(
        math.radians(angle),
        math.radians(chi),
        dop,
        math.radians(_number(row, "angle_std_deg", 0.0, low=0.0)),
        math.radians(_number(row, "ellipticity_std_deg", 0.0, low=0.0)),
        _number(row, "dop_std", 0.0, low=0.0),
        _number(row, "dolp_std", 0.0, low=0.0),
    )
    return intensity * ellipse(math.radians(angle), math.radians(chi), dop), spread


def _ellipse_std(
    angle: float,
    ellipticity: float,
    dop: float,
    angle_std: float,
    ellipticity_std: float,
    dop_std: float,
    dolp_std: float,
) -> np.ndarray:
    """Standard uncertainties of Q/I, U/I and V/I to first order; where the degree is 0, in all three alike."""
    c, s = math.cos(2.0 * angle), math.sin(2.0 * angle)
    flat, round_ = math.cos(2.0 * ellipticity), math.sin(2.0 * ellipticity)
    turn = 2.0 * angle_std * dop * flat * np.array([s, c, 0.0])
    bend = 2.0 * ellipticity_std * dop * np.array([round_ * c, round_ * s, flat])
    # light of no degree of polarisation has no direction of it either
    along = np.array([flat * c, flat * s, round_]) if dop > 0.0 else np.full(3, math.sqrt(1.0 / 3.0))
    flatly = np.array([c, s, 0.0]) if dop > 0.0 else np.full(3, math.sqrt(0.5)) * [1.0, 1.0, 0.0]
    return np.sqrt(turn**2 + bend**2 + (dop_std * along) ** 2 + (dolp_std * flatly) ** 2)
