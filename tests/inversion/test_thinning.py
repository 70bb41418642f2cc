"""Dense data: the part that is searched stands for all, and what comes out is the fit of all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import pbrdf
from pbrdf.inversion import thinning
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.unknowns import space_of, with_terms
from pbrdf.optics.half_difference import facet_tilt

PAINT = pbrdf.DoubleGauss(sigma=0.05, n=1.55, a=0.5, k=1.1, b=0.1, t=0.6)


def dense(count, seed=0, noise=0.03):
    rng = np.random.default_rng(seed)
    angles = np.deg2rad(rng.choice([15, 30, 45, 60], count)), np.deg2rad(rng.uniform(0, 80, count))
    phi = rng.uniform(-np.pi, np.pi, count)
    exact = PAINT.stokes(*angles, phi)[:, 0]
    intensity = exact * (1.0 + noise * rng.standard_normal(count))
    return pbrdf.make_dataset(
        *angles, phi, quantity="brdf", I=intensity, std={"I": noise * exact}, group=np.arange(count) % 3
    )


def problem(ds, **more):
    data = Observations.from_dataset(ds)
    space, _ = space_of("double-gauss", {}, {}, (), {}, {}, data)
    return with_terms(space, data, {}, more.get("split", {}), [], {}, more.get("loss", "linear")), data


def test_few_geometries_are_taken_as_they_are():
    space, data = problem(dense(3 * thinning.ENOUGH - 1))
    assert thinning.draw(space, data) is None


def test_the_part_keeps_the_lobe_and_its_weights_stand_for_all():
    space, data = problem(dense(20_000))
    part = thinning.draw(space, data)
    assert len(part.rows) == len(np.unique(part.rows)) == thinning.ENOUGH
    assert part.weight.sum() == pytest.approx(20_000, rel=0.02)
    tilt = facet_tilt(data.theta_i, data.theta_r, data.phi)
    near = tilt < np.deg2rad(4.0)
    assert np.isin(np.flatnonzero(near), part.rows).mean() > 3.0 * len(part.rows) / 20_000
    # χ² of the part estimates that of all
    thin = part.of(data)
    misfit = [np.sum(((o.values - 0.2) / o.std) ** 2) for o in (thin, data)]
    assert misfit[0] == pytest.approx(misfit[1], rel=0.1)


def test_wavelengths_with_held_values_of_their_own_are_all_drawn():
    """A wavelength of few geometries keeps them, in weight too, as its values are not those of the others."""
    ds = dense(20_000)
    ds = ds.assign_coords(wavelength=("geometry", np.where(np.arange(20_000) % 400, 550.0, 450.0)))
    data = Observations.from_dataset(ds)
    weights = []
    for held in ({450: 1.6, 550: 1.5}, 1.5):
        space, _ = space_of("double-gauss", {}, {"n": held}, (), {}, {}, data)
        part = thinning.draw(space, data)
        weights.append(part.weight[data.wavelength[part.rows] == 450.0].sum())
    assert weights[0] == pytest.approx(50, abs=1e-9) and len(part.rows) == thinning.ENOUGH
    assert weights[1] != pytest.approx(50, rel=0.1)


def test_what_was_not_measured_is_not_drawn_and_every_split_is():
    space, data = problem(dense(20_000), split={"a": "group"})
    hidden = np.arange(20_000) % 2 == 0
    part = thinning.draw(space, replace(data, std=np.where(hidden, np.inf, data.std)))
    assert not hidden[part.rows].any()
    counts = np.unique(data.group[part.rows], return_counts=True)[1]
    assert len(counts) == 3 and counts.min() > 0.25 * len(part.rows)


def test_a_robust_loss_has_no_weights():
    space, data = problem(dense(20_000), loss="cauchy")
    part = thinning.draw(space, data)
    assert (part.weight == 1.0).all()
    np.testing.assert_array_equal(part.of(data).std, data.std[:, part.rows])


@pytest.mark.slow
def test_the_fit_of_dense_data_is_that_of_all_geometries(monkeypatch):
    """The same optimum, χ² and errors as without the part; from few starts, as all geometries are slow."""
    ds = dense(3000)
    quick = pbrdf.fit(ds, starts=4)
    monkeypatch.setattr(thinning, "ENOUGH", 10**9)
    full = pbrdf.fit(ds, starts=4)
    assert [s.name for s in quick.stages] == ["search", "joint"] and len(full.stages) == 1
    assert quick.stages[0].points == 250 and quick.stages[1].points == 3000
    assert any("searched 250 of the 3000 geometries" in note for note in quick.notes)
    assert quick.goodness.chi2 == pytest.approx(full.goodness.chi2, rel=1e-9)
    assert quick.goodness.data == full.goodness.data == 3000
    for name, e in full.estimates.items():
        if e.verdict == "determined":
            assert quick.estimates[name].value == pytest.approx(e.value, abs=1e-4 * e.std)
            assert quick.estimates[name].std == pytest.approx(e.std, rel=1e-5)
            assert abs(e.value - PAINT.values[name]) < 4.0 * e.std
    assert quick.optima[0].chi2 == quick.goodness.chi2


@pytest.mark.slow
def test_the_stepwise_strategy_searches_the_part_too():
    ds = dense(3000)
    result = pbrdf.fit(ds, strategy="stepwise", starts=4)
    names = [(s.name, s.points) for s in result.stages]
    assert names[-2:] == [("search", 250), ("joint", 3000)] and names[0][0] == "diffuse"
    assert result.goodness.chi2 == pytest.approx(pbrdf.fit(ds, starts=4).goodness.chi2, rel=1e-9)
    used = result.comparison["used_for_diffuse"].values
    tilt = result.comparison["facet_tilt"].values
    assert used.any() and tilt[used].min() > tilt[~used].max()


@pytest.mark.slow
def test_folds_of_dense_data_are_refined_on_all_that_is_left():
    ds = dense(3000)
    validated = pbrdf.cross_validate(ds, by="theta_i", folds=2, starts=2)
    for fold in validated.folds:
        assert fold.converged
        assert fold.values["n"] == pytest.approx(1.55, abs=0.05)
