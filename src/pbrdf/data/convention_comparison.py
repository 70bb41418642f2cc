"""Mueller matrices of another program beside ours: whether they agree, and whether another convention fits better.

Signs are told by M/M00, scales by M00: a factor cosθ, π or n, or a division by M00, leaves the first alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from pbrdf.data.convert import PROGRAMS
from pbrdf.errors import DataError
from pbrdf.optics.fresnel import mueller_reflection
from pbrdf.wording import joined

__all__ = ["ConventionComparison", "compare_conventions", "flat_reflection", "named_signs"]

#: Differences of M/M00 below this are rounding, in single precision too.
ROUNDING = 1e-5
#: Another convention fits better where it leaves this share of the difference or less.
BETTER = 0.5
#: Signs of Q, U and V by which theirs become ours.
Signs = tuple[int, ...]


@dataclass(frozen=True)
class ConventionComparison:
    """What two sets of matrices say of a convention.

    Attributes
    ----------
    convention
        The stated program.
    difference
        Largest difference of an element of M/M00 after its conversion.
    place
        Where that is: number of the matrix, row, column.
    scale
        Least and greatest of M00 theirs over ours.
    compared, left_out
        Numbers of matrices, and of those that are not numbers or without light (M00 ≤ 0).
    by_signs
        Largest difference by signs of Q, U and V.
    better
        Signs that fit better than the stated ones, those of a program where several fit alike; None where none do.
    alike
        Signs of other programs that these matrices do not tell from the better ones, or else from the stated ones.
    """

    convention: str
    difference: float
    place: tuple[int, int, int]
    scale: tuple[float, float]
    compared: int
    left_out: int
    by_signs: dict[Signs, float]
    better: Signs | None
    alike: tuple[Signs, ...]


def compare_conventions(theirs: ArrayLike, ours: ArrayLike, convention: str) -> ConventionComparison:
    """Convert the matrices of a program and compare them with ours.

    Parameters
    ----------
    theirs
        As the program gave them, shape (..., 4, 4).
    ours
        In our convention, as many in the same order.
    convention
        Name of the program: one of :data:`pbrdf.data.convert.PROGRAMS`.

    Raises
    ------
    DataError
        If the convention is not known, the shapes do not go together, the matrices are not real, or none is left.
    """
    if convention not in PROGRAMS:
        raise DataError(f"no program is called {convention!r}; there are {', '.join(PROGRAMS)}")
    given, expected = _matrices(theirs), _matrices(ours)
    if len(given) != len(expected):
        raise DataError(f"there are {len(given)} matrices to compare with {len(expected)} of ours")
    m00 = given[:, 0, 0], expected[:, 0, 0]
    finite = np.isfinite(given).all((1, 2)) & np.isfinite(expected).all((1, 2))
    kept = np.flatnonzero(finite & (m00[0] > 0.0) & (m00[1] > 0.0))
    if not len(kept):
        raise DataError("no matrix is left to compare: all are NaN or without light (M00 ≤ 0)")
    given, expected = (m[kept] / m[kept][:, :1, :1] for m in (given, expected))
    stated = _signs_of(convention)
    by_signs = {}
    for signs in product((1, -1), repeat=3):
        by_signs[signs] = float(abs(_with(signs, given) - expected).max())
    off = abs(PROGRAMS[convention](given) - expected)
    number, row, column = np.unravel_index(off.argmax(), off.shape)
    known = {_signs_of(name) for name in PROGRAMS}
    least = min(by_signs.values())
    best = min(by_signs, key=lambda signs: (by_signs[signs] > least + ROUNDING, signs not in known))
    found = by_signs[stated] > ROUNDING and by_signs[best] <= BETTER * by_signs[stated]
    chosen = best if found else stated
    ratio = m00[0][kept] / m00[1][kept]
    return ConventionComparison(
        convention=convention,
        difference=float(off.max()),
        place=(int(kept[number]), int(row), int(column)),
        scale=(float(ratio.min()), float(ratio.max())),
        compared=len(kept),
        left_out=len(finite) - len(kept),
        by_signs=by_signs,
        better=best if found else None,
        alike=tuple(
            signs
            for signs in by_signs
            if signs in known - {chosen, stated}
            and abs(_with(signs, given) - _with(chosen, given)).max() <= ROUNDING
        ),
    )


def flat_reflection(theta_i: ArrayLike, n: float, kappa: float = 0.0) -> np.ndarray:
    """Mueller matrices of the reflection off a bare flat surface in air.

    Parameters
    ----------
    theta_i
        Angles of incidence, radians, shape (N,).
    n, kappa
        Index n − iκ.

    Returns
    -------
    ndarray
        Reflectances, shape (N, 4, 4).

    Raises
    ------
    DataError
        If n is not above 0, or κ is negative.
    """
    if not (n > 0.0 and kappa >= 0.0):
        raise DataError(f"the index n − iκ needs n > 0 and κ ≥ 0, not n = {n:g} and κ = {kappa:g}")
    angles = np.asarray(theta_i, dtype=float)
    matrices = np.zeros((len(angles), 4, 4))
    for matrix, angle in zip(matrices, angles, strict=True):
        r = mueller_reflection(float(np.cos(angle)), n, kappa)
        matrix[0, 0] = matrix[1, 1] = r.mean
        matrix[0, 1] = matrix[1, 0] = r.difference
        matrix[2, 2] = matrix[3, 3] = r.real
        matrix[3, 2], matrix[2, 3] = r.imaginary, -r.imaginary
    return matrices


def named_signs(signs: Signs) -> str:
    """The programs that count so, else which of Q, U and V are reversed."""
    programs = [name for name in PROGRAMS if _signs_of(name) == signs]
    reversed_ = [name for name, sign in zip("QUV", signs, strict=True) if sign < 0]
    words = f"{joined(reversed_, 'and')} reversed" if reversed_ else "nothing reversed"
    return f"{joined(programs, 'and')} ({words})" if programs else words


def _signs_of(program: str) -> Signs:
    return tuple(int(sign) for sign in PROGRAMS[program](np.ones((4, 4)))[0, 1:])


def _with(signs: Signs, matrices: np.ndarray) -> np.ndarray:
    diagonal = np.array([1, *signs])
    return np.asarray(diagonal[:, None] * matrices * diagonal)


def _matrices(values: ArrayLike) -> np.ndarray:
    array = np.asarray(values)
    if array.shape[-2:] != (4, 4) or array.dtype.kind not in "fiu":
        raise DataError(
            f"Mueller matrices are real numbers of the shape (..., 4, 4); these are {array.dtype} of {array.shape}"
        )
    return array.reshape(-1, 4, 4).astype(np.float64)
