"""Quick-look pictures of a reduction: intensity S0, degree and angle of linear polarisation.

:class:`pbrdf.report.reduction.picture_sums.Picture` holds what is drawn.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.instruments.reduction.regions import Region
from pbrdf.instruments.reduction.stokes_image import BAD_FLAGS
from pbrdf.report.picture_grid import Margins, beside, picture_grid
from pbrdf.report.reduction.picture_sums import Picture
from pbrdf.report.style import styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["Scales", "overview_figure", "quicklook_figure"]

#: AoLP whose standard error exceeds this many degrees is not shown.
_UNCERTAIN = 10.0
#: Tops of the scale of DoLP.
_DOLP_TOPS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
#: What a scale leaves out above, so that single bright pixels do not darken the rest.
_BRIGHTEST = 99.5
#: Colours of masked pixels; the maps of colours have none of them.
_MASKED = dict(zip(BAD_FLAGS, ("#FF5A00", "#00A878", "#56B4E9"), strict=True))
_NOT_SHOWN = "#9A9A9A"


@dataclass(frozen=True)
class Scales:
    """Tops of the scales of intensity and DoLP; both begin at 0."""

    intensity: float
    dolp: float

    @classmethod
    def of(cls, pictures: Sequence[Picture]) -> Scales:
        """Scales that hold nearly all of these pictures."""
        intensity = max((_brightest(p.intensity[p.mask == 0]) for p in pictures), default=0.0)
        # where noise hides the direction it makes the degree as well
        dolp = max(
            (_brightest(p.dolp[(p.mask == 0) & (p.aolp_std <= _UNCERTAIN)]) for p in pictures), default=0.0
        )
        return cls(intensity or 1.0, next((top for top in _DOLP_TOPS if top >= dolp), _DOLP_TOPS[-1]))


def _brightest(values: np.ndarray) -> float:
    values = values[np.isfinite(values)]
    return float(np.percentile(values, _BRIGHTEST)) if values.size else 0.0


def quicklook_figure(picture: Picture, title: str, regions: Mapping[str, Region] | None = None) -> Figure:
    """Intensity, degree and angle of linear polarisation of one series, side by side.

    Masked pixels have colours of their own, which the legend names; angles that noise leaves uncertain are grey.

    Parameters
    ----------
    picture
        The means over blocks.
    title
        Above all.
    regions
        To be outlined in the picture of the intensity.
    """
    scales = Scales.of([picture])
    with styled():
        figure, axes = picture_grid(1, 3, _PANEL, picture.shape, _MARGINS)
        figure.suptitle(title, y=1.0 - 0.12 / figure.get_figheight(), verticalalignment="top")
        shown = _draw(list(axes[0]), picture, scales)
        titles = (
            "Intensity S0",
            f"Degree of linear polarisation, scale 0 to {scales.dolp:g}",
            "Angle of linear polarisation",
        )
        labels = ("digital numbers", "DoLP", "degrees, from x towards y")
        for k, ax in enumerate(axes[0]):
            ax.set_title(titles[k])
            ax.set_xlabel("x, pixels")
            _colour_bar(shown[k], ax, labels[k], k, scales)
        axes[0, 0].set_ylabel("y, pixels")
        _compass(axes[0, 2])
        for name, region in (regions or {}).items():
            _outline(axes[0, 0], name, region)
        _legend(figure, [picture])
        return figure


#: Width of a panel of a quick look and of a thumbnail, inches, and the space around them.
_PANEL, _MARGINS = 4.1, Margins(0.75, 1.05, 0.75, 0.95, 1.6, 0.0)
_THUMBNAIL, _TIGHT = 1.5, Margins(0.1, 1.2, 0.95, 0.45, 0.06, 0.14)
#: Thumbnails to a row, and the space for a title above three of them, inches.
_PER_ROW, _TITLE = 8, 0.32


def _colour_bar(shown: Any, ax: Axes, label: str, layer: int, scales: Scales) -> None:
    """A bar of colours beside a panel: of intensity (0), DoLP (1) or AoLP (2)."""
    bar = ax.figure.colorbar(
        shown,
        cax=ax.inset_axes((1.0, 0.0, 0.045, 1.0), transform=beside(ax)),
        label=label,
        extend="max" if layer == 0 or (layer == 1 and scales.dolp < 1.0) else "neither",
    )
    if layer == 2:
        bar.set_ticks(range(-90, 91, 45))


def _legend(figure: Figure, pictures: Sequence[Picture]) -> None:
    """Name the colours that stand for pixels without a value."""
    from matplotlib.patches import Patch

    handles = [
        Patch(color=colour, label=str(flag.name).lower())
        for code, (flag, colour) in enumerate(_MASKED.items(), 1)
        if any((picture.mask == code).any() for picture in pictures)
    ]
    if any((picture.aolp_std[picture.mask == 0] > _UNCERTAIN).any() for picture in pictures):
        handles.append(Patch(color=_NOT_SHOWN, label=f"angle uncertain by more than {_UNCERTAIN:g}°"))
    if handles:
        figure.legend(handles=handles, loc="lower center", ncols=len(handles), frameon=False)


def _draw(axes: Sequence[Axes], picture: Picture, scales: Scales) -> list[Any]:
    """Draw the three pictures; returns what carries their colours."""
    from matplotlib.colors import ListedColormap

    mask = picture.mask
    uncertain = picture.aolp_std > _UNCERTAIN
    shown = []
    for ax, values, colours, low, high in (
        (axes[0], picture.intensity, "gray", 0.0, scales.intensity),
        (axes[1], picture.dolp, "cividis", 0.0, scales.dolp),
        (axes[2], np.where(uncertain, np.nan, picture.aolp), "twilight", -90.0, 90.0),
    ):
        ax.set_facecolor(_NOT_SHOWN)
        ax.grid(False)
        options: dict[str, Any] = {"extent": picture.extent, "interpolation": "nearest"}
        hidden = np.ma.masked_where((mask > 0) | ~np.isfinite(values), values)
        shown.append(ax.imshow(hidden, cmap=colours, vmin=low, vmax=high, **options))
        if (mask > 0).any():
            ax.imshow(
                np.ma.masked_equal(mask, 0),
                cmap=ListedColormap(list(_MASKED.values())),
                vmin=1,
                vmax=len(_MASKED),
                **options,
            )
        # blocks at the edges may reach beyond the picture
        ax.set_xlim(0.0, picture.shape[1])
        ax.set_ylim(picture.shape[0], 0.0)
    return shown


def _compass(ax: Axes) -> None:
    """A disc in a corner with the colour of each angle in its own direction."""
    from matplotlib import colormaps
    from matplotlib.patches import Circle

    size = 240
    y, x = np.mgrid[1.0 : -1.0 : size * 1j, -1.0 : 1.0 : size * 1j]
    distance = np.hypot(x, y)
    angle = np.rad2deg(np.arctan2(y, x))
    colours = colormaps["twilight"](np.mod(angle + 90.0, 180.0) / 180.0)
    colours[..., 3] = np.clip((1.0 - distance) * size / 2.0, 0.0, 1.0) * (distance > 0.35)
    inset = ax.inset_axes((0.01, 0.01, 0.2, 0.2))
    inset.imshow(colours, extent=(-1.0, 1.0, -1.0, 1.0))
    for radius, edge in ((0.98, "white"), (1.0, "black")):
        inset.add_patch(Circle((0.0, 0.0), radius, fill=False, edgecolor=edge, linewidth=0.8, clip_on=False))
    inset.set_axis_off()


def _outline(ax: Axes, name: str, region: Region) -> None:
    from matplotlib import patheffects

    edge = [patheffects.withStroke(linewidth=2.5, foreground="black")]
    x, y = region.outline().T
    ax.plot(x, y, color="white", linewidth=1.0, path_effects=edge)
    left, _, top, _ = region.box
    ax.annotate(
        name, (left, top), (0, 3), textcoords="offset points", color="white", fontsize=8, path_effects=edge
    )


def overview_figure(pictures: Sequence[Picture], names: Sequence[str], title: str) -> Figure:
    """Small pictures of many series on common scales: intensity above, then DoLP, then AoLP.

    Parameters
    ----------
    pictures, names
        Of the series.
    title
        Above all.
    """
    count = len(pictures)
    columns = min(count, _PER_ROW)
    scales = Scales.of(pictures)
    with styled():
        figure, axes = picture_grid(
            3, columns, _THUMBNAIL, pictures[0].shape, _TIGHT, math.ceil(count / columns), _TITLE
        )
        words = f"S0 in digital numbers; DoLP, scale 0 to {scales.dolp:g}; AoLP in degrees, from x towards y"
        figure.suptitle(f"{title}\n{words}", y=1.0 - 0.1 / figure.get_figheight(), verticalalignment="top")
        for k, (picture, name) in enumerate(zip(pictures, names, strict=True)):
            group, column = divmod(k, columns)
            own = axes[3 * group : 3 * group + 3, column]
            shown = _draw(list(own), picture, scales)
            own[0].set_title(name, fontsize=8.5, pad=3.0)
            if k == columns - 1:
                for layer, label in enumerate(("S0", "DoLP", "AoLP")):
                    _colour_bar(shown[layer], own[layer], label, layer, scales)
        _legend(figure, pictures)
        for k, ax in enumerate(axes.ravel()):
            ax.set_xticks([])
            ax.set_yticks([])
            ax.spines[:].set_visible(False)
            ax.set_visible(k // columns // 3 * columns + k % columns < count)
        return figure
