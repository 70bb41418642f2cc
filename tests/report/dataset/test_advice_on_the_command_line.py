"""Advice in terms of Python's arguments becomes options that a shell passes on as they are meant."""

from __future__ import annotations

import shlex

import pytest

from pbrdf.report.dataset.describe import on_the_command_line


@pytest.mark.parametrize(
    "text", ["U (k=2)", "it's {A}!", "plate #", "`ls`", 'say "x"', "a\\b", "~", "f_{r}", "σ", "unc", "$U$"]
)
def test_names_of_any_kind_reach_the_program(text):
    said = on_the_command_line(f"x column={{'I_std': {text!r}}}, where={{{text!r}: 'A 1'}} ignore=[{text!r}]")
    words = shlex.split(said.replace(", --", " --"))
    assert words == ["x", "--column", f"I_std={text}", "--where", f"{text}=A 1", "--ignore", text]


def test_a_name_that_begins_with_a_hyphen_is_no_option():
    assert on_the_command_line("ignore=['-err']") == "--ignore=-err"


def test_places_to_fill_in_and_other_arguments():
    assert on_the_command_line("column={'phi': …}") == "--column phi=…"
    assert on_the_command_line("column={'phi_i': …, 'phi_r': …}") == "--column phi_i=… --column phi_r=…"
    assert on_the_command_line("column={'phi': '=0'}, or coverage=2") == "--column phi==0, or --coverage 2"
    assert on_the_command_line("skip_invalid=True") == "--skip-invalid"
