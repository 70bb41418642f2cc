"""Parameters free for each group or wavelength, from data to result: SciPy on the predictions finds the same."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares

import pbrdf
from pbrdf.inversion.minimise import solve
from pbrdf.inversion.problem import derivatives, predict, residuals

pytestmark = pytest.mark.slow

MODEL = pbrdf.DoubleGauss(0.08, 1.55, 0.5, 1.1, 0.2, 0.5)
HELD = {"k": 1.1, "b": 0.2, "t": 0.5}


def dataset(groups: int = 4, wavelengths: int = 1, count: int = 12):
    """One amplitude for each group, one index for each wavelength, one gain for each group; noise of 1 %."""
    rng = np.random.default_rng(11)
    theta_i, theta_r = np.deg2rad(rng.uniform(10.0, 60.0, (2, groups, wavelengths, count)))
    phi = np.where(rng.random(theta_i.shape) < 0.5, 0.0, rng.uniform(0.0, np.pi, theta_i.shape))
    theta_r[..., :4], phi[..., :4] = theta_i[..., :4] + np.deg2rad([-4.0, -1.0, 2.0, 5.0]), 0.0
    group, wavelength = np.meshgrid(np.arange(groups), 450.0 + 50.0 * np.arange(wavelengths), indexing="ij")
    stokes = np.stack(
        [
            MODEL.replace(a=0.3 + 0.1 * g, n=1.55 + (w - 450.0) / 1000.0).stokes(
                theta_i[g, i], theta_r[g, i], phi[g, i]
            )
            for g in range(groups)
            for i, w in enumerate(wavelength[0])
        ]
    ).reshape(groups * wavelengths * count, -1)
    std = 0.01 * np.abs(stokes[:, :1]) + 1e-4
    noisy = stokes[:, :3] + std * rng.standard_normal((len(stokes), 3))
    return pbrdf.make_dataset(
        theta_i.ravel(),
        theta_r.ravel(),
        phi.ravel(),
        quantity="brdf",
        **{c: noisy[:, i] for i, c in enumerate("IQU")},
        std=dict.fromkeys("IQU", std[:, 0]),
        group=np.repeat(group.ravel(), count),
        wavelength=np.repeat(wavelength.ravel(), count),
    )


def by_scipy(result):
    """The optimum that SciPy finds from not far away, by the residuals of predictions, priors included."""
    space, data = result.space, result.data
    priors = [(i, *t.prior) for i, t in enumerate(space.terms) if t.prior is not None]
    low, high = space.box

    def residual(u):
        modelled = predict(space, u, data, data.channels)
        parts = [(modelled[c] - data.values[i]) / data.std[i] for i, c in enumerate(data.channels)]
        values = space.to_parameters(u)
        return np.concatenate([*parts, [(values[i] - mean) / std for i, mean, std in priors]])

    def jacobian(u):
        _, rows = derivatives(space, u[None], data, data.channels)
        weighted = rows[0] / data.std.T[:, :, None]
        extra = np.zeros((len(priors), len(u)))
        slope = space.derivative(space.to_parameters(u))
        for row, (i, _, std) in enumerate(priors):
            extra[row, i] = slope[i] / std
        return np.concatenate([*np.moveaxis(weighted, 1, 0), extra])

    return least_squares(
        residual,
        np.clip(0.8 * result.unknowns + 0.2 * space.to_unknowns(result.start_values[0]), low, high),
        jac=jacobian,
        bounds=(low, high),
        **dict.fromkeys(("xtol", "ftol", "gtol"), 1e-13),
    )


@pytest.mark.parametrize(
    ("shape", "arguments"),
    [
        ((5, 1), {"split": {"a": "group"}}),
        ((2, 3), {"split": {"a": "group", "n": "wavelength"}}),
        ((4, 2), {"split": {"a": "group", "n": "wavelength"}, "priors": {"a": (0.45, 0.003)}}),
        ((3, 1), {"nuisances": ["gain:group"], "priors": {"a": (0.4, 0.01)}}),
    ],
)
def test_scipy_finds_the_same_optimum(shape, arguments):
    result = pbrdf.fit(dataset(*shape), fix=HELD, starts=4, **arguments)
    peer = by_scipy(result)
    assert result.settled
    assert result.goodness.chi2 == pytest.approx(2.0 * peer.cost, rel=1e-8)
    spread = np.sqrt(np.diag(np.linalg.inv(peer.jac.T @ peer.jac)))
    np.testing.assert_allclose((result.unknowns - peer.x) / spread, 0.0, atol=1e-3)
    own = np.sqrt(np.diag(np.linalg.inv(result.information)))
    np.testing.assert_allclose(own / spread, 1.0, rtol=1e-4)


def test_a_group_held_out_is_predicted_by_the_mean_of_the_others():
    result = pbrdf.fit(dataset(4), fix=HELD, starts=4, split={"a": "group"}, hold_out="group=2")
    assert [n for n in result.estimates if n.startswith("a[")] == ["a[0]", "a[1]", "a[3]"]
    unknowns = result.unknowns[[i for i, t in enumerate(result.space.terms) if t.split]]
    mean = result.model.replace(a=float(np.exp(unknowns.mean())))
    out = result.comparison.sel(geometry=result.comparison["held_out"])
    angles = (out[name].values for name in ("theta_i", "theta_r", "phi"))
    np.testing.assert_allclose(out["I_modelled"].values, mean.stokes(*angles)[:, 0], rtol=1e-6)


def test_a_profile_holds_one_groups_parameter():
    """The model is linear in a: the ends of the interval lie 1.96 standard errors from the optimum."""
    result = pbrdf.fit(dataset(3), fix={**HELD, "sigma": 0.08}, starts=4, split={"a": "group"})
    interval = result.profile(["a[1]"]).intervals["a[1]"]
    std = result.estimates["a[1]"].std
    assert interval.lower == pytest.approx(interval.value - 1.96 * std, abs=0.03 * std)
    assert interval.upper == pytest.approx(interval.value + 1.96 * std, abs=0.03 * std)


def test_a_group_without_weight_keeps_its_start():
    """As in cross-validation: nothing speaks for the parameter of a group whose values have no weight."""
    from dataclasses import replace

    result = pbrdf.fit(dataset(3), fix=HELD, starts=4, split={"a": "group"})
    data = replace(result.data, std=np.where(result.data.group == 1, np.inf, result.data.std))
    column = result.space.names.index("a[1]")
    start = result.unknowns[None] + 0.1
    solution = solve(residuals(result.space, [data]), start, *result.space.box)
    assert solution.converged.all() and solution.u[0, column] == start[0, column]
