"""Derivatives through Dr.Jit against central differences of the NumPy values."""

from __future__ import annotations

import drjit as dr
import numpy as np
import pytest

from pbrdf.backend import get_backend
from pbrdf.models import DoubleGauss, ReciprocalDoubleGauss

VALUES = {"sigma": 0.0398, "n": 1.6207, "kappa": 0.3, "a": 1.5174, "k": 1.2504, "b": 0.1827, "t": 0.6717}
NAMES = (*VALUES, "theta_i", "theta_r", "phi")
#: a paint near its specular peak; the wedge of lit and seen facets, on opposite sides and on the same side
REGIMES = [
    {**VALUES, "theta_i": 0.5, "theta_r": 0.62, "phi": 0.2},
    {**VALUES, "sigma": 0.2, "theta_i": np.radians(80.0), "theta_r": np.radians(65.0), "phi": 0.4},
    {**VALUES, "sigma": 0.2, "theta_i": np.radians(80.0), "theta_r": np.radians(65.0), "phi": 2.4},
]
DEFAULT = pytest.param(DoubleGauss, {}, id="default")
OTHER = pytest.param(
    DoubleGauss,
    {"normalization": "visible", "transmittance": "amplitude", "shadowing": "smith"},
    id="visible-amplitude-smith",
)
RECIPROCAL = pytest.param(ReciprocalDoubleGauss, {}, id="reciprocal")
STEP = 1e-6

#: one lane for every (regime, name)
LANES = [(regime, name) for regime in REGIMES for name in NAMES]
CENTRE = {name: np.array([regime[name] for regime, _ in LANES]) for name in NAMES}
DIRECTION = {name: np.array([float(lane == name) for _, lane in LANES]) for name in NAMES}


def evaluate(cls, options, at):
    return cls(**{k: at[k] for k in VALUES}, **options).mueller(at["theta_i"], at["theta_r"], at["phi"])


def numerical(cls, options):
    """Central differences of all sixteen elements, (lanes, 4, 4), and the size of f."""
    f = [
        evaluate(cls, options, {k: CENTRE[k] + sign * STEP * DIRECTION[k] for k in NAMES}) for sign in (1, -1)
    ]
    return (f[0] - f[1]) / (2 * STEP), f[0]


def scale_of(derivative, f):
    return np.maximum(abs(derivative).max((1, 2)), abs(f).max((1, 2)))[:, None, None]


# not every model in both modes: tracing and compiling a derivative takes seconds
@pytest.mark.slow
@pytest.mark.parametrize(("cls", "options"), [DEFAULT, OTHER])
def test_forward_mode(cls, options):
    """Every parameter and angle, all sixteen elements: each lane moves one of them by the same ε."""
    Float = get_backend().Float
    epsilon = Float(0.0)
    dr.enable_grad(epsilon)
    f = evaluate(cls, options, {k: Float(CENTRE[k]) + epsilon * Float(DIRECTION[k]) for k in NAMES})
    dr.forward_from(epsilon)
    found = np.array(
        [[np.broadcast_to(f[i, j].grad.numpy(), len(LANES)) for j in range(4)] for i in range(4)]
    )
    expected, value = numerical(cls, options)
    error = abs(np.moveaxis(found, -1, 0) - expected) / scale_of(expected, value)
    worst = int(error.max((1, 2)).argmax())
    assert error.max() < 3e-7, LANES[worst]


@pytest.mark.slow
@pytest.mark.parametrize(("cls", "options"), [DEFAULT, RECIPROCAL])
def test_reverse_mode(cls, options):
    """One sweep back from a weighted sum of all elements gives the gradient in every parameter and angle."""
    Float = get_backend().Float
    weights = np.random.default_rng(0).normal(size=(4, 4))
    leaves = {k: Float(np.array([regime[k] for regime in REGIMES])) for k in NAMES}
    dr.enable_grad(*leaves.values())
    f = evaluate(cls, options, leaves)
    dr.backward(dr.sum(sum(f[i, j] * float(weights[i, j]) for i in range(4) for j in range(4))))
    derivative, value = numerical(cls, options)
    expected = (weights * derivative).sum((1, 2)).reshape(len(REGIMES), len(NAMES))
    found = np.stack([leaf.grad.numpy() for leaf in leaves.values()], -1)
    scale = scale_of(derivative, value).reshape(len(REGIMES), len(NAMES))
    np.testing.assert_allclose(found / scale, expected / scale, atol=1e-6)


def test_forward_mode_with_literal_angles():
    """Dr.Jit literals (Float(0.5)) as angles: the derivative of every element is there, f[3, 3] too."""
    Float = get_backend().Float
    sigma = Float(0.1)
    dr.enable_grad(sigma)
    f = DoubleGauss(sigma, 1.6, 1, 1.2, 0, 0.5).mueller(Float(0.5), Float(0.6), Float(0.2), part="specular")
    dr.forward_from(sigma)
    h = 1e-6
    low, high = (
        DoubleGauss(0.1 + d, 1.6, 1, 1.2, 0, 0.5).mueller(0.5, 0.6, 0.2, part="specular") for d in (-h, h)
    )
    assert f[3, 3].grad.numpy()[0] == pytest.approx((high - low)[3, 3] / (2 * h), rel=1e-6)


def test_gradient_of_an_array_of_directions():
    """Reverse mode over many lanes, both rules at once: the gradients add up."""
    Float = get_backend().Float
    rng = np.random.default_rng(1)
    theta_i, theta_r, phi = rng.uniform(0, 1.4, 50), rng.uniform(0, 1.4, 50), rng.uniform(-3, 3, 50)
    sigma = Float(0.1)
    dr.enable_grad(sigma)
    S = DoubleGauss(**{**VALUES, "sigma": sigma}).stokes(Float(theta_i), Float(theta_r), Float(phi))
    dr.backward(dr.sum(S[0]) + dr.sum(S[1]))
    low, high = (
        DoubleGauss(**{**VALUES, "sigma": 0.1 + d}).stokes(theta_i, theta_r, phi)[:, :2].sum()
        for d in (-STEP, STEP)
    )
    assert sigma.grad.numpy()[0] == pytest.approx((high - low) / (2 * STEP), rel=2e-6)


@pytest.mark.slow
@pytest.mark.parametrize("options", [{}, {"normalization": "visible"}], ids=["weighted", "visible"])
def test_gradients_are_finite_in_special_geometries(options):
    """Normal incidence, normal view, exact backscatter and mirror, grazing: no NaN in any derivative."""
    Float = get_backend().Float
    special = np.array(
        [(0, 0, 0), (0, 0.6, 1), (0.6, 0, 1), (0.6, 0.6, np.pi), (0.6, 0.6, 0), (1.55, 1.5, 3)]
    )
    leaves = {name: Float(np.full(len(special), v)) for name, v in {**VALUES, "sigma": 0.1}.items()}
    dr.enable_grad(*leaves.values())
    f = DoubleGauss(**leaves, **options).mueller(*(Float(angle) for angle in special.T.copy()))
    dr.backward(dr.sum(sum(f[i, j] for i in range(4) for j in range(4))))
    for name, leaf in leaves.items():
        assert np.isfinite(leaf.grad.numpy()).all(), name


def test_derivative_in_kappa_at_zero():
    """A dielectric whose κ is differentiated takes the absorbing formulas: the derivative at κ = 0 exists."""
    kappa = get_backend().Float(0.0)
    dr.enable_grad(kappa)
    f = DoubleGauss(0.1, 1.6, 1, 1.2, 0, 0.5, kappa=kappa).mueller(get_backend().Float(0.5), 0.6, 0.3)
    dr.forward_from(kappa)
    h = 1e-4
    values = [DoubleGauss(0.1, 1.6, 1, 1.2, 0, 0.5, kappa=x).mueller(0.5, 0.6, 0.3) for x in (0.0, h)]
    found = np.array([[f[i, j].grad.numpy()[0] for j in range(4)] for i in range(4)])
    np.testing.assert_allclose(found, (values[1] - values[0]) / h, atol=2e-3 * abs(values[0]).max())
