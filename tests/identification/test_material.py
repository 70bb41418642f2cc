"""Materials from their specimens: recovered scatter, the specimens' own uncertainty taken out."""

from __future__ import annotations

import numpy as np
import pytest

import pbrdf
from pbrdf.errors import FitError
from pbrdf.identification.library import bundled_library
from pbrdf.identification.material import assumed_scatter, material_from_fits, material_from_model, pooled


def test_scatter_is_recovered_and_the_uncertainty_of_the_fits_taken_out():
    random = np.random.default_rng(1)
    unit = np.array([0.1, 0.02, 0.3])
    true = np.diag(unit) @ np.array([[1.0, 0.5, 0.0], [0.5, 2.0, 0.3], [0.0, 0.3, 0.5]]) @ np.diag(unit)
    own = np.diag([0.1, 0.05, 0.2]) ** 2
    mean = np.array([-3.0, 1.6, 0.2])
    count = 20_000
    estimates = random.multivariate_normal(mean, true + own, count)
    found_mean, found, source = pooled(estimates, np.broadcast_to(own, (count, 3, 3)), unit)
    assert source == "estimated"
    assert found_mean == pytest.approx(mean, abs=0.01)
    scale = np.sqrt(np.diag(true))
    assert found / np.outer(scale, scale) == pytest.approx(true / np.outer(scale, scale), abs=0.06)


def test_two_specimens_that_agree_do_not_show_that_all_do():
    unit = np.array([0.1, 0.02])
    _, found, _ = pooled(np.array([[0.0, 1.5], [0.0, 1.5]]), np.zeros((2, 2, 2)), unit)
    assert (np.sqrt(np.diag(found)) > 0.7 * unit).all()


def test_one_specimen_has_an_assumed_scatter_and_its_own_uncertainty():
    unit = np.array([0.1, 0.02])
    own = np.diag([0.3, 0.01]) ** 2
    mean, found, source = pooled(np.array([[0.5, 1.5]]), own[None], unit)
    assert source == "assumed"
    assert mean == pytest.approx([0.5, 1.5])
    assert np.diag(found) == pytest.approx(unit**2 + np.diag(own))


def test_material_of_fits():
    """Fits of one paint's panels: the mean is the paint's, and specimens scatter as they were drawn."""
    material = bundled_library()["matte-white-thick"]
    experiment = pbrdf.open_experiment("matte-white-thick")
    angles = [experiment[name].values for name in ("theta_i", "theta_r", "phi")]
    random = np.random.default_rng(3)
    fits = []
    for values in material.draw(6, random):
        stokes = material.space.build(values).stokes(*angles)
        noise = 0.01 * stokes[:, 0]
        measured = {
            name: stokes[:, i] + noise * random.standard_normal(len(noise)) for i, name in enumerate("IQU")
        }
        data = pbrdf.make_dataset(*angles, quantity="brdf", **measured, std=dict.fromkeys(measured, noise))
        fits.append(pbrdf.fit(data, starts=8))
    made = material_from_fits("panels", fits, provenance=["six simulated panels"])
    assert (made.specimens, made.scatter) == (6, "estimated")
    spread = np.sqrt(np.diag(made.covariance))
    assert (np.abs(made.mean - material.mean) < 4.0 * spread / np.sqrt(6.0)).all()
    ratio = spread / np.sqrt(np.diag(material.covariance))
    assert ((ratio > 0.3) & (ratio < 3.0)).all()


def test_a_model_alone_has_the_assumed_scatter():
    made = material_from_model("paint", pbrdf.load_paint("white"), scatter={"n": 0.05})
    free = made.space.free
    assert np.sqrt(np.diag(made.covariance)) == pytest.approx(assumed_scatter(free, {"n": 0.05}))
    assert made.values["kappa"] == 0.0
    assert made.scatter == "assumed"
    assert made.values == pytest.approx(dict(pbrdf.load_paint("white").values))


@pytest.mark.parametrize(
    ("scatter", "said"),
    [
        ({"nu": 0.1}, "no free parameter 'nu'"),
        ({"n": 0.0}, "must be above 0"),
        ({"n": np.nan}, "must be above 0"),
    ],
)
def test_scatter_that_is_none(scatter, said):
    with pytest.raises(FitError, match=said):
        material_from_model("paint", pbrdf.load_paint("white"), scatter=scatter)


def test_specimens_keep_within_the_domain():
    drawn = bundled_library()["pearl-white"].draw(5000, np.random.default_rng(1))
    for values in drawn[:50]:
        bundled_library()["pearl-white"].space.build(values)
    assert np.isfinite(drawn).all()


def test_bounds_are_those_that_the_options_allow():
    """With the visible normalisation k ends above 1/3: every corner of the bounds is a model."""
    paint = pbrdf.DoubleGauss(**pbrdf.load_paint("white").values, normalization="visible")
    material = material_from_model("visible", paint)
    place = material.space.names.index("k")
    assert material.space.lower[place] > 1.0 / 3.0
    material.space.build(material.space.lower)
