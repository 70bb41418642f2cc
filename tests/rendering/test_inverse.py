"""Gradients of polarised pictures with respect to the paint, and the worked example of the documentation."""

import importlib.util
import math
import sys
from pathlib import Path

import numpy as np
import pytest

import pbrdf
import pbrdf.rendering
from pbrdf.rendering.scenes import Camera

pytestmark = pytest.mark.slow

EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "inverse_rendering.py"
PAINT = pbrdf.DoubleGauss(sigma=0.08, n=1.6, a=0.3, k=1.2, b=0.2, t=0.6, accuracy="fast")


@pytest.fixture
def example(mitsuba):
    spec = importlib.util.spec_from_file_location("inverse_rendering", EXAMPLE)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules[spec.name]


def test_reverse_mode_through_the_stokes_integrator_agrees_with_differences(mitsuba):
    """The derivative of S0, S1 and S2, weighted at random, with respect to each parameter: one reverse pass against
    pairs of pictures. Mitsuba draws the samples of a gradient with a seed of their own: the pictures have that one."""
    import drjit as dr

    scene = mitsuba.load_dict(
        {
            "type": "scene",
            "sensor": Camera((0.0, -3.0, 0.0), (0.0, 0.0, 0.0), math.radians(21.0)).to_dict(16, 16),
            "ball": {"type": "sphere", "radius": 0.5, "bsdf": pbrdf.rendering.bsdf_dict(PAINT)},
            "lamp": {
                "type": "point",
                "position": [2.0, -3.0, 1.5],
                "intensity": {"type": "uniform", "value": 10.0},
            },
        }
    )
    params = mitsuba.traverse(scene)
    integrator = mitsuba.load_dict({"type": "stokes", "nested": {"type": "direct"}})
    names = {name: f"ball.bsdf.{name}.value" for name in ("sigma", "n", "a", "k", "b", "t")}

    def objective(values, differentiated=False):
        variables = {name: mitsuba.Float(float(value)) for name, value in values.items()}
        if differentiated:
            dr.enable_grad(*variables.values())
        for name, variable in variables.items():
            params[names[name]] = variable
        params.update()
        if not differentiated:
            image = mitsuba.render(scene, integrator=integrator, spp=8, seed=7).numpy().astype(float)
            return float((weights * image[:, :, [1, 4, 7]]).sum())
        image = mitsuba.render(scene, params, integrator=integrator, spp=8, seed=1, seed_grad=7)
        parts = [
            dr.sum((mitsuba.TensorXf(weights[..., i]) * image[:, :, c]).array)
            for i, c in enumerate((1, 4, 7))
        ]
        dr.backward(parts[0] + parts[1] + parts[2])
        return {name: float(dr.grad(variable)[0]) for name, variable in variables.items()}

    weights = np.random.default_rng(2).uniform(0.0, 1.0, (16, 16, 3)) * [1.0, 10.0, -10.0]
    truth = {name: PAINT.values[name] for name in names}
    gradient = objective(truth, differentiated=True)
    for name, value in truth.items():
        step = 0.003 * value
        high, low = (objective({**truth, name: value + s * step}) for s in (1, -1))
        assert gradient[name] == pytest.approx((high - low) / (2.0 * step), rel=0.01), name


def test_the_example_of_the_documentation_recovers_the_paint(example, monkeypatch):
    """In a hurry: two lamps, small pictures, large steps."""
    monkeypatch.setattr(example, "STEPS", {name: 2.5 * step for name, step in example.STEPS.items()})
    monkeypatch.setattr(example, "LAMPS", example.LAMPS[:2])
    history = example.recover(size=32, iterations=40, spp=64)
    for name, values in history.values.items():
        truth = example.TRUTH.values[name]
        assert abs(values[0] / truth - 1.0) > 0.1
        assert values[-1] == pytest.approx(truth, rel=0.03), name
    assert np.mean(history.loss[-5:]) < 0.2 * history.loss[0]


def test_the_example_draws_its_figure(example, tmp_path):
    history = example.History([1.0, 0.1], {"sigma": [0.09, 0.06, 0.05], "n": [1.4, 1.6, 1.65]})
    example.draw(history, tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 10_000
