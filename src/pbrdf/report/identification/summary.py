"""What was identified, for a person: the set, the candidates, what it rests on."""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import TYPE_CHECKING

from pbrdf.report.dataset.describe import short_name
from pbrdf.report.identification.calibrated import (
    CALIBRATION_HEADINGS,
    Calibrated,
    calibrated_sentence,
    calibration_rests_on,
    calibration_rows,
)
from pbrdf.report.identification.classified import (
    CLASS_HEADINGS,
    Classified,
    class_rows,
    classes_rest_on,
    classes_sentence,
)
from pbrdf.report.identification.subject import HEADINGS, Identified, rests_on, rows_of, sentence
from pbrdf.report.printing import bare_table, print_parts, printing_console

if TYPE_CHECKING:
    from rich.console import Console, RenderableType

__all__ = ["print_calibration", "print_classes", "print_summary", "summary_text"]

_TEXT_WIDTH = 120


def print_summary(report: Identified, console: Console) -> None:
    """Print the set, the table of candidates, and the sentences."""
    print_parts(_parts(report), console)


def summary_text(report: Identified | Classified | Calibrated) -> str:
    """What is printed as plain text, for a file."""
    file = io.StringIO()
    console = printing_console(file=file, width=_TEXT_WIDTH, color_system=None, force_terminal=False)
    if isinstance(report, Identified):
        print_summary(report, console)
    elif isinstance(report, Classified):
        print_classes(report, console)
    else:
        print_calibration(report, console)
    return "\n".join(line.rstrip() for line in file.getvalue().splitlines()) + "\n"


def _parts(report: Identified) -> Iterator[RenderableType]:
    from rich.text import Text

    yield f"{short_name(report.name, report.dataset)}: {sentence(report.found)}"
    yield ""
    table = bare_table()
    for k, heading in enumerate(HEADINGS):
        table.add_column(heading, justify="right" if k in (1, 2) else "left")
    for row in rows_of(report.found):
        table.add_row(*map(Text, row))
    yield table
    yield ""
    yield from rests_on(report)


def print_classes(report: Classified, console: Console) -> None:
    """Print how many pixels show which material, and what that rests on."""
    print_parts(_classes(report), console)


def print_calibration(report: Calibrated, console: Console) -> None:
    """Print coverage and confusion by material, the calibration error, and what they rest on."""
    print_parts(_calibration(report), console)


def _classes(report: Classified) -> Iterator[RenderableType]:
    from rich.text import Text

    yield f"{report.name}: {classes_sentence(report)}"
    yield ""
    table = bare_table()
    for k, heading in enumerate(CLASS_HEADINGS):
        table.add_column(heading, justify="right" if k else "left")
    for row in class_rows(report):
        table.add_row(*map(Text, row))
    yield table
    yield ""
    yield from classes_rest_on(report)


def _calibration(report: Calibrated) -> Iterator[RenderableType]:
    from rich.text import Text

    yield f"{report.name}: {calibrated_sentence(report)}"
    yield ""
    table = bare_table()
    for k, heading in enumerate(CALIBRATION_HEADINGS):
        table.add_column(heading, justify="right" if k else "left")
    for row in calibration_rows(report):
        table.add_row(*map(Text, row))
    yield table
    yield ""
    yield from calibration_rests_on(report)
