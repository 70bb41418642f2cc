"""Polarimetric reflectance of coatings, from measurement to scene.

Everything a user needs stands here by name and is loaded when first used::

    import pbrdf

    paint = pbrdf.DoubleGauss(sigma=0.04, n=1.62, a=1.5, k=1.25, b=0.2, t=0.67)
    paint.mueller(theta_i, theta_r, phi)          # 4 x 4 Mueller matrices, 1/sr
    result = pbrdf.fit(pbrdf.read("paint.csv"))   # parameters with their uncertainty
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from pbrdf.backend import get_backend, point_drjit_to_llvm, set_backend
from pbrdf.errors import BackendError, DataError, FitError, ModelError, PbrdfError

if TYPE_CHECKING:
    from pbrdf.data import check, make_dataset, read, validate, write
    from pbrdf.data.paints import PAINTS, load_paint, open_experiment
    from pbrdf.inversion import (
        FitResult,
        HoldOut,
        NoiseModel,
        Nuisance,
        cross_validate,
        error_analysis,
        fit,
        plausibility,
    )
    from pbrdf.models import DoubleGauss, Model, ReciprocalDoubleGauss, load_model
    from pbrdf.models.reflectance import directional_hemispherical_reflectance
    from pbrdf.optics.mueller import coherency_eigenvalues
    from pbrdf.optics.stokes import aolp, docp, dolp, dop

__version__ = "0.1.0"

_HOME = {
    "pbrdf.data": ("check", "make_dataset", "read", "validate", "write"),
    "pbrdf.data.paints": ("PAINTS", "load_paint", "open_experiment"),
    "pbrdf.inversion": (
        "FitResult",
        "HoldOut",
        "NoiseModel",
        "Nuisance",
        "cross_validate",
        "error_analysis",
        "fit",
        "plausibility",
    ),
    "pbrdf.models": ("DoubleGauss", "Model", "ReciprocalDoubleGauss", "load_model"),
    "pbrdf.models.reflectance": ("directional_hemispherical_reflectance",),
    "pbrdf.optics.mueller": ("coherency_eigenvalues",),
    "pbrdf.optics.stokes": ("aolp", "docp", "dolp", "dop"),
}
_MODULE_OF = {name: module for module, names in _HOME.items() for name in names}

__all__ = [
    "PAINTS",
    "BackendError",
    "DataError",
    "DoubleGauss",
    "FitError",
    "FitResult",
    "HoldOut",
    "Model",
    "ModelError",
    "NoiseModel",
    "Nuisance",
    "PbrdfError",
    "ReciprocalDoubleGauss",
    "aolp",
    "check",
    "coherency_eigenvalues",
    "cross_validate",
    "directional_hemispherical_reflectance",
    "docp",
    "dolp",
    "dop",
    "error_analysis",
    "fit",
    "get_backend",
    "load_model",
    "load_paint",
    "make_dataset",
    "open_experiment",
    "plausibility",
    "read",
    "set_backend",
    "validate",
    "write",
]

# Dr.Jit looks for LLVM when it is imported, so this comes before anything that does
point_drjit_to_llvm()


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'pbrdf' has no attribute {name!r}")
    value = getattr(importlib.import_module(_MODULE_OF[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
