"""How the figures look: colours that colour-blind readers tell apart, legible sizes, no global state."""

from __future__ import annotations

import io
import math
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.errors import DataError, PbrdfError
from pbrdf.files.atomic import atomic_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "BLUE",
    "DISTINCT_COLOURS",
    "DOTS_PER_INCH",
    "FIGURE_FORMATS",
    "GREY",
    "RED",
    "Look",
    "check_figure_format",
    "figure_bytes",
    "leave_out_help_texts",
    "looks_of",
    "new_figure",
    "panels",
    "png",
    "save_figure",
    "styled",
]

#: Okabe and Ito's colours that show on white; their yellow does not.
_OKABE_ITO = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
BLUE, RED, GREY = _OKABE_ITO[0], _OKABE_ITO[1], "#777777"
#: Up to so many curves have a colour that has a name.
DISTINCT_COLOURS = len(_OKABE_ITO)
#: So that the groups are told apart in black and white too.
_MARKERS = "os^Dv<>pPX"

_RC: dict[str, Any] = {
    "font.size": 10.0,
    "axes.titlesize": 11.0,
    "axes.labelsize": 10.0,
    "legend.fontsize": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#E4E4E4",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "lines.linewidth": 1.4,
    "lines.markersize": 4.5,
    "svg.hashsalt": "pbrdf",
    "axes.titley": 1.0,  # no search for the ticks that a title might meet
    "pdf.fonttype": 42,
}
#: Resolution of figures.
DOTS_PER_INCH = 140
#: Formats that figures are written in, with what Matplotlib is told. No dates, so that the same figure is the same
#: file.
FIGURE_FORMATS: dict[str, dict[str, Any]] = {
    "png": {"dpi": DOTS_PER_INCH},
    "pdf": {"metadata": {"CreationDate": None}},
    "svg": {"metadata": {"Date": None}},
}


def check_figure_format(text: str, option: str = "figure_format") -> None:
    """Raise PbrdfError unless this is one of :data:`FIGURE_FORMATS`; ``option`` names what it was given for."""
    if text not in FIGURE_FORMATS:
        raise PbrdfError(f"{option} {text!r}: choose one of {', '.join(FIGURE_FORMATS)}")


@contextmanager
def styled() -> Iterator[None]:
    """Matplotlib with the project's settings while a figure is built or saved, whatever the user's are."""
    import matplotlib

    # matplotlib.rcdefaults would read all of matplotlib's style sheets
    settings: dict[Any, Any] = {k: v for k, v in matplotlib.rcParamsDefault.items() if k != "backend"} | _RC
    with matplotlib.rc_context(settings):
        yield


def new_figure(width: float, height: float) -> Figure:
    """A figure of this size in inches, laid out by matplotlib, that belongs to no window."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def panels(
    rows: int, columns: int, size: tuple[float, float], title: str, handles: list[Any]
) -> tuple[Figure, Any]:
    """A figure with a grid of axes, a title above and a legend below.

    Everything has its place in inches: to let matplotlib find the places takes longer than to draw.

    Parameters
    ----------
    rows, columns
        Of the grid.
    size
        Width and height of the axes, inches.
    title
        Above all.
    handles
        Entries of the legend.

    Returns
    -------
    figure, axes
        The axes have the shape (rows, columns).
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    left, right, top, bottom, between, above = 0.8, 0.2, 0.8, 0.6, 0.95, 0.75
    width = left + columns * size[0] + (columns - 1) * between + right
    longest = max(len(handle.get_label()) for handle in handles)
    across = min(max(int(width / (0.075 * longest + 0.6)), 1), len(handles))
    legend = 0.24 * math.ceil(len(handles) / across) + 0.1
    height = bottom + legend + rows * size[1] + (rows - 1) * above + top
    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    axes = figure.subplots(
        rows,
        columns,
        squeeze=False,
        gridspec_kw={
            "left": left / width,
            "right": 1.0 - right / width,
            "bottom": (bottom + legend) / height,
            "top": 1.0 - top / height,
            "wspace": between / size[0],
            "hspace": above / size[1],
        },
    )
    figure.suptitle(title, y=1.0 - 0.15 / height, verticalalignment="top")
    figure.legend(
        handles=handles, loc="lower center", ncols=across, frameon=False, bbox_to_anchor=(0.5, 0.02 / height)
    )
    return figure, axes


@dataclass(frozen=True)
class Look:
    """Colour and marker of what belongs together."""

    colour: str
    marker: str


def looks_of(count: int) -> list[Look]:
    """Looks of so many curves: colours with names for a few, an ordered ramp for many."""
    colours: tuple[str, ...] = _OKABE_ITO
    if count > DISTINCT_COLOURS:
        from matplotlib import colormaps
        from matplotlib.colors import to_hex

        # ordered in lightness as well; its bright end would be lost on white
        ramp = colormaps["viridis"]
        colours = tuple(to_hex(ramp(0.92 * i / (count - 1))) for i in range(count))
    return [Look(colours[i], _MARKERS[i % len(_MARKERS)]) for i in range(count)]


def save_figure(figure: Figure, path: Path) -> None:
    """Save a figure in the format of the file's extension; the same input gives the same bytes.

    Raises
    ------
    DataError
        If the format is not known or the file cannot be written.
    """
    kind = path.suffix.lower().removeprefix(".")
    if kind not in FIGURE_FORMATS:
        raise DataError(f"{path}: figures are written as {', '.join('.' + k for k in FIGURE_FORMATS)}")
    with atomic_file(path) as target:
        target.write_bytes(figure_bytes(figure, kind))


def figure_bytes(figure: Figure, kind: str) -> bytes:
    """A figure as a file of one of :data:`FIGURE_FORMATS`; the same input gives the same bytes."""
    with styled():
        if kind == "png":
            return png(_pixels(figure))
        file = io.BytesIO()
        figure.savefig(file, format=kind, **FIGURE_FORMATS[kind])
        return file.getvalue()


def _pixels(figure: Figure) -> np.ndarray:
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(figure)
    canvas.print_figure(io.BytesIO(), format="rgba", **FIGURE_FORMATS["png"])
    return np.asarray(canvas.buffer_rgba())


def png(pixels: np.ndarray) -> bytes:
    """A drawn figure as PNG: opaque, every row as its difference from the one above.

    Lines and letters on white differ little from row to row, so that the quickest compression makes smaller files of
    these differences than Pillow does, which looks for the best filter of each row, in a quarter of its time.

    Parameters
    ----------
    pixels
        RGBA, shape (height, width, 4), bytes.
    """
    height, width, _ = pixels.shape
    flat = pixels[..., :3].reshape(height, 3 * width)
    rows = np.empty((height, 1 + 3 * width), dtype=np.uint8)
    rows[:, 0] = 2  # the filter "up"
    rows[0, 1:] = flat[0]
    np.subtract(flat[1:], flat[:-1], out=rows[1:, 1:])
    per_metre = round(DOTS_PER_INCH / 0.0254)
    chunks = {
        b"IHDR": struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0),
        b"pHYs": struct.pack(">IIB", per_metre, per_metre, 1),
        b"IDAT": zlib.compress(rows.data, 1),
        b"IEND": b"",
    }
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))
        for name, content in chunks.items()
    )


def leave_out_help_texts() -> None:
    """Have matplotlib loaded without the help texts that it composes for its classes, a third of the time it takes.

    For processes in which nobody reads them, the command line's.
    """
    import matplotlib.artist

    matplotlib.artist.kwdoc = lambda artist: ""
