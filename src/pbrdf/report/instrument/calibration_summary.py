"""A calibration in words and numbers, and the table of its inputs."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pbrdf.files.atomic import atomic_file
from pbrdf.instruments.calibration.analyzer_calibration import Calibration
from pbrdf.instruments.calibration.settings_calibration import ModelCalibration
from pbrdf.optics.angles import within_half_turn
from pbrdf.optics.stokes import STOKES, aolp, docp, dolp
from pbrdf.report.instrument.polarimeter_summary import merit_table, vector_table
from pbrdf.report.numbers import brief, per_cent, with_error
from pbrdf.report.printing import plain_table, print_parts

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.table import Table

    from pbrdf.instruments.calibration.instrument_calibration import InstrumentCalibration

__all__ = ["angle_errors", "print_calibration", "write_inputs"]

#: Light less linearly polarised than this has no angle to speak of.
_NO_ANGLE = 0.05


def print_calibration(made: InstrumentCalibration, console: Console) -> None:
    """Print the analyser vectors or settings, the accuracy beside the nominal instrument's, and figures of merit."""
    print_parts(_parts(made), console)


def _parts(made: InstrumentCalibration) -> Iterator[RenderableType]:
    found, polarimeter = made.calibration, made.instrument.polarimeter
    counts = made.readings.counts()
    bad = ", ".join(f"{kind} {count}" for kind, count in counts.items() if kind != "good" and count)
    yield (
        f"{len(made.inputs.names)} inputs of {polarimeter.size} states; {counts['good']} of "
        f"{int(made.readings.used.sum())} pixels are good at all of them{f' ({bad})' if bad else ''}"
    )
    if polarimeter.is_map:
        filled = int(found.filled.sum()) if isinstance(found, Calibration) else 0
        rows, columns = polarimeter.analyzer.shape[:2]
        yield f"Map of {rows} × {columns} cells" + (
            f", of which {filled} without a good pixel take the nearest one's vectors" if filled else ""
        )
    yield f"The intensity 1 of the table is {brief(made.level)} digital numbers."
    if isinstance(found, ModelCalibration):
        yield _settings(found)
    covariance = None if isinstance(found, ModelCalibration) else found.covariance
    yield vector_table(polarimeter, covariance)
    yield _accuracy(made)
    own = found.accuracy
    if own is not None:
        noise = dict(zip(("linear", "circular"), map(per_cent, made.noise), strict=True))
        words = ", ".join(f"{k} {v}" for k, v in noise.items() if v != "–")
        yield f"The noise of these readings alone makes: {words}."
    known = made.inputs.accuracy
    if any(known):
        written = polarimeter.accuracy
        circular = (
            f", circular {per_cent(known[1])} and {per_cent(written[1])}" if polarimeter.determined[3] else ""
        )
        yield (
            f"The light itself is known to {per_cent(known[0])} of Q and U, which all inputs share; with it the "
            f"accuracy written is {per_cent(written[0])}{circular}."
        )
    yield merit_table({"calibrated": polarimeter, "nominal": made.nominal})
    intensity, linear, circular = (per_cent(share) for share in made.difference)
    yield (
        f"Rms difference from the nominal vectors, of their mean w_I: w_I {intensity}, w_Q and w_U {linear}, "
        f"w_V {circular}."
    )
    yield f"Residual of the readings: {per_cent(found.residual)} of their mean."


def _settings(found: ModelCalibration) -> Table:
    table = plain_table(
        "settings (angles and retardances in degrees)", "setting", "nominal", "fitted", "change"
    )
    table.add_column("", justify="left")
    for name, value, error, start in zip(found.names, found.values, found.errors, found.start, strict=True):
        if name in found.fixed:
            table.add_row(name, brief(start, 6), brief(value, 6), "", f"held: {found.fixed[name]}")
        elif name.startswith("gain"):
            table.add_row(name, "", with_error(value, error), "", "")
        else:
            table.add_row(name, brief(start, 6), with_error(value, error), brief(value - start, 3), "")
    return table


def _accuracy(made: InstrumentCalibration) -> RenderableType:
    own, nominal = made.calibration.accuracy, made.nominal_accuracy
    if own is None or nominal is None:
        return "No accuracy: no input was held out."
    count = len(made.inputs.names)
    each = "each held out in turn" if own.inputs > count // 2 else "held out"
    table = plain_table(
        f"rms errors at {own.inputs} inputs, {each}", "of", "calibrated", "nominal instrument"
    )
    for name, key in (
        ("Q/I and U/I (linear)", "linear"),
        ("V/I (circular)", "circular"),
        ("DoLP", "dolp"),
        ("DoCP", "docp"),
    ):
        if np.isfinite(getattr(own, key)):
            table.add_row(name, per_cent(getattr(own, key)), per_cent(getattr(nominal, key)))
    angles = [
        angle_errors(f, made.inputs.stokes)[list(made.calibration.held_out)]
        for f in (made.calibration.found, made.nominal_found)
    ]
    if np.isfinite(angles[0]).any():
        table.add_row("AoLP", *(f"{brief(float(np.rad2deg(np.sqrt(np.nanmean(a**2)))), 2)}°" for a in angles))
    return table


def angle_errors(found: np.ndarray, stokes: np.ndarray) -> np.ndarray:
    """Errors of the AoLP, radians in (−π/2, π/2], shape (K, ...); NaN for light that is hardly linearly polarised.

    Parameters
    ----------
    found, stokes
        Shapes (4, K, ...) and (4, K).
    """
    true = np.reshape(stokes, (*stokes.shape, *(1,) * (found.ndim - 2)))
    difference = aolp(np.moveaxis(found, 0, -1)) - aolp(np.moveaxis(true, 0, -1))
    wrapped = within_half_turn(difference, 0.5 * np.pi)
    return np.where(np.hypot(true[1], true[2]) > _NO_ANGLE * true[0], wrapped, np.nan)


def write_inputs(made: InstrumentCalibration, path: Path) -> None:
    """Write a CSV table of the inputs: known light, and what the calibrated and the nominal instrument find.

    Of a map, the means over the cells. Stokes parameters relative to the known intensity, angles in degrees.

    Raises
    ------
    DataError
        If the file cannot be written.
    """
    S = made.inputs.stokes
    header = ["series", "use", "intensity_dn"]
    columns: list[np.ndarray] = []
    for name, vectors in (("known", S), ("found", made.calibration.found), ("nominal", made.nominal_found)):
        mean = _over_cells(vectors)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratios = mean / S[0]
        columns += list(ratios) if name != "known" else list(ratios[1:])
        header += [f"{name}_{c}" for c in (STOKES if name != "known" else STOKES[1:])]
        last = mean.T
        columns += [dolp(last), np.rad2deg(aolp(last)), docp(last)]
        header += [f"{name}_dolp", f"{name}_aolp_deg", f"{name}_docp"]
    out = made.calibration.held_out
    with atomic_file(path) as target, target.open("x", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        for k, name in enumerate(made.inputs.names):
            numbers = [repr(float(column[k])) for column in columns]
            writer.writerow([name, "verified" if k in out else "calibrated", repr(float(S[0, k])), *numbers])


def _over_cells(vectors: np.ndarray) -> np.ndarray:
    """Stokes vectors (4, K) as they are, or means (4, K) over the cells of a map (4, K, rows, columns)."""
    if vectors.ndim == 2:
        return vectors
    known = np.isfinite(vectors[0])
    total = np.where(known, vectors, 0.0).sum(axis=(2, 3))
    values: np.ndarray = total / known.sum(axis=(1, 2))
    return values
