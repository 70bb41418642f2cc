"""The example files: each is what it says, and every command that it names takes it."""

from __future__ import annotations

import shlex

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

import pbrdf
from pbrdf.cli.main import app
from pbrdf.errors import DataError
from pbrdf.instruments.virtual.examples import EXAMPLES, write_example

#: What makes a command quick.
SMALLER = {
    "fit": "--starts 4 --no-figures --no-suggestions",
    "compare": "--starts 2 --vary 0 --no-figures",
    "map": "--starts 4 --no-figures",
    "reduce": "--no-pictures",
    "render": "--spp 16 --size 16x16",
}


def test_tables_are_the_bundled_experiment_in_few_digits(tmp_path):
    bundled = pbrdf.open_experiment("matte-white-thick")
    table = pbrdf.read(write_example("table", tmp_path))
    for name in ("theta_i", "theta_r", "phi", "I", "Q", "U", "I_std"):
        np.testing.assert_allclose(table[name], bundled[name], rtol=1e-4, atol=1e-4)
    assert table.attrs["quantity"] == "brdf" and table.attrs["simulated"] == 1
    ratios = pbrdf.read(write_example("ratios", tmp_path), column={"group": "position"})
    np.testing.assert_allclose(ratios["dolp"], np.hypot(bundled["Q"], bundled["U"]) / bundled["I"], rtol=1e-3)
    np.testing.assert_allclose(ratios["phi"], bundled["phi"], atol=1e-9)


def test_nothing_is_written_over(tmp_path):
    path = write_example("model", tmp_path)
    assert pbrdf.load_model(path) == pbrdf.load_paint("matte-white-thick-scene")
    path.write_text("mine")
    with pytest.raises(DataError, match="something of that name already"):
        write_example("model", tmp_path)
    assert path.read_text() == "mine"
    with pytest.raises(DataError, match="choose one of table, ratios"):
        write_example("nothing", tmp_path)


def test_labels_are_where_the_paints_are(tmp_path):
    folder = write_example("frames", tmp_path)
    labels = np.array(Image.open(folder / "labels.png"))
    frame = np.array(Image.open(next((folder / "frames").glob("*.png"))))
    assert labels.shape == frame.shape
    assert [(labels == number).sum() for number in (1, 2)] == [16, 16]
    assert frame[labels > 0].min() > frame[labels == 0].max()


def test_examples_are_small(tmp_path):
    for name in EXAMPLES:
        path = write_example(name, tmp_path)
        files = [path] if path.is_file() else [file for file in path.rglob("*") if file.is_file()]
        assert files and sum(file.stat().st_size for file in files) < 200_000


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
def test_every_command_that_an_example_names_takes_it(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    write_example(name, tmp_path)
    for command in EXAMPLES[name].commands:
        _, *words = shlex.split(command)
        if words[:2] != ["library", "add"]:
            words += shlex.split(SMALLER.get(words[0], ""))
        done = CliRunner().invoke(app, words)
        assert done.exit_code == 0, f"{command}\n{done.output}"
