"""``pbrdf convert``: a file of data in our own form."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pbrdf.cli.options import WRITTEN, data_argument, with_reading_options
from pbrdf.cli.reading import Reading
from pbrdf.cli.values import require_folder_of

__all__ = ["convert"]


@with_reading_options
def convert(
    file: Annotated[str, data_argument("IN")],
    output: Annotated[Path, typer.Argument(metavar="OUT", help=f"New file: {WRITTEN}.")],
    *,
    reading: Reading,
) -> None:
    """Write a file of data in the project's own CSV, netCDF or Zarr form.

    A file to try it with: `pbrdf example table`

    `pbrdf convert paint.csv paint.nc`
    """
    from pbrdf.data import write

    require_folder_of(output)
    dataset = reading.open(file)
    write(dataset, output)
    print(f"{output}: {dataset.sizes['geometry']} geometries")
