"""Mueller matrices from the readings of an instrument with a generator: frames, or a table of a detector's readings.

Of frames the means over regions are taken state by state, over the pixels that are good in all of them, and solved
(:func:`~pbrdf.instruments.polarimeter.mueller_polarimeter.solve_mueller`); their variance is that of the detector, or
the scatter of repeats, and that of the source from reading to reading.

A table has one row a reading::

    series,generator_deg,analyzer_deg,intensity,intensity_std
    p1,0,0,812.4,0.9
    p1,5,25,731.0,0.9

``intensity`` is the signal above the dark level. Rows of one ``series`` belong together, in any order; without such a
column those with the same angles of geometry (``theta_i_deg``, ``theta_r_deg``, ``phi_deg``, ``wavelength_nm`` …,
:mod:`pbrdf.instruments.goniometer.angle_table`), or all. Without the columns of the two angles each set has the states
of the instrument in their order. Without ``intensity_std`` the residuals of the solution say how noisy readings are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from pbrdf.data.build import make_dataset
from pbrdf.errors import DataError
from pbrdf.files.delimited import Table, read_table
from pbrdf.instruments.frames.digital_numbers import require_range
from pbrdf.instruments.frames.exposures import combine
from pbrdf.instruments.frames.frames import Frames, color_cells_of, layers_of
from pbrdf.instruments.goniometer.angle_table import AngleTable, angles_of
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.polarimeter.mueller_polarimeter import (
    dual_rotating_retarder,
    mueller_to_surface_axes,
    solve_mueller,
)
from pbrdf.instruments.reduction.corrections import Corrections
from pbrdf.instruments.reduction.regions import Region, require_inside, rows_of
from pbrdf.instruments.reduction.streaming import DEFAULT_MEMORY

__all__ = ["MuellerMeans", "mueller_dataset", "mueller_of_frames", "mueller_of_table"]

#: Bytes that a number of a state takes while it is averaged.
_BYTES = 60
_SETTINGS = ("generator_retardance", "analyzer_retardance", "polarizer", "analyzer")
_GENERATOR = ("generator_deg", "generator_angle_deg", "generator", "psg_deg", "psg")
_ANALYZER = ("analyzer_deg", "analyzer_angle_deg", "analyzer", "analyser_deg", "analyser", "psa_deg", "psa")
_READING = ("intensity", "reading", "signal")
_READING_STD = tuple(f"{name}_std" for name in _READING)


@dataclass(frozen=True, eq=False)
class MuellerMeans:
    """Mueller matrices in the axes of the instrument, one for each of M series.

    Attributes
    ----------
    names
        Of the series.
    mueller
        In digital numbers, shape (M, 4, 4); NaN without a good pixel.
    covariance
        Of the 16 elements row by row, shape (M, 16, 16); NaN where nothing says how noisy the readings are.
    residual
        Rms of readings minus those of the matrix over their mean, shape (M,).
    noise
        What the noise of the readings alone makes of it, shape (M,); NaN where nothing says how noisy they are.
    counts
        For each series how many pixels were good, saturated, dead; readings of a table are good.
    angles
        Those that the table of readings states, or None.
    """

    names: tuple[str, ...]
    mueller: np.ndarray
    covariance: np.ndarray
    residual: np.ndarray
    noise: np.ndarray
    counts: tuple[dict[str, int], ...]
    angles: AngleTable | None = None

    @property
    def std(self) -> np.ndarray:
        """Standard uncertainties of the elements, shape (M, 4, 4)."""
        values: np.ndarray = np.sqrt(np.einsum("mii->mi", self.covariance)).reshape(-1, 4, 4)
        return values


def mueller_of_frames(
    frames: Frames,
    instrument: Instrument,
    regions: Mapping[str, Region],
    *,
    max_memory: int = DEFAULT_MEMORY,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, MuellerMeans]:
    """Mueller matrices of regions, frames read by blocks of rows.

    Parameters
    ----------
    frames, instrument
        What was read, one frame for each pair of generator and analyser, and with what.
    regions
        Parts of the picture by name.
    max_memory
        Bytes for the frames and what is computed from them.
    progress
        Called with the number of finished rows and of all.

    Raises
    ------
    DataError
        If frames, instrument and regions do not fit each other, or the states do not determine the matrix.
    """
    generator = _generator(instrument)
    if frames.states != len(generator):
        raise DataError(
            f"{frames.states} frames a series for {len(generator)} pairs of generator and analyser"
        )
    require_inside(regions, frames.rows, frames.columns)
    corrections = Corrections.of(instrument, frames)
    top, bottom = rows_of(regions)
    pictures = frames.states * layers_of(frames) * color_cells_of(frames, 0).size[0]
    high = max(max_memory // (_BYTES * pictures * frames.columns), 1)
    found: dict[str, list[_Sum]] = {name: [_Sum(frames.states) for _ in frames.names] for name in regions}
    for k, series in enumerate(frames.names):
        for first in range(top, bottom, high):
            last = min(first + high, bottom)
            raw = frames.read(k, first, last)
            try:
                require_range(raw, instrument.detector)
            except DataError as error:
                raise DataError(f"series {series!r}: {error}") from None
            reading = combine(raw, instrument.detector, corrections.layout.exposures or 1)
            pixels = corrections.pixels(instrument, slice(first, last))
            response = np.asarray(pixels.response)
            saturated = reading.saturated.any(axis=0)
            dead = ~np.isfinite(reading.numbers).all(axis=0)
            if pixels.dead is not None:
                dead |= pixels.dead
            bad = saturated | dead
            response = np.where(bad, 1.0, response)
            signal = (np.where(bad, 0.0, reading.numbers) - pixels.level) / response
            variance = reading.variance(instrument.detector) / response**2
            for name, region in regions.items():
                mask = region.mask(first, last, frames.columns)
                found[name][k].add(signal, variance, mask & ~bad, mask & saturated, mask & dead)
            if progress is not None:
                progress(k * (bottom - top) + last - top, len(frames.names) * (bottom - top))
    return {name: _means(frames.names, sums, instrument) for name, sums in found.items()}


class _Sum:
    """Sums of the readings of each state over good pixels."""

    def __init__(self, states: int) -> None:
        self.signal, self.variance = np.zeros(states), np.zeros(states)
        self.counts = {"good": 0, "saturated": 0, "dead": 0}

    def add(
        self,
        signal: np.ndarray,
        variance: np.ndarray,
        good: np.ndarray,
        saturated: np.ndarray,
        dead: np.ndarray,
    ) -> None:
        self.signal += signal[:, good].sum(axis=1)
        self.variance += variance[:, good].sum(axis=1)
        for name, mask in (("good", good), ("saturated", saturated), ("dead", dead)):
            self.counts[name] += int(mask.sum())


def _means(names: Sequence[str], sums: Sequence[_Sum], instrument: Instrument) -> MuellerMeans:
    with np.errstate(divide="ignore", invalid="ignore"):
        readings = np.stack([s.signal / s.counts["good"] for s in sums])
        variance = np.stack([s.variance / np.square(float(s.counts["good"])) for s in sums])
    variance = variance + (instrument.stability * readings) ** 2
    mueller, covariance, residual = solve_mueller(
        readings, variance, _generator(instrument), instrument.polarimeter.mean_analyzer
    )
    counts = tuple(s.counts for s in sums)
    return MuellerMeans(tuple(names), mueller, covariance, residual, _noise(readings, variance), counts)


def _noise(readings: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """Expected rms residual of 16 elements fitted to the readings (..., N), over their mean."""
    count = readings.shape[-1]
    with np.errstate(divide="ignore", invalid="ignore"):
        values: np.ndarray = np.sqrt(variance.mean(axis=-1) * (count - 16) / count) / np.abs(
            readings.mean(axis=-1)
        )
        return values


def mueller_of_table(path: str | Path, instrument: Instrument) -> MuellerMeans:
    """Mueller matrices from the table of readings that the module's text describes.

    Raises
    ------
    DataError
        Names the file, and line and column where there is one.
    """
    table = read_table(Path(path))
    table.require_rows()
    used = {key: _one_of(table, names) for key, names in (
        ("generator", _GENERATOR), ("analyzer", _ANALYZER), ("reading", _READING), ("std", _READING_STD)
    )}  # fmt: skip
    if used["reading"] is None:
        raise DataError(
            f"{table.path}: there is no column {_READING[0]}; the columns are {', '.join(table.names)}"
        )
    if (used["generator"] is None) != (used["analyzer"] is None):
        raise DataError(f"{table.path}: give {_GENERATOR[0]} and {_ANALYZER[0]}, or neither")
    others = [name for name in used.values() if name is not None]
    geometry = [name for name in table.names if name not in others and name != "series"]
    sets: dict[tuple[str, ...], list[int]] = {}
    keys = ["series"] if "series" in table.names else geometry
    columns = [table.column(name) for name in keys]
    for row, cells in enumerate(table.rows):
        sets.setdefault(tuple(cells[c] for c in columns), []).append(row)
    names = (
        tuple(key[0] for key in sets)
        if keys == ["series"]
        else (table.path.stem,)
        if len(sets) == 1
        else tuple(str(k + 1) for k in range(len(sets)))
    )
    angles = None
    if geometry:
        angles = angles_of(table.taken([rows[0] for rows in sets.values()]), [*others, "series"], names)
        for rows in sets.values():
            _require_one_geometry(table, rows, geometry)
    parts = [
        _solved(table.taken(rows), used, name, instrument)
        for name, rows in zip(names, sets.values(), strict=True)
    ]
    mueller, covariance, residual, noise = (np.stack([part[k] for part in parts]) for k in range(4))
    counts = tuple({"good": len(rows), "saturated": 0, "dead": 0} for rows in sets.values())
    return MuellerMeans(names, mueller, covariance, residual, noise, counts, angles)


def _one_of(table: Table, names: Sequence[str]) -> str | None:
    found = [name for name in table.names if name.lower() in names]
    if len(found) > 1:
        raise DataError(f"{table.path}: the columns {' and '.join(map(repr, found))} say the same: leave one")
    return found[0] if found else None


def _require_one_geometry(table: Table, rows: Sequence[int], geometry: Sequence[str]) -> None:
    for name in geometry:
        column = table.column(name)
        odd = next((r for r in rows if table.rows[r][column] != table.rows[rows[0]][column]), None)
        if odd is not None:
            raise DataError(
                f"{table.place(odd, column)}: {table.rows[odd][column]}, but the series began with "
                f"{table.rows[rows[0]][column]}: a series is measured at one geometry"
            )


def _solved(
    table: Table, used: Mapping[str, str | None], name: str, instrument: Instrument
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Matrix, covariance, residual and its part that is noise, of one set of readings."""

    def numbers(key: str) -> np.ndarray | None:
        column = used[key]
        return None if column is None else table.numbers(table.column(column))

    readings, first, second, std = (numbers(key) for key in ("reading", "generator", "analyzer", "std"))
    assert readings is not None
    if not np.isfinite(readings).all():
        row = int(np.flatnonzero(~np.isfinite(readings))[0])
        raise DataError(f"{table.path}: line {table.lines[row]}: the reading is not a finite number")
    generator, analyzer = _generator(instrument), instrument.polarimeter.mean_analyzer
    if first is not None and second is not None:
        settings = instrument.generator.settings if instrument.generator is not None else {}
        turned = {key: float(np.deg2rad(settings[key])) for key in _SETTINGS}
        made, source = dual_rotating_retarder(
            np.deg2rad(first),
            np.deg2rad(second),
            generator_retardance=turned["generator_retardance"],
            analyzer_retardance=turned["analyzer_retardance"],
            polarizer=turned["polarizer"],
            analyzer=turned["analyzer"],
            diattenuation=settings["diattenuation"],
        )
        generator, analyzer = source.stokes, made.analyzer
    elif len(readings) != len(generator):
        raise DataError(
            f"{table.path}: series {name!r} has {len(readings)} readings for the {len(generator)} states of the "
            f"instrument: give the angles of each, {_GENERATOR[0]} and {_ANALYZER[0]}"
        )
    try:
        solved = solve_mueller(readings, None if std is None else std**2, generator, analyzer)
    except DataError as error:
        raise DataError(f"{table.path}: series {name!r}: {error}") from None
    return *solved, np.array(np.nan) if std is None else _noise(readings, std**2)


def _generator(instrument: Instrument) -> np.ndarray:
    if instrument.generator is None:
        raise DataError(f"{instrument.polarimeter.name} has no generator: it measures Stokes vectors")
    return instrument.generator.stokes


def mueller_dataset(
    means: MuellerMeans, instrument: Instrument, angles: AngleTable, *, attrs: Mapping[str, Any] | None = None
) -> xr.Dataset:
    """A data set of Mueller matrices in the axes (p, s) of the incident and the reflected ray.

    Parameters
    ----------
    means
        What was found.
    instrument
        How generator and analyser stand.
    angles
        One row for each series, in any order.
    attrs
        Further attributes of the data set.

    Returns
    -------
    xarray.Dataset
        ``mueller`` in digital numbers divided by the exposure, with standard uncertainties where they are known.

    Raises
    ------
    DataError
        If the angles are not those of these series, or no series has a good pixel.
    """
    unseen = [name for name in angles.names if name not in means.names]
    if unseen:
        raise DataError(
            f"the angle table has rows for {', '.join(map(repr, unseen))}, of which there are no readings"
        )
    used = np.isfinite(means.mueller).all(axis=(1, 2))
    if not used.any():
        raise DataError("no series has a good pixel: there is nothing to make a data set of")
    table = angles.rows([name for name, good in zip(means.names, used, strict=True) if good])
    own = np.asarray(table.reference_angle)
    assert instrument.generator is not None
    scale = np.asarray(table.exposure)
    mueller, covariance = mueller_to_surface_axes(
        means.mueller[used] / scale[:, None, None],
        means.covariance[used] / scale[:, None, None] ** 2,
        instrument.generator.reference_angle,
        np.where(np.isnan(own), instrument.reference_angle, own),
    )
    std = np.sqrt(np.maximum(np.einsum("gii->gi", covariance), 0.0)).reshape(-1, 4, 4)
    known = np.isfinite(std).all()
    return make_dataset(
        table.theta_i,
        table.theta_r,
        np.asarray(table.phi),
        quantity="dn",
        mueller=mueller,
        std={"mueller": std} if known else {},
        wavelength=table.wavelength,
        group=table.group,
        attrs={"instrument": instrument.polarimeter.name, **(attrs or {})},
    )
