"""Pages that need nothing but themselves: one frame (light, dark, phone, print) and the pieces to fill it with.

The templates lie beside this module in ``templates/``: ``page.html`` is the frame, ``page.css`` its style,
``pieces.html`` the pieces. Text that is put into a piece is escaped; pieces themselves (:class:`markupsafe.Markup`) go
into one another as they are.
"""

from __future__ import annotations

import base64
import platform
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from pbrdf.version import __version__

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup

__all__ = [
    "Section",
    "ShownVerdict",
    "bullets",
    "command",
    "embedded_picture",
    "figure",
    "file_list",
    "holds",
    "in_words",
    "markup",
    "paragraph",
    "render_page",
    "subheading",
    "table",
    "terms",
    "versions",
]

#: Look of a verdict by words in its level: what is worth most is looked for last.
_TONES = (("part", "partly"), ("not", "bad"), ("describes", "good"))


class ShownVerdict(Protocol):
    """What is shown above everything else: what a result is worth.

    Attributes
    ----------
    level
        How good; gives the colour: with ``part`` in it as in part, with ``not`` as bad, else ``describes`` as good.
    sentence
        The verdict.
    reasons
        Sentences on why.
    """

    @property
    def level(self) -> str: ...

    @property
    def sentence(self) -> str: ...

    @property
    def reasons(self) -> Sequence[str]: ...


@dataclass(frozen=True)
class Section:
    """A part of a page.

    Attributes
    ----------
    title
        Its heading, plain text; empty for none.
    parts
        What it holds, pieces made by the functions of this module.
    """

    title: str
    parts: Sequence[Markup] = field(default_factory=list)

    @property
    def anchor(self) -> str:
        """Name by which a link finds the section."""
        return re.sub(r"\W+", "-", self.title.lower()).strip("-")


def render_page(
    title: str,
    sections: Iterable[Section],
    *,
    lead: str = "",
    banner: str = "",
    verdict: ShownVerdict | None = None,
    footer: str = "",
    navigation: bool = False,
) -> str:
    """A whole document.

    Parameters
    ----------
    title
        Heading and title of the page.
    sections
        What it holds, in order.
    lead
        A sentence below the heading.
    banner
        A warning that no reader may miss; stands at the end again, unless there is a ``footer``.
    verdict
        What the result is worth; None for no verdict.
    footer
        The last line.
    navigation
        Whether links to the sections stand at the top.

    Returns
    -------
    str
        The page as HTML: nothing in it is fetched from elsewhere, and it holds no script.
    """
    return (
        _templates()
        .get_template("page.html")
        .render(
            title=title,
            sections=list(sections),
            lead=lead,
            banner=banner,
            verdict=verdict,
            tone="" if verdict is None else _tone(str(verdict.level)),
            footer=footer,
            navigation=navigation,
        )
    )


def paragraph(text: str) -> Markup:
    """A paragraph."""
    return _piece("paragraph", text)


def subheading(text: str) -> Markup:
    """A heading within a section."""
    return markup("<h3>{}</h3>", text)


def bullets(lines: Iterable[str]) -> Markup:
    """A list."""
    return _piece("bullets", list(lines))


def terms(pairs: Iterable[tuple[str, Sequence[str]]]) -> Markup:
    """Words in the margin, each with its lines."""
    return _piece("terms", list(pairs))


def command(line: str) -> Markup:
    """A line for a shell."""
    return _piece("command", line)


def holds(passed: bool, yes: str = "holds", no: str = "fails") -> Markup:
    """``✓ holds`` or ``✗ fails``, told apart by sign and word as well as by colour."""
    return _piece("holds", passed, yes if passed else no)


def figure(image: Markup, caption: str, files: Sequence[str] = ()) -> Markup:
    """A picture with what is to be said of it, and links to the files beside the page that hold it too.

    Parameters
    ----------
    image
        As of :func:`embedded_picture` or :func:`pbrdf.report.inline_svg.inline_svg`.
    caption
        Text below.
    files
        Paths from the page.
    """
    return _piece("figure", image, caption, [(path, Path(path).name) for path in files])


def embedded_picture(path: Path, alternative: str) -> Markup:
    """A PNG picture, put into the page itself; ``alternative`` says what it shows to those who do not see it."""
    return _piece("picture", base64.b64encode(path.read_bytes()).decode("ascii"), alternative)


def table(
    caption: str,
    headings: Sequence[str],
    rows: Iterable[Sequence[str | Markup | None]],
    *,
    numeric: Sequence[int] = (),
    classes: Sequence[str] = (),
) -> Markup:
    """A table in a box of its own, which scrolls where the page is narrow.

    Parameters
    ----------
    caption, headings
        Plain text.
    rows
        Cells; one that is ``None`` is spanned by the one before it.
    numeric
        Columns that are set flush right.
    classes
        A class for each row, or none at all: ``first`` of a block, ``theirs`` shaded, ``held`` out bold, ``doubtful``,
        ``fixed``.
    """
    return _piece("table", caption, headings, [_spans(row) for row in rows], list(numeric), list(classes))


def file_list(files: Iterable[str]) -> Markup:
    """Links to the files beside the page, by their names."""
    links = markup(" · ").join(markup('<a href="{}">{}</a>', name, name) for name in files)
    return markup("<p>Files beside this page: {}</p>", links)


def versions(packages: Iterable[str]) -> str:
    """The versions of pbrdf, Python and packages."""
    own = [f"pbrdf {__version__}", f"Python {platform.python_version()}"]
    return ", ".join([*own, *(f"{name} {version(name)}" for name in packages)])


def in_words(value: object) -> str:
    """A setting's value as text: of mappings and sequences what is in them."""
    if isinstance(value, Mapping):
        return ", ".join(f"{k} = {in_words(v)}" for k, v in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(map(in_words, value))
    return str(value)


def markup(template: str, *values: Any) -> Markup:
    """A piece of HTML of one's own; the values put in at ``{}`` are escaped unless they are pieces."""
    from markupsafe import Markup

    return Markup(template).format(*values)


def _spans(row: Sequence[str | Markup | None]) -> list[tuple[int, int, str | Markup]]:
    """Column, width and content of the cells that are there."""
    cells = []
    for i, cell in enumerate(row):
        if cell is None:
            continue
        span = 1
        while i + span < len(row) and row[i + span] is None:
            span += 1
        cells.append((i, span, cell))
    return cells


def _tone(level: str) -> str:
    return next((tone for word, tone in _TONES if word in level.lower()), "")


def _piece(name: str, *arguments: Any) -> Markup:
    from markupsafe import Markup

    return Markup(getattr(_templates().get_template("pieces.html").module, name)(*arguments))


@cache
def _templates() -> Environment:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    return Environment(
        loader=PackageLoader("pbrdf.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
