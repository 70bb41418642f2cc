"""The names of ``pbrdf`` itself: what there is, where it comes from, and that nothing else shows."""

from __future__ import annotations

import ast
import importlib
import importlib.metadata
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import pbrdf

PACKAGE = Path(pbrdf.__file__).parent
EAGER = {
    "BackendError",
    "DataError",
    "FitError",
    "ModelError",
    "PbrdfError",
    "__version__",
    "get_backend",
    "set_backend",
}


def home(name):
    """Module and name there, by the table of lazily loaded names."""
    module, _, own_name = pbrdf._HOME[name].partition(":")
    return module, own_name or name


def imported_for_type_checkers():
    """Module and name there by public name, as the block under TYPE_CHECKING imports them."""
    tree = ast.parse(Path(pbrdf.__file__).read_text(encoding="utf-8"))
    (block,) = (node for node in tree.body if isinstance(node, ast.If))
    assert ast.unparse(block.test) == "TYPE_CHECKING"
    return {
        alias.asname or alias.name: (statement.module, alias.name)
        for statement in block.body
        for alias in statement.names
    }


def test_dir_shows_the_public_names_and_nothing_else():
    assert dir(pbrdf) == sorted(pbrdf.__all__)
    assert len(set(pbrdf.__all__)) == len(pbrdf.__all__)


def test_table_and_list_agree():
    assert {*pbrdf._HOME} | EAGER == {*pbrdf.__all__}
    assert not {*pbrdf._HOME} & EAGER


def test_type_checkers_see_the_same_names_from_the_same_places():
    assert imported_for_type_checkers() == {name: home(name) for name in pbrdf._HOME}


def test_no_name_hides_a_module():
    """``pbrdf.plan`` is a function whatever has been imported before."""
    modules = {path.stem for path in PACKAGE.iterdir()}
    assert not modules & {*pbrdf.__all__}


@pytest.mark.parametrize("name", sorted(pbrdf._HOME))
def test_every_name_resolves_and_is_documented(name):
    value = getattr(pbrdf, name)
    module, own_name = home(name)
    assert value is getattr(importlib.import_module(module), own_name)
    if name != "PAINTS":  # a plain dictionary
        assert inspect.cleandoc(value.__doc__)


def test_a_name_that_is_not_there():
    with pytest.raises(AttributeError, match="module 'pbrdf' has no attribute 'brdf'"):
        pbrdf.brdf  # noqa: B018


def test_a_name_brings_its_module_and_not_before():
    code = (
        "import sys, pbrdf; before = 'pbrdf.inversion' in sys.modules; pbrdf.profile\n"
        "print(before, 'pbrdf.inversion' in sys.modules)"
    )
    run = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(PACKAGE.parent)!r})\n{code}"],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert run.stdout.split() == ["False", "True"], run.stderr


def test_version_of_package_and_metadata():
    assert importlib.metadata.version("pbrdf") == pbrdf.__version__
    found = [
        path for path in PACKAGE.rglob("*.py") if f'"{pbrdf.__version__}"' in path.read_text(encoding="utf-8")
    ]
    assert [path.name for path in found] == ["version.py"]
