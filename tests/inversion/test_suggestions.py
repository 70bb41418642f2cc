"""What to try next: only what helps, with numbers, in time; and conventions that the data contradict."""

from __future__ import annotations

import math
import time
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

import pbrdf
from pbrdf.inversion.conventions_check import contradicted_conventions, misfit, readings
from pbrdf.inversion.suggestions import suggestions
from pbrdf.inversion.trials import GEOMETRIES, Clock, some_of, trial_hold_out
from pbrdf.inversion.verdict import Level
from pbrdf.report.fit.checks import run_checks

PAINT = pbrdf.DoubleGauss(sigma=0.1, n=1.55, a=0.3, k=1.1, b=0.2, t=0.3)


def measured(paint=PAINT, change=None, polarised=True, **columns):
    """In and out of the plane of incidence at three angles, 2 % noise without a statement of it."""
    theta_i, theta_r, phi = (
        np.deg2rad(a.ravel())
        for a in np.meshgrid([20.0, 40.0, 60.0], np.arange(0.0, 75.0, 10.0), [0.0, 40.0, 180.0])
    )
    values = paint.stokes(theta_i, theta_r, phi)
    noise = 1.0 + 0.02 * np.random.default_rng(0).standard_normal((len(values), 3))
    stokes = dict(zip("IQU" if polarised else "I", (values[:, :3] * noise).T, strict=False))
    dataset = pbrdf.make_dataset(theta_i, theta_r, phi, quantity="brdf", **stokes, **columns)
    return dataset if change is None else change(dataset)


def advice(dataset, **arguments):
    result = pbrdf.fit(dataset, starts=4, **arguments)
    return result, suggestions(dataset, result, arguments, until=math.inf)


@pytest.mark.slow
def test_outliers_lead_to_a_robust_loss():
    dataset = measured(polarised=False)
    bad = np.random.default_rng(2).choice(dataset.sizes["geometry"], 14, replace=False)
    dataset["I"].values[bad] *= 8.0
    result, found = advice(dataset)
    assert result.verdict().level != Level.DESCRIBES
    robust = next(s for s in found if s.option == "--loss cauchy")
    assert robust.after < 0.8 * robust.before and math.isnan(robust.chi2_after)
    assert robust.sentence.startswith("--loss cauchy: held-out median error of the intensity ")
    # it is already robust: not suggested again
    assert "--loss cauchy" not in [s.option for s in advice(dataset, loss="cauchy")[1]]


@pytest.mark.slow
def test_a_wide_source_is_found():
    wide = pbrdf.DoubleGauss(sigma=0.02, n=1.55, a=0.3, k=1.1, b=0.2, t=0.3)
    theta_i = np.deg2rad(np.repeat([20.0, 40.0, 60.0], 61))
    theta_r = theta_i + np.deg2rad(np.tile(np.linspace(-15.0, 15.0, 61), 3))
    rng = np.random.default_rng(0)
    lobe = 0.0
    # a source of 4° radius, smeared in the plane of incidence by hand
    for shift in np.deg2rad(4.0) * np.sin(np.linspace(-1.5, 1.5, 41)):
        lobe = lobe + wide.stokes(theta_i, np.abs(theta_r + shift), 0.0)[:, :2] / 41.0
    lobe *= 1.0 + 0.01 * rng.standard_normal(lobe.shape)
    dataset = pbrdf.make_dataset(theta_i, theta_r, 0.0, quantity="brdf", I=lobe[:, 0], Q=lobe[:, 1])
    arguments = {"bounds": {"sigma": (0.019, 0.021)}}
    _, found = advice(dataset, **arguments)
    source = next(s for s in found if s.option == "--nuisance source")
    assert source.chi2_after < source.chi2_before and "χ²" in source.sentence


@pytest.mark.slow
def test_colours_lead_to_an_amplitude_of_their_own():
    red = measured(PAINT.replace(a=0.1), polarised=False, wavelength=650.0)
    blue = measured(PAINT.replace(a=0.9), polarised=False, wavelength=450.0)
    both = xr.concat([red, blue], "geometry").assign_attrs(red.attrs)
    result, found = advice(both)
    amplitude = next(p.name for p in result.model.parameters if p.amplitude)
    assert found[0].option == f"--split {amplitude}=wavelength"
    assert found[0].after < 0.05 < found[0].before


@pytest.mark.slow
def test_nothing_is_suggested_that_does_not_help():
    """Data without any rhyme: no loss, source or model describes them."""
    rng = np.random.default_rng(1)
    theta_i, theta_r = np.deg2rad(rng.uniform(5.0, 70.0, (2, 120)))
    noise = pbrdf.make_dataset(theta_i, theta_r, 0.0, quantity="brdf", I=np.exp(rng.normal(-2.0, 2.0, 120)))
    assert advice(noise)[1] == []


def exchanged(ds, a, b):
    return ds.assign(
        {a: ds[b].drop_vars([a, b], errors="ignore"), b: ds[a].drop_vars([a, b], errors="ignore")}
    )


#: What was done to the data, and the beginning of what is to be said of it.
WRONG = {
    "azimuth": (lambda ds: ds.assign_coords(phi=ds["phi"] + math.pi), "--azimuth forward=180"),
    "stokes": (lambda ds: ds.assign(Q=-ds["Q"], U=-ds["U"]), "--stokes s-p"),
    "Q and U": (lambda ds: exchanged(ds, "Q", "U"), "Q and U exchanged in the file"),
    "normalised": (
        lambda ds: ds.assign(Q=ds["Q"] / ds["I"], U=ds["U"] / ds["I"]),
        "Q and U as Q_over_I",
    ),
    "cosine of the viewer": (
        lambda ds: ds.assign({c: ds[c] * np.cos(ds["theta_r"]) for c in "IQU"}),
        "--cosine-weighted",
    ),
    "cosine of the source": (
        lambda ds: ds.assign({c: ds[c] * np.cos(ds["theta_i"]) for c in "IQU"}),
        "--quantity radiance",
    ),
    "per cent": (lambda ds: ds.assign({c: ds[c] * 100.0 for c in "IQU"}), "values divided by 100"),
    "factor π": (lambda ds: ds.assign({c: ds[c] * math.pi for c in "IQU"}), "--quantity reflectance_factor"),
    "angles of source and viewer": (
        lambda ds: ds.assign_coords(
            theta_i=("geometry", ds["theta_r"].values), theta_r=("geometry", ds["theta_i"].values)
        ),
        "both exchanged in the file",
    ),
    "elevation of the viewer": (
        lambda ds: ds.isel(geometry=ds["theta_r"].values > 0.0).pipe(
            lambda seen: seen.assign_coords(theta_r=0.5 * math.pi - seen["theta_r"])
        ),
        "theta_r as 90° minus the elevation",
    ),
    "radians": (
        lambda ds: ds.assign_coords({a: np.deg2rad(ds[a]) for a in ("theta_i", "theta_r", "phi")}),
        "--angles radians",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("stated", [True, False], ids=["with uncertainties", "without"])
@pytest.mark.parametrize("name", WRONG)
def test_a_contradicted_convention_is_named(name, stated):
    if name == "angles of source and viewer" and not stated:
        pytest.skip("the paint is so nearly reciprocal that the assumed noise of 5 % hides the exchange")
    change, option = WRONG[name]
    dataset = measured(change=change)
    if stated:
        dataset = dataset.assign(
            {f"{c}_std": 0.02 * abs(dataset[c]) + 0.002 * dataset["I"].median() for c in "IQU"}
        )
    # Fresnel's reflectance must be that of the coating, or n makes up for a cosine
    arguments = {"fix": {"n": 1.55, "k": 1.1, "b": 0.2}}
    result = pbrdf.fit(dataset, starts=4, **arguments)
    assert misfit(result, result.plausibility(dataset))
    found = contradicted_conventions(dataset, result, arguments, until=math.inf)
    assert found[0].option.startswith(option)
    assert found[0].chi2_after < 0.5 * found[0].chi2_before
    assert f"χ² {found[0].chi2_after:.4g} instead of {found[0].chi2_before:.4g}" in found[0].sentence


@pytest.mark.slow
def test_conventions_that_hold_are_not_contradicted():
    dataset = measured()
    result = pbrdf.fit(dataset, starts=4, fix={"t": 0.0})
    assert contradicted_conventions(dataset, result, {"fix": {"t": 0.0}}, until=math.inf) == []


@pytest.mark.slow
def test_a_degree_in_per_cent_is_found():
    """Off the lobe a degree of 0.6 % may stand in a file as 0.6."""
    dataset = measured()
    degree = (np.hypot(dataset["Q"], dataset["U"]) / dataset["I"]).values
    weak = np.flatnonzero(degree < 0.01)
    assert len(weak) > 20
    per_cent = dataset.drop_vars(["Q", "U"]).assign(dolp=("geometry", 100.0 * degree))
    per_cent = per_cent.isel(geometry=weak)
    result = pbrdf.fit(per_cent, starts=4)
    assert result.verdict().level != Level.DESCRIBES
    found = contradicted_conventions(per_cent, result, {}, until=math.inf)
    assert found[0].option == "DoLP divided by 100 in the file"


@pytest.mark.slow
def test_reflectance_factors_in_per_cent_are_found():
    dataset = measured()
    per_cent = dataset.assign({c: 100.0 * math.pi * dataset[c] for c in "IQU"})
    per_cent = per_cent.assign_attrs(quantity="reflectance_factor")
    result = pbrdf.fit(per_cent, starts=4)
    found = contradicted_conventions(per_cent, result, {}, until=math.inf)
    assert found[0].option == "values divided by 100 in the file"


def test_assumed_conventions_are_tried_first():
    stated = [option for option, *_ in readings(measured())]
    assumed = measured().assign_attrs(
        assumptions=["the file does not say what Q > 0 means; I_p - I_s was assumed"]
    )
    assert next(option for option, *_ in readings(assumed)) == "--stokes s-p"
    assert stated[0].endswith("(or forward=0 if that was stated)")


def test_every_reading_undoes_itself_or_its_opposite():
    dataset = measured(std={"I": 0.01})
    change = {option.split(" (")[0]: how for option, _, how in readings(dataset)}
    for there, back in (
        ("--azimuth forward=180", "--azimuth forward=180"),
        ("--stokes s-p", "--stokes s-p"),
        ("--cosine-weighted", "--not-cosine-weighted"),
    ):
        again = change[back](change[there](dataset))
        np.testing.assert_allclose(np.cos(again["phi"]), np.cos(dataset["phi"]), atol=1e-12)
        for name in ("I", "Q", "U", "I_std"):
            np.testing.assert_allclose(again[name], dataset[name], rtol=1e-12)
        once = change[there](dataset)
        assert any(not np.allclose(once[n], dataset[n]) for n in ("phi", "Q", "I"))


def shares(dataset):
    """The same data as ratios, and the full matrices of the paint over m00."""
    ratios = {f"{c}_over_I": (dataset[c] / dataset["I"]).values for c in "QU"}
    angles = [dataset[name].values for name in ("theta_i", "theta_r", "phi")]
    M = np.asarray(PAINT.mueller(*angles))
    return pbrdf.make_dataset(*angles, **ratios), pbrdf.make_dataset(
        *angles, mueller_over_m00=M / M[:, :1, :1]
    )


def test_ratios_have_readings_of_sign_and_per_cent_and_none_of_scale():
    for dataset in shares(measured()):
        change = {option.split(" (")[0]: how for option, _, how in readings(dataset)}
        assert not [option for option in change if "cosine" in option or option.startswith("values")]
        name = next(iter(dataset.data_vars))
        swapped = change["--stokes s-p"](dataset)
        xr.testing.assert_equal(change["--stokes s-p"](swapped), dataset)
        q, again = (
            ds[name].values if ds[name].ndim == 1 else ds[name].values[:, 1, 0] for ds in (dataset, swapped)
        )
        np.testing.assert_array_equal(again, -q)
        pbrdf.validate(change["the ratios divided by 100 in the file"](dataset))


@pytest.mark.slow
def test_a_wrong_sign_of_shares_is_named():
    dataset = shares(measured())[0]
    wrong = dataset.assign(Q_over_I=-dataset["Q_over_I"], U_over_I=-dataset["U_over_I"])
    arguments = {"fix": {"k": 1.1, "b": 0.2}}
    result = pbrdf.fit(wrong, starts=4, **arguments)
    assert result.verdict().level != Level.DESCRIBES
    assert contradicted_conventions(wrong, result, arguments, until=math.inf)[0].option.startswith(
        "--stokes s-p"
    )


def made_up(errors, level=Level.IN_PART, chi2=None):
    """Trials whose error is looked up by what was asked for, instead of fits."""

    def trial(dataset, clock, **arguments):
        model = arguments["model"]
        key = (model.name if isinstance(model, type) else "same", arguments.get("loss", "linear"))
        error = errors.get(key, 0.4)
        stratum = SimpleNamespace(where="", quantity="intensity", held_out=True, error=error)
        return SimpleNamespace(
            verdict=lambda: SimpleNamespace(strata=[stratum], level=level),
            space=SimpleNamespace(loss=arguments.get("loss", "linear")),
            goodness=SimpleNamespace(chi2=100.0 if chi2 is None else chi2.get(key, 100.0)),
        )

    return trial


def test_the_best_model_and_the_best_loss_are_tried_together(monkeypatch):
    dataset = measured(polarised=False)
    result = pbrdf.fit(dataset, starts=1)
    other = "reciprocal-double-gauss"
    errors = {(other, "linear"): 0.2, ("same", "cauchy"): 0.25, (other, "cauchy"): 0.1}

    def options(**given):
        monkeypatch.setattr("pbrdf.inversion.suggestions.trial", made_up(**given))
        return [s.option for s in suggestions(dataset, result, {}, until=math.inf)]

    assert options(errors=errors) == [f"--model {other} --loss cauchy", f"--model {other}", "--loss cauchy"]
    # together they must be better than the better one alone
    assert options(errors=errors | {(other, "cauchy"): 0.19}) == [f"--model {other}", "--loss cauchy"]
    # a fifth at least, no higher χ² of the same kind, and something that describes the data
    assert options(errors={("same", "cauchy"): 0.33}) == []
    assert options(errors=errors, chi2={(other, "linear"): 120.0}) == ["--loss cauchy"]
    assert options(errors=errors, level=Level.DOES_NOT) == []
    monkeypatch.setattr("pbrdf.inversion.suggestions.MOST", 2)
    assert len(options(errors=errors)) == 2


@pytest.mark.slow
def test_trials_are_bounded_in_size_and_time():
    dataset = measured(polarised=False)
    many = dataset.isel(geometry=np.arange(6 * dataset.sizes["geometry"]) % dataset.sizes["geometry"])
    used = some_of(many)
    assert len(used) == GEOMETRIES and (np.diff(used) > 0).all()
    assert len(some_of(dataset)) == dataset.sizes["geometry"]
    clock = Clock(time.monotonic() + 10.0)
    assert clock.allows()
    clock.measured(time.monotonic() - 11.0)
    assert not clock.allows()
    result = pbrdf.fit(dataset, starts=2)
    assert str(trial_hold_out(result, dataset)) == "theta_i=40"
    held = pbrdf.fit(dataset, starts=2, hold_out="theta_i=60")
    assert trial_hold_out(held, dataset) is held.hold_out
    assert suggestions(dataset, result, {}, until=time.monotonic() - 1.0) == []


@pytest.mark.slow
def test_checks_ask_for_advice_only_where_the_fit_is_not_good():
    good = measured()
    result = pbrdf.fit(good, starts=4)
    assert result.verdict().level == Level.DESCRIBES
    checks = run_checks(result, good, suggest=True)
    assert checks.advice() == []
    turned = measured(change=lambda ds: ds.assign_coords(phi=ds["phi"] + math.pi))
    result = pbrdf.fit(turned, starts=4)
    assert run_checks(result, turned).advice() == []
    checks = run_checks(result, turned, suggest=True)
    assert checks.advice()[0].startswith(
        "The data contradict the way they were read: with forward at the other"
    )
    assert checks.record(result)["conventions"][0]["option"].startswith("--azimuth forward=180")


def test_options_name_the_columns_of_the_file(tmp_path):
    """What is advised works when it is typed: columns by their names, in quotation marks where a shell needs them."""
    path = tmp_path / "paint.csv"
    path.write_text("# quantity: brdf\ntheta_i,theta_r,I,Q,my U\n30,-20,0.4,0.01,0\n30,40,0.5,0.02,0.001\n")
    dataset = pbrdf.read(path, column={"U": "my U"})
    options = {option.split(" (")[0]: change for option, _, change in readings(dataset)}
    exchanged = pbrdf.read(path, column={"Q": "my U", "U": "Q"})
    np.testing.assert_array_equal(
        options["--column 'Q=my U' --column U=Q"](dataset)["Q"].values, exchanged["Q"].values
    )
    assert "--column Q_over_I=Q --column 'U_over_I=my U'" in options
    assert "--column theta_i=theta_r --column theta_r=theta_i" in options
    # signed angles without an azimuth: the option counts there too
    turned = pbrdf.read(path, column={"U": "my U"}, azimuth="forward=180")
    found = options["--azimuth forward=180"](dataset)
    np.testing.assert_allclose(np.cos(found["phi"]), np.cos(turned["phi"]), atol=1e-12)
    assert not [option for option in options if "…" in option]


def test_ratios_in_per_cent_name_the_option_of_their_unit(tmp_path):
    path = tmp_path / "shares.csv"
    path.write_text("theta_i,theta_r,phi,Q_over_I,U_over_I\n30,20,0,0.10,0.01\n30,40,0,0.20,0.02\n")
    dataset = pbrdf.read(path)
    change = {option: how for option, _, how in readings(dataset)}["--unit Q_over_I=% --unit U_over_I=%"]
    stated = pbrdf.read(path, unit={"Q_over_I": "%", "U_over_I": "%"})
    np.testing.assert_allclose(change(dataset)["Q_over_I"], stated["Q_over_I"])
