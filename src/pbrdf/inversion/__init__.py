"""Parameters from measurements: the batched solver, starts, noise, uncertainty and held-out validation."""

from __future__ import annotations

from pbrdf.inversion.crossvalidation import cross_validate
from pbrdf.inversion.erroranalysis import error_analysis
from pbrdf.inversion.estimates import DistinctOptimum, Estimate
from pbrdf.inversion.fit import fit
from pbrdf.inversion.holdout import HoldOut, Prediction
from pbrdf.inversion.noise import EqualNoise, InstrumentNoise, NoiseModel
from pbrdf.inversion.nuisance import Nuisance
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.optimum import Optimum
from pbrdf.inversion.plausibility import plausibility
from pbrdf.inversion.result import FitResult

__all__ = [
    "DistinctOptimum",
    "EqualNoise",
    "Estimate",
    "FitResult",
    "HoldOut",
    "InstrumentNoise",
    "NoiseModel",
    "Nuisance",
    "Observations",
    "Optimum",
    "Prediction",
    "cross_validate",
    "error_analysis",
    "fit",
    "plausibility",
]
