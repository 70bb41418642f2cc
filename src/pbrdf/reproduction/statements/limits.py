"""Statements on the limits of the model: mirror, Lambertian surface."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pbrdf.models import DoubleGauss
from pbrdf.models.reflectance import directional_hemispherical_reflectance
from pbrdf.optics.fresnel import mueller_reflection
from pbrdf.reproduction.interpretations import Interpretation
from pbrdf.reproduction.plane import in_plane
from pbrdf.reproduction.statements.statement import Outcome, listed

__all__ = ["lambertian", "rough_and_smooth"]

#: Roughness from nearly a mirror to the largest that the model allows.
_ROUGHNESS = (0.002, 0.01, 0.05, 0.2, 0.6, 1.0)
#: A surface whose f varies by less than this factor within 60° counts as Lambertian; relative error of a mirror.
_FLAT, _MIRROR = 1.1, 1e-4


def rough_and_smooth(interpretation: Interpretation, positions: Sequence[float]) -> Outcome:
    """Statement 2: a very rough surface tends to Lambert, a very smooth one is Fresnel's mirror.

    Contrast (largest over smallest f within ±60°) over a Lambertian body (k = 1, b = t = 0, n = 1.5) lit at 30°,
    which must fall with σ to below 1.1; and the share of light reflected by the facets alone at σ = 0.002 against
    Fresnel's at 0°, 30°, 60°, which must agree to 1e-4.

    Value: contrasts, then the largest relative difference.
    """
    view = np.deg2rad(np.linspace(-60.0, 60.0, 241))
    models = [DoubleGauss(sigma, 1.5, 1.0, 1.0, 0.0, 0.0, **interpretation.options) for sigma in _ROUGHNESS]
    intensities = [in_plane(model, np.deg2rad(30.0), view)[:, 0] for model in models]
    contrast = np.array([i.max() / i.min() for i in intensities])
    angles = np.deg2rad([0.0, 30.0, 60.0])
    reflected = directional_hemispherical_reflectance(models[0].replace(a=0.0), angles)
    fresnel = np.array([mueller_reflection(float(c), 1.5).mean for c in np.cos(angles)])
    off = float(np.abs(reflected / fresnel - 1.0).max())
    passed = bool((np.diff(contrast) < 0.0).all()) and contrast[-1] < _FLAT and off < _MIRROR
    text = f"contrast {contrast[0]:.0f} at σ = 0.002, {contrast[-1]:.2f} at σ = 1; mirror to {off:.0e}"
    return Outcome((*map(float, contrast), off), bool(passed), text.replace("-", "−"))


def lambertian(interpretation: Interpretation, positions: Sequence[float]) -> Outcome:
    """Statement 3: k = 1, b = 0 is Lambertian, f_rpv = a/π (to 1e-12), with a = 0.8 and t = 0.

    Value: largest relative difference.
    """
    view = np.deg2rad(np.linspace(-85.0, 85.0, 35))
    f = in_plane(
        DoubleGauss(0.04, 1.6, 0.8, 1.0, 0.0, 0.0, **interpretation.options),
        np.deg2rad(17.0),
        view,
        "diffuse",
    )
    off = float(np.abs(f[:, 0] * np.pi / 0.8 - 1.0).max())
    return Outcome((off,), off < 1e-12, f"differs by {listed([off], '.0e')}")
