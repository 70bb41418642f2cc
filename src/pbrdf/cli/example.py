"""``pbrdf example``: small files to try the other commands with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pbrdf.cli.console import output_console

__all__ = ["example"]


def example(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="NAME", help="Which to write; without a name they are listed.", show_default=False
        ),
    ] = None,
) -> None:
    """Write small example files into this folder, and name the commands that take them.

    What there is: `pbrdf example`

    A table of measurements: `pbrdf example table`
    """
    from pbrdf.instruments.virtual.examples import EXAMPLES, write_example

    if not names:
        from pbrdf.report.printing import bare_table

        table = bare_table()
        for title in ("example", "writes", "what it is"):
            table.add_column(title)
        for name, listed in EXAMPLES.items():
            table.add_row(name, listed.target, listed.says)
        console = output_console()
        console.print(table)
        console.print(
            "\nAll are simulated. `pbrdf example NAME` writes one, and says what to do with it.", markup=False
        )
        return
    for name in names:
        print(write_example(name, Path()))
        print("Try it with:")
        for command in EXAMPLES[name].commands:
            print(f"  {command}")
