"""An identification as it shows itself in Python: its text, its table in a notebook."""

from __future__ import annotations

import xarray as xr

from pbrdf.identification.identify import Identification
from pbrdf.report.identification.subject import HEADINGS, Identified, rests_on, rows_of, sentence
from pbrdf.report.identification.summary import summary_text
from pbrdf.report.notebook import notebook_html, title_of

__all__ = ["html", "summary"]

#: What a library that is no file is called.
_LIBRARY = "as given"


def summary(found: Identification) -> str:
    """What ``pbrdf identify`` prints."""
    return summary_text(_report(found))


def html(found: Identification) -> str:
    """The set in a sentence, a table of the candidates, and what both rest on."""
    return notebook_html(sentence(found), HEADINGS, rows_of(found), rests_on(_report(found)))


def _report(found: Identification) -> Identified:
    dataset = xr.Dataset() if found.dataset is None else found.dataset
    return Identified(found, dataset, title_of(dataset), _LIBRARY, found.prior)
