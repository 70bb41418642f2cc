"""Statements on the intensity: peaks and diffuse light."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pbrdf.models import Model
from pbrdf.reproduction.interpretations import Interpretation
from pbrdf.reproduction.plane import in_plane, offsets, turned
from pbrdf.reproduction.statements.statement import Outcome, listed

__all__ = [
    "diffuse_intensity_falls",
    "local_incidence_grows",
    "narrow_peaks",
    "peaks_alike",
    "radiance",
]

#: Turn of the sample within which the intensity must have halved, degrees.
_NARROW = 5.0
#: Largest ratio of the peaks of two positions that counts as "roughly equal".
_ALIKE = 1.25
#: Angle of incidence and the two angles of view between which the diffuse light is compared, degrees.
DIFFUSE_AT = (10.0, 20.0, 60.0)


def radiance(model: Model, positions: Sequence[float], offset: np.ndarray) -> np.ndarray:
    """f cosθ_i of the turning sample, which a camera sees; angles in radians, shape (positions, offsets)."""
    theta_i, theta_r = turned(positions, offset)
    values: np.ndarray = in_plane(model, theta_i, theta_r)[..., 0] * np.cos(theta_i)
    return values


def narrow_peaks(interpretation: Interpretation, positions: Sequence[float]) -> Outcome:
    """Statement 6: a strong peak in the mirror direction that falls off fast, so the roughness is small.

    Half the width at half the peak, in degrees of turn of the sample, must be less than 5° for every sample and
    position.

    Value: the largest half width of each sample.
    """
    turn = offsets(14.0)
    widths = []
    for model in interpretation.samples():
        values = radiance(model, positions, turn)
        widths.append(max(0.5 * np.ptp(np.rad2deg(turn[v >= 0.5 * v.max()])) for v in values))
    return Outcome(
        tuple(map(float, widths)), max(widths) < _NARROW, f"half widths {listed(widths, '.1f', '°')}"
    )


def local_incidence_grows(interpretation: Interpretation, positions: Sequence[float]) -> Outcome:
    """Statement 9: the local incidence at the intensity's maximum grows from position 1 to 3.

    The facet that mirrors source into camera has β = Ψ/2 whatever the sample's angle. That the peak belongs to it: the
    maximum must lie within 1° of turn of the mirror direction for every sample and position, and Ψ/2 must grow.

    Value: Ψ/2 in degrees, then the largest distance of the maximum from the mirror direction, degrees.
    """
    turn = offsets(14.0)
    beta = np.rad2deg(positions) / 2.0
    maxima = [turn[radiance(model, positions, turn).argmax(axis=1)] for model in interpretation.samples()]
    away = float(np.abs(np.rad2deg(maxima)).max())
    passed = bool((np.diff(beta) > 0.0).all()) and away < 1.0
    text = f"β = {listed(beta.tolist(), 'g', '°')}; maximum within {away:.2f}° of the mirror direction"
    return Outcome((*map(float, beta), away), passed, text)


def peaks_alike(interpretation: Interpretation, positions: Sequence[float]) -> Outcome:
    """Statement 10: the maxima of the intensity are roughly equal at the three positions.

    Cosine loss against Fresnel gain. Largest over smallest maximum of f cosθ_i must not exceed 1.25 for any
    sample, for a source without extent.

    Value: the ratio of each sample.
    """
    turn = offsets(2.0)
    ratios = []
    for model in interpretation.samples():
        peaks = radiance(model, positions, turn).max(axis=1)
        ratios.append(peaks.max() / peaks.min())
    return Outcome(
        tuple(map(float, ratios)), max(ratios) <= _ALIKE, f"largest over smallest {listed(ratios)}"
    )


def diffuse_intensity_falls(interpretation: Interpretation, positions: Sequence[float]) -> Outcome:
    """Statement 11: right of the peak, at the same sample angle, the diffuse intensity falls from position 1 to 3.

    The same sample angle is the same θ_i; θ_r grows with the position. Diffuse intensity at θ_r = 60° over that at
    20°, both at θ_i = 10°, must be below 1 for every sample.

    Value: the ratio of each sample.
    """
    theta_i, near, far = np.deg2rad(DIFFUSE_AT)
    ratios = []
    for model in interpretation.samples():
        first, last = in_plane(model, theta_i, [near, far], "diffuse")[:, 0]
        ratios.append(float(last / first))
    return Outcome(tuple(ratios), max(ratios) < 1.0, f"ratio {listed(ratios)}")
