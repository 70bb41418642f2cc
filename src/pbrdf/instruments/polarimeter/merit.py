"""Figures of merit of a polarimeter: how it passes the noise of its intensities on to the Stokes parameters.

Condition numbers are only comparable in the same norm, so the norm is always named: an optimal set of four states has
√3 in the 2-norm and √20 in the Frobenius norm, and something that changes with the orientation of the axes in the
∞-norm, which some programs report. Sources: Tyo, Applied Optics 41, 619 (2002); Foreman & Goudail, Optical Engineering
58, 082410 (2019).

An instrument that does not measure a component (V behind linear polarisers) is judged on what it does measure: its
pseudo-inverse and its singular values other than 0. Such numbers are not comparable with those of a full one; `rank`
and `determined` tell them apart.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from pbrdf.errors import DataError
from pbrdf.instruments.polarimeter.polarimeter import Polarimeter
from pbrdf.instruments.polarimeter.stokes_solution import RANK_TOLERANCE, determined_components, row_space
from pbrdf.optics.stokes import STOKES

__all__ = [
    "Merit",
    "Norm",
    "component_variance",
    "condition_number",
    "equally_weighted_variance",
    "gram_determinant",
    "merit",
]

Norm = Literal["2", "frobenius", "infinity"]

_ORDERS: dict[str, Any] = {"2": 2, "frobenius": "fro", "infinity": np.inf}


@dataclass(frozen=True)
class Merit:
    """Figures of merit; floats, or arrays over the cells of a map.

    Attributes
    ----------
    condition
        Condition number ‖W‖‖W⁺‖ by norm: ``"2"``, ``"frobenius"``, ``"infinity"``.
    equally_weighted_variance
        tr(WᵀW)⁻¹: sum of the variances of the Stokes parameters for intensities of variance 1.
    determinant
        √det WᵀW, for four states |det W|.
    variance
        Variances of I, Q, U, V for intensities of variance 1, shape (4,) or (rows, columns, 4); NaN if not determined.
    rank
        Dimension of what is measured: 4 for a full-Stokes instrument.
    determined
        The components that are.
    """

    condition: dict[str, np.ndarray]
    equally_weighted_variance: np.ndarray
    determinant: np.ndarray
    variance: np.ndarray
    rank: int
    determined: tuple[str, ...]

    @property
    def note(self) -> str:
        """A sentence about what the figures refer to; empty for a full-Stokes instrument."""
        if self.rank == 4:
            return ""
        what = ", ".join(self.determined) or "no component by itself"
        return f"figures of merit of the {self.rank}-dimensional part that is measured ({what})"


def condition_number(analyzer: ArrayLike, norm: Norm) -> np.ndarray:
    """Condition number ‖W‖‖W⁺‖ of analyser vectors (..., N, 4), shape (...).

    Parameters
    ----------
    norm
        ``"2"``: ratio of the largest to the smallest singular value (√3 at best); ``"frobenius"``: root of the sum of
        squares (√20 at best for perfect analysers); ``"infinity"``: largest sum of a row, not the same in turned axes.

    Raises
    ------
    DataError
        If the norm has another name.
    """
    if norm not in _ORDERS:
        raise DataError(f"no norm is called {norm!r}; use one of {', '.join(_ORDERS)}")
    W = np.asarray(analyzer, dtype=float)
    order = _ORDERS[norm]
    values: np.ndarray = np.linalg.norm(W, order, axis=(-2, -1)) * np.linalg.norm(
        _inverse(W), order, axis=(-2, -1)
    )
    return values


def equally_weighted_variance(analyzer: ArrayLike) -> np.ndarray:
    """tr(WᵀW)⁻¹ of analyser vectors (..., N, 4), shape (...); 40/N at best."""
    values: np.ndarray = (_inverse(np.asarray(analyzer, dtype=float)) ** 2).sum(axis=(-2, -1))
    return values


def gram_determinant(analyzer: ArrayLike) -> np.ndarray:
    """√det WᵀW of analyser vectors (..., N, 4), shape (...); for four perfect analysers 1/(3√3) at best."""
    singular = np.linalg.svd(np.asarray(analyzer, dtype=float), compute_uv=False)
    values: np.ndarray = np.where(singular > RANK_TOLERANCE * singular[..., :1], singular, 1.0).prod(axis=-1)
    return values


def component_variance(analyzer: ArrayLike) -> np.ndarray:
    """Variances of I, Q, U, V for intensities of variance 1, shape (..., 4); NaN where not determined."""
    W = np.asarray(analyzer, dtype=float)
    return np.where(determined_components(row_space(W)), (_inverse(W) ** 2).sum(axis=-1), np.nan)


def merit(polarimeter: Polarimeter) -> Merit:
    """All figures of merit of a polarimeter, of each cell if it is a map.

    Raises
    ------
    DataError
        If the cells of a map do not all measure the same.
    """
    W = polarimeter.analyzer
    projector = row_space(W)
    ranks = np.rint(np.einsum("...ii->...", projector)).astype(int)
    known = determined_components(projector).reshape(-1, 4)
    if ranks.min() != ranks.max() or (known != known[0]).any():
        raise DataError(
            f"{polarimeter.name} does not measure the same components all over its field of view: judge parts of the "
            "map"
        )
    return Merit(
        condition={norm: condition_number(W, norm) for norm in ("2", "frobenius", "infinity")},
        equally_weighted_variance=equally_weighted_variance(W),
        determinant=gram_determinant(W),
        variance=component_variance(W),
        rank=int(ranks.flat[0]),
        determined=tuple(name for name, good in zip(STOKES, known[0], strict=True) if good),
    )


def _inverse(W: np.ndarray) -> np.ndarray:
    return np.linalg.pinv(W, rcond=RANK_TOLERANCE)
