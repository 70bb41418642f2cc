"""Curves in the plane of incidence of several models, data and fits, and panels of their Mueller elements."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from pbrdf.errors import DataError
from pbrdf.report.dataset.panels import VIEWING_ANGLE, scale_intensity, scale_signed
from pbrdf.report.dataset.quantities import is_intensity, quantity_label
from pbrdf.report.style import Look, looks_of, panels, styled
from pbrdf.report.together.source import Plane, Source, light_note, light_of, measured_names, planes_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["curves_figure", "mueller_figure"]

#: As many panels as stand side by side.
_MOST_PLANES = 4
_SIZES = {1: (5.2, 2.8), 2: (4.2, 2.5)}
_SMALL, _ELEMENT_SIZE = (2.9, 2.1), (2.1, 1.7)
#: Lines of models that look alike in black and white.
_LINES: tuple[Literal["-", "--", "-.", ":"], ...] = ("-", "--", "-.", ":")


def curves_figure(
    sources: Sequence[Source], theta_i: float | None = None, incident: Sequence[float] | None = None
) -> Figure:
    """Intensity and polarisation in the plane of incidence: a column for each cut, a colour for each source.

    Points are measured, lines are models; a fit has both.

    Parameters
    ----------
    sources
        What to draw.
    theta_i
        Angle of incidence in degrees; None for all (up to four) that were measured, and 35° without data.
    incident
        Stokes vector of the light; None for that of the data, natural light without data.

    Raises
    ------
    DataError
        If data lie on no few lines in the plane of incidence, or under different light.
    ModelError
        If ``incident`` is the Stokes vector of no light.
    """
    planes, found = planes_of(sources, theta_i, _MOST_PLANES)
    light = light_of(sources, incident)
    names = measured_names(sources, light)
    looks = looks_of(len(sources))
    title = ", ".join(source.name for source in sources) + light_note(light)
    if len(planes) < found:
        title += f" ({len(planes)} of {found} cuts)"
    with styled():
        size = _SIZES.get(len(planes), _SMALL)
        figure, axes = panels(len(names), len(planes), size, title, _legend(sources, looks))
        for column, plane in enumerate(planes):
            _draw(axes[:, column], plane, sources, looks, names, light)
            axes[0, column].set_title(plane.title)
            for ax, name in zip(axes[:, column], names, strict=True):
                ax.set_ylabel(_label(name, sources) if column == 0 else "")
                ax.set_xlabel("")
            axes[-1, column].set_xlabel(_axis(plane, len(planes)))
        return figure


def mueller_figure(sources: Sequence[Source], theta_i: float | None = None) -> Figure:
    """The 16 Mueller elements, divided by m00, in one cut through the plane of incidence; parameters as above.

    Data of Stokes vectors under natural light stand in the first column. Without ``theta_i`` the middle one of the
    measured cuts is drawn.

    Raises
    ------
    DataError
        As :func:`curves_figure`, and if nothing of a matrix was measured.
    """
    planes, _ = planes_of(sources, theta_i, 10**6)
    plane = planes[len(planes) // 2]
    names = [f"m{i}{j}" for i in range(4) for j in range(4)]
    for source in sources:
        if source.dataset is not None and all(source.channel(name) is None for name in names):
            raise DataError(f"{source.name} holds no element of a Mueller matrix; draw it with --kind curves")
    looks = looks_of(len(sources))
    title = f"{', '.join(source.name for source in sources)}: Mueller elements, {plane.title}"
    with styled():
        figure, axes = panels(4, 4, _ELEMENT_SIZE, title, _legend(sources, looks))
        _draw(axes.ravel(), plane, sources, looks, names, light=())
        for i, (ax, name) in enumerate(zip(axes.ravel(), names, strict=True)):
            ax.set_title(quantity_label(name), fontsize=9.0)
            ax.set_ylabel("")
            angle = "θi (°)" if plane.kind in ("theta_r", "mirror") else "θr (°)"
            ax.set_xlabel(angle if i >= 12 else "")
        return figure


def _draw(
    axes: Sequence[Axes],
    plane: Plane,
    sources: Sequence[Source],
    looks: Sequence[Look],
    names: Sequence[str],
    light: Sequence[float],
) -> None:
    """All sources in the panels of one cut, a panel for each quantity."""
    path = plane.path()
    several = sum(source.model is not None for source in sources) > 1
    drawn: dict[str, list[np.ndarray]] = {name: [] for name in names}
    for i, (source, look) in enumerate(zip(sources, looks, strict=True)):
        for name, ax in zip(names, axes, strict=True):
            channel = source.channel(name)
            for cut in plane.cuts.get(i, ()) if channel is not None else ():
                assert channel is not None
                std = channel.std[cut.rows]
                ax.errorbar(
                    cut.x,
                    channel.measured[cut.rows],
                    yerr=std if np.isfinite(std).any() else None,
                    fmt=look.marker,
                    color=look.colour,
                    elinewidth=0.8,
                    label=source.name,
                    zorder=2,
                )
                drawn[name].append(channel.measured[cut.rows])
        if source.model is not None:
            values = source.modelled(names, light, *path.path_angles())
            line = _LINES[i % len(_LINES)] if several else "-"
            for name, ax in zip(names, axes, strict=True):
                if name in values:
                    ax.plot(path.path_x, values[name], line, color=look.colour, label=source.name, zorder=3)
                    drawn[name].append(values[name])
    for name, ax in zip(names, axes, strict=True):
        if not drawn[name]:
            continue
        if is_intensity(name):
            scale_intensity(ax, np.concatenate(drawn[name]))
        elif name == "dolp":
            ax.set_ylim(0.0, min(max(ax.get_ylim()[1], 0.01), 1.05))
        else:
            scale_signed(ax, name)


def _legend(sources: Sequence[Source], looks: Sequence[Look]) -> list[Any]:
    from matplotlib.lines import Line2D

    several = sum(source.model is not None for source in sources) > 1
    return [
        Line2D(
            [],
            [],
            color=look.colour,
            linestyle="none" if source.model is None else (_LINES[i % len(_LINES)] if several else "-"),
            marker="none" if source.dataset is None else look.marker,
            label=source.name + _what(source),
        )
        for i, (source, look) in enumerate(zip(sources, looks, strict=True))
    ]


def _what(source: Source) -> str:
    if source.model is None:
        return " (measured)"
    return " (model)" if source.dataset is None else " (measured, and the fitted model)"


def _label(name: str, sources: Sequence[Source]) -> str:
    if name == "dolp":
        return "DoLP"
    if name == "aolp":
        return "AoLP (°)"
    if name != "intensity":
        return name
    arbitrary = any(points.arbitrary_scale for source in sources if (points := source.points) is not None)
    return "intensity (arbitrary)" if arbitrary else "intensity (1/sr)"


def _axis(plane: Plane, columns: int) -> str:
    if plane.kind in ("theta_r", "mirror"):
        return "angle of incidence θi (°)"
    return VIEWING_ANGLE if columns == 1 else "viewing angle θr (°)"
