"""A model that a user wrote, in every command, without being packaged."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

import own_model
import pbrdf
from pbrdf.models import MODELS


@pytest.fixture(autouse=True)
def unknown_before():
    """The model is not known but for what the command says."""
    MODELS._classes.pop("lambert-ggx", None)


@pytest.fixture
def paint(run, tmp_path):
    """The user's file, and data simulated with its model; returns the text that names the model."""
    shutil.copy(Path(own_model.__file__), tmp_path / "mine.py")
    own_model.LambertGGX(0.1, 1.5, 0.3).to_json(tmp_path / "paint.json")
    return "mine.py:LambertGGX"


@pytest.fixture
def with_model(run, paint):
    """Run a command after ``--model``."""

    def command(*arguments, **options):
        return run("--model", paint, *arguments, **options)

    return command


@pytest.mark.slow
def test_simulated_fitted_and_used_again(with_model, run, paint, tmp_path):
    angles = ("--theta-i", "20,50", "--theta-r", "0:75:5", "--phi", "0,180")
    with_model("simulate", "paint.json", *angles, "--noise", "0.01", "--seed", 2, "-o", "data.csv")
    # `fit` takes the class itself, and every command after it the folder of the fit
    shown = run("fit", "data.csv", "--model", paint, "--starts", 8, "-o", "found").stdout
    assert "lambert-ggx" in shown and "alpha" in shown and "rho" in shown
    again = pbrdf.load_fit(tmp_path / "found")
    assert again.model.values["alpha"] == pytest.approx(0.1, rel=0.1)
    with_model("plot", "found/model.json", "-o", "model.png")
    assert (tmp_path / "model.png").stat().st_size > 10_000
    assert "lambert-ggx" in with_model("models").stdout


@pytest.mark.slow
def test_planned_measured_and_exported(with_model, tmp_path):
    limits = ("--smallest-bistatic", 30, "--largest-zenith", 70, "--budget", 12)
    assert "alpha" in with_model("plan", "paint.json", *limits, "-o", "next.csv").stdout
    with_model("measure", "paint.json", "--angles", "next.csv", "-o", "virtual")
    result = pbrdf.fit(pbrdf.read(tmp_path / "virtual" / "paint.nc"), own_model.LambertGGX, starts=8)
    assert result.estimates["alpha"].value == pytest.approx(0.1, rel=0.1)
    with_model(
        "export", "paint.json", "--format", "csv", "--theta-i", "30", "--theta-r", "0:60:30", "--phi", "0"
    )
    exported = pbrdf.read(tmp_path / "paint.csv")
    expected = own_model.LambertGGX(0.1, 1.5, 0.3).mueller(
        np.deg2rad(30.0), np.deg2rad([0.0, 30.0, 60.0]), 0.0
    )
    np.testing.assert_allclose(exported["mueller"].values[:, 0, 0], expected[:, 0, 0], rtol=1e-6)


@pytest.mark.slow
def test_rendered(with_model, tmp_path):
    pytest.importorskip("mitsuba", reason="rendering needs mitsuba: pip install 'mitsuba>=3.9'")
    with_model("render", "paint.json", "--size", "24x24", "--spp", 4, "-o", "picture")
    assert any((tmp_path / "picture").iterdir())


def test_without_it_the_commands_say_how(refused, paint):
    message = refused("simulate", "paint.json", "-o", "data.csv")
    assert "unknown model 'lambert-ggx'" in message and "pbrdf --model FILE.py:Class" in message
    assert "there is no file other.py" in refused("--model", "other.py:Mine", "models")
    assert "defines no model Mine: it defines LambertGGX" in refused(
        "fit", "white", "--model", "mine.py:Mine"
    )
