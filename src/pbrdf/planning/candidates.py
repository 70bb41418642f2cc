"""Geometries from which a plan chooses: fine about the mirror direction, where the lobe is, and coarse elsewhere."""

from __future__ import annotations

import math

import numpy as np

from pbrdf.errors import FitError
from pbrdf.instruments.goniometer.protocols import Protocol
from pbrdf.models.base import Model

__all__ = ["in_plane_candidates", "out_of_plane_candidates"]

#: Tilts of the mirror facet that resolve the lobe, in units of its slope width.
_LOBE = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0)
#: The same out of plane, where there are two tilts.
_COARSE_LOBE = (0.0, 1.0, 2.0, 3.0, 4.0)


def in_plane_candidates(
    model: Model,
    *,
    smallest_bistatic: float = math.radians(10.0),
    largest_zenith: float = math.radians(80.0),
    position_step: float = math.radians(5.0),
    angle_step: float = math.radians(2.5),
) -> Protocol:
    """Geometries in the plane of incidence: camera positions × sample angles.

    Parameters
    ----------
    model
        Whose lobe is to be resolved.
    smallest_bistatic
        The camera obscures the source below it, radians.
    largest_zenith
        Of both rays, radians.
    position_step, angle_step
        Between camera positions, and between sample angles away from the lobe, radians.

    Raises
    ------
    FitError
        If the limits leave nothing.
    """
    positions = _positions(smallest_bistatic, largest_zenith, position_step)
    return _within(
        Protocol.in_plane(positions, _sample_angles(model, positions, angle_step, _LOBE)), largest_zenith
    )


def out_of_plane_candidates(
    model: Model,
    *,
    smallest_bistatic: float = math.radians(10.0),
    largest_zenith: float = math.radians(80.0),
    position_step: float = math.radians(10.0),
    angle_step: float = math.radians(7.5),
) -> Protocol:
    """Geometries in and out of the plane of incidence: camera positions × sample angles × tilts of the sample.

    Source and camera stay in one plane, the sample turns about two axes (:meth:`Protocol.two_axes`). Tilts to one side
    only: by the mirror symmetry of the sample the other side tells the same. Parameters as of
    :func:`in_plane_candidates`.

    Raises
    ------
    FitError
        If the limits leave nothing.
    """
    positions = _positions(smallest_bistatic, largest_zenith, position_step)
    turned = _sample_angles(model, positions, angle_step, _COARSE_LOBE)
    tilts = np.concatenate([_lobe(model, _COARSE_LOBE), np.arange(angle_step, largest_zenith, angle_step)])
    return _within(Protocol.two_axes(positions, turned, np.unique(np.round(tilts, 4))), largest_zenith)


def _positions(smallest: float, zenith: float, step: float) -> np.ndarray:
    if not (0.0 < smallest < 2.0 * zenith < math.pi and step > 0.0):
        raise FitError(
            f"candidates: bistatic angles from {math.degrees(smallest):g}° and zenith angles up to "
            f"{math.degrees(zenith):g}° leave no camera position"
        )
    return np.arange(smallest, 2.0 * zenith + 1e-9, step)


def _lobe(model: Model, tilts: tuple[float, ...]) -> np.ndarray:
    """Tilts of the mirror facet that resolve the lobe, radians."""
    return np.arctan(np.array(tilts) * float(model.lobe_width()))


def _sample_angles(
    model: Model, positions: np.ndarray, step: float, tilts: tuple[float, ...]
) -> list[np.ndarray]:
    """Sample angles about the mirror direction of each camera position, to a hundredth of a degree."""
    lobe = _lobe(model, tilts)
    even = np.arange(step, 0.5 * math.pi, step)
    offsets = np.concatenate([lobe, even[even > lobe.max()]])
    offsets = np.round(np.rad2deg(np.concatenate([-offsets[::-1], offsets[1:]])), 2)
    return [np.deg2rad(np.round(90.0 - 0.5 * np.rad2deg(psi), 2) + offsets) for psi in positions]


def _within(protocol: Protocol, zenith: float) -> Protocol:
    keep = np.maximum(protocol.theta_i, protocol.theta_r) <= zenith + 1e-9
    # a source beyond the normal tells nearly what a camera beyond it does, by reciprocity (2 % of the gain)
    keep &= ~(protocol.sample_angle > 0.5 * np.pi + 1e-9)
    return protocol.subset(keep)
