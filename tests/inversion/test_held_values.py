"""Values that a fit holds at each wavelength: numbers, and the n and k of a material."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_allclose

import pbrdf
from pbrdf.errors import FitError
from pbrdf.inversion import held_values as module
from pbrdf.inversion.held_values import held_values
from pbrdf.inversion.problem import derivatives, predict
from pbrdf.models import find_model

PAINT = pbrdf.DoubleGauss(0.08, 1.55, 0.5, 1.1, 0.2, 0.5)
DISPERSION = {450.0: (1.60, 0.1), 550.0: (1.52, 0.3), 650.0: (1.45, 0.0)}
HELD = {"k": 1.1, "b": 0.2, "t": 0.5}
NUMBERS = {name: {w: pair[i] for w, pair in DISPERSION.items()} for i, name in enumerate(("n", "kappa"))}
#: Pages that stand for those of the database: n and k, or n alone, of each wavelength.
PAGES = {
    "main/ink/both": DISPERSION,
    "main/ink/clear": {w: (n, 0.0) for w, (n, _) in DISPERSION.items()},
    "main/ink/faint": {w: (n, 0.01) for w, (n, _) in DISPERSION.items()},
    "main/ink/n": {w: (n, None) for w, (n, _) in DISPERSION.items()},
}


@pytest.fixture(autouse=True)
def _pages(monkeypatch):
    def stated(page, wavelength):
        n, k = zip(*(PAGES[page][w] for w in wavelength), strict=True)
        columns = {"n": ("wavelength", np.array(n))}
        if None not in k:
            columns["k"] = ("wavelength", np.array(k))
        return xr.Dataset(columns, attrs={"page": page, "title": "Ink: Writer 1900", "database": "test v1"})

    monkeypatch.setattr(module, "refractive_index", stated)


def measured(wavelengths=tuple(DISPERSION), known=True):
    """Without noise, a paint whose n and k change with the wavelength, its amplitude with it."""
    theta_i, theta_r = (
        a.ravel() for a in np.meshgrid(np.deg2rad([20, 45, 60]), np.deg2rad(range(5, 75, 10)))
    )
    phi = np.full(theta_i.size, 0.3)
    stokes = [
        PAINT.replace(n=DISPERSION[w][0], kappa=DISPERSION[w][1], a=0.001 * w).stokes(theta_i, theta_r, phi)
        for w in wavelengths
    ]
    columns = np.concatenate([np.asarray(s) for s in stokes])
    count = len(wavelengths)
    return pbrdf.make_dataset(
        *(np.tile(angle, count) for angle in (theta_i, theta_r, phi)),
        quantity="brdf",
        **{c: columns[:, i] for i, c in enumerate("IQU")},
        std=dict.fromkeys("IQU", 1e-3 * columns[:, 0]),
        **({"wavelength": np.repeat(wavelengths, theta_i.size)} if known else {}),
    )


@pytest.fixture(scope="module")
def result():
    return pbrdf.fit(measured(), fix={**HELD, **NUMBERS}, split={"a": "wavelength"}, starts=8)


def test_the_fit_finds_what_was_put_in(result):
    """Three wavelengths share σ; with any one n for all of them no σ describes the data."""
    assert result.goodness.chi2 < 1e-6
    assert_allclose(result.estimates["sigma"].value, 0.08, rtol=1e-6)
    for w in DISPERSION:
        assert_allclose(result.estimates[f"a[{w:g}]"].value, 0.001 * w, rtol=1e-6)
    held = result.estimates["n"]
    assert (held.value, held.lower, held.upper, held.verdict) == (1.60, 1.45, 1.60, "fixed")


def test_the_model_of_each_wavelength(result):
    values = [result.estimates[name].value for name in result.space.names]
    assert result.space.wavelengths == list(DISPERSION)
    for w, (n, kappa) in DISPERSION.items():
        model = result.space.build(values, w)
        assert (model.values["n"], model.values["kappa"]) == (n, kappa)
    assert result.model.values["n"] == DISPERSION[450.0][0]


def test_predictions_are_those_of_the_model_of_each_wavelength(result):
    data = result.data
    found = predict(result.space, result.unknowns, data, "IQU")
    values = [result.estimates[name].value for name in result.space.names]
    for w in DISPERSION:
        at = data.wavelength == w
        stokes = result.space.build(values, w).stokes(data.theta_i[at], data.theta_r[at], data.phi[at])
        for i, c in enumerate("IQU"):
            assert_allclose(found[c][at], np.asarray(stokes)[:, i], rtol=1e-9, atol=1e-12)


def test_derivatives_are_those_of_the_predictions(result):
    values, jacobian = derivatives(result.space, result.unknowns[None], result.data, "IQU")
    for p in range(len(result.unknowns)):
        step = np.zeros(len(result.unknowns))
        step[p] = 1e-5
        ends = [predict(result.space, result.unknowns + sign * step, result.data, "IQU") for sign in (1, -1)]
        slope = np.stack([(ends[0][c] - ends[1][c]) / 2e-5 for c in "IQU"], axis=-1)
        assert_allclose(jacobian[0, :, :, p], slope, rtol=1e-5, atol=1e-6 * np.abs(values).max())


@pytest.mark.slow
def test_without_split_parameters():
    """No blocks: the other way through the solver, where every wavelength has the same unknowns."""
    data = measured()
    data["I"], data["Q"], data["U"] = (data[c] / (0.001 * data["wavelength"]) for c in "IQU")
    free = pbrdf.fit(data, fix={**HELD, "n": NUMBERS["n"]}, free=["kappa"], starts=8)
    same = pbrdf.fit(data, fix={**HELD, "n": 1.55}, free=["kappa"], starts=8)
    assert free.space.blocks is None
    assert free.goodness.chi2 < same.goodness.chi2


def test_one_geometry_at_several_wavelengths_is_several():
    """I and Q of one direction tell three unknowns where n is another at each wavelength, and not where it is one."""
    data = measured().isel(geometry=slice(4, None, 21)).drop_vars(["U", "U_std"])
    assert len(set(zip(data["theta_i"].values, data["theta_r"].values, strict=True))) == 1
    held = {"b": 0.2, "a": {w: 0.001 * w for w in DISPERSION}}
    found = pbrdf.fit(data, fix={**held, **NUMBERS}, start={"sigma": 0.1, "k": 1.0, "t": 0.4}, starts=4)
    assert found.space.names == ["sigma", "k", "t"]
    assert found.goodness.chi2 < 1e-6
    same = {"b": 0.2, "a": 0.5, "n": 1.5}
    with pytest.raises(FitError, match="6 values at 1 geometry cannot determine 3 parameters"):
        pbrdf.fit(data, fix=same, starts=1)


@pytest.mark.slow
def test_a_wavelength_that_is_held_out_is_predicted_with_its_own_values():
    amplitudes = {w: 0.001 * w for w in DISPERSION}
    fix = {**HELD, **NUMBERS, "a": amplitudes}
    found = pbrdf.fit(measured(), fix=fix, hold_out="wavelength=550", starts=4)
    assert_allclose(found.estimates["sigma"].value, 0.08, rtol=1e-6)
    assert found.predicted["all"].intensity_median < 1e-6


@pytest.mark.slow
def test_it_is_stored_and_brought_back(result, tmp_path):
    result.save(tmp_path / "fit")
    back = pbrdf.load_fit(tmp_path / "fit")
    assert back.space.by_wavelength == result.space.by_wavelength
    assert back.models == result.models
    assert [m.values["n"] for m in back.models.values()] == [n for n, _ in DISPERSION.values()]
    for nm, model in back.models.items():
        assert model.values["a"] == back.estimates[f"a[{nm:g}]"].value
    assert back.model == back.models[450.0]
    assert f"{back.model!r} at 450 nm, the first of 3, χ²" in repr(back)
    record = json.loads((tmp_path / "fit" / "fit.json").read_text(encoding="utf-8"))
    assert record["held_by_wavelength"]["n"] == {"450": 1.60, "550": 1.52, "650": 1.45}
    assert "fixed at each wavelength" in (tmp_path / "fit" / "summary.txt").read_text(encoding="utf-8")


def test_a_material_of_several_wavelengths():
    found = pbrdf.fit(measured(), fix={**HELD, "n": "main/ink/both"}, split={"a": "wavelength"}, starts=8)
    assert found.goodness.chi2 < 1e-6
    assert found.space.by_wavelength["kappa"] == {w: k for w, (_, k) in DISPERSION.items()}
    assert found.notes[0] == (
        "n is held at 1.45 … 1.6, that of main/ink/both at 450 … 650 nm; its k is 0 … 0.3, at which kappa is held "
        "(Ink: Writer 1900; test v1)."
    )


@pytest.mark.parametrize(
    ("page", "claimed", "fixed", "said"),
    [
        ("both", (), {"n": 1.52, "kappa": 0.3}, "its k is 0.3, at which kappa is held"),
        ("clear", (), {"n": 1.52, "kappa": 0.0}, "its k is 0, at which kappa is held"),
        ("n", (), {"n": 1.52}, "the page states no k"),
        ("both", ("kappa",), {"n": 1.52}, "its k is 0.3, but kappa is as asked for"),
    ],
)
def test_the_extinction_of_a_material(page, claimed, fixed, said):
    found = held_values(pbrdf.DoubleGauss, {"n": f"main/ink/{page}"}, np.array([550.0, 550.0]), claimed)
    assert (found.fixed, found.by_wavelength) == (fixed, {})
    assert said in found.sources["n"]


def test_an_extinction_of_your_own_goes_before():
    fix = {"n": "main/ink/both", "kappa": 0.7}
    assert held_values(pbrdf.DoubleGauss, fix, np.array([550.0]), ()).fixed == {"n": 1.52, "kappa": 0.7}


def test_a_model_without_extinction_takes_what_hardly_absorbs():
    land = find_model("maignan-2009")
    found = held_values(land, {"n": "main/ink/faint"}, np.array([550.0]), ())
    assert found.fixed == {"n": 1.52}
    assert "its k is 0.01, which is left out" in found.sources["n"]
    with pytest.raises(
        FitError, match=r"main/ink/both absorbs, k is 0\.3 at 550 nm, and maignan-2009 has no extinct"
    ):
        held_values(land, {"n": "main/ink/both"}, np.array([550.0]), ())


def test_flakes_have_an_index_and_an_extinction_of_their_own():
    found = held_values(find_model("metallic-lacquer"), {"flake_n": "main/ink/both"}, np.array([550.0]), ())
    assert found.fixed == {"flake_n": 1.52, "flake_kappa": 0.3}


@pytest.mark.parametrize(
    ("fix", "wavelength", "said"),
    [
        (
            {"sigma": "main/ink/n"},
            [550.0],
            "sigma is no refractive index of double-gauss, which has n: give a number",
        ),
        ({"n": "main/ink/n"}, None, "held at main/ink/n, but the data do not state the wavelength: state it"),
        ({"n": "main/ink/n"}, [550.0, np.nan], "the data do not state the wavelength of 1 geometries"),
        ({"n": np.array([1.5, 1.6])}, [450.0, 550.0], "n is held at a number, numbers by wavelength as"),
        ({"n": {450: 1.5, "green": 1.6}}, [450.0], "n is held at a number, numbers by wavelength as"),
        ({"n": {450: None}}, [450.0], "n is held at a number, numbers by wavelength as"),
        ({"n": xr.Dataset({"n": 1.5})}, [450.0], "n is held at a number, numbers by wavelength as"),
        ({"n": {450: 1.5}}, None, "held at 1 values, but the data do not state the wavelength"),
        (
            {"n": {450: 1.5, 650: 1.4}},
            [450.0, 550.0],
            "n has values at 450, 650 nm, and none at 550 nm, which was",
        ),
    ],
)
def test_what_is_refused(fix, wavelength, said):
    with pytest.raises(FitError, match=said):
        held_values(pbrdf.DoubleGauss, fix, None if wavelength is None else np.array(wavelength), ())


def test_wavelengths_are_met_as_everywhere():
    """Within half a nanometre."""
    found = held_values(pbrdf.DoubleGauss, {"n": {450: 1.5, 550: 1.4}}, np.array([449.8, 550.3]), ())
    assert found.by_wavelength == {"n": {449.8: 1.5, 550.3: 1.4}}


def test_values_outside_of_the_domain_are_refused_at_every_wavelength():
    with pytest.raises(pbrdf.ModelError, match="must be at least 1"):
        pbrdf.fit(measured(), fix={"n": {450: 1.5, 550: 1.5, 650: 0.5}}, starts=1)


def test_a_fit_of_it_is_no_material_of_a_library(result):
    with pytest.raises(FitError, match="parameters of their own for groups or wavelengths"):
        pbrdf.material_from_fits("ink", [result])


@pytest.mark.slow
@pytest.mark.parametrize("wavelengths", [(550.0,), tuple(DISPERSION)])
def test_a_map(wavelengths):
    image = measured(wavelengths)
    for c in ("I", "Q", "U", "I_std", "Q_std", "U_std"):
        image[c] = image[c].expand_dims(x=2, axis=1)
    fix = {**HELD, "n": "main/ink/both", "a": {w: 0.001 * w for w in wavelengths}}
    found = pbrdf.fit_map(image, fix=fix, starts=4)
    assert_allclose(found["estimate"].sel(parameter="sigma"), 0.08, rtol=1e-5)
    described = json.loads(found.attrs["model"])
    assert "main/ink/both at" in described["sources"]["n"]
    if len(wavelengths) == 1:
        assert described["fixed"]["n"] == 1.52
        assert "by_wavelength" not in described
    else:
        assert described["by_wavelength"]["n"] == [[w, n] for w, (n, _) in DISPERSION.items()]
        assert json.loads(found.attrs["settings"])["by_wavelength"] == described["by_wavelength"]
