"""Stokes vectors and Mueller matrices of other programs, by the program's name.

Each function takes what the program gives and returns it in the project's convention (:mod:`pbrdf.data.conventions`):
frames (p, s, k), Q = I_p − I_s, V > 0 left circular, the index n − iκ. Stokes arrays have the shape (..., 4), Mueller
matrices (..., 4, 4), [outgoing, incident]; what has another shape or is not real is a DataError. NaN stays NaN.

A conversion is D M D with a diagonal D = ±1, its own inverse: applied to ours it gives theirs. That of pyElli is not,
as pyElli divides by M00. What each D means is said in ``docs/conventions.md``, "Other programs", and what else differs
in ``docs/neighbours.md``; the tests hold the functions to numbers that the programs gave.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pbrdf.data.conventions import mueller_flip_v, mueller_swap_sp, real_array, stokes_flip_v, stokes_swap_sp
from pbrdf.errors import DataError

__all__ = [
    "PROGRAMS",
    "from_eradiate_mueller",
    "from_eradiate_stokes",
    "from_katsu_mueller",
    "from_katsu_stokes",
    "from_mitsuba_mueller",
    "from_mitsuba_stokes",
    "from_polanalyser_mueller",
    "from_polanalyser_stokes",
    "from_pyelli_index",
    "from_pyelli_mueller",
    "from_pypolar_mueller",
    "from_pypolar_stokes",
    "from_scatmech_mueller",
    "from_scatmech_stokes",
]


def from_katsu_mueller(mueller: ArrayLike) -> NDArray[np.float64]:
    """Mueller matrices of katsu: V > 0 is right circular there, axes and angles are ours.

    Its ``depolarizer(angle, …)`` turns by −angle, which no conversion of the matrix can know.
    """
    return mueller_flip_v(_mueller(mueller))


def from_katsu_stokes(stokes: ArrayLike) -> NDArray[np.float64]:
    """Stokes vectors of katsu: see :func:`from_katsu_mueller`."""
    return stokes_flip_v(_stokes(stokes))


def from_polanalyser_mueller(mueller: ArrayLike) -> NDArray[np.float64]:
    """Mueller matrices of polanalyser, 4 × 4: V > 0 is right circular there, axes and angles are ours."""
    return mueller_flip_v(_mueller(mueller))


def from_polanalyser_stokes(stokes: ArrayLike) -> NDArray[np.float64]:
    """Stokes vectors of polanalyser, four components: see :func:`from_polanalyser_mueller`."""
    return stokes_flip_v(_stokes(stokes))


def from_pypolar_mueller(mueller: ArrayLike) -> NDArray[np.float64]:
    """Mueller matrices of pypolar, elements and reflection at a surface: V > 0 is right circular there.

    Frames (Q > 0 along p) and the index n − iκ are ours. ``op_fresnel_transmission`` is of fields: multiply it with
    Re(n cosθ_t)/cosθ_i to have the flux into a dielectric.
    """
    return mueller_flip_v(_mueller(mueller))


def from_pypolar_stokes(stokes: ArrayLike) -> NDArray[np.float64]:
    """Stokes vectors of pypolar: see :func:`from_pypolar_mueller`.

    Not those of ``stokes_ellipsometry``, which turn by 2Δ for Δ: give it half of Δ.
    """
    return stokes_flip_v(_stokes(stokes))


def from_pyelli_mueller(mueller: ArrayLike, reflectance: ArrayLike | None = None) -> NDArray[np.float64]:
    """Mueller matrices of pyElli, ``Result.mueller_matrix``: the signs are ours, but M00 has been divided out.

    Parameters
    ----------
    mueller
        Shape (..., 4, 4), M00 = 1.
    reflectance
        ``Result.R``, the reflectance under natural light, a number or one for each matrix: M00 of the surface. Without
        it the matrices stay divided, as the schema's ``mueller_over_m00``.

    Raises
    ------
    DataError
        If a matrix has another M00 than 1 (it is not what pyElli gave, and would be multiplied twice), or the
        reflectances are not as many as the matrices.
    """
    matrix = _mueller(mueller)
    m00 = matrix[..., 0, 0]
    if (abs(m00 - 1.0) > 1e-5).any():
        raise DataError(
            "pyElli's Mueller matrices have M00 = 1; these have not, they are in another convention"
        )
    if reflectance is None:
        return matrix
    factor = np.asarray(reflectance, dtype=np.float64)
    if factor.shape not in ((), m00.shape):
        raise DataError(f"there are reflectances of the shape {factor.shape} for matrices of {m00.shape}")
    return matrix * factor[..., None, None]


def from_pyelli_index(index: ArrayLike) -> NDArray[np.complex128]:
    """Index n + iκ of pyElli to n − iκ.

    Parameters
    ----------
    index
        Complex numbers of any shape.

    Raises
    ------
    DataError
        If an imaginary part is negative: pyElli answers for such an index as for n + iκ with its default solver, and
        with the handedness of the light turned round with ``Solver4x4``.
    """
    array = np.asarray(index, dtype=np.complex128)
    if (array.imag < 0.0).any():
        raise DataError(
            "an index of pyElli is n + iκ with κ ≥ 0, one has a negative imaginary part; "
            "its solvers do not agree on such a one: take the complex conjugate there"
        )
    return array.conj()


def from_scatmech_mueller(mueller: ArrayLike) -> NDArray[np.float64]:
    """Mueller matrices of SCATMECH and pySCATMECH in the ``psps`` frame.

    SCATMECH counts Q = I_s − I_p in the right-handed frame (s, p, k). Its V > 0 is the project's: the sign
    of V is not touched, as a comparison of Fresnel reflection off absorbing facets shows.
    """
    return mueller_swap_sp(_mueller(mueller))


def from_scatmech_stokes(stokes: ArrayLike) -> NDArray[np.float64]:
    """Stokes vectors of SCATMECH: see :func:`from_scatmech_mueller`."""
    return stokes_swap_sp(_stokes(stokes))


def from_mitsuba_mueller(mueller: ArrayLike) -> NDArray[np.float64]:
    """Mueller matrices of Mitsuba 3, rotated to frames with x = k×n̂ (s): Q = I_s − I_p, V > 0 right circular."""
    return mueller_flip_v(mueller_swap_sp(_mueller(mueller)))


def from_mitsuba_stokes(stokes: ArrayLike) -> NDArray[np.float64]:
    """Stokes vectors of Mitsuba 3, rotated to the frame with x = k×n̂: see :func:`from_mitsuba_mueller`."""
    return stokes_flip_v(stokes_swap_sp(_stokes(stokes)))


def from_eradiate_mueller(mueller: ArrayLike) -> NDArray[np.float64]:
    """Mueller matrices of Eradiate in meridian planes: Q = I_p − I_s as ours, V > 0 right circular as Mitsuba's.

    Azimuths by :func:`pbrdf.data.conventions.azimuth_forward_pi_to_zero`, ``brf`` is π times our BRDF.

    Not those of its absorbing ``ocean_mishchenko``, ``ocean_grasp`` and ``maignan``, which take n + iκ for n − iκ: M34
    and its like have our sign there already.
    """
    return mueller_flip_v(_mueller(mueller))


def from_eradiate_stokes(stokes: ArrayLike) -> NDArray[np.float64]:
    """Stokes vectors of Eradiate: see :func:`from_eradiate_mueller`."""
    return stokes_flip_v(_stokes(stokes))


#: Conversion of Mueller matrices by the program's name.
PROGRAMS: dict[str, Callable[[ArrayLike], NDArray[np.float64]]] = {
    "eradiate": from_eradiate_mueller,
    "katsu": from_katsu_mueller,
    "mitsuba": from_mitsuba_mueller,
    "polanalyser": from_polanalyser_mueller,
    "pyelli": from_pyelli_mueller,
    "pypolar": from_pypolar_mueller,
    "scatmech": from_scatmech_mueller,
}


def _mueller(values: ArrayLike) -> NDArray[np.float64]:
    return real_array(values, "Mueller matrices", (4, 4))


def _stokes(values: ArrayLike) -> NDArray[np.float64]:
    return real_array(values, "Stokes vectors", (4,))
