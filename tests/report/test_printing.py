"""What is printed reaches the terminal as text."""

from __future__ import annotations

import io

from pbrdf.report.printing import plain_table, print_parts, printing_console


def test_sentences_and_tables_hold_no_characters_that_command_a_terminal():
    file = io.StringIO()
    table = plain_table("title \x1b[2J", "group")
    table.add_row("red\x1b[31m")
    print_parts(["a [bold] word \x1b]0;x\x07", table], printing_console(file=file, width=80))
    assert "\x1b" not in file.getvalue()
    assert "a [bold] word \\x1b]0;x" in file.getvalue()
    assert "title \\x1b[2J" in file.getvalue()
    assert "red\\x1b" in file.getvalue()


def test_on_a_terminal_only_the_style_is_sent():
    file = io.StringIO()
    console = printing_console(file=file, width=80, force_terminal=True, color_system="standard")
    console.print("[bold]strong[/bold] \x1b[31m")
    assert file.getvalue() == "\x1b[1mstrong\x1b[0m \\x1b[31m\n"
