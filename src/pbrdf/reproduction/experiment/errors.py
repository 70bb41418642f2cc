"""Errors of the inverted model against the simulated measurement, in the paper's terms."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pbrdf.reproduction.experiment.sample import Sample

__all__ = ["ErrorNumbers", "PositionErrors", "error_numbers", "position_errors"]


@dataclass(frozen=True)
class ErrorNumbers:
    """Errors of one quantity over all points of a sample, model − measured.

    Attributes
    ----------
    std
        Standard deviation about the mean; digital numbers for the intensity.
    largest
        Error of the largest size, with its sign.
    share
        The same in units of the measured value there.
    position, angle
        Camera position and sample angle (degrees) of that point.
    """

    std: float
    largest: float
    share: float
    position: int
    angle: float


@dataclass(frozen=True)
class PositionErrors:
    """Relative errors, model/measured − 1, at the strongest points of one camera position.

    The strongest specular point is the one of the largest modelled value within the lobe (mirror facet tilted by less
    than 4 σ), the strongest diffuse point that of the largest outside; of the intensity for the intensity, of the
    degree of polarisation for that. (The largest measured degree would be that of the darkest point: noise
    polarises.) NaN where there is no such point.
    """

    position: int
    held_out: bool
    intensity_specular: float
    intensity_diffuse: float
    dolp_specular: float
    dolp_diffuse: float


def error_numbers(sample: Sample) -> tuple[ErrorNumbers, ErrorNumbers]:
    """Errors of the intensity (digital numbers) and of the degree of polarisation."""
    pairs = ((sample.intensity, sample.modelled_intensity), (sample.dolp, sample.modelled_dolp))
    intensity, degree = (_numbers(sample, measured, modelled) for measured, modelled in pairs)
    return intensity, degree


def _numbers(sample: Sample, measured: np.ndarray, modelled: np.ndarray) -> ErrorNumbers:
    error = modelled - measured
    known = np.flatnonzero(np.isfinite(error))
    worst = int(known[np.abs(error[known]).argmax()])
    return ErrorNumbers(
        std=float(error[known].std()),
        largest=float(error[worst]),
        share=float(error[worst] / measured[worst]) if measured[worst] else math.nan,
        position=int(sample.position[worst]),
        angle=float(np.rad2deg(sample.angle[worst])),
    )


def position_errors(sample: Sample) -> list[PositionErrors]:
    """Errors at the strongest points, one entry a camera position."""
    near = sample.near_specular
    rows = []
    for position in np.unique(sample.position):
        there = sample.position == position

        def at_strongest(
            measured: np.ndarray, modelled: np.ndarray, where: np.ndarray, there: np.ndarray = there
        ) -> float:
            rows = np.flatnonzero(there & where & (measured > 0.0))
            if not rows.size:
                return math.nan
            row = rows[modelled[rows].argmax()]
            return float(modelled[row] / measured[row] - 1.0)

        rows.append(
            PositionErrors(
                int(position),
                bool(sample.held_out[there].all()),
                at_strongest(sample.intensity, sample.modelled_intensity, near),
                at_strongest(sample.intensity, sample.modelled_intensity, ~near),
                at_strongest(sample.dolp, sample.modelled_dolp, near),
                at_strongest(sample.dolp, sample.modelled_dolp, ~near),
            )
        )
    return rows
