import numpy as np
import pytest

from pbrdf.report.dataset.quantities import polarised_quantities


def test_ratios_and_their_uncertainties_are_those_of_many_draws():
    rng = np.random.default_rng(1)
    value, std = {"I": 2.0, "Q": 0.6, "V": -0.2}, {"I": 0.02, "Q": 0.01, "V": 0.03}
    found = polarised_quantities(
        {n: np.array([v]) for n, v in value.items()}, {n: np.array([s]) for n, s in std.items()}
    )
    draws = {n: v + std[n] * rng.standard_normal(200_000) for n, v in value.items()}
    for name in ("Q", "V"):
        ratio = draws[name] / draws["I"]
        assert found[f"{name}/I"].measured[0] == pytest.approx(value[name] / value["I"])
        assert found[f"{name}/I"].std[0] == pytest.approx(ratio.std(), rel=0.02)
    assert set(found) == {"Q/I", "V/I"}  # without U no angle


def test_what_was_measured_as_a_ratio_keeps_its_own_uncertainty():
    one = np.ones(1)
    values = {"I": 2.0 * one, "Q_over_I": -0.3 * one, "m01_over_m00": 0.4 * one}
    found = polarised_quantities(values, {"I": 0.5 * one, "Q_over_I": 0.01 * one})
    assert (found["Q/I"].measured[0], found["Q/I"].std[0]) == (-0.3, 0.01)
    assert found["m01"].measured[0] == 0.4 and np.isnan(found["m01"].std[0])


@pytest.mark.parametrize("degrees", [-30.0, 0.0, 20.0, 90.0, 120.0])
def test_the_angle_is_that_of_the_electric_field(degrees):
    p, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    stokes = {"I": np.array([2.0]), "Q": np.array([p**2 - s**2]), "U": np.array([2.0 * p * s])}
    assert polarised_quantities(stokes)["aolp"].measured[0] == pytest.approx(degrees, abs=1e-9)


def test_the_angle_of_noise_is_not_drawn_and_its_error_is_first_order():
    one = np.ones(2)
    values = {"I": one, "Q": np.array([0.5, 0.01]), "U": np.array([0.0, 0.0])}
    std = {"I": 0.0 * one, "Q": 0.01 * one, "U": 0.01 * one}
    found = polarised_quantities(values, std)["aolp"]
    assert found.std[0] == pytest.approx(np.rad2deg(0.5 * 0.01 / 0.5))
    assert np.isnan(found.measured[1])


def test_mueller_elements_are_divided_by_the_first():
    M = np.arange(1.0, 17.0).reshape(4, 4)
    values = {f"m{i}{j}": np.array([M[i, j]]) for i in range(4) for j in range(4)}
    values["m33"] = np.array([np.nan])  # not measured
    found = polarised_quantities(values)
    assert set(found) == set(values) - {"m33"}
    assert found["m00"].measured[0] == 1.0 and found["m21"].measured[0] == 10.0
    values["m00"] = np.array([2.0])
    assert polarised_quantities(values)["m21"].measured[0] == 5.0


def test_intensity_alone_has_nothing_polarised():
    assert polarised_quantities({"I": np.ones(3), "Q": np.full(3, np.nan)}) == {}
