"""The worked example of inverse rendering in the documentation."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

pytestmark = pytest.mark.slow

EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "inverse_rendering.py"


@pytest.fixture
def example(mitsuba):
    spec = importlib.util.spec_from_file_location("inverse_rendering", EXAMPLE)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules[spec.name]


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
