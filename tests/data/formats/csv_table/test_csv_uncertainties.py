"""Columns of uncertainties: which are used and how, which are asked about, and what is no Stokes parameter."""

from __future__ import annotations

import pytest
from numpy.testing import assert_allclose

from pbrdf.data import check, read
from pbrdf.data.origin import origin_of
from pbrdf.errors import DataError

STATED = "# azimuth: forward=0\n# stokes: p-s\n# quantity: brdf\n"


@pytest.mark.parametrize(
    "name",
    [
        *("I_err", "I_unc", "I_std", "I_sd", "I_stdev", "sigma_I", "sigmaI", "σ_I", "dI", "d_I", "ΔI"),
        *("u(I)", "u_I", "uI", "u_c(I)", "std(I)", "err_I", "I_error", "I_uncertainty", "I_1sigma"),
        *("I uncertainty", "standard uncertainty of I", "I std. dev.", "std dev I", "I (1 sigma) error"),
    ],
)
def test_standard_uncertainties_of_the_intensity(text_file, name):
    ds = read(text_file(f"{STATED}theta_i,theta_r,phi,I,Q,U,{name}\n30,20,0,0.3,0.1,0.1,0.003\n"))
    assert_allclose(ds["I_std"], [0.003])
    assert dict(origin_of(ds).meanings)[name].startswith("I_std")
    assert check(ds) == []


def test_the_columns_of_the_case_c1(text_file):
    ds = read(text_file(
        f"{STATED}theta_i,theta_r,phi,I,Q,U,I_err,Q_err,U_err\n20,0,0,0.118,-0.001,0.0,0.003,0.001,0.002\n"
    ))  # fmt: skip
    assert [float(ds[name][0]) for name in ("I_std", "Q_std", "U_std")] == [0.003, 0.001, 0.002]
    assert "ignored_columns" not in ds.attrs


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("U (k=2)", "0.006"),
        ("U(I) k=2", "0.006"),
        ("U(I) (k = 2)", "0.006"),
        ("U_k2", "0.006"),
        ("expanded uncertainty (k=2)", "0.006"),
        ("uncertainty k=3", "0.009"),
        ("2sigma", "0.006"),
        ("I_2sigma", "0.006"),
        ("u(BRDF) (%)", "1"),
        ("rel. uncertainty (%)", "1"),
        ("I_std_rel", "0.01"),
        ("u (%)", "1"),
        ("u (1/sr)", "0.003"),
        ("U_rel (k=2) (%)", "2"),
        ("uncertainty (k=2) [%]", "2"),
        ("var_I", "9e-6"),
        ("variance of I", "9e-6"),
        ("stdev", "0.003"),
        ("standard uncertainty", "0.003"),
        ("unc (1/msr)", "3e-6"),
        ("brdf_unc_k2", "0.006"),
        ("BRDF U(k=2)", "0.006"),
        ("BRDF error (k=2)", "0.006"),
    ],
)
def test_other_kinds_become_standard_ones(text_file, name, value):
    """The case A1, and what is like it: expanded, relative, variances, each without being named after I."""
    ds = read(text_file(f"{STATED}theta_i,theta_r,phi,BRDF (1/sr),{name}\n30,20,0,0.3,{value}\n"))
    assert set(ds.data_vars) == {"I", "I_std"}
    assert_allclose(ds["I_std"], [0.003], rtol=1e-12)
    assert check(ds) == []


def test_per_cent_of_values_in_per_cent_are_points(text_file):
    ds = read(text_file("theta_i,theta_r,phi,Reflectance factor (%),unc (%)\n30,20,0,50,2\n"))
    assert_allclose(ds["I_std"], [0.02])
    relative = read(text_file("theta_i,theta_r,phi,Reflectance factor (%),rel. unc (%)\n30,20,0,50,2\n"))
    assert_allclose(relative["I_std"], [0.01])


def test_an_uncertainty_without_a_unit_has_that_of_its_values(text_file):
    ds = read(text_file(f"{STATED}theta_i,theta_r,phi,BRDF (1/msr),I_std\n30,20,0,0.0003,0.000003\n"))
    assert_allclose(ds["I_std"], [0.003])


@pytest.mark.parametrize(
    "name",
    [
        "expanded uncertainty",
        "U95",
        "U(I)",
        "BRDF_U95",
        "BRDF U",
        "U (95 %)",
        "U_rel (%)",
        "I expanded uncertainty (95 %)",
    ],
)
def test_an_expanded_uncertainty_without_its_factor_is_asked_about(text_file, name):
    path = text_file(f"{STATED}theta_i,theta_r,phi,BRDF,{name}\n30,20,0,0.3,0.006\n")
    with pytest.raises(DataError, match="is an expanded uncertainty: state its coverage factor k"):
        read(path)
    expected = 0.003 * (0.3 / 100 if "%" in name and "rel" in name else 1)
    assert_allclose(read(path, coverage=2)["I_std"], [expected])
    assert "I_std" not in read(path, ignore=[name])
    stated = text_file(f"# coverage: 2\n{path.read_text(encoding='utf-8')}")
    assert_allclose(read(stated)["I_std"], [expected])


def test_a_bare_u_beside_a_brdf_is_asked_about(text_file):
    path = text_file(f"{STATED}theta_i,theta_r,phi,BRDF,U\n30,20,0,0.3,0.006\n")
    with pytest.raises(DataError, match="'U' may be the Stokes parameter U or an expanded uncertainty"):
        read(path)
    assert_allclose(read(path, column={"U": "U"})["U"], [0.006])
    with pytest.raises(DataError, match="state its coverage factor"):
        read(path, column={"I_std": "U"})
    assert_allclose(read(path, column={"I_std": "U"}, coverage=2)["I_std"], [0.003])


@pytest.mark.parametrize("names", ["u,v", "v,u"])
def test_projected_coordinates_are_no_stokes_parameters(text_file, names):
    """The case A3."""
    ds = read(text_file(f"{STATED}theta_i,theta_r,phi,{names},BRDF\n30,30,0,0.5,0,0.49\n"))
    assert set(ds.data_vars) == {"I"}
    assert sorted(ds.attrs["ignored_columns"]) == ["u", "v"]
    assert [
        f"'{name}' is not taken for the Stokes" in str(i)
        for name, i in zip(names.split(","), check(ds), strict=True)
    ] == [True] * 2


def test_stokes_parameters_in_small_letters(text_file):
    ds = read(text_file(f"{STATED}theta_i,theta_r,phi,i,q,u,v\n30,30,0,0.5,0.1,0.2,0.05\n"))
    assert [float(ds[name][0]) for name in "IQUV"] == [0.5, 0.1, 0.2, 0.05]


def test_a_voltage_is_no_stokes_parameter(text_file):
    path = text_file(f"{STATED}theta_i,theta_r,phi,BRDF,V (mV)\n30,20,0,0.3,6\n")
    with pytest.raises(DataError, match=r"'V \(mV\)' may be the Stokes parameter V or a voltage"):
        read(path)
    ds = read(path, ignore=["V (mV)"])
    assert set(ds.data_vars) == {"I"}
    assert check(ds) == []


@pytest.mark.parametrize("name", ["error", "± I", "+- I", "sigma", "sample_error", "Q_err", "s_I"])
def test_what_may_be_an_uncertainty_is_not_used_and_named(text_file, name):
    ds = read(text_file(f"{STATED}theta_i,theta_r,phi,I,{name}\n30,20,0,0.3,0.006\n"))
    assert set(ds.data_vars) == {"I"}
    (issue,) = check(ds)
    assert str(issue).startswith(
        f"the column {name!r} looks like an uncertainty and is not used; use it with column="
    )
    assert_allclose(
        read(text_file(f"{STATED}theta_i,theta_r,phi,I,{name}\n30,20,0,0.3,0.006\n"), column={"I_std": name})[
            "I_std"
        ],
        [0.006],
    )
    assert (
        check(read(text_file(f"{STATED}theta_i,theta_r,phi,I,{name}\n30,20,0,0.3,1\n"), ignore=[name])) == []
    )


def test_an_unnamed_uncertainty_of_several_channels_is_named(text_file):
    ds = read(text_file(f"{STATED}theta_i,theta_r,phi,I,Q,stdev\n30,20,0,0.3,0.1,0.006\n"))
    assert "column={'…_std': 'stdev'}" in str(check(ds)[0])


def test_of_two_uncertainties_the_standard_one_is_taken(text_file):
    ds = read(text_file(f"{STATED}theta_i,theta_r,phi,I,U (k=2),u(I)\n30,20,0,0.3,0.0062,0.003\n"))
    assert_allclose(ds["I_std"], [0.003])
    assert dict(origin_of(ds).meanings)["U (k=2)"] == ""
    with pytest.raises(DataError, match="'I_err' and 'I_unc' both stand for I_std; choose with"):
        read(text_file(f"{STATED}theta_i,theta_r,phi,I,I_err,I_unc\n30,20,0,0.3,0.0062,0.003\n"))


def test_a_negative_variance_is_refused(text_file):
    with pytest.raises(DataError, match="line 5, column 'var_I': a variance must not be negative"):
        read(text_file(f"{STATED}theta_i,theta_r,phi,I,var_I\n30,20,0,0.3,-1\n"))


def test_covariances_have_the_square_of_the_values_unit(text_file):
    ds = read(text_file(
        f"{STATED}theta_i,theta_r,phi,I (1/msr),Q (1/msr),I_std,Q_std,cov_IQ\n30,20,0,0.3,0.1,0.01,0.01,0.00005\n"
    ))  # fmt: skip
    assert_allclose(ds["covariance"].values[0, 0, :2], [100.0, 50.0])


@pytest.mark.parametrize(("text", "words"), [("two", "coverage is 'two'"), ("0", "coverage is '0'")])
def test_a_coverage_factor_is_a_number_above_0(text_file, text, words):
    with pytest.raises(DataError, match=words):
        read(text_file(f"{STATED}# coverage: {text}\ntheta_i,theta_r,phi,I,U (k=2)\n30,20,0,0.3,0.1\n"))


@pytest.mark.parametrize(
    "comment",
    ["expanded uncertainties, k = 2", "Uncertainties are expanded (coverage factor k=2)"],
)
def test_a_comment_says_that_the_uncertainties_are_expanded(text_file, comment):
    names = "theta_i,theta_r,phi,BRDF,uncertainty"
    ds = read(text_file(f"{STATED}# {comment}\n{names}\n30,20,0,0.3,0.006\n"))
    assert_allclose(ds["I_std"], [0.003])
    standard = read(
        text_file(f"{STATED}# {comment}\n{names.replace('uncert', 'standard uncert')}\n30,20,0,0.3,0.006\n")
    )
    assert_allclose(standard["I_std"], [0.006])


def test_names_of_any_length_are_read_in_no_time(text_file):
    names = ["_" * 100_000, "(" * 50_000, "I" * 50_000 + "_400nm"]
    ds = read(
        text_file(
            f"{STATED}# {'theta_i in ' * 20_000}\ntheta_i,theta_r,phi,I,{','.join(names)}\n30,20,0,1,2,3,4\n"
        )
    )
    assert ds.attrs["ignored_columns"] == names


@pytest.mark.parametrize("name", ["u(R)", "R_err", "sigma_R", "dR", "u_R", "U(R) (k=1)", "R uncertainty"])
def test_uncertainties_of_a_reflectance_factor_called_r(text_file, name):
    ds = read(text_file(f"# azimuth: forward=0\ntheta_i,theta_r,phi,R,{name}\n30,20,0,0.9,0.02\n"))
    assert_allclose(ds["I_std"], [0.02])


@pytest.mark.parametrize("name", ["2 sigma", "2 SD", "3 sigma", "2 sigma BRDF", "2sigma"])
def test_multiples_of_sigma_in_two_words_are_divided(text_file, name):
    ds = read(text_file(f"{STATED}theta_i,theta_r,phi,BRDF,{name}\n30,20,0,0.3,0.06\n"))
    assert_allclose(ds["I_std"], 0.06 / int(name[0]))


def test_uncertainties_above_the_values_are_rather_per_cent(text_file):
    path = text_file(f"{STATED}theta_i,theta_r,phi,I,unc\n30,20,0,0.3,5\n30,30,0,0.4,5\n")
    (said,) = check(read(path))
    assert "state unit={'unc': '%'}" in str(said)
    ds = read(path, unit={"unc": "%"})
    assert_allclose(ds["I_std"], [0.015, 0.02])
    assert check(ds) == []


def test_small_letters_beside_a_capital_intensity_may_be_shares(text_file):
    path = text_file(f"{STATED}theta_i,theta_r,phi,I,q,u\n30,20,0,0.3,0.1,0.2\n")
    said = [str(issue) for issue in check(read(path))]
    assert [f"column={{'{v}_over_I': '{v.lower()}'}}" in s for v, s in zip("QU", said, strict=True)] == [
        True
    ] * 2
    ds = read(path, column={"Q_over_I": "q", "U_over_I": "u"})
    assert_allclose(ds["Q_over_I"], [0.1])
    assert check(ds) == []
    assert check(read(text_file(f"{STATED}theta_i,theta_r,phi,i,q,u\n30,20,0,0.3,0.1,0.2\n"))) == []


def test_names_in_tex(text_file):
    ds = read(text_file(
        f"{STATED}$\\theta_i$ (deg),$\\theta_r$ (deg),$\\phi$ (deg),$f_r$ (sr$^{{-1}}$),$\\sigma_{{f_r}}$\n"
        "30,20,0,0.3,0.01\n"
    ))  # fmt: skip
    assert_allclose(ds["I"], [0.3])
    assert_allclose(ds["I_std"], [0.01])


@pytest.mark.parametrize("name", ["$U$", "U:", "U 1/sr", "U [1/sr]"])
def test_u_in_any_dress_is_asked_about(text_file, name):
    with pytest.raises(DataError, match="may be the Stokes parameter U or an expanded uncertainty"):
        read(text_file(f"{STATED}theta_i,theta_r,phi,BRDF,{name}\n30,20,0,0.3,0.01\n"))
