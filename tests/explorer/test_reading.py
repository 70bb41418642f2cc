"""States from outside are completed, or refused in words."""

import json

import pytest

from pbrdf.errors import PbrdfError
from pbrdf.explorer import reading
from pbrdf.explorer.catalogue import layer_of, state_of
from pbrdf.explorer.state import read_state


def answered(state):
    found = []
    reading.answer(
        {"state": state, "from": "sent.json"}, [], None, lambda content, buffers: found.append(content)
    )
    return found[0]["state"]


def test_a_whole_state_stays_as_it_is(white):
    state = state_of([layer_of("white", white)])
    state |= {
        "light": {"theta_i": 20.5, "stokes": [1.0, 0.5, 0.0, -0.5]},
        "compare": 0,
        "settings": {"page": {"views": ["x"]}},
    }
    assert answered(json.loads(json.dumps(state))) == state


def test_what_is_left_out_has_its_default():
    state = answered({"version": 1, "layers": [{"model": "priest-germer", "parameters": {"n": 1.6}}]})
    [layer] = state["layers"]
    assert layer["parameters"]["n"] == 1.6
    assert set(layer["parameters"]) == {"sigma", "n", "kappa"}
    assert state["light"]["stokes"] == [1.0, 0.0, 0.0, 0.0]
    assert read_state(state).to_dict() == state


@pytest.mark.parametrize(
    "state",
    [
        None,
        3,
        {"version": 9},
        {"version": 1, "layers": []},
        {"version": 1, "layers": [{"model": "none"}]},
        {"version": 1, "layers": [{"model": "priest-germer"}], "quantities": []},
        {"version": 1, "layers": [{"model": "priest-germer", "parameters": {"n": 10**400}}]},
    ],
)
def test_others_are_refused_by_name(state):
    with pytest.raises(PbrdfError, match=r"^sent\.json: "):
        answered(state)
