"""How results show themselves in a notebook: a sentence, a table, and lines below it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

import xarray as xr

__all__ = ["notebook_html", "title_of"]

#: What data without a title are called.
_UNNAMED = "data"


def notebook_html(
    sentence: str, headings: Sequence[str], rows: Iterable[Sequence[str]], lines: Iterable[str]
) -> str:
    """HTML without a style of its own; every argument is plain text."""
    head = "".join(f"<th>{escape(heading)}</th>" for heading in headings)
    body = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows)
    below = "".join(f"<p>{escape(line)}</p>" for line in lines)
    return (
        f"<div><p>{escape(sentence)}</p>"
        f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{below}</div>"
    )


def title_of(dataset: xr.Dataset) -> str:
    """What a result calls its data where no file is known."""
    return str(dataset.attrs.get("title") or _UNNAMED)
