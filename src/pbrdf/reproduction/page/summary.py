"""The reproduction in a few lines, for a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pbrdf.report.printing import bare_table
from pbrdf.reproduction.page.page import verdicts_in_words
from pbrdf.reproduction.page.tables import recovered
from pbrdf.reproduction.paper import SAMPLES, SIMULATED
from pbrdf.reproduction.result import Reproduction
from pbrdf.reproduction.statements.parameters import agreement
from pbrdf.reproduction.statements.statement import signed

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["print_summary"]


def print_summary(reproduction: Reproduction, console: Console) -> None:
    """Print what was simulated, the recovered parameters with (recovered − true)/standard error, and the statements."""
    samples = reproduction.samples
    console.print(f"{SIMULATED}\n{reproduction.options.in_words()}\n", markup=False)
    table = bare_table()
    table.add_column("", no_wrap=True)
    for r in recovered(samples[0]):
        table.add_column(r.symbol, justify="right", no_wrap=True)
    table.add_column("best optimum from", no_wrap=True)
    for sample in samples:
        found = agreement(sample)
        rows = recovered(sample)
        table.add_row(
            f"{sample.number} {SAMPLES[sample.name]}",
            *(f"{r.value:.4f}" for r in rows),
            f"{found.reached} of {found.starts}",
        )
        table.add_row("  table 1", *(f"{r.true:.4f}" for r in rows), style="dim")
        table.add_row("  pull", *(signed(r.pull, 1) for r in rows), style="dim")
    console.print(table)
    console.print()
    for line in verdicts_in_words(reproduction.statements):
        console.print(line, markup=False)
