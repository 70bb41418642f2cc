"""What the contracts in ``pyproject.toml`` cannot say of the imports inside the package, and the page that draws it."""

from __future__ import annotations

import re
from pathlib import Path

import grimp
import pytest

import pbrdf

PACKAGE = Path(pbrdf.__file__).parent
PAGE = Path(__file__).parents[1] / "docs" / "architecture.md"


@pytest.fixture(scope="module")
def graph():
    """Which module imports which, those for type checkers and those inside functions too."""
    return grimp.build_graph("pbrdf", cache_dir=None)


def circles(imports):
    """Strongly connected modules, by Tarjan's algorithm; `imports` maps each module to those that it imports."""
    order, low, stack, found = {}, {}, [], []

    def visit(module):
        order[module] = low[module] = len(order)
        stack.append(module)
        for other in sorted(imports[module]):
            if other not in order:
                visit(other)
            if other in stack:
                low[module] = min(low[module], low[other])
        if low[module] == order[module]:
            place = stack.index(module)
            members = stack[place:]
            del stack[place:]
            if len(members) > 1:
                found.append(sorted(members))

    for module in sorted(imports):
        if module not in order:
            visit(module)
    return found


def test_circles_are_found():
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"b", "d"}, "d": set()}) == [["b", "c"]]
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}) == [["a", "b", "c"]]
    assert circles({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == []


def test_no_circle_of_files(graph):
    """A package's ``__init__`` and its own modules too, which the contract on siblings leaves out."""
    assert (
        circles({module: graph.find_modules_directly_imported_by(module) for module in graph.modules}) == []
    )


def test_nothing_inside_imports_the_front_door(graph):
    assert graph.find_modules_that_directly_import("pbrdf") == set()


def test_the_page_draws_every_floor_and_names_files_that_are_there():
    text = PAGE.read_text(encoding="utf-8")
    drawn = set(re.findall(r"\w+", " ".join(line[:17] for line in text.split("```")[1].splitlines())))
    there = {path.stem for path in PACKAGE.iterdir() if path.is_dir() or path.suffix == ".py"}
    assert there - {"__init__", "__pycache__"} <= drawn
    named = re.findall(r"`((?:\w+/)+[a-z_]+\.py)`", text.split("## Where a change goes")[1])
    assert len(named) > 5
    assert [name for name in named if not (PACKAGE / name).is_file()] == []
