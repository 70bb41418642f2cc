"""The packages of the instruments stand in an order, and each imports only from those before it."""

import ast
from pathlib import Path

import pytest

import pbrdf.instruments

ROOMS = ("polarimeter", "frames", "goniometer", "reduction", "pixel_geometry", "calibration", "virtual")
FOLDER = Path(pbrdf.instruments.__file__).parent


def imported(path):
    """Names of the modules that a file imports, anywhere in it."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def test_all_rooms_are_known():
    assert {path.parent.name for path in FOLDER.glob("*/__init__.py")} == set(ROOMS)


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_imports_from_those_before_it(room):
    later = ROOMS[ROOMS.index(room) + 1 :]
    forbidden = tuple(f"pbrdf.instruments.{other}." for other in later)
    files = sorted((FOLDER / room).glob("*.py"))
    assert files
    found = [(path.name, name) for path in files for name in imported(path) if name.startswith(forbidden)]
    assert found == []
