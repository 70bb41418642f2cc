"""`pbrdf fit` on data that were read the wrong way: the first line says so, and the end of the summary what to do."""

import json

import numpy as np
import pytest

import pbrdf


@pytest.fixture
def turned(tmp_path):
    """A table whose lobe lies at phi = 180, which does not say where forward is."""
    theta_i, theta_r, phi = (
        a.ravel() for a in np.meshgrid([30.0, 50.0], np.arange(0.0, 75.0, 10.0), [0.0, 60.0, 120.0, 180.0])
    )
    paint = pbrdf.DoubleGauss(sigma=0.08, n=1.55, a=0.3, k=1.1, b=0.2, t=0.3)
    stokes = paint.stokes(*np.deg2rad([theta_i, theta_r, phi]))
    rows = np.column_stack([theta_i, theta_r, 180.0 - phi, stokes[:, :3]])
    path = tmp_path / "turned.csv"
    header = "# quantity: brdf\n# stokes: p-s\ntheta_i,theta_r,phi,I,Q,U"
    np.savetxt(path, rows, delimiter=",", header=header, comments="")
    return path.name


@pytest.mark.slow
def test_the_reading_that_fits_is_recommended_and_does(run, tmp_path, turned):
    text = " ".join(run("fit", turned, "--starts", 4, "-o", "out").stdout.split())
    assert text.startswith("Verdict The model does")
    assert "The data contradict the way they were read: with forward at the other end" in text
    assert "read them with --azimuth forward=180." in text
    record = json.loads((tmp_path / "out" / "fit.json").read_text(encoding="utf-8"))
    assert record["verdict"]["level"] in ("in_part", "does_not")
    assert record["verdict"]["sentence"] in text
    assert record["checks"]["conventions"][0]["option"] == "--azimuth forward=180"
    right = " ".join(
        run("fit", turned, "--starts", 4, "--azimuth", "forward=180", "-o", "out").stdout.split()
    )
    assert right.startswith("Verdict The model describes the data: median error of the intensity")
    assert "Try next" not in right
    order = [
        right.index(word) for word in ("Verdict", "errors, ", "parameter meaning", "Fitted to", "Goodness")
    ]
    assert order == sorted(order)


@pytest.mark.slow
def test_suggestions_can_be_left_out(run, turned):
    assert "Try next" not in run("fit", turned, "--starts", 4, "--no-suggestions", "-o", "out").stdout
