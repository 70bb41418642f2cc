"""Maps of materials, reliability and confusion: figures, pages and words."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from figure_helpers import legend
from matplotlib.colors import to_hex

from pbrdf.identification.conformal import calibrate
from pbrdf.identification.confusion import table_of
from pbrdf.identification.cross_check import cross_checked
from pbrdf.identification.labelled_pixels import judge_pixels
from pbrdf.identification.library import Library, bundled_library
from pbrdf.report.identification.calibrated import (
    Calibrated,
    calibration_rests_on,
)
from pbrdf.report.identification.calibration_figure import confusion_figure, reliability_figure
from pbrdf.report.identification.class_figure import class_counts, class_figure
from pbrdf.report.identification.classified import Classified, class_rows, classes_sentence
from pbrdf.report.identification.confusion_table import level_of_sets
from pbrdf.report.identification.folder import write_calibration, write_classes
from pbrdf.report.identification.subject import fewest_needed
from pbrdf.report.identification.summary import summary_text

LIBRARY = bundled_library()


def mapped(material, names=LIBRARY.names):
    """A map with these numbers of materials, all known with 90 %."""
    material = np.asarray(material, dtype=np.int16)
    dims = ("y", "x")[-material.ndim :]
    confidence = np.where(material >= 0, 0.9, np.nan).astype(np.float32)
    by_name = ("material_name", *dims)
    inside = material[None] == np.arange(len(names)).reshape(-1, *(1,) * material.ndim)
    return xr.Dataset(
        {
            "material": (dims, material),
            "confidence": (dims, confidence),
            "in_set": (by_name, inside),
            "probability": (by_name, np.where(inside, 0.9, 0.025).astype(np.float32)),
        },
        coords={"material_name": list(names)},
        attrs={"confidence": 0.95, "calibration": "none", "smoothing": 0.0},
    )


@pytest.fixture
def picture():
    return mapped([[0, 0, 0, 1], [-1, -1, 4, -2]])


@pytest.fixture(scope="module")
def calibrated():
    truth = np.repeat(np.arange(5), 30)
    x = 2.0 * truth + np.random.default_rng(1).standard_normal(truth.size)
    distance = (x[:, None] - 2.0 * np.arange(5)) ** 2
    evidence = -0.5 * distance, np.exp(-0.5 * distance), truth
    made = Library(LIBRARY.materials, calibrate(LIBRARY.names, *evidence, "a trial"))
    probability, p_value = cross_checked(LIBRARY.names, *evidence)
    table = table_of(LIBRARY.names, truth, probability, p_value > 0.05, 0.95)
    return Calibrated(made, table, "labels.csv", "out/library.json")


def test_pixels_are_counted(picture):
    counts = {count.name: count for count in class_counts(picture)}
    assert {name: count.pixels for name, count in counts.items() if count.pixels} == {
        "white": 3, "matte-white-thin": 1, "cd-back": 1, "none of these": 2, "not measured": 1,
    }  # fmt: skip
    assert counts["white"].confidence == pytest.approx(0.9)
    assert np.isnan(counts["none of these"].confidence)
    report = Classified(picture, "map.nc", LIBRARY, "the bundled paints")
    assert classes_sentence(report).startswith("of 7 measured pixels white 43 %")
    assert classes_sentence(report).endswith("none of these 29 %; 1 more were not measured")
    assert [row[2] for row in class_rows(report) if row[1] != "0"] == ["43 %", "14 %", "14 %", "29 %", "–"]
    nothing = Classified(mapped([[-2, -2]]), "map.nc", LIBRARY, "the bundled paints")
    assert classes_sentence(nothing) == "no pixel was measured"


def test_colours_of_the_map_are_those_of_the_legend(picture):
    figure = class_figure(picture, "map")
    assert legend(figure)[0] == "white: 3 (43 %)"
    assert "none of these: 2 (29 %)" in legend(figure)
    (image,) = figure.axes[0].get_images()
    shown = image.cmap(image.norm(np.asarray(image.get_array())))
    by_name = {
        text.get_text().split(":")[0]: to_hex(patch.get_facecolor())
        for text, patch in zip(figure.legends[0].get_texts(), figure.legends[0].get_patches(), strict=True)
    }
    assert to_hex(shown[0, 0]) == by_name["white"]
    assert to_hex(shown[1, 0]) == by_name["none of these"]
    assert to_hex(shown[1, 2]) == by_name["cd-back"]
    assert to_hex(shown[1, 3]) == by_name["not measured"]
    assert len(set(by_name.values())) == len(by_name)


def test_many_materials_a_line_and_a_large_map():
    many = [f"m{i}" for i in range(20)]
    figure = class_figure(mapped(np.arange(20).reshape(4, 5), many), "many")
    colours = [to_hex(p.get_facecolor()) for p in figure.legends[0].get_patches()]
    assert len(set(colours)) == 20
    assert class_figure(mapped([0, 1, -1, -2]), "line").axes[0].get_images()[0].get_array().shape == (1, 4)
    large = class_figure(mapped(np.zeros((3, 1500), dtype=int)), "large")
    assert large.axes[0].get_images()[0].get_array().shape == (3, 500)
    assert large.axes[0].get_xlabel() == "x (every 3. pixel)"
    assert legend(large)[0] == "white: 4500 (100 %)"


@pytest.mark.slow
def test_the_folder_of_a_map(picture, tmp_path):
    report = Classified(picture, "map.nc", LIBRARY, "the bundled paints", True, True, {"white": 0.5})
    files = write_classes(report, tmp_path / "out")
    assert [f.name for f in files] == [
        "index.html",
        "summary.txt",
        "classes.json",
        "materials.nc",
        "classes.png",
    ]
    with xr.open_dataset(tmp_path / "out" / "materials.nc", engine="h5netcdf") as found:
        assert np.array_equal(found["material"].values, picture["material"].values)
        assert found["in_set"].dtype == np.int8
    page = files[0].read_text(encoding="utf-8")
    assert "which material is where?" in page
    assert "a common factor of each pixel" in page
    assert "Simulated data, not measured." in page
    assert "white 50 %, the others share the rest" in page


@pytest.mark.slow
def test_a_map_against_its_labels(picture, tmp_path):
    truth = xr.DataArray(
        [["white", "white", "white", ""], ["white", "cd-back", "cd-back", "white"]], dims=("y", "x")
    )
    table = judge_pixels(picture, truth)
    report = Classified(picture, "map.nc", LIBRARY, "the bundled paints", labelled=table, labels="truth.npy")
    files = write_classes(report, tmp_path / "out", figure_format="svg")
    assert {"confusion.svg", "reliability.svg"} <= {f.name for f in files}
    record = json.loads((tmp_path / "out" / "classes.json").read_text(encoding="utf-8"))
    assert record["labelled"]["labels"] == "truth.npy"
    assert np.sum(record["labelled"]["confusion"]) == 6
    assert "of 6 labelled pixels" in files[0].read_text(encoding="utf-8")
    assert "truth.npy: of 6 labelled pixels" in summary_text(report)


def test_reliability(calibrated):
    found = calibrated.table.reliability
    figure = reliability_figure(found, "trial")
    upper, lower = figure.axes
    assert f"error {found.error:.3f}" in upper.get_title()
    heights = [patch.get_height() for patch in lower.patches]
    assert sum(heights) == 150
    (points,) = [c.lines[0] for c in upper.containers if c.get_label() == "found"]
    assert np.array_equal(points.get_ydata(), found.accuracy[found.count > 0])


def test_confusion(calibrated):
    figure = confusion_figure(calibrated.table, "trial")
    ax = figure.axes[0]
    matrix = calibrated.table.counts
    written = {tuple(map(int, text.get_position()[::-1])): int(text.get_text()) for text in ax.texts}
    assert written == {place: int(n) for place, n in np.ndenumerate(matrix) if n}
    assert [t.get_text() for t in ax.get_xticklabels()] == [*LIBRARY.names, "none of these"]


@pytest.mark.slow
def test_the_folder_of_a_calibration(calibrated, tmp_path):
    files = write_calibration(calibrated, tmp_path / "out", with_library=True, figure_format="svg")
    assert [f.name for f in files] == [
        "index.html", "summary.txt", "calibration.json", "library.json", "confusion.svg", "reliability.svg",
    ]  # fmt: skip
    record = json.loads((tmp_path / "out" / "calibration.json").read_text(encoding="utf-8"))
    assert np.sum(record["confusion"]) == 150
    assert "of 150 labelled measurements" in summary_text(calibrated)


def test_few_measurements_exclude_nothing(calibrated):
    """A p-value is at least 1/(n + 1)."""
    assert fewest_needed(0.95) == 19
    assert fewest_needed(0.9) == 9
    assert not any("Too few" in line for line in calibration_rests_on(calibrated))
    assert calibrated.library.calibration.p_values(np.zeros((1, 5))).max() <= 1.0 / 31.0 + 1e-12


def test_a_promise_that_is_not_kept_shows(calibrated):
    assert level_of_sets(calibrated.table) == "describes"
    broken = replace(calibrated.table, coverage=np.full(5, 0.8))
    assert level_of_sets(broken) == "not"
