"""The recipes of CONTRIBUTING.md: their blocks do what they say, and the files they name are there."""

from __future__ import annotations

import re
import sys
import types
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import pbrdf
from pbrdf.cli import main as command_line
from pbrdf.data import readers
from pbrdf.errors import DataError
from pbrdf.inversion.noise import parse_noise
from pbrdf.models import MODELS
from pbrdf.report.style import save_figure

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
RECIPES = dict(re.findall(r"^### A (\w+)\n(.*?)(?=^###? |\Z)", TEXT, re.DOTALL | re.MULTILINE))


def made(recipe, **known):
    """What the block of a recipe defines."""
    (block,) = re.findall(r"```python\n(.*?)```", RECIPES[recipe], re.DOTALL)
    namespace = {"__name__": "block", **known}
    # else its dataclasses look for their module
    sys.modules["block"] = types.ModuleType("block")
    try:
        exec(compile(block, f"CONTRIBUTING.md: {recipe}", "exec"), namespace)
    finally:
        del sys.modules["block"]
    return namespace


def test_the_recipes_are_there():
    assert list(RECIPES) == ["model", "reader", "figure", "command", "noise"]


def test_files_that_are_named_exist():
    named = re.findall(r"`((?:src|tests|docs|\.github)/[\w./]+)`", TEXT)
    named += [link for link in re.findall(r"\]\(([^)#]+)\)", TEXT) if "://" not in link]
    assert len(named) > 25
    assert [name for name in named if not (ROOT / name).exists()] == []


def test_the_model_is_one():
    try:
        model = made("model")["Minnaert"](rho=0.4, k=1.5)
        assert pbrdf.load_model(model.to_dict()) == model
        theta_i, theta_r = 0.3, np.array([0.1, 0.9])
        expected = 0.4 / np.pi * (np.cos(theta_i) * np.cos(theta_r)) ** 0.5
        matrix = np.zeros((2, 4, 4))
        matrix[:, 0, 0] = expected
        np.testing.assert_allclose(model.mueller(theta_i, theta_r, 0.2), matrix, rtol=1e-12)
    finally:
        MODELS._classes.pop("minnaert", None)


def test_the_reader_reads(tmp_path, monkeypatch):
    monkeypatch.setattr(readers, "_registered", {})
    readers.register_reader(made("reader")["READER"])
    path = tmp_path / "paint.lab"
    path.write_text("LAB\n30 30 0.61\n30 40 0.42\n")
    dataset = pbrdf.read(path)
    np.testing.assert_allclose(dataset["I"].values, [0.61, 0.42])
    np.testing.assert_allclose(np.rad2deg(dataset["theta_r"].values), [30.0, 40.0])
    path.write_text("LAB\n30 30\n")
    with pytest.raises(DataError, match=r"paint\.lab: three numbers a line"):
        pbrdf.read(path)


def test_the_figure_is_drawn(tmp_path):
    angles = np.linspace(0.0, 1.0, 3)
    stokes = np.array([[2.0, 0.6, 0.8, 0.0], [1.0, 0.0, 0.1, 0.0], [1.0, 0.3, 0.4, 0.0]])
    figure = made("figure")["dolp_figure"](angles, stokes, "white")
    np.testing.assert_allclose(figure.axes[0].get_lines()[0].get_ydata(), [0.5, 0.1, 0.5])
    for name in ("one.png", "two.png"):
        save_figure(figure, tmp_path / name)
    assert (tmp_path / "one.png").read_bytes() == (tmp_path / "two.png").read_bytes()


def test_the_command_runs(monkeypatch):
    module = types.ModuleType("pbrdf.cli.bounds")
    module.bounds = made("command")["bounds"]
    monkeypatch.setitem(sys.modules, "pbrdf.cli.bounds", module)
    monkeypatch.setitem(command_line.COMMANDS, "bounds", "bounds")
    printed = CliRunner().invoke(command_line.app, ["bounds", "double-gauss"])
    assert printed.exit_code == 0
    assert printed.stdout.splitlines()[0].split()[0] == pbrdf.DoubleGauss.parameters[0].name
    assert CliRunner().invoke(command_line.app, ["bounds", "nonsense"]).exit_code == 2


def test_the_noise_is_that_of_counts():
    noise = made("noise")["ShotNoise"](counts=1e4)
    # readings of 100 and 400 counts, brought to the scale of a BRDF by a factor of 2
    intensity, scale = np.array([0.02, 0.08]), np.array([2.0, 2.0])
    np.testing.assert_allclose(noise.standard_uncertainty("I", intensity, scale), [2e-3, 4e-3])
    np.testing.assert_allclose(noise.standard_uncertainty("Q_over_I", intensity, scale), [0.1, 0.05])
    like = {name for name in dir(parse_noise("instrument")) if not name.startswith("_")}
    assert {"absolute_scale", "standard_uncertainty"} <= like & set(dir(noise))
