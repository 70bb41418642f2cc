"""Maps for the page: what is sent are the map's own numbers, few of them are read, pixels have models and data."""

import json
import re

import made_maps
import numpy as np
import pytest
import xarray as xr
from made_maps import ON_BOUND, SHAPE, STATES, UNDETERMINED, material_map, parameter_map, pixel_data
from xarray.core import indexing

import pbrdf
from pbrdf.errors import PbrdfError
from pbrdf.explorer import map_pixels, maps
from pbrdf.explorer.fitting import job_of
from pbrdf.explorer.maps import chosen_map
from pbrdf.explorer.opening import is_map, open_source
from pbrdf.explorer.points import chosen_data
from pbrdf.explorer.state import StateError, read_state
from pbrdf.explorer.views import map as view
from pbrdf.explorer.workspace import Workspace
from pbrdf.inversion.map_store import DatasetSource
from pbrdf.inversion.map_store.made_from import MadeFrom
from pbrdf.inversion.parameter_map.layout import PixelStatus


class Counted(xr.backends.BackendArray):
    """An array that lies elsewhere; says how many numbers of it were read."""

    def __init__(self, array):
        self.array, self.shape, self.dtype = array, array.shape, array.dtype
        self.read = []

    def __getitem__(self, key):
        return indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.BASIC, self._get)

    def _get(self, key):
        found = self.array[key]
        self.read.append(found.size)
        return found


def counted(dataset):
    """The data set with variables that are read when they are asked for, and these by name."""
    arrays = {name: Counted(np.asarray(v.values)) for name, v in dataset.data_vars.items()}
    lazy = {
        name: xr.Variable(dataset[name].dims, indexing.LazilyIndexedArray(a), dataset[name].attrs)
        for name, a in arrays.items()
    }
    return xr.Dataset(lazy, dataset.coords, dataset.attrs), arrays


def shown(workspace, **settings):
    state = workspace.state()
    state["settings"]["map"] = settings
    return read_state(state)


def of(dataset, **settings):
    workspace = Workspace(maps=[("paint", dataset)])
    return chosen_map(shown(workspace, **settings), workspace)


def kind(picture, at):
    number = picture.kinds[at]
    return picture.header["kinds"][number - 1]["text"] if number else ""


def test_pictures_are_the_maps_numbers():
    found = parameter_map()
    estimate = of(found, variable="estimate:n").picture()
    assert estimate.values.shape == estimate.kinds.shape == SHAPE
    for at in ((0, 0), (3, 2), (4, 6)):
        assert kind(estimate, at) == ""
        assert estimate.values[at] == np.float32(found["estimate"].values[(1, *at)])
    assert kind(estimate, UNDETERMINED) == "the data do not determine it"
    assert kind(estimate, STATES[PixelStatus.NOT_MEASURED]) == "not measured or left out"
    assert kind(estimate, STATES[PixelStatus.MASKED]) == "not measured or left out"
    assert kind(estimate, STATES[PixelStatus.FAILED]) == "no result"
    assert kind(estimate, STATES[PixelStatus.NOT_CONVERGED]) == "no result"
    assert kind(estimate, STATES[-1]) == "not yet fitted"
    low, high = estimate.header["range"]
    # all but the outermost
    assert 1.5 <= low < 1.502 and 1.595 < high < 1.6
    error = of(found, variable="standard_error:n").picture()
    assert error.values[3, 2] == np.float32(found["standard_error"].values[1, 3, 2])
    assert kind(error, ON_BOUND) == "on a bound: no standard error"
    assert kind(of(found, variable="limits:n").picture(), ON_BOUND) == "on its upper bound"
    chi2 = of(found, variable="reduced_chi2").picture()
    assert chi2.values[3, 2] == np.float32(found["chi2"].values[3, 2] / 20)
    status = of(found, variable="status").picture()
    assert kind(status, STATES[PixelStatus.FAILED]) == "failed"
    assert status.kinds.all() and status.header["range"] is None


def test_numbers_are_in_shown_units():
    found = parameter_map()
    found["unit"] = ("parameter", ["rad", "1"])
    chosen = of(found, variable="estimate:sigma", pixel=[3, 2])
    assert chosen.variable.unit == "°"
    assert chosen.picture().values[3, 2] == np.float32(np.rad2deg(found["estimate"].values[0, 3, 2]))
    row = chosen.described_pixel(Workspace())["rows"][0]
    assert row["written"].startswith(f"{np.rad2deg(found['estimate'].values[0, 3, 2]):.2f}")
    assert row["unit"] == "°"


def test_a_large_map_is_read_by_strides_and_a_pixel_alone():
    found, arrays = counted(parameter_map((1000, 1400)))
    workspace = Workspace(maps=[("large", found)])
    state = shown(workspace, variable="estimate:n")
    view.draw(state, workspace, False)
    assert not any(array.read for array in arrays.values())
    chosen = chosen_map(state, workspace)
    picture = chosen.picture()
    assert chosen.step == 3 and picture.values.shape == (334, 467)
    for name in ("estimate", "flags", "status"):
        assert arrays[name].read == [334 * 467]
    assert picture.values[100, 200] == np.float32(arrays["estimate"].array[1, 300, 600])
    # nothing else of the map
    assert {name for name, array in arrays.items() if array.read} == {"estimate", "flags", "status"}
    for array in arrays.values():
        array.read.clear()
    for _ in range(2):  # a slider that moves reads nothing
        header, _ = view.draw(shown(workspace, pixel=[731, 1201]), workspace, True)
    assert [sum(array.read) for array in arrays.values()] == [2, 2, 1, 1, 1, 0, 2, 1]
    assert header["pixel"]["where"] == "y 731 (rows from the top), x 1201 (columns from the left)"
    # zoomed in, every pixel is shown
    near = of(found, variable="estimate:n", region=[700, 1100, 200, 300]).picture()
    assert near.header["step"] == 1 and near.values[31, 101] == np.float32(
        arrays["estimate"].array[1, 731, 1201]
    )


def test_dimensions_that_the_picture_does_not_have():
    found = parameter_map((3, 5, 7), ("time", "y", "x"))
    chosen = of(found, variable="estimate:n", place={"time": 2}, pixel=[3, 2])
    assert chosen.dims == ("y", "x")
    assert chosen.picture().values[3, 2] == np.float32(found["estimate"].values[1, 2, 3, 2])
    assert chosen.indices == {"time": 2, "y": 3, "x": 2}
    assert view.draw(shown(w := Workspace(maps=[("m", found)]), place={"time": 2}), w, False)[0]["place"] == [
        ["time", 2, 3]
    ]
    # rows and columns stay themselves in a map that is stored the other way round
    turned = of(found.transpose("parameter", "x", "y", "time"), variable="estimate:n", place={"time": 2})
    np.testing.assert_array_equal(turned.picture().values, chosen.picture().values)
    line = of(parameter_map((9,), ("sample",)), variable="estimate:n", pixel=[0, 4])
    assert line.picture().values.shape == (1, 9) and line.indices == {"sample": 4}


def test_maps_of_materials():
    found = material_map()
    assert is_map(found)
    picture = of(found).picture()
    assert [kind(picture, at) for at in ((2, 2), (2, 3), (0, 0), (1, 1))] == [
        "gloss black",
        "matt white",
        "none of these",
        "not measured",
    ]
    sure = of(found, variable="confidence").picture()
    assert sure.header["range"] == [0.7, 1.0] and sure.values[2, 3] == np.float32(0.95)
    assert kind(sure, (0, 0)) == "none of these"
    told = of(found, pixel=[2, 3]).described_pixel(Workspace())
    assert told["status"] == "matt white" and told["facts"][0][1] == "95 %"
    with pytest.raises(PbrdfError, match="map of materials"):
        maps.model_at(of(found, pixel=[2, 3]), Workspace())


@pytest.mark.parametrize(
    ("settings", "place"),
    [
        ({"name": "none"}, "settings.map.name"),
        ({"name": ["x"]}, "settings.map.name"),
        ({"pixel": [5, 0]}, "settings.map.pixel"),
        ({"pixel": [0.5, 0]}, "settings.map.pixel"),
        ({"pixel": "here"}, "settings.map.pixel"),
        ({"region": [0, 0, 6, 7]}, "settings.map.region"),
        ({"region": [0, 0, 0, 7]}, "settings.map.region"),
        ({"place": 3}, "settings.map.place"),
    ],
)
def test_hostile_settings_are_refused_where_they_stand(settings, place):
    with pytest.raises(StateError) as refused:
        of(parameter_map(), **settings)
    assert refused.value.place == place


def test_of_values_of_each_wavelength_the_model_of_a_pixel_has_the_first():
    found = parameter_map()
    described = json.loads(found.attrs["model"])
    found.attrs["model"] = json.dumps({**described, "by_wavelength": {"kappa": [[450.0, 0.1], [550.0, 0.2]]}})
    assert maps.model_at(of(found, pixel=[2, 3]), Workspace()).values["kappa"] == 0.1


def test_a_damaged_map_is_said_in_words():
    found = parameter_map()
    del found["status"].attrs["flag_meanings"]
    with pytest.raises(PbrdfError, match="does not say what the values of status mean"):
        of(found, variable="status").picture()
    with pytest.raises(PbrdfError, match="does not say of which model"):
        maps.model_at(of(parameter_map(model="?"), pixel=[0, 0]), Workspace())


def test_words_of_a_pixel():
    found = parameter_map()
    w = Workspace(maps=[("paint", found)])

    def told(at):
        return chosen_map(shown(w, pixel=list(at)), w).described_pixel(w)

    assert told((3, 2))["status"] == "The fit converged."
    assert told(ON_BOUND)["rows"][1]["note"] == "on its upper bound"
    assert told(STATES[-1])["status"] == "Nobody has fitted it yet."
    assert [row["written"] for row in told(STATES[PixelStatus.FAILED])["rows"]] == ["–", "–"]
    assert "did not converge" in told(STATES[PixelStatus.NOT_CONVERGED])["status"]


def test_a_map_that_is_being_filled_is_read_again():
    found = parameter_map(units_missing=1)
    workspace = Workspace(maps=[("paint", found)])
    chosen = chosen_map(shown(workspace, pixel=list(STATES[-1])), workspace)
    assert chosen.described_pixel(workspace)["status"] == "Nobody has fitted it yet."
    found["status"][STATES[-1]] = 0
    assert chosen.described_pixel(workspace)["status"] == "The fit converged."
    assert view.draw(shown(workspace), workspace, False)[0]["left"] == 1


def asked(workspace, **settings):
    """The answer to a page that asks for the chosen pixel."""
    answers = []
    request = {"type": "map_pixel", "id": 1, "state": shown(workspace, **settings).to_dict()}
    map_pixels.answer(request, [], workspace, lambda content, buffers: answers.append(content))
    return answers[0]


def test_the_pixels_model_and_its_data():
    found, data = parameter_map(), pixel_data()
    workspace = Workspace(maps=[("paint", found)], pictures=[("data", DatasetSource(data))])
    answer = asked(workspace, pixel=[3, 2])
    model = pbrdf.load_paint(made_maps.PAINT)
    expected = model.replace(
        sigma=float(found["estimate"].values[0, 3, 2]), n=float(found["estimate"].values[1, 3, 2])
    )
    assert answer["layer"] == {"name": "paint at y 3, x 2", "shown": True, **expected.to_dict()}
    assert answer["data"]["set"] == "paint at y 3, x 2" and answer["said"] == []
    state = shown(workspace).to_dict()
    state["settings"]["data"] = {"set": "paint at y 4, x 6"}
    # a state that names a pixel finds it, also before it was asked for
    points = chosen_data(read_state(state), workspace).measured.whole
    np.testing.assert_array_equal(points["I"], data["I"].isel(y=4, x=6))
    # a fit takes them
    assert job_of(read_state(state), workspace)["dataset"].identical(points)
    assert [name for name, _ in workspace.datasets] == ["paint at y 3, x 2", "paint at y 4, x 6"]
    for column in range(7):
        asked(workspace, pixel=[0, column])
        asked(workspace, pixel=[1, column])
        asked(workspace, pixel=[3, column])
    assert len(workspace.datasets) == map_pixels.MOST_PIXELS
    # of what was not measured the model alone, and the other way round
    nothing = asked(workspace, pixel=list(STATES[PixelStatus.MASKED]))
    assert nothing["layer"] is None and "no result" in nothing["said"][0]
    with pytest.raises(StateError, match=r"no result: .* Nothing was measured at this pixel"):
        asked(workspace, pixel=list(STATES[PixelStatus.NOT_MEASURED]))
    with pytest.raises(StateError, match="choose a pixel"):
        asked(workspace)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("paint at y 2, x 0", "Nothing was measured"),
        *((f"paint at {place}", "no data called") for place in ("y 3", "y 3, x 7", "y 3, parameter 1", "")),
        ("other at y 3, x 2", "no data called"),
        ("paint at " + "y 1, " * 200_000, "no data called"),
    ],
)
def test_states_that_name_no_pixel(name, words):
    workspace = Workspace(maps=[("paint", parameter_map())], pictures=[("data", DatasetSource(pixel_data()))])
    workspace.add_dataset("own", pbrdf.open_experiment(made_maps.PAINT))
    state = shown(workspace).to_dict()
    state["settings"]["data"] = {"set": name}
    with pytest.raises(StateError, match=words) as refused:
        chosen_data(read_state(state), workspace)
    assert refused.value.place == "settings.data.set"


def test_values_that_a_fit_leaves_out_are_left_out():
    data = pixel_data()
    data["I"][0, 3, 2] = np.inf
    data["I_std"][1, 3, 2] = 0.0
    wide = data["theta_r"].broadcast_like(data["I"]).transpose("geometry", "y", "x").copy()
    wide[2, 3, 2] = np.nan
    data = data.assign_coords(theta_r=wide)
    workspace = Workspace(maps=[("paint", parameter_map())], pictures=[("data", DatasetSource(data))])
    asked(workspace, pixel=[3, 2])
    one = workspace.datasets[0][1]
    assert one.sizes["geometry"] == data.sizes["geometry"] - 1
    assert np.isnan(one["I"].values[:2]).all() and np.isfinite(one["I"].values[2:]).all()


def stored(dataset, path):
    """The data as a file."""
    dataset = dataset.assign_attrs(illumination=[1.0, 0.0, 0.0, 0.0])
    for name in ("theta_i", "theta_r", "phi"):
        dataset[name].attrs["units"] = "rad"
    dataset["group"] = dataset["group"].astype(int)
    keep = [n for n in ("I", "I_std", "Q", "Q_std", "U", "U_std") if n in dataset]
    dataset[keep].to_netcdf(path, engine="h5netcdf")


@pytest.mark.slow
def test_data_are_found_where_the_map_says(tmp_path):
    from pbrdf.files.netcdf_files import write_netcdf_file

    stored(pixel_data(), tmp_path / "data.nc")
    told = MadeFrom.relative_to(tmp_path, [tmp_path / "data.nc"]).attribute
    write_netcdf_file(tmp_path / "paint.nc", {"/": parameter_map(**told)})
    workspace = Workspace()
    open_source(workspace, str(tmp_path / "paint.nc"))
    assert workspace.state()["settings"]["page"]["views"] == ["cuts", "map"]
    assert view.draw(shown(workspace, pixel=[3, 2]), workspace, False)[0]["no_data"] == ""
    name = asked(workspace, pixel=[3, 2])["data"]["set"]
    np.testing.assert_allclose(
        dict(workspace.datasets)[name]["I"].values, pixel_data()["I"].values[:, 3, 2], rtol=1e-12
    )
    # a map that was dropped on the page may name no file of this machine
    dropped = Workspace(maps=list(workspace.maps))
    answer = asked(dropped, pixel=[3, 2])
    assert answer["data"] is None and "not for one that was dropped" in answer["said"][0]
    assert "dropped" in view.draw(shown(dropped, pixel=[3, 2]), dropped, False)[0]["no_data"]
    # other data under that name
    found = workspace.maps[0][1]
    settings = {"input": {"files": [{"variables": {}, "size": 1, "digest": "0"}]}}
    other = Workspace(
        maps=[("paint.nc", found.assign_attrs(map_settings=json.dumps(settings)))],
        map_folders=[("paint.nc", tmp_path)],
    )
    assert "holds other data now" in asked(other, pixel=[3, 2])["said"][0]
    (tmp_path / "data.nc").unlink()
    gone = Workspace(maps=[("paint.nc", found)], map_folders=[("paint.nc", tmp_path)])
    assert re.search(
        r"cannot be opened: .*data\.nc: there is no such file", asked(gone, pixel=[3, 2])["said"][0]
    )


@pytest.mark.slow
def test_data_that_are_opened_beside_a_map(tmp_path):
    stored(pixel_data(), tmp_path / "data.nc")
    workspace = Workspace(maps=[("paint", parameter_map())])
    open_source(workspace, str(tmp_path / "data.nc"))
    assert [name for name, _ in workspace.pictures] == ["data.nc"] and not workspace.datasets
    assert asked(workspace, pixel=[3, 2])["data"]["set"] == "paint at y 3, x 2"
    # those of another image are not this map's
    other = Workspace(maps=[("paint", parameter_map((8, 9)))], pictures=workspace.pictures)
    refused = asked(other, pixel=[3, 2])
    assert refused["data"] is None and "does not say where its data are" in refused["said"][0]


def test_without_a_map():
    workspace = Workspace([("white", pbrdf.load_paint("white"))])
    assert view.draw(shown(workspace), workspace, False) == ({"maps": []}, [])
    with pytest.raises(StateError, match="no map is open"):
        maps.answer({"state": shown(workspace).to_dict()}, [], workspace, None)


@pytest.mark.slow
def test_data_of_other_places_are_not_shown_with_a_map():
    """Rows from the bottom beside a map with rows from the top."""
    rows = np.arange(SHAPE[0])
    found = parameter_map().assign_coords(y=rows)
    for y, there in ((rows, True), (rows[::-1], False)):
        data = DatasetSource(pixel_data().assign_coords(y=y))
        said = map_pixels.data_in_words(
            "paint", Workspace(maps=[("paint", found)], pictures=[("data", data)])
        )
        assert said == "" if there else said.startswith("What was measured here is not known")


def test_data_of_pixels_that_are_dropped_say_where_they_belong(tmp_path):
    from pbrdf.explorer.upload_process import _opened

    stored(pixel_data(), tmp_path / "data.nc")
    assert "opened beside their map: pbrdf explore MAP" in _opened(str(tmp_path / "data.nc"), {})


def test_maps_and_their_data_in_python():
    from pbrdf.explorer.explore import _add

    workspace = Workspace()
    _add(workspace, "paint", parameter_map())
    _add(workspace, None, pixel_data())
    _add(workspace, None, material_map())
    assert [name for name, _ in workspace.maps] == ["paint", "map"]
    assert asked(workspace, name="paint", pixel=[3, 2])["data"]["set"] == "paint at y 3, x 2"
