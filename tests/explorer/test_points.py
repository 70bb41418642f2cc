"""Measured points for the page: those of the data set, with the uncertainties of its figures and of its fits."""

import numpy as np
import pytest
import xarray as xr

import pbrdf
from pbrdf.data import make_dataset
from pbrdf.explorer.catalogue import layer_of, state_of
from pbrdf.explorer.fit_process import process_of
from pbrdf.explorer.points import Measured, answer, chosen_data
from pbrdf.explorer.state import StateError, read_state
from pbrdf.explorer.workspace import Workspace
from pbrdf.inversion.observations import Observations


@pytest.fixture
def experiment():
    return pbrdf.open_experiment("matte-white-thick")


def state_with(model, **settings):
    content = state_of([layer_of("white", model)])
    content["settings"] = settings
    return read_state(content)


def test_points_are_those_of_the_data_set(experiment):
    measured = Measured.of("white", experiment, None)
    (intensity, spread), (q, _) = measured.channel("intensity"), measured.channel("q")
    np.testing.assert_array_equal(intensity.measured, experiment["I"].values)
    np.testing.assert_array_equal(intensity.std, experiment["I_std"].values)
    np.testing.assert_array_equal(spread, experiment["I_std"].values)
    np.testing.assert_allclose(q.measured, experiment["Q"].values / experiment["I"].values, rtol=1e-14)
    np.testing.assert_allclose(np.deg2rad(measured.points.theta_r), experiment["theta_r"].values, rtol=1e-14)
    assert measured.channel("m11") is None
    assert measured.light == (1.0, 0.0, 0.0, 0.0)


def test_weights_of_every_quantity_follow_from_those_of_a_fit(experiment):
    """By hand, to first order, from the uncertainties that the fit itself takes."""
    measured = Measured.of("white", experiment.drop_vars([f"{n}_std" for n in "IQUV"]), None)
    data = Observations.from_dataset(measured.dataset)
    std = dict(zip(data.channels, data.std, strict=True))
    I, Q, U = (experiment[name].values for name in "IQU")  # noqa: E741
    channel, spread = measured.channel("intensity")
    assert np.isnan(channel.std).all()  # what a fit has to assume is no error bar
    np.testing.assert_allclose(spread, std["I"], rtol=1e-14)
    np.testing.assert_allclose(measured.channel("q")[1], np.hypot(std["Q"], Q / I * std["I"]) / I, rtol=1e-12)
    size = np.hypot(Q, U)
    by_hand = (
        np.sqrt((size / I * std["I"]) ** 2 + (Q / size * std["Q"]) ** 2 + (U / size * std["U"]) ** 2) / I
    )
    np.testing.assert_allclose(measured.channel("dolp")[1], by_hand, rtol=1e-12)
    assert "assumed" in measured.noise


def test_first_column_of_matrices_is_the_stokes_vector(white):
    angles = np.deg2rad([10.0, 30.0, 50.0])
    M = white.mueller(angles, angles, 0.4)
    ds = make_dataset(angles, angles, 0.4, quantity="brdf", mueller=M, std={"mueller": 0.01})
    measured = Measured.of("matrix", ds, None)
    np.testing.assert_allclose(measured.channel("q")[0].measured, M[:, 1, 0] / M[:, 0, 0], rtol=1e-14)
    np.testing.assert_allclose(measured.channel("intensity")[1], 0.01)
    np.testing.assert_allclose(measured.channel("dolp")[1], measured.channel("dolp")[0].std, rtol=1e-12)
    np.testing.assert_array_equal(measured.channel("m22")[0].measured, M[:, 2, 2] / M[:, 0, 0])


def test_points_of_a_wavelength_and_those_switched_off(experiment, white):
    other = experiment.copy(deep=True)
    other["wavelength"] = other["wavelength"] + 100.0
    both = xr.concat([experiment, other], dim="geometry")
    both.attrs = experiment.attrs
    workspace = Workspace(datasets=[("both", both)])
    choice = chosen_data(state_with(white, data={"wavelength": 576.0, "off": [0, 64, 65]}), workspace)
    assert choice.measured.rows.tolist() == list(range(63, 126))
    assert np.flatnonzero(choice.off).tolist() == [1, 2]
    assert choice.used.sizes["geometry"] == 61
    assert chosen_data(state_with(white), workspace).measured.wavelength == 476.0
    held = {"kind": "group", "values": ["2"]}
    choice = chosen_data(state_with(white, data={"held_out": held}), workspace)
    np.testing.assert_array_equal(choice.is_held_out, experiment["group"].values == 2)
    workspace.close()


@pytest.mark.parametrize(
    "settings, place",
    [
        ({"set": "another"}, "set"),
        ({"set": ["white"]}, "set"),
        ({"wavelength": 600.0}, "wavelength"),
        ({"wavelength": "red"}, "wavelength"),
        ({"off": [63]}, "off"),
        ({"off": [-1]}, "off"),
        ({"off": [True]}, "off"),
        ({"off": "all"}, "off"),
        ({"held_out": {"kind": "group", "values": ["9"]}}, "held_out"),
        ({"held_out": {"kind": "fraction", "values": ["0.5"]}}, "held_out"),
        ({"held_out": "group=1"}, "held_out"),
        ({"held_out": {"kind": "group", "values": ["1", "2", "3"]}}, "held_out"),
    ],
)
def test_settings_that_are_none_are_refused_in_words(experiment, white, settings, place):
    workspace = Workspace(datasets=[("white", experiment)])
    with pytest.raises(StateError) as caught:
        chosen_data(state_with(white, data=settings), workspace)
    assert caught.value.place == f"settings.data.{place}"
    workspace.close()


def test_page_is_told_what_there_is(experiment, white):
    workspace, said = Workspace(datasets=[("white", experiment)]), []
    content = state_of([layer_of("white", white)])
    answer({"type": "data", "id": 7, "state": content}, [], workspace, lambda *given: said.append(given[0]))
    workspace.close()
    (told,) = said
    assert (told["type"], told["id"], told["sets"]) == ("data", 7, ["white"])
    assert told["chosen"]["groups"] == ["1", "2", "3"]
    assert told["chosen"]["count"] == 63
    assert told["chosen"]["simulated"]
    empty = Workspace()
    answer({"type": "data"}, [], empty, lambda *given: said.append(given[0]))
    assert said[1]["sets"] == [] and said[1]["chosen"] is None
    assert process_of(empty).pid is None  # no process for those who have nothing to fit
