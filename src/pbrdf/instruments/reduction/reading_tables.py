"""Tables of readings behind an analyser, a camera's or a photodiode's, as data sets of Stokes parameters.

    # analyzer_zero: p
    theta_i_deg,theta_r_deg,I0,I45,I90,I135
    30,30,0.41,0.52,0.63,0.52

:mod:`pbrdf.instruments.reduction.reading_states` says which names of columns are states,
:mod:`pbrdf.instruments.reduction.reading_columns` how the table may be laid out,
:mod:`pbrdf.instruments.reduction.reading_settings` what the header states. Directions, wavelengths, groups and the
quantity are those of every CSV table (:mod:`pbrdf.data.formats.csv_table`).

The geometries are those of the table: readings of the same directions, wavelength and group belong together, in
whatever order they stand. Where the quantity is not stated the readings count as digital numbers on an arbitrary
scale, proportional to BRDF · cos θ_i: those of a detector that sees a part of an evenly lit patch.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from pbrdf.data.build import assemble
from pbrdf.data.formats.csv_table.header import statements
from pbrdf.data.formats.csv_table.reading import read_rows, selected
from pbrdf.data.formats.declaration import Reader
from pbrdf.data.origin import of_rows, origin_of, remember
from pbrdf.data.validation import validate
from pbrdf.errors import DataError
from pbrdf.files.delimited import TABLE_EXTENSIONS, Table, column_names, read_table
from pbrdf.files.text import first_bytes
from pbrdf.instruments.reduction.reading_columns import (
    LongColumns,
    WideColumns,
    exposure_column,
    holds_readings,
    long_columns,
    source_columns,
    unused_factors,
    wide_columns,
)
from pbrdf.instruments.reduction.reading_settings import Settings, is_setting, settings_of
from pbrdf.instruments.reduction.reading_solution import Readings, disagreements, solve_readings
from pbrdf.instruments.reduction.reading_states import DARK, OPEN, State, parse_label, settle
from pbrdf.optics.stokes import STOKES

__all__ = ["READER", "read_readings"]

_MISSING = frozenset(("", "nan", "na"))
#: Columns of ``column`` that are the readings' own.
_OWN = ("reading", "reading_std", "analyzer", "retarder", "retardance", "state")
#: Directions that differ by less than this are one geometry, radians and nm.
_SAME = 7
#: Readings whose squares are numbers.
_LARGEST = 1e150
_SAMPLES = ("sample", "specimen", "material", "coupon", "panel", "paint", "target")


def read_readings(
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
    unit: Mapping[str, str] | None = None,
    coverage: float | str | None = None,
    scale: str | None = None,
    ignore: Sequence[str] = (),
    sheet: str | None = None,
    analyzer: Mapping[str, Any] | None = None,
) -> xr.Dataset:
    """Read a table of readings behind an analyser.

    Parameters
    ----------
    path
        The file.
    column
        As for a CSV table; also ``reading``, ``reading_std``, ``analyzer``, ``retarder``, ``retardance`` and ``state``
        of a table with a row for each reading.
    where, skip_invalid, quantity, azimuth, illumination, cosine_weighted, angles, unit, coverage, scale, ignore, sheet
        As for a CSV table, :func:`pbrdf.data.formats.csv_table.reading.read_csv`.
    stokes
        ``"s-p"`` where Q = I_s − I_p is meant: the analyser's 0 lies along s.
    analyzer
        How the readings were taken, by the keys of :mod:`pbrdf.instruments.reduction.reading_settings`:
        ``{"zero": "s", "dark": 0.4}``.

    Returns
    -------
    xarray.Dataset
        I and those of Q, U, V that the states determine, with covariance where uncertainties are known.

    Raises
    ------
    DataError
        Names the file, the line and the column.
    """
    path = Path(path)
    table = read_table(path, sheet)
    table.require_rows()
    if where:
        table = selected(table, where)
    stated = statements(table)
    if stokes is not None:
        stated["stokes"] = stokes
    settings, _ = settings_of(path, stated, analyzer)
    # the header's own statements about the analyser are no attributes of the data
    table = replace(table, comments=[(n, line) for n, line in table.comments if not is_setting(line)])
    mapping = dict(column or {})
    for own, here in (("I", "reading"), ("I_std", "reading_std")):
        if own in mapping and here not in mapping:
            mapping[here] = mapping.pop(own)
    own_mapping = {name: mapping.pop(name) for name in _OWN if name in mapping}
    plain, table = table, _with_units(table)
    layout = _layout(
        table, settings, {name: table.names[_position(plain, name, own_mapping)] for name in own_mapping}
    )
    light = _light(table) if illumination is None and "illumination" not in stated else None
    if isinstance(layout, WideColumns):
        state, value, deviation, states, dark = _wide(table, layout, settings)
        darks: NDArray[np.bool_] = np.zeros(len(table), dtype=bool)
    else:
        radians = str(angles or stated.get("angles", "")).lower() == "radians"
        state, value, deviation, states, dark, darks = _long(table, layout, settings, radians)
    exposure = _exposures(table)
    value, dark = value / exposure[:, None], dark / exposure
    deviation = None if deviation is None else deviation / exposure[:, None]
    rows = np.flatnonzero(~darks)
    implied = layout.quantity or ("brdf" if layout.unit in ("1/sr", "sr^-1", "sr-1", "/sr") else None)
    stated_quantity = quantity or stated.get("quantity") or implied
    time = exposure_column(table.names)
    used = layout.used | (frozenset() if time is None else {time})
    rest = _without(plain.taken(rows.tolist()), used)
    ds, lines = read_rows(
        rest,
        column={**mapping, "I": "=1"},
        skip_invalid=skip_invalid,
        quantity=stated_quantity or "dn",
        azimuth=azimuth,
        stokes=stokes,
        illumination=illumination,
        cosine_weighted=cosine_weighted,
        angles=angles,
        unit=unit,
        coverage=coverage,
        scale=scale,
        ignore=ignore,
    )
    kept = rows[np.isin(np.asarray(table.lines)[rows], lines)]
    geometry, first = _geometries(ds)
    _require_one_sample(table, rest.names, kept, geometry, state, path)
    values, spreads = value[kept], None if deviation is None else deviation[kept]
    count = values.shape[1]
    try:
        vectors = np.array([settings.vector(s) for s in states])
    except DataError as error:
        raise DataError(f"{path}: {error}") from None
    readings = Readings(
        np.repeat(geometry, count),
        state[kept].ravel(),
        values.ravel(),
        None if spreads is None else spreads.ravel(),
        vectors,
        None if settings.gain is None else np.repeat(settings.gain * exposure[kept], count),
        float(np.mean(dark)),
    )
    found = solve_readings(readings, len(first))
    first_lines = [lines[row] for row in first]
    names = _state_names(table, layout, states)
    assumptions = [
        *ds.attrs.get("assumptions", ()),
        *settings.assumptions(states, "stokes" in stated),
        *layout.assumptions,
        *([light] if isinstance(light, str) else []),
        *(
            []
            if time is None
            else [f"the readings were divided by the column {table.names[time]!r}, first row 1"]
        ),
        *(
            f"the column {name!r} was not used: readings are not divided by it"
            for name in unused_factors(table.names)
        ),
    ]
    if stated_quantity is None:
        assumptions.append(
            "the file does not say what was measured; the readings were taken as proportional to BRDF · cos θ_i on an "
            "arbitrary scale, those of a detector that sees a part of an evenly lit patch (one that collects all "
            "light of a small spot reads BRDF · cos θ_r: quantity brdf, cosine_weighted yes, scale arbitrary)"
        )
    absolute = stated_quantity in ("brdf", "reflectance_factor") and ds.attrs.get("scale") != "arbitrary"
    if absolute and "transmission" not in settings.stated:
        assumptions.append(
            "an analyser was taken to pass half of natural light, I = I0 + I90 (# analyzer_transmission: 1 where "
            "I = (I0 + I90)/2)"
        )
    factor = ds["I"].values[first] * (
        0.01 if layout.unit == "%" and stated_quantity == "reflectance_factor" else 1.0
    )
    vector, covariance = found.stokes * factor[:, None], found.covariance * factor[:, None, None] ** 2
    usable = ~np.isnan(vector[:, 0])
    assumptions += _incomplete(vector, usable, first_lines, names, path)
    assumptions += disagreements(found, first_lines, _sums(readings, names, len(first)))
    assumptions += _clipped(readings, first_lines)
    attrs = {
        **ds.attrs,
        "readings": [f"{name}: {_in_words(s, settings)}" for name, s in zip(names, states, strict=True)],
    }
    if isinstance(light, list):
        attrs["illumination"] = light
    attrs.pop("ignored_columns", None)
    ignored = [name for name in ds.attrs.get("ignored_columns", ()) if name]
    if ignored := ignored + [table.names[i] for i in layout.unused]:
        attrs["ignored_columns"] = ignored
    if stated_quantity is None or layout.unit not in ("", "1", "-", "%", "1/sr", "sr^-1", "sr-1", "/sr"):
        attrs.setdefault("scale", "arbitrary")
    if assumptions:
        attrs["assumptions"] = assumptions
    geometries = ds.isel(geometry=first[usable])
    result = assemble(
        {
            name: geometries[name].values if name in geometries.coords else None
            for name in ("theta_i", "theta_r", "phi", "wavelength", "group")
        },
        {name: vector[usable, k] for k, name in enumerate(STOKES) if not np.isnan(vector[usable, k]).all()},
        {},
        attrs,
        covariance[usable] if not np.isnan(covariance[usable]).all() else None,
    )
    _remember(result, ds, first[usable], table, layout, states, settings)
    validate(
        result, origin=str(path), lines=[line for line, use in zip(first_lines, usable, strict=True) if use]
    )
    return result


def _remember(
    result: xr.Dataset,
    rows: xr.Dataset,
    first: NDArray[np.intp],
    table: Table,
    layout: WideColumns | LongColumns,
    states: Sequence[State],
    settings: Settings,
) -> None:
    """Note on the data set which columns it came from."""
    of_rows(rows, first, result)
    origin = origin_of(result)
    assert origin is not None
    if isinstance(layout, WideColumns):
        meanings = {
            table.names[column.index]: f"reading {_behind(state, settings)}"
            for column, state in zip(layout.readings, states, strict=True)
        }
        beside = {column.deviation for column in layout.readings} - {None}
        meanings |= {
            table.names[index]: "standard uncertainty of a reading" for index in beside if index is not None
        }
        if layout.dark is not None:
            meanings[table.names[layout.dark]] = "reading without light"
    else:
        of_column = {
            layout.reading: "readings behind an analyser",
            layout.deviation: "standard uncertainties of the readings",
            layout.analyzer: "angle or name of the analyser",
            layout.retarder: "angle of the retarder",
            layout.retardance: "retardance",
            layout.state: "state of the analyser",
        }
        meanings = {table.names[index]: words for index, words in of_column.items() if index is not None}
    meanings |= {table.names[index]: "" for index in layout.unused}
    unused = {name: cells for name, cells in origin.unused.items() if name}
    remember(result, replace(origin, meanings=(*origin.meanings, *meanings.items()), unused=unused))


def _with_units(table: Table) -> Table:
    """The table with the units of its row of units in the names of the columns."""
    if table.units is None:
        return table
    names = [
        name if not unit or re.search(r"[(\[]", name) else f"{name} [{unit}]"
        for name, unit in zip(table.names, table.units, strict=True)
    ]
    return replace(table, names=names)


def _position(table: Table, name: str, mapping: Mapping[str, str]) -> int:
    if mapping[name] not in table.names:
        raise DataError(
            f"{table.path}: there is no column {mapping[name]!r} for {name}; the columns are {', '.join(table.names)}"
        )
    return table.names.index(mapping[name])


def _layout(table: Table, settings: Settings, mapping: Mapping[str, str]) -> WideColumns | LongColumns:
    """Which columns hold the readings; raises DataError if none does."""
    where = str(table.path)
    layout: WideColumns | LongColumns | None = None
    if not mapping:
        layout = wide_columns(table.names, settings, where)
    layout = layout or long_columns(table.names, mapping, where)
    if layout is None:
        raise DataError(
            f"{where}: there are no readings behind an analyser: name the columns I0, I45, I90, I135, or give a column "
            "'analyzer' and one 'reading', or state them in a line '# analyzer_states: NAME = polarizer 45; …'; the "
            f"columns are {', '.join(table.names)}"
        )
    return layout


def _wide(
    table: Table, layout: WideColumns, settings: Settings
) -> tuple[
    NDArray[np.intp],
    NDArray[np.float64],
    NDArray[np.float64] | None,
    list[State],
    NDArray[np.float64],
]:
    """States, readings and uncertainties, shapes (rows, states); the states; and the dark reading of each row."""
    columns = layout.readings
    dark = np.full(len(table), settings.dark or 0.0)
    if layout.dark is not None:
        read = _numbers(table, layout.dark)
        if np.isnan(read).all():
            raise DataError(f"{table.path}: the column {table.names[layout.dark]!r} is empty; leave it out")
        dark = dark + np.where(np.isnan(read), np.nanmean(read), read)
    raw = np.stack([_numbers(table, column.index) for column in columns], axis=1)
    value = raw - dark[:, None]
    deviation = None
    if any(column.deviation is not None for column in columns):
        deviation = np.full_like(value, np.nan)
        for j, column in enumerate(columns):
            if column.deviation is not None:
                deviation[:, j] = _deviations(
                    table, column.deviation, column.divisor, column.relative, raw[:, j]
                )
    states = np.broadcast_to(np.arange(len(columns)), value.shape)
    return states, value, deviation, [column.state for column in columns], dark


def _long(
    table: Table, layout: LongColumns, settings: Settings, radians: bool
) -> tuple[
    NDArray[np.intp],
    NDArray[np.float64],
    NDArray[np.float64] | None,
    list[State],
    NDArray[np.float64],
    NDArray[np.bool_],
]:
    """As :func:`_wide`, shapes (rows, 1); and which rows are readings without light."""
    of_row = _states_of_rows(table, layout, settings, radians)
    distinct = list(dict.fromkeys(of_row))
    settled, _ = settle(distinct, str(table.path))
    meaning = dict(zip(distinct, settled, strict=True))
    states = list(dict.fromkeys(state for state in settled if state.named != DARK))
    place = {state: index for index, state in enumerate(states)}
    darks = np.array([state.named == DARK for state in of_row])
    number = np.array([place.get(meaning[state], 0) for state in of_row], dtype=np.intp)
    raw = _numbers(table, layout.reading)
    dark = np.full(len(table), settings.dark or 0.0)
    if darks.any():
        dark += _dark_readings(table, layout, raw, darks)
    deviation = None
    if layout.deviation is not None:
        deviation = _deviations(table, layout.deviation, layout.divisor, layout.relative, raw)[:, None]
    return number[:, None], (raw - dark)[:, None], deviation, states, dark, darks


def _numbers(table: Table, index: int) -> NDArray[np.float64]:
    """Readings of a column, or their uncertainties, NaN where there is none."""
    found = np.asarray(table.numbers(index, _MISSING))
    beyond = np.flatnonzero(np.abs(found) > _LARGEST)
    if beyond.size:
        row = int(beyond[0])
        raise DataError(
            f"{table.place(row, index)}: {table.rows[row][index]!r} is no reading: infinite, or as good as that; leave "
            "the cell empty where there is none"
        )
    return found


def _deviations(
    table: Table, index: int, divisor: float, relative: bool, raw: NDArray[np.float64]
) -> NDArray[np.float64]:
    found = _numbers(table, index) / divisor
    found = found / 100.0 * np.abs(raw) if relative else found
    bad = np.flatnonzero(found < 0.0)
    if bad.size:
        raise DataError(f"{table.place(int(bad[0]), index)}: an uncertainty is negative")
    return np.where(found > 0.0, found, np.nan)


def _states_of_rows(table: Table, layout: LongColumns, settings: Settings, radians: bool) -> list[State]:
    """The state of each row; angles without a unit are in radians where the file's are."""
    cells = [
        None if index is None else [row[index] for row in table.rows]
        for index in (layout.state, layout.analyzer, layout.retarder, layout.retardance)
    ]
    known: dict[tuple[str | None, ...], State] = {}
    found = []
    for row in range(len(table)):
        key = tuple(None if column is None else column[row] for column in cells)
        if key not in known:
            known[key] = _state_of(table, layout, settings, radians, row, key)
        found.append(known[key])
    return found


def _state_of(
    table: Table,
    layout: LongColumns,
    settings: Settings,
    radians: bool,
    row: int,
    cells: tuple[str | None, ...],
) -> State:
    label, analyzer, retarder, retardance = cells
    stated = {name.lower(): value for name, value in settings.states.items()}
    state = State()
    if label:
        found = stated.get(label.lower()) or parse_label(label)
        if found is None:
            assert layout.state is not None
            raise DataError(
                f"{table.place(row, layout.state)}: {label!r} is no state that is understood; say it as 45, H, RCP, "
                "'qwp30 pol0', open or dark, or state it in a line '# analyzer_states: NAME = …'"
            )
        state = found
    if analyzer:
        assert layout.analyzer is not None
        try:
            found = stated.get(analyzer.lower())
            state = found or replace(state, polarizer=_angle(table, row, layout.analyzer, radians))
        except DataError:
            found = parse_label(analyzer)
            if found is None:
                raise
            state = found
    elif label is None and retarder is None:
        state = State(named=OPEN)
    if retarder and retarder.lower() not in ("none", "out", "-", "nan", "na"):
        assert layout.retarder is not None
        plate = layout.plate if settings.retardance is None else settings.retardance
        state = replace(state, retarder=_angle(table, row, layout.retarder, radians), retardance=plate)
        if retardance:
            assert layout.retardance is not None
            state = replace(state, retardance=_angle(table, row, layout.retardance, radians))
    elif analyzer == "" and not label:
        state = State(named=OPEN)
    return state


def _angle(table: Table, row: int, index: int, radians: bool) -> float:
    """An angle of a cell in degrees."""
    name = table.names[index].lower()
    value = table.number(row, index)
    if not np.isfinite(value):
        raise DataError(f"{table.place(row, index)}: {value} is not an angle")
    if re.search(r"(?<![a-z])waves(?![a-z])|λ", name):
        return 360.0 * value
    if re.search(r"(?<![a-z])rad", name) or (radians and not re.search(r"deg|°", name)):
        return float(np.round(np.rad2deg(value), 9))
    return value


def _dark_readings(
    table: Table, layout: LongColumns, raw: NDArray[np.float64], darks: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """The dark reading for each row: of rows with the same other cells where all have one, else the mean of all."""
    rest = [index for index in range(len(table.names)) if index not in layout.used]
    keys = [tuple(row[index] for index in rest) for row in table.rows]
    own: dict[tuple[str, ...], list[float]] = {}
    for row in np.flatnonzero(darks & np.isfinite(raw)).tolist():
        own.setdefault(keys[row], []).append(float(raw[row]))
    light = np.flatnonzero(~darks).tolist()
    if all(keys[row] in own for row in light):
        return np.array([np.mean(own[key]) if key in own else 0.0 for key in keys])
    every = [value for values in own.values() for value in values]
    return np.full(len(table), np.mean(every) if every else 0.0)


def _without(table: Table, used: frozenset[int]) -> Table:
    """The table whose columns of readings have no names, and so no meaning; they stay where they are."""
    names = ["" if index in used else name for index, name in enumerate(table.names)]
    units = None if table.units is None else ["" if i in used else unit for i, unit in enumerate(table.units)]
    return replace(table, names=names, units=units)


def _geometries(ds: xr.Dataset) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Which geometry each row belongs to, and the first row of each, in the order in which they stand."""
    columns = []
    for name in ("theta_i", "theta_r", "phi", "wavelength", "group"):
        if name in ds.coords:
            values = ds[name].values
            if values.dtype.kind == "f":
                values = np.round(np.nan_to_num(values, nan=-1.0), _SAME)
            columns.append(np.unique(values, return_inverse=True)[1].ravel())
    _, first, place = np.unique(np.stack(columns), axis=1, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return rank[place.ravel()], first[order]


def _exposures(table: Table) -> NDArray[np.float64]:
    """Exposure of each row, relative to the first; 1 where no column tells it."""
    index = exposure_column(table.names)
    if index is None:
        return np.ones(len(table))
    found = np.asarray(table.numbers(index))
    bad = np.flatnonzero(~(np.isfinite(found) & (found > 0.0)))
    if bad.size:
        raise DataError(f"{table.place(int(bad[0]), index)}: an exposure is a number above 0")
    values: NDArray[np.float64] = found / found[0]
    return values


def _light(table: Table) -> list[float] | str | None:
    """What a column says of the source: its Stokes vector (p, s), a sentence if that is not clear, None without one.

    Raises DataError if there are several.
    """
    found: list[float] | str | None = None
    for index in source_columns(table.names):
        name = table.names[index]
        labels = sorted({row[index] for row in table.rows})
        if len(labels) > 1:
            raise DataError(
                f"{table.path}: the column {name!r} says that the source was polarised in several ways "
                f"({', '.join(labels[:6])}); take one of them with --where {name}={labels[0]} "
                f"(where={{{name!r}: {labels[0]!r}}}) and state the light with the option illumination"
            )
        state = parse_label(labels[0])
        named = None if state is None else {"P": "p"}.get(state.named or "", state.named)
        if named in ("p", "s"):
            found = [1.0, 1.0 if named == "p" else -1.0, 0.0, 0.0]
        elif named != OPEN and labels[0].lower() not in ("", "natural", "unpolarized", "unpolarised"):
            found = (
                f"the column {name!r} says {labels[0]!r} of the source, but natural light was assumed; state its "
                "Stokes vector with the option illumination"
            )
    return found


def _require_one_sample(
    table: Table,
    others: Sequence[str],
    kept: NDArray[np.intp],
    geometry: NDArray[np.intp],
    state: NDArray[np.intp],
    path: Path,
) -> None:
    """Readings of one state at one geometry must not be those of two samples."""
    rows = table.rows
    for index, name in enumerate(table.names):
        if name not in others:
            continue
        cells = [rows[row][index] for row in kept]
        words = "".join(letter for letter in name.lower() if letter.isalpha())
        labels = len(set(cells)) <= len(cells) // 2 and not all(_is_number(cell) for cell in cells)
        if not (labels or any(word in words for word in _SAMPLES)):
            continue
        seen: dict[tuple[int, bytes], str] = {}
        for row, g, cell in zip(kept.tolist(), geometry.tolist(), cells, strict=True):
            other = seen.setdefault((g, state[row].tobytes()), cell)
            if other != cell:
                raise DataError(
                    f"{path}: line {table.lines[row]}: the same directions and state come with {other!r} and {cell!r} "
                    f"in the column {name!r}: two samples? Take one with --where {name}={cell} "
                    f"(where={{{name!r}: {cell!r}}}), or tell them apart with column={{'group': {name!r}}}"
                )


def _is_number(cell: str) -> bool:
    try:
        float(cell or "0")
    except ValueError:
        return False
    return True


def _state_names(table: Table, layout: WideColumns | LongColumns, states: Sequence[State]) -> list[str]:
    if isinstance(layout, WideColumns):
        return [table.names[column.index] for column in layout.readings]
    return [_short(state) for state in states]


def _short(state: State) -> str:
    if state.named is not None:
        return state.named
    if state.vector is not None:
        return "(" + ", ".join(f"{w:g}" for w in state.vector) + ")"
    text = "" if state.polarizer is None else f"{state.polarizer:g}°"
    return text if state.retarder is None else f"{text} retarder {state.retarder:g}°".strip()


def _behind(state: State, settings: Settings) -> str:
    words = _in_words(state, settings)
    if state.named == OPEN:
        return "without analyser"
    return f"behind an {words}" if state.vector is not None else f"behind a {words}"


def _in_words(state: State, settings: Settings) -> str:
    if state.named in ("p", "s"):
        return f"polariser along {state.named}"
    if state.named in ("right", "left"):
        return f"{state.named} circular analyser"
    if state.named == OPEN:
        return "no analyser"
    if state.vector is not None:
        return f"analyser vector {_short(state)}"
    axis = settings.polarizer if state.polarizer is None else state.polarizer
    text = f"polariser at {axis:g}°"
    if state.retarder is not None:
        retardance = settings.retardance if state.retardance is None else state.retardance
        text = f"retarder of {retardance:g}° at {state.retarder:g}° before a {text}"
    return text


def _incomplete(
    vector: NDArray[np.float64],
    usable: NDArray[np.bool_],
    lines: Sequence[int],
    names: Sequence[str],
    path: Path,
) -> list[str]:
    """Sentences on what the states leave open; raises DataError if no geometry has its intensity."""
    if not usable.any():
        raise DataError(
            f"{path}: at no geometry do the readings determine the intensity; the states are {', '.join(names)}. "
            "Readings belong together where theta_i, theta_r, phi, wavelength and group are the same"
        )
    sentences = []
    if not usable.all():
        rows = np.flatnonzero(~usable)
        shown = ", ".join(str(lines[row]) for row in rows[:5]) + (
            f" and {rows.size - 5} more" if rows.size > 5 else ""
        )
        sentences.append(
            f"{rows.size} of {usable.size} geometries were left out, because their readings do not determine the "
            f"intensity (line{'s' if rows.size > 1 else ''} {shown})"
        )
    known = ~np.isnan(vector[usable])
    never = [name for k, name in enumerate(STOKES[:3]) if not known[:, k].any()]
    if never:
        sentences.append(f"the states {', '.join(names)} do not determine {' and '.join(never)}")
    for k, name in enumerate(STOKES):
        if known[:, k].any() and not known[:, k].all():
            row = int(np.flatnonzero(usable)[np.argmin(known[:, k])])
            sentences.append(
                f"{name} is left open at {int((~known[:, k]).sum())} of {len(known)} geometries, where states are "
                f"missing (the first is that of line {lines[row]})"
            )
    return sentences


def _sums(readings: Readings, names: Sequence[str], geometries: int) -> list[tuple[str, NDArray[np.float64]]]:
    """Sums of the mean readings of pairs of states that together pass all light alike, in units of I."""
    shape = (geometries, len(names))
    good = np.isfinite(readings.value)
    place = readings.geometry[good] * shape[1] + readings.state[good]
    counts = np.bincount(place, minlength=geometries * shape[1])
    with np.errstate(invalid="ignore"):
        means = (np.bincount(place, readings.value[good], minlength=geometries * shape[1]) / counts).reshape(
            shape
        )
    found = []
    for i in range(len(names)):
        for j in range(i + 1, len(names)):
            both = readings.vectors[i] + readings.vectors[j]
            if both[0] > 0.0 and np.abs(both[1:]).max() < 1e-9 * both[0]:
                single = readings.vectors[i][0] < 0.75 * both[0]
                if single and np.abs(readings.vectors[i][1:]).max() > 0.0:
                    found.append((f"{names[i]} + {names[j]}", (means[:, i] + means[:, j]) / both[0]))
    return found


def _clipped(readings: Readings, lines: Sequence[int]) -> list[str]:
    """A sentence if the largest reading comes again and again: a detector at its end."""
    raw = readings.value + readings.dark
    if not np.isfinite(raw).any():
        return []
    top = float(np.nanmax(raw))
    where = np.unique(readings.geometry[raw == top])
    if where.size < 3:
        return []
    shown = ", ".join(str(lines[g]) for g in where[:5]) + (" …" if where.size > 5 else "")
    return [
        f"the largest reading, {top:g}, comes at {where.size} geometries (lines {shown}): the detector is saturated "
        "there, or the readings are rounded"
    ]


def _has_readings(path: Path) -> bool:
    head = first_bytes(path, 2**16).decode("utf-8-sig", errors="replace")
    stated = [line for line in head.splitlines() if is_setting(line)]
    if any(is_setting(line, "states") for line in stated):
        return True
    return holds_readings(column_names(path), stated=bool(stated))


READER = Reader("readings", read_readings, extensions=TABLE_EXTENSIONS, sniff=_has_readings)
