"""Integrated likelihoods, against integrals by SciPy and by symmetries."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

import pbrdf
from pbrdf.identification.evidence import evidence
from pbrdf.identification.library import bundled_library
from pbrdf.identification.material import Material
from pbrdf.inversion.observations import Observations

ANGLES = [np.radians([20.0, 35.0, 50.0, 60.0]), np.radians([40.0, 35.0, 20.0, 70.0]), np.zeros(4)]


def observed(model, noise=0.01, factor=1.0, seed=1):
    """One measurement of I, Q, U."""
    true = factor * model.stokes(*ANGLES)[:, :3].T
    std = np.broadcast_to(noise * true[0], true.shape).copy()
    noisy = true + std * np.random.default_rng(seed).standard_normal(true.shape)
    return Observations(*ANGLES, ("I", "Q", "U"), noisy, std, (1.0, 0.0, 0.0, 0.0), True)


def of_one_parameter(material, name):
    """The material with one parameter free, the others held at their means."""
    space = material.space
    place = space.names.index(name)
    kept = [place]
    values = space.to_parameters(material.mean)
    fixed = {n: float(v) for n, v in zip(space.names, values, strict=True) if n != name}
    smaller = replace(
        space,
        free=tuple(space.free[i] for i in kept),
        lower=space.lower[kept],
        upper=space.upper[kept],
        fixed={**space.fixed, **fixed},
        terms=(),
    )
    return Material(material.name, smaller, material.mean[kept], material.covariance[np.ix_(kept, kept)])


@pytest.mark.parametrize("name", ["n", "t", "a"])
def test_integral_over_one_parameter(name):
    """log of the integrated likelihood ratio of two materials, by adaptive quadrature."""
    library = bundled_library()
    materials = [of_one_parameter(library[m], name) for m in ("matte-white-thick", "matte-white-thin")]
    data = observed(pbrdf.load_paint("matte-white-thick"), noise=0.02)

    def integral(material):
        def density(z):
            unknown = material.mean + z * material.root[0]
            model = material.space.build(material.space.to_parameters(unknown))
            modelled = model.stokes(*ANGLES)[:, :3].T
            misfit = (((modelled - data.values) / data.std) ** 2).sum()
            return np.exp(-0.5 * misfit - 0.5 * z * z + 200.0) / np.sqrt(2.0 * np.pi)

        return np.log(
            quad(density, -8.0, 8.0, points=[-2.0, 0.0, 2.0], epsabs=0.0, epsrel=1e-8, limit=200)[0]
        )

    found = evidence(materials, [data]).log_evidence[0]
    assert found[0] - found[1] == pytest.approx(integral(materials[0]) - integral(materials[1]), abs=0.05)


def test_distance_of_a_linear_model_is_that_of_its_predictive_distribution():
    """With a small scatter the model is linear: (y − m)ᵀ (J Σ Jᵀ + R)⁻¹ (y − m)."""
    from pbrdf.inversion.problem import derivatives

    material = bundled_library()["cd-back"]
    material = replace(material, covariance=1e-4 * material.covariance)
    data = observed(pbrdf.load_paint("cd-back"), noise=1e-3)
    values, jacobian = derivatives(material.space, material.mean[None], data, data.channels)
    J = jacobian[0].reshape(-1, len(material.mean))
    off = data.values.T.ravel() - values[0].ravel()
    predictive = J @ material.covariance @ J.T + np.diag(data.std.T.ravel() ** 2)
    expected = off @ np.linalg.solve(predictive, off)
    found = evidence([material], [data])
    assert found.distance[0, 0] == pytest.approx(expected, rel=1e-3)
    assert found.degrees_of_freedom[0] == 12
    # and the evidence is the normal density, but for the measurement's own constant
    determinant = np.linalg.slogdet(predictive)[1] - np.log(data.std**2).sum()
    assert found.log_evidence[0, 0] == pytest.approx(-0.5 * expected - 0.5 * determinant, abs=1e-2)


def test_an_unknown_gain_leaves_only_the_shape():
    """The same light, ten thousand times as many counts: every material is as likely as before."""
    materials = bundled_library().materials
    model = pbrdf.load_paint("pearl-white")
    one, other = (observed(model, factor=factor) for factor in (1.0, 1e4))
    found = evidence(materials, [one], gain=True), evidence(materials, [other], gain=True)
    assert found[0].distance == pytest.approx(found[1].distance, rel=1e-5, abs=1e-5)
    apart = found[0].log_evidence - found[1].log_evidence
    assert apart - apart[0, 0] == pytest.approx(0.0, abs=1e-4)
    assert found[0].degrees_of_freedom[0] == 11


def test_ratios_know_no_gain():
    materials = bundled_library().materials
    data = observed(pbrdf.load_paint("white"))
    ratios = replace(
        data,
        channels=("Q_over_I", "U_over_I"),
        values=data.values[1:] / data.values[0],
        std=np.full((2, 4), 0.01),
    )
    with_gain, without = (evidence(materials, [ratios], gain=gain) for gain in (True, False))
    assert np.array_equal(with_gain.log_evidence, without.log_evidence)
    assert with_gain.degrees_of_freedom[0] == 8


def test_a_measurement_that_says_nothing_leaves_all_materials_alike():
    data = observed(pbrdf.load_paint("white"), noise=1.0)
    blind = replace(data, std=np.full_like(data.std, 1e6))
    found = evidence(bundled_library().materials, [blind])
    assert found.log_evidence == pytest.approx(0.0, abs=1e-6)
    assert found.distance == pytest.approx(0.0, abs=1e-6)


def test_many_measurements_are_each_by_itself():
    materials = bundled_library().materials
    data = [observed(pbrdf.load_paint(name), seed=i) for i, name in enumerate(pbrdf.PAINTS)]
    together = evidence(materials, data)
    for b, one in enumerate(data):
        alone = evidence(materials, [one])
        assert together.log_evidence[b] == pytest.approx(alone.log_evidence[0], rel=1e-4, abs=1e-4)
        assert together.distance[b] == pytest.approx(alone.distance[0], rel=1e-4, abs=1e-4)


def test_parts_of_many_measurements(monkeypatch):
    """More than are looked at together, with an unknown gain: as one by one."""
    import pbrdf.identification.evidence as module

    materials = bundled_library().materials
    data = [observed(pbrdf.load_paint(name), seed=i) for i, name in enumerate(pbrdf.PAINTS)]
    whole = evidence(materials, data, gain=True)
    monkeypatch.setattr(module, "TOGETHER", 2)
    parts = evidence(materials, data, gain=True)
    assert parts.log_evidence == pytest.approx(whole.log_evidence, rel=1e-4, abs=1e-4)
    assert np.array_equal(parts.degrees_of_freedom, whole.degrees_of_freedom)
    for c in range(len(materials)):
        assert parts.values[c] == pytest.approx(whole.values[c], rel=1e-4)


def test_a_turned_sample_is_recognised_if_its_offset_is_allowed_for():
    """Sample turned by one degree in the plane of incidence: the glossy paint's peak is elsewhere."""
    offset = np.radians(1.0)
    model = pbrdf.load_paint("white")
    true = model.stokes(ANGLES[0] + offset, ANGLES[1] - offset, ANGLES[2])[:, :3].T
    std = np.broadcast_to(0.01 * true[0], true.shape).copy()
    data = Observations(*ANGLES, ("I", "Q", "U"), true, std, (1.0, 0.0, 0.0, 0.0), True)
    materials = [bundled_library()["white"]]
    assert evidence(materials, [data]).distance[0, 0] > 25.0
    assert evidence(materials, [data], angle=offset).distance[0, 0] < 12.0


@pytest.mark.parametrize("first", [2.87, 2.5, -2.5])
def test_an_unusual_specimen_is_found_at_the_flank_of_a_lobe(first):
    """A rough panel near grazing: a first step from the mean goes past the lobe, to where nothing of it is left."""
    material = bundled_library()["cd-back"]
    z = np.zeros(len(material.mean))
    z[0] = first
    model = material.space.build(material.space.to_parameters(material.mean + material.root @ z))
    angles = [np.radians([40.0, 65.6]), np.radians([20.0, 79.4]), np.zeros(2)]
    exact = model.stokes(*angles)[:, :3].T
    std = np.broadcast_to(0.03 * exact[0], exact.shape)
    data = Observations(*angles, ("I", "Q", "U"), exact, std, (1.0, 0.0, 0.0, 0.0), True)
    # the true specimen costs |z|², the most likely one less
    assert evidence([material], [data]).distance[0, 0] <= first**2 + 1e-6
