"""How well a material's model describes the specimens that it was made of.

A model that misses its own specimens by more than their uncertainties misses every measurement of the material by as
much. The likelihoods of :mod:`pbrdf.identification.evidence` know of noise and of scatter between specimens only: they
take what the model misses for a difference between materials. A library therefore keeps what its fits missed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pbrdf.data.schema import is_ratio
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.optimum import Optimum
from pbrdf.inversion.verdict import Level, verdict

__all__ = ["SpecimenFits", "relative_noise"]

#: χ² by degree of freedom beyond which what a model misses is no longer lost in the noise: it is as large as that.
MISFIT = 2.0


@dataclass(frozen=True)
class SpecimenFits:
    """What the fits behind a material are worth.

    Attributes
    ----------
    reduced_chi2
        χ² by degree of freedom, median over the specimens; NaN where it is not known.
    missed
        Noise that would explain what the model misses: that of the fitted data (:func:`relative_noise`) times the root
        of χ² by degree of freedom, median over the specimens; NaN where it is not known.
    cautions
        A sentence on each fit that describes its data only in part, or not, or whose parameters are not to be quoted.
    """

    reduced_chi2: float = math.nan
    missed: float = math.nan
    cautions: tuple[str, ...] = ()

    @classmethod
    def of(cls, fits: Sequence[Optimum], labels: Sequence[str]) -> SpecimenFits:
        """Judge the fits of specimens, called by the labels."""
        cautions = []
        for fit, label in zip(fits, labels, strict=True):
            judged = verdict(fit)
            if judged.level is not Level.DESCRIBES or judged.do_not_quote:
                cautions.append(f"{label}: {judged.sentence}")
        return cls(
            _median([fit.goodness.reduced_chi2 for fit in fits]),
            _median([_missed(fit) for fit in fits]),
            tuple(cautions),
        )

    def misfits(self, noise: float = math.nan) -> bool:
        """Whether the model misses its own specimens by more than noise explains.

        Parameters
        ----------
        noise
            Of a measurement that is to be compared, see :func:`relative_noise`; NaN where it is not known. What the
            model misses is no harm where it is less than that.
        """
        return self.reduced_chi2 > MISFIT and not self.missed <= noise


def relative_noise(data: Observations) -> float:
    """Uncertainty of the intensity relative to it, or of the ratios where there are only these; NaN if not known.

    The median over the geometries: robust against the dark ones, where it has no limit.
    """
    channels = [c for c, name in enumerate(data.channels) if name in ("I", "m00")]
    if not channels:
        std = data.std[np.isfinite(data.std)]
        return float(np.median(std)) if std.size and all(map(is_ratio, data.channels)) else math.nan
    values, std = data.values[channels[0]], data.std[channels[0]]
    there = np.isfinite(std) & (values > 0.0)
    return float(np.median(std[there] / values[there])) if there.any() else math.nan


def _missed(fit: Optimum) -> float:
    return relative_noise(fit.data) * math.sqrt(max(fit.goodness.reduced_chi2, 0.0))


def _median(values: Sequence[float]) -> float:
    known = [value for value in values if math.isfinite(value)]
    return float(np.median(known)) if known else math.nan
