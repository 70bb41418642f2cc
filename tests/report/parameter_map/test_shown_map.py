"""What is shown of a map: which pixels, in which units, and nothing that was not read."""

import dask.array as da
import numpy as np
import pytest
import xarray as xr
from example_maps import example_map

from pbrdf.errors import DataError
from pbrdf.report.parameter_map.shown_map import PENDING, ShownMap, Window


def test_a_small_map_is_shown_whole():
    found = example_map((7, 9))
    shown = ShownMap(found)
    np.testing.assert_array_equal(shown.estimate, found["estimate"])
    np.testing.assert_array_equal(shown.reduced_chi2, found["chi2"] / found["degrees_of_freedom"])
    assert shown.window.words() == ""
    np.testing.assert_array_equal(shown.good, found["status"] == 0)
    np.testing.assert_array_equal(shown.masked, found["status"] >= 4)
    assert not shown.pending.any()


def test_of_a_large_map_every_nth_pixel_is_shown_and_said():
    found = example_map((50, 33), parameters=2)
    window = Window.of(found, most=10)
    assert window.steps == (5, 4)
    assert window.shape == (10, 9)
    shown = ShownMap(found, window)
    np.testing.assert_array_equal(shown.estimate, found["estimate"].values[:, ::5, ::4])
    assert window.words() == "every 5th pixel along y; every 4th pixel along x"
    assert Window.of(example_map((50, 44), parameters=1), most=22).words() == (
        "every 3rd pixel along y; every 2nd pixel along x"
    )
    assert Window.of(example_map((44, 44), parameters=1), most=22).words() == "every 2nd pixel along y and x"
    assert shown.coordinates["y"] == (pytest.approx(np.arange(0, 50, 5)), "y, pixels")


@pytest.mark.parametrize("split", [(20, 17), (3, 33), (50, 1)])
def test_pieces_make_the_whole_however_it_is_cut(split):
    found = example_map((50, 33), parameters=2)
    window = Window.of(found, most=7)
    pieces = ShownMap(found, window, empty=True)
    assert pieces.pending.all()
    for y in range(0, 50, split[0]):
        for x in range(0, 33, split[1]):
            region = {"y": slice(y, y + split[0]), "x": slice(x, x + split[1])}
            pieces.update(found, region)
    whole = ShownMap(found, window)
    for name in ("estimate", "standard_error", "flags", "reduced_chi2", "optima", "status"):
        np.testing.assert_array_equal(getattr(pieces, name), getattr(whole, name))


def test_only_the_shown_pixels_of_the_region_are_computed():
    found = example_map((60, 60), parameters=2).chunk({"y": 30, "x": 30})
    reached = set()

    def watch(block, block_info=None):
        reached.add(tuple(block_info[0]["chunk-location"]))
        return block

    found["chi2"] = (("y", "x"), da.map_blocks(watch, found["chi2"].data, dtype=float, meta=np.empty((0, 0))))
    shown = ShownMap(found, Window.of(found, most=12), empty=True)
    shown.update(found, {"y": slice(30, 60), "x": slice(0, 30)})
    assert reached == {(1, 0)}
    assert np.isfinite(shown.estimate).any()


def test_dimensions_beyond_two_are_shown_at_their_first_place():
    found = example_map((3, 8, 9), parameters=2, dims=("time", "y", "x"))
    shown = ShownMap(found)
    assert shown.window.dims == ("y", "x")
    np.testing.assert_array_equal(shown.estimate, found["estimate"].values[:, 0])
    assert shown.window.words() == "time: the first only"
    again = ShownMap(found, shown.window, empty=True)
    again.update(found, {"time": slice(1, 3)})
    assert again.pending.all()


def test_a_dimension_of_one_pixel_is_no_side_of_a_picture():
    shown = ShownMap(example_map((1, 30), parameters=1))
    assert shown.window.dims == ("x",)
    assert shown.estimate.shape == (1, 30)


def test_no_dimension_at_all_is_refused():
    with pytest.raises(DataError, match="no dimension"):
        ShownMap(example_map((3, 3)).isel(x=0, y=0))


@pytest.mark.parametrize("fill", [-1, np.nan])
def test_a_status_that_is_no_state_is_a_pixel_not_yet_fitted(fill):
    found = example_map((6, 6))
    found["status"] = (found["status"].dims, found["status"].values.astype(float), found["status"].attrs)
    found["status"][2:4] = fill
    shown = ShownMap(found)
    assert shown.states[-1] == PENDING
    assert shown.pending[2:4].all()
    assert shown.pending.sum() == 12


def test_angles_are_shown_in_degrees_and_symbols_where_the_model_is_known():
    found = example_map((4, 4), parameters=2)
    found = found.assign_coords(unit=("parameter", ["1", "rad"]))
    found.attrs["model"] = "{}"
    shown = ShownMap(found)
    assert [label.with_unit for label in shown.labels] == ["sigma", "n, °"]
    np.testing.assert_allclose(shown.estimate[1], np.rad2deg(found["estimate"][1]))
    assert ShownMap(example_map((4, 4))).labels[0].text == "σ (sigma)"


def test_coordinates_with_a_unit_that_are_evenly_spaced_are_kept():
    found = example_map((4, 5), parameters=1).assign_coords(
        y=xr.DataArray([1.0, 1.5, 2.0, 2.5], dims="y", attrs={"units": "mm"}),
        x=xr.DataArray([0.0, 1.0, 5.0, 6.0, 7.0], dims="x", attrs={"units": "mm"}),
    )
    shown = ShownMap(found)
    assert shown.coordinates["y"] == (pytest.approx([1.0, 1.5, 2.0, 2.5]), "y, mm")
    assert shown.coordinates["x"][1] == "x, pixels"


def test_flags_count_for_pixels_with_a_result_only():
    found = example_map((30, 30))
    shown = ShownMap(found)
    at_bounds = (found["flags"].values & 3 != 0) & (found["status"].values == 0)
    np.testing.assert_array_equal(shown.at_bounds, at_bounds)
    assert shown.flagged("undetermined").any()
    assert not shown.flagged("no_such_flag").any()
