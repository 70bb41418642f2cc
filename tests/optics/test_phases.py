"""Phases of many turns in float32 and float64 kernels, against NumPy's sine and extended precision."""

import drjit as dr
import numpy as np
import pytest

from pbrdf.backend import get_backend
from pbrdf.optics.phases import cos_of_turns, in_double, less_whole_turns

RNG = np.random.default_rng(5)


def test_half_a_turn_of_a_million_is_half_a_turn():
    """The float32 sine of such an argument is off by 0.03, a float64 one of radians by 1e-9."""
    turns = np.repeat([0.0, 1e3, -1e6, 1e9], 8) + np.tile(np.arange(8) / 8, 4)
    found = np.array(cos_of_turns(get_backend().Float(turns)))
    np.testing.assert_allclose(found, np.tile(np.cos(2.0 * np.pi * np.arange(8) / 8), 4), atol=1e-15)
    assert cos_of_turns(1e6 + 0.5) == -1.0


@pytest.mark.parametrize("single", [True, False])
@pytest.mark.parametrize("size", [1.0, 1e3, 1e6, 1e9, 1e15])
def test_an_angle_less_whole_turns(size, single):
    """The number that the array holds, reduced; of 1e15 rad a quarter is left."""
    backend = get_backend()
    Float = backend.Float32 if single else backend.Float
    angle = RNG.uniform(-size, size, 1000).astype(np.float32 if single else float)
    found = less_whole_turns(Float(angle))
    assert type(found) is Float
    assert abs(np.array(found)).max() <= (np.float32(np.pi) if single else np.pi)
    off = np.exp(1j * np.array(found, dtype=float)) - np.exp(1j * angle.astype(float))
    assert abs(off).max() < (2e-7 if single else 1e-15) + 2e-16 * size


def test_derivatives_pass_through_the_reduction():
    """Forward and reverse: that of an angle is 1, that of the cosine is −2π sin 2πx, in the number's precision."""
    backend = get_backend()
    x = RNG.uniform(-100.0, 100.0, 500).astype(np.float32)
    expected = -2.0 * np.pi * np.sin(2.0 * np.pi * (x.astype(float) % 1.0))
    for forward in (True, False):
        variable = backend.Float32(x)
        dr.enable_grad(variable)
        y = backend.Float32(cos_of_turns(in_double(variable))) + 10.0 * less_whole_turns(variable)
        if forward:
            dr.forward(variable)
        else:
            dr.backward(y)
        found = np.array(dr.grad(y if forward else variable))
        np.testing.assert_allclose(found, expected + 10.0, atol=3e-6)
