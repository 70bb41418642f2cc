"""Mueller matrices of another program beside ours: whether they agree, and whether another convention fits better.

Signs are told by M/M00, scales by M00: a factor cosθ, π or n, or a division by M00, leaves the first alone.

Of two conventions one fits better if the elements whose signs differ between them leave half the squares of the
differences or less: noise of other elements, or of one dark matrix, decides nothing. Where neither does, the matrices
do not tell the two apart.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pbrdf.data.conventions import real_array
from pbrdf.data.convert import PROGRAMS
from pbrdf.errors import DataError
from pbrdf.optics.fresnel import mueller_reflection
from pbrdf.wording import joined

__all__ = ["ConventionComparison", "compare_conventions", "flat_reflection", "named_signs"]

#: Differences of M/M00 below this are rounding, in single precision too.
ROUNDING = 1e-5
#: Another convention fits better where it leaves this share of the squares of the differences or less.
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
    ratio
        M00 theirs over ours, shape (N,); NaN for what is left out.
    divided
        Whether M00 of theirs is 1 throughout and that of ours is not.
    compared, left_out
        Numbers of matrices, and of those that are not numbers or without light (M00 ≤ 0).
    by_signs
        Largest difference by signs of Q, U and V.
    better
        Signs that fit better than the stated ones, those of a program where several fit alike; None where none do.
    alike
        Signs of other programs that these matrices do not tell from the better ones, or else from the stated ones.
    exchanged
        Signs and largest difference of theirs with rows and columns exchanged, where that fits better: with the stated
        signs as well as the better ones do, with others better than these; else None.
    residual
        Root mean square of the differences with the better convention, or else the stated one.
    """

    convention: str
    difference: float
    place: tuple[int, int, int]
    ratio: NDArray[np.float64]
    divided: bool
    compared: int
    left_out: int
    by_signs: dict[Signs, float]
    better: Signs | None
    alike: tuple[Signs, ...]
    exchanged: tuple[Signs, float] | None
    residual: float

    @property
    def signs(self) -> Signs:
        """The better signs, or else the stated ones."""
        return _signs_of(self.convention) if self.better is None else self.better

    def fits_better_than(self, other: ConventionComparison) -> bool:
        """Whether the signs' differences or the scatter of M00 are less than the other's, and neither is more.

        For the same matrices beside others of ours, as those of azimuths half a turn further.
        """

        def less(one: tuple[float, float], two: tuple[float, float]) -> list[bool]:
            return [b > ROUNDING and a**2 <= BETTER * b**2 for a, b in zip(one, two, strict=True)]

        mine, its = ((c.residual, c._scatter) for c in (self, other))
        return any(less(mine, its)) and not any(less(its, mine))

    @property
    def _scatter(self) -> float:
        return 0.0 if self.divided else float(np.nanstd(self.ratio) / np.nanmean(self.ratio))


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
        raise DataError(
            f"there are {len(given)} matrices to compare with {len(expected)} of ours (theirs of the shape "
            f"{np.shape(theirs)}, ours {np.shape(ours)})"
        )
    m00 = given[:, 0, 0], expected[:, 0, 0]
    finite = np.isfinite(given).all((1, 2)) & np.isfinite(expected).all((1, 2))
    kept = np.flatnonzero(finite & (m00[0] > 0.0) & (m00[1] > 0.0))
    if not len(kept):
        raise DataError("no matrix is left to compare: all are NaN or without light (M00 ≤ 0)")
    given, expected = (m[kept] / m[kept][:, :1, :1] for m in (given, expected))
    off = abs(PROGRAMS[convention](given) - expected)
    number, row, column = np.unravel_index(off.argmax(), off.shape)
    stated = _signs_of(convention)
    fits = _Fits(given, expected)
    found = fits.best(stated)
    exchanged = _exchanged(_Fits(given.swapaxes(1, 2), expected), fits, stated, found or stated)
    if found and exchanged and _clearly(exchanged, fits, found):
        found = None
    chosen = found or stated
    ratio = np.full(len(finite), np.nan)
    ratio[kept] = m00[0][kept] / m00[1][kept]
    return ConventionComparison(
        convention=convention,
        difference=float(off.max()),
        place=(int(kept[number]), int(row), int(column)),
        ratio=ratio,
        divided=bool((abs(m00[0][kept] - 1) <= ROUNDING).all() and (abs(m00[1][kept] - 1) > ROUNDING).any()),
        compared=len(kept),
        left_out=len(finite) - len(kept),
        by_signs={signs: fits.largest(signs) for signs in _ALL},
        better=found,
        alike=tuple(
            signs for signs in _ALL if signs in _KNOWN - {chosen, stated} and not fits.tells(chosen, signs)
        ),
        exchanged=None if exchanged is None else (exchanged.signs, exchanged.difference),
        residual=float(np.sqrt(fits.squares(chosen) / (15 * len(kept)))),
    )


class _Fits:
    """How well theirs fit with each choice of signs: every element is either as theirs or reversed."""

    def __init__(self, given: np.ndarray, expected: np.ndarray) -> None:
        differences = {sign: abs(sign * given - expected) for sign in (1, -1)}
        self._squares = {sign: (off**2).sum(0) for sign, off in differences.items()}
        self._largest = {sign: off.max(0) for sign, off in differences.items()}

    def squares(self, signs: Signs, where: np.ndarray | bool = True) -> float:
        """Sum of the squares of the differences over some elements."""
        squares = np.where(_factors(signs) > 0, self._squares[1], self._squares[-1])
        return float(squares.sum(where=where))

    def largest(self, signs: Signs, where: np.ndarray | bool = True) -> float:
        """Largest difference over some elements."""
        off = np.where(_factors(signs) > 0, self._largest[1], self._largest[-1])
        return float(off.max(where=where, initial=0.0))

    def tells(self, right: Signs, wrong: Signs) -> bool:
        """Whether the first fit better than the second."""
        where = _factors(right) != _factors(wrong)
        if self.largest(wrong, where) <= ROUNDING:
            return False
        return self.squares(right, where) <= BETTER * self.squares(wrong, where)

    def best(self, stated: Signs) -> Signs | None:
        """Signs that fit better than the stated ones; of several alike those of a program."""
        least = min(_ALL, key=self.squares)
        alike = [signs for signs in _ALL if not self.tells(least, signs)]
        best = min(alike, key=lambda signs: (signs not in _KNOWN, self.squares(signs)))
        return best if self.tells(best, stated) else None


class _Exchanged(NamedTuple):
    signs: Signs
    difference: float
    squares: float


def _exchanged(turned: _Fits, fits: _Fits, stated: Signs, chosen: Signs) -> _Exchanged | None:
    best = turned.best(stated) or stated
    found = _Exchanged(best, turned.largest(best), turned.squares(best))
    if not _clearly(found, fits, stated):
        return None
    if best == stated:
        # Of a flat surface rows and columns exchanged are another convention: either may be the cause.
        as_good = found.difference <= ROUNDING or BETTER * found.squares <= fits.squares(chosen)
    else:
        as_good = _clearly(found, fits, chosen)
    return found if as_good else None


def _clearly(exchanged: _Exchanged, fits: _Fits, signs: Signs) -> bool:
    """Whether theirs with rows and columns exchanged fit better than as they are."""
    return fits.largest(signs) > ROUNDING and exchanged.squares <= BETTER * fits.squares(signs)


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
    """The programs that count so, and which of Q, U and V are reversed.

    Signs of no program are those of one with the azimuth counted the other way, which reverses U and V.
    """
    reversed_ = [name for name, sign in zip("QUV", signs, strict=True) if sign < 0]
    words = f"{joined(reversed_, 'and')} reversed" if reversed_ else "nothing reversed"
    if signs not in _KNOWN:
        signs, words = (signs[0], -signs[1], -signs[2]), f"φ counted the other way; {words}"
    return f"{joined([name for name in PROGRAMS if _signs_of(name) == signs], 'and')} ({words})"


def _signs_of(program: str) -> Signs:
    return tuple(int(sign) for sign in PROGRAMS[program](np.ones((4, 4)))[0, 1:])


def _factors(signs: Signs) -> np.ndarray:
    return np.outer((1, *signs), (1, *signs))


def _matrices(values: ArrayLike) -> np.ndarray:
    return real_array(values, "Mueller matrices", (4, 4)).reshape(-1, 4, 4)


#: Every choice of signs, and those of programs.
_ALL: tuple[Signs, ...] = tuple(product((1, -1), repeat=3))
_KNOWN = {_signs_of(name) for name in PROGRAMS}
