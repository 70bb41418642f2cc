"""Exports: the numbers are the model's, and the commands make the same files."""

import json
import shlex
from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner

import pbrdf
from pbrdf.cli.main import app
from pbrdf.errors import PbrdfError
from pbrdf.explorer import exports
from pbrdf.explorer.catalogue import layer_of, state_of
from pbrdf.explorer.workspace import Workspace
from pbrdf.models.registry import find_model

GGX = find_model("ggx-lambert").from_values(
    {**{p.name: p.default for p in find_model("ggx-lambert").parameters}, "n": 1.6}
)


@pytest.fixture
def state(white):
    """A paint as it is and a model of another name, in partly linearly polarised light."""
    shown = [
        layer_of("matte-white-thick", white),
        layer_of("My model", GGX),
    ]
    return {**state_of(shown), "light": {"theta_i": 42.5, "stokes": [1.0, 0.3, 0.4, 0.0]}}


def made(state, what, kind="png", workspace=None):
    return exports.export({"state": state, "what": what, "format": kind}, workspace or Workspace())


def save_models(state, folder):
    for i in range(len(state["layers"])):
        saved = made({**state, "active": i}, "model", "json")
        (folder / saved.name).write_bytes(saved.content)


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Run a command line in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def start(command):
        name, *words = shlex.split(command)
        assert name == "pbrdf"
        result = CliRunner().invoke(app, words)
        assert result.exit_code == 0, result.output

    return start


@pytest.mark.parametrize(("what", "count"), [("plane", 171), ("directions", 18 * 25)])
@pytest.mark.parametrize("part", ["total", "diffuse"])
def test_tables_hold_what_the_model_says(state, tmp_path, what, count, part):
    found = made({**state, "active": 1, "part": part}, what)
    assert found.name == f"my-model-{what}.csv"
    (tmp_path / "table.csv").write_bytes(found.content)
    dataset = pbrdf.read(tmp_path / "table.csv")
    assert dataset.sizes["geometry"] == count
    assert tuple(dataset.attrs["illumination"]) == (1.0, 0.3, 0.4, 0.0)
    angles = [dataset[name].values for name in ("theta_i", "theta_r", "phi")]
    np.testing.assert_allclose(np.rad2deg(angles[0]), 42.5)
    expected = GGX.stokes(*angles, incident=(1.0, 0.3, 0.4, 0.0), part=part)
    for i, name in enumerate("IQUV"):
        np.testing.assert_allclose(dataset[name].values, expected[:, i], rtol=1e-12, atol=1e-15)
    assert (found.command is None) == (part == "diffuse")


@pytest.mark.parametrize("what", ["plane", "directions"])
def test_the_command_writes_the_same_table(state, tmp_path, run, what):
    state["active"] = 1
    save_models(state, tmp_path)
    found = made(state, what)
    run(found.command)
    assert (tmp_path / found.name).read_bytes() == found.content


@pytest.mark.slow
@pytest.mark.parametrize(
    ("what", "kind"),
    [("overview", "pdf"), ("curves", "svg"), ("hemisphere", "png"), ("surface", "png"), ("mueller", "svg")],
)
def test_the_command_draws_the_same_figure(state, tmp_path, run, what, kind):
    state["active"] = 1
    save_models(state, tmp_path)
    found = made(state, what, kind)
    assert found.name == f"my-model-{what}.{kind}"
    run(found.command)
    assert (tmp_path / found.name).read_bytes() == found.content


@pytest.fixture
def measured(tmp_path):
    """A workspace with data whose file is beside the models'."""
    dataset = pbrdf.open_experiment("matte-white-thick")
    pbrdf.write(dataset, tmp_path / "paint.csv")
    return Workspace(datasets=[("paint.csv", pbrdf.read(tmp_path / "paint.csv"))])


@pytest.mark.slow
@pytest.mark.parametrize(("what", "kind"), [("curves", "svg"), ("hemisphere", "png"), ("mueller", "svg")])
def test_measured_data_are_in_the_figures(state, measured, tmp_path, run, what, kind):
    save_models(state, tmp_path)
    found = made(state, what, kind, measured)
    assert "paint.csv" in found.command
    assert ("in the light of the data" in found.note) == (what != "mueller")
    run(found.command)
    assert (tmp_path / found.name).read_bytes() == found.content


@pytest.mark.slow
def test_the_command_of_a_fit_fits_as_the_page_does(state, measured, tmp_path, run):
    state["settings"] = {
        "fit": {"starts": 2, "held": ["n", "t"], "free": ["kappa"]},
        "data": {"held_out": {"kind": "group", "values": ["3"]}, "off": [4]},
    }
    save_models(state, tmp_path)
    found = made(state, "fit", "", measured)
    assert found.content is None
    assert "switched off" in found.note
    n, t = (state["layers"][0]["parameters"][name] for name in ("n", "t"))
    words = [
        "paint.csv",
        "--model",
        "matte-white-thick.json",
        "--starts",
        "2",
        "--fix",
        f"n={n}",
        "--fix",
        f"t={t}",
    ]
    assert shlex.split(found.command)[2:] == [*words, "--free", "kappa", "--hold-out", "group=3"]
    run(f"{found.command} --no-figures --no-suggestions -o out")
    fitted = pbrdf.load_fit(tmp_path / "out")
    assert fitted.model.values["n"] == n


def test_data_of_a_fit_have_no_file_of_that_name(state):
    dataset = pbrdf.open_experiment("matte-white-thick")
    workspace = Workspace(datasets=[("paint-fit", dataset)])
    assert "is a fit" not in made(state, "fit", "", workspace).note
    workspace.fits.append(("paint-fit", SimpleNamespace(dataset=dataset)))
    assert "paint-fit is a fit: name the file" in made(state, "fit", "", workspace).note


def test_commands_name_paints_as_they_are_and_others_by_their_files(state):
    state["layers"].append(
        {**state["layers"][0], "parameters": {**state["layers"][0]["parameters"], "n": 1.5}}
    )
    command = made(state, "curves", "svg").command
    assert shlex.split(command)[2:5] == ["matte-white-thick", "my-model.json", "matte-white-thick-2.json"]


def test_what_is_left_out_is_said(state):
    assert "natural light" in made(state, "overview", "svg").note
    assert "not a part" in made({**state, "part": "specular"}, "curves", "svg").note
    assert "not their difference" in made({**state, "compare": 1}, "curves", "svg").note
    assert made(state, "curves", "svg").note == ""


@pytest.mark.parametrize(
    "request_",
    [
        {"what": "none"},
        {"what": "curves", "format": "exe"},
        {"what": ["curves"]},
        {"what": "plane", "theta_i": 90},
    ],
)
def test_what_cannot_be_made_is_refused(state, request_):
    state["light"]["theta_i"] = request_.get("theta_i", 30)
    with pytest.raises(PbrdfError):
        exports.export({"state": state, **request_}, Workspace())


def test_answers_come_as_messages(state):
    emitted = []
    for what in ("model", "none"):
        request = {"id": 3, "what": what, "state": state}
        exports.answer(
            request, [], Workspace(), lambda content, buffers: emitted.append((content, buffers))
        ).join(60)
    (content, [file]), (error, none) = emitted
    assert content["type"] == "exported" and content["name"] == "matte-white-thick.json"
    assert json.loads(file)["model"] == "double-gauss"
    assert error["type"] == "error" and error["about"] == "export" and none == []
