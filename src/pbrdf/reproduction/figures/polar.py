"""The paper's figure 3: intensity and degree of polarisation as polar surfaces, with cuts through them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.models import Model
from pbrdf.optics.stokes import dolp
from pbrdf.report.dataset.panels import VIEWING_ANGLE
from pbrdf.report.polar_surface import draw_polar_surface
from pbrdf.report.style import GREY, RED, looks_of, styled
from pbrdf.reproduction.interpretations import DEFAULT, INTERPRETATIONS
from pbrdf.reproduction.paper import FIGURE_3_INCIDENCE, SIMULATED
from pbrdf.reproduction.plane import zero_crossings
from pbrdf.reproduction.statements.polarisation import figure_3_cut

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["polar_figure"]

#: Zenith angle of the surfaces' rim, degrees: at 90° f is 0.
_RIM = 89.0
_LINES = ("-", "--", "-.", ":")
#: Behind text that stands on curves.
_PAPER = {"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 1.0}


def polar_figure() -> Figure:
    """Figure 3 with its parameters: the surfaces in the default interpretation, the cuts in all of them."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with styled():
        figure = Figure(figsize=(11.0, 9.2))
        FigureCanvasAgg(figure)
        model = DEFAULT.figure_3()
        theta_r, phi, stokes = _hemisphere(model)
        for row, (name, unit, values) in enumerate(
            (("intensity f", " sr⁻¹", stokes[..., 0]), ("degree of polarisation", "", dolp(stokes)))
        ):
            bottom = 0.51 - 0.455 * row
            surface: Any = figure.add_axes((0.0, bottom - 0.03, 0.52, 0.45), projection="3d")
            draw_polar_surface(surface, theta_r, phi, values / values.max(), FIGURE_3_INCIDENCE)
            surface.set_title(f"{name}: distance from the origin, up to {values.max():.3g}{unit}", y=0.97)
            cut = figure.add_axes((0.6, bottom + 0.04, 0.37, 0.33))
            (_intensity_cut if row == 0 else _polarisation_cut)(cut)
        figure.suptitle(
            "Figure 3: θi = 35°, φi = 0°, σ = 0.1, n = 2 − 1.5i, a = 3, k = 2, b = 1, t = 0.5; natural light\n"
            f"Surfaces: reading {DEFAULT.name}. A model, no measurement",
            fontsize=11,
            y=0.985,
        )
        figure.text(0.5, 0.008, SIMULATED, ha="center", fontsize=8.5, color=GREY)
        return figure


def _hemisphere(model: Model) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """θ_r, φ (radians, broadcast against each other) and Stokes vectors."""
    theta_r = np.deg2rad(np.linspace(0.0, _RIM, 60))[:, None]
    phi = np.deg2rad(np.linspace(-180.0, 180.0, 121))[None, :]
    return theta_r, phi, model.stokes(np.deg2rad(FIGURE_3_INCIDENCE), theta_r, phi)


def _grid() -> np.ndarray:
    return np.deg2rad(np.linspace(-_RIM, _RIM, 1781))


def _dress(ax: Axes) -> None:
    ax.axvline(FIGURE_3_INCIDENCE, color=RED, linewidth=1.0, linestyle=":")
    ax.set_xlim(-90.0, 90.0)
    ax.set_xticks(np.arange(-90, 91, 30))
    ax.set_xlabel(VIEWING_ANGLE)


def _intensity_cut(ax: Axes) -> None:
    theta_r = _grid()
    degrees = np.rad2deg(theta_r)
    for look, line, interpretation in zip(
        looks_of(len(INTERPRETATIONS)), _LINES, INTERPRETATIONS, strict=True
    ):
        values, _ = figure_3_cut(interpretation.figure_3(), theta_r)
        ax.plot(degrees, values, color=look.colour, linestyle=line, label=interpretation.name)
        if interpretation == DEFAULT:
            peak = int(values.argmax())
            ax.plot(degrees[peak], values[peak], "v", color=look.colour, markersize=7)
            ax.annotate(
                f"{degrees[peak]:.1f}°",
                (degrees[peak], values[peak]),
                (6, 4),
                textcoords="offset points",
                color=look.colour,
                bbox=_PAPER,
            )
    ax.set_ylim(0.0, ax.get_ylim()[1] * 1.06)
    ax.set_ylabel("intensity f (1/sr)")
    ax.set_title("plane of incidence, all readings", fontsize=10)
    _dress(ax)
    ax.legend(
        frameon=False, fontsize=8.5, loc="upper left", title="reading of eqs (12), (13)", title_fontsize=8.5
    )


def _polarisation_cut(ax: Axes) -> None:
    theta_r = _grid()
    degrees = np.rad2deg(theta_r)
    for look, line, interpretation in zip(
        looks_of(len(INTERPRETATIONS)), _LINES, INTERPRETATIONS, strict=True
    ):
        _, q = figure_3_cut(interpretation.figure_3(), theta_r)
        ax.plot(degrees, np.abs(q), color=look.colour, linestyle=line)
        zeros = np.rad2deg(zero_crossings(theta_r, q))
        ax.plot(zeros, np.zeros_like(zeros), "o", color=look.colour, markersize=5, clip_on=False, zorder=5)
        if interpretation != DEFAULT:
            continue
        for zero in zeros:
            ax.annotate(
                f"0 at {zero:.1f}°".replace("-", "−"),
                (zero, 0.0),
                (0, 16),
                textcoords="offset points",
                ha="center",
                fontsize=9,
                color=look.colour,
                bbox=_PAPER,
                arrowprops={"arrowstyle": "-", "color": look.colour, "linewidth": 0.8},
            )
        for where in (degrees < zeros[0], (degrees > zeros[0]) & (degrees < zeros[-1]), degrees > zeros[-1]):
            peak = int(np.argmax(np.where(where, np.abs(q), -1.0)))
            ax.plot(degrees[peak], abs(q[peak]), "v", color=look.colour, markersize=7, zorder=5)
            ax.annotate(
                f"{abs(q[peak]):.1%}\n{degrees[peak]:.0f}°".replace("%", " %").replace("-", "−"),
                (degrees[peak], abs(q[peak])),
                (0, 7),
                textcoords="offset points",
                ha="center",
                fontsize=9,
                color=look.colour,
                bbox=_PAPER,
            )
    ax.set_ylim(0.0, 0.6)
    ax.set_ylabel("degree of polarisation")
    ax.set_title("zeros (dots) and maxima of the default reading (triangles)", fontsize=10)
    _dress(ax)
