import json
import math
from dataclasses import asdict

import numpy as np
import pytest
import xarray as xr

import pbrdf
from pbrdf.errors import DataError, PbrdfError
from pbrdf.report.fit import folder as module
from pbrdf.report.fit.folder import (
    comparison_file,
    fit_record,
    write_report,
)
from pbrdf.report.numbers import plain

NUMBERS = {"index.html", "summary.txt", "model.json", "fit.json", "comparison.nc", "fit.nc"}
NAMES = NUMBERS | {"figure.png", "polarisation.png", "starts.png"}


@pytest.fixture(scope="module")
def folder(report, tmp_path_factory):
    """The report written once."""
    target = tmp_path_factory.mktemp("report") / "fit"
    written = write_report(report, target)
    assert {path.name for path in written} == NAMES
    return target


@pytest.mark.slow
def test_the_folder_holds_everything_and_nothing_else(folder):
    assert {path.name for path in folder.iterdir()} == NAMES
    assert [path.name for path in folder.parent.iterdir()] == ["fit"]


def test_the_model_reads_back(folder, report):
    assert pbrdf.load_model(folder / "model.json") == report.result.model


def test_the_record_has_the_numbers_of_the_result(folder, report):
    text = (folder / "fit.json").read_text(encoding="utf-8")
    assert "NaN" not in text
    record = json.loads(text)
    result = report.result
    assert record == fit_record(report)
    for name, estimate in result.estimates.items():
        stored = record["estimates"][name]
        assert stored["value"] == estimate.value
        assert stored["standard_error"] == (None if math.isnan(estimate.std) else estimate.std)
        assert stored["verdict"] == estimate.verdict
    assert record["correlation"]["matrix"] == result.correlation.values.tolist()
    assert record["goodness"]["chi2"] == result.goodness.chi2
    assert record["optima"][0] == asdict(result.optima[0])
    assert record["predicted_errors"]["off-specular"] == plain(asdict(result.predicted["off-specular"]))
    assert record["hold_out"] == "group=3"
    assert record["data"]["held_out_geometries"] == 21
    assert record["settings"]["starts"] == 8
    assert record["uncertainties_from_data"] is True


@pytest.mark.slow
def test_the_comparison_is_in_degrees_and_explains_itself(folder, report):
    with xr.open_dataset(folder / "comparison.nc", engine="h5netcdf") as stored:
        expected = report.result.comparison
        for name in ("theta_i", "theta_r", "phi", "facet_tilt"):
            assert stored[name].attrs["units"] == "degree"
            np.testing.assert_allclose(np.deg2rad(stored[name].values), expected[name].values, atol=1e-12)
        np.testing.assert_array_equal(stored["I_residual"], stored["I_modelled"] - stored["I_measured"])
        np.testing.assert_array_equal(stored["held_out"].values.astype(bool), expected["held_out"].values)
        assert stored.attrs["hold_out"] == "group=3"
        assert pbrdf.load_model(json.loads(stored.attrs["model"])) == report.result.model
        assert pbrdf.__version__ in stored.attrs["source"]


def test_the_comparison_leaves_the_result_alone(report):
    before = report.result.comparison.copy(deep=True)
    comparison_file(report)
    xr.testing.assert_identical(report.result.comparison, before)


@pytest.mark.slow
def test_figures_come_in_every_format_that_is_asked_for(hemisphere_report, tmp_path):
    written = write_report(hemisphere_report, tmp_path / "fit", figure_format="png, pdf")
    figures = {f"{name}.{kind}" for name in ("figure", "hemisphere", "starts") for kind in ("png", "pdf")}
    assert {path.name for path in written} == NUMBERS | figures
    assert all(path.is_file() for path in written)


@pytest.mark.parametrize("text", ["gif", "png,gif", ""])
def test_an_unknown_format_is_refused_before_anything_is_written(report, tmp_path, text):
    with pytest.raises(PbrdfError, match="choose one of png, pdf, svg"):
        write_report(report, tmp_path / "fit", figure_format=text)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_without_figures_the_page_says_so(report, tmp_path):
    written = write_report(report, tmp_path / "fit", figures=False)
    assert {path.name for path in written} == NUMBERS
    text = (tmp_path / "fit" / "index.html").read_text(encoding="utf-8")
    assert "<svg" not in text and "No figures were drawn" in text


@pytest.mark.slow
def test_other_files_of_a_folder_are_left_alone(report, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "fit.json").write_text("old")
    write_report(report, tmp_path, figure_format="svg")
    assert (tmp_path / "notes.txt").read_text() == "mine"
    assert json.loads((tmp_path / "fit.json").read_text())["hold_out"] == "group=3"
    assert (tmp_path / "figure.svg").read_text().startswith("<?xml")


def test_a_failure_leaves_nothing_behind(report, tmp_path, monkeypatch):
    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(module, "comparison_file", fail)
    with pytest.raises(DataError, match="fit: cannot be written: No space left"):
        write_report(report, tmp_path / "fit")
    assert list(tmp_path.iterdir()) == []
