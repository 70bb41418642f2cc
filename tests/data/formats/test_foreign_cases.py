"""Small files as strangers sent them, in ../shared/cases: what each is to be read as."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pbrdf.cli.sources import open_model
from pbrdf.data import check, read
from pbrdf.errors import PbrdfError

CASES = Path(__file__).resolve().parents[4] / "shared" / "cases"


@pytest.fixture
def case():
    """Path of a case's file; skips where the cases are absent."""

    def find(name: str) -> Path:
        path = CASES / name
        if not path.is_file():
            pytest.skip(f"cases absent: ../shared/cases/{name} (not part of the repository)")
        return path

    return find


def test_zemax(case):
    ds = read(case("O1-zemax-bsdf/data.bsdf"))
    assert ds.sizes["geometry"] == 24
    # the format repeats the mirror direction for every azimuth
    (copies,) = check(ds)
    assert copies.severity == "warning" and copies.rows == (4, 8, 16, 20)
    mirror = np.isclose(ds["theta_r"], ds["theta_i"]) & np.isclose(ds["phi"], 0.0)
    for theta_i, value in ((20, 1.58), (50, 2.58)):
        assert_allclose(ds["I"].values[mirror & (ds["group"].values == theta_i)], value)


def test_fred(case):
    ds = read(case("O3-fred-tabulated-bsdf/data.txt"))
    assert_array_equal(ds["group"], [10, 10, 10, 50, 50, 50])
    assert_allclose(np.rad2deg(ds["theta_r"]), [0, 10, 30, 0, 50, 80])
    assert_allclose(np.rad2deg(ds["phi"]), [0, 0, 90, 0, 0, 0])
    assert_array_equal(ds["I"], [0.031, 0.036, 0.030, 0.030, 0.090, 0.060])


def test_openmaterial(case):
    ds = read(case("O5-openmaterial-lookup-table/data.xompt"))
    assert_array_equal(ds["wavelength"], [905, 905])
    assert_array_equal(ds["I"], [0.9, 0.3])
    assert_allclose(np.abs(ds["phi"]), [0.0, np.pi], atol=1e-5)


def test_matlab(case):
    ds = read(case("O7-kaist-mat/data.mat"))
    assert_array_equal(np.unique(ds["wavelength"]), [450, 550])
    assert ds["mueller"].dims == ("geometry", "stokes_out", "stokes_in")
    assert_allclose(ds["mueller"][:, 0, 0], 0.2)


def test_hpbrdf(case):
    path = case("O9-hpbrdf-extension/data.hpbrdf")
    ds = read(path)
    assert_array_equal(np.unique(ds["wavelength"]), [450, 550])
    with pytest.raises(PbrdfError, match=r"\.hpbrdf tables are measurements, not models; fit them first"):
        open_model(str(path))
