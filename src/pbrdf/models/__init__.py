"""Whole pBRDF models: formulas of ``pbrdf.optics`` composed, with named, bounded, documented parameters."""

from __future__ import annotations

from pbrdf.models.base import Model
from pbrdf.models.coherent import InterferenceLacquer, MetallicLacquer, MirrorFacetsMRPV, MirrorHazeMRPV
from pbrdf.models.double_gauss import DoubleGauss, ReciprocalDoubleGauss
from pbrdf.models.hyde import HydeType
from pbrdf.models.microfacet import (
    CookTorranceLambert,
    GeneralisedGaussianMRPV,
    GGXLambert,
    PriestGermer,
)
from pbrdf.models.parameters import Option, Parameter
from pbrdf.models.registry import MODELS, find_model, load_model, register
from pbrdf.models.two_lobes import DoubleGaussTwoLobes

__all__ = [
    "MODELS",
    "CookTorranceLambert",
    "DoubleGauss",
    "DoubleGaussTwoLobes",
    "GGXLambert",
    "GeneralisedGaussianMRPV",
    "HydeType",
    "InterferenceLacquer",
    "MetallicLacquer",
    "MirrorFacetsMRPV",
    "MirrorHazeMRPV",
    "Model",
    "Option",
    "Parameter",
    "PriestGermer",
    "ReciprocalDoubleGauss",
    "find_model",
    "load_model",
    "register",
]

register(DoubleGauss)
register(ReciprocalDoubleGauss)
register(CookTorranceLambert)
register(PriestGermer)
register(HydeType)
register(GGXLambert)
register(GeneralisedGaussianMRPV)
register(DoubleGaussTwoLobes)
register(MirrorFacetsMRPV)
register(MirrorHazeMRPV)
register(MetallicLacquer)
register(InterferenceLacquer)
