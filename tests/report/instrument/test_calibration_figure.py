"""The picture and the numbers of a calibration show its errors."""

from __future__ import annotations

import numpy as np
import pytest

from pbrdf.instruments.calibration.analyzer_calibration import standard_inputs
from pbrdf.instruments.calibration.input_table import InputTable
from pbrdf.instruments.calibration.instrument_calibration import calibrate_instrument
from pbrdf.instruments.frames.frames import ArrayFrames
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.polarimeter.polarimeter import lcvr, rotating_polarizer
from pbrdf.instruments.polarimeter.retardance_sets import retardance_set
from pbrdf.instruments.virtual.miscalibration import miscalibrated
from pbrdf.report.instrument.calibration_figure import calibration_figure
from pbrdf.report.instrument.calibration_summary import angle_errors, print_calibration

DETECTOR = Detector(bits=14, gain=2.0, read_noise=5.0, offset=60.0)
NAMES = tuple(f"{k:02d}" for k in range(14))


def calibration(nominal, truth, count, **options):
    """A calibration with the first inputs of the standard ones."""
    S = standard_inputs(12)[:, :count]
    signal = truth.intensities(6000.0 * S).T[..., None, None]
    raw = DETECTOR.expose(np.broadcast_to(signal, (*signal.shape[:2], 8, 10)), np.random.default_rng(0))
    inputs = InputTable(NAMES[:count], S)
    return calibrate_instrument(
        ArrayFrames(raw, NAMES[:count]), Instrument(nominal, DETECTOR), inputs, **options
    )


@pytest.fixture(scope="module")
def made():
    nominal = lcvr(retardance_set("tetrahedron"))
    truth = miscalibrated(nominal, 0.02, 0.05, np.random.default_rng(1))
    return calibration(nominal, truth, 14), calibration(
        nominal, truth, 14, cells=(2, 5), held_out=["03", "12"]
    )


def points(ax, start):
    (line,) = [line for line in ax.lines if str(line.get_label()).startswith(start)]
    return np.column_stack(line.get_data()), str(line.get_label())


def test_errors_are_drawn_magnified_from_the_known_light(made):
    figure = calibration_figure(made[0], "imager")
    S = made[0].inputs.stokes
    linear, circular = figure.subfigs[0].axes[:2]
    for ax, parts in ((linear, [1, 2]), (circular, [1, 3])):
        known, _ = points(ax, "known")
        np.testing.assert_allclose(known, (S[parts] / S[0]).T, atol=1e-12)
        for start, found in (("nominal", made[0].nominal_found), ("calibrated", made[0].calibration.found)):
            ends, label = points(ax, start)
            factor = float(label.rpartition("×")[2])
            np.testing.assert_allclose(
                ends, known + factor * ((found[parts] / found[0]).T - known), atol=1e-12
            )
    assert linear.get_xlabel() == "Q/I" and linear.get_ylabel() == "U/I"
    assert circular.get_ylabel() == "V/I (> 0: left circular)"
    assert "imager: rms error at inputs held out: linear" in figure.get_suptitle()


def test_a_map_shows_where_it_is_how_good(made):
    figure = calibration_figure(made[1], "imager")
    shown = [ax for ax in figure.subfigs[1].axes if ax.images]
    assert [ax.get_title() for ax in shown] == [
        "condition number, 2-norm", "rms error of Q/I and U/I (%)", "rms error of V/I (%)",
    ]  # fmt: skip
    assert all(ax.images[0].get_array().shape == (2, 5) for ax in shown)
    # rms over the cells is the accuracy
    values = np.asarray(shown[1].images[0].get_array())
    assert np.sqrt(np.mean(values**2)) == pytest.approx(100 * made[1].calibration.accuracy.linear)
    labels = [tick.get_text() for tick in figure.subfigs[0].axes[-1].get_xticklabels()]
    assert labels[3] == "03" and labels[4] == "04 *"


@pytest.mark.slow
def test_without_v_there_is_no_circular_panel():
    nominal = rotating_polarizer(np.deg2rad([0, 45, 90, 135]))
    found = calibration(nominal, nominal, 12)
    figure = calibration_figure(found, "camera")
    assert [ax.get_ylabel() for ax in figure.subfigs[0].axes] == ["U/I", "DoLP", "AoLP (°)"]


def test_angle_errors_are_the_short_way_round():
    """From −89° to 89° it is 2°, not 178°; light without linear polarisation has no angle."""

    def light(degrees):
        return np.array([[1.0], [np.cos(2 * np.deg2rad(degrees))], [np.sin(2 * np.deg2rad(degrees))], [0.0]])

    assert np.rad2deg(angle_errors(light(89.0), light(-89.0)))[0] == pytest.approx(-2.0)
    assert np.rad2deg(angle_errors(light(31.0), light(30.0)))[0] == pytest.approx(1.0)
    for across in (90.0, -90.0):
        assert np.rad2deg(angle_errors(light(across), light(0.0)))[0] == 90.0
    natural = np.array([[1.0], [0.001], [0.0], [0.0]])
    assert np.isnan(angle_errors(natural, natural)[0])


def test_the_summary_says_what_was_found(made):
    from io import StringIO

    from rich.console import Console

    for calibrated in made:
        console = Console(file=StringIO(), width=110)
        print_calibration(calibrated, console)
        text = console.file.getvalue()
        assert "Q/I and U/I (linear)" in text and "V/I (circular)" in text
        assert "condition number, 2-norm" in text and "1.732" in text
        assert max(map(len, text.splitlines())) <= 110
    assert "Map of 2 × 5 cells" in text and "rms errors at 2 inputs, held out" in text
