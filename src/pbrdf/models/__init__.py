"""Whole pBRDF models: formulas of ``pbrdf.optics`` composed, with named, bounded, documented parameters."""

from __future__ import annotations

from pbrdf.models.base import Model
from pbrdf.models.double_gauss import DoubleGauss, ReciprocalDoubleGauss
from pbrdf.models.parameters import Option, Parameter
from pbrdf.models.registry import MODELS, find_model, load_model, register

__all__ = [
    "MODELS",
    "DoubleGauss",
    "Model",
    "Option",
    "Parameter",
    "ReciprocalDoubleGauss",
    "find_model",
    "load_model",
    "register",
]

register(DoubleGauss)
register(ReciprocalDoubleGauss)
