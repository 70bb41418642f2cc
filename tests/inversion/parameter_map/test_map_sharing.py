"""Parameters that pixels share, against single fits of all pixels with ``split``."""

from __future__ import annotations

import json
import pickle

import numpy as np
import pytest
import xarray as xr
from map_helpers import directions, measured, pixel, varied

import pbrdf
from pbrdf.inversion.parameter_map import PixelStatus

FIX = {"k": 1.2504, "b": 0.1827}
OWN = ("sigma", "a")


@pytest.fixture(scope="module")
def data():
    return measured(varied((2, 3)), directions(3))


def together(dataset, chosen=None):
    """The pixels as groups of one data set."""
    parts = []
    for number, (y, x) in enumerate(np.ndindex(dataset.sizes["y"], dataset.sizes["x"])):
        if chosen is None or chosen[y, x]:
            one = pixel(dataset, y=y, x=x)
            parts.append(one.assign_coords(group=("geometry", np.full(one.sizes["geometry"], number))))
    result = xr.concat(parts, "geometry")
    result.attrs = dataset.attrs
    return result


def assert_same_as_split(found, result, chosen=None, tolerance=1e-3):
    for number, (y, x) in enumerate(np.ndindex(found.sizes["y"], found.sizes["x"])):
        if chosen is not None and not chosen[y, x]:
            continue
        own = found.isel(y=y, x=x)
        for name in found["parameter"].values.tolist():
            one = result.estimates.get(name) or result.estimates[f"{name}[{number}]"]
            here = own.sel(parameter=name)
            np.testing.assert_allclose(here["estimate"], one.value, rtol=0.0, atol=tolerance * one.std)
            np.testing.assert_allclose(here["standard_error"], one.std, rtol=tolerance)


WAYS = {"plain": {}, "prior": {"priors": {"n": (1.6, 0.001)}}, "scale not known": {"noise": "0.05,0"}}


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
def test_shared_parameters_are_those_of_one_fit_of_all_pixels(data, way):
    options = {"fix": FIX, "starts": 16, **WAYS[way]}
    found = pbrdf.fit_map(data, share=["n", "t"], correlation=True, **options)
    result = pbrdf.fit(together(data), split=dict.fromkeys(OWN, "group"), **options)
    assert (found["status"] == PixelStatus.CONVERGED).all()
    assert_same_as_split(found, result)
    told = json.loads(found.attrs["shared"])["1"]
    np.testing.assert_allclose(told["values"]["n"], result.estimates["n"].value, rtol=1e-6)
    np.testing.assert_allclose(told["standard_errors"]["n"], result.estimates["n"].std, rtol=1e-3)
    np.testing.assert_allclose(told["chi2"], result.goodness.chi2, rtol=1e-6)
    assert told["degrees_of_freedom"] == result.goodness.data - result.goodness.free
    assert told["converged"]
    # correlations of a pixel's own parameters with the shared ones
    names = ["sigma[4]", "n", "a[4]", "t"]
    whole = result.correlation.sel(parameter=names, other=names).values
    np.testing.assert_allclose(found["correlation"].isel(y=1, x=1).values, whole, atol=2e-3)
    # block by block the same
    again = pbrdf.fit_map(data, share=["n", "t"], block={"y": 1, "x": 2}, **options)
    off = (again["estimate"] - found["estimate"]) / found["standard_error"]
    assert float(np.abs(off).max()) < 3e-3


@pytest.mark.slow
def test_each_label_has_its_own(data):
    labels = np.array([[1, 1, 0], [7, 7, 1]])
    options = {"fix": FIX, "starts": 16}
    found = pbrdf.fit_map(data, share=["n", "t"], labels=labels, **options)
    assert (found["status"].values == PixelStatus.MASKED).sum() == 1
    assert [*json.loads(found.attrs["shared"])] == ["1", "7"]
    for label in (1, 7):
        result = pbrdf.fit(together(data, labels == label), split=dict.fromkeys(OWN, "group"), **options)
        assert_same_as_split(found, result, labels == label)


@pytest.mark.slow
def test_all_parameters_shared_is_one_fit_for_each_label(data):
    options = {"fix": FIX, "starts": 16}
    found = pbrdf.fit_map(data, share=["sigma", "n", "a", "t"], **options)
    result = pbrdf.fit(
        together(data).drop_vars("group").assign_coords(group=together(data)["group"] * 0), **options
    )
    for name in found["parameter"].values.tolist():
        one = result.estimates[name]
        own = found.sel(parameter=name)
        assert np.ptp(own["estimate"].values) == 0.0
        np.testing.assert_allclose(own["estimate"].values, one.value, atol=1e-3 * one.std)
        np.testing.assert_allclose(own["standard_error"].values, one.std, rtol=1e-3)
    np.testing.assert_allclose(found["chi2"].sum(), result.goodness.chi2, rtol=1e-6)


@pytest.mark.slow
def test_pixels_that_alone_have_too_few_values(data):
    few = data.isel(geometry=[2])[["I", "Q", "U", "I_std", "Q_std", "U_std"]]
    with pytest.raises(pbrdf.FitError, match="cannot determine"):
        pbrdf.fit_map(few, fix=FIX)
    found = pbrdf.fit_map(few, fix=FIX | {"sigma": 0.04, "t": 0.67}, share=["n"], starts=8)
    assert (found["status"] == PixelStatus.CONVERGED).all()
    assert (found["degrees_of_freedom"] == 2).all()


@pytest.mark.slow
def test_a_shared_parameter_on_its_bound(data):
    found = pbrdf.fit_map(data, fix=FIX, share=["n"], bounds={"n": (1.4, 1.5)}, starts=16)
    own = found.sel(parameter="n")
    assert (
        (own["flags"] == 2).all()
        and np.allclose(own["estimate"], 1.5)
        and np.isnan(own["standard_error"]).all()
    )
    alone = pbrdf.fit_map(data, fix=FIX | {"n": 1.5}, starts=16)
    np.testing.assert_allclose(
        found["standard_error"].sel(parameter="a"), alone["standard_error"].sel(parameter="a"), rtol=1e-4
    )


@pytest.mark.slow
def test_whoever_fits_a_block_has_what_is_shared(data):
    prepared = pbrdf.MapFit.prepare(data, fix=FIX, share="n", starts=8)
    found = prepared.solve_shared([data.isel(y=[0]), data.isel(y=[1])])
    assert json.loads(json.dumps(found.settings))["shared"]["1"] == [
        float(found.fit_block(data)["estimate"][1, 0, 0])
    ]
    assert prepared.shared is None and found.shared.passes < 8
    block = data.isel(y=[1], x=[0, 2])
    again = pickle.loads(pickle.dumps(found)).fit_block(block)
    xr.testing.assert_identical(again, found.fit_block(block))
    assert [*found.template().data_vars] == [*again.data_vars] and again.attrs == found.template().attrs


def test_a_name_that_is_given_twice_is_shared_once(data):
    prepared = pbrdf.MapFit.prepare(data, fix=FIX, share=["n", "n"], starts=8)
    assert prepared.settings["share"] == ["n"]


def test_blocks_need_what_is_shared_first(data):
    prepared = pbrdf.MapFit.prepare(data, fix=FIX, share="n")
    with pytest.raises(pbrdf.FitError, match=r"MapFit\.solve_shared"):
        prepared.fit_block(data)
    with pytest.raises(pbrdf.FitError, match="no pixel has enough measured values"):
        prepared.solve_shared([data.assign({n: np.nan * data[n] for n in "IQU"})])
