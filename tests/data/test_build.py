from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from pbrdf.data import make_dataset
from pbrdf.errors import DataError

ANGLES = {"theta_i": [0.1, 0.2, 0.3], "theta_r": 0.5, "phi": 0.0, "quantity": "brdf"}


def test_scalars_fill_all_rows():
    ds = make_dataset(**ANGLES, I=[1.0, 2.0, 3.0], dolp=0.1, std={"I": 0.05}, wavelength=550)
    assert ds.sizes == {"geometry": 3}
    assert_array_equal(ds["theta_r"], [0.5, 0.5, 0.5])
    assert_array_equal(ds["dolp"], [0.1, 0.1, 0.1])
    assert_array_equal(ds["I_std"], [0.05, 0.05, 0.05])
    assert_array_equal(ds["wavelength"], [550.0, 550.0, 550.0])
    assert_array_equal(ds["group"], [0, 0, 0])


def test_attributes_have_their_defaults():
    ds = make_dataset(**ANGLES, I=1.0, attrs={"title": "white"})
    assert ds.attrs == {
        "quantity": "brdf",
        "stokes_convention": "p-s",
        "illumination": [1.0, 0.0, 0.0, 0.0],
        "simulated": 0,
        "title": "white",
    }
    assert ds["I"].attrs["units"] == "1/sr"
    assert ds["phi"].attrs["units"] == "rad"


def test_mueller_matrices_carry_named_axes():
    ds = make_dataset(**ANGLES, mueller=np.eye(4))
    assert ds["mueller"].dims == ("geometry", "stokes_out", "stokes_in")
    assert float(ds["mueller"].sel(stokes_out="Q", stokes_in="Q")[2]) == 1.0


def test_arrays_are_copied():
    intensity = np.ones(3)
    ds = make_dataset(**ANGLES, I=intensity)
    intensity[:] = 7
    assert_array_equal(ds["I"], [1.0, 1.0, 1.0])


@pytest.mark.parametrize(
    ("group", "stored"),
    [
        ([3, 1, 2], np.array([3, 1, 2])),
        (["3", "1", "2"], np.array([3, 1, 2])),
        ([3.0, 1.0, 2.0], np.array([3, 1, 2])),
        (["3", "left", "2"], np.array(["3", "left", "2"])),
    ],
)
def test_group_labels_that_spell_integers_are_integers(group, stored):
    ds = make_dataset(**ANGLES, I=1.0, group=group)
    assert_array_equal(ds["group"], stored)
    assert ds["group"].dtype.kind == stored.dtype.kind


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"I": [1.0, 2.0]}, r"shape \(2,\).*\(3,\)"),
        ({"mueller": np.ones((3, 3, 3))}, r"shape \(3, 3, 3\).*\(3, 4, 4\)"),
        ({"I": "abc"}, "I does not hold real numbers"),
        ({"I": 1.0, "std": {"Q": 1.0}}, "uncertainty of Q but no Q"),
        ({"I": 1.0, "std": {"DoLP": 1.0}}, "'DoLP'.*dolp"),
        ({"I": 1.0, "quantity": "bsdf"}, "'bsdf'.*reflectance_factor"),
        ({"I": 1.0, "group": [1.5, 2, 3]}, "group labels are integers or text"),
        ({}, "the variables are none"),
        ({"mueller": np.eye(4), "I": 1.0}, "mueller alone"),
        ({"I": 1.0, "Q": 0.1, "dolp": 0.1}, "I with any of Q, U, V"),
        ({"Q_over_I": 0.1, "dolp": 0.1}, "dolp, perhaps with"),
        ({"mueller_over_m00": np.full((4, 4), 0.5)}, "divided by m00, but their own m00 is 0.5"),
        ({"I": 1.0, "quantity": "normalised"}, "'normalised', for ratios alone, but there is I"),
        ({"I": 1.0, "quantity": None}, "state the quantity"),
    ],
)
def test_what_does_not_fit_is_refused_in_words(arguments, words):
    with pytest.raises(DataError, match=words):
        make_dataset(**(ANGLES | arguments))
