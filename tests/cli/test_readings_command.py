"""Tables of readings behind an analyser on the command line: checked, converted, fitted as they stand."""

from __future__ import annotations

import numpy as np
import pytest

import pbrdf
from pbrdf.data.paints import load_paint


@pytest.fixture
def table(tmp_path):
    """Twenty geometries of a paint behind polarisers at 0°, 45°, 90°, 135° from s, with a dark signal of 0.5."""
    theta_r = np.deg2rad(np.arange(-40.0, 60.0, 5.0))
    phi = np.where(theta_r < 0.0, np.pi, 0.0)
    theta_i = np.full(theta_r.shape, np.deg2rad(35.0))
    matrices = load_paint("matte-white-thick").mueller(theta_i, np.abs(theta_r), phi)
    i, q, u = np.asarray(matrices)[:, :3, 0].T
    path = tmp_path / "camera.csv"
    rows = [
        f"35;{np.rad2deg(a):.0f};" + ";".join(f"{x:.9f}".replace(".", ",") for x in four)
        for a, *four in zip(
            theta_r, 0.5 + (i - q) / 2, 0.5 + (i - u) / 2, 0.5 + (i + q) / 2, 0.5 + (i + u) / 2, strict=True
        )
    ]
    path.write_text(
        "theta_i;theta_r;I(0°);I(45°);I(90°);I(135°)\n" + "\n".join(rows) + "\n", encoding="utf-8"
    )
    return path


OPTIONS = ("--analyzer", "zero=s", "--analyzer", "dark=0.5", "--quantity", "brdf")


def test_check_tells_what_the_columns_are(run, table):
    found = run("check", table)
    assert "measured I, Q, U (digital numbers of a camera)" in found.stdout
    assert (
        "from readings behind an analyser: I(0°): polariser at 0°, I(45°): polariser at 45°" in found.stdout
    )
    assert "warning: the file does not say where the analyser's angle 0 (H) lies" in found.stdout
    stated = run("check", table, *OPTIONS).stdout
    assert "measured I, Q, U (BRDF, 1/sr)" in stated
    assert "angle 0 (H)" not in stated


def test_a_key_that_is_not_known_is_answered(run, table):
    assert "did you mean 'zero'" in run("check", table, "--analyzer", "zeros=s", code=2).stderr
    example = run("check", table, "--analyzer", "s", code=2).stderr
    assert "give NAME=VALUE, for example --analyzer zero=s" in example


@pytest.mark.slow
def test_readings_are_converted_and_fitted(run, table, tmp_path):
    run("convert", table, tmp_path / "out.csv", *OPTIONS)
    ds = pbrdf.read(tmp_path / "out.csv")
    assert ds.attrs["readings"][0] == "I(0°): polariser at 0°"
    run("fit", table, *OPTIONS, "--starts", "8", "-o", tmp_path / "fit", "--no-figures")
    found = pbrdf.load_fit(tmp_path / "fit").estimates
    for name, value in load_paint("matte-white-thick").values.items():
        assert found[name].value == pytest.approx(value, rel=0.01), name
