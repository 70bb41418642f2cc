"""What was identified, for a person: the set, the candidates, what it rests on."""

from __future__ import annotations

import io
from collections.abc import Container, Sequence
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
from pbrdf.report.identification.next_reading import next_sentence
from pbrdf.report.identification.subject import HEADINGS, Identified, rests_on, rows_of, sentence
from pbrdf.report.printing import bare_table, print_parts, printing_console

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["print_calibration", "print_classes", "print_summary", "summary_text"]

_TEXT_WIDTH = 120


def print_summary(report: Identified, console: Console) -> None:
    """Print the set, the table of candidates, and the sentences."""
    name = short_name(report.name, report.dataset)
    heading = f"{name}: {sentence(report.found)}"
    following = [] if report.next_measurement is None else [next_sentence(report.next_measurement), ""]
    _print(heading, HEADINGS, (1, 2), rows_of(report.found), [*following, *rests_on(report)], console)


def print_classes(report: Classified, console: Console) -> None:
    """Print how many pixels show which material, and what that rests on."""
    heading = f"{report.name}: {classes_sentence(report)}"
    numeric = range(1, len(CLASS_HEADINGS))
    _print(heading, CLASS_HEADINGS, numeric, class_rows(report), classes_rest_on(report), console)


def print_calibration(report: Calibrated, console: Console) -> None:
    """Print coverage and confusion by material, the calibration error, and what they rest on."""
    heading = f"{report.name}: {calibrated_sentence(report)}"
    numeric = range(1, len(CALIBRATION_HEADINGS))
    rows = calibration_rows(report)
    _print(heading, CALIBRATION_HEADINGS, numeric, rows, calibration_rests_on(report), console)


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


def _print(
    heading: str,
    columns: Sequence[str],
    numeric: Container[int],
    rows: Sequence[Sequence[str]],
    lines: Sequence[str],
    console: Console,
) -> None:
    """A sentence, a table and what both rest on."""
    from rich.text import Text

    table = bare_table()
    for k, column in enumerate(columns):
        table.add_column(column, justify="right" if k in numeric else "left")
    for row in rows:
        table.add_row(*map(Text, row))
    print_parts([heading, "", table, "", *lines], console)
