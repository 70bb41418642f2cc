from __future__ import annotations

import pytest

from pbrdf.data.schema import spells_integer, std_name, variable_dims, variable_units


@pytest.mark.parametrize("label", ["0", "-3", "12", "9223372036854775807"])
def test_labels_that_read_back_as_integers(label):
    assert spells_integer(label)


@pytest.mark.parametrize("label", ["", "01", "1.0", "+1", "1_0", "a", "-0", "9223372036854775808"])
def test_labels_that_would_change_as_integers(label):
    assert not spells_integer(label)


def test_uncertainties_share_dimensions_and_units_with_their_variables():
    for variable in ("I", "dolp", "aolp", "mueller"):
        assert variable_dims(std_name(variable)) == variable_dims(variable)
        assert variable_units(std_name(variable), "brdf") == variable_units(variable, "brdf")


def test_units_follow_the_quantity_for_intensities_only():
    assert variable_units("mueller", "brdf") == "1/sr"
    assert variable_units("I", "reflectance_factor") == "1"
    assert variable_units("covariance", "brdf") == "1/sr2"
    assert variable_units("covariance", "reflectance_factor") == "1"
    assert variable_units("dolp", "brdf") == "1"
    assert variable_units("theta_i", "dn") == "rad"
    assert variable_units("wavelength", "dn") == "nm"
