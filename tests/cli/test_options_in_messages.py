"""What messages advise can be typed: every option that the package's texts name is one of its commands'."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

import pbrdf
from pbrdf.cli.main import app

SOURCES = Path(pbrdf.__file__).parent
#: Not options: names of colours in style sheets.
NO_OPTIONS = {"report/inline_svg.py"}
#: Options of other programs: of `dask worker`, of `brew`.
OTHERS = {"inversion/map_store/scheduler.py": {"--nthreads"}, "backend.py": {"--prefix"}}


def options_of_commands() -> dict[str, set[str]]:
    group = typer.main.get_command(app)
    general = {name for p in group.params for name in p.opts}
    return {
        command: general
        | {"--help"}
        | {name for p in parameters(one) for name in (*p.opts, *p.secondary_opts)}
        for command, one in group.commands.items()
    }


def parameters(command: Any) -> list[Any]:
    """Of a command, or of all commands of a group."""
    return [*command.params, *(p for one in getattr(command, "commands", {}).values() for p in one.params)]


OPTIONS = options_of_commands()


def named_options(path: Path) -> Iterator[tuple[int, str]]:
    """Lines and options in the strings of a file, those of f-strings and docstrings included."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            for option in re.findall(r"(?<![\w-])--[a-z][a-z0-9-]*", node.value):
                yield node.lineno, option


@pytest.mark.slow
def test_every_option_that_a_text_names_exists():
    everywhere = set().union(*OPTIONS.values())
    unknown, count = [], 0
    for path in sorted(SOURCES.rglob("*.py")):
        place = path.relative_to(SOURCES).as_posix()
        if place in NO_OPTIONS:
            continue
        known = everywhere | OTHERS.get(place, set())
        if place.startswith("inversion/"):
            known = OPTIONS["fit"] | OPTIONS["compare"] | OTHERS.get(place, set())
        if place.startswith("inversion/map_store/"):
            known |= OPTIONS["map"]
        for line, option in named_options(path):
            count += 1
            if option not in known:
                unknown.append(f"{place}:{line}: {option}")
    assert not unknown
    assert count > 200, "the texts were looked through"
