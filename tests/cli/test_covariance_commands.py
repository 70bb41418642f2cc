"""Files whose data have covariances, on the command line."""

from __future__ import annotations

import json

import numpy as np
import pytest

import pbrdf

CORRELATION = np.array([[1.0, 0.7, 0.0], [0.7, 1.0, -0.4], [0.0, -0.4, 1.0]])


@pytest.fixture
def file(tmp_path):
    """A simulated measurement of I, Q and U whose errors are correlated, but for two rows."""
    bundled = pbrdf.open_experiment("cd-back")
    angles = [bundled[name].values for name in ("theta_i", "theta_r", "phi")]
    stokes = pbrdf.load_paint("cd-back").stokes(*angles)[:, :3]
    std = 0.01 * stokes[:, :1] * np.ones(3)
    draws = np.random.default_rng(6).standard_normal(stokes.shape) @ np.linalg.cholesky(CORRELATION).T
    covariance = np.full((63, 4, 4), np.nan)
    covariance[:, :3, :3] = np.einsum("gi,ij,gj->gij", std, CORRELATION, std)
    covariance[:2] = np.nan
    columns = dict(zip("IQU", (stokes + std * draws).T, strict=True))
    ds = pbrdf.make_dataset(
        *angles,
        quantity="brdf",
        group=bundled["group"].values,
        **columns,
        covariance=covariance,
        std=dict(zip("IQU", std.T, strict=True)),
    )
    pbrdf.write(ds, tmp_path / "data.csv")
    return ds


def test_a_file_with_covariances_is_described(run, file):
    text = run("check", "data.csv").stdout
    assert (
        "standard uncertainties of I, Q, U and their covariances at 61 geometries (correlations up to 0.7)"
        in text
    )
    assert "Nothing is wrong with it." in text


def test_what_is_no_covariance_is_refused(run, file, tmp_path):
    text = (tmp_path / "data.csv").read_text().splitlines()
    names, cells = text[-64].split(","), text[-1].split(",")
    cells[names.index("cov_IQ")] = "1.0"
    (tmp_path / "bad.csv").write_text("\n".join([*text[:-1], ",".join(cells)]))
    message = run("check", "bad.csv", code=2).stderr
    assert message.startswith("pbrdf: error: bad.csv does not follow the schema")
    assert f"covariance, line {len(text)}: no covariance: it is not positive semidefinite" in message


@pytest.mark.slow
def test_covariances_survive_every_format(run, file, tmp_path):
    pytest.importorskip("zarr")
    for source, target in (("data.csv", "a.nc"), ("a.nc", "b.zarr"), ("b.zarr", "c.csv")):
        assert run("convert", source, target).stdout == f"{target}: 63 geometries\n"
    assert pbrdf.read(tmp_path / "c.csv").identical(file.assign_attrs(pbrdf.read(tmp_path / "c.csv").attrs))
    run("convert", "b.zarr", "d.csv", "--select", "group=3")
    third = file.isel(geometry=file["group"].values == 3)
    np.testing.assert_array_equal(pbrdf.read(tmp_path / "d.csv")["covariance"], third["covariance"])


@pytest.mark.slow
def test_a_fit_uses_them_unless_a_noise_is_stated(run, file, tmp_path):
    run("fit", "data.csv", "--starts", 4, "--hold-out", "group=3", "-q", "-o", "full")
    run("fit", "data.csv", "--starts", 4, "--hold-out", "group=3", "-q", "-o", "stated", "--noise", "1%,0")
    full, stated = (
        json.loads((tmp_path / n / "fit.json").read_text(encoding="utf-8")) for n in ("full", "stated")
    )
    assert full["noise"] == "covariances of the data set" and stated["noise"].startswith("stated: 0.01")
    expected = pbrdf.fit(file, starts=4, hold_out="group=3")
    assert full["goodness"]["chi2"] == pytest.approx(expected.goodness.chi2, rel=1e-9)
    assert full["estimates"]["t"]["standard_error"] == pytest.approx(expected.estimates["t"].std, rel=1e-6)
    # the same standard uncertainties without the correlations
    assert abs(full["goodness"]["chi2"] / stated["goodness"]["chi2"] - 1.0) > 0.02
    assert "covariances of the data set" in (tmp_path / "full" / "summary.txt").read_text(encoding="utf-8")


def test_no_folder_but_zarr_is_a_file(run, refused, tmp_path):
    (tmp_path / "some").mkdir()
    (tmp_path / "empty.zarr").mkdir()
    assert refused("check", "some") == "some: this is a folder; name a file in it"
    assert "empty.zarr: this is not a Zarr folder" in refused("check", "empty.zarr")
