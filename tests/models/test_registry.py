"""Models by name: registered by a program, offered by a package, defined in a file."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest

import own_model
import pbrdf
from own_model import LambertGGX
from pbrdf.errors import ModelError, PluginWarning
from pbrdf.models import MODELS, DoubleGauss, Model, find_model, load_model, register
from pbrdf.models.registry import ENTRY_POINTS, Registry

OWN = Path(own_model.__file__)


def package(folder: Path, entries: str, **files: str) -> None:
    """An installed package as importlib.metadata sees it: modules and the record of its entry points."""
    for name, text in files.items():
        (folder / f"{name}.py").write_text(text, encoding="utf-8")
    info = folder / "paints-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: paints\nVersion: 1.0\n", encoding="utf-8")
    (info / "entry_points.txt").write_text(f"[{ENTRY_POINTS}]\n{entries}\n", encoding="utf-8")


def test_a_registered_model_is_known_everywhere_by_its_name(tmp_path):
    assert register(LambertGGX) is LambertGGX
    assert MODELS["lambert-ggx"] is LambertGGX and find_model("lambert-ggx") is LambertGGX
    model = LambertGGX(0.1, 1.5, 0.3)
    model.to_json(tmp_path / "own.json")
    assert load_model(tmp_path / "own.json") == model
    register(LambertGGX)  # again: nothing new


def test_names_of_others_are_not_taken_and_what_is_no_model_is_refused():
    class Impostor(LambertGGX):
        name = "double-gauss"

    with pytest.raises(ModelError, match=r"'double-gauss' belongs to pbrdf.models.double_gauss.DoubleGauss"):
        register(Impostor)
    assert MODELS["double-gauss"] is DoubleGauss

    class Nameless(Model):
        def kernel(self, geometry, values, part="total"): ...

    with pytest.raises(ModelError, match="needs a name"):
        register(Nameless)

    class Empty(Model):
        name = "empty"

    with pytest.raises(ModelError, match="needs a method kernel"):
        register(Empty)
    with pytest.raises(ModelError, match="is no pBRDF model"):
        register(dict)


def test_a_package_offers_a_model_by_an_entry_point(tmp_path, monkeypatch):
    package(tmp_path, "lambert-ggx = paint_models:LambertGGX", paint_models=OWN.read_text(encoding="utf-8"))
    monkeypatch.syspath_prepend(tmp_path)
    registry = Registry()
    registry.add(DoubleGauss)
    assert registry["lambert-ggx"].__module__ == "paint_models"
    assert list(registry) == ["double-gauss", "lambert-ggx"] and len(registry) == 2


def test_a_broken_package_is_named_and_stops_nothing(tmp_path, monkeypatch):
    package(
        tmp_path,
        "broken = no_such_module:Model\nnumber = math:pi\nlambert-ggx = paint_models_2:LambertGGX",
        paint_models_2=OWN.read_text(encoding="utf-8"),
    )
    monkeypatch.syspath_prepend(tmp_path)
    registry = Registry()
    with pytest.warns(PluginWarning) as warned:
        assert list(registry) == ["lambert-ggx"]
    said = [str(w.message) for w in warned]
    assert any("'broken'" in s and "no_such_module" in s for s in said)
    assert any("'number'" in s and "no pBRDF model" in s for s in said)


def test_a_model_from_a_file(tmp_path):
    shutil.copy(OWN, tmp_path / "mine.py")
    cls = find_model(f"{tmp_path / 'mine.py'}:LambertGGX")
    assert cls.name == "lambert-ggx" and cls(0.1, 1.5, 0.3).mueller(0.5, 0.5).shape == (4, 4)
    # the same file is not run twice
    assert find_model(f"{tmp_path / 'mine.py'}:LambertGGX") is cls


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("nothing.py:Model", "there is no file"),
        ("{folder}/mine.py", "name the model's class as well"),
        ("{folder}/mine.py:Other", "defines no model Other: it defines LambertGGX"),
        ("{folder}/wrong.py:Mine", "cannot be run: SyntaxError"),
        ("{folder}/failing.py:Mine", "cannot be run: ZeroDivisionError"),
        ("no-such-model", r"known are double-gauss, .*FILE.py:Class"),
    ],
)
def test_what_is_wrong_with_a_model_is_said(tmp_path, text, message):
    shutil.copy(OWN, tmp_path / "mine.py")
    (tmp_path / "wrong.py").write_text("class Mine(:\n", encoding="utf-8")
    (tmp_path / "failing.py").write_text("1 / 0\n", encoding="utf-8")
    with pytest.raises(ModelError, match=message):
        find_model(text.format(folder=tmp_path))
    assert not [name for name in sys.modules if name.startswith("pbrdf_model_failing")]


def test_a_declaration_that_cannot_be_is_an_error_of_the_program():
    p = LambertGGX.parameters[0]
    for parameters, message in (
        ((p, p), "the name 'alpha' is taken"),
        ((pbrdf.models.Parameter("part", "p", "1", "x", 0, 1, (0, 1), 0),), "the name 'part' is taken"),
        ((pbrdf.models.Parameter("a b", "p", "1", "x", 0, 1, (0, 1), 0),), "cannot be the name"),
    ):
        with pytest.raises(TypeError, match=message):
            type("Wrong", (Model,), {"name": "wrong", "parameters": parameters})
