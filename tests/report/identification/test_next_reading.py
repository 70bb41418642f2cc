"""What to measure next: the sentence, the table, the numbers and the figure."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from pbrdf.identification.telling_apart import NextMeasurement
from pbrdf.instruments.goniometer.protocols import Protocol
from pbrdf.report.identification.folder import write_identification
from pbrdf.report.identification.next_reading import (
    NEXT_HEADINGS,
    next_figure,
    next_record,
    next_rows,
    next_sentence,
)
from pbrdf.report.identification.summary import summary_text
from pbrdf.report.numbers import plain


@pytest.fixture
def ranked():
    """Made by hand: the second geometry is a near copy of the first, the third on the side of the source."""
    angles = np.radians([[40.0, 41.0, 60.0], [45.5, 46.5, 20.0], [0.0, 0.0, 180.0]])
    protocol = Protocol(*angles, np.ones(3, int), np.full(3, np.nan))
    return NextMeasurement(
        materials=("white", "cd-back"),
        probability=np.array([0.5, 0.5]),
        geometries=protocol,
        information=np.array([0.8, 0.79, 0.1]),
        expected_right=np.array([0.97, 0.96, 0.6]),
        expected_left=np.array([1.2, 1.2, 1.9]),
        channels=("I", "Q", "U"),
        mean=np.ones((3, 2, 3)),
        std=np.ones((3, 2, 3)),
        noise=np.full((3, 2), 0.01),
    )


def test_the_sentence(ranked):
    assert next_sentence(ranked, 2) == (
        "Next measurement: I, Q, U at θi 40°, θr 45.5°, φ 0° would tell them apart best, by an expected 0.8 of the 1 "
        "bits that are open; of 2 candidates it would leave 1.2 on average."
    )
    little = replace(ranked, information=0.1 * ranked.information)
    assert next_sentence(little, 2).endswith("No single reading tells them apart well.")
    assert "of the 2 most probable candidates it would leave 1.2" in next_sentence(ranked, 5)
    many = replace(ranked, channels=("m00", "m01", "m10", "m11", "m22"))
    assert "m00 … m22 at θi" in next_sentence(many, 2)


def test_geometries_that_differ(ranked):
    rows = next_rows(ranked)
    assert [row[:3] for row in rows] == [["40°", "45.5°", "0°"], ["60°", "20°", "180°"]]
    assert rows[0][3:] == ["0.8 bits", "97 %", "1.2"]
    assert len(rows[0]) == len(NEXT_HEADINGS)


def test_the_record_is_plain_and_in_degrees(ranked):
    record = json.loads(json.dumps(plain(next_record(ranked, 2))))
    assert record["open_bits"] == pytest.approx(1.0)
    assert record["candidates"] == {"white": 0.5, "cd-back": 0.5}
    assert record["geometries"][1] == {
        "theta_i_degrees": 60.0, "theta_r_degrees": 20.0, "phi_degrees": 180.0, "expected_bits": 0.1,
        "expected_right": 0.6, "expected_left": 1.9,
    }  # fmt: skip


def test_the_figure_shows_all_geometries_and_what_was_measured(ranked, scattered):
    data = scattered.found.data
    figure = next_figure(ranked, data, "trial")
    ax = figure.axes[0]
    places = ax.collections[0].get_offsets()
    assert sorted(np.round(places[:, 1], 6)) == [-20.0, 45.5, 46.5]
    crosses, _, star = (line.get_xydata() for line in ax.lines)
    assert len(crosses) == len(data.theta_i)
    assert star == pytest.approx(np.array([[40.0, 45.5]]))


@pytest.mark.slow
def test_folder_and_text(ranked, scattered, tmp_path):
    report = replace(scattered, next_measurement=ranked)
    assert "would tell them apart best" in summary_text(report)
    files = write_identification(report, tmp_path / "out", figure_format="svg")
    assert "next.svg" in [path.name for path in files]
    page = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    assert "Which measurement would tell them apart" in page
    record = json.loads((tmp_path / "out" / "identification.json").read_text(encoding="utf-8"))
    assert record["next_measurement"]["sentence"] == next_sentence(ranked, len(scattered.found.materials))
    write_identification(scattered, tmp_path / "without", figure_format=None)
    assert "Which measurement" not in (tmp_path / "without" / "index.html").read_text(encoding="utf-8")
    assert "next_measurement" not in json.loads((tmp_path / "without" / "identification.json").read_text())
