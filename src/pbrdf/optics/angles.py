"""Angles of arrays, brought into the range that the project uses; over NumPy arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["radians_within_a_turn", "rounded_azimuth", "within_half_turn", "within_turn"]


def within_half_turn(angle: ArrayLike, half_turn: float = np.pi) -> NDArray[np.float64]:
    """An angle less whole turns, in (−half turn, half turn].

    Parameters
    ----------
    angle
        In any unit.
    half_turn
        π in that unit, or a quarter turn for directions without a sense.
    """
    angle = np.asarray(angle, dtype=np.float64)
    turned = angle - 2 * half_turn * np.ceil((angle - half_turn) / (2 * half_turn))
    found = np.where(np.abs(angle) < half_turn, angle, turned)
    # beside an end of the range rounding leads beyond it
    return np.where((found > half_turn) | (found <= -half_turn), half_turn, found)[()]


def within_turn(angle: ArrayLike, turn: float = 2 * np.pi) -> NDArray[np.float64]:
    """An angle less whole turns, in [0, turn); the remainder of −1e-17 alone is the whole turn."""
    found = np.mod(np.asarray(angle, dtype=np.float64), turn)
    return np.where(found == turn, 0.0, found)[()]


def rounded_azimuth(phi: ArrayLike) -> NDArray[np.float64]:
    """Azimuths, radians in [0, 2π) to nine decimals: one number for one direction."""
    return within_turn(np.round(within_turn(phi), 9), np.round(2 * np.pi, 9))


def radians_within_a_turn(degrees: ArrayLike) -> NDArray[np.float64]:
    """Radians of angles in degrees, of those beyond ±360° without their whole turns.

    These are taken off in degrees, where they are no rounded numbers: 360 k + x is x to the last digit.
    """
    angle = np.asarray(degrees, dtype=np.float64)
    return np.deg2rad(np.where(np.abs(angle) > 360.0, np.fmod(angle, 360.0), angle))
