"""Parameters from measurements: the batched solver, starts, noise, uncertainty and held-out validation."""

from __future__ import annotations

from pbrdf.inversion.fit import Estimate, FitResult, Optimum, fit
from pbrdf.inversion.holdout import HoldOut, Prediction
from pbrdf.inversion.noise import NoiseModel
from pbrdf.inversion.observations import Observations

__all__ = ["Estimate", "FitResult", "HoldOut", "NoiseModel", "Observations", "Optimum", "Prediction", "fit"]
