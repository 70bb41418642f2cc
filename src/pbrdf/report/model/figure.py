"""Figure of a model at one angle of incidence."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.errors import ModelError
from pbrdf.report.dataset.panels import VIEWING_ANGLE, dress_hemisphere
from pbrdf.report.style import BLUE, GREY, RED, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pbrdf.models import Model

__all__ = ["model_figure"]

_GRAZING = 89.0
#: Decades below the brightest direction that the colours of the intensity reach down to.
_DECADES = 4.0


def model_figure(model: Model, theta_i: float, name: str) -> Figure:
    """Reflected light over the hemisphere and in the plane of incidence, for natural light.

    Four panels: intensity and degree of linear polarisation in every viewing direction (forward on the
    right); intensity and the signed polarisation Q/I in the plane of incidence, with its two parts: Q/I < 0
    is polarised as by reflection, Q/I > 0 as by transmission out of the coating.

    Parameters
    ----------
    model
        A model with single numbers as parameters.
    theta_i
        Angle of incidence, degrees.
    name
        What to call the model.

    Raises
    ------
    ModelError
        If the angle is out of range, or the model's parameters are arrays.
    """
    if any(np.ndim(value) for value in model.values.values()):
        raise ModelError(f"{name}: its parameters are arrays; a figure shows one set of single numbers")
    if not 0.0 <= theta_i < 90.0:
        raise ModelError(f"the angle of incidence is {theta_i:g}°; it must be at least 0° and below 90°")
    with styled():
        figure = new_figure(10.4, 8.2)
        grid = figure.add_gridspec(2, 2)
        discs = [figure.add_subplot(grid[0, i], projection="polar") for i in range(2)]
        lines = [figure.add_subplot(grid[1, i]) for i in range(2)]
        _draw_hemispheres(figure, discs, model, theta_i)
        _draw_plane(lines, model, theta_i)
        figure.suptitle(f"{name}: {model!r}\nincidence at {theta_i:g}°, natural light", fontsize=10.5)
        return figure


def _draw_hemispheres(figure: Figure, axes: list[Axes], model: Model, theta_i: float) -> None:
    from matplotlib.colors import LogNorm, Normalize

    # fine about the mirror direction, where a smooth coating has all of its specular light
    theta_r = np.unique(
        np.concatenate([np.linspace(0.0, _GRAZING, 90), theta_i + np.linspace(-6.0, 6.0, 49)])
    )
    theta_r = theta_r[(theta_r >= 0.0) & (theta_r <= _GRAZING)]
    phi = np.unique(np.concatenate([np.linspace(0.0, 180.0, 91), np.linspace(0.0, 12.0, 49)]))
    half = model.stokes(np.deg2rad(theta_i), np.deg2rad(theta_r)[:, None], np.deg2rad(phi)[None, :])
    # I and DoLP are even in φ: the other half is the mirror image
    intensity = np.concatenate([half[:, :0:-1, 0], half[..., 0]], axis=1)
    with np.errstate(
        invalid="ignore"
    ):  # a model without a body has directions without light, and no DoLP there
        dolp = np.hypot(half[..., 1], half[..., 2]) / half[..., 0]
    dolp = np.concatenate([dolp[:, :0:-1], dolp], axis=1)
    azimuth = np.deg2rad(np.concatenate([-phi[:0:-1], phi]))
    positive = intensity[intensity > 0.0]
    wide = positive.size > 0 and positive.max() > 30.0 * positive.min()
    norm = (
        LogNorm(max(positive.min(), positive.max() * 10.0**-_DECADES), positive.max())
        if wide
        else Normalize(0.0, intensity.max())
    )
    for ax, values, scale, label in (
        (axes[0], intensity, norm, "intensity (1/sr)"),
        (axes[1], dolp, Normalize(0.0, float(np.nanmax(dolp))), "degree of linear polarisation"),
    ):
        mesh = ax.pcolormesh(
            azimuth, theta_r, values, norm=scale, cmap="viridis", shading="gouraud", rasterized=True
        )
        dress_hemisphere(ax)
        ax.set_axisbelow(False)
        ax.grid(color="white", linewidth=0.5, alpha=0.5)
        ax.tick_params(axis="y", labelcolor="white")
        figure.colorbar(mesh, ax=ax, label=label, shrink=0.85, pad=0.1)
        ax.plot([np.pi], [theta_i], marker="*", color=RED, markersize=9, clip_on=False)
        ax.set_title(f"all viewing directions (★ source at {theta_i:g}°)", fontsize=9.5)


def _draw_plane(axes: list[Axes], model: Model, theta_i: float) -> None:
    s = np.unique(np.concatenate([np.linspace(-_GRAZING, _GRAZING, 1781), [theta_i]]))
    angles = np.deg2rad(theta_i), np.deg2rad(np.abs(s)), np.where(s < 0.0, np.pi, 0.0)
    parts = {part: model.stokes(*angles, part=part) for part in ("total", "specular", "diffuse")}
    total = parts["total"]
    styles: dict[str, dict[str, Any]] = {
        "total": {"color": "black", "linewidth": 1.8},
        "specular": {"color": BLUE, "linestyle": "--"},
        "diffuse": {"color": RED, "linestyle": "-."},
    }
    left, right = axes
    floor = total[:, 0].max() * 10.0**-_DECADES
    for part, stokes in parts.items():
        left.plot(s, np.where(stokes[:, 0] > 0.0, stokes[:, 0], np.nan), label=part, **styles[part])
        with np.errstate(invalid="ignore"):
            share = stokes[:, 1] / total[:, 0]
        right.plot(s, share, label=part, **styles[part])
    if total[:, 0].max() > 30.0 * total[:, 0].min():
        left.set_yscale("log")
        left.set_ylim(max(total[:, 0].min() * 0.5, floor), total[:, 0].max() * 1.5)
    else:
        left.set_ylim(0.0, total[:, 0].max() * 1.1)
    left.set_ylabel("intensity (1/sr)")
    right.axhline(0.0, color=GREY, linewidth=0.8)
    right.set_ylabel("Q / I of the total light  (Q = Ip − Is)")
    for ax in axes:
        ax.axvline(theta_i, color=GREY, linewidth=0.7, linestyle=":")
        ax.set_xlim(-90.0, 90.0)
        ax.set_xticks(np.arange(-90, 91, 30))
        ax.set_xlabel(VIEWING_ANGLE)
    left.set_title("plane of incidence", fontsize=9.5)
    right.set_title("polarised by reflection below 0, by transmission above", fontsize=9.5)
    left.legend(frameon=False)
