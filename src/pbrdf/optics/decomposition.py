"""Polar decomposition of Mueller matrices: a diattenuator, then a retarder, then a depolariser, M = M_Δ M_R M_D.

Source: Lu and Chipman, J. Opt. Soc. Am. A 13, 1106 (1996), whose V counts right circular light positive; the formulas
here hold for the project's V > 0, left circular (:mod:`pbrdf.optics.elements`), in which a retarder turns the Poincaré
sphere (Q, U, V) about its fast axis by +δ, right-handed.

With D the diattenuation vector and a = √(1 − D²): m_D = a + D Dᵀ/(1 + a), P_Δ = (P − m D)/a² and
m' = m_Δ m_R = (m − P_Δ Dᵀ) m_D⁻¹, which have no D in a denominator. m' = U Σ Vᵀ gives m_Δ = ±U Σ Uᵀ and the rotation
m_R = ±U Vᵀ, with the sign of det m'. The retardance comes from the quaternion of m_R, as exact near 0 and π as between.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pbrdf.optics.mueller import matrices_of, normalized

__all__ = ["LuChipman", "lu_chipman"]

#: What is below this, of M00 or of a rotation, is nothing: rounding, whose direction says nothing.
_NOTHING = 1e-10


@dataclass(frozen=True, eq=False)
class LuChipman:
    """Factors M = M_Δ M_R M_D of Mueller matrices and what they say; arrays of the kind that was decomposed.

    Vectors have the three components (Q, U, V), in a last dimension that is called ``stokes`` in xarray.

    Attributes
    ----------
    depolarizer, retarder, diattenuator
        M_Δ, M_R, M_D, shape (..., 4, 4); M_D has the transmittance M00, the others have 1 there.
    diattenuation, polarizance
        Lengths of the vectors below, shape (...).
    diattenuation_vector, polarizance_vector
        First row and first column over M00, shape (..., 3): the state that passes best points along the first, natural
        light leaves with the second.
    retardance
        Of M_R, radians within [0, π], shape (...).
    fast_axis
        Stokes parameters (Q, U, V) of the state whose phase leads, of the length 1, shape (..., 3): (1, 0, 0) for a
        retarder with its fast axis along x (p), (0, 0, 1) where left circular light leads. NaN without retardance. Of
        a half-wave retarder both states lead alike: the one with the first component that is not 0 positive is given.
    depolarization
        Depolarisation power 1 − |tr m_Δ|/3, shape (...): 0 for none, 1 for the ideal depolariser.
    """

    depolarizer: Any
    retarder: Any
    diattenuator: Any
    diattenuation: Any
    polarizance: Any
    diattenuation_vector: Any
    polarizance_vector: Any
    retardance: Any
    fast_axis: Any
    depolarization: Any


def lu_chipman(mueller: Any) -> LuChipman:
    """Decompose Mueller matrices as Lu and Chipman do.

    NaN stands where a matrix says nothing: everything where M00 is not above 0 or an element is not finite; retarder
    and depolariser of a perfect polariser (D = 1, or above by noise), which lets one state through; the retarder of
    what leaves less than two directions of the Poincaré sphere polarised, as the ideal depolariser. Where the
    determinant of M is below 0, m_Δ is negative in all directions, as in the paper: noise that turns the sign of a
    determinant near 0 turns the retardance with it.

    Parameters
    ----------
    mueller
        Mueller matrices, shape (..., 4, 4), normalised or not; or an xarray array with the dimensions ``stokes_out``
        and ``stokes_in``. Of reflection in the axes (p, s) of both rays the retardance of a smooth surface is |Δ| of
        ellipsometry, π for a mirror at normal incidence.

    Raises
    ------
    DataError
        If these are not 4 × 4 matrices.
    """
    matrices, like = matrices_of(mueller)
    M, known = normalized(matrices)
    m, D, P = M[..., 1:, 1:], M[..., 0, 1:], M[..., 1:, 0]
    square = np.square(D).sum(axis=-1)
    polariser = square >= 1.0 - _NOTHING
    a = np.sqrt(np.where(polariser, 0.0, 1.0 - square))[..., None, None]
    outer = D[..., :, None] * D[..., None, :] / (1.0 + a)
    diattenuator = np.copy(M)
    diattenuator[..., 1:, 0] = D
    diattenuator[..., 1:, 1:] = a * np.eye(3) + outer

    safe = np.where(polariser[..., None, None], 1.0, a)
    along = (P - np.einsum("...ij,...j->...i", m, D)) / safe[..., 0] ** 2
    rest = (m - along[..., :, None] * D[..., None, :]) @ ((np.eye(3) - outer) / safe)
    left, widths, right = np.linalg.svd(rest)
    odd = np.linalg.det(left) * np.linalg.det(right) < 0.0
    # the sign of a determinant that is rounding must not turn the retarder
    flat = widths[..., 2] <= _NOTHING
    signs = np.where((odd & ~flat)[..., None], -1.0, np.ones(3))
    signs[..., 2] = np.where(odd, -1.0, 1.0)
    rotation = (left * signs[..., None, :]) @ right
    remaining = (left * (signs * widths)[..., None, :]) @ np.swapaxes(left, -1, -2)

    depolarizer = _with_corner(remaining)
    depolarizer[..., 1:, 0] = along
    unknown = ~known | polariser
    undetermined = unknown | (widths[..., 1] <= _NOTHING)
    retardance, fast_axis = _turn(rotation)
    power = 1.0 - np.abs(np.einsum("...ii->...", remaining)) / 3.0
    both = ("stokes_out", "stokes_in")
    scale = np.where(known, matrices[..., 0, 0], np.nan)[..., None, None]
    return LuChipman(
        depolarizer=like(_nan_where(unknown, depolarizer), *both),
        retarder=like(_nan_where(undetermined, _with_corner(rotation)), *both),
        diattenuator=like(scale * diattenuator, *both),
        diattenuation=like(_nan_where(~known, np.sqrt(square))),
        polarizance=like(_nan_where(~known, np.sqrt(np.square(P).sum(axis=-1)))),
        diattenuation_vector=like(_nan_where(~known, D), "stokes"),
        polarizance_vector=like(_nan_where(~known, P), "stokes"),
        retardance=like(_nan_where(undetermined, retardance)),
        fast_axis=like(_nan_where(undetermined, fast_axis), "stokes"),
        depolarization=like(_nan_where(unknown, power)),
    )


def _with_corner(block: np.ndarray) -> np.ndarray:
    """A Mueller matrix of M00 = 1 without diattenuation and polarizance, from its block of (Q, U, V)."""
    whole = np.zeros((*block.shape[:-2], 4, 4))
    whole[..., 0, 0] = 1.0
    whole[..., 1:, 1:] = block
    return whole


def _nan_where(mask: np.ndarray, values: np.ndarray) -> np.ndarray:
    following = tuple(range(np.ndim(mask), np.ndim(values)))
    return np.where(np.expand_dims(mask, following), np.nan, values)


def _turn(rotation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angle within [0, π] and axis of rotations (..., 3, 3); the axis is NaN where there is no rotation.

    The elements give 4 q qᵀ of the quaternion q = (cos δ/2, axis sin δ/2) without a root or a quotient: its longest
    column is q but for the length, whatever the angle.
    """
    R = rotation
    trace = np.einsum("...ii->...", R)
    products = np.empty((*R.shape[:-2], 4, 4))
    products[..., 0, 0] = 1.0 + trace
    for k, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
        products[..., 0, k + 1] = products[..., k + 1, 0] = R[..., j, i] - R[..., i, j]
        products[..., i + 1, j + 1] = products[..., j + 1, i + 1] = R[..., i, j] + R[..., j, i]
        products[..., k + 1, k + 1] = 1.0 + 2.0 * R[..., k, k] - trace
    longest = np.argmax(np.einsum("...ii->...i", products), axis=-1)
    q = np.take_along_axis(products, longest[..., None, None], axis=-1)[..., 0]
    q /= np.sqrt(np.square(q).sum(axis=-1, keepdims=True))
    # q and −q are one rotation: the one with the first component that is not 0 positive, cos δ/2 the first of all
    first = np.argmax(np.abs(q) > _NOTHING, axis=-1)[..., None]
    q = q * np.where(np.take_along_axis(q, first, axis=-1) < 0.0, -1.0, 1.0)
    sine = np.sqrt(np.square(q[..., 1:]).sum(axis=-1))
    turned = sine > _NOTHING
    axis = q[..., 1:] / np.where(turned, sine, 1.0)[..., None]
    return 2.0 * np.arctan2(sine, np.abs(q[..., 0])), _nan_where(~turned, axis)
