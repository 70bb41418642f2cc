"""Whole pBRDF models: formulas of ``pbrdf.optics`` composed, with named, bounded, documented parameters."""

from __future__ import annotations

from pbrdf.models.base import Model
from pbrdf.models.baselines import (
    Baek2018,
    Diner2012,
    Diner2012Uniform,
    GermerSubsurface,
    Litvinov2011,
    Maignan2009,
    RPVHotSpot,
)
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
    "Baek2018",
    "CookTorranceLambert",
    "Diner2012",
    "Diner2012Uniform",
    "DoubleGauss",
    "DoubleGaussTwoLobes",
    "GGXLambert",
    "GeneralisedGaussianMRPV",
    "GermerSubsurface",
    "HydeType",
    "InterferenceLacquer",
    "Litvinov2011",
    "Maignan2009",
    "MetallicLacquer",
    "MirrorFacetsMRPV",
    "MirrorHazeMRPV",
    "Model",
    "Option",
    "Parameter",
    "PriestGermer",
    "RPVHotSpot",
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
register(Baek2018)
register(GermerSubsurface)
register(RPVHotSpot)
register(Diner2012)
register(Diner2012Uniform)
register(Maignan2009)
register(Litvinov2011)
register(InterferenceLacquer)
