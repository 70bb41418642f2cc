"""Figure of a map of materials: which material each pixel shows, and how sure that is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.identification.class_map import NONE_OF_THESE, NOT_MEASURED
from pbrdf.report.numbers import per_cent
from pbrdf.report.style import looks_of, new_figure, styled

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["NONE", "WITHOUT", "ClassCount", "class_counts", "class_figure", "colours_of_materials"]

#: Pixels along a side of a picture, at most.
_MOST = 600
#: What is like no material, and what was not measured.
NONE, WITHOUT = "#222222", "#DADADA"
_LARGEST, _LEGEND = 4.6, 2.5


@dataclass(frozen=True)
class ClassCount:
    """How many pixels show one material, or none.

    Attributes
    ----------
    value
        Number in the map.
    name
        Of the material, ``none of these`` or ``not measured``.
    pixels, share
        How many, and what part of the measured pixels; NaN for those that were not measured.
    confidence
        Median of the probability of the material at these pixels; NaN for no material.
    """

    value: int
    name: str
    pixels: int
    share: float
    confidence: float


def class_counts(found: xr.Dataset) -> list[ClassCount]:
    """Pixels by material in the order of the library, then none of these and not measured, zeros included.

    Parameters
    ----------
    found
        As :func:`pbrdf.identify_map` gives it.
    """
    material, confidence = found["material"].values, found["confidence"].values
    names = {number: str(name) for number, name in enumerate(found["material_name"].values)}
    names |= {NONE_OF_THESE: "none of these", NOT_MEASURED: "not measured"}
    counts, measured = [], max(int((material != NOT_MEASURED).sum()), 1)
    for value, name in names.items():
        where = material == value
        pixels = int(where.sum())
        share = pixels / measured if value != NOT_MEASURED else math.nan
        median = float(np.median(confidence[where])) if value >= 0 and where.any() else math.nan
        counts.append(ClassCount(value, name, pixels, share, median))
    return counts


def class_figure(found: xr.Dataset, title: str) -> Figure:
    """Materials on the left with a legend of their pixels, the probability of the material told on the right.

    Of a large map every n-th pixel is drawn; of more than two dimensions the first place along the others. The counts
    are those of all pixels.

    Parameters
    ----------
    found
        As :func:`pbrdf.identify_map` gives it.
    title
        What to call the map.
    """
    from matplotlib.colors import BoundaryNorm, ListedColormap, Normalize
    from matplotlib.patches import Patch

    material, confidence, labels = _shown(found)
    counts = class_counts(found)
    colours = colours_of_materials(len(found["material_name"]))
    with styled():
        rows, columns = material.shape
        scale = _LARGEST / max(rows, columns)
        width, height = max(columns * scale, 1.6), max(rows * scale, 0.6)
        figure = new_figure(2.0 * width + _LEGEND + 1.7, max(height + 1.1, 0.22 * len(counts) + 0.9))
        left, right = figure.subplots(1, 2, sharex=True, sharey=True)
        # material c is colour c + 2: those that are none come first
        palette = ListedColormap([WITHOUT, NONE, *colours])
        norm = BoundaryNorm(np.arange(NOT_MEASURED - 0.5, len(colours) + 0.5), palette.N)
        _draw(left, material, cmap=palette, norm=norm)
        left.set_title("most probable material of the set", fontsize=10.0)
        ground = ListedColormap([WITHOUT, NONE])
        _draw(right, np.where(material < 0, material, np.nan), cmap=ground, norm=Normalize(-2.5, -0.5))
        image = _draw(right, confidence, cmap="viridis", norm=Normalize(_least(confidence), 1.0))
        right.set_title("its probability", fontsize=10.0)
        figure.colorbar(image, ax=right, shrink=0.9, pad=0.02, format="{x:g}")
        for ax in (left, right):
            ax.set_xlabel(labels[1])
        left.set_ylabel(labels[0])
        handles = [
            Patch(
                facecolor=palette(norm(count.value)),
                edgecolor="#555555",
                linewidth=0.5,
                label=_counted(count),
            )
            for count in counts
            if count.pixels or count.value >= 0
        ]
        figure.legend(
            handles=handles,
            loc="outside right upper",
            frameon=False,
            title="pixels (share of measured)",
            alignment="left",
        )
        figure.suptitle(title)
    return figure


def _counted(count: ClassCount) -> str:
    share = f" ({per_cent(count.share)})" if math.isfinite(count.share) else ""
    return f"{count.name}: {count.pixels}{share}"


def _shown(found: xr.Dataset) -> tuple[np.ndarray, np.ndarray, tuple[str, str]]:
    """Numbers and probabilities of the shown pixels, (rows, columns), and names of the axes."""
    dims = [str(d) for d in found["material"].dims]
    picture = dims[-2:]
    steps = {d: max(math.ceil(found.sizes[d] / _MOST), 1) for d in picture}
    place: dict[str, Any] = dict.fromkeys(dims[:-2], 0) | {d: slice(None, None, n) for d, n in steps.items()}
    arrays = [found[name].isel(place).values for name in ("material", "confidence")]
    if len(picture) == 1:
        arrays, picture = [a[None] for a in arrays], ["", *picture]
    rows, columns = (f"{d} (every {steps[d]}. pixel)" if steps.get(d, 1) > 1 else d for d in picture)
    return arrays[0], arrays[1], (rows, columns)


def _draw(ax: Any, values: np.ndarray, **options: Any) -> Any:
    ax.grid(visible=False)
    image = ax.imshow(
        values, interpolation="nearest", aspect="equal" if values.shape[0] > 1 else "auto", **options
    )
    if values.shape[0] == 1:
        ax.set_yticks([])
    return image


def _least(confidence: np.ndarray) -> float:
    """Where the scale of the probabilities begins: at a tenth, so that two maps are soon compared."""
    known = confidence[np.isfinite(confidence)]
    lowest = float(known.min()) if known.size else 0.0
    return max(min(math.floor(10.0 * lowest) / 10.0, 0.9), 0.0)


def colours_of_materials(count: int) -> list[Any]:
    """Colours of the materials: Okabe and Ito's without black, which stands for none; of more, matplotlib's twenty."""
    named = [look.colour for look in looks_of(7)][:6]
    if count <= len(named):
        return named[:count]
    from matplotlib import colormaps

    twenty = colormaps["tab20"]
    return [twenty((2 * i) % 20 + (2 * i) // 20 % 2) for i in range(count)]
