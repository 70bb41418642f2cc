"""The curves of the page: those of stokes() and mueller(), and deviations of the points from them."""

import numpy as np
import pytest

import pbrdf
from pbrdf.data import make_dataset
from pbrdf.explorer.catalogue import layer_of, state_of
from pbrdf.explorer.state import StateError, read_state
from pbrdf.explorer.views.cuts import draw, half_turn_of
from pbrdf.explorer.workspace import Workspace
from pbrdf.optics import stokes as optics_stokes


class Drawn:
    """What :func:`draw` gave, taken apart."""

    def __init__(self, content, workspace=None):
        self.header, buffers = draw(read_state(content), workspace or Workspace(), False)
        quantities = len(self.header["quantities"])
        self.x = np.frombuffer(buffers[0])
        self.curves = np.frombuffer(buffers[1], dtype="<f4").reshape(-1, quantities, len(self.x))
        self.difference = np.frombuffer(buffers[2], dtype="<f4").reshape(-1, len(self.x))
        self.at = np.frombuffer(buffers[3])
        self.points = np.frombuffer(buffers[4]).reshape(quantities, 4, len(self.at))


def content_of(*models, **changes):
    return {**state_of([layer_of(f"model {i}", m) for i, m in enumerate(models)]), **changes}


@pytest.fixture
def pearl():
    return pbrdf.load_paint("pearl-white")


def test_curves_in_an_azimuth_are_those_of_stokes(white, pearl):
    light = [1.0, 0.3, -0.2, 0.1]
    content = content_of(
        white,
        pearl,
        light={"theta_i": 40.0, "stokes": light},
        quantities=["intensity", "dolp", "q", "u", "v"],
        settings={"cuts": {"along": "theta_r", "phi": 25.0}},
    )
    drawn = Drawn(content)
    phi = np.deg2rad(np.where(drawn.x < 0.0, 205.0, 25.0))
    for i, model in enumerate((white, pearl)):
        S = model.stokes(np.deg2rad(40.0), np.deg2rad(np.abs(drawn.x)), phi, incident=light)
        expected = np.stack([S[:, 0], optics_stokes.dolp(S), *(S[:, 1:] / S[:, :1]).T])
        np.testing.assert_allclose(drawn.curves[i], expected, rtol=1e-6, atol=1e-7)
    assert drawn.header["layers"] == [0, 1]
    assert "φ = 25°" in drawn.header["title"]


def test_curves_along_the_azimuth_are_those_of_mueller(white):
    content = content_of(
        white,
        quantities=["m00", "m12", "m33", "aolp"],
        settings={"cuts": {"along": "phi", "theta_r": 20.0}},
    )
    drawn = Drawn(content)
    assert (drawn.x[0], drawn.x[-1]) == (-180.0, 180.0)
    M = white.mueller(np.deg2rad(35.0), np.deg2rad(20.0), np.deg2rad(drawn.x))
    expected = [M[:, 0, 0], M[:, 1, 2] / M[:, 0, 0], M[:, 3, 3] / M[:, 0, 0]]
    np.testing.assert_allclose(drawn.curves[0, :3], expected, rtol=1e-6, atol=1e-7)
    # angles are the same after half a turn
    off = drawn.curves[0, 3] - np.rad2deg(optics_stokes.aolp(M[:, :, 0]))
    known = np.isfinite(off)
    assert known.sum() > 300
    np.testing.assert_allclose(off[known] - 180.0 * np.round(off[known] / 180.0), 0.0, atol=1e-4)
    assert np.ptp(drawn.curves[0, 3][known]) <= 180.0


def test_hidden_models_have_no_curve_and_the_difference_is_that_of_the_curves(white, pearl):
    content = content_of(white, pearl, active=1, compare=0, quantities=["intensity", "q"])
    drawn = Drawn(content)
    np.testing.assert_allclose(drawn.difference, drawn.curves[1] - drawn.curves[0], atol=1e-6)
    content["layers"][0]["shown"] = False
    hidden = Drawn(content)
    assert hidden.header["layers"] == [1]
    np.testing.assert_array_equal(hidden.difference, drawn.difference)
    content["layers"][1]["shown"] = False
    assert Drawn(content).curves.size == 0


def test_points_of_the_measured_line_with_their_deviations(white):
    ds = pbrdf.open_experiment("matte-white-thick")
    workspace = Workspace(datasets=[("white", ds)])
    wish = {"kind": "bistatic", "constant": 100.0, "group": "3"}
    content = content_of(
        white,
        quantities=["intensity", "q", "m11"],
        settings={
            "cuts": {"cut": wish},
            "data": {"off": [50], "held_out": {"kind": "group", "values": ["3"]}},
        },
    )
    drawn = Drawn(content, workspace)
    workspace.close()
    rows = drawn.header["rows"]
    assert sorted(rows) == np.flatnonzero(ds["group"].values == 3).tolist()
    assert [row for row, off in zip(rows, drawn.header["off"], strict=True) if off] == [50]
    assert all(drawn.header["held_out"])
    at = ds.isel(geometry=rows)
    signed = np.rad2deg(np.where(np.cos(at["phi"]) < 0.0, -at["theta_r"], at["theta_r"]))
    np.testing.assert_allclose(drawn.at, signed, atol=1e-9)
    S = white.stokes(*(at[name].values for name in ("theta_i", "theta_r", "phi")))
    measured, std, deviation, weight = drawn.points[0]
    np.testing.assert_array_equal(measured, at["I"].values)
    np.testing.assert_array_equal(std, at["I_std"].values)
    np.testing.assert_allclose(deviation, (at["I"].values - S[:, 0]) / at["I_std"].values, rtol=1e-9)
    np.testing.assert_allclose(weight, 1.0 / at["I_std"].values)
    assert np.isnan(drawn.points[2]).all()  # no matrix was measured
    # the curve goes through the geometry of every point
    S_at = np.interp(drawn.at, drawn.x, drawn.curves[0, 0])
    np.testing.assert_allclose(S_at, S[:, 0], rtol=1e-5)


def test_points_in_an_azimuth_at_the_angle_of_the_light(white):
    phi, theta_r = np.meshgrid(np.deg2rad([0.0, 60.0, 180.0, -120.0]), np.deg2rad([10.0, 20.0, 40.0]))
    theta_i = np.repeat(np.deg2rad([30.0, 50.0]), phi.size)
    theta_r, phi = np.tile(theta_r.ravel(), 2), np.tile(phi.ravel(), 2)
    S = white.stokes(theta_i, theta_r, phi)
    ds = make_dataset(theta_i, theta_r, phi, quantity="brdf", I=S[:, 0], Q=S[:, 1], U=S[:, 2])
    workspace = Workspace(datasets=[("white", ds)])
    content = content_of(white, light={"theta_i": 50.0}, settings={"cuts": {"along": "theta_r", "phi": 60.0}})
    drawn = Drawn(content, workspace)
    np.testing.assert_allclose(drawn.at, [-40.0, -20.0, -10.0, 10.0, 20.0, 40.0], atol=1e-9)
    np.testing.assert_allclose(drawn.points[:, 2], 0.0, atol=1e-9)
    content["settings"]["cuts"] = {"along": "phi", "theta_r": 20.0}
    drawn = Drawn(content, workspace)
    np.testing.assert_allclose(drawn.at, [-120.0, 0.0, 60.0, 180.0], atol=1e-9)
    content["light"]["stokes"] = [1.0, 0.5, 0.0, 0.0]
    assert "other light" in Drawn(content, workspace).header["note"]
    content["settings"]["data"] = {"set": "gone"}
    drawn = Drawn(content, workspace)
    assert "'gone'" in drawn.header["note"] and drawn.at.size == 0  # the curves are drawn all the same
    workspace.close()


def test_of_very_many_points_some_are_drawn(white):
    theta_r = np.deg2rad(np.linspace(0.0, 80.0, 5000))
    ds = make_dataset(0.5, theta_r, 0.0, quantity="brdf", I=np.full(5000, 0.3))
    workspace = Workspace(datasets=[("scan", ds)])
    drawn = Drawn(content_of(white), workspace)
    workspace.close()
    assert len(drawn.at) == 500 and len(drawn.x) < 1000
    assert "500 of the 5000 points" in drawn.header["note"]
    np.testing.assert_array_equal(drawn.points[0, 0], 0.3)


def test_angles_are_drawn_within_the_half_turn_that_they_leave_least():
    steady = np.array([0.0, 90.0, 80.0, np.nan, -10.0])
    assert half_turn_of(steady) == -45.0
    around_135 = np.array([130.0, -44.0, 128.0, np.nan, -41.0, 133.0])
    assert half_turn_of(around_135) == 45.0
    assert half_turn_of(np.full(3, np.nan)) == -45.0


def test_angles_of_points_and_curves_share_their_half_turn(white):
    ds = pbrdf.open_experiment("matte-white-thick")
    workspace = Workspace(datasets=[("white", ds)])
    drawn = Drawn(content_of(white, quantities=["aolp"]), workspace)
    workspace.close()
    at = ds.isel(geometry=drawn.header["rows"])
    measured, _, deviation, _ = drawn.points[0]
    known = np.isfinite(measured)
    assert known.sum() > 5
    expected = 0.5 * np.rad2deg(np.arctan2(at["U"].values, at["Q"].values))
    turns = (measured - expected)[known] / 180.0
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-9)
    assert np.all((measured[known] >= -45.0) & (measured[known] <= 135.0))
    assert np.nanmax(np.abs(deviation)) < 5.0  # not half a turn away


@pytest.mark.parametrize(
    "settings, place",
    [
        ({"along": "wind"}, "along"),
        ({"along": "phi", "theta_r": 91.0}, "theta_r"),
        ({"along": "theta_r", "phi": "north"}, "phi"),
        ({"along": "theta_r", "phi": 1e9}, "phi"),
    ],
)
def test_settings_that_are_none_are_refused_in_words(white, settings, place):
    with pytest.raises(StateError) as caught:
        Drawn(content_of(white, settings={"cuts": settings}))
    assert caught.value.place == f"settings.cuts.{place}"
