from __future__ import annotations

import numpy as np
import pytest

import pbrdf
from pbrdf.data import Issue, check, make_dataset, read, validate, write
from pbrdf.errors import DataError


@pytest.fixture
def ds():
    return make_dataset(
        [0.1, 0.2, 0.3], 0.5, 0.0, quantity="brdf", I=[1.0, 2.0, 3.0], Q=0.1, std={"I": 0.1}, wavelength=500.0
    )


def only(issues: list[Issue]) -> Issue:
    assert len(issues) == 1, [str(issue) for issue in issues]
    return issues[0]


def test_a_clean_data_set_has_no_issues(ds):
    assert check(ds) == []


@pytest.mark.parametrize("value", [-0.1, np.pi / 2, np.nan, np.inf])
@pytest.mark.parametrize("name", ["theta_i", "theta_r"])
def test_zenith_angles_outside_the_hemisphere_are_errors(ds, name, value):
    ds[name][1] = value
    issue = only(check(ds))
    assert (issue.severity, issue.variable, issue.rows) == ("error", name, (1,))
    assert "index 1" in issue.message


def test_degrees_taken_for_radians_are_recognised(ds):
    ds["theta_r"][:] = [30.0, 60.0, 75.0]
    assert "numpy.deg2rad" in only(check(ds)).message


def test_a_value_just_past_the_horizon_is_not_called_degrees(ds):
    ds["theta_r"][:] = [0.1, 0.2, 1.6]
    assert "degrees" not in only(check(ds)).message


def test_radians_taken_for_degrees_are_a_warning(ds):
    ds["theta_i"][:] = np.deg2rad(ds["theta_i"])
    ds["theta_r"][:] = np.deg2rad(ds["theta_r"])
    assert only(check(ds)).severity == "warning"


@pytest.mark.parametrize("value", [180.0, np.nan, -6.4])
def test_azimuths_beyond_one_turn_are_errors(ds, value):
    ds["phi"][2] = value
    assert only(check(ds)).rows == (2,)


def test_azimuth_of_a_full_turn_is_allowed(ds):
    ds["phi"][:] = [-2 * np.pi, 2 * np.pi, 6.2832]
    assert check(ds) == []


def test_aolp_in_degrees_is_an_error_and_nan_is_not():
    ds = make_dataset([0.1, 0.2], 0.5, 0.0, quantity="dn", I=1.0, dolp=0.1, aolp=[np.nan, 0.3])
    assert check(ds) == []
    ds["aolp"][0] = 83.0
    assert only(check(ds)).variable == "aolp"


@pytest.mark.parametrize(("name", "value"), [("I_std", 0.0), ("I_std", -1.0), ("wavelength", 0.0)])
def test_uncertainties_and_wavelengths_must_be_positive(ds, name, value):
    ds[name][1] = value
    issue = only(check(ds))
    assert issue.severity == "error"
    assert name in issue.message
    assert "positive" in issue.message


def test_infinite_values_are_errors(ds):
    ds["Q"][0] = -np.inf
    errors = [issue for issue in check(ds) if issue.severity == "error"]
    assert only(errors).variable == "Q"


def test_nothing_measured_in_a_row_is_a_warning(ds):
    ds["I"][1] = ds["Q"][1] = np.nan
    issue = only(check(ds))
    assert (issue.severity, issue.rows) == ("warning", (1,))


@pytest.mark.parametrize("value", [0.0, -0.2])
def test_intensity_that_is_not_positive_is_a_warning(ds, value):
    ds["I"][0] = value
    issue = only(check(ds))
    assert (issue.severity, issue.variable, issue.rows) == ("warning", "I", (0,))


@pytest.mark.parametrize(
    ("std", "q", "reported"),
    [(0.1, 2.0, False), (0.1, 3.0, True), (0.01, 1.05, False), (0.01, 1.1, True)],
)
def test_degree_of_polarization_above_one_counts_uncertainties(std, q, reported):
    """I = 1 ± u and Q = q ± u: the ratio is q ± u √(1 + q²), and five of these are tolerated."""
    ds = make_dataset(0.1, 0.2, 0.0, quantity="brdf", I=1.0, Q=q, std={"I": std, "Q": std})
    assert bool(check(ds)) == reported


def test_degree_of_polarization_uses_all_channels():
    parts = {"Q": 0.6, "U": 0.6, "V": 0.6}
    assert "degree of polarisation" in str(
        only(check(make_dataset(0.1, 0.2, 0.0, quantity="brdf", I=1.0, **parts)))
    )
    assert check(make_dataset(0.1, 0.2, 0.0, quantity="brdf", I=1.0, Q=0.6, U=0.6, V=np.nan)) == []


@pytest.mark.parametrize("dolp", [1.01, -0.01])
def test_dolp_outside_its_range_is_a_warning(dolp):
    ds = make_dataset(0.1, 0.2, 0.0, quantity="brdf", I=1.0, dolp=dolp)
    issue = only(check(ds))
    assert (issue.severity, issue.variable) == ("warning", "dolp")


@pytest.mark.parametrize(("q", "std", "reported"), [(0.9, 0.01, False), (1.2, 0.1, False), (1.2, 0.01, True)])
def test_normalised_parameters_above_one_count_uncertainties(q, std, reported):
    ds = make_dataset(0.1, [0.4, 0.5], 0.0, Q_over_I=[0.0, -q], U_over_I=0.1, std={"Q_over_I": std})
    issues = check(ds)
    assert bool(issues) == reported
    if reported:
        assert (only(issues).variable, only(issues).rows) == ("Q_over_I", (1,))
        assert "degree of polarisation" in only(issues).message


def test_elements_over_m00_above_one_are_a_warning():
    M = np.full((2, 4, 4), np.nan)
    M[:, 2, 2] = [-0.5, -1.5]
    issue = only(check(make_dataset(0.1, [0.4, 0.5], 0.0, mueller_over_m00=M)))
    assert (issue.severity, issue.rows) == ("warning", (1,)) and "|m_ij|/m00 = 1.5" in issue.message


def test_mueller_elements_above_m00_are_a_warning_beyond_their_uncertainty():
    mueller = np.diag([1.0, 1.3, 0.5, 0.5])
    exact = make_dataset(0.1, 0.2, 0.0, quantity="brdf", mueller=mueller)
    rough = make_dataset(0.1, 0.2, 0.0, quantity="brdf", mueller=mueller, std={"mueller": 0.1})
    assert only(check(exact)).variable == "mueller"
    assert check(rough) == []


@pytest.mark.parametrize(
    ("attrs", "words"),
    [
        ({"quantity": "bsdf"}, "brdf, reflectance_factor, radiance, dn"),
        ({"stokes_convention": "s-p"}, "must be 'p-s'"),
        ({"simulated": 2}, "use 0 or 1"),
        ({"illumination": [1, 0, 0]}, "four numbers"),
        ({"illumination": "natural"}, "four numbers"),
        ({"illumination": [1, 1, 1, 0]}, "no Stokes vector"),
        ({"illumination": [0, 0, 0, 0]}, "no Stokes vector"),
        ({"title": 5}, "not text"),
        ({"Title": "x"}, "lower case"),
        ({"azimuth": "forward=0"}, "files state conventions"),
        ({"nested": {"a": 1}}, "cannot be stored"),
        ({"limit": np.inf}, "cannot be stored"),
        ({"mixed": [1, "a"]}, "cannot be stored"),
        ({"a b": 1}, "attribute name"),
    ],
)
def test_attributes_that_break_the_schema(ds, attrs, words):
    ds.attrs |= attrs
    issue = only(check(ds))
    assert issue.severity == "error"
    assert words in issue.message


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda ds: ds.rename(geometry="row"), "no dimension 'geometry'"),
        (lambda ds: ds.isel(geometry=[]), "no rows"),
        (lambda ds: ds.drop_vars("phi"), "coordinate phi is missing"),
        (lambda ds: ds.reset_coords("wavelength"), "must be a coordinate"),
        (lambda ds: ds.assign(DoLP=ds["Q"]), "no variable 'DoLP'"),
        (lambda ds: ds.assign(V_std=ds["Q"]), "V_std is there but V is not"),
        (lambda ds: ds.assign(Q=ds["Q"].astype(int)), "floating-point"),
        (lambda ds: ds.assign(Q=("other", [1.0])), "dimensions"),
        (lambda ds: ds.drop_vars(["I", "I_std"]), "the variables are Q"),
    ],
)
def test_structure_that_breaks_the_schema(ds, change, words):
    with pytest.raises(DataError, match=words):
        validate(change(ds))


@pytest.mark.parametrize("label", ["", " a", "a\nb"])
def test_group_labels_that_do_not_survive_a_text_file(ds, label):
    ds = ds.assign_coords(group=("geometry", np.array([label, "b", "c"])))
    issue = only(check(ds))
    assert (issue.variable, issue.rows) == ("group", (0,))


def test_stokes_axes_must_be_in_order():
    ds = make_dataset(0.1, 0.2, 0.0, quantity="brdf", mueller=np.eye(4))
    ds = ds.assign_coords(stokes_in=["I", "U", "Q", "V"])
    assert only(check(ds)).variable == "stokes_in"


def test_all_errors_are_listed_and_named_as_in_the_file(ds):
    ds["theta_i"][0] = 2.0
    ds["I_std"][2] = 0.0
    with pytest.raises(DataError) as caught:
        validate(ds, origin="run.csv", lines=[4, 5, 9], columns={"I_std": "sigma"})
    message = str(caught.value)
    assert message.startswith("run.csv")
    assert "theta_i, line 4: 2 rad (114.592°)" in message
    assert "I_std (column 'sigma'), line 9" in message


def test_errors_come_before_warnings_and_many_rows_are_shortened():
    ds = make_dataset(np.full(9, 0.1), 0.2, 0.0, quantity="brdf", I=-1.0)
    ds["theta_r"][:] = 1.6
    first, second = check(ds)
    assert (first.severity, second.severity) == ("error", "warning")
    assert "indices 0, 1, 2, 3, 4 and 4 more" in str(first)
    assert first.rows == tuple(range(9))


def test_assumptions_of_a_reader_are_warnings(ds):
    ds.attrs["assumptions"] = ["forward was assumed"]
    assert str(only(check(ds))) == "forward was assumed"


def test_a_data_set_made_by_hand_needs_no_groups(tmp_path):
    """Judged, written, described and fitted like one whose rows are all of group 0."""
    ds = make_dataset(np.linspace(0.1, 1.2, 9), 0.4, 0.0, quantity="brdf", I=np.linspace(0.1, 0.2, 9))
    bare = ds.drop_vars("group")
    validate(bare)
    assert check(bare) == check(ds)
    for name in ("bare.csv", "bare.nc"):
        write(bare, tmp_path / name)
        assert (read(tmp_path / name)["group"] == 0).all()
    result = pbrdf.fit(bare, starts=2, free=["a"])
    assert str(result.comparison["group"].values[0]) == "0"
    assert "group" not in bare.coords


def test_places_in_memory_are_called_indices_and_lines_of_files_lines():
    ds = make_dataset([0.1, 0.2], 0.2, 0.0, quantity="brdf", I=-1.0)
    assert "indices 0, 1: " in str(check(ds)[0]) and "lines 4, 5: " in str(check(ds, lines=[4, 5])[0])
