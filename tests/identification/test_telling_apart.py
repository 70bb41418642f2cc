"""Which reading tells materials apart: limits, symmetries, integrals by SciPy, and simulated specimens."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import nnls
from scipy.stats import chi2, norm

import pbrdf
from pbrdf.errors import FitError
from pbrdf.identification.conformal import Calibration, nominal, probabilities
from pbrdf.identification.evidence import evidence, linearised, posterior
from pbrdf.identification.identify import identify
from pbrdf.identification.library import Library, bundled_library
from pbrdf.identification.telling_apart import expected_information, next_measurement, non_negative
from pbrdf.planning.candidates import in_plane_candidates

LIBRARY = bundled_library()
PAIR = Library((LIBRARY["cd-back"], LIBRARY["matte-white-thick"]))


def measurement(name="cd-back", angles=((40.0,), (20.0,), (0.0,)), noise=0.03, seed=0, channels="IQU"):
    angles = [np.radians(a) for a in angles]
    stokes = pbrdf.load_paint(name).stokes(*angles)
    random = np.random.default_rng(seed)
    std = noise * stokes[:, 0]
    values = {n: stokes[:, i] + std * random.standard_normal(len(std)) for i, n in enumerate(channels)}
    return pbrdf.make_dataset(*angles, quantity="brdf", **values, std=dict.fromkeys(values, std))


def test_two_normal_distributions_of_one_number():
    """Mutual information and rate of right choices by adaptive quadrature."""
    p, m, s = np.array([0.3, 0.7]), np.array([0.0, 1.5]), np.array([1.0, 0.6])

    def densities(y):
        return p * norm.pdf(y, m, s)

    def told(y):
        each = densities(y)
        return (each * np.log2(each / p / each.sum())).sum()

    limit = np.array([2.0, 1.0])
    information, right, left = expected_information(p, m[None, :, None], (s**2)[None, :, None, None], limit)
    limits = {"epsabs": 1e-9, "limit": 200}
    assert information[0] == pytest.approx(quad(told, -10, 10, **limits)[0], abs=5e-3)
    assert right[0] == pytest.approx(quad(lambda y: densities(y).max(), -10, 10, **limits)[0], abs=5e-3)
    root = np.sqrt(limit) * s
    ends = norm.cdf(np.stack([m - root, m + root])[..., None], m, s)  # ends of k, readings of c
    assert left[0] == pytest.approx(float(((ends[1] - ends[0]) @ p).sum()), abs=6e-3)


def test_limits_of_the_information():
    p = np.array([0.5, 0.3, 0.2])
    entropy = -(p * np.log2(p)).sum()
    mean = np.array([[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]] * 3)
    covariance = np.eye(2) * np.array([1e-8, 1.0, 1e8])[:, None, None, None] * np.ones((3, 3, 1, 1))
    limit = np.full(3, 6.0)
    inside = chi2.cdf(6.0, 2)
    information, right, left = expected_information(p, mean, covariance, limit)
    assert left[0] == pytest.approx(inside, abs=0.01)  # its own set alone
    assert left[2] == pytest.approx(3.0 * inside, abs=0.02)
    assert information[0] == pytest.approx(entropy)  # separates perfectly
    assert right[0] == pytest.approx(1.0)
    assert 0.0 < information[1] < entropy
    assert information[2] == pytest.approx(0.0, abs=1e-4)  # drowned in noise
    assert right[2] == pytest.approx(p.max(), abs=1e-4)
    same, right, left = expected_information(p, np.zeros((1, 3, 2)), covariance[:1], limit)
    assert left[0] == pytest.approx(3.0 * inside, abs=0.02)
    assert expected_information(p, mean, covariance, np.full(3, -1.0))[2].tolist() == [0.0] * 3
    assert same[0] == pytest.approx(0.0, abs=1e-12)
    assert right[0] == pytest.approx(p.max())


def test_information_does_not_depend_on_units_or_order():
    rng = np.random.default_rng(2)
    p, mean = np.array([0.2, 0.5, 0.3]), rng.normal(size=(4, 3, 2))
    root = rng.normal(size=(4, 3, 2, 2))
    covariance = root @ root.swapaxes(-1, -2) + 0.1 * np.eye(2)
    turn = np.array([[3.0, 0.0], [-0.7, 0.2]])  # lower triangular: the same points of the sequence
    limit = np.array([3.0, 5.0, 4.0])
    found = np.array(expected_information(p, mean, covariance, limit))
    other = np.array(expected_information(p, mean @ turn.T, turn @ covariance @ turn.T, limit))
    np.testing.assert_allclose(other, found, rtol=1e-9)
    shuffled = np.array(expected_information(p[::-1], mean[:, ::-1], covariance[:, ::-1], limit[::-1]))
    np.testing.assert_allclose(shuffled, found, rtol=1e-9)


@pytest.mark.slow
def test_more_noise_tells_less():
    found = identify(measurement(), PAIR)
    angles = np.radians([37.0, 60.0]), np.radians([43.0, 60.0]), 0.0
    told = []
    for noise in (0.01, 0.1, 1.0, 1e4):
        ranked = next_measurement(found, angles, noise=noise)
        assert (np.diff(ranked.information) <= 0.0).all()  # the best first
        assert ranked.information[0] <= ranked.entropy
        told.append(ranked.information[0])
    assert told == sorted(told, reverse=True)
    assert told[-1] < 1e-4


@pytest.mark.slow
def test_two_names_of_one_material_are_not_told_apart():
    twin = replace(LIBRARY["cd-back"], name="twin")
    found = identify(measurement(), Library((LIBRARY["cd-back"], twin)))
    ranked = next_measurement(found)
    assert ranked.entropy == pytest.approx(1.0)
    assert ranked.information.max() < 1e-9
    assert ranked.expected_right.max() == pytest.approx(0.5)


@pytest.mark.slow
def test_specimens_without_scatter_are_told_apart_for_sure():
    materials = [replace(m, covariance=1e-8 * m.covariance) for m in PAIR.materials]
    # the data say nothing: both remain
    found = identify(measurement(noise=3.0), Library(tuple(materials)))
    ranked = next_measurement(found, (np.radians(65.0), np.radians(65.0), 0.0), noise=1e-4)
    assert ranked.information[0] == pytest.approx(ranked.entropy, rel=1e-6)
    assert ranked.expected_right[0] == pytest.approx(1.0)


@pytest.mark.slow
def test_a_gain_that_the_data_fixed_is_known_to_the_next_reading():
    """Without data of its own the gain would hide any difference of brightness."""
    data = measurement(angles=((40.0, 40.0), (20.0, 0.0), (0.0, 0.0)), noise=0.02)
    angles = np.radians([40.0]), np.radians([42.0]), 0.0
    known = next_measurement(identify(data, PAIR, gain=False, confidence=0.999), angles)
    free = next_measurement(identify(data, PAIR, gain=True, confidence=0.999), angles)
    # of a reading's intensity the gain leaves far less than its prior, three e-folds, uncertain
    assert (free.std[0, :, 0] < 0.8 * free.mean[0, :, 0]).all()
    assert free.information[0] > 0.2
    assert known.materials and free.entropy > 0.5


@pytest.mark.slow
def test_linearised_signals_are_those_of_the_model():
    """Values and derivatives along z, with gain and angle, against differences."""
    found = identify(measurement(), PAIR, gain=True, angle=0.01)
    z, _, centre = posterior(PAIR["cd-back"], [found.data], gain=True, angle=0.01)
    assert z.shape == (1, 8)
    args = PAIR["cd-back"], float(centre[0]), 0.01, found.data
    material, centre, angle, data = args
    values, jacobian = linearised(material, z[0], centre, angle, data)
    step = 1e-4
    for i in range(8):
        up, down = z[0].copy(), z[0].copy()
        up[i] += step
        down[i] -= step
        slope = (linearised(material, up, centre, angle, data)[0]
                 - linearised(material, down, centre, angle, data)[0]) / (2.0 * step)  # fmt: skip
        np.testing.assert_allclose(jacobian[..., i], slope, rtol=1e-5, atol=1e-7 * np.abs(values).max())


def test_candidates_of_all_remaining_materials_and_noise_of_the_data():
    ranked = next_measurement(identify(measurement(noise=0.05), PAIR))
    own = in_plane_candidates(PAIR["cd-back"].model)
    there = set(np.round(ranked.geometries.sample_angle, 6))
    assert set(np.round(own.sample_angle, 6)) <= there
    np.testing.assert_allclose(ranked.noise[:, 0], 0.05, rtol=0.15)
    assert (ranked.noise[:, 1] == 0.0).all()
    assert ranked.mean.shape == (len(ranked.geometries), 2, 3)


def test_relative_and_absolute_part_of_assumed_noise():
    data = measurement(angles=((30.0, 50.0, 65.0), (30.0, 35.0, 75.0), (0.0, 0.0, 0.0)))
    found = identify(data, PAIR, noise="0.02,0.1", confidence=0.999999)
    intensity = found.data.values[0]
    ranked = next_measurement(found, (0.5, 0.5, 0.0))
    np.testing.assert_allclose(ranked.noise[0], [0.02, 0.1 * np.median(intensity)], rtol=1e-6)


def test_parts_of_the_noise_are_those_of_scipys_least_squares():
    rng = np.random.default_rng(3)
    size = rng.lognormal(size=9)
    for std in (0.03 * size, np.full(9, 0.2), np.hypot(0.02 * size, 0.1), rng.lognormal(size=9), 0.1 / size):
        columns = np.stack([size**2, np.ones(9)], axis=1) / std[:, None] ** 2
        np.testing.assert_allclose(non_negative(columns), nnls(columns, np.ones(9))[0], atol=1e-12)
    assert non_negative(np.ones((4, 2))).tolist() == [1.0, 0.0]  # one is enough


def test_a_calibration_says_what_leaves_the_set():
    """Materials with few calibration measurements never leave; the limits are those of the calibrated p-values."""
    found = identify(measurement(), PAIR)
    many = Calibration(tuple(PAIR.names), (np.linspace(0.1, 1.0, 99), np.linspace(0.1, 1.0, 5)))
    calibrated = next_measurement(identify(measurement(), PAIR, calibration=many), (0.5, 1.2, 0.0))
    assert calibrated.expected_left[0] < next_measurement(found, (0.5, 1.2, 0.0)).expected_left[0] + 1.0
    assert calibrated.expected_left[0] >= 1.0  # the second one always


def test_what_cannot_be():
    found = identify(measurement(), PAIR)
    with pytest.raises(FitError, match="noise=0"):
        next_measurement(found, noise=0.0)
    alone = identify(measurement(), Library((LIBRARY["white"],)))
    with pytest.raises(FitError, match="one material"):
        next_measurement(alone)


def specimens(found, material, count, rng):
    """Parameters of specimens that the data so far allow: draws from the material, weighted by their likelihood."""
    data = found.data
    values = material.draw(20_000, rng)
    modelled = signals(material, values, (data.theta_i, data.theta_r, data.phi))
    misfit = (((modelled - data.values) / data.std) ** 2).sum(axis=(1, 2))
    weight = np.exp(-0.5 * (misfit - misfit.min()))
    return values[rng.choice(len(values), count, p=weight / weight.sum())]


def signals(material, values, angles):
    space = material.space
    named = {p.name: values[:, i, None] for i, p in enumerate(space.free)} | dict(space.fixed)
    model = space.model.from_values(named, **space.options)
    return np.moveaxis(model.stokes(*(angle[None] for angle in angles))[..., :3], -1, 1)


@pytest.mark.slow
def test_against_simulated_specimens_and_readings():
    """Specimens that the data so far allow, a further reading each, identified with it: what it really told."""
    found = identify(measurement(), PAIR)
    ranked = next_measurement(found)
    materials, p = [PAIR[name] for name in ranked.materials], ranked.probability
    assert p.max() < 0.7  # one reading at 40°/20° leaves both
    rng = np.random.default_rng(1)
    data, count, noise = found.data, 1000, 0.03
    chosen = {
        (39.5, 45.5): 0.1,
        (50.0, 80.0): 0.05, (36.4, 38.6): 0.05, (50.0, 50.0): 0.05, (20.0, 45.0): 0.05, (55.0, 5.0): 0.01,
    }  # fmt: skip
    told, expected = [], []
    for pair, within in chosen.items():
        angles = [*np.radians(pair)[:, None], np.zeros(1)]
        batch, truth = [], []
        for c, material in enumerate(materials):
            true = signals(material, specimens(found, material, count, rng), angles)
            std = np.broadcast_to(noise * true[:, :1], true.shape)
            for reading, own in zip(true + std * rng.standard_normal(true.shape), std, strict=True):
                batch.append(
                    replace(
                        data,
                        **{
                            name: np.append(getattr(data, name), angle)
                            for name, angle in zip(("theta_i", "theta_r", "phi"), angles, strict=True)
                        },
                        values=np.concatenate([data.values, reading], axis=1),
                        std=np.concatenate([data.std, own], axis=1),
                        group=None,
                        scale=None,
                    )
                )
                truth.append(c)
        judged = evidence(materials, batch)
        after = probabilities(judged.log_evidence)
        truth = np.array(truth)
        rows, weight = np.arange(len(truth)), p[truth] / count
        told.append(float((weight * np.log2(after[rows, truth] / p[truth])).sum()))
        right = float((weight * (after.argmax(axis=1) == truth)).sum())
        inside = nominal(judged.distance, judged.degrees_of_freedom) > 0.05
        here = next_measurement(found, angles, noise=noise)
        assert here.expected_left[0] == pytest.approx(
            float((weight * inside.sum(axis=1)).sum()), abs=2.0 * within
        )
        expected.append(here.information[0])
        assert here.information[0] == pytest.approx(told[-1], abs=within)
        assert here.expected_right[0] == pytest.approx(right, abs=within)
    assert np.argsort(told)[:2].tolist() == np.argsort(expected)[:2].tolist()
