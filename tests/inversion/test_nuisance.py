"""Nuisance terms, priors, split parameters: simulated effects of an instrument are found again."""

from __future__ import annotations

import math

import numpy as np
import pytest

import pbrdf
from pbrdf.errors import FitError
from pbrdf.inversion.nuisance import Nuisance
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.plausibility import plausibility
from pbrdf.inversion.problem import Space, Term, predict

MODEL = pbrdf.DoubleGauss(0.05, 1.6, 0.6, 1.2, 0.2, 0.6)
FREE = ("sigma", "n", "a", "k", "b", "t")


def protocol(positions=(60.0, 80.0, 100.0), count=25):
    """In-plane angles in degrees (θ_i, signed θ_r) and camera position, bistatic angle fixed for each."""
    theta_i, theta_r, group = [], [], []
    for number, bistatic in enumerate(positions, start=1):
        reach = min(45.0, 84.0 - bistatic / 2.0)
        offset = reach * np.sign(np.linspace(-1, 1, count)) * np.linspace(-1, 1, count) ** 2
        theta_i.append(bistatic / 2.0 - offset)
        theta_r.append(bistatic / 2.0 + offset)
        group.append(np.full(count, number))
    return np.concatenate(theta_i), np.concatenate(theta_r), np.concatenate(group)


def as_angles(theta_i_deg, signed_theta_r_deg):
    flip = (signed_theta_r_deg < 0.0) ^ (theta_i_deg < 0.0)
    return np.deg2rad(np.abs(theta_i_deg)), np.deg2rad(np.abs(signed_theta_r_deg)), np.where(flip, np.pi, 0.0)


def dataset(stokes, theta_i, theta_r, group, quantity="brdf", noise=0.01, seed=5, **more):
    angles = as_angles(theta_i, theta_r)
    std = noise * np.abs(stokes[:, 0])
    rng = np.random.default_rng(seed)
    columns = {c: stokes[:, i] + std * rng.standard_normal(len(std)) for i, c in enumerate("IQU")}
    return pbrdf.make_dataset(
        *angles, quantity=quantity, **columns, std=dict.fromkeys("IQU", std), group=group, **more
    )


def pull(estimate, truth):
    return abs(estimate.value - truth) / estimate.std


@pytest.mark.slow
def test_gain_of_a_camera_is_told_from_the_amplitude():
    """DN = gain · f · cosθ_i: the specular peak fixes the gain, and a becomes the coating's own."""
    theta_i, theta_r, group = protocol()
    angles = as_angles(theta_i, theta_r)
    dn = 180.0 * MODEL.stokes(*angles) * np.cos(angles[0])[:, None]
    result = pbrdf.fit(dataset(dn, theta_i, theta_r, group, "dn"), nuisances=["gain"], starts=32)
    assert result.estimates["gain"].value == pytest.approx(180.0, rel=0.05)
    for name, truth in (("gain", 180.0), *((n, MODEL.values[n]) for n in FREE)):
        assert pull(result.estimates[name], truth) < 4.0, name
    assert 0.6 < result.goodness.reduced_chi2 < 1.4


@pytest.mark.slow
def test_gains_of_camera_positions_and_the_prediction_of_an_unseen_one():
    theta_i, theta_r, group = protocol()
    gains = {1: 1.0, 2: 1.1, 3: 1.05}
    stokes = MODEL.stokes(*as_angles(theta_i, theta_r)) * np.array([gains[g] for g in group])[:, None]
    ds = dataset(stokes, theta_i, theta_r, group)
    result = pbrdf.fit(ds, nuisances=[Nuisance("gain", per_group=True)], starts=32)
    for label, truth in gains.items():
        assert pull(result.estimates[f"gain[{label}]"], truth) < 4.0
    assert result.estimates["gain[2]"].value / result.estimates["gain[1]"].value == pytest.approx(
        1.1, rel=0.01
    )
    # position 3 has no gain of its own when it is held out: the mean of the others, √1.1, serves
    held = pbrdf.fit(ds, nuisances=["gain:group"], hold_out="group=3", starts=32)
    assert set(held.estimates) == {*FREE, "kappa", "gain[1]", "gain[2]"}
    table = held.comparison.isel(geometry=held.comparison["group"].values == 3)
    ratio = float(np.median(table["I_modelled"] / table["I_measured"]))
    assert ratio == pytest.approx(math.sqrt(1.1) / 1.05, rel=0.02)


def test_dark_offset_is_constant_on_the_datas_own_scale():
    theta_i, theta_r, group = protocol()
    angles = as_angles(theta_i, theta_r)
    radiance = MODEL.stokes(*angles) * np.cos(angles[0])[:, None]
    radiance[:, 0] += 0.03
    result = pbrdf.fit(
        dataset(radiance, theta_i, theta_r, group, "radiance", noise=0.003), nuisances=["dark"], starts=16
    )
    assert pull(result.estimates["dark"], 0.03) < 4.0 and result.estimates["dark"].std < 0.005
    assert pull(result.estimates["k"], 1.2) < 4.0


@pytest.mark.slow
def test_angle_offsets_of_camera_positions():
    """The sample turned by δ raises θ_i by δ and lowers signed θ_r by δ."""
    theta_i, theta_r, group = protocol()
    offsets = {1: 0.3, 2: -0.2, 3: 0.1}  # degrees
    delta = np.array([offsets[g] for g in group])
    stokes = MODEL.stokes(*as_angles(theta_i + delta, theta_r - delta))
    result = pbrdf.fit(dataset(stokes, theta_i, theta_r, group), nuisances=["angle:group~none"], starts=16)
    for label, truth in offsets.items():
        estimate = result.estimates[f"angle[{label}]"]
        assert pull(estimate, math.radians(truth)) < 4.0
        assert estimate.std < math.radians(0.05)
    blind = pbrdf.fit(dataset(stokes, theta_i, theta_r, group), starts=16)
    assert blind.goodness.chi2 > 3.0 * result.goodness.chi2


def test_an_extended_source_is_the_average_over_its_disc():
    """The convolution against a brute-force average of exact geometries over a uniform disc."""
    radius = math.radians(4.0)
    rng = np.random.default_rng(0)
    r, turn = radius * np.sqrt(rng.random(40_000)), 2.0 * np.pi * rng.random(40_000)
    specular_only = pbrdf.DoubleGauss(0.03, 1.6, 0.0, 1.0, 0.0, 0.0)
    for theta_i, theta_r in ((30.0, 30.0), (40.0, 36.0), (50.0, 56.0)):
        ti, tr = math.radians(theta_i), math.radians(theta_r)
        omega = np.array([-math.sin(ti), 0.0, math.cos(ti)])
        p, s = np.array([math.cos(ti), 0.0, math.sin(ti)]), np.array([0.0, -1.0, 0.0])
        rays = omega + (r * np.cos(turn))[:, None] * p + (r * np.sin(turn))[:, None] * s
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        azimuth_of_source = np.arctan2(rays[:, 1], rays[:, 0])
        each = specular_only.stokes(np.arccos(rays[:, 2]), tr, np.pi - azimuth_of_source)[:, 0]
        expected = (each * rays[:, 2]).mean() / rays[:, 2].mean()  # every ray by its share of the irradiance
        space = Space(
            pbrdf.DoubleGauss,
            {},
            (pbrdf.inversion.nuisance.KINDS["source"],),
            {n: float(v) for n, v in specular_only.values.items()},
            np.array([0.0]),
            np.array([1.0]),
            (Term("source", nuisance=True),),
        )
        data = Observations(
            *(np.array([v]) for v in (ti, tr, 0.0)),
            ("I",),
            np.zeros((1, 1)),
            np.ones((1, 1)),
            (1, 0, 0, 0),
            True,
        )
        found = predict(space, np.array([radius**2]), data, ["I"])["I"][0]
        point = specular_only.stokes(ti, tr, 0.0)[0]
        assert found == pytest.approx(expected, rel=0.01)
        assert abs(point / expected - 1.0) > 0.03, "the source must matter in this test"


@pytest.mark.slow
def test_radius_of_the_source_is_found_and_sigma_with_it():
    theta_i, theta_r, group = protocol()
    space = Space(
        pbrdf.DoubleGauss,
        {},
        (pbrdf.inversion.nuisance.KINDS["source"],),
        {n: float(v) for n, v in MODEL.values.items()},
        np.array([0.0]),
        np.array([1.0]),
        (Term("source", nuisance=True),),
    )
    empty = dataset(np.ones((len(theta_i), 4)), theta_i, theta_r, group)
    signal = predict(space, np.array([math.radians(4.0) ** 2]), Observations.from_dataset(empty), "IQUV")
    ds = dataset(np.column_stack([signal[c] for c in "IQUV"]), theta_i, theta_r, group, noise=0.002)
    result = pbrdf.fit(ds, nuisances=["source"], starts=16)
    assert pull(result.estimates["source"], math.radians(4.0)) < 4.0
    assert pull(result.estimates["sigma"], 0.05) < 4.0
    blind = pbrdf.fit(ds, starts=16)
    assert blind.estimates["sigma"].value > 0.051, "without the source the lobe looks wider"


@pytest.mark.slow
def test_one_amplitude_for_each_wavelength_and_the_rest_shared():
    theta_i, theta_r, group = protocol(count=15)
    amplitudes = {450.0: 0.3, 550.0: 0.6, 650.0: 0.9}
    parts = [
        dataset(
            MODEL.replace(a=a).stokes(*as_angles(theta_i, theta_r)),
            theta_i,
            theta_r,
            group,
            wavelength=w,
            seed=int(w),
        )
        for w, a in amplitudes.items()
    ]
    import xarray as xr

    result = pbrdf.fit(xr.concat(parts, "geometry"), split={"a": "wavelength"}, starts=16)
    for wavelength, truth in amplitudes.items():
        assert pull(result.estimates[f"a[{wavelength:g}]"], truth) < 4.0
    single = pbrdf.fit(parts[1], starts=16)
    assert result.estimates["n"].std < 0.75 * single.estimates["n"].std, "three wavelengths share n"
    assert result.model.values["a"] == pytest.approx(result.estimates["a[450]"].value)


def test_a_prior_and_the_data_combine_by_their_weights():
    """Two independent values of n, the data's and the prior's: the inverse variances add."""
    theta_i = np.full(8, 5.0)
    theta_r = np.array([-30.0, -25, -22, -18, 20, 25, 28, 30])
    angles = as_angles(theta_i, theta_r)
    stokes = MODEL.stokes(*angles)
    ds = pbrdf.make_dataset(*angles, quantity="brdf", I=stokes[:, 0], std={"I": 0.01 * stokes[:, 0]})
    fixed = {"sigma": 0.05, "b": 0.2, "t": 0.6}
    data = pbrdf.fit(ds, starts=16, fix=fixed).estimates["n"]
    both = pbrdf.fit(ds, starts=16, fix=fixed, priors={"n": (1.55, 0.03)}).estimates["n"]
    weights = np.array([data.std**-2, 0.03**-2])
    assert both.std == pytest.approx(weights.sum() ** -0.5, rel=0.1)
    assert both.value == pytest.approx(weights @ [data.value, 1.55] / weights.sum(), abs=0.3 * both.std)


@pytest.mark.slow
def test_outliers_move_a_robust_fit_less():
    theta_i, theta_r, group = protocol()
    ds = dataset(MODEL.stokes(*as_angles(theta_i, theta_r)), theta_i, theta_r, group)
    ds["I"][::9] *= 1.5
    plain = pbrdf.fit(ds, starts=16)
    robust = pbrdf.fit(ds, starts=16, loss="cauchy")
    error = {
        name: max(abs(r.estimates[n].value / MODEL.values[n] - 1.0) for n in ("sigma", "n", "a", "k"))
        for name, r in (("plain", plain), ("robust", robust))
    }
    assert error["robust"] < 0.02 < error["plain"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("gain", Nuisance("gain")),
        ("angle:group~0,0.5", Nuisance("angle", True, (0.0, math.radians(0.5)))),
        ("angle", Nuisance("angle", False, (0.0, math.radians(0.2)))),
        ("angle~none", Nuisance("angle")),
        ("dark~0.1,0.02", Nuisance("dark", False, (0.1, 0.02))),
    ],
)
def test_nuisances_are_read_from_text(text, expected):
    parsed = Nuisance.parse(text)
    assert (parsed.kind, parsed.per_group) == (expected.kind, expected.per_group)
    assert parsed.prior == pytest.approx(expected.prior) if expected.prior else parsed.prior is None


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"nuisances": ["gains"]}, "choose one of gain, dark, angle, source"),
        ({"nuisances": ["gain:wavelength"]}, "only 'group' is understood"),
        ({"nuisances": ["gain~1"]}, "a prior is MEAN,STD"),
        ({"nuisances": ["gain~1,0"]}, "a standard deviation above 0"),
        ({"nuisances": ["gain", "gain:group"]}, "gain is given twice"),
        ({"split": {"a": "wavelength"}}, "the fitted data have only one"),
        ({"split": {"a": "angle"}}, "for each 'group' or 'wavelength'"),
        ({"split": {"kappa": "group"}}, "'kappa' is not a free parameter"),
        ({"priors": {"q": (1.0, 1.0)}}, "'q' is not a free parameter"),
        ({"loss": "l7"}, "choose one of linear, soft_l1, huber, cauchy"),
        ({"strategy": "guess"}, "choose one of joint, stepwise"),
    ],
)
def test_what_is_not_understood_is_said(arguments, message):
    with pytest.raises(FitError, match=message):
        pbrdf.fit(pbrdf.open_experiment("cd-back"), **arguments)


def test_angle_offsets_need_data_in_plane():
    stokes = MODEL.stokes([0.3] * 8, [0.2] * 8, np.linspace(0.2, 2.0, 8))
    ds = pbrdf.make_dataset(0.3, 0.2, np.linspace(0.2, 2.0, 8), quantity="brdf", I=stokes[:, 0])
    with pytest.raises(FitError, match="plane of incidence"):
        pbrdf.fit(ds, nuisances=["angle"])


def test_an_angle_on_its_bound_is_told_in_degrees():
    """As in the table above the notes."""
    theta_i, theta_r, group = protocol()
    stokes = MODEL.stokes(*as_angles(theta_i + 3.0, theta_r - 3.0))
    held = {name: value for name, value in MODEL.values.items() if name != "a"}
    ds = dataset(stokes, theta_i, theta_r, group)
    result = pbrdf.fit(ds, nuisances=["angle~none"], fix=held, starts=2)
    (note,) = [note for note in result.notes if note.startswith("angle stands")]
    assert "at upper bound (2°)" in note
    findings = [f.sentence for f in plausibility(result, ds) if f.sentence.startswith("angle")]
    assert findings and findings[0].startswith("angle = 2° stands at upper bound")
