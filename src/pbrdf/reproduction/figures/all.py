"""The figures of the report by name, made when they are asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from pbrdf.reproduction.experiment.sample import Sample
from pbrdf.reproduction.figures.angles import dop_figure, intensity_figure
from pbrdf.reproduction.figures.errors import dop_error_figure, intensity_error_figure
from pbrdf.reproduction.figures.polar import polar_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["ERROR_SAMPLE", "pictures"]

#: The sample whose errors the paper shows.
ERROR_SAMPLE = 3


def pictures(samples: Sequence[Sample], positions: Sequence[float]) -> dict[str, Callable[[], Figure]]:
    """Makers of the figures by the name of their files.

    Parameters
    ----------
    samples
        The inverted samples.
    positions
        Bistatic angles of the camera positions, radians.
    """
    shown = next(sample for sample in samples if sample.number == ERROR_SAMPLE)
    return {
        "figure-3": polar_figure,
        "figure-5": lambda: intensity_figure(samples, positions),
        "figure-6": lambda: intensity_error_figure(shown, positions),
        "figure-7": lambda: dop_figure(samples, positions),
        "figure-8": lambda: dop_error_figure(shown, positions),
    }
