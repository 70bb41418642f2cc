"""Plans for a model that a user wrote: its lobe is resolved, and the promise holds."""

from __future__ import annotations

import numpy as np
import pytest

import pbrdf
from own_model import LambertGGX
from pbrdf.inversion.noise import InstrumentNoise
from pbrdf.planning.candidates import in_plane_candidates
from pbrdf.planning.plan import plan

NOISE = InstrumentNoise(linear=0.01, circular=0.05)


@pytest.mark.parametrize("alpha", [0.01, 0.3])
def test_candidates_resolve_the_lobe_whatever_its_width(alpha):
    """Facet tilts next to the mirror direction are steps of half the lobe's width, not of a fixed one."""
    model = LambertGGX(alpha=alpha, index=1.5, rho=0.3)
    protocol = in_plane_candidates(model)
    tilt = np.unique(np.round(0.5 * np.abs(protocol.theta_i - protocol.theta_r), 5))
    # GGX falls to half its height at tan²θ = (√2 − 1) α², a Gaussian of σ at 2 ln 2 σ²
    sigma = alpha * np.sqrt((np.sqrt(2.0) - 1.0) / (2.0 * np.log(2.0)))
    assert model.lobe_width() == pytest.approx(sigma, rel=0.03)
    assert tilt[tilt > 1e-4][0] == pytest.approx(0.5 * sigma, rel=0.1, abs=1e-4)


def test_the_promised_standard_errors_are_those_of_a_fit():
    truth = LambertGGX(alpha=0.1, index=1.55, rho=0.3)
    made = plan(truth, NOISE, 40, starts=1)
    assert made.names == ("alpha", "index", "rho")
    geometry = made.protocol
    stokes = truth.stokes(geometry.theta_i, geometry.theta_r, geometry.phi)
    std = {c: s * stokes[:, 0] for c, s in zip("IQUV", (0.01, 0.01, 0.01, 0.05), strict=True)}
    data = pbrdf.make_dataset(
        geometry.theta_i, geometry.theta_r, geometry.phi, quantity="brdf",
        **dict(zip("IQUV", stokes.T, strict=True)), std=std,
    )  # fmt: skip
    result = pbrdf.fit(data, truth, starts=1)
    for name, promised in zip(made.names, made.std, strict=True):
        assert result.estimates[name].std == pytest.approx(promised, rel=1e-3)
