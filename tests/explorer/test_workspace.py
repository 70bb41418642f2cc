"""What is open: sources by what they are, names that are free, the state to begin with."""

from types import SimpleNamespace

import numpy as np
import pytest

import pbrdf
from pbrdf.errors import PbrdfError
from pbrdf.explorer.opening import is_map, open_source
from pbrdf.explorer.state import read_state
from pbrdf.explorer.workspace import MOST_OPEN, Workspace, beginning


@pytest.fixture
def workspace():
    return Workspace()


@pytest.fixture
def experiment():
    return pbrdf.open_experiment("white")


def test_nothing_is_the_empty_state(workspace):
    assert workspace.state() is None


def test_the_model_of_a_fit_of_several_wavelengths_is_called_by_its_own(workspace, experiment, white):
    alone = SimpleNamespace(model=white, models={}, dataset=experiment)
    workspace.add_fit("one", alone)
    workspace.add_fit("three", SimpleNamespace(**{**vars(alone), "models": {450.0: white, 550.0: white}}))
    assert [name for name, _ in workspace.models] == ["one", "three at 450 nm"]
    assert [name for name, _ in workspace.datasets] == ["one", "three"]


def test_a_paint_and_a_model_file(workspace, white, tmp_path):
    white.to_json(tmp_path / "mine.json")
    (tmp_path / "white").mkdir()
    white.to_json(tmp_path / "white" / "model.json")
    for source in ("pearl-white", tmp_path / "mine.json", tmp_path / "white"):
        open_source(workspace, str(source))
    assert [name for name, _ in workspace.models] == ["pearl-white", "mine", "white"]
    assert workspace.models[1][1] == white
    shown = read_state(workspace.state())
    assert [layer.model for layer in shown.layers] == [pbrdf.load_paint("pearl-white"), white, white]


def test_data_are_read_as_the_caller_says(workspace, experiment, tmp_path):
    asked = []
    (tmp_path / "x.csv").write_text("")
    open_source(workspace, str(tmp_path / "x.csv"), lambda path: asked.append(path) or experiment)
    assert asked == [str(tmp_path / "x.csv")]
    assert [name for name, _ in workspace.datasets] == ["x.csv"]


def test_data_alone_begin_under_a_model(workspace, experiment):
    """At an angle of incidence that was measured, with values a fit begins in the midst of."""
    workspace.add_dataset("paint", experiment)
    state = read_state(workspace.state())
    assert len(state.layers) == 1
    assert np.rad2deg(experiment["theta_i"].values) == pytest.approx(state.light.theta_i, abs=90)
    nearest = np.abs(np.rad2deg(experiment["theta_i"].values) - state.light.theta_i).min()
    assert nearest < 2e-3


def test_what_was_measured_is_drawn_first(workspace, white):
    angles = np.deg2rad([[20.0, 40.0], [30.0, 50.0], [0.0, 0.0]])
    ratios = np.full((2, 4, 4), np.nan)
    M = white.mueller(*angles)
    ratios[:, 2, 2], ratios[:, 0, 1] = M[:, 2, 2] / M[:, 0, 0], M[:, 0, 1] / M[:, 0, 0]
    workspace.add_dataset("ratios", pbrdf.make_dataset(*angles, mueller_over_m00=ratios))
    assert workspace.state()["quantities"] == ["m01", "m22"]


def test_the_light_begins_at_a_measured_angle():
    angles = np.deg2rad([[20.0, 20.0, 50.0, 60.0], [30.0, 50.0, 30.0, 50.0], [0.0, 0.0, 0.0, 0.0]])
    assert beginning(pbrdf.make_dataset(*angles, quantity="brdf", I=np.ones(4))) == {
        "theta_i": 20.0,
        "quantities": [],
    }
    ratios = {"Q_over_I": np.zeros(4), "V_over_I": np.zeros(4)}
    assert beginning(pbrdf.make_dataset(*angles, **ratios))["quantities"] == ["q", "v"]


@pytest.mark.slow
def test_a_fit_brings_its_model_and_its_data(workspace, experiment, tmp_path):
    result = pbrdf.fit(experiment, starts=1)
    result.save(tmp_path / "paint-fit")
    open_source(workspace, str(tmp_path / "paint-fit"))
    assert [
        [name for name, _ in kind] for kind in (workspace.models, workspace.datasets, workspace.fits)
    ] == [["paint-fit"]] * 3
    assert workspace.models[0][1] == result.model
    assert workspace.datasets[0][1].identical(result.dataset)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["map.nc", "map.zarr"])
def test_a_map_is_told_from_data(workspace, experiment, tmp_path, name, monkeypatch):
    from pbrdf.files.netcdf_files import write_netcdf_file

    found = pbrdf.fit_map(experiment.isel(geometry=slice(0, 21)).expand_dims(x=2), starts=1)
    assert is_map(found) and not is_map(experiment)
    if name == "map.nc":
        write_netcdf_file(tmp_path / name, {"/": found})
    else:
        # how stores are made is not of interest here
        (tmp_path / name).mkdir()
        monkeypatch.setattr("pbrdf.inversion.map_store.is_map", lambda path: path.name == name)
        monkeypatch.setattr("pbrdf.inversion.map_store.open_map", lambda path, partial: found)
    open_source(workspace, str(tmp_path / name))
    ((opened, stored),) = workspace.maps
    assert opened == name
    np.testing.assert_array_equal(stored["estimate"], found["estimate"])
    pbrdf.write(experiment, tmp_path / "data.nc")
    open_source(workspace, str(tmp_path / "data.nc"))
    assert [name for name, _ in workspace.datasets] == ["data.nc"]


def test_names_are_those_of_no_others(workspace, experiment, white):
    assert [workspace.add_dataset("x", experiment) for _ in range(3)] == ["x", "x (2)", "x (3)"]
    workspace.add_model("x", white)
    workspace.add_model("x", white)
    assert [name for name, _ in workspace.models] == ["x", "x (2)"]


def test_a_page_that_is_loaded_again_has_what_was_opened(workspace, experiment):
    first, again = workspace.again(), workspace.again()
    first.add_dataset("dropped", experiment)
    first.close()
    assert [name for name, _ in again.datasets] == ["dropped"]
    assert first.at_close is not again.at_close


def test_what_cannot_be_opened_is_said(workspace, experiment, white, tmp_path):
    (tmp_path / "empty").mkdir()
    for source, words in (
        ("nothing", "there is no such file, and no paint of that name: white,"),
        ("nothing.csv", "nothing.csv: there is no such file$"),
        (str(tmp_path / "empty"), "this is a folder"),
    ):
        with pytest.raises(PbrdfError, match=words):
            open_source(workspace, source)
    values = {**white.values, white.parameters[0].name: np.array([0.02, 0.03])}
    with pytest.raises(PbrdfError, match="its parameters are arrays"):
        workspace.add_model("map", type(white).from_values(values))
    for number in range(6):
        workspace.add_model(str(number), white)
    with pytest.raises(PbrdfError, match="6 models at once"):
        workspace.add_model("7", white)
    workspace.datasets += [("x", experiment)] * MOST_OPEN
    with pytest.raises(PbrdfError, match="64 data sets are open"):
        workspace.add_dataset("x", experiment)
