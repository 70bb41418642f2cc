"""The house is open to any model: no name of a parameter of one stands outside of what owns it."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import pbrdf
from pbrdf.models import MODELS

SOURCE = Path(pbrdf.__file__).parent
NAMES = {p.name for model in MODELS.values() for p in model.parameters}
#: The models themselves, the reproduction of the paper that one of them is from, its bundled paints, and the
#: self-check, which evaluates one model against numbers that were computed elsewhere. Fields of other programs' files
#: and pages and what is below the models are no parameters either.
OWNERS = (
    "models/", "reproduction/", "data/paints.py", "cli/selfcheck.py", "data/formats/rgl.py",
    "data/refractive_index.py", "files/",
)  # fmt: skip
#: Modes of opening a file are no parameters.
FILE_MODES = {"a"}


def modules() -> Iterator[Path]:
    for path in sorted(SOURCE.rglob("*.py")):
        where = path.relative_to(SOURCE).as_posix()
        # formulas have arguments of their own; what they are called with is a model's business
        if not where.startswith((*OWNERS, "optics/")):
            yield path


def docstrings(tree: ast.AST) -> set[int]:
    found = set()
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            found |= {
                id(s.value) for s in body if isinstance(s, ast.Expr) and isinstance(s.value, ast.Constant)
            }
    return found


def file_modes(tree: ast.AST) -> set[int]:
    """Second arguments and arguments ``mode`` of calls that open something."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            called = ast.unparse(node.func)
            modes = [k.value for k in node.keywords if k.arg == "mode"]
            if called.endswith(("open", "File")):
                modes += node.args[1:2]
            found |= {id(m) for m in modes if isinstance(m, ast.Constant) and m.value in FILE_MODES}
    return found


def mentions(text: str) -> list[str]:
    """Strings that are the name of a parameter, and attributes ``values["…"]`` by keyword of such a name."""
    tree = ast.parse(text)
    skipped = docstrings(tree) | file_modes(tree)
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and node.value in NAMES and id(node) not in skipped:
            found.append(f"line {node.lineno}: {node.value!r}")
        if isinstance(node, ast.keyword) and node.arg in NAMES and len(node.arg) > 1:
            found.append(f"line {node.value.lineno}: {node.arg}=")
    return found


@pytest.mark.parametrize("path", list(modules()), ids=lambda path: path.relative_to(SOURCE).as_posix())
def test_no_parameter_of_a_model_is_named(path):
    assert mentions(path.read_text(encoding="utf-8")) == []


def test_the_check_itself():
    """It finds a lookup, a comparison, a keyword and an element of a tuple; not a docstring, not a file's mode."""
    assert len(mentions('f(values["sigma"])\nif p.name == "a": pass\nfit(sigma=1)\nx = ("n", "other")')) == 4
    assert mentions('"""n"""\nopen(path, "a")\nto_netcdf(path, mode="a")\ny = b') == []
