"""Degrees and angle of polarisation of Stokes vectors."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import pbrdf
from pbrdf.backend import get_backend
from pbrdf.data.conventions import dolp_aolp_from_stokes
from pbrdf.optics.stokes import aolp, docp, dolp, dop

S = np.array([[2.0, 0.6, 0.8, 0.0], [1.0, -1.0, 0.0, 0.0], [4.0, 0.0, 0.0, -2.0], [1.0, 0.0, 0.5, 0.5]])
EXPECTED = {
    dolp: [0.5, 1.0, 0.0, 0.5],
    docp: [0.0, 0.0, 0.5, 0.5],
    dop: [0.5, 1.0, 0.5, np.sqrt(0.5)],
    aolp: [0.5 * np.arctan2(0.8, 0.6), np.pi / 2, 0.0, np.pi / 4],
    pbrdf.ellipticity: [0.0, 0.0, -np.pi / 4, np.pi / 8],
}


@pytest.mark.parametrize("function", EXPECTED)
def test_definitions(function):
    """DoLP = √(Q² + U²)/I, DoCP = |V|/I, DoP, AoLP = ½ atan2(U, Q): 0 along p, 90° along s, 45° along p + s."""
    np.testing.assert_allclose(function(S), EXPECTED[function], atol=1e-15)
    assert function(list(S[3])) == pytest.approx(EXPECTED[function][3])


@pytest.mark.parametrize("function", EXPECTED)
@pytest.mark.parametrize("dim", ["stokes_out", "stokes"])
def test_xarray(function, dim):
    labelled = xr.DataArray(S, dims=("view", dim), coords={"view": [1, 2, 3, 4], dim: list("IQUV")})
    found = function(labelled)
    assert found.dims == ("view",) and list(found["view"]) == [1, 2, 3, 4]
    np.testing.assert_allclose(found.values, EXPECTED[function], atol=1e-15)


@pytest.mark.parametrize("function", EXPECTED)
def test_drjit(function):
    module = get_backend().module
    np.testing.assert_allclose(function(module.Array4f64(*S.T)).numpy(), EXPECTED[function], atol=1e-15)


def test_ellipticity_is_that_of_the_polarised_part():
    """Natural light added and the frame turned change nothing; an ellipse is found again (pypolar: asin(V/I)/2)."""
    angles = np.linspace(-np.pi / 4, np.pi / 4, 9)
    for share in (1.0, 0.3, 1e-3):
        for axis in (0.0, 0.4, np.pi / 4, -1.2):
            flat = share * np.cos(2 * angles)
            stokes = np.stack(
                [
                    0 * angles + 1,
                    flat * np.cos(2 * axis),
                    flat * np.sin(2 * axis),
                    share * np.sin(2 * angles),
                ],
                -1,
            )
            np.testing.assert_allclose(pbrdf.ellipticity(stokes), angles, atol=1e-14)
    assert pbrdf.ellipticity([1.0, 0.0, 0.0, 0.3]) == np.pi / 4
    assert np.tan(pbrdf.ellipticity([1.0, 0.6, 0.0, 0.8])) == pytest.approx(0.5)
    assert np.tan(pbrdf.ellipticity([1.0, 0.0, 0.6, 0.8])) == pytest.approx(0.5)


@pytest.mark.parametrize("function", [dolp, docp, dop])
def test_invariance(function):
    """Brightness does not matter; turning the frame changes no degree of polarisation."""
    np.testing.assert_allclose(function(7.3 * S), function(S), atol=1e-15)
    chi = 0.4
    c, s = np.cos(2 * chi), np.sin(2 * chi)
    turned = S @ np.array([[1, 0, 0, 0], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1]])
    np.testing.assert_allclose(function(turned), function(S), atol=1e-15)


@pytest.mark.parametrize("function", [dolp, docp, dop])
def test_no_light_is_nan_without_a_warning(function):
    """Where I = 0 there is no light and the result is NaN (module docstring)."""
    assert np.isnan(function(np.zeros((2, 4)))).all()


@pytest.mark.parametrize("u", [0.0, -0.0, 1e-17, -1e-17, -1e-300])
def test_light_along_s_is_at_plus_90_degrees_whatever_the_sign_of_a_u_that_is_zero(u):
    stokes = [1.0, -1.0, u, 0.0]
    assert aolp(stokes) == np.pi / 2
    assert dolp_aolp_from_stokes(stokes)[1] == np.pi / 2
    assert aolp(xr.DataArray(stokes, dims="stokes_out")).item() == np.pi / 2
    assert aolp(xr.DataArray(np.float32(stokes), dims="stokes_out")).item() == np.pi / 2
    assert aolp(get_backend().module.Array4f64(*stokes)).numpy()[0] == np.pi / 2
