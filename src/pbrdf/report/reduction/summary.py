"""What a reduction found in numbers: one row for each series and region, as a table to read and as a CSV file."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pbrdf.data.schema import std_name
from pbrdf.instruments.polarimeter.polarization_errors import debiased_dolp, polarization
from pbrdf.instruments.reduction.region_averages import RegionAverage
from pbrdf.optics.stokes import STOKES

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["print_averages", "write_averages"]

_MASKED = ("saturated", "dead", "dark")
#: More rows than this are not printed.
_MOST_ROWS = 40
#: Share of saturated pixels from which on the mean of a region is called too low.
_MANY_SATURATED = 0.01


def write_averages(averages: Mapping[str, Sequence[RegionAverage]], names: Sequence[str], path: Path) -> None:
    """Write the averages as a CSV table: Stokes parameters in the instrument's axes, angles in degrees."""
    with path.open("x", encoding="utf-8", newline="") as file:
        writer: csv.DictWriter[str] | None = None
        for series, region, average in _rows(averages, names):
            row = _cells(series, region, average)
            if writer is None:
                writer = csv.DictWriter(file, list(row), lineterminator="\n")
                writer.writeheader()
            writer.writerow(row)


def _rows(
    averages: Mapping[str, Sequence[RegionAverage]], names: Sequence[str]
) -> list[tuple[str, str, RegionAverage]]:
    return [(name, region, means[k]) for k, name in enumerate(names) for region, means in averages.items()]


def _cells(series: str, region: str, average: RegionAverage) -> dict[str, str]:
    found = polarization(average.stokes, average.covariance)
    std = np.sqrt(np.diag(average.covariance))
    numbers = {
        **{
            key: value
            for k, name in enumerate(STOKES)
            for key, value in ((name, average.stokes[k]), (std_name(name), std[k]))
        },
        "dolp": found.dolp,
        "dolp_std": found.dolp_std,
        "dolp_debiased": debiased_dolp(average.stokes, average.covariance),
        "aolp_deg": np.rad2deg(found.aolp),
        "aolp_std_deg": np.rad2deg(found.aolp_std),
        "docp": found.docp,
        "docp_std": found.docp_std,
        "scatter_I": average.scatter[0],
    }
    return {
        "series": series,
        "region": region,
        "pixels": str(average.pixels),
        **{kind: str(count) for kind, count in average.counts.items()},
        **{name: repr(float(value)) for name, value in numbers.items()},
    }


def print_averages(
    averages: Mapping[str, Sequence[RegionAverage]], names: Sequence[str], console: Console
) -> None:
    """Print a table: pixels by what became of them, mean intensity and how much pixels differ in it,
    degree and angle of polarisation.

    The errors are those of the means; the scatter is the standard deviation of the pixels about theirs.
    """
    from rich.table import Table

    rows = _rows(averages, names)
    circular = any(np.isfinite(average.stokes[3]) for _, _, average in rows)
    table = Table(box=None, pad_edge=False, header_style="bold")
    several = len(names) > 1
    # columns of what never happened would only take place
    kinds = ["good", *(kind for kind in _MASKED if any(average.counts[kind] for _, _, average in rows))]
    for title in ("series", "region") if several else ("region",):
        table.add_column(title, overflow="fold")
    for title in (*kinds, "mean I", "scatter of I", "DoLP", "AoLP, °", *(["DoCP"] if circular else [])):
        table.add_column(title, justify="right", no_wrap=True)
    for series, region, average in rows[:_MOST_ROWS]:
        found = polarization(average.stokes, average.covariance)
        cells = [str(average.counts[kind]) for kind in kinds]
        cells.append(_with_error(average.stokes[0], np.sqrt(average.covariance[0, 0])))
        cells.append(f"{average.scatter[0]:.2g}" if np.isfinite(average.scatter[0]) else "–")
        cells.append(_with_error(found.dolp, found.dolp_std))
        cells.append(_with_error(np.rad2deg(found.aolp), np.rad2deg(found.aolp_std)))
        if circular:
            cells.append(_with_error(found.docp, found.docp_std))
        table.add_row(*([series] if several else []), region, *cells)
    console.print(table)
    if len(rows) > _MOST_ROWS:
        console.print(f"… {len(rows) - _MOST_ROWS} more rows in summary.csv")
    for warning in _warnings(rows):
        console.print(warning, markup=False)


def _with_error(value: float | np.ndarray, error: float | np.ndarray) -> str:
    """A number with its standard error, to two digits of the error."""
    value, error = float(value), float(error)
    if not np.isfinite(value):
        return "–"
    if not (np.isfinite(error) and error > 0.0):
        return f"{value:.4g}"
    places = max(1 - int(np.floor(np.log10(error))), 0)
    return f"{value:.{places}f} ± {error:.{places}f}"


def _warnings(rows: Sequence[tuple[str, str, RegionAverage]]) -> list[str]:
    bright = [r for r in rows if r[2].pixels and r[2].counts["saturated"] > _MANY_SATURATED * r[2].pixels]
    if not bright:
        return []
    worst = max(bright, key=lambda row: row[2].counts["saturated"] / row[2].pixels)
    share = worst[2].counts["saturated"] / worst[2].pixels
    return [
        f"Saturated pixels are left out, which makes the mean of the others too low: {share:.1%} of {worst[1]!r} in "
        f"{worst[0]!r}" + (f", and {len(bright) - 1} more" if len(bright) > 1 else "") + "."
    ]
