"""What is written is what was there, bit for bit."""

from __future__ import annotations

import numpy as np
import pytest
from dataset_strategies import datasets, same_bits
from hypothesis import HealthCheck, given, settings

from pbrdf.data import make_dataset, read, write


@pytest.mark.slow
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(ds=datasets())
def test_round_trip_is_bit_for_bit(tmp_path, ds):
    write(ds, tmp_path / "data.csv")
    assert same_bits(read(tmp_path / "data.csv"), ds)


def test_what_is_written_is_what_the_documentation_shows(tmp_path):
    ds = make_dataset(
        np.deg2rad(30.0), np.deg2rad(45.0), np.pi, quantity="brdf", I=0.61, dolp=0.08, std={"I": 0.01},
        wavelength=476, group=1, attrs={"title": "white paint"},
    )  # fmt: skip
    write(ds, tmp_path / "data.csv")
    assert (tmp_path / "data.csv").read_text(encoding="utf-8").splitlines() == [
        "# quantity: brdf",
        "# azimuth: forward=0",
        "# stokes: p-s",
        "# illumination: natural",
        "# simulated: 0",
        "# title: white paint",
        "theta_i_deg,theta_r_deg,phi_deg,wavelength_nm,group,I,I_std,dolp",
        "30.0,45.0,180.0,476.0,1,0.61,0.01,0.08",
    ]


def test_angles_without_exact_degrees_are_written_in_radians(tmp_path):
    odd = 1.0000000000000002
    write(make_dataset(0.5, odd, 0.0, quantity="brdf", I=1.0), tmp_path / "data.csv")
    header, row = (tmp_path / "data.csv").read_text().splitlines()[-2:]
    cells = dict(zip(header.split(","), row.split(","), strict=True))
    assert cells.get("theta_r_rad", repr(odd)) == repr(odd)
    assert float(read(tmp_path / "data.csv")["theta_r"][0]) == odd
