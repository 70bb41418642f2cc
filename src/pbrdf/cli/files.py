"""``pbrdf check`` and ``pbrdf convert``: is a file understood, and its data in our own form."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pbrdf.cli.reading import WRITTEN, Reading, with_reading_options
from pbrdf.cli.values import require_folder_of

__all__ = ["check", "convert"]


@with_reading_options
def check(
    file: Annotated[str, typer.Argument(metavar="FILE", help="File of measured data, or a bundled paint.")],
    *,
    reading: Reading,
) -> None:
    """Tell what a file of data holds, and what is wrong or suspicious in it.

    The exit code is 2 if the file cannot be used as it stands.
    """
    from pbrdf.data import check as issues_of
    from pbrdf.report.dataset.describe import describe

    dataset = reading.open(file)
    for line in describe(dataset):
        print(line)
    issues = issues_of(dataset)
    for issue in issues:
        print(f"{issue.severity}: {issue}")
    if not issues:
        print("Nothing is wrong with it.")


@with_reading_options
def convert(
    file: Annotated[str, typer.Argument(metavar="IN", help="File of measured data, or a bundled paint.")],
    output: Annotated[Path, typer.Argument(metavar="OUT", help=f"New file: {WRITTEN}.")],
    *,
    reading: Reading,
) -> None:
    """Write a file of data in the project's own CSV, netCDF or Zarr form."""
    from pbrdf.data import write

    require_folder_of(output)
    dataset = reading.open(file)
    write(dataset, output)
    print(f"{output}: {dataset.sizes['geometry']} geometries")
