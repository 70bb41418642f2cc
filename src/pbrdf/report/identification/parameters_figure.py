"""Figure of fitted parameters over those of each material's specimens."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pbrdf.identification.fitted_parameters import FittedParameters
from pbrdf.identification.identify import Identification
from pbrdf.models.parameters import shown_unit
from pbrdf.report.style import BLUE, GREY, RED, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["parameters_figure"]

#: Half the width of the middle 95 % of a normal distribution, and materials that are drawn at most.
_HALF, _MOST = 1.959964, 10


def parameters_figure(found: Identification, fitted: FittedParameters, title: str) -> Figure:
    """A panel a parameter: the fit with its standard error over the middle 95 % of each material's specimens."""
    shown = found.candidates[:_MOST]
    materials = [found.library[candidate.name] for candidate in shown]
    free = materials[0].space.free
    with styled():
        figure = new_figure(1.75 * len(free) + 1.6, 0.32 * len(shown) + 1.5)
        axes = np.atleast_1d(figure.subplots(1, len(free), sharey=True))
        for i, (ax, parameter) in enumerate(zip(axes, free, strict=True)):
            factor, unit = shown_unit(parameter)
            for row, (candidate, material) in enumerate(zip(shown, materials, strict=True)):
                half = _HALF * np.sqrt(material.covariance[i, i])
                ends = np.array([material.mean, material.mean, material.mean])
                ends[:, i] += half * np.array([-1.0, 0.0, 1.0])
                low, middle, high = factor * material.space.to_parameters(ends)[:, i]
                colour = BLUE if candidate.accepted else RED
                ax.barh(row, high - low, 0.55, left=low, color=colour, alpha=0.35, linewidth=0)
                ax.plot([middle], [row], "|", color=colour, markersize=9.0, markeredgewidth=1.4)
            place = fitted.names.index(parameter.name)
            value, error = (factor * array[place] for array in (fitted.estimate, fitted.standard_error))
            known = np.isfinite(error)
            if known:
                ax.axvspan(value - error, value + error, color=GREY, alpha=0.35, linewidth=0)
            ax.axvline(value, color="black", linewidth=1.1, linestyle="-" if known else ":")
            ax.set_xlabel(parameter.name + (f" ({unit})" if unit not in ("", "1") else ""))
            ax.locator_params(axis="x", nbins=4)
        axes[0].set_yticks(range(len(shown)), [candidate.name for candidate in shown])
        axes[0].invert_yaxis()
        figure.suptitle(title)
    return figure
