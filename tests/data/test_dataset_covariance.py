"""The covariance of the Stokes components in data sets: what it must be, and how files hold it."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_allclose, assert_array_equal

from pbrdf.data import check, make_dataset, read, validate, write
from pbrdf.data.covariance import correlations
from pbrdf.errors import DataError

STD = {"I": [0.02, 0.03, 0.04], "Q": [0.01, 0.012, 0.014], "U": [0.01, 0.011, 0.012], "V": [0.03, 0.03, 0.03]}
CORRELATION = np.array(
    [[1.0, 0.8, 0.1, -0.2], [0.8, 1.0, 0.3, 0.0], [0.1, 0.3, 1.0, 0.4], [-0.2, 0.0, 0.4, 1.0]]
)
COVARIANCE = np.einsum("ig,ij,jg->gij", [STD[c] for c in "IQUV"], CORRELATION, [STD[c] for c in "IQUV"])


def build(channels="IQUV", **more):
    values = {"I": 1.0, "Q": 0.1, "U": -0.2, "V": 0.05}
    more = {"quantity": "brdf", "covariance": COVARIANCE, **more}
    return make_dataset([0.1, 0.2, 0.3], 0.4, 0.0, **{c: values[c] for c in channels}, **more)


@pytest.fixture
def ds():
    return build()


def only_error(ds):
    (issue,) = [issue for issue in check(ds) if issue.severity == "error"]
    return issue


# --- building -------------------------------------------------------------------------------------


def test_the_standard_uncertainties_are_the_roots_of_the_diagonal(ds):
    for name, std in STD.items():
        assert_allclose(ds[f"{name}_std"], std, rtol=1e-15)
    assert_allclose(ds["covariance"], COVARIANCE, rtol=1e-15)
    assert ds["covariance"].dims == ("geometry", "stokes_row", "stokes_column")
    assert float(ds["covariance"].sel(stokes_row="I", stokes_column="Q")[1]) == pytest.approx(
        0.8 * 0.03 * 0.012
    )
    assert ds["covariance"].attrs["units"] == "1/sr2"
    assert check(ds) == []


def test_stated_uncertainties_stay_and_the_others_are_filled(ds):
    stated = build(std={"Q": STD["Q"]})
    assert_array_equal(stated["Q_std"], STD["Q"])
    assert_allclose(stated["U_std"], STD["U"])
    with pytest.raises(
        DataError, match=r"indices 0, 2: the variance of Q is 0\.0001, that is 0\.01², but Q_std is 0\.02"
    ):
        build(std={"Q": [0.02, 0.012, 0.02]})
    with pytest.raises(DataError, match=r"index 1: the variance of Q is .* but Q_std is not stated"):
        build(std={"Q": [0.01, np.nan, 0.014]})


def test_one_matrix_serves_all_rows():
    assert_allclose(build(covariance=COVARIANCE[0])["covariance"], np.stack([COVARIANCE[0]] * 3))


def test_what_is_not_known_is_nan():
    """Row 0 knows no covariance at all, in row 1 U was not measured, in row 2 V is independent of the others."""
    covariance = COVARIANCE.copy()
    covariance[0] = np.nan
    covariance[1, 2, :] = covariance[1, :, 2] = np.nan
    covariance[2, 3, :3] = covariance[2, :3, 3] = np.nan
    std = {name: np.where([True, name != "U", True], value, np.nan) for name, value in STD.items()}
    ds = build(covariance=covariance, std=std)
    assert check(ds) == []
    found = correlations(ds["covariance"].values)
    assert_array_equal(found[0], np.eye(4))
    assert_allclose(found[1], np.where(np.isnan(covariance[1]), np.eye(4), CORRELATION))
    assert_allclose(found[2], np.where(np.isnan(covariance[2]), 0.0, CORRELATION))


def test_a_covariance_needs_no_polarised_components():
    only_i = np.full((4, 4), np.nan)
    only_i[0, 0] = 0.25
    ds = build("I", covariance=only_i)
    assert_array_equal(ds["I_std"], 0.5)
    validate(ds)


def test_rounding_of_a_product_is_evened_out():
    """J C Jᵀ is symmetric to rounding only."""
    turn = np.linalg.qr(np.random.default_rng(4).normal(size=(4, 4)))[0]
    product = turn @ COVARIANCE @ turn.T
    assert not np.array_equal(product, product.transpose(0, 2, 1))
    found = build(covariance=product)["covariance"].values
    assert_array_equal(found, found.transpose(0, 2, 1))
    assert_allclose(found, product, rtol=1e-12, atol=1e-18)


@pytest.mark.parametrize(
    ("covariance", "words"),
    [
        (np.ones((3, 3, 3)), r"shape \(3, 3, 3\), but \(3, 4, 4\) is needed here, in the order I, Q, U, V"),
        (np.ones((2, 4, 4)), r"covariance has the shape \(2, 4, 4\), but \(3, 4, 4\) is needed"),
        (0.1, r"shape \(\)"),
        ("much", "covariance does not hold real numbers"),
    ],
)
def test_shapes_that_do_not_fit(covariance, words):
    with pytest.raises(DataError, match=words):
        build(covariance=covariance)


# --- judging --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("row", "entries", "words"),
    [
        (1, {(0, 1): 0.0, (1, 0): 1e-4}, "(I, Q) is 0 but (Q, I) is 0.0001; a covariance is symmetric"),
        (2, {(1, 2): np.nan}, "(Q, U) is nan but (U, Q) is"),
        (0, {(2, 2): 0.0}, "the variance of U must be positive, not 0"),
        (0, {(3, 3): -1e-4}, "the variance of V must be positive, not -0.0001"),
        (2, {(1, 1): np.nan}, "there is a covariance (I, Q) but no variance of Q"),
        (1, {(1, 1): 0.012**2 * (1 + 3e-6)}, "the diagonal is the square of the standard uncertainties"),
        (
            1,
            {(0, 1): 4e-4, (1, 0): 4e-4},
            "not positive semidefinite (the largest correlation, (I, Q), is 1.11111",
        ),
        (0, {(1, 2): -7e-5, (2, 1): -7e-5}, "not positive semidefinite"),
        (1, {(0, 3): np.inf, (3, 0): np.inf}, "infinite"),
    ],
)
def test_what_is_no_covariance_is_an_error_that_names_the_row(ds, row, entries, words):
    for (i, j), value in entries.items():
        ds["covariance"][row, i, j] = value
    issue = only_error(ds)
    assert issue.variable == "covariance"
    assert issue.rows == (row,)
    assert f"index {row}" in issue.message
    assert words in issue.message


def test_a_singular_covariance_and_agreement_to_a_millionth_are_allowed(ds):
    ds["covariance"][0] = np.outer(*[[STD[c][0] for c in "IQUV"]] * 2)
    ds["covariance"][1, 0, 0] *= 1 + 5e-7
    assert check(ds) == []


def test_every_row_is_named_once_with_the_first_thing_wrong(ds):
    ds["covariance"][:, 0, 0] = -1.0
    ds["covariance"][2, 0, 1] = 5.0
    first, second = [issue for issue in check(ds) if issue.severity == "error"]
    assert first.rows == (2,) and "symmetric" in str(first)
    assert second.rows == (0, 1) and "positive" in str(second)


def test_components_without_values_have_no_covariance(ds):
    with pytest.raises(
        DataError, match="indices 0, 1, 2: there is a covariance of V but no V; put NaN there"
    ):
        validate(ds.drop_vars(["V", "V_std"]))
    with pytest.raises(DataError, match="Q_std is not stated"):
        validate(ds.drop_vars("Q_std"))


@pytest.mark.parametrize(
    ("form", "words"),
    [
        ({"I": 1.0, "dolp": 0.1}, "cannot stand beside dolp"),
        ({"mueller": np.eye(4)}, "cannot stand beside mueller"),
    ],
)
def test_only_stokes_components_have_a_covariance(form, words):
    unknown = np.full((4, 4), np.nan)
    with pytest.raises(DataError, match=words):
        make_dataset(0.1, 0.2, 0.0, quantity="brdf", covariance=unknown, **form)


def test_the_axes_are_in_the_order_of_the_components(ds):
    with pytest.raises(DataError, match="stokes_row must be I, Q, U, V in this order"):
        validate(ds.assign_coords(stokes_row=["Q", "I", "U", "V"]))
    with pytest.raises(DataError, match=r"\('geometry', 'stokes_row', 'stokes_column'\) is needed"):
        validate(ds.assign(covariance=ds["covariance"].transpose("stokes_row", "geometry", "stokes_column")))


# --- rows together and apart ----------------------------------------------------------------------


def test_rows_taken_and_joined_keep_their_covariance(ds):
    part, rest = ds.isel(geometry=[2]), ds.isel(geometry=[0, 1])
    assert_array_equal(part["covariance"][0], ds["covariance"][2])
    joined = xr.concat([part, rest], "geometry", data_vars="all")
    validate(joined)
    assert_array_equal(joined["covariance"][0], ds["covariance"][2])


def test_data_without_a_covariance_join_those_with_one(ds):
    """Its place is then NaN: there the standard uncertainties stand by themselves."""
    without = ds.isel(geometry=[0]).drop_vars("covariance").drop_vars(["stokes_row", "stokes_column"])
    joined = xr.concat(
        [ds, without], "geometry", data_vars="all", join="outer", coords="different", compat="equals"
    )
    validate(joined)
    assert np.isnan(joined["covariance"][3]).all()
    assert_array_equal(joined["I_std"][3], ds["I_std"][0])


# --- files ----------------------------------------------------------------------------------------


def test_a_table_holds_the_covariances_between_what_was_measured(tmp_path):
    covariance = COVARIANCE.copy()
    covariance[:, 3, :] = covariance[:, :, 3] = np.nan
    write(build("IQU", covariance=covariance), tmp_path / "data.csv")
    names = (tmp_path / "data.csv").read_text().splitlines()[-4].split(",")
    assert names[4:] == ["I", "I_std", "Q", "Q_std", "U", "U_std", "cov_IQ", "cov_IU", "cov_QU"]


def test_variances_stand_in_a_table_only_where_they_are_not_exactly_the_squares(ds, tmp_path):
    ds["covariance"][1, 1, 1] *= 1 + 1e-12
    write(ds, tmp_path / "data.csv")
    assert ",cov_IQ,cov_IU,cov_IV,cov_QQ,cov_QU,cov_QV,cov_UV\n" in (tmp_path / "data.csv").read_text()
    assert read(tmp_path / "data.csv").identical(ds)


TABLE = "# quantity: brdf\n# azimuth: forward=0\n# stokes: {}\ntheta_i,theta_r,phi,I,Q,U,V,"
FILE = TABLE + "I_std,Q_std,U_std,V_std,cov_IQ,cov_IU,cov_IV,cov_QU,cov_QV,cov_UV\n"
FILE += "30,60,0,1,.1,.2,.3,.1,.1,.1,.1,.001,.002,.003,.004,.005,.006\n"


def test_s_minus_p_changes_the_sign_of_covariances_with_one_of_q_and_u(text_file):
    """Their Q > 0 is along s: Q and U change sign, and so do their covariances with I and V; (Q, U) does not."""
    theirs = read(text_file(FILE.format("s-p")))["covariance"].values[0]
    ours = read(text_file(FILE.format("p-s")))["covariance"].values[0]
    i, j = np.triu_indices(4, 1)
    assert_allclose(ours[i, j], [0.001, 0.002, 0.003, 0.004, 0.005, 0.006])
    assert_allclose(theirs[i, j], [-0.001, -0.002, 0.003, 0.004, -0.005, -0.006])
    assert_array_equal(theirs, theirs.T)
    assert_array_equal(np.diag(theirs), np.diag(ours))


def test_cosine_weight_is_divided_out_twice(text_file):
    plain = read(text_file(FILE.format("p-s")))
    weighted = read(text_file(FILE.format("p-s")), cosine_weighted=True)
    assert_allclose(weighted["covariance"], 4.0 * plain["covariance"])
    assert_array_equal(np.diag(weighted["covariance"].values[0])[1], weighted["Q_std"].values[0] ** 2)


def test_strangers_name_covariances_in_either_order_and_variances_for_uncertainties(text_file):
    ds = read(text_file(
        TABLE.format("p-s") + "Cov_II,cov s1s0,cov[1]\n30,60,0,1,.1,.2,.3,0.04,0.001,9\n"
    ), column={"cov_QQ": "=0.01"})  # fmt: skip
    assert_allclose(ds["I_std"], 0.2)
    assert_allclose(ds["Q_std"], 0.1)
    assert "U_std" not in ds
    assert_allclose(ds["covariance"][0, :2, :2], [[0.04, 0.001], [0.001, 0.01]])
    assert np.isnan(ds["covariance"][0, 2:]).all()
    assert ds.attrs["ignored_columns"] == ["cov[1]"]


def test_mistakes_in_a_table_are_named_by_their_line(text_file):
    path = text_file(FILE.format("p-s").replace(".001,", "0.02,"))
    with pytest.raises(DataError, match=r"data\.csv.*covariance, line 5: .* \(I, Q\), is 2"):
        read(path)
    with pytest.raises(DataError, match="there are no rows"):
        read(path, skip_invalid=True)
    both = TABLE.format("p-s") + "cov_IQ,cov_QI\n" + "1," * 8 + "1\n"
    with pytest.raises(DataError, match="'cov_IQ' and 'cov_QI' both stand for cov_IQ"):
        read(text_file(both))
    with pytest.raises(DataError, match=r"no column is called 'cov_LR' here; .* or cov_IQ … cov_UV"):
        read(path, column={"cov_LR": "x"})


def test_a_strangers_netcdf_without_axes_or_uncertainties(ds, tmp_path):
    """The axes need no labels; the standard uncertainties must be there."""
    bare = ds.drop_vars(["stokes_row", "stokes_column"])
    bare.to_netcdf(tmp_path / "bare.nc", engine="h5netcdf")
    assert_array_equal(read(tmp_path / "bare.nc")["covariance"], ds["covariance"])
    bare.drop_vars("U_std").to_netcdf(tmp_path / "bare.nc", engine="h5netcdf")
    with pytest.raises(DataError, match=r"bare\.nc .* indices 0, 1, 2: .* but U_std is not stated"):
        read(tmp_path / "bare.nc")
