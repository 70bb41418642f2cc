"""Pieces of a page that needs nothing but itself: tables, figures, the frame around them."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path

__all__ = ["figure", "page", "paragraph", "table", "verdict"]

_STYLE = """
:root { color-scheme: light; }
body { font: 16px/1.5 system-ui, "Segoe UI", "DejaVu Sans", sans-serif; color: #1a1a1a; background: #fff;
       max-width: 1160px; margin: 0 auto; padding: 0 20px 60px; }
h1 { font-size: 1.7rem; margin: 1.2em 0 .3em; } h2 { font-size: 1.25rem; margin: 2.2em 0 .4em; }
p, li { max-width: 60em; } a { color: #0072B2; }
.banner { background: #FFF3D6; border-left: 6px solid #E69F00; padding: .7em 1em; margin: 1em 0; font-weight: 600; }
figure { margin: 1em 0; } figure img { max-width: 100%; height: auto; } figcaption { font-size: .9rem; color: #444; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: .86rem; margin: .8em 0; }
caption { text-align: left; font-size: .9rem; color: #444; padding-bottom: .4em; }
th, td { padding: .3em .6em; border-bottom: 1px solid #ddd; text-align: left; vertical-align: top; }
th { border-bottom: 2px solid #888; } td.n, th.n { text-align: right; white-space: nowrap; }
tr.theirs td { background: #f2f2f2; } tr.first td { border-top: 2px solid #888; }
.holds { color: #00664a; font-weight: 600; white-space: nowrap; }
.fails { color: #B34700; font-weight: 700; white-space: nowrap; }
.small { font-size: .8rem; color: #444; } footer { margin-top: 3em; color: #444; font-size: .9rem; }
"""


def page(title: str, banner: str, parts: Iterable[str]) -> str:
    """A whole document; `parts` are pieces of HTML."""
    body = "\n".join(parts)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n<h1>{escape(title)}</h1>\n"
        f'<div class="banner">{escape(banner)}</div>\n{body}\n'
        f"<footer>{escape(banner)}</footer>\n</body>\n</html>\n"
    )


def paragraph(text: str) -> str:
    """A paragraph of plain text."""
    return f"<p>{escape(text)}</p>"


def figure(image: Path, alternative: str, caption: str, files: Sequence[str] = ()) -> str:
    """A PNG picture, put into the page itself, with links to the files beside it."""
    content = base64.b64encode(image.read_bytes()).decode("ascii")
    links = " · ".join(f'<a href="{escape(name)}">{escape(Path(name).name)}</a>' for name in files)
    return (
        f'<figure><img src="data:image/png;base64,{content}" alt="{escape(alternative)}">'
        f"<figcaption>{escape(caption)}{' ' + links if links else ''}</figcaption></figure>"
    )


def verdict(passed: bool) -> str:
    """``holds`` or ``fails``, told apart by sign and word as well as by colour."""
    return '<span class="holds">✓ holds</span>' if passed else '<span class="fails">✗ fails</span>'


def table(
    caption: str,
    headings: Sequence[str],
    rows: Iterable[Sequence[str | None]],
    *,
    numeric: Sequence[int] = (),
    classes: Sequence[str] = (),
) -> str:
    """A table; cells are pieces of HTML, a cell ``None`` is spanned by the one before it.

    Parameters
    ----------
    caption, headings
        Plain text.
    rows
        Cells; those that hold text of others must be escaped by the caller.
    numeric
        Columns that are set flush right.
    classes
        A class for each row, or none at all.
    """
    head = "".join(
        f'<th scope="col"{_class(i in numeric)}>{escape(text)}</th>' for i, text in enumerate(headings)
    )
    lines = []
    for number, row in enumerate(rows):
        cells = []
        for i, cell in enumerate(row):
            if cell is None:
                continue
            span = 1
            while i + span < len(row) and row[i + span] is None:
                span += 1
            wide = f' colspan="{span}"' if span > 1 else ""
            cells.append(f"<td{_class(i in numeric)}{wide}>{cell}</td>")
        mark = f' class="{classes[number]}"' if classes and classes[number] else ""
        lines.append(f"<tr{mark}>{''.join(cells)}</tr>")
    body = "\n".join(lines)
    return (
        f'<div class="scroll"><table><caption>{escape(caption)}</caption><thead><tr>{head}</tr></thead>\n'
        f"<tbody>\n{body}\n</tbody></table></div>"
    )


def _class(numeric: bool) -> str:
    return ' class="n"' if numeric else ""
