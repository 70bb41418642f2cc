"""What stands for a model on the command line, and what does not."""

from __future__ import annotations

import numpy as np
import pytest

from pbrdf.cli.sources import open_model
from pbrdf.data import make_dataset, write
from pbrdf.data.formats.tensor_file import write_tensors
from pbrdf.data.paints import load_paint
from pbrdf.errors import PbrdfError
from pbrdf.inversion import fit
from pbrdf.models import load_model


@pytest.fixture
def table(tmp_path):
    axis = np.linspace(0.1, 0.5, 3, dtype=np.float32)[np.newaxis]
    path = tmp_path / "t.pbsdf"
    fields = {"theta_h": axis, "theta_d": axis, "phi_d": axis, "wvls": np.array([550], np.uint16)}
    write_tensors(fields | {"M": np.ones((3, 3, 3, 1, 4, 4), np.float32)}, path)
    return path


def test_a_table_of_measurements_is_no_model_and_the_step_between_is_named(table, tmp_path):
    with pytest.raises(
        PbrdfError,
        match=r"\.pbsdf tables are measurements, not models; fit them first \(pbrdf fit .*t\.pbsdf\)",
    ):
        open_model(str(table))
    nameless = table.rename(tmp_path / "out")
    with pytest.raises(PbrdfError, match="pbsdf tables are measurements, not models"):
        open_model(str(nameless))


@pytest.mark.parametrize("name", ["d.csv", "d.nc"])
def test_nor_is_a_data_set(tmp_path, name):
    write(make_dataset(0.5, 0.5, 0.0, quantity="brdf", I=[0.2]), tmp_path / name)
    with pytest.raises(PbrdfError, match="tables are measurements, not models; fit them first"):
        open_model(str(tmp_path / name))


@pytest.mark.slow
def test_of_parameters_by_group_the_first_are_told_to_be_taken(tmp_path, capsys):
    paint = load_paint("white")
    theta_r = np.tile(np.deg2rad(np.arange(0.0, 80.0, 8.0)), 2)
    group = np.repeat(["left", "right"], 10)
    stokes = np.asarray(paint.stokes(0.6, theta_r, 0.0)) * np.where(group == "left", 1.0, 0.5)[:, None]
    ds = make_dataset(
        0.6, theta_r, 0.0, quantity="brdf", I=stokes[:, 0], Q=stokes[:, 1], U=stokes[:, 2], group=group
    )
    held = {name: value for name, value in paint.values.items() if name != "a"}
    result = fit(ds, fix=held, split={"a": "group"}, starts=2)
    result.save(tmp_path / "f")
    assert open_model(str(tmp_path / "f")) == result.model
    assert "a of its own in each group: this is the model of the first, left" in capsys.readouterr().err


def test_a_file_that_is_no_text_is_answered_without_a_codec(table):
    with pytest.raises(PbrdfError, match="not a text file, so not a model") as raised:
        load_model(table)
    assert "codec" not in str(raised.value)
