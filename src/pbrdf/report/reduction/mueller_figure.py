"""Figure of measured Mueller matrices in a few numbers: diattenuation, polarizance, retardance, depolarisation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from pbrdf.instruments.goniometer.angle_table import AngleTable
from pbrdf.instruments.reduction.mueller_properties import UNKNOWN_RETARDANCE, Properties
from pbrdf.instruments.reduction.mueller_reduction import MuellerMeans
from pbrdf.report.dataset.panels import VIEWING_ANGLE
from pbrdf.report.style import looks_of, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["properties_figure"]

#: Quantity, label, and the least span of its axis: smaller ones would show rounding.
_PANELS = (
    ("diattenuation", "diattenuation", 0.02),
    ("polarizance", "polarizance", 0.02),
    ("retardance_deg", "retardance (°)", 2.0),
    ("depolarization", "depolarisation power", 0.02),
)
SERIES, INCIDENCE = "series", "angle of incidence θi (°)"
#: Sine of an azimuth that is in the plane of incidence, and angles of incidence with a curve of their own.
_FLAT, _MOST_CURVES = 1e-6, 12
#: Names of series that find room below an axis, and the letters of one that are shown.
_MOST_NAMES, _LETTERS = 12, 16


def properties_figure(
    found: Mapping[str, MuellerMeans],
    properties: Mapping[str, Properties],
    angles: AngleTable | None,
    title: str,
) -> Figure:
    """A panel a quantity, over the viewing angle, the angle of incidence or the series; a colour a curve.

    Retardances that the readings leave unknown are not drawn.

    Parameters
    ----------
    found
        Mueller matrices by region, of the same series.
    properties
        What they say, by region.
    angles
        Of these series, or None.
    title
        Above all.
    """
    names = next(iter(found.values())).names
    x, label, parts = _abscissa(angles, names)
    curves = [(region, part) for region in found for part in parts]
    looks = looks_of(len(curves))
    # series are no axis along which to interpolate
    line = "none" if label == SERIES else "-"
    with styled():
        figure = new_figure(9.0, 6.4)
        axes = figure.subplots(2, 2, sharex=True)
        for ax, (name, words, span) in zip(axes.ravel(), _PANELS, strict=True):
            for look, (region, part) in zip(looks, curves, strict=True):
                rows = parts[part][np.argsort(x[parts[part]], kind="stable")]
                value, std = (array[rows] for array in properties[region][name])
                if name == "retardance_deg":
                    value = np.where(std > UNKNOWN_RETARDANCE, np.nan, value)
                ax.errorbar(
                    x[rows],
                    value,
                    np.nan_to_num(std),
                    color=look.colour,
                    marker=look.marker,
                    linestyle=line,
                    capsize=2.0,
                    label=", ".join(filter(None, (region, part))),
                )
            _widen(ax, span)
            ax.set_ylabel(words)
        for ax in axes[1]:
            ax.set_xlabel(label)
            if label == SERIES:
                _name_series(ax, names)
        figure.suptitle(title)
        if len(curves) > 1:
            handles, labels = axes[0, 0].get_legend_handles_labels()
            figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
    return figure


def _abscissa(
    angles: AngleTable | None, names: tuple[str, ...]
) -> tuple[np.ndarray, str, dict[str, np.ndarray]]:
    """Places along the axis, its label, and the rows of each curve by what it is called.

    Over an angle only in the plane of incidence, at one wavelength and few angles of incidence; series in their order
    otherwise.
    """
    order = np.arange(len(names))
    by_series = order.astype(float), SERIES, {"": order}
    # a series without a good pixel needs no angles
    if angles is None or not {*names} <= {*angles.names}:
        return by_series
    own = angles.rows(names)
    theta_i, theta_r, phi = (np.asarray(angle) for angle in (own.theta_i, own.theta_r, own.phi))
    several = own.wavelength is not None and len(np.unique(np.asarray(own.wavelength))) > 1
    if several or (np.abs(np.sin(phi)) > _FLAT).any():
        return by_series
    theta_i = np.rad2deg(theta_i).round(6)
    levels = np.unique(theta_i)
    if len(levels) == len(names):
        return theta_i, INCIDENCE, {"": order}
    if len(levels) > _MOST_CURVES:
        return by_series
    parts = {f"θi = {level:g}°": np.flatnonzero(theta_i == level) for level in levels}
    return np.rad2deg(np.where(np.cos(phi) < 0.0, -theta_r, theta_r)), VIEWING_ANGLE, parts


def _widen(ax: Axes, span: float) -> None:
    """An axis of at least this span."""
    low, high = ax.get_ylim()
    middle, half = 0.5 * (low + high), 0.5 * max(high - low, span)
    ax.set_ylim(middle - half, middle + half)


def _name_series(ax: Axes, names: tuple[str, ...]) -> None:
    places = list(range(0, len(names), -(-len(names) // _MOST_NAMES)))
    words = [names[k] if len(names[k]) <= _LETTERS else f"{names[k][: _LETTERS - 1]}…" for k in places]
    ax.set_xticks(places, words, rotation=35.0, ha="right", rotation_mode="anchor")
