"""The figures of a fit, by name, with what to say of each: for the folder and for the page."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pbrdf.inversion.holdout import Prediction
    from pbrdf.report.fit.subject import Report

__all__ = ["Picture", "pictures"]


@dataclass(frozen=True)
class Picture:
    """A figure that was drawn.

    Attributes
    ----------
    name
        Of its files, without extension.
    figure
        The figure.
    alternative
        What it shows, for those who do not see it.
    caption
        How to read it.
    """

    name: str
    figure: Figure
    alternative: str
    caption: str


def pictures(report: Report) -> Iterator[Picture]:
    """Draw the figures of a fit one after the other; those that its data do not make are left out."""
    from pbrdf.report.fit.contour_figure import contour_figure
    from pbrdf.report.fit.figure import fit_figure
    from pbrdf.report.fit.hemisphere_figure import hemisphere_figure
    from pbrdf.report.fit.polarisation_figure import polarisation_figure
    from pbrdf.report.fit.starts_figure import starts_figure

    result = report.result
    what = f"{result.model.name} and {result.comparison.sizes['geometry']} measured geometries"
    errors = result.predicted or result.fitted
    found = f"{_error(errors)} ({'held out' if result.predicted else 'fitted'})"
    yield Picture(
        "figure",
        fit_figure(report),
        f"Intensity and, where measured, degree of linear polarisation of {what}: {found}.",
        "Points: measured. Lines: the fitted model. Open points and broken lines: held out, not fitted.",
    )
    elements = next((name for name in result.data.channels if name.startswith("m")), "")
    if (figure := polarisation_figure(report)) is not None:
        yield Picture(
            "polarisation",
            figure,
            f"Polarised light of {what}, a panel for each of {len(figure.axes)} quantities.",
            "Normalised Mueller elements in their places" + (", m00 itself." if elements == "m00" else ".")
            if elements
            else "Q = Ip − Is: negative as by reflection. The angle of polarisation is drawn where the polarised light "
            "stands out of its noise; 0° is p, 90° is s.",
        )
    if (figure := hemisphere_figure(report)) is not None:
        yield Picture(
            "hemisphere",
            figure,
            "Differences between model and measurement over the hemisphere of viewing directions.",
            "Red: the model is too bright (too polarised), blue: too dark. Forward is on the right, the normal in the "
            "centre.",
        )
    yield Picture(
        "starts",
        starts_figure(report),
        f"Where {'the only start' if result.starts == 1 else f'each of {result.starts} starts'} of the search began "
        "and ended, a panel for each free parameter.",
        "Lines that end in one point agree; those that end elsewhere found another optimum, or none.",
    )
    if report.checks is not None and report.checks.contours:
        yield Picture(
            "contours",
            contour_figure(report),
            "Joint confidence regions of "
            + "; ".join(f"{c.a} and {c.b}" for c in report.checks.contours)
            + ".",
            "What lies within a line is allowed by the data at its level.",
        )


def _error(errors: dict[str, Prediction]) -> str:
    """The error of the intensity, or where only ratios were measured, of these."""
    from pbrdf.report.numbers import brief, per_cent

    everything = errors.get("all")
    if everything is None or math.isfinite(everything.intensity_median):
        return f"median error of the intensity {per_cent(everything.intensity_median) if everything else '–'}"
    rms = everything.dolp_rms if math.isfinite(everything.dolp_rms) else everything.ratio_rms
    return f"rms error of the normalised polarisation {brief(rms, 2)}"
