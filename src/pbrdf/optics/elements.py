"""Mueller matrices of ideal and imperfect optical elements, in the frame of an instrument.

The instrument's axes are x (angle 0°), y and the direction of propagation k, right-handed; angles of elements turn
from x towards y, counterclockwise for an observer who looks against the light. Stokes vectors are (I, Q, U, V) with
Q = I_x − I_y, U = I_45° − I_135°. The sign of V is that of :mod:`pbrdf.optics.fresnel`, time factor e^{+iωt}:
**V > 0 is left circular light, whose field turns counterclockwise for that observer**. A retarder with its fast axis
along x then turns U into +V sin δ. (Goldstein, Mitsuba and katsu count right circular light positive: there the sign
of V is the opposite, and with it the signs of the last row and the last column but for their common element.)

Source: Goldstein, *Polarized Light*, ch. 5-6; sign of V changed as stated. Angles may be arrays: shapes are broadcast
and the matrices stand in the last two dimensions. Unlike the formulas of reflection these are NumPy's: an instrument
has few states, and nothing is compiled for them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pbrdf.errors import ModelError

__all__ = ["axis_rate", "diattenuator", "retardance_rate", "retarder", "rotate_frame"]


def diattenuator(angle: ArrayLike, diattenuation: ArrayLike = 1.0) -> np.ndarray:
    """Linear polariser, perfect or not.

    Parameters
    ----------
    angle
        Transmission axis, radians from x towards y.
    diattenuation
        (T_max − T_min)/(T_max + T_min), from −1 to 1; 1 is a perfect polariser, and a negative one passes more of
        the light across the axis.

    Returns
    -------
    ndarray
        Shape (..., 4, 4); light polarised along the axis passes whole when the diattenuation is 1, and natural light
        passes by half at any diattenuation.

    Raises
    ------
    ModelError
        If a diattenuation is not from −1 to 1.
    """
    angle, d = np.broadcast_arrays(np.asarray(angle, float), np.asarray(diattenuation, float))
    if not (np.abs(d) <= 1.0).all():
        raise ModelError(
            f"a diattenuation is {d.flat[np.argmax(~(np.abs(d) <= 1.0))]:g}, it must be from −1 to 1"
        )
    c, s = np.cos(2.0 * angle), np.sin(2.0 * angle)
    across = np.sqrt(1.0 - d * d)
    zero = np.zeros_like(c)
    rows = [
        [np.ones_like(c), d * c, d * s, zero],
        [d * c, c * c + across * s * s, (1.0 - across) * c * s, zero],
        [d * s, (1.0 - across) * c * s, s * s + across * c * c, zero],
        [zero, zero, zero, across],
    ]
    return 0.5 * _matrices(rows)


def retarder(angle: ArrayLike, retardance: ArrayLike) -> np.ndarray:
    """Linear retarder.

    Parameters
    ----------
    angle
        Fast axis, radians from x towards y.
    retardance
        Phase by which the fast component leads, radians.

    Returns
    -------
    ndarray
        Shape (..., 4, 4).
    """
    angle, delta = np.broadcast_arrays(np.asarray(angle, float), np.asarray(retardance, float))
    c, s = np.cos(2.0 * angle), np.sin(2.0 * angle)
    cd, sd = np.cos(delta), np.sin(delta)
    one, zero = np.ones_like(c), np.zeros_like(c)
    rows = [
        [one, zero, zero, zero],
        [zero, c * c + s * s * cd, c * s * (1.0 - cd), s * sd],
        [zero, c * s * (1.0 - cd), s * s + c * c * cd, -c * sd],
        [zero, -s * sd, c * sd, cd],
    ]
    return _matrices(rows)


def rotate_frame(angle: ArrayLike) -> np.ndarray:
    """Change of frame: Stokes vectors as read in axes turned by `angle` (radians, from x towards y); (..., 4, 4)."""
    angle = np.asarray(angle, float)
    c, s = np.cos(2.0 * angle), np.sin(2.0 * angle)
    one, zero = np.ones_like(c), np.zeros_like(c)
    return _matrices(
        [[one, zero, zero, zero], [zero, c, s, zero], [zero, -s, c, zero], [zero, zero, zero, one]]
    )


def retardance_rate(angle: ArrayLike, retardance: ArrayLike) -> np.ndarray:
    """Derivative of :func:`retarder` by the retardance, 1/rad, (..., 4, 4).

    The matrix is A + B cos δ + C sin δ: a quarter wave more, without the part A that does not change.
    """
    delta = np.asarray(retardance, float)
    constant = 0.5 * (retarder(angle, delta) + retarder(angle, delta + np.pi))
    values: np.ndarray = retarder(angle, delta + 0.5 * np.pi) - constant
    return values


def axis_rate(matrix: np.ndarray) -> np.ndarray:
    """Derivative of an element's matrix (..., 4, 4) as the element turns about the ray, 1/rad.

    The turned element is T(−χ) M T(χ) with T of :func:`rotate_frame`, hence M T'(0) − T'(0) M.
    """
    turn = np.zeros((4, 4))
    turn[1, 2], turn[2, 1] = 2.0, -2.0
    values: np.ndarray = matrix @ turn - turn @ matrix
    return values


def _matrices(rows: list[list[np.ndarray]]) -> np.ndarray:
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
