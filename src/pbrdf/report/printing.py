"""What is printed: tables that look alike, and the parts of a summary one after the other."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from pbrdf.errors import visible

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.table import Table

__all__ = ["bare_table", "plain_table", "print_parts", "printing_console"]


def plain_table(title: str, *columns: str) -> Table:
    """A table with a title, the first column of words, the others of numbers."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    table = Table(box=SIMPLE_HEAD, title=title, title_justify="left")
    for k, name in enumerate(columns):
        table.add_column(name, justify="right" if k else "left")
    return table


def bare_table(*, header: bool = True) -> Table:
    """A table without lines, two spaces between its columns, which the caller adds."""
    from rich.table import Table

    return Table(box=None, show_header=header, pad_edge=False, padding=(0, 2, 0, 0))


def print_parts(parts: Iterable[RenderableType], console: Console) -> None:
    """Print sentences and tables; square brackets in a sentence are no markup."""
    for part in parts:
        console.print(part, markup=False) if isinstance(part, str) else console.print(part)


def printing_console(**options: Any) -> Console:
    """A console that prints text as it stands, but characters that command a terminal spelled.

    Parameters
    ----------
    **options
        Of :class:`rich.console.Console`.
    """
    from rich.console import Console
    from rich.segment import Segment

    class Printing(Console):
        def render(self, *arguments: Any, **more: Any) -> Iterable[Segment]:
            for segment in super().render(*arguments, **more):
                yield segment if segment.control else Segment(visible(segment.text), segment.style)

    return Printing(highlight=False, **options)
