"""Polar surfaces: in every direction the distance from the origin is the value there."""

from __future__ import annotations

from typing import Any

import numpy as np

from pbrdf.report.style import GREY, RED

__all__ = ["draw_directions", "draw_polar_surface", "polar_surface"]


def polar_surface(
    theta_r: np.ndarray, phi: np.ndarray, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points at the distance `values` from the origin in the directions θ_r, φ (radians).

    x points forward, z along the normal.
    """
    across = values * np.sin(theta_r)
    return across * np.cos(phi), across * np.sin(phi), values * np.cos(theta_r)


def draw_polar_surface(
    ax: Any,
    theta_r: np.ndarray,
    phi: np.ndarray,
    values: np.ndarray,
    theta_i: float,
) -> None:
    """Draw a polar surface whose values are distances of at most 1, with the directions around it.

    Parameters
    ----------
    ax
        Three-dimensional axes.
    theta_r, phi
        Radians, broadcast against each other to the shape of ``values``.
    values
        What is drawn, ≥ 0.
    theta_i
        Angle of incidence, degrees; the arrow of the light.
    """
    from matplotlib import colormaps

    x, y, z = polar_surface(theta_r, phi, values)
    colours = colormaps["viridis"](
        0.25 * (values[1:, 1:] + values[1:, :-1] + values[:-1, 1:] + values[:-1, :-1])
    )
    surface = ax.plot_surface(
        x, y, z, facecolors=colours, rstride=1, cstride=1, linewidth=0, antialiased=False, shade=True
    )
    surface.set_rasterized(True)
    draw_directions(ax, theta_i)


def draw_directions(ax: Any, theta_i: float) -> None:
    """The plane below a polar surface with its azimuths, the light that falls on it and its mirror direction."""
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    for radius in (0.5, 1.0):
        ax.plot(
            radius * np.cos(turn), radius * np.sin(turn), 0.0 * turn, color="#BBBBBB", linewidth=0.7, zorder=0
        )
    for degrees, label in (
        (0, "forward\nφ = 0°"),
        (90, "90°"),
        (180, "back\n180°"),
        (-90, "−90°"),
        (45, "45°"),
        (135, "135°"),
        (-45, "−45°"),
        (-135, "−135°"),
    ):
        c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
        ax.plot([0.0, c], [0.0, s], [0.0, 0.0], color="#DDDDDD", linewidth=0.6, zorder=0)
        main = degrees % 90 == 0
        ax.text(
            1.2 * c,
            1.2 * s,
            0.0,
            label,
            ha="center",
            va="center",
            fontsize=9 if main else 7.5,
            color="black" if main else GREY,
        )
    incidence = np.deg2rad(theta_i)
    source = 1.15 * np.array([-np.sin(incidence), 0.0, np.cos(incidence)])
    ax.quiver(*source, *(-0.45 * source), color=RED, linewidth=1.8, arrow_length_ratio=0.25, normalize=False)
    ax.text(*(1.1 * source), "light", color=RED, ha="center", fontsize=9)
    mirror = 1.15 * np.array([np.sin(incidence), 0.0, np.cos(incidence)])
    ax.plot(*zip((0, 0, 0), mirror, strict=True), color=RED, linewidth=1.0, linestyle=":")
    ax.text(*(1.1 * mirror), "mirror", color=RED, ha="center", fontsize=9)
    ax.set(xlim=(-0.95, 0.95), ylim=(-0.95, 0.95), zlim=(0.0, 0.95))
    ax.set_box_aspect((2.0, 2.0, 1.0), zoom=1.35)
    ax.view_init(elev=28.0, azim=-82.0)
    ax.set_axis_off()
