"""Pictures of a map: all parameters at a glance, each with its standard error and histogram, and the quality.

The colours of values (viridis) and of errors (cividis) rise in lightness and hold for readers who do not tell red from
green; pixels without a result have colours that neither contains. Scales leave out the outermost pixels, as one stray
fit would darken all others: each figure says so.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.report.numbers import brief, per_cent
from pbrdf.report.parameter_map.colours import (
    LEFT_OUT,
    MASKED,
    NO_RESULT,
    NOT_YET,
    ON_BOUND,
    UNDETERMINED,
    WIDE,
    colours_of_states,
    scale_of,
)
from pbrdf.report.parameter_map.shown_map import WITHOUT, ShownMap
from pbrdf.report.picture_grid import Margins, beside, panel_height, picture_grid
from pbrdf.report.style import BLUE, GREY, RED, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["HELD", "drawn_parameters", "overview_figure", "parameter_figure", "quality_figure"]

#: What the figures say of their scales.
HELD = f"scales hold the middle {100.0 - 2.0 * LEFT_OUT:g} % of the pixels"
_VALUES, _ERRORS = "viridis", "cividis"
_HATCH = "#A6A6A6"
#: Counts as colours, 0 or 1 first; the last one stands for more as well.
_COUNTS = ("#F0F0F0", "#A6CEE3", "#3F7FBF", "#1B3A78", "#000000")
#: Width of panels, inches, and the space around them.
_OVERVIEW, _OVERVIEW_MARGINS = 2.5, Margins(0.75, 0.95, 0.95, 0.9, 1.45, 0.75)
_PANEL, _PANEL_MARGINS = 3.3, Margins(0.8, 0.25, 0.95, 0.95, 1.55, 0.95)
_QUALITY_MARGINS = Margins(0.8, 0.75, 0.95, 0.95, 1.6, 0.95)
#: Panels beside each other in the overview, at most: of up to so many parameters, and of more.
_ACROSS, _SOME = (3, 4), 9
#: Height over width of the panels of a line.
_LINE = 0.6
#: Bars of a histogram, at most.
_BINS = 60


def drawn_parameters(shown: ShownMap) -> list[int]:
    """Parameters that differ from pixel to pixel; all of them if none does."""
    return [k for k in range(len(shown.labels)) if shown.varies(k)] or list(range(len(shown.labels)))


def overview_figure(shown: ShownMap, title: str) -> Figure:
    """The parameters that vary, one panel each with its scale.

    Parameters
    ----------
    shown
        The map.
    title
        Above all.
    """
    drawn = drawn_parameters(shown)
    columns = 2 if len(drawn) == 4 else min(len(drawn), _ACROSS[len(drawn) > _SOME])
    # few panels have room for a larger picture
    width = _OVERVIEW * {1: 2.0, 2: 1.6}.get(columns, 1.0)
    with styled():
        rows = math.ceil(len(drawn) / columns)
        figure, axes = picture_grid(rows, columns, width, _proportions(shown), _OVERVIEW_MARGINS)
        _head(figure, title, shown)
        for place, ax in enumerate(axes.ravel()):
            ax.set_visible(place < len(drawn))
        for place, k in enumerate(drawn):
            ax = axes.ravel()[place]
            ax.set_title(shown.labels[k].text)
            _draw_values(ax, shown, k)
            _label_axes(ax, shown, down=place % columns == 0, across=place + columns >= len(drawn))
        _legend(figure, shown, drawn)
        return figure


def parameter_figure(shown: ShownMap, parameter: int, title: str) -> Figure:
    """One parameter: its map, that of its standard error, and how its values are spread.

    Parameters
    ----------
    shown
        The map.
    parameter
        Its place.
    title
        Above all.
    """
    label = shown.labels[parameter]
    with styled():
        figure, axes = picture_grid(1, 3, _PANEL, _proportions(shown), _PANEL_MARGINS)
        _head(figure, f"{title}: {label.text}", shown)
        value, error, histogram = axes[0]
        value.set_title("value ± standard error" if len(shown.window.dims) == 1 else "value")
        _draw_values(value, shown, parameter, band=True)
        error.set_title("standard error")
        _draw_errors(error, shown, parameter)
        for ax in (value, error):
            _label_axes(ax, shown, down=ax is value, across=True)
        _draw_histogram(histogram, shown, parameter)
        _legend(figure, shown, [parameter], errors=True)
        return figure


def quality_figure(shown: ShownMap, title: str) -> Figure:
    """How far to trust a map: χ², state of the fits, optima, parameters at bounds and undetermined ones.

    Parameters
    ----------
    shown
        The map.
    title
        Above all.
    """
    with styled():
        figure, axes = picture_grid(2, 3, _PANEL, _proportions(shown), _QUALITY_MARGINS)
        _head(figure, f"{title}: quality of the fits", shown)
        chi2, state, optima, histogram, bounds, undetermined = axes.ravel()
        chi2.set_title("χ² per degree of freedom")
        _draw_errors(chi2, shown, None)
        _draw_states(state, shown)
        for ax, counts, first, words in (
            (optima, shown.optima, 1, "distinct optima seen"),
            (bounds, shown.at_bounds.sum(axis=0), 0, "parameters at a bound"),
            (undetermined, shown.flagged("undetermined").sum(axis=0), 0, "undetermined parameters"),
        ):
            ax.set_title(words)
            _draw_counts(ax, shown, counts, first)
        for ax in (chi2, state, optima, bounds, undetermined):
            _label_axes(ax, shown, down=ax is chi2, across=True)
        _draw_goodness(histogram, shown)
        _legend(figure, shown)
        return figure


# What the panels share


def _proportions(shown: ShownMap) -> tuple[int, int]:
    """Rows and columns, for the shape of the panels."""
    sizes = shown.window.sizes
    return (round(1000 * _LINE), 1000) if len(sizes) == 1 else (sizes[0], sizes[1])


def _head(figure: Figure, title: str, shown: ShownMap) -> None:
    words = [HELD, shown.window.words(), "not to scale" if _stretched(shown) else ""]
    figure.suptitle(
        f"{title}\n{'; '.join(filter(None, words))}",
        y=1.0 - 0.1 / figure.get_figheight(),
        verticalalignment="top",
        fontsize=10.5,
    )


def _stretched(shown: ShownMap) -> bool:
    """Whether the panels have other proportions than the picture."""
    rows, columns = _proportions(shown)
    return panel_height((rows, columns)) != rows / columns


def _extent(shown: ShownMap) -> tuple[float, float, float, float]:
    """Left, right, bottom and top edge, the first row at the top."""
    (top, bottom), (left, right) = (_edges(shown, dim) for dim in shown.window.dims)
    return left, right, bottom, top


def _edges(shown: ShownMap, dim: str) -> tuple[float, float]:
    """Outer edges of the first and the last pixel along a dimension."""
    values = shown.coordinates[dim][0]
    half = 0.5 * (values[1] - values[0]) if values.size > 1 else 0.5
    return values[0] - half, values[-1] + half


def _label_axes(ax: Axes, shown: ShownMap, *, down: bool, across: bool) -> None:
    dims = shown.window.dims
    if across:
        ax.set_xlabel(shown.coordinates[dims[-1]][1])
    if len(dims) == 2:
        from matplotlib.ticker import MaxNLocator

        for axis, dim in ((ax.yaxis, dims[0]), (ax.xaxis, dims[1])):
            axis.set_major_locator(
                MaxNLocator(5, integer=shown.coordinates[dim][1].endswith("pixels"), steps=[1, 2, 5, 10])
            )
        if down:
            ax.set_ylabel(shown.coordinates[dims[0]][1])


def _ground(ax: Axes) -> None:
    """Hatch what has no pixels drawn on it."""
    ax.grid(False)
    ax.set_facecolor(MASKED)
    ax.patch.set_hatch("////")
    ax.patch.set_edgecolor(_HATCH)
    ax.patch.set_linewidth(0.0)


def _picture(ax: Axes, shown: ShownMap, values: np.ndarray, where: np.ndarray, **options: Any) -> Any:
    """Draw pixels in the colours of a scale; the others stay as they are."""
    options |= {
        "extent": _extent(shown),
        "interpolation": "nearest",
        "aspect": "auto" if _stretched(shown) else "equal",
    }
    return ax.imshow(np.ma.masked_where(~where, values), **options)


def _plain(ax: Axes, shown: ShownMap, where: np.ndarray, colour: str) -> None:
    """Draw pixels in one colour."""
    from matplotlib.colors import ListedColormap

    if where.any():
        _picture(ax, shown, np.ones(where.shape), where, cmap=ListedColormap([colour]), vmin=0, vmax=1)


def _without_result(shown: ShownMap) -> np.ndarray:
    values: np.ndarray = ~(shown.good | shown.masked | shown.pending)
    return values


def _others(ax: Axes, shown: ShownMap) -> None:
    """Pixels without a result, and those that nobody has come to."""
    _plain(ax, shown, _without_result(shown), NO_RESULT)
    _plain(ax, shown, shown.pending, NOT_YET)


def _bar(ax: Axes, image: Any, label: str, values: np.ndarray, low: float, high: float) -> None:
    """The scale beside a panel, with tips where there is more."""
    values = values[np.isfinite(values)]
    below, above = bool((values < low).any()), bool((values > high).any())
    extend = {(0, 0): "neither", (1, 0): "min", (0, 1): "max", (1, 1): "both"}[int(below), int(above)]
    bar = ax.figure.colorbar(
        image, cax=ax.inset_axes((1.0, 0.0, 0.05, 1.0), transform=beside(ax)), label=label, extend=extend
    )
    formatter: Any = bar.formatter
    if hasattr(formatter, "set_useOffset"):
        formatter.set_useOffset(False)
        formatter.set_powerlimits((-3, 5))
    else:
        _plain_ticks(bar.ax.yaxis)


def _plain_ticks(axis: Any) -> None:
    """Few numbers along a logarithmic axis, written out."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=8))
    axis.set_major_formatter(FuncFormatter(lambda value, _: brief(value, 2)))
    axis.set_minor_formatter(NullFormatter())


def _legend(figure: Figure, shown: ShownMap, parameters: Sequence[int] = (), *, errors: bool = False) -> None:
    """Name the colours of the pixels without a value, or without a standard error."""
    from matplotlib.patches import Patch

    undetermined = [shown.good & ~shown.determined(k) for k in parameters]
    without = [shown.determined(k) & ~np.isfinite(shown.standard_error[k]) for k in parameters if errors]
    handles = []
    kinds: tuple[tuple[np.ndarray, str, dict[str, Any]], ...] = (
        (
            shown.masked,
            "not measured or left out",
            {"facecolor": MASKED, "edgecolor": _HATCH, "hatch": "////"},
        ),
        (_without_result(shown), "no result", {"color": NO_RESULT}),
        (shown.pending, "not yet fitted", {"facecolor": NOT_YET, "edgecolor": "black"}),
        (np.array(undetermined), "undetermined", {"color": UNDETERMINED}),
        (np.array(without), "on a bound: no standard error", {"color": ON_BOUND}),
    )
    for where, words, options in kinds:
        if where.any():
            handles.append(Patch(label=words, linewidth=0.6, **options))
    if handles:
        figure.legend(handles=handles, loc="lower center", ncols=len(handles), frameon=False)


# Panels


def _draw_values(ax: Axes, shown: ShownMap, parameter: int, *, band: bool = False) -> None:
    label, values, good = shown.labels[parameter], shown.estimate[parameter], shown.determined(parameter)
    low, high = scale_of(values[good])
    if len(shown.window.dims) == 1:
        values = np.where(good, values, np.nan)
        _line(ax, shown, values, shown.standard_error[parameter] if band else None)
        ax.set_ylabel(label.unit)
        margin = 0.15 * (high - low)
        ax.set_ylim(low - margin, high + margin)
        return
    _ground(ax)
    image = _picture(ax, shown, values, good & np.isfinite(values), cmap=_VALUES, vmin=low, vmax=high)
    _plain(ax, shown, shown.good & ~good, UNDETERMINED)
    _others(ax, shown)
    _bar(ax, image, label.unit, values[good], low, high)


def _draw_errors(ax: Axes, shown: ShownMap, parameter: int | None) -> None:
    """The standard error of a parameter, or χ² per degree of freedom."""
    from matplotlib.colors import LogNorm, Normalize

    if parameter is None:
        values, unit = shown.reduced_chi2, ""
    else:
        values, unit = shown.standard_error[parameter], shown.labels[parameter].unit
    where = shown.good & np.isfinite(values) & (values >= 0.0)
    low, high = scale_of(values[where])
    wide = low > 0.0 and high / low > WIDE
    if not wide:
        low = 0.0
    if len(shown.window.dims) == 1:
        _line(ax, shown, values, None)
        ax.set_ylabel(unit)
        if wide:
            ax.set_yscale("log")
            _plain_ticks(ax.yaxis)
        ax.set_ylim(0.9 * low, 1.1 * high)
        return
    _ground(ax)
    norm = LogNorm(low, high) if wide else Normalize(low, high)
    image = _picture(ax, shown, values, where, cmap=_ERRORS, norm=norm)
    if parameter is not None:
        determined = shown.determined(parameter)
        _plain(ax, shown, shown.good & ~determined, UNDETERMINED)
        _plain(ax, shown, determined & ~where, ON_BOUND)
    _others(ax, shown)
    _bar(ax, image, unit, values[where], low, high)


def _line(ax: Axes, shown: ShownMap, values: np.ndarray, errors: np.ndarray | None) -> None:
    """Values along the single dimension of a map, with gaps where there is no result."""
    at = shown.coordinates[shown.window.dims[0]][0]
    values = np.where(shown.good, values, np.nan)
    few = np.count_nonzero(shown.good) <= 200
    ax.plot(at, values, color=BLUE, linewidth=1.0, marker="o" if few else "", markersize=2.5)
    if errors is not None:
        ax.fill_between(at, values - errors, values + errors, color=BLUE, alpha=0.25, linewidth=0.0)
    if at.size > 1:
        ax.set_xlim(at[0], at[-1])
    for where, colour in ((shown.masked, _HATCH), (_without_result(shown), NO_RESULT)):
        ax.plot(
            at[where],
            np.zeros(where.sum()),
            "|",
            color=colour,
            transform=ax.get_xaxis_transform(),
            clip_on=False,
        )


def _draw_states(ax: Axes, shown: ShownMap) -> None:
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    colours = colours_of_states(shown.states)
    _ground(ax)
    if len(shown.window.dims) == 1:
        ax.imshow(
            np.ma.masked_where(shown.masked, shown.status)[None],
            cmap=ListedColormap(colours),
            vmin=0,
            vmax=len(colours) - 1,
            interpolation="nearest",
            extent=(*_edges(shown, shown.window.dims[0]), 0.0, 1.0),
            aspect="auto",
        )
        ax.set_yticks([])
    handles = []
    for k, name in enumerate(shown.states):
        where = shown.status == k
        if not where.any():
            continue
        hatched = name in WITHOUT
        handles.append(
            Patch(
                facecolor=colours[k],
                edgecolor=_HATCH if hatched else "black",
                hatch="////" if hatched else None,
                linewidth=0.5,
                label=f"{name.replace('_', ' ')}\n{per_cent(where.mean())}",
            )
        )
        if len(shown.window.dims) == 2 and not hatched:
            _plain(ax, shown, where, colours[k])
    ax.set_title("state of the fit")
    ax.legend(
        handles=handles,
        loc="upper left",
        bbox_to_anchor=(1.01, 1.02),
        frameon=False,
        fontsize=8,
        handlelength=1.0,
        borderpad=0.2,
    )


def _draw_counts(ax: Axes, shown: ShownMap, counts: np.ndarray, first: int) -> None:
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.ticker import MaxNLocator

    good = shown.good
    if len(shown.window.dims) == 1:
        _line(ax, shown, counts.astype(float), None)
        ax.set_ylim(first - 0.5, max(int(counts.max(initial=first)), first + 1) + 0.5)
        ax.yaxis.set_major_locator(MaxNLocator(integer=True))
        return
    _ground(ax)
    most = int(counts[good].max(initial=first + 1))
    last = min(most, first + len(_COUNTS) - 1)
    colours = _COUNTS[: last - first + 1]
    bounds = np.arange(first, last + 2) - 0.5
    image = _picture(
        ax,
        shown,
        np.clip(counts, first, last),
        good,
        cmap=ListedColormap(list(colours)),
        norm=BoundaryNorm(bounds, len(colours)),
    )
    _others(ax, shown)
    bar = ax.figure.colorbar(image, cax=ax.inset_axes((1.0, 0.0, 0.05, 1.0), transform=beside(ax)))
    ticks = list(range(first, last + 1))
    bar.set_ticks(ticks, labels=[*map(str, ticks[:-1]), f"≥ {last}" if most > last else str(last)])
    bar.ax.tick_params(length=0)


def _draw_histogram(ax: Axes, shown: ShownMap, parameter: int) -> None:
    """How values are spread, with the middle, and how far off a single one may be."""
    label, good = shown.labels[parameter], shown.determined(parameter)
    values = shown.estimate[parameter][good]
    values = values[np.isfinite(values)]
    ax.set_xlabel(label.with_unit)
    ax.set_ylabel("pixels")
    if values.size == 0:
        ax.text(0.5, 0.5, "no pixel determines it", transform=ax.transAxes, ha="center", color=GREY)
        return
    low, high = scale_of(values)
    ax.hist(values, bins=_bins(values), range=(low, high), color=BLUE, alpha=0.75)
    middle, error = (
        float(np.median(values)),
        float(np.nanmedian(np.r_[shown.standard_error[parameter][good], np.nan])),
    )
    ax.axvline(middle, color="black", linewidth=1.0)
    if math.isfinite(error):
        ax.errorbar(
            middle,
            0.92,
            xerr=error,
            color=RED,
            capsize=3.0,
            marker="o",
            transform=ax.get_xaxis_transform(),
            label="median, median standard error",
        )
    ax.set_xlim(low - 0.02 * (high - low), high + 0.02 * (high - low))
    ax.locator_params(axis="x", nbins=5)
    inner = np.percentile(values, (16.0, 84.0))
    ax.set_title(
        f"median {brief(middle, 3)}, middle 68 % ± {brief(0.5 * float(np.ptp(inner)), 2)},\n"
        f"standard error {brief(error, 2)}",
        fontsize=9.5,
    )


def _bins(values: np.ndarray) -> int:
    """So many bars that the scatter of their heights hides no shape."""
    return int(min(max(2.0 * values.size ** (1.0 / 3.0), 5.0), _BINS))


def _draw_goodness(ax: Axes, shown: ShownMap) -> None:
    """How χ² per degree of freedom is spread, and how it would be if model and uncertainties were right."""
    from scipy import stats

    freedom = shown.degrees_of_freedom[shown.good & (shown.degrees_of_freedom > 0)]
    values = shown.reduced_chi2[shown.good & np.isfinite(shown.reduced_chi2)]
    ax.set_xlabel("χ² per degree of freedom")
    ax.set_ylabel("pixels")
    if values.size == 0 or freedom.size == 0:
        ax.text(0.5, 0.5, "no pixel has a χ²", transform=ax.transAxes, ha="center", color=GREY)
        return
    low, high = scale_of(values)
    typical = int(np.median(freedom))
    expected = stats.chi2(typical)
    low, high = min(low, expected.ppf(0.01) / typical), max(high, expected.ppf(0.99) / typical)
    count = _bins(values)
    wide = high > WIDE * low > 0.0
    edges = (np.geomspace if wide else np.linspace)(low, high, count + 1)
    ax.hist(values, bins=edges.tolist(), color=BLUE, alpha=0.75, label="found")
    if wide:
        ax.set_xscale("log")
        _plain_ticks(ax.xaxis)
    # how many pixels a bar as wide as those there would have
    at = np.interp(np.linspace(0.0, count, 300), np.arange(count + 1), edges)
    width = np.interp(at, edges, np.gradient(edges))
    ax.plot(
        at,
        values.size * width * typical * expected.pdf(at * typical),
        color=RED,
        label=f"expected, {typical} degrees of freedom",
    )
    ax.legend(
        loc="lower left", bbox_to_anchor=(-0.03, 0.98), frameon=False, fontsize=8, ncols=2, columnspacing=1.0
    )
    height = _PANEL * panel_height(_proportions(shown))
    ax.set_title(f"median {brief(float(np.median(values)), 3)}", y=1.0 + 0.22 / height)
