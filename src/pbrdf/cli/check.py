"""``pbrdf check``: is a file of data understood, and what is in it."""

from __future__ import annotations

from typing import Annotated

from pbrdf.cli.options import data_argument, with_reading_options
from pbrdf.cli.reading import Reading
from pbrdf.errors import visible

__all__ = ["check"]


@with_reading_options
def check(
    file: Annotated[str, data_argument("FILE")],
    *,
    reading: Reading,
) -> None:
    """Tell what a file of data holds, and what is wrong or suspicious in it.

    The exit code is 2 if the file cannot be used as it stands.

    A file to try it with: `pbrdf example table`

    `pbrdf check paint.csv`

    A file with names of its own: `pbrdf check camera.csv --column group=position`
    """
    from pbrdf.data import check as issues_of
    from pbrdf.report.dataset.describe import columns_in_words, describe, on_the_command_line

    dataset = reading.open(file, say=False)
    for line in describe(dataset):
        print(visible(line))
    for i, line in enumerate(columns_in_words(dataset)):
        print(visible(line if i else f"columns: {line}"))
    issues = issues_of(dataset)
    for issue in issues:
        print(visible(f"{issue.severity}: {on_the_command_line(str(issue))}"))
    if not issues:
        print("Nothing is wrong with it.")
