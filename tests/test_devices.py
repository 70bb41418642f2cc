"""The same numbers on every device that Dr.Jit knows: evaluation and batch fit, double and single precision.

Tests marked ``cuda`` need a card and are skipped without one; ``benchmarks/cuda.sh`` runs them where there is one.
"""

from __future__ import annotations

import drjit as dr
import numpy as np
import pytest

import pbrdf
from pbrdf import backend
from pbrdf.inversion.solver import Residuals, solve

PAINT = {"sigma": 0.0398, "n": 1.6207, "a": 1.5174, "k": 1.2504, "b": 0.1827, "t": 0.6717}
DEVICES = [
    "llvm",
    pytest.param(
        "cuda",
        marks=[
            pytest.mark.cuda,
            pytest.mark.skipif(
                not dr.has_backend(dr.JitBackend.CUDA), reason="this machine has no CUDA device"
            ),
        ],
    ),
]


@pytest.fixture(params=DEVICES)
def device(request, monkeypatch):
    """A backend that is active for one test."""
    monkeypatch.setattr(backend, "_chosen", backend._chosen)
    monkeypatch.setattr(backend, "_active", backend._active)
    backend.set_backend(request.param)
    return backend.get_backend()


def test_matrices_of_the_table(device, double_gauss_table):
    table = double_gauss_table
    # where the error of the default accuracy is stated: docs/model.md, section 4
    chosen = (table["normalization"] == "weighted") & (table["sigma"] <= 0.1)
    chosen &= np.maximum(table["theta_i"], table["theta_r"]) <= np.radians(75.0)
    assert chosen.sum() > 10
    row = {k: v[chosen] for k, v in table.items()}
    model = pbrdf.DoubleGauss(**{k: row[k] for k in (*PAINT, "kappa")}, transmittance="flux")
    found = model.mueller(row["theta_i"], row["theta_r"], row["phi"])
    assert np.abs(found - row["M"]).max(axis=(1, 2)) / row["M"][:, 0, 0] == pytest.approx(0.0, abs=4e-5)


def test_single_precision_arrays(device):
    random = np.random.default_rng(1)
    theta_i, theta_r = random.uniform(0.0, 1.2, (2, 500))
    angles = [a.astype(np.float32) for a in (theta_i, theta_r, random.uniform(-np.pi, np.pi, 500))]
    model = pbrdf.DoubleGauss(**PAINT)
    double = model.mueller(*(angle.astype(float) for angle in angles))
    single = model.mueller(*(device.module.Float(angle) for angle in angles))
    found = np.moveaxis(np.array(single), -1, 0)
    assert np.abs(found - double).max(axis=(1, 2)) / double[:, 0, 0] == pytest.approx(0.0, abs=1e-4)


def test_reciprocals_in_double_precision(device):
    """Dr.Jit's fast math leaves them 20 bits on CUDA, and so derivatives that hold one, as log x has 1/x."""
    x = np.random.default_rng(3).uniform(1e-3, 1e3, 1000)
    X = device.upload(device.Float, x)
    assert dr.rcp(X).numpy() * x == pytest.approx(1.0, abs=1e-14)
    assert dr.rsqrt(X).numpy() ** 2 * x == pytest.approx(1.0, abs=1e-14)
    dr.enable_grad(X)
    logarithm = dr.log(X)
    dr.forward(X)
    assert dr.grad(logarithm).numpy() * x == pytest.approx(1.0, abs=1e-14)


def test_as_the_processor_has_it(device):
    """In double precision but for rounding, with NumPy arrays and with Dr.Jit's own."""
    random = np.random.default_rng(4)
    angles = *random.uniform(0.0, 1.3, (2, 400)), random.uniform(-np.pi, np.pi, 400)
    model = pbrdf.DoubleGauss(**PAINT)
    found = model.mueller(*angles)
    own = np.moveaxis(
        np.array(model.mueller(*(device.upload(device.Float, angle) for angle in angles))), -1, 0
    )
    backend.set_backend("llvm")
    expected = model.mueller(*angles)
    assert (found - expected) / expected[:, :1, :1] == pytest.approx(0.0, abs=1e-11)
    assert (own - expected) / expected[:, :1, :1] == pytest.approx(0.0, abs=1e-11)


def test_a_batch_of_fits(device):
    """Lines through noisy points have a solution in closed form."""
    random = np.random.default_rng(2)
    x = np.linspace(-1.0, 1.0, 30)
    y = random.uniform(-1.0, 1.0, (50, 1)) + random.uniform(-1.0, 1.0, (50, 1)) * x
    y += 0.01 * random.standard_normal(y.shape)
    X, Y = device.upload(device.Float, x), device.upload(device.Float, y.ravel())

    def line(u, lane, point):
        r = u[0] + u[1] * dr.gather(device.Float, X, point)
        return [r - dr.gather(device.Float, Y, lane * 30 + point)], None

    found = solve(Residuals(line, 30), np.zeros((50, 2)), [-5.0, -5.0], [5.0, 5.0])
    assert found.converged.all()
    assert found.u == pytest.approx(np.polynomial.polynomial.polyfit(x, y.T, 1).T, abs=1e-9)
