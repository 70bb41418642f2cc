"""Normalised polarisation from the command line: check, fit, convert, plot."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import pbrdf

GLASS = (
    Path(__file__).parents[3] / "shared" / "data" / "glass-ng1" / "schott_ng1_inplane_specular_mueller.csv"
)
READ = ("--where", "blocked=0", "--stokes", "s-p", "--column", "theta_r=theta_i_deg")
SMOOTH = ("--model", "priest-germer", "--fix", "sigma=0.01")


@pytest.fixture
def shares(tmp_path):
    """Q/I and U/I of a paint in per cent, as a stranger's table."""
    paint = pbrdf.DoubleGauss(sigma=0.1, n=1.6, a=0.5, k=1.1, b=0.2, t=0.5)
    lines = ["incidence,zenith_r,phi,S1/S0 (%),S2/S0 (%)"]
    for theta_i in (20, 40, 60):
        for theta_r in range(5, 80, 5):
            for phi in (0, 30, 90):
                stokes = paint.stokes(*np.deg2rad([theta_i, theta_r, phi]))
                q, u = 100.0 * stokes[1:3] / stokes[0]
                lines.append(f"{theta_i},{theta_r},{phi},{q:.3f},{u:.3f}")
    path = tmp_path / "shares.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_check_says_what_they_are(run, shares):
    assert "measured Q/I, U/I (ratios, 1), natural light" in run("check", shares).stdout


@pytest.mark.slow
def test_shares_in_per_cent_are_fitted_held_out_and_kept(run, shares, tmp_path):
    run("convert", shares, "shares.nc")
    result = run("fit", "shares.nc", "--hold-out", "theta_i=40", "--starts", 8, "-o", "out")
    assert "No intensity was measured, only ratios" in result.stdout
    record = json.loads((tmp_path / "out" / "fit.json").read_text(encoding="utf-8"))
    assert record["estimates"]["n"]["value"] == pytest.approx(1.6, abs=1e-3)
    assert record["predicted_errors"]["all"]["ratio_rms"] < 1e-4
    run("plot", "shares.nc", "-o", "shares.png")


@pytest.mark.slow
def test_measured_glass_by_one_command(run, tmp_path):
    if not GLASS.exists():
        pytest.skip("measured data absent: ../shared/data/glass-ng1")
    run("fit", GLASS, *READ, *SMOOTH, "--starts", 8, "-o", "out")
    record = json.loads((tmp_path / "out" / "fit.json").read_text(encoding="utf-8"))
    assert record["estimates"]["n"]["value"] == pytest.approx(1.537, abs=0.01)
