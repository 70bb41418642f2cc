"""Fits from the command line that stall, stand at a bound, are dense or repeated: exit codes, lines, warnings."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import pbrdf
from pbrdf.cli import console

CASES = Path(__file__).resolve().parents[3] / "shared" / "cases"
COMMAND = [sys.executable, "-c", "from pbrdf.cli.main import main; main()"]
PAINT = pbrdf.DoubleGauss(sigma=0.1, n=1.55, a=0.5, k=1.1, b=0.1, t=0.6)


def case(name: str) -> Path:
    path = CASES / name / "data.csv"
    if not path.is_file():
        pytest.skip(f"case absent: ../shared/cases/{name} (not part of the repository)")
    return path


def table(path: Path, theta_i, theta_r, phi, noise=0.03, seed=0) -> Path:
    """A table of intensities of a paint, angles in degrees."""
    intensity = PAINT.stokes(*np.deg2rad([theta_i, theta_r, phi]))[:, 0]
    intensity *= 1.0 + noise * np.random.default_rng(seed).standard_normal(len(intensity))
    header = "# quantity: brdf\n# azimuth: forward=0\ntheta_i,theta_r,phi,brdf"
    rows = np.column_stack([theta_i, theta_r, phi, intensity])
    np.savetxt(path, rows, delimiter=",", fmt="%.6f", header=header, comments="")
    return path


def dense(path: Path, count: int) -> Path:
    rng = np.random.default_rng(0)
    return table(
        path, rng.choice([15, 30, 45, 60], count), rng.uniform(0, 80, count), rng.uniform(-180, 180, count)
    )


@pytest.fixture
def few(tmp_path):
    theta_i, theta_r = (a.ravel() for a in np.meshgrid([20.0, 50.0], np.arange(0.0, 70.0, 5.0)))
    return table(tmp_path / "few.csv", theta_i, theta_r, np.zeros(len(theta_i))).name


@pytest.mark.slow
def test_a_fit_that_has_not_converged_has_an_exit_code_and_says_so_first(run, few, tmp_path):
    done = run("fit", few, "--iterations", 1, "--starts", 2, "--no-figures", "-o", "out", code=3)
    first = done.stdout.splitlines()[0]
    assert first.split(maxsplit=1)[1].startswith("The fit has not converged: its numbers are no result")
    assert "determined to" not in done.stdout
    record = json.loads((tmp_path / "out" / "fit.json").read_text(encoding="utf-8"))
    assert record["settled"] is False and record["verdict"]["level"] == "not_converged"
    assert {e["verdict"] for e in record["estimates"].values()} == {"not converged", "fixed"}
    assert run("fit", few, "--starts", 4, "--no-figures", "-q", "-o", "out").stdout == "out\n"


@pytest.mark.slow
def test_a_comparison_whose_best_has_not_converged_says_so(run, few, monkeypatch):
    from pbrdf.inversion import model_comparison

    plain = model_comparison.compare_models
    monkeypatch.setattr(model_comparison, "compare_models", lambda *a, **k: plain(*a, **k, max_iterations=1))
    done = run(
        "compare", few, "--models", "rpv-hot-spot", "--by", "angle", "--folds", 2, "--starts", 1, "--vary", 0,
        "--no-figures", "-o", "out", code=3,
    )  # fmt: skip
    assert "has not converged: its numbers are no result" in " ".join(done.stdout.splitlines()[:3])


def test_repeated_readings_of_one_geometry_are_refused(refused, tmp_path):
    name = table(tmp_path / "one.csv", np.full(40, 30.0), np.full(40, 20.0), np.zeros(40)).name
    assert "40 values at 1 geometry cannot determine 6 parameters" in refused("fit", name)


@pytest.mark.slow
def test_no_warning_of_numpy_reaches_the_terminal(tmp_path, few):
    """A parameter on its bound, from which the others trade off: 0/0 where steps are counted."""
    done = subprocess.run(
        [*COMMAND, "fit", few, "--starts=2", "--bounds=sigma=0.2:0.4", "--bounds=k=0.3:0.9", "-q", "-o", "out"],
        cwd=tmp_path, capture_output=True, text=True, timeout=120, env={**os.environ, "PYTHONWARNINGS": "default"},
    )  # fmt: skip
    assert done.returncode == 0 and done.stderr == "" and done.stdout == "out\n"


def test_progress_comes_as_lines_where_there_is_no_terminal(monkeypatch, capsys):
    monkeypatch.setattr(console, "_EVERY", 0.05)
    with console.stage_bar(first="Working") as show:
        time.sleep(0.12)
        show("half of it", 3, 7)
        time.sleep(0.12)
    lines = capsys.readouterr().err.splitlines()
    assert re.fullmatch(r"pbrdf: Working \(0 s\)", lines[0])
    assert re.fullmatch(r"pbrdf: half of it: 3 of 7 \(0 s\)", lines[-1])
    with console.progress_bar("Quiet", quiet=True) as tell:
        tell(1, 2)
        time.sleep(0.12)
    assert capsys.readouterr().err == ""


def test_short_work_shows_no_progress(capsys):
    with console.progress_bar("Fitting") as tell:
        tell(1, 2)
    assert capsys.readouterr().err == ""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT to another process")
@pytest.mark.parametrize("wait", [2.0, 5.0])
def test_ctrl_c_ends_a_dense_fit_within_two_seconds(tmp_path, wait):
    dense(tmp_path / "dense.csv", 20_000)
    running = subprocess.Popen(
        [*COMMAND, "fit", "dense.csv", "--starts", "8192", "-o", "out"],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    time.sleep(wait)
    began = time.monotonic()
    running.send_signal(signal.SIGINT)
    out, err = running.communicate(timeout=30)
    assert time.monotonic() - began < 2.0
    assert running.returncode == 130
    assert out == "" and err.splitlines()[-1] == "pbrdf: error: interrupted" and "Traceback" not in err
    assert [p.name for p in tmp_path.iterdir()] == ["dense.csv"]


@pytest.mark.slow
def test_case_f1_converges(run, tmp_path):
    path = case("F1-stalls-with-angle-and-aperture")
    run("fit", path, "--noise", "0.02,0.02", "--nuisance", "angle", "--nuisance", "source", "--no-figures", "-q",
        "--starts", 16, "-o", "out")  # fmt: skip
    record = json.loads((tmp_path / "out" / "fit.json").read_text(encoding="utf-8"))
    found = {name: e["value"] for name, e in record["estimates"].items()}
    assert found["sigma"] == pytest.approx(0.0070, abs=1e-4)
    assert found["n"] == pytest.approx(1.5, abs=0.005) and found["a"] == pytest.approx(0.9, abs=0.01)
    assert found["angle"] == pytest.approx(-0.20, abs=0.01)
    assert found["source"] == pytest.approx(0.70, abs=0.03)
    assert record["goodness"]["reduced_chi2"] == pytest.approx(0.65, abs=0.01)
    assert record["settled"] is True


@pytest.mark.slow
def test_case_f2_names_one_chi2(run, tmp_path):
    path = case("F2-optima-line-contradicts-fit")
    done = run(
        "fit",
        path,
        "--noise",
        "0.02,0.02",
        "--nuisance",
        "source",
        "--no-figures",
        "-o",
        "out",
        "--starts",
        24,
    )
    record = json.loads((tmp_path / "out" / "fit.json").read_text(encoding="utf-8"))
    assert record["goodness"]["chi2"] == pytest.approx(128.28, abs=0.01)
    assert record["optima"][0]["chi2"] == record["goodness"]["chi2"]
    assert "starts reached the best optimum (χ² = 128.3)" in done.stdout
    assert "not converge" not in done.stdout


@pytest.mark.slow
def test_case_g1_is_silent(tmp_path):
    path = case("G1-runtime-warning")
    done = subprocess.run(
        [*COMMAND, "fit", str(path), "-q", "-o", "out"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0 and done.stderr == ""
