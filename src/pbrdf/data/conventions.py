"""Conversions between the conventions of others and the project's.

Those by the name of a program are made of these: :mod:`pbrdf.data.convert`.

The project's convention: φ = 0 is the forward half-plane. For light travelling along k, s = k×ẑ/|k×ẑ|, where
ẑ is the surface normal, and p = s×k, so that (p, s, k) is right-handed; Q = |E_p|² − |E_s|² and
U = 2 Re(E_p E_s*). Angles are in radians. Stokes arrays have the shape (..., 4), Mueller matrices
(..., 4, 4), indexed [outgoing, incident]; angles have the shape of the leading dimensions.

Conversions that are their own inverse are called ``swap_...`` or ``flip_...``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pbrdf.errors import DataError
from pbrdf.optics.angles import within_half_turn

__all__ = [
    "aolp_swap_sp",
    "apply_cosine_weight",
    "azimuth_forward_pi_to_zero",
    "azimuth_forward_zero_to_pi",
    "brdf_to_reflectance_factor",
    "covariance_flip_v",
    "covariance_swap_sp",
    "dolp_aolp_from_stokes",
    "mueller_flip_v",
    "mueller_sp_to_xyxy",
    "mueller_swap_sp",
    "mueller_xyxy_to_sp",
    "qu_from_dolp_aolp",
    "real_array",
    "reflectance_factor_to_brdf",
    "remove_cosine_weight",
    "stokes_flip_v",
    "stokes_swap_sp",
]

_SWAP_SP = np.array([1.0, -1.0, -1.0, 1.0])
_FLIP_V = np.array([1.0, 1.0, 1.0, -1.0])
#: Imaginary parts up to this share of the largest element are the rounding of a calculation with Jones matrices.
_ROUNDING = 1e-9


def real_array(values: ArrayLike, what: str, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Real numbers whose last dimensions have a given shape.

    Parameters
    ----------
    values
        What a program gave; complex numbers whose imaginary parts are rounding pass for real ones.
    what
        What they are, for the message.
    shape
        Of one vector or matrix: (4,) or (4, 4).

    Returns
    -------
    ndarray
        Shape (..., *shape); NaN where a complex number is not finite.

    Raises
    ------
    DataError
        If they are none. Says where the four components stand if that is not at the end.
    """
    array = np.asarray(values)
    if array.dtype.kind == "c":
        finite = np.isfinite(array)
        largest = abs(array.real).max(initial=0.0, where=finite)
        if not (abs(array.imag) > _ROUNDING * largest).any(where=finite):
            # what is not finite in either part is not a number
            array = np.where(finite, array.real, np.nan)
    wanted = f"(..., {', '.join(map(str, shape))})"
    if array.shape[-len(shape) :] != shape or array.dtype.kind not in "fiu":
        message = f"{what} are real numbers of the shape {wanted}; these are {array.dtype} of {array.shape}"
        if array.dtype.kind in "fiu" and array.ndim > len(shape) and array.shape[: len(shape)] == shape:
            # Dr.Jit's matrices as arrays; their ``.T`` has rows and columns exchanged as well.
            first, last = tuple(range(len(shape))), tuple(range(-len(shape), 0))
            message += f": numpy.moveaxis(x, {first}, {last}) puts them so"
        raise DataError(message)
    return array.astype(np.float64)


def azimuth_forward_pi_to_zero(phi: ArrayLike, half_turn: float = np.pi) -> NDArray[np.float64]:
    """Relative azimuth from "forward is π" to "forward is 0".

    Parameters
    ----------
    phi
        Azimuth of the viewer relative to the source, both directions pointing away from the surface.
    half_turn
        π in the unit of `phi`. 180 converts degrees, without the rounding of a detour through radians.

    Returns
    -------
    ndarray
        φ − half turn, brought into (−half turn, half turn].
    """
    shifted = np.asarray(phi, dtype=np.float64) - half_turn
    return within_half_turn(shifted, half_turn)


def azimuth_forward_zero_to_pi(phi: ArrayLike, half_turn: float = np.pi) -> NDArray[np.float64]:
    """Inverse of :func:`azimuth_forward_pi_to_zero`, with the same range."""
    shifted = np.asarray(phi, dtype=np.float64) + half_turn
    return within_half_turn(shifted, half_turn)


def stokes_swap_sp(stokes: ArrayLike) -> NDArray[np.float64]:
    """Stokes vectors from Q = I_s − I_p to Q = I_p − I_s, or back.

    Both frames are right-handed with k, (s, p', k) and (p, s, k) with p' = −p, so one is the other turned by
    90° about the ray: Q and U change sign, V does not.
    """
    values: NDArray[np.float64] = np.asarray(stokes, dtype=np.float64) * _SWAP_SP
    return values


def mueller_swap_sp(mueller: ArrayLike) -> NDArray[np.float64]:
    """Mueller matrices from Q = I_s − I_p to Q = I_p − I_s, or back: see :func:`stokes_swap_sp`."""
    return np.asarray(mueller, dtype=np.float64) * np.outer(_SWAP_SP, _SWAP_SP)


def aolp_swap_sp(aolp: ArrayLike) -> NDArray[np.float64]:
    """AoLP counted from s to AoLP counted from p, or back: 90° further, brought into (−π/2, π/2]."""
    angle = np.asarray(aolp, dtype=np.float64)
    return within_half_turn(angle + np.pi / 2, np.pi / 2)


def stokes_flip_v(stokes: ArrayLike) -> NDArray[np.float64]:
    """Stokes vectors with the other handedness counted as V > 0."""
    values: NDArray[np.float64] = np.asarray(stokes, dtype=np.float64) * _FLIP_V
    return values


def mueller_flip_v(mueller: ArrayLike) -> NDArray[np.float64]:
    """Mueller matrices with the other handedness counted as V > 0, on both sides."""
    return np.asarray(mueller, dtype=np.float64) * np.outer(_FLIP_V, _FLIP_V)


def covariance_swap_sp(covariance: ArrayLike) -> NDArray[np.float64]:
    """Covariances of Stokes vectors from Q = I_s − I_p to Q = I_p − I_s, or back: see :func:`stokes_swap_sp`.

    The vector is multiplied with D = diag(1, −1, −1, 1), so its covariance C, shape (..., 4, 4), becomes D C Dᵀ.
    """
    return np.asarray(covariance, dtype=np.float64) * np.outer(_SWAP_SP, _SWAP_SP)


def covariance_flip_v(covariance: ArrayLike) -> NDArray[np.float64]:
    """Covariances of Stokes vectors, shape (..., 4, 4), with the other handedness counted as V > 0."""
    return np.asarray(covariance, dtype=np.float64) * np.outer(_FLIP_V, _FLIP_V)


def mueller_xyxy_to_sp(mueller: ArrayLike, phi: ArrayLike) -> NDArray[np.float64]:
    """Mueller matrices from SCATMECH's ``xyxy`` frame of the sample to the surface's s and p.

    The plane of incidence is the xz plane, so the incident frame is the same in both. The outgoing ``xyxy``
    frame is the frame of s and p of the forward direction φ = 0, carried to φ by turning it about the ray
    by −φ: for light that leaves along the normal it is the fixed x and y of the sample. Hence, whichever of
    s and p counts as Q > 0,

        Q_sp = cos 2φ Q_xy + sin 2φ U_xy,    U_sp = −sin 2φ Q_xy + cos 2φ U_xy.

    Parameters
    ----------
    mueller
        Shape (..., 4, 4); the source at azimuth π of the sample.
    phi
        Azimuth of the viewer, φ = 0 forward, shape (...).
    """
    return _turn_outgoing(mueller, phi)


def mueller_sp_to_xyxy(mueller: ArrayLike, phi: ArrayLike) -> NDArray[np.float64]:
    """Inverse of :func:`mueller_xyxy_to_sp`."""
    return _turn_outgoing(mueller, -np.asarray(phi, dtype=np.float64))


def _turn_outgoing(mueller: ArrayLike, angle: ArrayLike) -> NDArray[np.float64]:
    matrix = np.asarray(mueller, dtype=np.float64)
    double = 2 * np.asarray(angle, dtype=np.float64)[..., np.newaxis]
    turned = np.broadcast_to(matrix, np.broadcast_shapes(matrix.shape, (*double.shape[:-1], 4, 4))).copy()
    q, u = matrix[..., 1, :], matrix[..., 2, :]
    turned[..., 1, :] = np.cos(double) * q + np.sin(double) * u
    turned[..., 2, :] = -np.sin(double) * q + np.cos(double) * u
    return turned


def remove_cosine_weight(values: ArrayLike, theta: ArrayLike) -> NDArray[np.float64]:
    """Values given as f · cos θ to f: division by cos θ.

    Parameters
    ----------
    values
        Shape (N,), (N, 4) or (N, 4, 4).
    theta
        The zenith angle of the weight (θ_r for a cosine-weighted BRDF, θ_i for radiance), shape (N,).
    """
    array = np.asarray(values, dtype=np.float64)
    return array / _cosine(theta, array.ndim)


def apply_cosine_weight(values: ArrayLike, theta: ArrayLike) -> NDArray[np.float64]:
    """Inverse of :func:`remove_cosine_weight`."""
    array = np.asarray(values, dtype=np.float64)
    return array * _cosine(theta, array.ndim)


def _cosine(theta: ArrayLike, ndim: int) -> NDArray[np.float64]:
    cosine = np.cos(np.asarray(theta, dtype=np.float64))
    return cosine.reshape(cosine.shape + (1,) * (ndim - cosine.ndim))


def reflectance_factor_to_brdf(values: ArrayLike) -> NDArray[np.float64]:
    """Reflectance factor (1 for a perfect Lambertian diffuser) to BRDF (1/sr): division by π."""
    return np.asarray(values, dtype=np.float64) / np.pi


def brdf_to_reflectance_factor(values: ArrayLike) -> NDArray[np.float64]:
    """Inverse of :func:`reflectance_factor_to_brdf`."""
    return np.asarray(values, dtype=np.float64) * np.pi


def dolp_aolp_from_stokes(stokes: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Degree and angle of linear polarisation, √(Q²+U²)/I and ½ atan2(U, Q).

    Parameters
    ----------
    stokes
        Shape (..., 3) or (..., 4).

    Returns
    -------
    dolp, aolp
        Shape (...). DoLP is NaN where I = 0; AoLP, in (−π/2, π/2], is 0 along p and π/2 along s.
    """
    array = np.asarray(stokes, dtype=np.float64)
    intensity, q, u = array[..., 0], array[..., 1], array[..., 2]
    linear = np.hypot(q, u)
    dolp = np.divide(linear, intensity, out=np.full_like(linear, np.nan), where=intensity != 0)
    return dolp, within_half_turn(0.5 * np.arctan2(u, q), 0.5 * np.pi)


def qu_from_dolp_aolp(
    intensity: ArrayLike, dolp: ArrayLike, aolp: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Q = I · DoLP · cos(2 AoLP) and U = I · DoLP · sin(2 AoLP); the arrays broadcast."""
    linear = np.asarray(intensity, dtype=np.float64) * np.asarray(dolp, dtype=np.float64)
    double = 2 * np.asarray(aolp, dtype=np.float64)
    return linear * np.cos(double), linear * np.sin(double)
