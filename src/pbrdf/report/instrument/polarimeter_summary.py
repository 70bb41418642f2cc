"""A polarimeter in words and numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from pbrdf.instruments.polarimeter.merit import Merit, merit
from pbrdf.optics.stokes import STOKES
from pbrdf.report.numbers import brief, per_cent, with_error
from pbrdf.report.printing import plain_table

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from pbrdf.instruments.polarimeter.instrument import Instrument
    from pbrdf.instruments.polarimeter.polarimeter import Polarimeter

__all__ = ["merit_table", "print_polarimeter", "vector_table"]


def print_polarimeter(instrument: Instrument, console: Console) -> None:
    """Print what an instrument measures, its analyser vectors, figures of merit, accuracy and detector."""
    polarimeter, detector = instrument.polarimeter, instrument.detector
    seen = [name for name, known in zip(STOKES, polarimeter.determined, strict=True) if known]
    cells = ""
    if polarimeter.is_map:
        cells = " in {} × {} cells of the field".format(*polarimeter.analyzer.shape[:2])
    console.print(
        f"{polarimeter.name}: {polarimeter.size} states{cells}, measures {', '.join(seen) or 'no component by itself'}",
        markup=False,
    )
    console.print(vector_table(polarimeter))
    console.print(merit_table({"this instrument": polarimeter}))
    linear, circular = polarimeter.accuracy
    stated = f"linear {per_cent(linear)}" + (f", circular {per_cent(circular)}" if seen[3:] else "")
    console.print(f"Accuracy of the calibration: {stated if any(polarimeter.accuracy) else 'not stated'}")
    console.print(
        f"Mounted at {brief(float(np.rad2deg(instrument.reference_angle)))}° from p; source stable to "
        f"{per_cent(instrument.stability)}"
    )
    console.print(
        f"Detector: {detector.bits} bits, {brief(detector.gain)} electrons per digital number, read noise "
        f"{brief(detector.read_noise)}, black level {brief(detector.black)}, saturated at "
        f"{brief(detector.saturation, 6)}"
    )


def vector_table(polarimeter: Polarimeter, covariance: np.ndarray | None = None) -> Table:
    """A table of analyser vectors, with standard errors (covariance (N, 4, 4)); of a map mean and range over cells."""
    W = polarimeter.analyzer
    words = ", mean (least…largest) over the field" if polarimeter.is_map else ""
    table = plain_table(f"analyser vectors{words}", "state", *(f"w_{name}" for name in STOKES))
    for j, state in enumerate(polarimeter.states):
        cells = []
        for i in range(4):
            values = W[..., j, i]
            if polarimeter.is_map:
                spread = f"{values.min():.3f}…{values.max():.3f}"
                cells.append(f"{values.mean():.3f} ({spread})".replace("-", "−"))
            elif covariance is None:
                # a true zero has no sign
                cells.append(f"{round(float(values), 5) + 0.0:.5f}".replace("-", "−"))
            else:
                cells.append(with_error(float(values), float(np.sqrt(max(covariance[j, i, i], 0.0)))))
        table.add_row(state, *cells)
    return table


def merit_table(instruments: dict[str, Polarimeter]) -> Table:
    """Figures of merit of polarimeters of as many states side by side; of a map the median and the worst cell.

    The best possible ones are those of perfect analysers spread evenly over the Poincaré sphere (Foreman & Goudail,
    Optical Engineering 58, 082410 (2019)) or, without V, over its equator: WᵀW has then the eigenvalues N/4 and, for
    each other component, N/4 over their number.
    """
    found = {name: merit(polarimeter) for name, polarimeter in instruments.items()}
    first, size = next(iter(found.values())), next(iter(instruments.values())).size
    table = plain_table("figures of merit", "of", *found, "best possible")
    others = first.rank - 1
    variance = 4.0 * (1.0 + others**2) / size
    rows: tuple[tuple[str, Callable[[Merit], np.ndarray], float], ...] = (
        ("condition number, 2-norm", lambda m: m.condition["2"], np.sqrt(others)),
        (
            "condition number, Frobenius norm",
            lambda m: m.condition["frobenius"],
            np.sqrt(0.5 * size * variance),
        ),
        ("equally weighted variance tr(WᵀW)⁻¹", lambda m: m.equally_weighted_variance, variance),
    )
    known = first.determined in (STOKES, STOKES[:3])
    for name, value, optimum in rows:
        cells = [_worst(np.asarray(value(m))) for m in found.values()]
        table.add_row(name, *cells, brief(float(optimum)) if known else "")
    for i, component in enumerate(STOKES):
        if component in first.determined:
            cells = [_worst(m.variance[..., i]) for m in found.values()]
            table.add_row(f"variance of {component}", *cells, "")
    if first.note:
        table.caption, table.caption_justify = first.note, "left"
    return table


def _worst(values: np.ndarray) -> str:
    """A number, or the median over a map with the largest."""
    if values.ndim == 0 or np.ptp(values) == 0.0:
        return brief(float(values.flat[0]))
    return f"{brief(float(np.median(values)))} (worst {brief(float(values.max()))})"
