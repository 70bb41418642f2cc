"""Files of others through the commands: what columns were taken for, what is asked before any work."""

from __future__ import annotations

import json

import numpy as np
import pytest

import pbrdf

STATED = "# quantity: brdf\n# azimuth: forward=0\n# stokes: p-s\n"


@pytest.fixture
def scan(tmp_path):
    """Write a small measurement as a stranger would; returns its path."""

    def write(name="data.csv", uncertainty="I_err", wavelengths=(550,), header=STATED, extra=""):
        lines = [header + f"theta_i,theta_r,phi,wavelength,I,{uncertainty},sample{',note' if extra else ''}"]
        for wavelength in wavelengths:
            for theta_i in (30.0, 50.0):
                for theta_r in np.arange(0.0, 80.0, 10.0):
                    value = 0.1 + 0.2 * np.exp(-(((theta_r - theta_i) / 15.0) ** 2))
                    lines.append(f"{theta_i},{theta_r},0,{wavelength},{value:.6g},0.01,A{extra}")
        path = tmp_path / name
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return path

    return write


def test_check_lists_the_columns(run, tmp_path):
    (tmp_path / "data.csv").write_text(
        f"{STATED}theta_i_deg,theta_r,phi,BRDF (1/sr),U (k=2),Q_err,note\n30,20,0,0.3,0.006,1,x\n",
        encoding="utf-8",
    )
    lines = run("check", "data.csv").stdout.splitlines()
    assert (
        "columns: theta_i_deg → theta_i (deg), theta_r → theta_r (deg), phi → phi (deg), BRDF (1/sr) → I (1/sr), "
        "U (k=2) → I_std (expanded, divided by k = 2)"
    ) in lines
    assert "not used: Q_err, note" in lines
    assert (
        "warning: the column 'Q_err' looks like an uncertainty and is not used; use it with --column I_std=Q_err, or "
        "leave it out with --ignore Q_err"
    ) in lines
    left = run("check", "data.csv", "--ignore", "Q_err").stdout.splitlines()
    assert "not used: note" in left
    assert "left out as asked: Q_err" in left
    assert left[-1] == "Nothing is wrong with it."


def test_advice_can_be_pasted_into_a_shell(run, refused, tmp_path):
    (tmp_path / "data.csv").write_text(
        f"{STATED}theta_i,theta_r,phi,BRDF,V (mV),paint no\n30,20,0,0.3,6,1\n30,30,0,0.3,6,2\n",
        encoding="utf-8",
    )
    assert "--column 'V=V (mV)', or leave it out with --ignore 'V (mV)'" in refused("check", "data.csv")
    words = run("check", "data.csv", "--ignore", "V (mV)").stdout
    assert "take one with --where 'paint no=1', keep them apart with --column 'group=paint no'" in words


def test_options_reach_the_reader(run, refused, tmp_path):
    (tmp_path / "data.csv").write_text(
        f"{STATED}theta_i,theta_r,phi,BRDF,DoLP,U95\n500,20,0,0.3,21,0.06\n", encoding="utf-8"
    )
    assert "state its coverage factor k, for example --coverage 2" in refused(
        "check", "data.csv", "--column", "I_std=U95"
    )
    options = ["--unit", "theta_i=mrad", "--unit", "dolp=%", "--column", "I_std=U95", "--coverage", "2"]
    run("convert", "data.csv", "data.nc", *options, "--scale", "arbitrary")
    ds = pbrdf.read(tmp_path / "data.nc")
    assert [float(ds[name][0]) for name in ("theta_i", "dolp", "I_std")] == [0.5, 0.21, 0.03]
    assert ds.attrs["scale"] == "arbitrary"
    assert run("convert", "data.nc", "other.nc", "--scale", "absolute").stderr == ""
    assert pbrdf.read(tmp_path / "other.nc").attrs["scale"] == "absolute"
    assert "--scale 'half': choose arbitrary or absolute" in refused("check", "data.nc", "--scale", "half")
    assert "the unit 'grad' is not understood" in refused("check", "data.csv", "--unit", "theta_i=grad")


def test_what_should_be_used_is_said_on_standard_error(run, scan):
    scan(uncertainty="error")
    result = run("convert", "data.csv", "data.nc")
    assert result.stderr == (
        "pbrdf: data.csv: the column 'error' looks like an uncertainty and is not used; use it with --column "
        "I_std=error, or leave it out with --ignore error\n"
    )
    assert run("convert", "data.csv", "other.nc", "--ignore", "error").stderr == ""


def test_warnings_after_a_selection_name_lines(run, tmp_path):
    rows = "".join(f"30,{angle},0,{0 if angle == 40 else 0.3}\n" for angle in range(0, 80, 10))
    (tmp_path / "data.csv").write_text(f"{STATED}theta_i,theta_r,phi,I\n{rows}", encoding="utf-8")
    assert "line 9: I = 0 is not positive" in run("check", "data.csv", "--select", "theta_r=20:60").stdout


@pytest.mark.slow
def test_fit_lists_the_columns_and_uses_the_uncertainties(run, scan, tmp_path):
    scan(extra=",x")
    result = run("fit", "data.csv", "--starts", 4, "--no-figures", "--no-suggestions")
    words = " ".join(result.stdout.split())
    assert "I → I (1/sr), I_err → I_std" in words
    assert "not used: sample, note" in words
    assert "standard uncertainties of the data set" in words
    assert "I_err → I_std" in (tmp_path / "data-fit" / "index.html").read_text(encoding="utf-8")
    assert (
        run("fit", "data.csv", "--starts", 4, "--no-figures", "--no-suggestions", "-q").stdout == "data-fit\n"
    )


@pytest.mark.slow
def test_one_missing_uncertainty_leaves_one_value_out(run, scan, tmp_path):
    """The case I1."""
    path = scan()
    lines = path.read_text(encoding="utf-8").splitlines()
    lines[7] = lines[7].replace(",0.01,", ",nan,")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    assert "line 8: no uncertainty is stated, though others are" in run("check", "data.csv").stdout
    run("fit", "data.csv", "--starts", 4, "--no-figures", "--no-suggestions")
    record = json.loads((tmp_path / "data-fit" / "fit.json").read_text(encoding="utf-8"))
    summary = " ".join((tmp_path / "data-fit" / "summary.txt").read_text(encoding="utf-8").split())
    assert "standard uncertainties of the data set; values without one are left out: 1" in summary
    assert "16 geometries, 15 measured values" in summary
    assert record["uncertainties_from_data"] is True


MANY = tuple(range(400, 710, 10))


@pytest.mark.parametrize("command", ["fit", "compare"])
def test_many_wavelengths_are_asked_about_before_any_work(refused, scan, command):
    scan(wavelengths=MANY)
    words = refused(command, "data.csv")
    assert (
        "there are 31 wavelengths, 400 … 700 nm, and one set of parameters for all would be fitted" in words
    )
    assert "--wavelength 550 for one" in words
    assert ("--split a=wavelength" in words) == (command == "fit")
    assert "--select wavelength=400:700 if one set for these is meant" in words


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [
        ("--wavelength", 550),
        ("--select", "wavelength=400:700"),
        ("--split", "a=wavelength", "--select", "wavelength=400:420"),
    ],
)
def test_a_choice_among_many_wavelengths_is_followed(run, scan, options):
    scan(wavelengths=MANY)
    run("fit", "data.csv", "--starts", 2, "--no-figures", "--no-suggestions", "-q", *options)


@pytest.mark.slow
def test_a_few_wavelengths_are_fitted_with_a_note(run, scan):
    scan(wavelengths=(450, 550, 650))
    words = " ".join(run("fit", "data.csv", "--starts", 4, "--no-figures", "--no-suggestions").stdout.split())
    assert "One set of parameters was fitted to 3 wavelengths at once" in words


@pytest.mark.slow
def test_an_arbitrary_scale_without_a_gain_is_noted(run, scan):
    scan()
    options = ("--starts", 4, "--no-figures", "--no-suggestions", "--scale", "arbitrary")
    words = " ".join(run("fit", "data.csv", *options).stdout.split())
    assert "on an arbitrary scale and no gain was fitted" in words
    assert "add the nuisance gain (--nuisance gain)" in words
    words = " ".join(run("fit", "data.csv", *options, "--nuisance", "gain").stdout.split())
    assert "no gain was fitted" not in words
