"""Derivatives of the BSDF plugin with respect to the paint, at single points and through rendered pictures."""

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


def ball(mi, integrator, paint):
    T = mi.ScalarTransform4f
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": integrator,
            "sensor": {
                "type": "perspective",
                "fov": 30.0,
                "to_world": T().look_at([0.0, -5.0, 2.0], [0.0, 0.0, 0.5], [0.0, 0.0, 1.0]),
                "film": {"type": "hdrfilm", "width": 24, "height": 24, "rfilter": {"type": "box"}},
            },
            "sky": {"type": "constant", "radiance": 0.5},
            "lamp": {
                "type": "rectangle",
                "to_world": T().look_at([2.0, -2.0, 4.0], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0]),
                "emitter": {"type": "area", "radiance": 8.0},
            },
            "ball": {"type": "sphere", "bsdf": {"type": "pbrdf", "accuracy": "fast", **paint}},
            "floor": {
                "type": "rectangle",
                "to_world": T().translate([0.0, 0.0, -1.0]).scale(4.0),
                "bsdf": {"type": "diffuse"},
            },
        }
    )


INTEGRATORS = {
    "llvm_ad_rgb": {"type": "prb", "max_depth": 3},
    "llvm_ad_mono_polarized": {"type": "stokes", "nested": {"type": "direct"}},
}


@pytest.mark.parametrize("variant", INTEGRATORS)
@pytest.mark.parametrize("name", ["sigma", "n", "a", "t"])
def test_derivative_of_a_picture(name, variant):
    """Gradient of a weighted mean of the pixels against differences of two renderings; both carry noise."""
    mi = use(variant)
    import drjit as dr

    mi.set_log_level(mi.LogLevel.Error)
    paint = {**PAINT, "kappa": 0.0}
    scene = ball(mi, INTEGRATORS[variant], paint)
    parameters = mi.traverse(scene)
    key = f"ball.bsdf.{name}.value"

    def mean(image):
        return dr.mean(image.array * (1.0 + 0.5 * dr.sin(dr.arange(mi.Float, dr.width(image.array)))))

    def estimates(function, seeds):
        values = [function(seed) for seed in seeds]
        return np.mean(values), np.std(values, ddof=1) / len(values) ** 0.5

    def gradient(seed):
        x = mi.Float(paint[name])
        dr.enable_grad(x)
        parameters[key] = x
        parameters.update()
        dr.backward(mean(mi.render(scene, parameters, spp=128, seed=2 * seed, seed_grad=2 * seed + 1)))
        return x.grad[0]

    def difference(seed):
        pair = []
        for sign in (1.0, -1.0):
            parameters[key] = mi.Float(paint[name] * (1.0 + 0.02 * sign))
            parameters.update()
            pair.append(mean(mi.render(scene, spp=256, seed=seed))[0])
        return (pair[0] - pair[1]) / (0.04 * paint[name])

    found, error = estimates(gradient, range(8))
    expected, noise = estimates(difference, range(100, 108))
    assert abs(found - expected) < 4.0 * np.hypot(error, noise) + 2e-3 * abs(expected)
    assert abs(expected) > 5.0 * noise and error < 0.2 * abs(found)  # there is something to compare
