"""An identification as it shows itself in Python: its text, its table in a notebook."""

from __future__ import annotations

from html import escape

import xarray as xr

from pbrdf.identification.identify import Identification
from pbrdf.report.identification.subject import HEADINGS, Identified, rests_on, rows_of, sentence
from pbrdf.report.identification.summary import summary_text

__all__ = ["html", "summary"]

#: What data without a title, and a library that is no file, are called.
_UNNAMED, _LIBRARY = "data", "as given"


def summary(found: Identification) -> str:
    """What ``pbrdf identify`` prints."""
    return summary_text(_report(found))


def html(found: Identification) -> str:
    """The set in a sentence, a table of the candidates, and what both rest on."""
    head = "".join(f"<th>{title}</th>" for title in HEADINGS)
    rows = "".join(
        f"<tr>{''.join(f'<td>{escape(text)}</td>' for text in row)}</tr>" for row in rows_of(found)
    )
    lines = "".join(f"<p>{escape(line)}</p>" for line in rests_on(_report(found)))
    table = f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"
    return f"<div><p>{escape(sentence(found))}</p>{table}{lines}</div>"


def _report(found: Identification) -> Identified:
    dataset = xr.Dataset() if found.dataset is None else found.dataset
    return Identified(found, dataset, str(dataset.attrs.get("title") or _UNNAMED), _LIBRARY, found.prior)
