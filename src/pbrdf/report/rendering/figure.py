"""Figures of rendered pictures: intensity, degree and angle of linear polarisation, Stokes components."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.report.style import new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pbrdf.rendering.picture import StokesPicture

__all__ = ["channel_figure", "colour_figure", "polarizer_figure", "stokes_figure"]

#: Exponent with which radiances are shown, as on a screen; a few brightest pixels are left to saturate.
_GAMMA, _BRIGHTEST = 1.0 / 2.2, 99.5
#: Where the linear polarisation is no more than so many standard errors its angle means nothing.
_SIGNIFICANT = 3.0
_NO_ANGLE = "#9A9A9A"
#: With standard errors from 16 passes one pixel in a hundred is beyond these by chance.
_CHANCE = 0.03
#: Of S3 over S0: single precision.
_ROUNDING = 1e-5
#: Inches of the longer side of a picture by itself, and of one among others.
_LARGE, _SMALL = 5.6, 3.4
_CHANNELS = ("s0", "dolp", "aolp", "s1", "s2", "s3")


def channel_figure(picture: StokesPicture, channel: str, title: str) -> Figure:
    """One channel of a picture with its scale.

    Parameters
    ----------
    picture
        What was rendered.
    channel
        ``"s0"``, ``"dolp"`` or ``"aolp"``, or ``"s1"``, ``"s2"``, ``"s3"`` relative to S0.
    title
        What it shows.
    """
    with styled():
        width, height = _size(picture, _LARGE)
        figure = new_figure(width + 1.1, height + 0.8)
        _draw(figure, figure.subplots(), picture, channel)
        figure.suptitle(title, fontsize=10.5)
        return figure


def polarizer_figure(picture: StokesPicture, angle: float, title: str) -> Figure:
    """The view through a linear polariser at an angle (radians), on the brightness scale of the whole light's half."""
    with styled():
        width, height = _size(picture, _LARGE)
        figure = new_figure(width + 1.1, height + 0.7)
        ax = figure.subplots()
        seen = picture.through_polarizer(angle)
        _radiance(figure, ax, seen, 0.5 * _brightest(picture.stokes[0]), "radiance behind the polariser")
        ax.set_title(f"linear polariser at {round(math.degrees(angle), 2):g}°")
        _polarizer_mark(ax, angle)
        figure.suptitle(title, fontsize=10.5)
        return figure


def stokes_figure(picture: StokesPicture, title: str) -> Figure:
    """All channels of a picture in one figure."""
    with styled():
        width, height = _size(picture, _SMALL)
        figure = new_figure(3.0 * (width + 1.0), 2.0 * (height + 0.45) + 0.75)
        for ax, channel in zip(figure.subplots(2, 3).ravel(), _CHANNELS, strict=True):
            _draw(figure, ax, picture, channel)
        figure.suptitle(title, fontsize=11)
        return figure


def colour_figure(pictures: Sequence[StokesPicture], title: str) -> Figure:
    """Three pictures of one scene as red, green and blue, the longest wavelength red, on one scale of radiance.

    Parameters
    ----------
    pictures
        With the attribute ``wavelength``, in any order.
    title
        What they show.
    """
    ordered = sorted(pictures, key=lambda picture: float(picture.attrs["wavelength"]), reverse=True)
    radiance = np.stack([picture.stokes[0] for picture in ordered], axis=-1)
    with styled():
        width, height = _size(ordered[0], _LARGE)
        figure = new_figure(width + 0.4, height + 0.8)
        ax = figure.subplots()
        ax.imshow(
            np.clip(np.nan_to_num(radiance) / _brightest(radiance), 0.0, 1.0) ** _GAMMA,
            interpolation="nearest",
        )
        _bare(ax)
        shown = ", ".join(f"{float(picture.attrs['wavelength']):g} nm" for picture in ordered)
        ax.set_title(f"radiance S0 at {shown} as red, green, blue", fontsize=9.5)
        figure.suptitle(title, fontsize=10.5)
        return figure


def _size(picture: StokesPicture, longer: float) -> tuple[float, float]:
    rows, columns = picture.shape
    scale = longer / max(rows, columns)
    return max(columns * scale, 2.6), max(rows * scale, 2.0)


def _draw(figure: Figure, ax: Axes, picture: StokesPicture, channel: str) -> None:
    if channel == "s0":
        _radiance(figure, ax, picture.stokes[0], _brightest(picture.stokes[0]), "radiance S0")
        ax.set_title("intensity")
    elif channel == "dolp":
        dolp = np.where(picture.stokes[0] > 0.0, picture.dolp, np.nan)
        top = min(1.0, max(0.05, math.ceil(_highest(picture, dolp) * 20.0) / 20.0))
        extend = "max" if np.nanmax(dolp, initial=0.0) > top else "neither"
        _image(figure, ax, dolp, "degree of linear polarisation", extend, cmap="viridis", vmin=0.0, vmax=top)
        ax.set_title("DoLP")
    elif channel == "aolp":
        _angle(figure, ax, picture)
    else:
        number = int(channel[1])
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(picture.stokes[0] > 0.0, picture.stokes[number] / picture.stokes[0], np.nan)
        top = max(_highest(picture, np.abs(ratio)), 0.01)
        meaning = {1: "horizontal +, vertical −", 2: "+45° +, −45° −", 3: "left circular +, right −"}[number]
        if number == 3 and _is_noise(picture):
            ratio = np.full_like(ratio, np.nan)
            meaning = "none beyond the noise"
        extend = "both" if np.nanmax(np.abs(ratio), initial=0.0) > top else "neither"
        _image(figure, ax, ratio, f"S{number} / S0", extend, cmap="RdBu_r", vmin=-top, vmax=top)
        ax.set_title(f"S{number} / S0: {meaning}", fontsize=9.5)


def _highest(picture: StokesPicture, values: np.ndarray) -> float:
    """Where a scale of values of 0 and more ends: nearly all surfaces are within it, the sky behind them may not be."""
    known = values[np.isfinite(values) & (True if picture.surface is None else picture.surface)]
    if not known.size:
        known = values[np.isfinite(values)]
    return float(np.percentile(known, _BRIGHTEST)) if known.size else 1.0


def _is_noise(picture: StokesPicture) -> bool:
    """Whether there is no circular polarisation but by chance: dielectrics make none of linear light."""
    known = np.isfinite(picture.std[3]) & (picture.stokes[0] > 0.0)
    if not known.any():
        return False
    beyond = np.abs(picture.stokes[3]) > np.maximum(
        _SIGNIFICANT * picture.std[3], _ROUNDING * picture.stokes[0]
    )
    return float(beyond[known].mean()) < _CHANCE


def _brightest(radiance: np.ndarray) -> float:
    known = radiance[np.isfinite(radiance)]
    top = float(np.percentile(known, _BRIGHTEST)) if known.size else 0.0
    return top if top > 0.0 else max(float(known.max(initial=0.0)), 1e-12)


def _radiance(figure: Figure, ax: Axes, values: np.ndarray, top: float, label: str) -> None:
    from matplotlib.colors import PowerNorm
    from matplotlib.ticker import MaxNLocator

    norm = PowerNorm(_GAMMA, 0.0, top, clip=True)
    bar = _image(figure, ax, np.maximum(values, 0.0), label, cmap="gray", norm=norm, extend="max")
    bar.set_ticks([tick for tick in MaxNLocator(4).tick_values(0.0, top) if tick <= top])


def _image(
    figure: Figure, ax: Axes, values: np.ndarray, label: str, extend: str = "neither", **how: Any
) -> Any:
    shown = ax.imshow(values, interpolation="nearest", **how)
    _bare(ax)
    bar = figure.colorbar(shown, ax=ax, shrink=0.9, extend=extend, pad=0.02)
    bar.set_label(label)
    bar.outline.set_visible(False)
    return bar


def _bare(ax: Axes) -> None:
    ax.set_xticks([])
    ax.set_yticks([])
    ax.grid(False)
    for spine in ax.spines.values():
        spine.set_visible(False)
    # what holds no number
    ax.set_facecolor(_NO_ANGLE)


def _angle(figure: Figure, ax: Axes, picture: StokesPicture) -> None:
    """AoLP in cyclic colours: −90° and 90° are the same direction and have the same colour."""
    polarised = np.hypot(picture.stokes[1], picture.stokes[2])
    error = np.hypot(picture.std[1], picture.std[2])
    angle = np.where((polarised > _SIGNIFICANT * error) | np.isnan(error), np.rad2deg(picture.aolp), np.nan)
    angle = np.where(polarised > 0.0, angle, np.nan)
    bar = _image(
        figure, ax, angle, "angle of linear polarisation (°)", cmap="twilight", vmin=-90.0, vmax=90.0
    )
    bar.set_ticks([-90, -45, 0, 45, 90])
    ax.set_title(
        "AoLP: 0° horizontal, counterclockwise\ngrey: no polarisation beyond the noise", fontsize=9.5
    )
    _direction_marks(bar.ax)


def _direction_marks(ax: Axes) -> None:
    """Small strokes in the scale along the directions that its colours stand for."""
    for degrees in (-67.5, -22.5, 22.5, 67.5):
        stroke = (2, 2, degrees + 90.0)
        ax.plot(
            [0.5], [degrees], marker=stroke, markersize=9, color="white", transform=ax.get_yaxis_transform()
        )


def _polarizer_mark(ax: Axes, angle: float) -> None:
    ax.plot(
        [0.06],
        [0.06],
        marker=(2, 2, math.degrees(angle) + 90.0),
        markersize=22,
        color="#E69F00",
        markeredgewidth=2.5,
        transform=ax.transAxes,
    )
