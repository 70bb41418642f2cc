"""Sums and their derivatives in one loop: against closed forms, forwards, in reverse, nested, inside another loop."""

from __future__ import annotations

import ast
from pathlib import Path

import drjit as dr
import numpy as np
import pytest

from pbrdf.backend import get_backend
from pbrdf.optics.summation import differentiated, summed

BACKEND = get_backend()
Float, UInt32 = BACKEND.Float, BACKEND.UInt32
X, Y = np.array([0.3, 0.5, 0.7]), 1.5


def geometric(x, y):
    """y Σ_{j<5} x^j and Σ_{j<5} x^j, in a loop."""

    def term(j, x, pair):
        power = dr.exp(Float(j) * dr.log(x))
        return pair[0] * power, power

    return summed(term, dr.opaque(UInt32, 5), 2, (x, (y, None)))


def doubly(x, y):
    """Σ_{i<4} Σ_{j<3} y (i + 1) exp(j (x + i)/4) in nested sums."""

    def row(i, x, y):
        def column(j, x, y, shift, factor):
            return [factor * y * dr.exp(Float(j) * shift)]

        shift, factor = 0.25 * (x + Float(i)), Float(i) + 1.0
        return summed(column, dr.opaque(UInt32, 3), 1, (x, y, shift, factor), differentiated((x, y)))

    return summed(row, dr.opaque(UInt32, 4), 1, (x, y))


def doubly_by_hand():
    i, j = np.arange(4)[:, None, None], np.arange(3)[:, None]
    terms = (i + 1) * np.exp(0.25 * j * (X + i))
    return Y * terms.sum((0, 1)), (Y * 0.25 * j * terms).sum((0, 1)), terms.sum((0, 1))


def test_values_and_derivatives_forwards():
    x, y = Float(X), dr.opaque(Float, Y)
    dr.enable_grad(x, y)
    total, _ = geometric(x, y)
    powers = X[:, None] ** np.arange(5)
    np.testing.assert_allclose(total.numpy(), Y * powers.sum(1), rtol=1e-14)
    dr.forward(x)
    slope = (np.arange(1, 5) * X[:, None] ** np.arange(4)).sum(1)
    np.testing.assert_allclose(total.grad.numpy(), Y * slope, rtol=1e-13)


def test_a_shared_variable_gets_the_sum_over_the_lanes_in_reverse():
    x, y = Float(X), dr.opaque(Float, Y)
    dr.enable_grad(x, y)
    first, second = geometric(x, y)
    dr.backward(dr.sum(first + second))
    powers = X[:, None] ** np.arange(5)
    slope = (np.arange(1, 5) * X[:, None] ** np.arange(4)).sum(1)
    np.testing.assert_allclose(x.grad.numpy(), (1.0 + Y) * slope, rtol=1e-13)
    np.testing.assert_allclose(y.grad.numpy(), powers.sum(), rtol=1e-13)


@pytest.mark.parametrize("width", [1, 3])
def test_nested_sums(width):
    expected, by_x, by_y = doubly_by_hand()
    x, y = Float(X), dr.opaque(Float, Y, width)
    dr.enable_grad(x, y)
    (total,) = doubly(x, y)
    np.testing.assert_allclose(total.numpy(), expected, rtol=1e-14)
    dr.backward(total)
    np.testing.assert_allclose(x.grad.numpy(), by_x, rtol=1e-13)
    np.testing.assert_allclose(y.grad.numpy(), by_y if width == 3 else [by_y.sum()], rtol=1e-13)


def test_inside_a_loop_that_takes_derivatives():
    """As the solver does: the derivatives are taken inside the body."""

    def body(turn, x, found):
        own = Float(x)
        dr.enable_grad(own)
        (total,) = doubly(own, Float(Y))
        dr.set_grad(own, 1.0)
        dr.enqueue(dr.ADMode.Forward, own)
        dr.traverse(dr.ADMode.Forward, flags=dr.ADFlag.ClearInterior)
        return turn + 1, x, found + dr.grad(total)

    turns = dr.opaque(UInt32, 2)
    found = dr.while_loop(
        (UInt32(0), Float(X), dr.zeros(Float, 3)), lambda turn, *_: turn < turns, body, mode="symbolic"
    )[2]
    np.testing.assert_allclose(found.numpy(), 2.0 * doubly_by_hand()[1], rtol=1e-13)


def test_what_does_not_depend_on_anything_is_summed_too():
    total, count = geometric(Float(X), Float(Y))
    assert not dr.grad_enabled(total)
    np.testing.assert_allclose(total.numpy(), Y * count.numpy(), rtol=1e-14)


def test_no_loop_states_a_bound_that_could_be_too_small():
    """With ``max_iterations`` below the true count Dr.Jit's reverse derivative is wrong without a word.

    Without a bound, what is no sum is refused.
    """
    loops = []
    for path in (Path(__file__).parents[2] / "src" / "pbrdf").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and ast.unparse(node.func).endswith(
                ("while_loop", "dr.hint", "dr.syntax")
            ):
                loops += [ast.unparse(k.value) for k in node.keywords if k.arg == "max_iterations"] or [
                    "none"
                ]
    assert len(loops) > 5 and set(loops) == {"-1", "none"}

    x = Float(X)
    dr.enable_grad(x)
    power = dr.while_loop(
        (UInt32(0), x * 1.0), lambda j, _: j < 4, lambda j, z: (j + 1, z * z), max_iterations=-1
    )[1]
    with pytest.raises(RuntimeError, match="max_iterations"):
        dr.backward(power)
