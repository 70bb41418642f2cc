"""The BSDF plugin against Mitsuba's own materials where the models coincide.

Both sides are Mitsuba's matrices in Mitsuba's implicit frames: nothing of this project's conventions enters.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from bsdf_helpers import call, directions, use
from scipy.special import erfc

POLARISED = "llvm_ad_mono_polarized"


def component(mi, index):
    ctx = mi.BSDFContext()
    ctx.component = index
    return ctx


@pytest.mark.parametrize("kappa", [0.0, 1.5])
@pytest.mark.parametrize("sigma", [0.0398, 0.2])
def test_specular_part_is_roughconductor(sigma, kappa):
    """Facets with Beckmann's α = √2 σ, every matrix element, all signs, azimuths all around.

    Zenith angles at which nothing is shadowed: Mitsuba's Smith function (separable, approximate) is 1 there.
    """
    mi = use(POLARISED)
    largest = 50.0 if sigma < 0.1 else 25.0
    wi, wo = directions(5000, largest, 1), directions(5000, largest, 2)
    ours = mi.load_dict(
        {"type": "pbrdf", "sigma": sigma, "n": 1.7, "kappa": kappa, "shadowing": "none", "accuracy": "fast"}
    )
    theirs = mi.load_dict({"type": "roughconductor", "alpha": math.sqrt(2.0) * sigma, "eta": 1.7, "k": kappa})
    found = call(mi, ours.eval, wi, wo, ctx=component(mi, 0))[:, 0]
    expected = call(mi, theirs.eval, wi, wo)[:, 0]
    lobe = expected[:, 0, 0] > 1e-12 * expected[:, 0, 0].max()
    assert lobe.sum() > 1000
    difference = np.abs(found - expected)[lobe].max((1, 2)) / expected[lobe, 0, 0]
    # far out in the lobe exp(−tan²θ/2σ²) takes the rounding of tan²θ times its large exponent
    assert np.max(difference) < 2e-4 and np.median(difference) < 5e-6


@pytest.mark.parametrize("shadowing", ["v-cavity", "smith", "none"])
def test_specular_polarisation_is_roughconductors_at_every_angle(shadowing):
    """Shadowing is a common factor of the matrix: normalised matrices agree whatever its form."""
    mi = use(POLARISED)
    wi, wo = directions(5000, 88.0, 1), directions(5000, 88.0, 2)
    sigma = 0.3
    ours = mi.load_dict(
        {"type": "pbrdf", "sigma": sigma, "n": 0.9, "kappa": 2.0, "shadowing": shadowing, "accuracy": "fast"}
    )
    theirs = mi.load_dict({"type": "roughconductor", "alpha": math.sqrt(2.0) * sigma, "eta": 0.9, "k": 2.0})
    found = call(mi, ours.eval, wi, wo, ctx=component(mi, 0))[:, 0]
    expected = call(mi, theirs.eval, wi, wo)[:, 0]
    lobe = (expected[:, 0, 0] > 1e-6) & (found[:, 0, 0] > 1e-6)
    assert lobe.sum() > 3000
    normalised = [M[lobe] / M[lobe, :1, :1] for M in (found, expected)]
    # Mitsuba takes frames along the normal for collinear ones only where they are so exactly
    assert np.max(np.abs(normalised[0] - normalised[1])) < 2e-4


def test_smith_shadowing_is_mitsubas_but_for_the_correlation():
    """Ours is 1/(1 + Λ_i + Λ_r), Mitsuba's 1/((1 + Λ_i)(1 + Λ_r)) by an approximation good to 0.35 % a factor."""
    mi = use(POLARISED)
    wi, wo = directions(5000, 85.0, 1), directions(5000, 85.0, 2)
    sigma = 0.4
    ours = mi.load_dict({"type": "pbrdf", "sigma": sigma, "n": 1.5, "shadowing": "smith", "accuracy": "fast"})
    theirs = mi.load_dict({"type": "roughconductor", "alpha": math.sqrt(2.0) * sigma, "eta": 1.5, "k": 0.0})
    found = call(mi, ours.eval, wi, wo, ctx=component(mi, 0))[:, 0, 0, 0]
    expected = call(mi, theirs.eval, wi, wo)[:, 0, 0, 0]

    def smith(v):
        x = v[:, 2] / np.hypot(v[:, 0], v[:, 1]) / (math.sqrt(2.0) * sigma)
        return 0.5 * (np.exp(-x * x) / (math.sqrt(math.pi) * x) - erfc(x))

    lambda_i, lambda_r = smith(wo), smith(wi)
    lobe = expected > 1e-6 * expected.max()
    separable = found * (1.0 + lambda_i + lambda_r) / ((1.0 + lambda_i) * (1.0 + lambda_r))
    assert np.max(np.abs(separable[lobe] / expected[lobe] - 1.0)) < 0.008
    assert np.max(found[lobe] / expected[lobe]) > 1.05  # the correlation is there


def test_smooth_reciprocal_body_is_pplastic():
    """σ → 0, Lambertian body, fully polarised share: ρ/π T(θ_o) D_s T(θ_i), Mitsuba's ``pplastic``."""
    mi = use(POLARISED)
    wi, wo = directions(5000, 80.0, 1), directions(5000, 80.0, 2)
    ours = mi.load_dict(
        {
            "type": "pbrdf",
            "model": "reciprocal-double-gauss",
            "sigma": 0.001,
            "n": 1.5,
            "a": 0.6,
            "k": 1.0,
            "b": 0.0,
            "t": 1.0,
        }
    )
    theirs = mi.load_dict(
        {"type": "pplastic", "diffuse_reflectance": 0.6, "int_ior": 1.5, "ext_ior": 1.0, "alpha": 0.001}
    )
    found = call(mi, ours.eval, wi, wo, ctx=component(mi, 1))[:, 0]
    expected = call(mi, theirs.eval, wi, wo, ctx=component(mi, 1))[:, 0]
    assert np.max(np.abs(found - expected).max((1, 2)) / expected[:, 0, 0]) < 1e-4


def test_body_polarisation_of_the_paper_is_the_first_column_of_pplastic():
    """Of ``DoubleGauss`` light does not enter through the facets: the same column, without T(θ_i)."""
    mi = use(POLARISED)
    wi, wo = directions(5000, 80.0, 1), directions(5000, 80.0, 2)
    ours = mi.load_dict({"type": "pbrdf", "sigma": 0.001, "n": 1.5, "a": 0.6, "k": 1.0, "b": 0.0, "t": 1.0})
    theirs = mi.load_dict(
        {"type": "pplastic", "diffuse_reflectance": 0.6, "int_ior": 1.5, "ext_ior": 1.0, "alpha": 0.001}
    )
    found = call(mi, ours.eval, wi, wo, ctx=component(mi, 1))[:, 0]
    expected = call(mi, theirs.eval, wi, wo, ctx=component(mi, 1))[:, 0]
    column = expected[:, :, 0] / expected[:, :1, 0]
    assert np.max(np.abs(found[:, :, 0] / found[:, :1, 0] - column)) < 1e-4
    assert np.max(np.abs(found[:, :, 1:])) == 0.0
