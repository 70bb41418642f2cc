"""What was identified, for a person: the set, the candidates, what it rests on."""

from __future__ import annotations

import io
from collections.abc import Container, Sequence
from typing import TYPE_CHECKING

from pbrdf.report.identification.calibrated import Calibrated, calibration_rests_on
from pbrdf.report.identification.classified import (
    CLASS_HEADINGS,
    Classified,
    class_rows,
    classes_rest_on,
    classes_sentence,
)
from pbrdf.report.identification.confusion_table import confusion_headings, confusion_rows, confusion_sentence
from pbrdf.report.identification.labelled import LabelledReport, labels_rest_on
from pbrdf.report.identification.next_reading import next_sentence
from pbrdf.report.identification.subject import HEADINGS, Identified, rests_on, rows_of, sentence
from pbrdf.report.printing import bare_table, print_parts, printing_console

if TYPE_CHECKING:
    from rich.console import Console

    from pbrdf.identification.confusion import Confusion

__all__ = ["print_calibration", "print_classes", "print_labelled", "print_summary", "summary_text"]

_TEXT_WIDTH = 120


def print_summary(report: Identified, console: Console) -> None:
    """Print the set, the table of candidates, and the sentences."""
    heading = f"{report.title}: {sentence(report.found)}"
    following = []
    if (best := report.next_measurement) is not None:
        following = [next_sentence(best, len(report.found.materials)), ""]
    _print(heading, HEADINGS, (1, 2), rows_of(report.found), [*following, *rests_on(report)], console)


def print_classes(report: Classified, console: Console) -> None:
    """Print how many pixels show which material, and what that rests on."""
    heading = f"{report.name}: {classes_sentence(report)}"
    numeric = range(1, len(CLASS_HEADINGS))
    _print(heading, CLASS_HEADINGS, numeric, class_rows(report), classes_rest_on(report), console)
    if report.labelled is not None:
        console.print()
        _print_table(report.labels, report.labelled, "pixels", [], console)


def print_calibration(report: Calibrated, console: Console) -> None:
    """Print coverage and confusion by material, the calibration error, and what they rest on."""
    _print_table(report.name, report.table, "measurements", calibration_rests_on(report), console)


def print_labelled(report: LabelledReport, console: Console) -> None:
    """Print what labelled measurements were taken for, and what that rests on."""
    _print_table(report.name, report.table, "measurements", labels_rest_on(report), console)


def _print_table(name: str, table: Confusion, what: str, lines: Sequence[str], console: Console) -> None:
    heading = f"{name}: {confusion_sentence(table, what)}"
    headings = confusion_headings(what)
    _print(heading, headings, range(1, len(headings)), confusion_rows(table), lines, console)


def summary_text(report: Identified | Classified | Calibrated | LabelledReport) -> str:
    """What is printed as plain text, for a file."""
    file = io.StringIO()
    console = printing_console(file=file, width=_TEXT_WIDTH, color_system=None, force_terminal=False)
    if isinstance(report, Identified):
        print_summary(report, console)
    elif isinstance(report, Classified):
        print_classes(report, console)
    elif isinstance(report, LabelledReport):
        print_labelled(report, console)
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
    print_parts([heading, "", table, *(["", *lines] if lines else [])], console)
