"""Whole pBRDF models: formulas of ``pbrdf.optics`` composed, with named, bounded, documented parameters."""

from __future__ import annotations

from pbrdf.models.base import Model, load_model
from pbrdf.models.double_gauss import DoubleGauss, ReciprocalDoubleGauss
from pbrdf.models.parameters import Parameter

__all__ = ["MODELS", "DoubleGauss", "Model", "Parameter", "ReciprocalDoubleGauss", "load_model"]

#: Every model by the name that files and the command line use.
MODELS: dict[str, type[Model]] = {model.name: model for model in (DoubleGauss, ReciprocalDoubleGauss)}
