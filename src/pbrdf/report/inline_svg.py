"""A figure as SVG within a page: it takes the page's colours, light or dark, and says what it shows.

Matplotlib's black, white and the grey of its grid become the page's ink, paper and grid (variables of ``page.css``);
the colours of most curves stay. Identifiers are made unique, so that several figures can stand in one page.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from pbrdf.report.style import DOTS_PER_INCH, png, styled

if TYPE_CHECKING:
    from pathlib import Path

    from markupsafe import Markup
    from matplotlib.figure import Figure

__all__ = ["inline_svg"]

#: Points of a panel from which on they are put in as a picture: the page would become too large.
_MANY_POINTS = 1500
#: CSS pixels per dot of a figure.
_PIXELS_PER_DOT = 96.0 / DOTS_PER_INCH
#: Part of its natural width below which a figure is no longer legible: it scrolls in its box then.
_LEGIBLE = 0.72
#: What becomes a colour of the page; dark blue and dark green are hard to see on black.
_PAGE_COLOURS = {
    "#000000": "currentColor",
    "#ffffff": "var(--paper)",
    "#e4e4e4": "var(--grid)",
    "#0072b2": "var(--curve-blue)",
    "#009e73": "var(--curve-green)",
}
_FONTS = "system-ui, 'DejaVu Sans', sans-serif"


def inline_svg(figure: Figure, alternative: str, name: str, picture: Path | None = None) -> Markup:
    """The figure as an ``svg`` element.

    Parameters
    ----------
    figure
        What to draw; the points of panels that have very many become pictures.
    alternative
        What it shows, for those who do not see it.
    name
        Unique within the page; letters, digits and hyphens.
    picture
        Where to save the figure as PNG as well, drawn at the same time.
    """
    import matplotlib
    from markupsafe import Markup, escape

    from pbrdf.report.drawing import drawn

    for ax in figure.axes:
        _keep_small(ax)
    with styled():
        matplotlib.rcParams["svg.fonttype"] = "none"  # text stays text: small, searchable, sharp
        pixels, text = drawn(figure, DOTS_PER_INCH)
    if picture is not None:
        picture.write_bytes(png(pixels))
    opening = re.search(r"<svg\b[^>]*>", text)
    view = re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', text)
    if opening is None or view is None:
        raise AssertionError("matplotlib wrote no SVG")
    body = text[opening.end() : text.rindex("</svg>")]
    body = re.sub(r"<metadata>.*?</metadata>", "", body, count=1, flags=re.DOTALL)
    body = re.sub(r"<style\b.*?</style>", "", body, flags=re.DOTALL)
    body = body.replace("xlink:href", "href")
    body = re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{name}-", body)
    body = _in_colours_of_the_page(body)
    width, height = (_PIXELS_PER_DOT * float(size) for size in view.groups())
    return Markup(
        f'<svg role="img" aria-label="{escape(alternative)}" viewBox="0 0 {view[1]} {view[2]}" width="{width:.0f}" '
        f'height="{height:.0f}" style="min-width:{_LEGIBLE * width:.0f}px"><title>{escape(alternative)}</title>'
        f"{body}</svg>"
    )


def _keep_small(ax: Any) -> None:
    """Have the points of a panel put in as a picture, with their error bars, if they are very many."""
    points = [line for line in ax.get_lines() if line.get_linestyle() == "None"]
    bars = [c for c in ax.collections if hasattr(c, "get_segments")]
    if sum(len(line.get_xdata()) for line in points) > _MANY_POINTS:
        for artist in (*points, *bars):
            artist.set_rasterized(True)


def _in_colours_of_the_page(body: str) -> str:
    body = re.sub(
        r"\b(fill|stroke): (#[0-9a-f]{6})", lambda m: f"{m[1]}: {_PAGE_COLOURS.get(m[2], m[2])}", body
    )
    return re.sub(r"font: ([\d.]+px) [^;\"]*", lambda m: f"font: {m[1]} {_FONTS}", body)
