"""Figure of a data set."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.report.dataset.describe import short_name
from pbrdf.report.dataset.panels import (
    LOGARITHMIC_FROM,
    PANEL_SIZE,
    channel_label,
    cut_panel,
    dress_hemisphere,
)
from pbrdf.report.dataset.points import Points
from pbrdf.report.dataset.shown_cuts import shown_cuts
from pbrdf.report.style import new_figure, panels, styled

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["data_figure"]


def data_figure(dataset: xr.Dataset, name: str) -> Figure:
    """Measured points: intensity and degree of linear polarisation against the angle, or over the hemisphere.

    Parameters
    ----------
    dataset
        The data.
    name
        What to call them.
    """
    points = Points.from_dataset(dataset)
    shown, title = shown_cuts(points), short_name(name, dataset)
    with styled():
        from matplotlib.lines import Line2D

        if not shown.cuts:
            return _hemispheres(points, title)
        handles = [
            Line2D([], [], color=look.colour, marker=look.marker, linestyle="none", label=shown.label(cut))
            for cut, look in zip(shown.cuts, shown.looks, strict=True)
        ]
        channels = points.channels
        figure, axes = panels(len(channels), 1, PANEL_SIZE, title, handles)
        for ax, channel in zip(axes[:, 0], channels, strict=True):
            cut_panel(ax, points, shown, channel)
        axes[0, 0].set_title(shown.title)
        return figure


def _hemispheres(points: Points, title: str) -> Figure:
    """Every point over the hemisphere of viewing directions, one disc per group."""
    channels = points.channels
    groups = list(dict.fromkeys(points.group))
    shown = [
        groups[i] for i in np.unique(np.linspace(0, len(groups) - 1, min(len(groups), 4)).round().astype(int))
    ]
    figure = new_figure(3.2 * len(shown) + 1.0, 3.3 * len(channels) + 0.6)
    axes = figure.subplots(len(channels), len(shown), squeeze=False, subplot_kw={"projection": "polar"})
    for row, (name, channel) in enumerate(channels.items()):
        usable = np.isin(points.group, shown) & np.isfinite(channel.measured)
        norm = _colour_norm(name, channel.measured[usable])
        for ax, group in zip(axes[row], shown, strict=True):
            chosen = usable & (points.group == group)
            drawn = ax.scatter(
                np.deg2rad(points.phi[chosen]),
                points.theta_r[chosen],
                c=channel.measured[chosen],
                s=12.0,
                norm=norm,
                cmap="viridis",
            )
            dress_hemisphere(ax)
            if row == 0:
                ax.set_title(f"group {group}")
        figure.colorbar(drawn, ax=list(axes[row]), label=channel_label(name, points), shrink=0.8)
    figure.suptitle(title + (f" ({len(shown)} of {len(groups)} groups)" if len(shown) < len(groups) else ""))
    return figure


def _colour_norm(name: str, values: np.ndarray) -> Any:
    from matplotlib.colors import LogNorm, Normalize

    positive = values[values > 0.0]
    if (
        name == "intensity"
        and positive.size
        and math.log10(positive.max() / positive.min()) > LOGARITHMIC_FROM
    ):
        return LogNorm(positive.min(), positive.max())
    return Normalize(min(0.0, float(values.min(initial=0.0))), float(values.max(initial=1e-6)))
