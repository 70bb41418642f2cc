"""What a fit is worth: every criterion on made-up residuals, and fits of a right, a wrong and a hopeless model."""

from __future__ import annotations

import math
import warnings
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

import pbrdf
from pbrdf.inversion.verdict import DISTINCT, GRAZING, Level, verdict
from pbrdf.optics.half_difference import facet_tilt


def case(
    wrong=None, *, std=None, q=None, q_modelled=None, held=None, incidences=(20, 40, 60), estimates=None
):
    """A lobe over a floor, in and out of the plane, and a model that is off by a factor 1 + wrong(table)."""
    theta_i, theta_r, phi = (
        np.deg2rad(a.ravel())
        for a in np.meshgrid(incidences, np.arange(0.0, 80.0, 5.0), [0.0, 90.0, 180.0], indexing="ij")
    )
    tilt = facet_tilt(theta_i, theta_r, phi)
    measured = 0.1 + 0.9 * np.exp(-((tilt / 0.15) ** 2))
    table = xr.Dataset(
        {"facet_tilt": ("geometry", tilt)},
        coords={
            "theta_i": ("geometry", theta_i),
            "theta_r": ("geometry", theta_r),
            "phi": ("geometry", phi),
            "group": ("geometry", np.where(np.arange(tilt.size) % 2, "left", "right")),
            "wavelength": ("geometry", np.where(np.arange(tilt.size) % 3, 550.0, 650.0)),
        },
    )
    table["I_measured"] = ("geometry", measured)
    noise = 0.02 * np.random.default_rng(0).standard_normal(tilt.size)
    table["I_modelled"] = ("geometry", measured * (1.0 + noise + (0.0 if wrong is None else wrong(table))))
    table["held_out"] = ("geometry", np.zeros(tilt.size, dtype=bool) if held is None else held(table))
    channels = ("I",)
    if q is not None:
        channels = ("I", "Q")
        table["Q_measured"] = ("geometry", q * measured)
        table["Q_modelled"] = ("geometry", (q if q_modelled is None else q_modelled) * measured)
    for c in channels:
        table[f"{c}_residual"] = table[f"{c}_modelled"] - table[f"{c}_measured"]
        table[f"{c}_std"] = ("geometry", (0.05 if std is None else std) * measured)
    z = np.concatenate([table[f"{c}_residual"].values / table[f"{c}_std"].values for c in channels])
    return SimpleNamespace(
        comparison=table,
        data=SimpleNamespace(channels=channels),
        std_known=std is not None,
        estimates=estimates or {},
        goodness=SimpleNamespace(reduced_chi2=float((z**2).mean())),
        settled=True,
    )


def at(name, value, factor):
    """Wrong by a factor where a coordinate has a value (angles in degrees)."""

    def wrong(table):
        column = table[name].values
        if name.startswith("theta"):
            column = np.round(np.rad2deg(column), 6)
        return np.where(column == value, factor, 0.0)

    return wrong


def test_errors_within_the_tolerance_describe_the_data():
    found = verdict(case())
    assert found.level == Level.DESCRIBES
    assert found.sentence.startswith("The model describes the data: median error of the intensity 1.")
    assert "in part" not in found.sentence and not found.do_not_quote
    assert any("Nothing was held out" in reason for reason in found.reasons)
    assert any("No polarisation was measured" in reason for reason in found.reasons)


@pytest.mark.parametrize(
    ("wrong", "where"),
    [
        (at("theta_i", 60.0, 0.45), "not at θ_i = 60°, median error 4"),
        (at("wavelength", 650.0, 0.45), "not at 650 nm, median error 4"),
        (at("group", "left", -0.45), "not in group left, median error 4"),
        (lambda t: np.where(t["facet_tilt"] < np.radians(10.0), 0.45, 0.0), "not within 10° of facet tilt"),
        # only the peak, which is fewer points than any other part
        (lambda t: np.where(t["I_measured"] > 0.55, -0.7, 0.0), "not where it is brightest"),
    ],
)
def test_the_worst_part_is_named(wrong, where):
    found = verdict(case(wrong))
    assert found.level == Level.IN_PART
    assert found.sentence.startswith(f"The model describes the data in part: {where}")
    assert where[1:] in found.reasons[0]
    assert verdict(case(lambda t: 0.1 * wrong(t))).level == Level.DESCRIBES


def test_many_angles_of_incidence_are_judged_in_bins():
    angles = tuple(np.linspace(10.0, 74.0, 100))
    assert len(angles) > DISTINCT
    found = verdict(case(lambda t: np.where(np.rad2deg(t["theta_i"]) > 67.5, 0.6, 0.0), incidences=angles))
    assert found.level == Level.IN_PART and "not at θ_i = 70° ± 2.5°, median error 6" in found.sentence
    assert len(found.strata) < 30


def test_a_bias_counts_where_scatter_of_the_same_size_does_not():
    signs = np.where(np.arange(200) % 2, 1.0, -1.0)
    biased = verdict(case(at("theta_i", 40.0, 0.15)))
    assert (
        biased.level == Level.IN_PART and "not at θ_i = 40°, above the measurement by 15 %" in biased.sentence
    )
    scattered = verdict(case(lambda t: at("theta_i", 40.0, 0.15)(t) * signs[: t.sizes["geometry"]]))
    assert scattered.level == Level.DESCRIBES


def test_half_of_the_signal_missed_is_no_description():
    found = verdict(case(lambda t: np.full(t.sizes["geometry"], -0.6)))
    assert found.level == Level.DOES_NOT
    assert found.sentence.startswith("The model does not describe this sample, do not quote its parameters: ")
    assert verdict(case(lambda t: np.full(t.sizes["geometry"], -0.3))).level == Level.IN_PART


def test_what_was_held_out_decides_like_what_was_fitted():
    held = lambda t: np.rad2deg(t["theta_i"].values).round() == 40.0  # noqa: E731
    for factor, level in ((0.0, Level.DESCRIBES), (0.36, Level.IN_PART), (0.6, Level.DOES_NOT)):
        found = verdict(case(at("theta_i", 40.0, factor), held=held))
        assert found.level == level and "held out" in found.sentence
    partly = verdict(case(at("theta_i", 40.0, 0.36), held=held)).sentence
    assert "not at θ_i = 40° (held out), median error 3" in partly


def test_grazing_incidence_is_named_but_does_not_count():
    angles = (20, 40, 60, math.degrees(GRAZING) + 5.0)
    found = verdict(case(at("theta_i", 80.0, 0.5), incidences=angles))
    assert found.level == Level.DESCRIBES
    assert "but not at θ_i = 80°, median error 5" in found.sentence and "(grazing)" in found.sentence


def test_a_model_no_better_than_a_constant_explains_nothing():
    constant = lambda t: 0.13 / t["I_measured"].values - 1.0  # noqa: E731
    found = verdict(case(constant))
    assert found.level == Level.DOES_NOT and "no more than a constant would" in found.sentence
    assert next(s.error for s in found.strata) < 0.5  # it is not the size of the error
    half = lambda t: 0.5 * constant(t)  # noqa: E731
    assert verdict(case(half)).level == Level.IN_PART


def test_a_model_that_is_black_somewhere_is_judged_without_a_warning():
    """A Beckmann lobe underflows far from the mirror direction; no one is told of 0/0."""
    black = case(q=0.3)
    black.comparison["I_modelled"].values[black.comparison["theta_i"].values > 1.0] = 0.0
    black.comparison["Q_modelled"].values[black.comparison["theta_i"].values > 1.0] = 0.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert verdict(black).level != Level.DESCRIBES


def test_polarisation_of_the_wrong_sign_is_not_described():
    assert verdict(case(q=-0.3)).level == Level.DESCRIBES
    found = verdict(case(q=-0.3, q_modelled=0.3))
    assert found.level == Level.IN_PART
    assert "in part: not its polarisation, rms error 0.6 of a measured 0.3" in found.sentence
    # with the intensity amiss as well nothing is left
    both = verdict(case(at("theta_i", 60.0, 0.45), q=-0.3, q_modelled=0.3))
    assert both.level == Level.DOES_NOT
    # little of it, or little wrong with it, is allowed
    assert verdict(case(q=0.005, q_modelled=-0.005)).level == Level.DESCRIBES
    assert verdict(case(q=0.3, q_modelled=0.25)).level == Level.DESCRIBES


def test_errors_of_the_size_of_stated_uncertainties_are_excused():
    wrong = at("theta_i", 60.0, 0.3)
    assert verdict(case(wrong)).level == Level.IN_PART
    found = verdict(case(wrong, std=0.3))
    assert found.level == Level.DESCRIBES
    assert any("nothing closer can be asked for" in reason for reason in found.reasons)


def test_a_large_chi2_may_still_be_a_useful_description():
    found = verdict(case(std=0.002))
    assert found.level == Level.DESCRIBES
    assert any("times the stated uncertainty: a useful description" in reason for reason in found.reasons)


def test_parameters_on_bounds_are_not_quoted():
    def estimate(name, at):
        parameter = SimpleNamespace(name=name, domain=(0.0, 10.0))
        return SimpleNamespace(parameter=parameter, verdict=at, lower=0.0, upper=5.0)

    estimates = {
        "x": estimate("x", "determined"),
        "y": estimate("y", "at upper bound"),  # of the search
        "z": estimate("z", "at lower bound"),  # the edge of what the model is defined for
        "w": estimate("w", "undetermined"),
        "v": estimate("v", "fixed"),
    }
    found = verdict(case(estimates=estimates))
    assert found.level == Level.DESCRIBES and found.do_not_quote == ["y", "z", "w"]
    assert found.sentence.endswith("do not quote y and z (on a bound) and w (not determined).")
    assert next(r for r in found.reasons if "on a bound of the search" in r).startswith("y stands")
    hopeless = verdict(case(lambda t: np.full(t.sizes["geometry"], -0.9), estimates=estimates))
    assert hopeless.do_not_quote == ["x", "y", "z", "w"]


def test_fits_of_a_right_a_wrong_and_a_hopeless_model():
    dataset = pbrdf.open_experiment("matte-white-thick")
    right = pbrdf.fit(dataset, hold_out="group=3", starts=8).verdict()
    assert right.level == Level.DESCRIBES and right.do_not_quote == []
    # a metal's polarisation by a model that has none: n held near 1
    wrong = pbrdf.fit(dataset, starts=4, fix={"t": 0.0, "n": 1.21})
    assert wrong.verdict().level == Level.IN_PART
    assert "polarisation" in wrong.verdict().sentence
    rng = np.random.default_rng(1)
    theta_i, theta_r = np.deg2rad(rng.uniform(5.0, 70.0, (2, 120)))
    noise = pbrdf.make_dataset(theta_i, theta_r, 0.0, quantity="brdf", I=np.exp(rng.normal(-2.0, 2.0, 120)))
    hopeless = pbrdf.fit(noise, starts=4)
    assert hopeless.verdict().level == Level.DOES_NOT
    assert set(hopeless.verdict().do_not_quote) == set(hopeless.space.names)
    assert hopeless.identifiability().sentences == [
        "Nothing can be said of what the data determine, as the model does not describe them."
    ]
    assert any("those of no sample" in f.sentence for f in hopeless.plausibility())
    text = hopeless.summary()
    first = " ".join(text.split("\n\n")[0].split())
    assert first.startswith("Verdict The model does not describe this sample, do not quote its parameters")
    rest = text[len("Verdict") :]
    for contradiction in (
        "determined to",
        "The data determine",
        "Every fitted parameter",
        "describes the data",
    ):
        assert contradiction not in rest, contradiction
