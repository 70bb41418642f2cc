"""Analyser vectors in files: CSV for one set, netCDF for a map over the field of view."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pbrdf.errors import DataError
from pbrdf.files.atomic import atomic_file
from pbrdf.files.delimited import TABLE_EXTENSIONS, read_table, write_table
from pbrdf.files.netcdf_files import load_netcdf, write_netcdf_file
from pbrdf.instruments.polarimeter.polarimeter import Polarimeter, measured
from pbrdf.optics.stokes import STOKES

__all__ = ["read_analyzer", "write_analyzer"]

_COLUMNS = tuple(f"w_{name}" for name in STOKES)


def read_analyzer(path: str | Path) -> Polarimeter:
    """Read analyser vectors.

    Parameters
    ----------
    path
        A table (``.csv``, ``.xlsx`` …) with the columns state, w_I, w_Q, w_U, w_V (:mod:`pbrdf.files.delimited` says
        how they may be separated) and a row for each state; or ``.nc`` with a variable
        ``analyzer`` over (row, column, state, stokes) or (state, stokes).

    Raises
    ------
    DataError
        If the file cannot be read or lacks what is expected; names the file, the line and the column.
    """
    path = Path(path)
    readers = {**dict.fromkeys(TABLE_EXTENSIONS, _read_csv), ".nc": _read_netcdf}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise DataError(
            f"{path}: the extension {path.suffix!r} cannot be read as analyser vectors; use .csv, another "
            "table, or .nc"
        )
    if not path.is_file():
        raise DataError(f"{path}: there is no such file")
    analyzer, states = reader(path)
    try:
        return measured(analyzer, states, path.stem)
    except DataError as error:
        raise DataError(f"{path}: {error}") from error


def write_analyzer(polarimeter: Polarimeter, path: str | Path) -> None:
    """Write the analyser vectors of a polarimeter; ``.csv`` for a single set, ``.nc`` for a map or a single set.

    Raises
    ------
    DataError
        If the extension does not fit or the file cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() == ".nc":
        import xarray as xr

        dims = ("row", "column", "state", "stokes")[-polarimeter.analyzer.ndim :]
        stored = xr.Dataset(
            {"analyzer": (dims, polarimeter.analyzer)},
            {"state": list(polarimeter.states), "stokes": list(STOKES)},
            {"title": "analyser vectors W, intensity = W·(I, Q, U, V); x towards y, V > 0 left circular"},
        )
        with atomic_file(path) as target:
            write_netcdf_file(target, {"/": stored})
    elif path.suffix.lower() == ".csv" and not polarimeter.is_map:
        rows = zip(polarimeter.states, polarimeter.analyzer.tolist(), strict=True)
        write_table(path, ["state", *_COLUMNS], ([name, *map(repr, w)] for name, w in rows))
    else:
        kind = "a map of analyser vectors" if polarimeter.is_map else "analyser vectors"
        use = ".nc" if polarimeter.is_map else ".csv or .nc"
        raise DataError(f"{path}: {kind} cannot be written with this extension; use {use}")


def _read_csv(path: Path) -> tuple[np.ndarray, list[str] | None]:
    table = read_table(path)
    state = table.column("state")
    vectors = [table.numbers(table.column(name)) for name in _COLUMNS]
    return np.array(vectors).T, table.cells(state)


def _read_netcdf(path: Path) -> tuple[np.ndarray, list[str] | None]:
    (stored,) = load_netcdf(path, decode_times=False)
    if "analyzer" not in stored:
        raise DataError(f"{path}: there is no variable 'analyzer'")
    array = stored["analyzer"]
    wanted = ("row", "column", "state", "stokes")
    if set(array.dims) not in ({*wanted}, {*wanted[2:]}):
        raise DataError(
            f"{path}: analyzer has the dimensions {', '.join(map(str, array.dims))}; they must be "
            f"{', '.join(wanted)}, or the last two"
        )
    array = array.transpose(*(name for name in wanted if name in array.dims))
    if "stokes" in array.coords:
        order = [str(name) for name in array["stokes"].values]
        if sorted(order) != sorted(STOKES):
            raise DataError(f"{path}: the Stokes components are {', '.join(order)}; they must be I, Q, U, V")
        array = array.sel(stokes=list(STOKES))
    states = [str(name) for name in array["state"].values] if "state" in array.coords else None
    return array.values, states
