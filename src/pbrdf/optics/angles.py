"""Angles of arrays, brought into the range that the project uses; over NumPy arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["radians_within_a_turn", "within_half_turn"]


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
    return angle - 2 * half_turn * np.ceil((angle - half_turn) / (2 * half_turn))


def radians_within_a_turn(degrees: ArrayLike) -> NDArray[np.float64]:
    """Radians of angles in degrees, of those beyond ±360° without their whole turns.

    These are taken off in degrees, where they are no rounded numbers: 360 k + x is x to the last digit.
    """
    angle = np.asarray(degrees, dtype=np.float64)
    return np.deg2rad(np.where(np.abs(angle) > 360.0, np.fmod(angle, 360.0), angle))
