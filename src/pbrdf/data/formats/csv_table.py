"""The documented CSV table, and the tables of strangers.

A file of the project's own looks like this::

    # quantity: brdf
    # azimuth: forward=0
    # stokes: p-s
    # illumination: natural
    # title: white paint, 476 nm
    theta_i_deg,theta_r_deg,phi_deg,wavelength_nm,group,I,I_std,dolp
    30,30,0,476,1,0.61,0.01,0.08

**Header.** Lines ``# key: value`` before the column names; other comment lines are skipped. Each key may
instead be given to :func:`read_csv` as an option, which then counts.

=================== ================================================= ====================================
key                 values                                            if it is not stated
=================== ================================================= ====================================
``quantity``        brdf, reflectance_factor, radiance, dn            taken from a column called ``brdf``,
                                                                      ``f_r``, ``reflectance_factor``,
                                                                      ``radiance`` or ``dn``, else an error
``azimuth``         forward=0 or forward=180                          forward=0 assumed
``stokes``          p-s or s-p                                        p-s assumed
``illumination``    natural, or four numbers ``1,0,0,0``              natural
``cosine_weighted`` yes: values are multiplied by cos θ_r; or no      no
``angles``          degrees or radians                                degrees
``simulated``       0 or 1                                            0
=================== ================================================= ====================================

``title``, ``source``, ``reference``, ``instrument`` and any other key become attributes. What was assumed
about polarisation and azimuth is recorded in the attribute ``assumptions``.

**Columns.** ``theta_i``, ``theta_r``, ``phi``, ``wavelength``, ``group``, ``I``, ``Q``, ``U``, ``V``,
``dolp``, ``aolp``, ``m00`` … ``m33``, ``<name>_std``, and the covariances ``cov_IQ``, ``cov_IU``,
``cov_IV``, ``cov_QU``, ``cov_QV``, ``cov_UV``; case, spaces, hyphens and underscores do not matter, and some
usual synonyms are understood (``incidence``, ``zenith_i``, ``lambda``, ``s0`` … ``s3``).
A unit in the name, ``_deg``, ``_rad``, ``_nm``, ``_um`` or ``[deg]``, counts before the header's. Other
columns are left out and listed in the attribute ``ignored_columns``. Empty cells, ``nan`` and ``NA`` are
NaN. Columns are separated by commas, semicolons or tabs; with the last two, decimal commas are read.

**Covariances.** Where there is any column of them, the variances are the squares of ``<name>_std``, or, where
there is one, the column ``cov_II``, ``cov_QQ``, ``cov_UU`` or ``cov_VV``; such a column also serves in place of
``<name>_std``.

**No azimuth column** means a measurement in the plane of incidence. Then ``theta_i`` must not be negative,
``theta_r`` ≥ 0 is on the side of the specular direction (φ = 0), and ``theta_r`` < 0 on the side of the
source (φ = π at |theta_r|). With an azimuth column a negative ``theta_r`` means |theta_r| at φ + π.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from pbrdf.data import conventions
from pbrdf.data.build import assemble, group_labels
from pbrdf.data.covariance import derived_variance, square
from pbrdf.data.degrees import exact_degrees
from pbrdf.data.formats.attributes import decode_attribute, encode_attribute, plain_attributes
from pbrdf.data.formats.csv_columns import (
    ANGLE_COLUMNS,
    CHANNELS,
    COVARIANCES,
    ELEMENTS,
    Column,
    resolve_columns,
)
from pbrdf.data.schema import (
    ATTRIBUTE_NAME,
    COVARIANCE,
    FILE_KEYS,
    NATURAL_LIGHT,
    QUANTITIES,
    TEXT_ATTRIBUTES,
    VARIABLES,
    std_name,
)
from pbrdf.data.validate import check, validate
from pbrdf.errors import DataError
from pbrdf.files.atomic import atomic_file
from pbrdf.files.text import read_lines
from pbrdf.optics.stokes import STOKES

__all__ = ["header_names", "read_csv", "write_csv"]

_MISSING = frozenset(("", "nan", "na"))
_YES_NO = {"yes": True, "1": True, "true": True, "no": False, "0": False, "false": False}


def read_csv(
    path: str | Path,
    *,
    column: Mapping[str, str] | None = None,
    where: Mapping[str, str] | None = None,
    skip_invalid: bool = False,
    quantity: str | None = None,
    azimuth: str | None = None,
    stokes: str | None = None,
    illumination: str | Sequence[float] | None = None,
    cosine_weighted: bool | str | None = None,
    angles: str | None = None,
) -> xr.Dataset:
    """Read a CSV table; the module's text describes the format.

    Parameters
    ----------
    path
        The file.
    column
        The file's names for the columns, by the name used here: ``{"I": "f_r_per_sr"}``. A unit in the
        file's name counts. A value that begins with ``=`` is a constant for all rows, in the unit of the
        header's ``angles``, or in nm: ``{"phi": "=0", "wavelength": "=550"}``.
    where
        Take only the rows that have this text in these columns, by the file's names:
        ``{"material": "white"}``.
    skip_invalid
        Leave out rows with angles or values that the schema does not allow, and rows where nothing was
        measured. How many is recorded in the attribute ``skipped_rows``.
    quantity, azimuth, stokes, illumination, cosine_weighted, angles
        As the header keys of the same names, for files that do not state them, or state them wrongly.

    Returns
    -------
    xarray.Dataset
        A valid data set in the project's conventions, radians.

    Raises
    ------
    DataError
        Names the file, the line (from 1) and the column.
    """
    path = Path(path)
    table = _read_table(path)
    options = {
        "quantity": quantity,
        "azimuth": azimuth,
        "stokes": stokes,
        "illumination": illumination,
        "cosine_weighted": cosine_weighted,
        "angles": angles,
    }
    statements = table.header | {key: value for key, value in options.items() if value is not None}
    header = _Header.parse(path, statements)
    columns, ignored = resolve_columns(path, table.names, column or {})
    if where:
        table = _filter(table, where)

    values = {source.variable: _values(table, source, header) for source in columns}
    names = {c.variable: table.names[c.index] for c in columns if c.index is not None}
    ds = _to_dataset(table, header, columns, values, ignored)
    lines = table.lines
    if skip_invalid:
        ds, lines = _without_invalid(ds, lines)
    validate(ds, origin=str(path), lines=lines, columns=names)
    return ds


def header_names(lines: Iterable[str]) -> list[str]:
    """Column names of a CSV file: the cells of its first line that is neither empty nor a comment."""
    for line in lines:
        if line.strip() and not line.lstrip().startswith("#"):
            return [name.strip() for name in next(csv.reader([line], delimiter=_delimiter(line)))]
    return []


@dataclass(frozen=True)
class _Table:
    """The text of a file: header statements, column names, and cells with their line numbers."""

    path: Path
    header: dict[str, str]
    names: list[str]
    rows: list[list[str]]
    lines: list[int]
    decimal_comma: bool

    def place(self, row: int, index: int) -> str:
        return f"{self.path}: line {self.lines[row]}, column {self.names[index]!r}"


@dataclass(frozen=True)
class _Header:
    """What the file states about its conventions, checked."""

    quantity: str | None
    forward_at_zero: bool
    p_minus_s: bool
    illumination: list[float]
    cosine_weighted: bool
    degrees: bool
    unstated: frozenset[str]
    attrs: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def parse(cls, path: Path, statements: Mapping[str, Any]) -> _Header:
        def choose(key: str, choices: Mapping[str, Any], default: str) -> Any:
            text = str(statements.get(key, default)).replace(" ", "").lower()
            if text not in choices:
                raise DataError(f"{path}: {key} is {statements[key]!r}; use {' or '.join(choices)}")
            return choices[text]

        if "quantity" in statements and statements["quantity"] not in QUANTITIES:
            raise DataError(f"{path}: quantity is {statements['quantity']!r}; use {' or '.join(QUANTITIES)}")
        own = {"quantity", "illumination", "simulated", *FILE_KEYS}
        attrs = {key: decode_attribute(key, value) for key, value in statements.items() if key not in own}
        attrs["simulated"] = int(choose("simulated", _YES_NO, "0"))
        return cls(
            quantity=statements.get("quantity"),
            forward_at_zero=choose("azimuth", {"forward=0": True, "forward=180": False}, "forward=0"),
            p_minus_s=choose("stokes", {"p-s": True, "s-p": False}, "p-s"),
            illumination=_illumination(path, statements.get("illumination", "natural")),
            cosine_weighted=choose("cosine_weighted", _YES_NO, "no"),
            degrees=choose("angles", {"degrees": True, "radians": False}, "degrees"),
            unstated=frozenset(("azimuth", "stokes")) - statements.keys(),
            attrs=attrs,
        )


def _illumination(path: Path, stated: str | Sequence[float]) -> list[float]:
    if stated == "natural":
        return list(NATURAL_LIGHT)
    parts = stated.strip("[]() ").split(",") if isinstance(stated, str) else stated
    try:
        vector = [float(part) for part in parts]
    except (TypeError, ValueError):
        vector = []
    if len(vector) != 4:
        raise DataError(f"{path}: illumination is {stated!r}; use natural or four numbers such as 1,0,0,0")
    return vector


def _read_table(path: Path) -> _Table:
    lines = read_lines(path)
    header: dict[str, str] = {}
    start = 0
    for start, line in enumerate(lines):  # noqa: B007 - `start` is wanted after the loop
        text = line.strip()
        if text and not text.startswith("#"):
            break
        statement = re.fullmatch(rf"#\s*({ATTRIBUTE_NAME})\s*:(?!//)(.*)", text)
        if statement:
            key, value = statement[1], statement[2].strip()
            lowered = key.lower()
            known = ("quantity", "illumination", "simulated", *FILE_KEYS, *TEXT_ATTRIBUTES)
            header[lowered if lowered in known else key] = value
    names = header_names(lines[start:])
    if not names:
        raise DataError(f"{path}: there is no line of column names")
    delimiter = _delimiter(lines[start])

    def body() -> Iterator[str]:
        # Comments become empty lines, which keeps the line numbers right.
        return ("" if line.lstrip().startswith("#") else line + "\n" for line in lines[start + 1 :])

    rows, numbers, first = [], [], start + 2
    reader = csv.reader(body(), delimiter=delimiter, skipinitialspace=True)
    for cells in reader:
        number, first = first, start + 2 + reader.line_num
        if not any(cell.strip() for cell in cells):
            continue
        if len(cells) != len(names):
            hint = ""
            if delimiter == "," and len(cells) > len(names):
                hint = "; if its numbers have decimal commas, separate the columns by semicolons"
            raise DataError(
                f"{path}: line {number}: {len(cells)} cells under {len(names)} column names{hint}"
            )
        rows.append([cell.strip() for cell in cells])
        numbers.append(number)
    if not rows:
        raise DataError(f"{path}: there are no rows under the column names")
    return _Table(path, header, names, rows, numbers, decimal_comma=delimiter != ",")


def _delimiter(line: str) -> str:
    return max((",", ";", "\t"), key=line.count)


def _filter(table: _Table, where: Mapping[str, str]) -> _Table:
    keep = list(range(len(table.rows)))
    for name, text in where.items():
        if name not in table.names:
            raise DataError(
                f"{table.path}: there is no column {name!r} to select by; the columns are "
                f"{', '.join(table.names)}"
            )
        index = table.names.index(name)
        present = sorted({row[index] for row in table.rows})
        keep = [row for row in keep if table.rows[row][index] == str(text)]
        if not keep:
            some = ", ".join(map(repr, present[:10])) + (" …" if len(present) > 10 else "")
            raise DataError(f"{table.path}: no row has {text!r} in the column {name!r}; there are {some}")
    return _Table(
        table.path,
        table.header,
        table.names,
        [table.rows[row] for row in keep],
        [table.lines[row] for row in keep],
        table.decimal_comma,
    )


def _values(table: _Table, column: Column, header: _Header) -> NDArray[Any]:
    """One column as labels or numbers: angles in radians but for φ (see `_azimuth`), wavelengths in nm."""
    if column.variable == "group":
        return _labels(table, column)
    if column.index is None:
        try:
            values = np.full(len(table.rows), float(column.constant))
        except ValueError:
            raise DataError(
                f"{table.path}: the constant {'=' + column.constant!r} for {column.variable} is not a number"
            ) from None
    else:
        index = column.index
        values = np.array([_number(table, row, index) for row in range(len(table.rows))])
    if column.variable in ANGLE_COLUMNS:
        return _angle(table, column, header, values)
    if column.variable == "wavelength":
        _require_unit(table, column, ("nm", "um"))
        return values * 1000 if column.unit == "um" else values
    return values


def _number(table: _Table, row: int, index: int) -> float:
    cell = table.rows[row][index]
    try:
        return float(cell)
    except ValueError:
        pass
    if cell.lower() in _MISSING:
        return np.nan
    if table.decimal_comma and re.fullmatch(r"[-+]?\d*,\d+([eE][-+]?\d+)?", cell):
        return float(cell.replace(",", "."))
    raise DataError(f"{table.place(row, index)}: {cell!r} is not a number")


def _labels(table: _Table, column: Column) -> NDArray[Any]:
    if column.index is None:
        return np.full(len(table.rows), group_labels(column.constant))
    cells = [row[column.index] for row in table.rows]
    if "" in cells:
        raise DataError(f"{table.place(cells.index(''), column.index)}: there is no group label")
    return group_labels(cells)


def _angle(
    table: _Table, column: Column, header: _Header, values: NDArray[np.float64]
) -> NDArray[np.float64]:
    _require_unit(table, column, ("deg", "rad"))
    degrees = header.degrees if column.unit is None else column.unit == "deg"
    if column.variable == "phi" and not header.forward_at_zero:
        # In the file's own unit, so that 180° becomes exactly 0.
        values = conventions.azimuth_forward_pi_to_zero(values, 180.0 if degrees else np.pi)
    return np.deg2rad(values) if degrees else values


def _require_unit(table: _Table, column: Column, units: tuple[str, ...]) -> None:
    if column.unit is not None and column.unit not in units:
        name = table.names[column.index or 0]
        raise DataError(
            f"{table.path}: the unit of the column {name!r} is not understood; use {' or '.join(units)}"
        )


def _to_dataset(
    table: _Table,
    header: _Header,
    columns: list[Column],
    values: dict[str, NDArray[Any]],
    ignored: list[str],
) -> xr.Dataset:
    assumptions = []
    azimuth = next((column for column in columns if column.variable == "phi"), None)
    if azimuth is not None:
        if "azimuth" in header.unstated and azimuth.index is not None:
            assumptions.append("the file does not say where phi = 0 lies; the forward half-plane was assumed")
        phi = values["phi"]
        values["phi"] = np.where(values["theta_r"] < 0, phi + np.where(phi > 0, -np.pi, np.pi), phi)
    else:
        _require_positive_incidence(table, values["theta_i"], columns)
        values["phi"] = np.where(values["theta_r"] < 0, np.pi, 0.0)
        assumptions.append(
            "the file has no azimuth; theta_r >= 0 was taken as forward, theta_r < 0 as backward"
        )
    # Not abs(), which would lose the sign of −0.0 that a round trip has to keep.
    values["theta_r"] = np.where(values["theta_r"] < 0, -values["theta_r"], values["theta_r"])

    channels = {name: values[name] for name in CHANNELS if name in values}
    std = {name: values[std_name(name)] for name in CHANNELS if std_name(name) in values}
    channels, std = _gather_mueller(channels), _gather_mueller(std)
    covariance = _gather_covariance(values)
    if "stokes" in header.unstated and channels.keys() & {"Q", "U", "aolp", "mueller"}:
        assumptions.append("the file does not say what Q > 0 means; Q = I_p - I_s was assumed")
    illumination = header.illumination
    if not header.p_minus_s:
        illumination = conventions.stokes_swap_sp(illumination).tolist()
        channels = _swap_sp(channels)
        covariance = None if covariance is None else conventions.covariance_swap_sp(covariance)
    if header.cosine_weighted:
        for part in (channels, std):
            for name in part.keys() - {"dolp", "aolp"}:
                part[name] = conventions.remove_cosine_weight(part[name], values["theta_r"])
        if covariance is not None:
            for _ in range(2):
                covariance = conventions.remove_cosine_weight(covariance, values["theta_r"])

    if covariance is not None:
        for i, name in enumerate(STOKES):
            if COVARIANCES[i, i] not in values and name in std:
                covariance[:, i, i] = square(std[name])
    extra: dict[str, Any] = {"ignored_columns": ignored} if ignored else {}
    if assumptions:
        extra["assumptions"] = assumptions
    coordinates = {name: values.get(name) for name in ("theta_i", "theta_r", "phi", "wavelength", "group")}
    attrs = {
        **header.attrs,
        "quantity": _quantity(table, header, columns),
        "illumination": illumination,
        **extra,
    }
    try:
        return assemble(coordinates, channels, std, attrs, covariance)
    except DataError as error:
        raise DataError(f"{table.path}: {error}") from None


def _require_positive_incidence(table: _Table, theta_i: NDArray[np.float64], columns: list[Column]) -> None:
    negative = np.flatnonzero(theta_i < 0)
    if negative.size:
        index = next(column.index for column in columns if column.variable == "theta_i") or 0
        raise DataError(
            f"{table.place(int(negative[0]), index)}: a negative theta_i without an azimuth column could "
            "mean either side; count theta_i from 0 to 90 and give theta_r the sign, or add phi"
        )


def _quantity(table: _Table, header: _Header, columns: list[Column]) -> str:
    implied = next((c.quantity for c in columns if c.variable == "I"), None)
    if header.quantity is None and implied is None:
        raise DataError(
            f"{table.path}: it does not say what was measured; add a line '# quantity: …' or the option "
            f"quantity, one of {', '.join(QUANTITIES)}"
        )
    return header.quantity or str(implied)


def _gather_mueller(values: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Replace the columns m00 … m33 by one array (N, 4, 4); elements without a column are NaN."""
    elements = {name: value for name, value in values.items() if name in ELEMENTS}
    rest = {name: value for name, value in values.items() if name not in ELEMENTS}
    if elements:
        missing = np.full(len(next(iter(elements.values()))), np.nan)
        stacked = np.stack([elements.get(name, missing) for name in ELEMENTS], axis=-1)
        rest["mueller"] = stacked.reshape(-1, 4, 4)
    return rest


def _gather_covariance(values: Mapping[str, NDArray[Any]]) -> NDArray[np.float64] | None:
    """The covariance, shape (N, 4, 4), from its columns, NaN where there is none; None without any."""
    if not values.keys() & set(COVARIANCES.values()):
        return None
    matrix = np.full((len(values["theta_i"]), 4, 4), np.nan)
    for (i, j), name in COVARIANCES.items():
        if name in values:
            matrix[:, i, j] = matrix[:, j, i] = values[name]
    return matrix


def _swap_sp(channels: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    swapped = dict(channels)
    for name in swapped.keys() & {"Q", "U"}:
        swapped[name] = -swapped[name]
    if "aolp" in swapped:
        swapped["aolp"] = conventions.aolp_swap_sp(swapped["aolp"])
    if "mueller" in swapped:
        swapped["mueller"] = conventions.mueller_swap_sp(swapped["mueller"])
    return swapped


def _without_invalid(ds: xr.Dataset, lines: list[int]) -> tuple[xr.Dataset, list[int]]:
    bad: set[int] = set()
    for issue in check(ds):
        # The only issue that concerns rows but no variable is that nothing was measured there.
        if issue.severity == "error" or not issue.variable:
            bad.update(issue.rows)
    keep = [row for row in range(ds.sizes["geometry"]) if row not in bad]
    kept = ds.isel(geometry=keep)
    if bad:
        kept.attrs["skipped_rows"] = len(bad)
    return kept, [lines[row] for row in keep]


def write_csv(ds: xr.Dataset, path: str | Path) -> None:
    """Write a data set as a CSV table that :func:`read_csv` reads back bit for bit.

    Angles are written in degrees; a column with an angle that no number of degrees stands for exactly is
    written in radians, as its name then says. The file appears under its name only when it is complete.

    Parameters
    ----------
    ds
        A valid data set.
    path
        The file; replaced if it exists.

    Raises
    ------
    DataError
        If `ds` does not follow the schema or the file cannot be written.
    """
    path = Path(path)
    validate(ds)
    header = {"azimuth": "forward=0", "stokes": "p-s"}
    for name, value in plain_attributes(ds.attrs).items():
        if name == "illumination":
            header[name] = "natural" if tuple(value) == NATURAL_LIGHT else ",".join(map(repr, value))
        elif name != "stokes_convention":
            header[name] = encode_attribute(name, value)
    columns = dict(_text_columns(ds))
    with atomic_file(path) as target, target.open("x", encoding="utf-8", newline="") as file:
        for name in sorted(header, key=lambda name: name != "quantity"):
            file.write(f"# {name}: {header[name]}\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))


def _text_columns(ds: xr.Dataset) -> Iterator[tuple[str, list[str]]]:
    for name in ("theta_i", "theta_r", "phi"):
        yield _text_angle(ds, name)
    if "wavelength" in ds.coords:
        yield "wavelength_nm", _text(ds["wavelength"].values)
    yield "group", [str(label) for label in ds["group"].values]
    for channel in VARIABLES:
        for name in (channel, std_name(channel)):
            if name not in ds.data_vars:
                continue
            if channel == "aolp":
                yield _text_angle(ds, name)
            elif channel == "mueller":
                flat = ds[name].values.reshape(-1, 16)
                for position, element in enumerate(ELEMENTS):
                    yield element + name.removeprefix("mueller"), _text(flat[:, position])
            else:
                yield name, _text(ds[name].values)
    if COVARIANCE in ds.data_vars:
        for i, j in _covariances_written(ds):
            yield COVARIANCES[i, j], _text(ds[COVARIANCE].values[:, i, j])


def _covariances_written(ds: xr.Dataset) -> list[tuple[int, int]]:
    """Entries that a file needs: those between what was measured, and variances other than exactly std²."""
    matrix = ds[COVARIANCE].values
    written = []
    for i, j in COVARIANCES:
        if i == j:
            needed = not np.array_equal(matrix[:, i, i], derived_variance(ds, STOKES[i]), equal_nan=True)
        else:
            needed = STOKES[i] in ds.data_vars and STOKES[j] in ds.data_vars
        if needed:
            written.append((i, j))
    return written or [(0, 0)]


def _text_angle(ds: xr.Dataset, name: str) -> tuple[str, list[str]]:
    radians = ds[name].values
    degrees = exact_degrees(radians)
    return (f"{name}_rad", _text(radians)) if degrees is None else (f"{name}_deg", _text(degrees))


def _text(values: NDArray[np.float64]) -> list[str]:
    return [repr(float(value)) for value in values]
