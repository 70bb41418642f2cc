"""Which reading would tell the remaining candidates apart best: in a sentence, a table, numbers and a figure."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.data.schema import written
from pbrdf.identification.telling_apart import NextMeasurement
from pbrdf.report.numbers import brief
from pbrdf.report.style import GREY, RED, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pbrdf.inversion.observations import Observations

__all__ = ["NEXT_HEADINGS", "next_figure", "next_record", "next_rows", "next_sentence"]

NEXT_HEADINGS = ("θi", "θr", "φ", "expected information", "right afterwards", "candidates left")
#: Geometries that are named, and by how much one of their angles differs.
_NAMED, _APART = 5, math.radians(5.0)
#: Sine of the azimuth below which a measured geometry counts as one of the plane of incidence.
_IN_PLANE = 0.05
#: Channels that are named one by one.
_LISTED = 4
#: What a reading tells of what is open below which one alone is said not to be enough.
_LITTLE = 0.25


def next_sentence(found: NextMeasurement, candidates: int) -> str:
    """The best reading, what it is expected to tell and how many of so many candidates it would leave."""
    bits = found.information[0]
    theta_i, theta_r, phi = _angles(found, 0)
    count = len(found.materials)
    among = f"of {count} candidates" if count >= candidates else f"of the {count} most probable candidates"
    told = (
        f"Next measurement: {_read(found.channels)} at θi {theta_i}, θr {theta_r}, φ {phi} would tell them apart best, "
        f"by an expected {_bits(bits)} of the {_bits(found.entropy)} bits that are open; {among} it would leave "
        f"{_number(found.expected_left[0])} on average."
    )
    if bits < _LITTLE * found.entropy:
        told += " No single reading tells them apart well."
    return told


def next_rows(found: NextMeasurement) -> list[list[str]]:
    """Geometries that differ, the best first, as texts below :data:`NEXT_HEADINGS`."""
    return [
        [
            *_angles(found, g),
            f"{_bits(found.information[g])} bits",
            f"{100.0 * found.expected_right[g]:.0f} %",
            _number(found.expected_left[g]),
        ]
        for g in _different(found)
    ]


def next_record(found: NextMeasurement, candidates: int) -> dict[str, Any]:
    """The same as plain values: angles in degrees, information in bits."""
    return {
        "candidates": dict(zip(found.materials, found.probability, strict=True)),
        "open_bits": found.entropy,
        "right_now": found.right_now,
        "channels": list(found.channels),
        "sentence": next_sentence(found, candidates),
        "geometries": [
            {
                **{
                    f"{name}_degrees": round(math.degrees(getattr(found.geometries, name)[g]), 6)
                    for name in ("theta_i", "theta_r", "phi")
                },
                "expected_bits": found.information[g],
                "expected_right": found.expected_right[g],
                "expected_left": found.expected_left[g],
            }
            for g in _different(found)
        ],
    }


def next_figure(found: NextMeasurement, data: Observations, title: str) -> Figure:
    """Expected information over the candidate geometries, with the best one and those measured so far.

    A direction of view on the side of the source has a negative angle.
    """
    with styled():
        figure = new_figure(5.4, 4.4)
        ax = figure.add_subplot()
        # the best on top
        order = np.argsort(found.information, kind="stable")
        incidence, view = _plane(found.geometries)
        drawn = ax.scatter(
            incidence[order],
            view[order],
            c=found.information[order],
            vmin=0.0,
            vmax=max(found.entropy, 1e-12),
            cmap="viridis",
            s=14.0,
            marker="s",
            linewidths=0.0,
            rasterized=True,
        )
        bar = figure.colorbar(drawn, ax=ax, pad=0.02)
        bar.set_label(f"expected information (bits; {_bits(found.entropy)} are open)", fontsize=9.0)
        so_far = np.array(_plane(data))[:, np.abs(np.sin(data.phi)) < _IN_PLANE]
        ax.plot(
            *so_far, "x", color=GREY, markeredgecolor="white", markersize=8.0, markeredgewidth=3.0, zorder=3
        )
        ax.plot(*so_far, "x", color="black", markersize=7.0, markeredgewidth=1.2, label="measured", zorder=4)
        ax.plot(
            incidence[:1],
            view[:1],
            "*",
            color=RED,
            markeredgecolor="white",
            markersize=15.0,
            label="the best",
            zorder=5,
        )
        ax.set_xlabel("angle of incidence θi (°)")
        ax.set_ylabel("angle of view θr (°), negative: on the side of the source")
        ax.legend(frameon=True, loc="lower left", fontsize=9.0)
        ax.set_title(title)
    return figure


def _plane(geometries: Any) -> tuple[np.ndarray, np.ndarray]:
    """Angles of incidence and signed angles of view, degrees."""
    sign = np.where(np.cos(geometries.phi) < 0.0, -1.0, 1.0)
    return np.degrees(geometries.theta_i), sign * np.degrees(geometries.theta_r)


def _different(found: NextMeasurement) -> list[int]:
    """Numbers of the best geometries that are no near copies of a better one."""
    places = np.radians(np.stack(_plane(found.geometries), axis=1))
    chosen: list[int] = []
    for g, place in enumerate(places):
        if all(np.abs(place - places[one]).max() >= _APART for one in chosen):
            chosen.append(g)
        if len(chosen) == _NAMED:
            break
    return chosen


def _angles(found: NextMeasurement, g: int) -> list[str]:
    angles = (getattr(found.geometries, name)[g] for name in ("theta_i", "theta_r", "phi"))
    return [f"{math.degrees(angle):.1f}°".replace(".0°", "°") for angle in angles]


def _read(channels: tuple[str, ...]) -> str:
    """What is read; of many the first and the last."""
    if len(channels) > _LISTED:
        return f"{written(channels[0])} … {written(channels[-1])}"
    return ", ".join(map(written, channels))


def _bits(bits: float) -> str:
    return brief(bits, 2) if bits >= 0.005 else "0"


def _number(left: float) -> str:
    return f"{left:.1f}"
