"""How the figures look: colours that colour-blind readers tell apart, legible sizes, no global state."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from pbrdf.data.storage import atomic_target
from pbrdf.errors import DataError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["BLUE", "GREY", "MARKERS", "RED", "colours", "new_figure", "save_figure", "styled"]

#: Okabe and Ito's colours that show on white; their yellow does not.
_OKABE_ITO = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
BLUE, RED, GREY = _OKABE_ITO[0], _OKABE_ITO[1], "#777777"
#: So that the groups are told apart in black and white too.
MARKERS = "os^Dv<>pPX"

_RC = {
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
    "pdf.fonttype": 42,
}
_DOTS_PER_INCH = 140


@contextmanager
def styled() -> Iterator[None]:
    """Matplotlib with the project's settings while a figure is built or saved, whatever the user's are."""
    import matplotlib

    with matplotlib.rc_context({**matplotlib.rcParamsDefault, **_RC, "backend": "agg"}):
        yield


def new_figure(width: float, height: float) -> Figure:
    """A figure of this size in inches that belongs to no window and needs no display."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def colours(count: int) -> list[str]:
    """Colours for so many curves: distinct ones for a few, an ordered ramp for many."""
    if count <= len(_OKABE_ITO):
        return list(_OKABE_ITO[:count])
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    # ordered in lightness as well; its bright end would be lost on white
    ramp = colormaps["viridis"]
    return [to_hex(ramp(0.92 * i / (count - 1))) for i in range(count)]


def save_figure(figure: Figure, path: Path) -> None:
    """Save a figure in the format of the file's extension; the same input gives the same bytes.

    Raises
    ------
    DataError
        If the format is not known or the file cannot be written.
    """
    kind = path.suffix.lower().removeprefix(".")
    undated: dict[str, dict[str, None]] = {"png": {}, "pdf": {"CreationDate": None}, "svg": {"Date": None}}
    if kind not in undated:
        raise DataError(f"{path}: figures are written as {', '.join('.' + k for k in undated)}")
    with styled(), atomic_target(path) as target:
        figure.savefig(target, format=kind, dpi=_DOTS_PER_INCH, metadata=undated[kind])
