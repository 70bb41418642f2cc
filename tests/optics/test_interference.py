"""Two beams off a film in float32 and float64 kernels, against the formula in extended precision."""

import drjit as dr
import numpy as np
import pytest

from pbrdf.backend import get_backend
from pbrdf.models import MODELS
from pbrdf.optics.interference import two_beam_interference

ORDER = next(p for p in MODELS["interference-lacquer"].parameters if p.name == "film_order")
V, N = 0.875, 1.375  # exact in float32


def film(cos_beta, order):
    """Value, derivatives by the order and by cosβ, in extended precision."""
    cos = cos_beta.astype(np.longdouble)
    inside = np.sqrt(1.0 - (1.0 - cos**2) / N**2)
    turns = order * inside
    phase = 2.0 * np.arccos(np.longdouble(-1.0)) * (turns - np.round(turns))
    rise = -V * np.sin(phase) * 2.0 * np.arccos(np.longdouble(-1.0)) / (1.0 + V)
    return (1.0 + V * np.cos(phase)) / (1.0 + V), rise * inside, rise * order * cos / (N**2 * inside)


@pytest.mark.parametrize("order", [ORDER.lower, ORDER.upper, ORDER.domain[1]])
@pytest.mark.parametrize(("single", "rounding"), [(True, 6e-8), (False, 1.2e-16)])
def test_orders_up_to_the_largest_in_both_precisions(order, single, rounding):
    """A float32 kernel is as exact at order 100 as at 1, where its sine of the whole phase was off by 4e-5."""
    backend = get_backend()
    Float, dtype = (backend.Float32, np.float32) if single else (backend.Float, float)
    cos_beta = np.random.default_rng(2).uniform(0.02, 1.0, 2000).astype(dtype)
    order = float(dtype(order))
    value, by_order, by_cos = film(cos_beta, order)
    # what the last digit of the phase's float64 does, beside the kernel's own rounding
    digit = 1e-15 * order
    allowed = (10.0 * rounding + 10.0 * digit) * np.array([1.0 + order, 2.0])
    for forward in (True, False):
        for k, expected in enumerate((by_cos, by_order)):
            variables = [Float(cos_beta), Float(np.full(len(cos_beta), order, dtype))]
            dr.enable_grad(variables[k])
            y = two_beam_interference(*variables, Float(V), Float(N))
            assert type(y) is Float
            assert abs(np.array(y) - value).max() < 3.0 * rounding + digit
            if forward:
                dr.forward(variables[k])
            else:
                dr.backward(y)
            slope = np.array(dr.grad(y if forward else variables[k]))
            assert abs(slope - expected).max() < allowed[k]


def test_numbers_of_python_are_taken_too():
    assert two_beam_interference(1.0, 2.5, 1.0, 1.5) == pytest.approx(0.0, abs=1e-15)
