"""Data sets side by side."""

import numpy as np
import pytest

import pbrdf
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.stack import Stack


@pytest.mark.parametrize(
    ("group", "wavelength", "different"),
    [
        ([1, 1, 2, 2], [450.0, 550.0, 450.0, 550.0], 8),
        ([1, 1, 2, 2], [450.0, 450.0, 450.0, 450.0], 4),
        ([1, 1, 1, 1], [450.0, 450.0, 450.0, 450.0], 2),
    ],
)
def test_groups_and_wavelengths_of_one_direction_are_told_apart(group, wavelength, different):
    """By both together: the second group at the first wavelength is not the first group at the second."""
    one = np.full(4, 0.5)
    ds = pbrdf.make_dataset(
        one, one, np.array([0.0, 2 * np.pi, -1e-17, 0.0]), quantity="brdf", I=one, Q=0.1 * one,
        group=np.array(group), wavelength=np.array(wavelength),
    )  # fmt: skip
    assert Stack.of([Observations.from_dataset(ds)]).different_values() == [different]
