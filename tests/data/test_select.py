from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pbrdf.data import make_dataset, measured_channels, to_brdf_scale, validate
from pbrdf.data.select import match_wavelengths
from pbrdf.errors import DataError

THETA_I = np.deg2rad([0.0, 60.0])


def test_channels_without_any_value_are_not_measured():
    ds = make_dataset(THETA_I, 0.5, 0.0, quantity="brdf", I=1.0, Q=[np.nan, 0.1], U=np.nan)
    assert measured_channels(ds) == ("I", "Q")
    assert measured_channels(make_dataset(0.1, 0.5, 0.0, quantity="brdf", mueller=np.eye(4))) == ("mueller",)


@pytest.mark.parametrize("quantity", ["reflectance_factor", "radiance", "dn"])
def test_no_conversion_of_the_intensity_touches_the_ratio_beside_it(quantity):
    M = np.full((4, 4), 0.25)
    M[0, 0] = 1.0
    ds = make_dataset(
        THETA_I, 0.5, 0.0, quantity=quantity, I=3.0, mueller_over_m00=M, std={"mueller_over_m00": 0.01}
    )
    brdf = to_brdf_scale(ds)
    assert not np.allclose(brdf["I"], ds["I"])
    for name in ("mueller_over_m00", "mueller_over_m00_std"):
        assert_array_equal(brdf[name], ds[name])
    assert measured_channels(ds) == ("I", "mueller_over_m00")


def test_ratios_alone_are_normalised_and_stay_so():
    ds = make_dataset(THETA_I, 0.5, 0.0, Q_over_I=-0.1)
    assert ds.attrs["quantity"] == "normalised"
    assert to_brdf_scale(ds).identical(ds)


def test_reflectance_factor_is_divided_by_pi_with_its_uncertainty():
    ds = make_dataset(
        THETA_I,
        0.5,
        0.0,
        quantity="reflectance_factor",
        I=np.pi,
        dolp=0.3,
        std={"I": np.pi / 10, "dolp": 0.01},
    )
    brdf = to_brdf_scale(ds)
    assert_allclose(brdf["I"], 1.0)
    assert_allclose(brdf["I_std"], 0.1)
    assert_array_equal(brdf["dolp"], ds["dolp"])
    assert_array_equal(brdf["dolp_std"], ds["dolp_std"])
    assert brdf.attrs["quantity"] == "brdf"
    assert brdf["I"].attrs["units"] == "1/sr"
    assert "scale" not in brdf.attrs
    validate(brdf)


@pytest.mark.parametrize("quantity", ["radiance", "dn"])
def test_radiance_is_divided_by_the_cosine_of_incidence(quantity):
    ds = make_dataset(THETA_I, 0.5, 0.0, quantity=quantity, mueller=np.eye(4), std={"mueller": 0.1})
    brdf = to_brdf_scale(ds)
    assert_allclose(brdf["mueller"], np.eye(4) * np.array([1.0, 2.0])[:, None, None])
    assert_allclose(brdf["mueller_std"], 0.1 * np.array([1.0, 2.0])[:, None, None] * np.ones((4, 4)))
    assert brdf.attrs["scale"] == "arbitrary"
    assert_array_equal(ds["mueller"][1], np.eye(4))
    assert to_brdf_scale(brdf).identical(brdf)


@pytest.mark.parametrize(
    ("quantity", "factor"),
    [("reflectance_factor", [1 / np.pi, 1 / np.pi]), ("dn", [1.0, 2.0]), ("brdf", [1.0, 1.0])],
)
def test_a_covariance_is_scaled_with_the_square_of_the_values_factor(quantity, factor):
    """Var(c x) = c² Var(x): correlations stay, and the diagonal stays the square of the standard uncertainty."""
    covariance = np.array(
        [[4.0, 1.5, -0.3, np.nan], [1.5, 1.0, 0.2, np.nan], [-0.3, 0.2, 2.0, np.nan], 4 * [np.nan]]
    )
    ds = make_dataset(THETA_I, 0.5, 0.0, quantity=quantity, I=9.0, Q=1.0, U=0.5, covariance=covariance)
    brdf = to_brdf_scale(ds)
    factor = np.array(factor)
    assert_allclose(brdf["covariance"], covariance * factor[:, None, None] ** 2)
    assert_array_equal(brdf["covariance"][:, 1, 1], brdf["Q_std"] ** 2)
    assert brdf["covariance"].attrs["units"] == "1/sr2"
    assert ds["covariance"].attrs["units"] != "1/sr2" or quantity == "brdf", "the original is not changed"
    validate(brdf)


def test_wavelengths_are_met_within_half_a_nanometre():
    available = np.array([400.0, 410.0, 420.0])
    assert match_wavelengths(available, None, "f") == [0, 1, 2]
    assert match_wavelengths(available, 410.4, "f") == [1]
    assert match_wavelengths(available, [420, 400], "f") == [0, 2]
    with pytest.raises(DataError, match=r"f: 411 nm.*400, 410, 420"):
        match_wavelengths(available, 411, "f")
