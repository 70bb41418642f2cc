"""The side in words: the azimuth of the source is 0, so π is the specular half-plane."""

from __future__ import annotations

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pbrdf.data import read
from pbrdf.errors import DataError

ROWS = [
    [9.05e-07, 0.5, 0.5, 0.0, 0.3],
    [9.05e-07, 0.5, 0.5, 3.141592653589793, 0.9],
    [9.05e-07, 0.5, 0.0, None, 0.4],
    [1.55e-06, 0.5, 0.5, 1.5, None],
    [1.55e-06, 0.2, 0.5, 1.5, 0.2],
]


def content(rows=ROWS, **metadata):
    return json.dumps(
        {
            "metadata": {"name": "asphalt", "sources": "measurement", **metadata},
            "brdf": {"wavelengths": [9.05e-07, 1.55e-06], "lookupTable": rows},
        },
        indent=1,
    )


def test_metres_and_radians_and_forward_at_pi(text_file):
    ds = read(text_file(content(), "asphalt.xompt"))
    assert_array_equal(ds["wavelength"], [905, 905, 905, 1550])
    assert_allclose(ds["theta_i"], [0.5, 0.5, 0.5, 0.2])
    assert_allclose(ds["phi"][[0, 1, 3]], [np.pi, 0.0, 1.5 - np.pi])
    assert_array_equal(ds["I"], [0.3, 0.9, 0.4, 0.2])
    assert ds.attrs["title"] == "asphalt"
    assert ds.attrs["source"] == "asphalt.xompt: measurement"
    assert ds.attrs["quantity"] == "brdf"
    assert not ds.attrs["simulated"]


def test_another_reading_of_the_azimuth_can_be_stated(text_file):
    path = text_file(content(), "asphalt.xompt")
    assert_allclose(read(path, azimuth="forward=0")["phi"][:2], [0.0, np.pi])
    with pytest.raises(DataError, match="azimuth='forward=90' is not understood"):
        read(path, azimuth="forward=90")


def test_wavelengths_are_selected(text_file):
    ds = read(text_file(content(), "asphalt.xompt"), wavelength=1550)
    assert_array_equal(ds["I"], [0.2])


def test_a_simulation_says_so(text_file):
    assert read(text_file(content(sources="Simulation (FDTD)"), "a.xompt")).attrs["simulated"] == 1


def test_the_content_tells_the_format(text_file):
    assert read(text_file(content(), "asphalt.json")).sizes["geometry"] == 4


@pytest.mark.parametrize(
    ("row", "value", "words"),
    [
        (0, [905, 0.5, 0.5, 0.0, 0.3], "row 1: the wavelength is 905; it must be in metres"),
        (1, [9.05e-07, 0.5, 0.5, 0.0], "row 2: five numbers are needed"),
        (1, [9.05e-07, 0.5, 0.5, "0.0", 0.3], "row 2: the exit azimuth is '0.0', not a number"),
        (1, [9.05e-07, 0.5, 0.5, True, 0.3], "row 2: the exit azimuth is True, not a number"),
        (1, [9.05e-07, 0.5, 10**400, 0.0, 0.3], "row 2: the exit zenith angle is 1000"),
        (1, [9.05e-07, 0.5, None, 0.0, 0.3], "row 2: the exit zenith angle is null"),
        (1, [9.05e-07, 0.5, 30.0, 0.0, 0.3], "theta_r, index 1: 30 rad"),
    ],
)
def test_errors_name_the_row(text_file, row, value, words):
    rows = [*ROWS[:row], value, *ROWS[row + 1 :]]
    with pytest.raises(DataError, match=words):
        read(text_file(content(rows), "asphalt.xompt"))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (content()[:-30], "line .*: not JSON: .* truncated"),
        ("[1]", "not an OpenMATERIAL file"),
        (
            '{"metadata": {}, "reflectionCoefficient": {}}',
            "no brdf with a lookupTable .* it holds reflectionCoeff",
        ),
        (content([]), "the lookupTable is empty"),
        (content([ROWS[3]]), "no row of the lookupTable has a BRDF"),
        ("[" * 200_000, "not JSON"),
    ],
)
def test_other_files_are_refused(text_file, text, words):
    with pytest.raises(DataError, match=words):
        read(text_file(text, "asphalt.xompt"))
