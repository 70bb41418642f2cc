"""Models in files."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pbrdf.backend import get_backend
from pbrdf.errors import ModelError
from pbrdf.models import MODELS, DoubleGauss, load_model

DOMAINS = {
    "sigma": (0.001, 1),
    "n": (1, 100),
    "flake_n": (1, 100),
    "kappa": (0, 100),
    "a": (0, 1e6),
    "k": (0.34, 20),
    "b": (-20, 20),
    "t": (0, 1),
}
PAINT = {"sigma": 0.04, "n": 1.62, "a": 1.5, "k": 1.25, "b": 0.2, "t": 0.5}


@st.composite
def models(draw):
    cls = draw(st.sampled_from(list(MODELS.values())))

    def value(low, high):
        number = st.floats(low, high)
        return st.one_of(number, arrays(float, (2, 3), elements=number))

    domains = {p.name: DOMAINS.get(p.name, (p.domain[0], min(p.domain[1], 1e6))) for p in cls.parameters}
    values = {name: draw(value(*domain)) for name, domain in domains.items()}
    options = {name: draw(st.sampled_from(choices)) for name, choices in cls.options.items()}
    return cls(**values, **options)


@given(models())
def test_round_trip(model):
    """Text → model is the model, to the last digit, options included."""
    text = model.to_json()
    again = load_model(text)
    assert again == model and again.chosen == model.chosen and type(again) is type(model)
    for name, value in model.values.items():
        np.testing.assert_array_equal(again.values[name], value)
    assert load_model(json.loads(text)) == model
    assert again.to_json() == text


def test_round_trip_through_a_file(tmp_path):
    model = DoubleGauss(**PAINT, shadowing="smith")
    path = tmp_path / "weiß paint.json"
    text = model.to_json(path)
    assert path.read_text(encoding="utf-8") == text
    assert load_model(path) == model == load_model(str(path))
    assert [p.name for p in tmp_path.iterdir()] == [path.name]  # nothing left beside it


def test_drjit_values_are_written_as_numbers():
    model = DoubleGauss(**{**PAINT, "sigma": get_backend().Float([0.02, 0.03])})
    assert json.loads(model.to_json())["parameters"]["sigma"] == [0.02, 0.03]


def test_kappa_and_options_may_be_left_out():
    model = load_model({"model": "double-gauss", "parameters": PAINT})
    assert model == DoubleGauss(**PAINT)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", r"not JSON, line 1 column 2"),
        ("[1, 2]", r'not a model: the key "model" is missing'),
        ("{}", r'not a model: the key "model" is missing'),
        ('{"model": "phong"}', r"unknown model 'phong': known are double-gauss, reciprocal-double-gauss"),
        ('{"model": "double-gauss"}', r'"parameters" and "options" must be tables'),
        (
            '{"model": "double-gauss", "parameters": {"sigma": 0.1}}',
            r"parameter 'n' of double-gauss is missing",
        ),
        (
            '{"model": "double-gauss", "parameters": {"gloss": 1}}',
            r"unknown parameter 'gloss' of double-gauss",
        ),
        (
            json.dumps({"model": "double-gauss", "parameters": PAINT, "options": {"mode": "x"}}),
            r"unknown option 'mode' of double-gauss: known are normalization",
        ),
        (
            json.dumps({"model": "double-gauss", "parameters": {**PAINT, "t": 3}}),
            r"t=3 is outside its domain",
        ),
        (
            json.dumps({"model": "double-gauss", "parameters": PAINT, "options": {"accuracy": "x"}}),
            r"accuracy='x': choose one of",
        ),
    ],
    ids=lambda x: x[:40],
)
def test_errors_name_the_file(tmp_path, content, message):
    path = tmp_path / "paint.json"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(ModelError, match=message) as error:
        load_model(path)
    assert str(error.value).startswith(f"{path}: ")


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(ModelError, match=r"nowhere\.json: cannot be read as a model"):
        load_model(tmp_path / "nowhere.json")
    (tmp_path / "binary.json").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(ModelError, match=r"binary\.json: not a text file, so not a model"):
        load_model(tmp_path / "binary.json")


@pytest.mark.parametrize(
    "name",
    [3, None, ["double-gauss"], {"a": 1}],
    ids=str,
)
def test_a_model_name_of_the_wrong_type(name):
    with pytest.raises(ModelError, match="unknown model"):
        load_model({"model": name, "parameters": PAINT})


@pytest.mark.parametrize("value", [True, [0.1, True], "0.1", "1_0", {"a": 1}, None, [1.0, [1.0]]])
def test_what_is_no_number_in_json_is_none_of_a_parameter(value):
    with pytest.raises(ModelError, match="sigma"):
        load_model({"model": "double-gauss", "parameters": {**PAINT, "sigma": value}})
    with pytest.raises(ModelError, match="sigma"):
        load_model(json.dumps({"model": "double-gauss", "parameters": {**PAINT, "sigma": value}}))
    with pytest.raises(ModelError, match=r"\bn\b"):
        load_model({"model": "double-gauss", "parameters": {**PAINT, "n": value}})


@pytest.mark.parametrize("text", ['{"model": ' + "[" * 100_000, '{"model": ' + "9" * 5000 + "}"])
def test_json_that_python_cannot_take_is_refused_in_a_sentence(tmp_path, text):
    (tmp_path / "a.json").write_text(text, encoding="utf-8")
    with pytest.raises(
        ModelError, match=r"a\.json: not JSON, (brackets stand too deep|an integer has more digits)"
    ):
        load_model(tmp_path / "a.json")
