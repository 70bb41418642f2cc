"""Calibration of settings: what went in comes out, with standard errors that hold, and what cannot be told is said."""

from __future__ import annotations

import numpy as np
import pytest

from pbrdf.errors import DataError
from pbrdf.instruments.calibration.analyzer_calibration import standard_inputs
from pbrdf.instruments.calibration.settings_calibration import calibrate_model
from pbrdf.instruments.polarimeter.band import in_band, top_hat_band
from pbrdf.instruments.polarimeter.polarimeter import (
    division_of_focal_plane,
    from_settings,
    lcvr,
    measured,
    rotating_polarizer,
    rotating_retarder,
)
from pbrdf.instruments.polarimeter.retardance_sets import retardance_set

SIX = retardance_set("six_states")
#: Polarised light of two intensities, natural light and none: tells everything, the offset too.
INPUTS = np.concatenate(
    [100 * standard_inputs(12, natural=True), 40 * standard_inputs(3), np.zeros((4, 1))], axis=1
)


def driven(sets, errors):
    """The retardances with an error for each level (states with the same nominal retardance share it)."""
    out = sets.copy()
    for k in range(sets.shape[1]):
        levels = np.unique(sets[:, k])
        for j, level in enumerate(levels):
            out[sets[:, k] == level, k] += errors[k][j]
    return out


TRUE_SIX = lcvr(
    driven(SIX, [np.deg2rad([3.0, -2.0, 1.5, 4.0]), np.deg2rad([-1.0, 2.0, 2.5])]),
    axes=np.deg2rad([1.5, 43.8]),
    diattenuation=0.97,
)


def test_an_imager_of_two_retarders():
    """Retardances of each level, both axes, diattenuation, gain and offset come back from noiseless readings."""
    read = 1.7 * TRUE_SIX.intensities(INPUTS) + 3.0
    found = calibrate_model(lcvr(SIX), read, INPUTS)
    assert set(found.fixed) == {"analyzer"}
    for name, value in {
        "retardance 1 at 0": 3.0,
        "retardance 1 at 90": 88.0,
        "retardance 1 at 270": 274.0,
        "retardance 2 at 180": 182.5,
        "axis 1": 1.5,
        "axis 2": 43.8,
        "diattenuation": 0.97,
        "gain": 1.7,
        "offset": 3.0,
    }.items():
        assert found.value(name) == pytest.approx(value, abs=1e-5), name
    np.testing.assert_allclose(found.polarimeter.analyzer, 1.7 * TRUE_SIX.analyzer, atol=1e-8)
    np.testing.assert_allclose(
        from_settings(found.polarimeter.details).analyzer, TRUE_SIX.analyzer, atol=1e-8
    )
    assert found.residual < 1e-9 and found.chi2 is None


def test_a_rotating_retarder():
    """Retardance, zero of the rotation, diattenuation; also the analyser's axis, if it is not fixed."""
    angles = np.deg2rad(np.arange(0, 180, 22.5))
    truth = rotating_retarder(angles + np.deg2rad(2), np.deg2rad(96), np.deg2rad(-1.2), diattenuation=0.99)
    found = calibrate_model(rotating_retarder(angles), truth.intensities(INPUTS), INPUTS, fixed=())
    assert not found.fixed
    assert found.value("retardance") == pytest.approx(96, abs=1e-5)
    assert found.value("zero") == pytest.approx(2, abs=1e-5)
    assert found.value("analyzer") == pytest.approx(-1.2, abs=1e-5)
    assert found.value("diattenuation") == pytest.approx(0.99, abs=1e-7)


def test_a_rotating_polariser_with_a_gain_for_each_state():
    """A source that drifts from state to state."""
    angles = np.deg2rad([0, 45, 90, 135])
    drift = np.array([1.0, 1.03, 0.98, 1.01])
    truth = rotating_polarizer(angles + np.deg2rad(3), diattenuation=0.95)
    read = drift[:, None] * truth.intensities(INPUTS)
    found = calibrate_model(rotating_polarizer(angles), read, INPUTS, gain="each")
    assert found.value("zero") == pytest.approx(3, abs=1e-5)
    assert found.value("diattenuation") == pytest.approx(0.95, abs=1e-7)
    np.testing.assert_allclose([found.value(f"gain {s}") for s in ("0", "45", "90", "135")], drift, rtol=1e-7)


def test_a_mosaic_has_settings_of_each_class_of_pixel():
    nominal = division_of_focal_plane(np.deg2rad([[90, 45], [135, 0]]))
    axes, d = np.deg2rad([88.5, 45.5, 136, 0.3]), np.array([0.95, 0.9, 0.97, 0.93])
    truth = np.concatenate(
        [rotating_polarizer([a], diattenuation=p).analyzer for a, p in zip(axes, d, strict=True)]
    )
    found = calibrate_model(nominal, 2 * truth @ INPUTS + 1, INPUTS)
    for name, a, p in zip(nominal.states, axes, d, strict=True):
        assert found.value(f"axis {name}") == pytest.approx(np.rad2deg(a), abs=1e-5)
        assert found.value(f"diattenuation {name}") == pytest.approx(p, abs=1e-7)
    np.testing.assert_array_equal(found.polarimeter.mosaic, nominal.mosaic)


@pytest.mark.slow
def test_standard_errors_are_the_scatter():
    """40 noisy calibrations: values minus truth over standard errors have the variance 1 (all settings together, 5
    standard errors of a variance), and χ² is the number of readings less settings."""
    rng = np.random.default_rng(0)
    exact = 1.2 * TRUE_SIX.intensities(INPUTS) + 2.0
    sigma = 0.05 * np.sqrt(1 + exact / 20)
    truth = calibrate_model(lcvr(SIX), exact, INPUTS)
    pulls, chi2 = [], []
    for _ in range(40):
        noisy = exact + sigma * rng.standard_normal(exact.shape)
        found = calibrate_model(lcvr(SIX), noisy, INPUTS, variance=sigma**2)
        free = found.errors > 0
        pulls.append((found.values - truth.values)[free] / found.errors[free])
        chi2.append(found.chi2 / found.freedom)
    pulls = np.array(pulls)
    assert pulls.shape[1] == free.sum() == 12
    assert np.mean(pulls**2) == pytest.approx(1, abs=5 * np.sqrt(2 / 40 / 4))
    assert (abs(pulls.mean(axis=0)) < 5 / np.sqrt(40)).all()
    assert np.mean(chi2) == pytest.approx(1, abs=5 * np.sqrt(2 / 40 / found.freedom))


def test_errors_without_variances_come_from_the_residuals():
    rng = np.random.default_rng(1)
    exact = TRUE_SIX.intensities(INPUTS)
    noisy = exact + 0.05 * rng.standard_normal(exact.shape)
    blind = calibrate_model(lcvr(SIX), noisy, INPUTS)
    told = calibrate_model(lcvr(SIX), noisy, INPUTS, variance=np.full(exact.shape, 0.05**2))
    np.testing.assert_allclose(blind.values, told.values, atol=1e-5)
    np.testing.assert_allclose(blind.errors, told.errors, rtol=0.3)
    assert told.covariance.shape == (12, 12)
    np.testing.assert_allclose(np.sqrt(np.diag(told.covariance)), told.errors[told.errors > 0], rtol=1e-9)


def test_what_the_readings_do_not_tell_is_fixed_and_said():
    """Inputs of one intensity do not tell the offset from the gain. The tetrahedral set leaves an axis free. A retarder
    that stands along the analyser does nothing."""
    even = 100 * standard_inputs(12)
    found = calibrate_model(lcvr(SIX), TRUE_SIX.intensities(even), even)
    assert found.fixed == {
        "analyzer": "fixed",
        "offset": "these inputs do not tell it from the other settings",
    }
    assert found.error("offset") == 0.0 and found.value("offset") == 0.0
    tetrahedron = retardance_set("tetrahedron")
    found = calibrate_model(lcvr(tetrahedron), lcvr(tetrahedron).intensities(INPUTS), INPUTS)
    assert set(found.fixed) == {"analyzer", "axis 2", "diattenuation"}
    assert found.fixed["axis 2"] == "these inputs do not tell it from the other settings"
    idle = lcvr([[0.3, 0.4], [1.1, 0.4], [2.0, 0.4]], axes=[0.5, 0.0])
    found = calibrate_model(idle, idle.intensities(INPUTS), INPUTS, fixed=("analyzer", "axis"))
    assert found.fixed["retardance 2 at 22.9183"] == "without effect"


def test_each_state_with_its_own_retardances_leaves_the_axes_free():
    """Two retardances a state reach any analyser vector from these axes: the axes cannot be told, the vectors can."""
    truth = lcvr(SIX + np.deg2rad(2) * np.random.default_rng(0).standard_normal(SIX.shape), axes=[0.02, 0.77])
    found = calibrate_model(lcvr(SIX), truth.intensities(INPUTS), INPUTS, shared=False)
    assert {"axis 1", "axis 2"} <= set(found.fixed)
    assert "retardance 2 of s3" in found.names


def test_a_perfect_analyser_is_held_at_its_limit():
    """Noise would make the diattenuation greater than 1: it stays 1, without a standard error, and that is said."""
    rng = np.random.default_rng(7)
    truth = rotating_polarizer(np.deg2rad([0, 30, 60, 90, 120, 150]))
    exact = truth.intensities(INPUTS)
    for _ in range(20):
        found = calibrate_model(truth, exact + 0.1 * rng.standard_normal(exact.shape), INPUTS)
        if "diattenuation" in found.fixed:
            assert found.value("diattenuation") == pytest.approx(1.0, abs=1e-8)
            assert found.error("diattenuation") == 0.0
            assert found.fixed["diattenuation"] == "at its physical limit"
            break
    else:
        pytest.fail("never at the limit")
    assert found.error("zero") > 0


def test_inputs_held_out_verify():
    read = TRUE_SIX.intensities(INPUTS)
    read[:, 3] *= np.linspace(0.9, 1.1, 6)
    found = calibrate_model(lcvr(SIX), read, INPUTS, held_out=[3, 5])
    np.testing.assert_allclose(found.polarimeter.analyzer, TRUE_SIX.analyzer, atol=1e-7)
    assert found.accuracy.inputs == 2 and found.accuracy.linear > 0.005
    assert found.polarimeter.accuracy == (found.accuracy.linear, found.accuracy.circular)


@pytest.mark.slow
def test_each_input_held_out_in_turn():
    """The settings are those of all inputs; what each input is found to be comes from a fit without it, as if it alone
    had been held out. A dark input verifies nothing."""
    rng = np.random.default_rng(6)
    read = TRUE_SIX.intensities(INPUTS) + 0.1 * rng.standard_normal((6, INPUTS.shape[1]))
    found = calibrate_model(lcvr(SIX), read, INPUTS, held_out="each")
    everything = calibrate_model(lcvr(SIX), read, INPUTS)
    np.testing.assert_array_equal(found.values, everything.values)
    assert everything.accuracy is None and found.held_out == tuple(range(INPUTS.shape[1] - 1))
    alone = calibrate_model(lcvr(SIX), read, INPUTS, held_out=[4])
    np.testing.assert_array_equal(found.found[:, 4], alone.found[:, 4])
    assert abs(found.found[:, 4] - everything.found[:, 4]).max() > 1e-6
    errors = found.found[1:3, :-1] / found.found[0, :-1] - INPUTS[1:3, :-1] / INPUTS[0, :-1]
    assert found.accuracy.linear == pytest.approx(np.sqrt(np.mean(errors**2)))
    assert found.polarimeter.accuracy[0] == found.accuracy.linear


def test_as_many_settings_as_readings():
    """One polariser, two inputs: gain and angle fit whatever was read; without variances nothing says how well."""
    truth = rotating_polarizer([0.35])
    found = calibrate_model(
        rotating_polarizer([0.3]), truth.intensities(INPUTS[:, [0, 3]]), INPUTS[:, [0, 3]]
    )
    assert found.freedom == 0 and len(found.fixed) == 2
    assert np.isnan(found.error("gain"))


def test_errors():
    with pytest.raises(DataError, match="'each'"):
        calibrate_model(lcvr(SIX), TRUE_SIX.intensities(INPUTS), INPUTS, held_out="all")
    read = TRUE_SIX.intensities(INPUTS)
    for other in (
        measured(TRUE_SIX.analyzer),
        lcvr(SIX).turned(0.1),
        in_band(lcvr(SIX), top_hat_band(476, 50)),
    ):
        with pytest.raises(DataError, match="not made by its settings"):
            calibrate_model(other, read, INPUTS)
    with pytest.raises(DataError, match=r"give \(6, inputs\)"):
        calibrate_model(lcvr(SIX), read[:5], INPUTS)
    with pytest.raises(DataError, match="positive"):
        calibrate_model(lcvr(SIX), read, INPUTS, variance=np.zeros(read.shape))
    with pytest.raises(DataError, match="no setting is called 'axes'"):
        calibrate_model(lcvr(SIX), read, INPUTS, fixed=("axes",))
    with pytest.raises(DataError, match="gain"):
        calibrate_model(lcvr(SIX), read, INPUTS, gain="free")
    with pytest.raises(DataError, match="held out"):
        calibrate_model(lcvr(SIX), read, INPUTS, held_out=[99])
    with pytest.raises(DataError, match="nothing in common"):
        calibrate_model(lcvr(SIX), -read, INPUTS)
