"""Every viewing direction of several models, data and fits: flat discs in colour, or polar surfaces."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.errors import DataError
from pbrdf.report.dataset.panels import LOGARITHMIC_FROM, dress_hemisphere
from pbrdf.report.polar_surface import draw_directions, draw_polar_surface, polar_surface
from pbrdf.report.style import RED, new_figure, styled
from pbrdf.report.together.source import Source, incidence_of, light_note, light_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["hemispheres_figure", "surfaces_figure"]

#: Zenith angle up to which models are drawn, degrees: at 90° f is 0.
_RIM = 89.0
#: Angles of incidence nearer than this belong to one hemisphere, degrees.
_SAME = 0.5
#: Decades that the colours of the intensity span at most.
_DECADES = 4.0
_LABELS = {"intensity": "intensity (1/sr)", "dolp": "degree of linear polarisation"}


@dataclass(frozen=True)
class _View:
    """A disc's or a surface's worth: θ_r and φ in radians with intensity and DoLP there, NaN where unknown.

    ``measured`` says whether these are points, shape (G,), or a grid of a model.
    """

    title: str
    measured: bool
    theta_r: np.ndarray
    phi: np.ndarray
    values: dict[str, np.ndarray]


def hemispheres_figure(
    sources: Sequence[Source], theta_i: float | None = None, incident: Sequence[float] | None = None
) -> Figure:
    """Intensity and DoLP over the hemisphere of viewing directions: a column for each source, one scale of colours.

    Parameters
    ----------
    sources
        What to draw; a fit has two columns, measured and modelled.
    theta_i
        Angle of incidence in degrees, of data the nearest that was measured; None for the one with the most points,
        and 35° without data.
    incident
        Stokes vector of the light; None for that of the data, natural light without data.

    Raises
    ------
    DataError
        If the data were measured under different light, or hold neither intensity nor DoLP.
    ModelError
        If ``incident`` is the Stokes vector of no light.
    """
    angle = incidence_of(sources, theta_i)
    light = light_of(sources, incident)
    views = _views(sources, angle, light, fine=True)
    names = _names(views)
    with styled():
        figure = new_figure(3.1 * max(len(views), 2) + 1.0, 3.3 * len(names) + 0.7)
        axes = figure.subplots(len(names), len(views), squeeze=False, subplot_kw={"projection": "polar"})
        for row, name in zip(axes, names, strict=True):
            norm = _norm(name, [view.values[name] for view in views if name in view.values])
            drawn: Any = None
            for ax, view in zip(row, views, strict=True):
                dress_hemisphere(ax)
                ax.set_title(view.title if name == names[0] else "", fontsize=9.5)
                ax.plot([np.pi], [angle], marker="*", color=RED, markersize=9.0, clip_on=False, zorder=5)
                if name not in view.values:
                    ax.annotate("not measured", (0.5, 0.5), xycoords="axes fraction", ha="center")
                    continue
                values = view.values[name]
                if view.measured:
                    drawn = ax.scatter(
                        view.phi,
                        np.rad2deg(view.theta_r),
                        c=values,
                        s=14.0,
                        norm=norm,
                        cmap="viridis",
                        rasterized=values.size > 400,
                    )
                else:
                    drawn = ax.pcolormesh(
                        view.phi[0],
                        np.rad2deg(view.theta_r[:, 0]),
                        values,
                        norm=norm,
                        cmap="viridis",
                        shading="gouraud",
                        rasterized=True,
                    )
                    ax.set_axisbelow(False)
                    ax.grid(color="white", linewidth=0.5, alpha=0.5)
                    ax.tick_params(axis="y", labelcolor="white")
            if drawn is not None:
                figure.colorbar(drawn, ax=list(row), label=_LABELS[name], shrink=0.8, aspect=14.0)
        figure.suptitle(f"θi = {angle:g}°{light_note(light)} (★ source)", fontsize=11.0)
        return figure


def surfaces_figure(
    sources: Sequence[Source], theta_i: float | None = None, incident: Sequence[float] | None = None
) -> Figure:
    """Intensity and DoLP as polar surfaces: a column for each source, each row with one scale; parameters as above.

    Measured values are points at their distance from the origin. Intensities that span decades are drawn by their
    logarithm.
    """
    angle = incidence_of(sources, theta_i)
    light = light_of(sources, incident)
    views = _views(sources, angle, light, fine=False)
    names = _names(views)
    with styled():
        figure = new_figure(5.0 * len(views), 3.9 * len(names) + 0.5)
        axes: Any = figure.subplots(len(names), len(views), squeeze=False, subplot_kw={"projection": "3d"})
        for row, name in zip(axes, names, strict=True):
            radius, scale = _radius(name, [view.values[name] for view in views if name in view.values])
            for ax, view in zip(row, views, strict=True):
                if name not in view.values:
                    ax.remove()
                    continue
                values = view.values[name]
                what = "intensity" if name == "intensity" else "DoLP"
                ax.set_title(f"{view.title}\n{what}, up to {np.nanmax(values):.3g}{scale}", fontsize=10.0)
                r = radius(values)
                if view.measured:
                    x, y, z = polar_surface(view.theta_r, view.phi, r)
                    ax.scatter(x, y, z, s=9.0, c=r, cmap="viridis", vmin=0.0, vmax=1.0)
                    draw_directions(ax, angle)
                else:
                    draw_polar_surface(ax, view.theta_r, view.phi, r, angle)
        figure.suptitle(
            f"θi = {angle:g}°{light_note(light)}: the distance from the origin is the value", fontsize=11.0
        )
        return figure


def _views(sources: Sequence[Source], angle: float, light: Sequence[float], *, fine: bool) -> list[_View]:
    views = []
    for source in sources:
        both = source.model is not None and source.dataset is not None
        if (points := source.points) is not None:
            at = np.abs(points.theta_i - angle) < _SAME
            views.append(
                _View(
                    source.name + (": measured" if both else ""),
                    True,
                    np.deg2rad(points.theta_r[at]),
                    np.deg2rad(points.phi[at]),
                    {
                        name: channel.measured[at]
                        for name, channel in points.channels.items()
                        if np.isfinite(channel.measured[at]).any()
                    },
                )
            )
        if source.model is not None:
            theta_r, phi = _grid(angle, fine)
            values = source.modelled(("intensity", "dolp"), light, np.deg2rad(angle), theta_r, phi)
            views.append(_View(source.name + (": model" if both else ""), False, theta_r, phi, values))
    return views


def _grid(angle: float, fine: bool) -> tuple[np.ndarray, np.ndarray]:
    """Directions in radians, shapes (T, 1) and (1, P), the mirror direction among them; a fine grid is finest there."""
    if not fine:
        theta_r = np.unique(np.append(np.linspace(0.0, _RIM, 60), min(angle, _RIM)))
        return np.deg2rad(theta_r)[:, None], np.deg2rad(np.linspace(-180.0, 180.0, 121))[None, :]
    theta_r = np.unique(np.concatenate([np.linspace(0.0, _RIM, 90), angle + np.linspace(-6.0, 6.0, 49)]))
    half = np.unique(np.concatenate([np.linspace(0.0, 180.0, 91), np.linspace(0.0, 12.0, 49)]))
    phi = np.concatenate([-half[:0:-1], half])
    return np.deg2rad(theta_r[(theta_r >= 0.0) & (theta_r <= _RIM)])[:, None], np.deg2rad(phi)[None, :]


def _names(views: Sequence[_View]) -> list[str]:
    names = [name for name in _LABELS if any(name in view.values for view in views)]
    if not names:
        raise DataError(
            f"{views[0].title}: neither intensity nor degree of linear polarisation was measured; draw the data with "
            "--kind curves or mueller"
        )
    return names


def _radius(name: str, values: Sequence[np.ndarray]) -> tuple[Callable[[np.ndarray], np.ndarray], str]:
    """Distance from the origin as a function of the value, one for all, and what to say of it."""
    norm = _norm(name, values)
    logarithmic = type(norm).__name__ == "LogNorm"
    low, high = (math.log10(v) if logarithmic else v for v in (norm.vmin, norm.vmax))

    def radius(value: np.ndarray) -> np.ndarray:
        with np.errstate(divide="ignore", invalid="ignore"):
            share = ((np.log10(value) if logarithmic else value) - low) / (high - low)
        # facets without extent have no normal to be shaded by
        values: np.ndarray = np.clip(np.nan_to_num(share), 1e-4, 1.0)
        return values

    return radius, f"\n(logarithmic, from {norm.vmin:.2g})" if logarithmic else ""


def _norm(name: str, values: Sequence[np.ndarray]) -> Any:
    """One scale of colours for all: logarithmic if the intensities span decades."""
    from matplotlib.colors import LogNorm, Normalize

    together = np.concatenate([v.ravel() for v in values])
    positive = together[together > 0.0]
    largest = float(positive.max()) if positive.size else 1.0
    if name == "intensity" and positive.size:
        smallest = max(float(positive.min()), largest * 10.0**-_DECADES)
        if math.log10(largest / smallest) > LOGARITHMIC_FROM:
            return LogNorm(smallest, largest)
    return Normalize(0.0, largest)
