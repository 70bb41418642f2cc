"""What the commands share is declared once: the same option looks the same everywhere."""

import ast
import sys
from pathlib import Path

import typer

from pbrdf.cli.main import COMMANDS as COMMAND_MODULES
from pbrdf.cli.main import app

COMMANDS = {name: command.params for name, command in typer.main.get_command(app).commands.items()}


def declared(option):
    """The declarations of an option by command."""
    return {name: p for name, params in COMMANDS.items() for p in params if option in p.opts}


def test_shared_options_have_the_same_short_form():
    for option, short in (("--output", "-o"), ("--quiet", "-q")):
        found = declared(option)
        assert len(found) > 4
        assert all(set(p.opts) == {option, short} for p in found.values())


def test_options_that_mean_the_same_are_described_alike():
    for option, count in (("--backend", 10), ("--dark-level", 2), ("--calibration-error", 2), ("--patch", 2)):
        found = declared(option).values()
        assert len(found) == count, option
        assert len({(p.help, p.metavar) for p in found}) == 1, option


def test_values_of_one_kind_are_named_alike():
    assert all(p.metavar == "ANGLES" for option in ("--theta-r", "--phi") for p in declared(option).values())
    assert all(p.metavar == "NAME|FILE" for p in declared("--polarimeter").values())
    assert all(
        p.help.lower().startswith(("seed", "with --search: seed")) for p in declared("--seed").values()
    )


def test_no_command_imports_another():
    modules = {f"pbrdf.cli.{module.partition(':')[0]}" for module in COMMAND_MODULES.values()}
    assert len(modules) > 10
    for module in modules:
        tree = ast.parse(Path(sys.modules[module].__file__).read_text(encoding="utf-8"))
        imported = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
        assert not imported & modules, module
