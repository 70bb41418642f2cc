"""Every Mueller matrix is physically realisable: Cloude's coherency eigenvalues ≥ −1e-12 f00."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import independent as ref
from pbrdf.models import DoubleGauss, ReciprocalDoubleGauss

OPTIONS = [
    (DoubleGauss, {}),
    (DoubleGauss, {"normalization": "visible", "transmittance": "amplitude", "shadowing": "smith"}),
    (DoubleGauss, {"transmittance": "amplitude", "shadowing": "none"}),
    (ReciprocalDoubleGauss, {}),
    (ReciprocalDoubleGauss, {"shadowing": "smith"}),
]
IDS = ["default", "visible-amplitude-smith", "weighted-amplitude-none", "reciprocal", "reciprocal-smith"]


def check(f):
    assert np.isfinite(f).all()
    # the tail of the lobe underflows; a matrix of zeros is realisable too
    f00 = f[..., 0, 0]
    assert (f00 > 0).all()
    eigenvalues = ref.coherency_eigenvalues(f / f00[..., None, None])
    assert eigenvalues.min() >= -1e-12
    np.testing.assert_allclose(eigenvalues.sum(-1), 1.0, atol=1e-12)


def test_the_criterion_itself():
    """It tells: a mixture of Jones matrices passes; M43 = +M34 (the print) fails by −0.093."""
    rng = np.random.default_rng(0)
    J = rng.normal(size=(20, 5, 2, 2)) + 1j * rng.normal(size=(20, 5, 2, 2))
    mixed = ref.mueller_from_jones(J).mean(1)
    assert (ref.coherency_eigenvalues(mixed) / mixed[:, :1, 0]).min() > -1e-14
    right = ref.mirror_mueller(np.radians(60), 2 - 1.5j)
    np.testing.assert_allclose(ref.coherency_eigenvalues(right), [0, 0, 0, right[0, 0]], atol=1e-15)
    printed = right.copy()
    printed[2, 3] = printed[3, 2]
    assert ref.coherency_eigenvalues(printed)[0] == pytest.approx(-0.093, abs=5e-4)
    np.testing.assert_allclose(ref.coherency_eigenvalues(printed), [-0.093, 0.029, 0.093, 0.294], atol=6e-4)


@pytest.mark.parametrize(("model", "options"), OPTIONS, ids=IDS)
def test_random_parameters_in_bounds(model, options):
    """5000 random models and geometries up to 89.9°, half of them absorbing."""
    p, g = ref.random_case(np.random.default_rng(7), 5000)
    if options.get("normalization") == "visible":
        p["k"] = np.maximum(p["k"], 0.34)
    check(model(**p, **options).mueller(*g.values()))


@pytest.mark.parametrize("part", ["specular", "diffuse"])
@pytest.mark.parametrize("model", [DoubleGauss, ReciprocalDoubleGauss])
def test_each_part_alone(model, part):
    p, g = ref.random_case(np.random.default_rng(9), 2000, sigma=(0.1, 0.6), theta_max=85)
    f = model(**p).mueller(*g.values(), part=part)
    check(f[f[:, 0, 0] > 1e-200])


@given(arrays(float, (10, 16), elements=st.floats(0.0, 1.0)))
@pytest.mark.parametrize(("model", "options"), OPTIONS, ids=IDS)
def test_corners_of_the_bounds(model, options, unit):
    """Hypothesis looks for bad corners: bounds, 0°, 89.9°, φ = 0 and ±π, κ = 0, t = 0 and 1."""
    p = {}
    for u, name in zip(unit, ref.PARAMETERS, strict=False):
        p[name] = ref.LOWER[name] + u * (ref.UPPER[name] - ref.LOWER[name])
    p["k"] = np.maximum(p["k"], 0.34)
    theta = np.radians(89.9) * unit[7:9]
    check(model(**p, **options).mueller(*theta, np.pi * (2 * unit[9] - 1)))


@pytest.mark.parametrize(("model", "options"), OPTIONS, ids=IDS)
@pytest.mark.parametrize("index", [1.62, 2 - 1.5j, 0.18 - 3.4j], ids=str)
def test_special_geometries(model, options, index):
    """Normal incidence and view, exact mirror, exact backscatter, grazing; σ from 0.002 to 0.6."""
    degrees = np.array([0.0, 1e-9, 1e-4, 0.1, 30.0, 60.0, 89.0, 89.9])
    i, r, phi, sigma = np.meshgrid(
        np.radians(degrees),
        np.radians(degrees),
        [0.0, -0.0, 1e-12, 1.0, -2.0, np.pi, -np.pi, np.pi - 1e-9],
        [0.002, 0.006, 0.1, 0.6],
    )
    f = model(sigma, index, 1.0, 1.3, 0.5, 0.7, **options).mueller(i, r, phi)
    check(f.reshape(-1, 4, 4))
