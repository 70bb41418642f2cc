"""A comparison of models for a person: the verdict, the ranking, what each assumption costs, what failed."""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import TYPE_CHECKING

from pbrdf.report.comparison.subject import Compared, table
from pbrdf.report.dataset.describe import short_name
from pbrdf.report.printing import bare_table, print_parts, printing_console

if TYPE_CHECKING:
    from rich.console import Console, RenderableType

__all__ = ["print_summary", "summary_text"]

_TEXT_WIDTH = 140


def summary_text(report: Compared) -> str:
    """The summary as plain text, for a file."""
    file = io.StringIO()
    console = printing_console(file=file, width=_TEXT_WIDTH, color_system=None, force_terminal=False)
    print_summary(report, console)
    return "\n".join(line.rstrip() for line in file.getvalue().splitlines()) + "\n"


def print_summary(report: Compared, console: Console) -> None:
    """Print the verdict, the ranking and the sentences."""
    print_parts(_parts(report), console)


def _parts(report: Compared) -> Iterator[RenderableType]:
    comparison = report.comparison
    verdict, *others = comparison.sentences()
    yield f"{short_name(report.name, comparison.dataset)}: {verdict}"
    yield ""
    headings, rows = table(comparison)
    shown = bare_table()
    # the name of a model breaks at its spaces, never within a word
    words = max(len(word) for row in rows for word in row[0].split())
    for k, heading in enumerate(headings):
        if k in (0, len(headings) - 1):
            shown.add_column(heading, min_width=None if k else words)
        else:
            shown.add_column(heading, justify="right", no_wrap=True)
    for row in rows:
        shown.add_row(*map(_literal, row))
    yield shown
    yield ""
    yield from others
    for failure in comparison.failures:
        yield f"Not compared: {failure.rung.name}: {failure.reason}"


def _literal(text: str) -> RenderableType:
    """Text whose square brackets (``a[550]``) are no markup."""
    from rich.text import Text

    return Text(text)
