"""The page of the neighbours against the scripts, the numbers and the programs that it names."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import pytest

import pbrdf

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "neighbours.md").read_text(encoding="utf-8")


def test_every_finding_is_linked_and_every_link_leads_somewhere():
    linked = set(re.findall(r"\]\(\.\./([^)#]+)\)", PAGE))
    assert [path for path in linked if not (ROOT / path).exists()] == []
    assert {path.relative_to(ROOT).as_posix() for path in (ROOT / "findings").glob("*.sh")} <= linked


@pytest.mark.parametrize("script", sorted((ROOT / "findings").glob("*.sh")), ids=lambda path: path.stem)
def test_versions_of_the_page_are_those_of_the_scripts(script):
    """The program that a script installs first is the one of its row, in the version that the page states."""
    package, version = re.search(r"([A-Za-z-]+)==([\d.]+)", script.read_text(encoding="utf-8")).groups()
    name = {
        "eradiate-mitsuba": "Eradiate's kernel",
        "drjit": "Dr.Jit",
        "mitsuba": "Mitsuba",
        "scipy": "SciPy",
    }.get(package, package)
    row = PAGE[: PAGE.index(script.name)].rpartition(f"| {name} {version}")
    assert row[1], f"{name} {version}"
    assert not re.search(r"^\| [A-Za-z]", row[2], re.MULTILINE)


def test_versions_of_the_numbers_are_those_of_the_page():
    with (ROOT / "tests" / "data_oracle" / "conventions.csv").open(encoding="utf-8") as file:
        found = {(row["program"], row["version"]) for row in csv.DictReader(file)}
    names = {"mitsuba": "Mitsuba", "eradiate-mitsuba": "Eradiate's kernel", "eradiate": "Eradiate"}
    assert found and all(f"{names.get(program, program)} {version}" in PAGE for program, version in found)


def test_conversions_that_the_page_names_are_there():
    for name in set(re.findall(r"from_[a-z]+_[a-z]+", PAGE)):
        assert callable(getattr(pbrdf.convert, name)), name
