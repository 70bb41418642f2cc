"""Picture of a calibration: known light and what the instrument makes of it, before and after."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.instruments.calibration.analyzer_calibration import input_errors
from pbrdf.instruments.polarimeter.merit import condition_number
from pbrdf.report.instrument.calibration_summary import angle_errors
from pbrdf.report.numbers import per_cent
from pbrdf.report.style import BLUE, GREY, RED, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pbrdf.instruments.calibration.instrument_calibration import InstrumentCalibration

__all__ = ["calibration_figure"]

#: Longest arrow that an error is drawn as, in units of the degree of polarisation.
_LONGEST = 0.35
_MAGNIFICATIONS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
#: Errors smaller than this share of the largest one shown are drawn at the lower edge.
_RANGE = 1e-3
_LOOKS = (("nominal", RED, "s"), ("calibrated", BLUE, "o"))


def calibration_figure(made: InstrumentCalibration, name: str) -> Figure:
    """Input states with their errors magnified, the errors of DoLP, AoLP and DoCP input by input, and maps if any.

    Errors are those of inputs held out, where they were; of a map their rms over the cells.

    Parameters
    ----------
    made
        The calibration.
    name
        What to call it.
    """
    polarimeter = made.instrument.polarimeter
    circular = bool(polarimeter.determined[3])
    lit = np.flatnonzero(made.inputs.stokes[0] > 0.0)
    both = {"nominal": made.nominal_found[:, lit], "calibrated": made.calibration.found[:, lit]}
    S = made.inputs.stokes[:, lit]
    with styled():
        rows = 2 if polarimeter.is_map else 1
        figure = new_figure(13.0 if circular else 10.0, 5.2 + 3.6 * (rows - 1))
        parts = figure.subfigures(rows, 1, height_ratios=(5.2, 3.6)[:rows], squeeze=False)[:, 0]
        grid = parts[0].add_gridspec(
            3 if circular else 2, 3 if circular else 2, width_ratios=(1.0,) * (2 + circular)
        )
        planes = [(1, 2), (1, 3)] if circular else [(1, 2)]
        factor = _magnification(both, S)
        for column, plane in enumerate(planes):
            _draw_states(parts[0].add_subplot(grid[:, column]), both, S, plane, factor)
        _draw_errors(
            parts[0],
            grid,
            both,
            S,
            [made.inputs.names[k] for k in lit],
            lit,
            made.calibration.held_out,
            circular,
        )
        accuracy = made.calibration.accuracy
        words = "not verified"
        if accuracy is not None:
            words = f"at inputs held out: linear {per_cent(accuracy.linear)}" + (
                f", circular {per_cent(accuracy.circular)}" if circular else ""
            )
        figure.suptitle(f"{name}: rms error {words}" if accuracy is not None else f"{name}: {words}")
        handles, labels = parts[0].axes[0].get_legend_handles_labels()
        parts[0].legend(handles, labels, loc="outside lower left", ncols=4, frameon=False)
        if polarimeter.is_map:
            _draw_maps(parts[1], made, circular)
        return figure


def _mean_ratios(found: np.ndarray) -> np.ndarray:
    """Q/I, U/I, V/I, shape (3, K); over a map the mean of its cells."""
    ratios = found[1:] / found[0]
    values: np.ndarray = (
        ratios if ratios.ndim == 2 else np.nanmean(np.where(np.isfinite(ratios), ratios, np.nan), axis=(2, 3))
    )
    return values


def _magnification(both: dict[str, np.ndarray], S: np.ndarray) -> int:
    known = S[1:] / S[0]
    largest = max(np.nanmax(np.abs(_known_parts(_mean_ratios(found) - known))) for found in both.values())
    return max((m for m in _MAGNIFICATIONS if m * largest <= _LONGEST), default=1)


def _known_parts(errors: np.ndarray) -> np.ndarray:
    """Without a component that is not measured."""
    values: np.ndarray = errors[np.isfinite(errors).any(axis=1)]
    return values


def _draw_states(
    ax: Axes, both: dict[str, np.ndarray], S: np.ndarray, plane: tuple[int, int], factor: int
) -> None:
    from matplotlib.patches import Circle

    ax.add_patch(Circle((0.0, 0.0), 1.0, fill=False, edgecolor=GREY, linewidth=0.8))
    known = S[1:] / S[0]
    x, y = known[plane[0] - 1], known[plane[1] - 1]
    ax.plot(
        x,
        y,
        "o",
        markersize=7,
        markerfacecolor="white",
        markeredgecolor="black",
        label="known light",
        zorder=3,
    )
    for name, colour, marker in _LOOKS:
        error = factor * (_mean_ratios(both[name]) - known)
        dx, dy = error[plane[0] - 1], error[plane[1] - 1]
        label = f"{name} instrument, error × {factor}"
        ax.plot(np.stack([x, x + dx]), np.stack([y, y + dy]), color=colour, linewidth=1.3, zorder=2)
        ax.plot(x + dx, y + dy, marker, color=colour, markersize=3.5, linestyle="none", label=label, zorder=4)
    ax.set_aspect("equal")
    ax.set_xlim(-1.3, 1.3)
    ax.set_ylim(-1.3, 1.3)
    letters = "?QUV"
    ax.set_xlabel(f"{letters[plane[0]]}/I")
    ax.set_ylabel(f"{letters[plane[1]]}/I" + (" (> 0: left circular)" if plane[1] == 3 else ""))


def _draw_errors(
    figure: Any,
    grid: Any,
    both: dict[str, np.ndarray],
    S: np.ndarray,
    names: list[str],
    lit: np.ndarray,
    held_out: tuple[int, ...],
    circular: bool,
) -> None:
    kinds = ["DoLP", "AoLP (°)", "DoCP"][: 3 if circular else 2]
    place = np.arange(len(names))
    axes: list[Axes] = []
    for row, kind in enumerate(kinds):
        ax = figure.add_subplot(grid[row, -1], sharex=axes[0] if axes else None)
        axes.append(ax)
        shown = {n: _rms_over_cells(_error(kind, found, S)) for n, found in both.items()}
        finite = np.concatenate([v[np.isfinite(v)] for v in shown.values()])
        top = finite.max() if finite.size and finite.max() > 0.0 else 1.0
        floor = max(finite[finite > 0.0].min() if (finite > 0.0).any() else 0.0, _RANGE * top)
        for n, colour, marker in _LOOKS:
            ax.plot(
                place, np.maximum(shown[n], floor), marker, color=colour, markersize=4.5, linestyle="none"
            )
            ax.axhline(
                np.sqrt(np.nanmean(shown[n] ** 2)) if finite.size else np.nan,
                color=colour,
                linewidth=0.9,
                linestyle="--",
            )
        ax.set_yscale("log")
        ax.set_ylim(min(0.5 * floor, 0.05 * top), 2.5 * top)
        ax.yaxis.set_minor_formatter("")
        ax.set_ylabel(kind)
        ax.tick_params(axis="x", labelbottom=row == len(kinds) - 1)
    axes[0].set_title("size of the error, input by input (dashed: rms)", fontsize=9.5)
    labels = [n if k in held_out or not held_out else f"{n} *" for n, k in zip(names, lit, strict=True)]
    axes[-1].set_xticks(place, labels, rotation=90, fontsize=8.0)
    if len(names) > 30:
        axes[-1].set_xticks(place[:: len(names) // 15], labels[:: len(names) // 15])
    if any(label.endswith(" *") for label in labels):
        axes[-1].set_xlabel("* took part in the calibration", fontsize=9.0)


def _error(kind: str, found: np.ndarray, S: np.ndarray) -> np.ndarray:
    errors: np.ndarray = (
        np.rad2deg(angle_errors(found, S))
        if kind.startswith("AoLP")
        else input_errors(found, S)[3 if kind == "DoLP" else 4]
    )
    return errors


def _rms_over_cells(errors: np.ndarray) -> np.ndarray:
    """Absolute values (K,), or rms over the cells of (K, rows, columns)."""
    sizes: np.ndarray
    if errors.ndim == 1:
        sizes = np.abs(errors)
        return sizes
    known = np.isfinite(errors)
    total = np.where(known, errors, 0.0) ** 2
    with np.errstate(invalid="ignore"):
        sizes = np.sqrt(total.sum(axis=(1, 2)) / known.sum(axis=(1, 2)))
    return sizes


def _draw_maps(figure: Any, made: InstrumentCalibration, circular: bool) -> None:
    """Condition number and rms errors of the cells."""
    out = list(made.calibration.held_out)
    out = [k for k in out if made.inputs.stokes[0, k] > 0.0]
    squares = input_errors(made.calibration.found[:, out], made.inputs.stokes[:, out]) ** 2
    maps = [("condition number, 2-norm", condition_number(made.instrument.polarimeter.analyzer, "2"))]
    if out:
        maps.append(("rms error of Q/I and U/I (%)", 100.0 * np.sqrt(squares[:2].mean(axis=(0, 1)))))
        if circular:
            maps.append(("rms error of V/I (%)", 100.0 * np.sqrt(squares[2].mean(axis=0))))
    axes = figure.subplots(1, len(maps), squeeze=False)[0]
    rows, columns = made.readings.flags.shape
    for ax, (title, values) in zip(axes, maps, strict=True):
        shown = ax.imshow(values, extent=(0, columns, rows, 0), cmap="viridis", interpolation="nearest")
        figure.colorbar(shown, ax=ax, shrink=0.9)
        ax.set_title(title, fontsize=9.5)
        ax.grid(False)
        ax.set_facecolor("#B0B0B0")
        ax.set_xlabel("x, pixels")
    axes[0].set_ylabel("y, pixels")
