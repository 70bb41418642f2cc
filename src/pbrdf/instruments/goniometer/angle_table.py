"""The table that says at which angles each series of frames was taken.

A CSV file with one row a series, for example::

    # azimuth: forward=0
    series,theta_i_deg,theta_r_deg,phi_deg,group,wavelength_nm,exposure
    p1_01,10,50,0,1,476,1
    p1_02,12,48,0,1,476,0.5

``series`` is the name by which the frames are called. Angles are in degrees, or in radians in a column whose name ends
in ``_rad`` or after a line ``# angles: radians``. ``phi`` is the relative azimuth, 0 in the forward half-plane unless
the line ``# azimuth: forward=180`` says otherwise; without the column all was measured in the plane of incidence, and
θ_r < 0 is on the side of the source. :mod:`pbrdf.files.delimited` says how columns may be separated.
Optional: ``group``; ``wavelength`` (nm); ``exposure``, the exposure time in any one unit, by which signals are divided;
``reference_angle``, in place of the instrument's, where the camera was turned between series; ``sample_angle``, how the
sample stood (the paper's Angle_S_I), kept for the record.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pbrdf.data.build import group_labels
from pbrdf.data.conventions import azimuth_forward_pi_to_zero
from pbrdf.data.degrees import exact_degrees
from pbrdf.errors import DataError
from pbrdf.files.delimited import Table, read_table, write_table
from pbrdf.instruments.frames.frames import Frames, color_sources_of, named

__all__ = ["AngleTable", "angles_of", "read_angles", "write_angles"]

_ANGLES = ("theta_i", "theta_r", "phi", "reference_angle", "sample_angle")
_COLUMNS = ("series", *_ANGLES[:3], "group", "wavelength", "exposure", *_ANGLES[3:])
_NEEDED = ("series", "theta_i", "theta_r")
_MAY_BE_EMPTY = ("wavelength", "reference_angle", "sample_angle")
_UNITS = {
    "deg": "deg",
    "degree": "deg",
    "degrees": "deg",
    "°": "deg",
    "rad": "rad",
    "radians": "rad",
    "nm": "nm",
}


@dataclass(frozen=True, eq=False)
class AngleTable:
    """Angles of every series of frames.

    Attributes
    ----------
    names
        Of the M series, no name twice.
    theta_i, theta_r, phi
        Radians, shape (M,), φ = 0 in the forward half-plane.
    group
        What was measured together, shape (M,): integers or text; 0 everywhere by default.
    wavelength
        Nanometres, shape (M,), or None.
    exposure
        Exposure times in any one unit, shape (M,), more than 0; 1 everywhere by default.
    reference_angle
        Radians from the p direction to the polarimeter's x axis, shape (M,); NaN: that of the instrument.
    sample_angle
        Radians, shape (M,); NaN where it is not known.

    Raises
    ------
    DataError
        If the shapes do not fit, a name comes twice, or a number is out of its range.
    """

    names: tuple[str, ...]
    theta_i: np.ndarray
    theta_r: np.ndarray
    phi: ArrayLike = 0.0
    group: ArrayLike = 0
    wavelength: ArrayLike | None = None
    exposure: ArrayLike = 1.0
    reference_angle: ArrayLike = np.nan
    sample_angle: ArrayLike = np.nan

    def __post_init__(self) -> None:
        names = tuple(str(name) for name in self.names)
        object.__setattr__(self, "names", names)
        twice = [name for name in names if names.count(name) > 1] if len(set(names)) < len(names) else []
        if twice:
            raise DataError(f"angle table: the series {twice[0]!r} stands there twice")
        for field in (*_ANGLES, "exposure", "wavelength", "group"):
            value = getattr(self, field)
            if value is None:
                continue
            array = group_labels(value) if field == "group" else np.asarray(value, dtype=float)
            try:
                array = np.broadcast_to(array, (len(names),)).copy()
            except ValueError:
                raise DataError(
                    f"angle table: {field} has the shape {array.shape}, not {len(names)} values"
                ) from None
            object.__setattr__(self, field, array)
        for field in _MAY_BE_EMPTY:
            values = getattr(self, field)
            bad = np.flatnonzero(np.isinf(values)) if values is not None else np.array([], dtype=int)
            if bad.size:
                raise DataError(f"angle table: series {names[bad[0]]!r}: {field} is infinite")
        for field, low, high, need in (
            ("theta_i", 0.0, np.pi / 2, "from 0° to below 90°"),
            ("theta_r", 0.0, np.pi / 2, "from 0° to below 90°"),
            ("phi", -2 * np.pi, 2 * np.pi + 1e-12, "within one turn"),
            ("exposure", np.finfo(float).tiny, np.inf, "more than 0"),
        ):
            values = getattr(self, field)
            bad = np.flatnonzero(~((values >= low) & (values < high)))
            if bad.size:
                value = values[bad[0]] if field == "exposure" else np.rad2deg(values[bad[0]])
                raise DataError(
                    f"angle table: series {names[bad[0]]!r}: {field} is {value:g}, it must be {need}"
                )

    def rows(self, names: Sequence[str]) -> AngleTable:
        """The rows of these series, in this order.

        Raises
        ------
        DataError
            If one is not in the table.
        """
        missing = [name for name in names if name not in self.names]
        if missing:
            raise DataError(f"the angle table has no row for {named(missing)}; it has {named(self.names)}")
        return replace(self._taken(names), names=tuple(names))

    def for_frames(self, frames: Frames) -> AngleTable:
        """The table with a row for each colour of each picture, where the camera sees several: :meth:`for_colors`."""
        return self.for_colors(color_sources_of(frames))

    def for_colors(self, sources: Sequence[tuple[str, str, float | None]]) -> AngleTable:
        """The table with a row for each of these: name of a picture, colour, wavelength (nm) if it is known.

        Rows of pictures serve all their colours: with the nominal wavelength of the colour if the table has none, and
        where that is not known either, with the colour as group. A table that names the colours' series stays as it is.
        """
        if not sources or not {picture for picture, _, _ in sources} & set(self.names):
            return self
        chosen = [(picture, color, nm) for picture, color, nm in sources if picture in self.names]
        table = self._taken([picture for picture, _, _ in chosen])
        known = all(nm is not None for _, _, nm in chosen)
        group, wavelength = np.asarray(table.group), table.wavelength
        if wavelength is None and known:
            wavelength = np.array([nm for _, _, nm in chosen], dtype=float)
        elif wavelength is None:
            plain = len(set(group.tolist())) == 1
            group = np.array(
                [color if plain else f"{g} {color}" for g, (_, color, _) in zip(group, chosen, strict=True)]
            )
        names = tuple(f"{picture}_{color}" for picture, color, _ in chosen)
        return replace(table, names=names, group=group, wavelength=wavelength)

    def _taken(self, names: Sequence[str]) -> AngleTable:
        """Rows of these series, as often as they are named, under the numbers 1, 2, …"""
        index = np.array([self.names.index(name) for name in names], dtype=int)
        chosen: dict[str, Any] = {
            field: np.asarray(getattr(self, field))[index]
            for field in (*_ANGLES, "exposure", "wavelength", "group")
            if getattr(self, field) is not None
        }
        return replace(self, names=tuple(str(k) for k in range(len(names))), **chosen)


def read_angles(path: str | Path) -> AngleTable:
    """Read the CSV table that the module's text describes.

    Raises
    ------
    DataError
        Names the file, and the line and the column where there is one.
    """
    return angles_of(read_table(Path(path)))


def angles_of(table: Table, others: Collection[str] = (), names: Sequence[str] | None = None) -> AngleTable:
    """The angles in a table of text.

    Parameters
    ----------
    table
        As :func:`read_angles` reads it.
    others
        Columns that hold something else.
    names
        Of the series, where no column says so.

    Raises
    ------
    DataError
        As :func:`read_angles`.
    """
    path = table.path
    forward_at_zero = _stated(table, "azimuth", ("forward=0", "forward=180")) == "forward=0"
    usual = "rad" if _stated(table, "angles", ("degrees", "radians")) == "radians" else "deg"
    columns = _columns(path, table.names, usual, others, names is None)
    table.require_rows()
    values: dict[str, Any] = {}
    for name, (index, unit) in columns.items():
        if name in ("series", "group"):
            values[name] = [table.text(row, index) for row in range(len(table))]
        else:
            values[name] = np.array(table.numbers(index, ("",) if name in _MAY_BE_EMPTY else ()))
            if name == "phi" and not forward_at_zero:
                values[name] = azimuth_forward_pi_to_zero(values[name], np.pi if unit == "rad" else 180.0)
            if name in _ANGLES and unit != "rad":
                values[name] = np.deg2rad(values[name])
    _sides(path, values)
    own = values.pop("series", names)
    try:
        return AngleTable(names=tuple(own if names is None else names), **values)
    except DataError as error:
        raise DataError(f"{path}: {error}") from None


def _stated(table: Table, key: str, choices: tuple[str, str]) -> str:
    """What the line ``# key: …`` states, the first choice where there is none."""
    for _, comment in table.comments:
        stated = re.fullmatch(rf"#\s*{key}\s*:(.*)", comment, re.IGNORECASE)
        if stated:
            text = stated[1].replace(" ", "").lower()
            if text not in choices:
                raise DataError(f"{table.path}: {key} is {text!r}; use {' or '.join(choices)}")
            return text
    return choices[0]


def _columns(
    path: Path, names: list[str], usual: str, others: Collection[str], named_series: bool
) -> dict[str, tuple[int, str | None]]:
    """Place and unit of each column that is known; angles without one are in the usual unit."""
    found: dict[str, tuple[int, str | None]] = {}
    for index, name in enumerate(names):
        if name in others:
            continue
        words = [word for word in re.split(r"[\s_.\-\[\]()]+", name.lower()) if word]
        unit = _UNITS.get(words[-1]) if len(words) > 1 else None
        key = "_".join(words[:-1] if unit else words)
        if key not in _COLUMNS:
            raise DataError(
                f"{path}: the column {name!r} is not known; use {', '.join(_COLUMNS)}, with _deg, _rad or _nm"
            )
        if key in found:
            raise DataError(f"{path}: two columns are called {key}")
        if unit is not None and unit not in (("deg", "rad") if key in _ANGLES else ("nm",)):
            raise DataError(f"{path}: the unit of the column {name!r} is not understood")
        found[key] = (index, unit or (usual if key in _ANGLES else None))
    for key in _NEEDED:
        if key not in found and (key != "series" or named_series):
            raise DataError(f"{path}: there is no column {key}; the columns are {', '.join(names)}")
    return found


def _sides(path: Path, values: dict[str, Any]) -> None:
    """A negative θ_r is the other side of the normal: |θ_r| at φ + 180°."""
    in_plane = "phi" not in values
    if in_plane and (values["theta_i"] < 0.0).any():
        raise DataError(f"{path}: theta_i is negative; count it from 0 to 90 and give theta_r the sign")
    phi = np.zeros_like(values["theta_r"]) if in_plane else values["phi"]
    turned = phi + np.where(phi > 0.0, -np.pi, np.pi)
    values["phi"] = np.where(values["theta_r"] < 0.0, turned, phi)
    values["theta_r"] = np.abs(values["theta_r"])


def write_angles(table: AngleTable, path: str | Path) -> None:
    """Write a table that :func:`read_angles` reads back, angles in degrees where they stand for exactly these radians.

    Raises
    ------
    DataError
        If the file cannot be written.
    """
    columns: dict[str, list[str]] = {"series": list(table.names)}
    for field in _COLUMNS[1:]:
        values = getattr(table, field)
        if values is None or (field in _ANGLES[3:] and np.isnan(values).all()):
            continue
        if field in _ANGLES:
            degrees = exact_degrees(values)
            field, values = (f"{field}_rad", values) if degrees is None else (f"{field}_deg", degrees)
        elif field == "wavelength":
            field = "wavelength_nm"
        columns[field] = [_cell(value) for value in values.tolist()]
    write_table(Path(path), columns, zip(*columns.values(), strict=True), {"azimuth": "forward=0"})


def _cell(value: Any) -> str:
    if isinstance(value, float):
        return "" if np.isnan(value) else repr(value)
    return str(value)
