"""Derivatives of the BSDF plugin at single points; those of pictures: ``test_gradients_by_integrator.py``."""

from __future__ import annotations

import numpy as np
import pytest
from bsdf_helpers import D, directions, interaction, light, turn, use, vector

import pbrdf

pytestmark = pytest.mark.slow

PAINT = {"sigma": 0.1, "n": 1.62, "kappa": 0.4, "a": 0.9, "k": 1.25, "b": 0.3, "t": 0.6}


@pytest.mark.parametrize("mode", ["forward", "backward"])
@pytest.mark.parametrize("accuracy", ["fast", "default", None])
@pytest.mark.parametrize("name", PAINT)
def test_derivative_of_a_value(name, accuracy, mode):
    """Against central differences of ``mueller()`` in double precision, summed with random weights.

    Without an accuracy the plugin takes the rule for packets of rays.
    """
    mi = use("llvm_ad_mono_polarized")
    import drjit as dr
    from bsdf_helpers import implicit_axes

    wi, wo = directions(200, 80.0, 1), directions(200, 80.0, 2)
    weights = np.random.default_rng(3).normal(size=(4, 4))
    normal = np.array([0.0, 0.0, 1.0])

    def in_implicit_frames(M):
        def rotation(k):
            s = np.cross(k, normal)
            return turn(k, implicit_axes(k), s / np.linalg.norm(s, axis=-1, keepdims=True))

        return rotation(wi) @ D @ M @ D @ np.swapaxes(rotation(-wo), -1, -2) * wo[:, 2, None, None]

    def weighed(value):
        model = pbrdf.DoubleGauss(**{**PAINT, name: value}, accuracy=accuracy or "default")
        return np.sum(weights * in_implicit_frames(model.mueller(*light(wi, wo))).mean(0))

    step = 1e-4 * PAINT[name]
    expected = (weighed(PAINT[name] + step) - weighed(PAINT[name] - step)) / (2.0 * step)

    chosen = {} if accuracy is None else {"accuracy": accuracy}
    bsdf = mi.load_dict({"type": "pbrdf", **PAINT, **chosen})
    parameters = mi.traverse(bsdf)
    x = mi.Float(PAINT[name])
    dr.enable_grad(x)
    parameters[f"{name}.value"] = x
    parameters.update()
    f = bsdf.eval(mi.BSDFContext(), interaction(mi, wi), vector(mi, wo))
    total = dr.mean(sum(f[i, j][0] * float(weights[i, j]) for i in range(4) for j in range(4)))
    if mode == "backward":
        dr.backward(total)
        found = x.grad[0]
    else:
        dr.forward(x)
        found = total.grad[0]
    assert found == pytest.approx(expected, rel=2e-3, abs=2e-5)
