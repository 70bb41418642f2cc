"""Names of columns and labels as states of an analyser."""

from __future__ import annotations

import pytest

from pbrdf.errors import DataError
from pbrdf.instruments.reduction.reading_states import (
    State,
    parse_label,
    parse_name,
    parse_state,
    settle,
    split_uncertainty,
)


@pytest.mark.parametrize(
    ("name", "state"),
    [
        ("I45", State(polarizer=45.0)),
        ("I(22.5°)", State(polarizer=22.5)),
        ("I_22p5", State(polarizer=22.5)),
        ("I_m45", State(polarizer=-45.0)),
        ("I_-45 [mV]", State(polarizer=-45.0)),
        ("Irradiance", None),
        ("V_H", State(polarizer=0.0)),
        ("I_V", State(polarizer=90.0)),
        ("I_RCP", State(named="right")),
        ("I_l", State(named="left")),
        ("qwp30", State(retarder=30.0, retardance=90.0)),
        ("hwp_30", State(retarder=30.0, retardance=180.0)),
        ("P0_Q45", State(polarizer=0.0, retarder=45.0, retardance=90.0)),
        ("I_P0_R45_D127", State(polarizer=0.0, retarder=45.0, retardance=127.0)),
        ("I_R45", State(retarder=45.0)),
        ("R45", State(polarizer=45.0)),
        ("f_r_45", State(polarizer=45.0)),
        ("R_s", None),
        ("brdf_p", None),
        ("I_HV", None),
        ("theta_r", None),
        ("theta_r_45", None),
        ("m00", None),
        ("I", None),
        ("I_std", None),
        ("sample_1", None),
        ("I0/I90", None),
    ],
)
def test_names(name, state):
    found = parse_name(name)
    assert (None if found is None else found.state) == state


@pytest.mark.parametrize(
    ("name", "rest", "deviation", "coverage"),
    [
        ("I0_std", "I0", True, None),
        ("std_I0", "I0", True, None),
        ("u(I0)", "I0", True, None),
        ("U(I0)", "I0", True, 2.0),
        ("U(I0) (k=3)", "I0", True, 3.0),
        ("I0 standard uncertainty", "I0 standard", True, None),
        ("dI45 (V)", "I45 (V)", True, None),
        ("ΔI45", "I45", True, None),
        ("delta_I45", "I45", True, None),
        ("direction", "direction", False, None),
        ("diameter 3", "diameter 3", False, None),
        ("I0", "I0", False, None),
        ("I_U", "I", True, None),
    ],
)
def test_uncertainties(name, rest, deviation, coverage):
    text, found, factor = split_uncertainty(name)
    assert found == deviation
    if name != "I_U":
        assert (text, factor) == (rest, coverage)


@pytest.mark.parametrize(
    ("text", "state"),
    [
        ("-45", State(polarizer=-45.0)),
        ("V", State(polarizer=90.0)),
        ("R", State(named="right")),
        ("I45", State(polarizer=45.0)),
        ("qwp30 pol0", State(polarizer=0.0, retarder=30.0, retardance=90.0)),
        ("none", State(named="open")),
        ("Dark", State(named="dark")),
        ("fast", None),
        ("lens 50", None),
    ],
)
def test_labels(text, state):
    assert parse_label(text) == state


@pytest.mark.parametrize(
    ("text", "state"),
    [
        ("polarizer 45", State(polarizer=45.0)),
        ("45", State(polarizer=45.0)),
        ("retarder 30 90, polarizer 0", State(polarizer=0.0, retarder=30.0, retardance=90.0)),
        ("retarder 30, 127", State(retarder=30.0, retardance=127.0)),
        ("qwp 30, polarizer 0", State(polarizer=0.0, retarder=30.0, retardance=90.0)),
        ("(0.5, 0.5, 0, 0)", State(vector=(0.5, 0.5, 0.0, 0.0))),
        ("RCP", State(named="right")),
        ("1 2", None),
        ("", None),
    ],
)
def test_states_in_words(text, state):
    assert parse_state(text) == state


def test_p_is_settled_by_its_neighbours():
    plus = State(named="P")
    assert settle([plus, State(named="s")], "file")[0][0] == State(named="p")
    assert settle([plus, State(polarizer=0.0)], "file")[0][0] == State(polarizer=45.0)
    assert settle([State(named="par")], "file")[0] == [State(named="p")]
    assert "parallel" in settle([State(named="perp")], "file")[1][0]
    with pytest.raises(DataError, match=r"file: P may be the polariser at \+45° or along"):
        settle([plus, State(named="s"), State(polarizer=-45.0)], "file")
