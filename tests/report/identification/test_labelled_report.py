"""Labelled measurements and pixels in words, tables and pages; fitted parameters in a figure."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import pbrdf
from pbrdf.identification.conformal import Calibration
from pbrdf.identification.confusion import table_of
from pbrdf.identification.fitted_parameters import FittedParameters
from pbrdf.identification.identify_fit import identify_fit
from pbrdf.identification.library import Library, bundled_library
from pbrdf.report.identification.calibration_figure import confusion_figure
from pbrdf.report.identification.confusion_table import (
    confusion_headings,
    confusion_record,
    confusion_rows,
    confusion_sentence,
    level_of_sets,
)
from pbrdf.report.identification.folder import write_identification, write_labelled
from pbrdf.report.identification.labelled import LabelledReport, labels_rest_on
from pbrdf.report.identification.parameters_figure import parameters_figure
from pbrdf.report.identification.subject import Identified, rests_on
from pbrdf.report.identification.summary import summary_text
from pbrdf.report.numbers import plain

LIBRARY = bundled_library()


@pytest.fixture
def table():
    """Four of the first two materials, told as itself, as the other, as none; two of a stranger."""
    truth = np.array([0, 0, 0, 1, 5, 5])
    probability = np.full((6, 5), 0.02)
    inside = np.zeros((6, 5), dtype=bool)
    for row, best in enumerate([0, 1, 0, 1, 3, 3]):
        probability[row, best] = 0.92
        inside[row, best] = row not in (2, 5)
    return table_of(LIBRARY.names, truth, probability, inside, 0.95, ["gloss"])


def test_rows(table):
    assert confusion_headings("pixels")[1] == "pixels"
    assert confusion_rows(table) == [
        ["white", "3", "1", "1", "1", "33 %"],
        ["matte-white-thin", "1", "1", "0", "0", "100 %"],
        ["gloss (not in the library)", "2", "–", "1", "1", "–"],
    ]


def test_the_sentence(table):
    assert confusion_sentence(table, "pixels") == (
        "of 4 labelled pixels the 95 % set held the true material for 50.0 %; the most probable was right for 75.0 %; "
        "expected calibration error 0.170; of 2 labelled pixels of materials that the library has not got 1 were told "
        "as none"
    )
    assert level_of_sets(table) == "not"
    strangers = table_of(
        LIBRARY.names, np.array([5]), np.full((1, 5), 0.2), np.zeros((1, 5), bool), 0.95, ["x"]
    )
    assert confusion_sentence(strangers, "pixels").startswith("of 1 labelled pixels of materials that")
    assert level_of_sets(strangers) == "in part"
    json.dumps(plain(confusion_record(strangers)), allow_nan=False)


def test_the_confusion_has_a_row_for_the_stranger(table):
    ax = confusion_figure(table, "trial").axes[0]
    assert [t.get_text() for t in ax.get_yticklabels()] == ["white", "matte-white-thin", "gloss"]
    assert [t.get_text() for t in ax.get_xticklabels()] == [*LIBRARY.names, "none of these"]


def test_what_it_rests_on(table):
    report = LabelledReport(table, "others.csv", LIBRARY, "paints.json")
    lines = labels_rest_on(report)
    assert "left unchanged" in lines[0]
    assert not any("flatter" in line for line in lines)
    own = Calibration(tuple(LIBRARY.names), (np.linspace(0.1, 1.0, 20),) * 5)
    calibrated = Library(LIBRARY.materials, own)
    assert any("flatter" in line for line in labels_rest_on(replace(report, materials=calibrated)))


@pytest.mark.slow
def test_the_folder(table, tmp_path):
    report = LabelledReport(
        table, "others.csv", LIBRARY, "paints.json", command="pbrdf identify --labelled others.csv"
    )
    files = write_labelled(report, tmp_path / "out", figure_format="svg")
    assert [f.name for f in files] == [
        "index.html", "summary.txt", "labelled.json", "confusion.svg", "reliability.svg",
    ]  # fmt: skip
    record = json.loads((tmp_path / "out" / "labelled.json").read_text(encoding="utf-8"))
    assert record["confusion"] == table.counts.tolist()
    assert record["in_library"] == [True, True, False]
    assert record["expected_calibration_error"] == pytest.approx(0.17)
    page = files[0].read_text(encoding="utf-8")
    assert "others.csv: judged by paints.json" in page
    assert "Which material was told as which" in page
    assert "of 4 labelled measurements" in summary_text(report)


@pytest.fixture
def fitted():
    paint = pbrdf.load_paint("white")
    names = tuple(p.name for p in paint.parameters if p.fitted)
    values = np.array([paint.values[name] for name in names])
    error = 0.01 * values
    error[1] = np.nan
    one = FittedParameters(paint, names, values, error, np.eye(len(names)), data="panel 4")
    return Identified(identify_fit(one, LIBRARY), None, "panel-fit", "the bundled paints", fitted=one)


def test_the_figure_of_fitted_parameters(fitted):
    figure = parameters_figure(fitted.found, fitted.fitted, "trial")
    assert [ax.get_xlabel() for ax in figure.axes] == list(fitted.fitted.names)
    for ax, value in zip(figure.axes, fitted.fitted.estimate, strict=True):
        assert ax.lines[-1].get_xdata() == pytest.approx([value, value])
        assert len(ax.patches) == 5 + (ax is not figure.axes[1])  # a band where the fit determines it
    bar = figure.axes[0].patches[0]
    material = LIBRARY["white"]
    half = 1.959964 * np.sqrt(material.covariance[0, 0])
    assert bar.get_x() == pytest.approx(np.exp(material.mean[0] - half), rel=1e-4)


@pytest.mark.slow
def test_the_folder_of_fitted_parameters(fitted, tmp_path):
    files = write_identification(fitted, tmp_path / "out", figure_format="svg")
    assert "parameters.svg" in [f.name for f in files]
    page = files[0].read_text(encoding="utf-8")
    assert "What was fitted" in page and "panel 4" in page
    assert any("From fitted parameters" in line for line in rests_on(fitted))
    assert "panel-fit: white" in summary_text(fitted)
