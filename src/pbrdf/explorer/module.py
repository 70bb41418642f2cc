"""The explorer's one ES module, in AnyWidget form, put together from the files in ``page``.

A notebook takes a module as one text, so it cannot import others: the files are joined in the order below, in one
scope, and hold no imports or exports of their own.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

__all__ = ["PAGE", "module_text"]

#: Folder of the files.
PAGE = Path(__file__).parent / "page"
#: The files of the module, in order; a file uses names of those before it.
PARTS = (
    "elements.js",
    "graphics.js",
    "legend.js",
    "application.js",
    "address.js",
    "controls.js",
    "unsaid.js",
    "files.js",
    "views/hemisphere.js",
    "views/map.js",
    "views/cuts.js",
    "views/sphere.js",
    "views/polar.js",
    "views/mueller.js",
    "panels/models.js",
    "panels/parameters.js",
    "panels/light.js",
    "panels/quantities.js",
    "panels/data.js",
    "panels/fit.js",
    "panels/export.js",
    "empty.js",
    "explorer.js",
)


@cache
def module_text() -> str:
    """The module."""
    return "\n".join((PAGE / part).read_text(encoding="utf-8") for part in PARTS)
