"""The covariance of the Stokes components in a data set: completed, judged, turned into correlations.

Arrays have the shape (N, 4, 4), rows and columns in the order I, Q, U, V. What the entries mean, NaN among them,
stands in :mod:`pbrdf.data.schema`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from pbrdf.data.schema import COVARIANCE, std_name
from pbrdf.errors import DataError
from pbrdf.optics.stokes import STOKES

__all__ = ["complete_covariance", "correlations", "covariance_problems", "derived_variance", "square"]

#: Variance and squared standard uncertainty agree if they differ by no more than this part.
AGREEMENT = 1e-6
#: Entries (i, j) and (j, i) that differ by no more than this part of the standard uncertainties are rounding.
SYMMETRY = 1e-9
#: Eigenvalues of the correlation matrix down to minus this count as 0.
INDEFINITE = 1e-9


def complete_covariance(
    covariance: ArrayLike, rows: int, std: Mapping[str, ArrayLike], channels: Collection[str]
) -> tuple[NDArray[np.float64], dict[str, ArrayLike]]:
    """Fill the standard uncertainties that nobody stated from the diagonal, and even out rounding.

    Parameters
    ----------
    covariance
        Shape (N, 4, 4), or (4, 4) for all rows.
    rows
        Their number N.
    std
        The standard uncertainties that were stated, by the name of their variable; these stay as they are.
    channels
        Names of the data variables.

    Returns
    -------
    covariance, std
        The covariance, symmetric to the last bit where it was to 1e-9, its diagonal the exact square of the
        uncertainties that were filled in; and all uncertainties.

    Raises
    ------
    DataError
        If the array has another shape.
    """
    try:
        matrix = np.array(covariance, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise DataError(f"covariance does not hold real numbers: {error}") from error
    if matrix.shape not in ((4, 4), (1, 4, 4), (rows, 4, 4)):
        raise DataError(
            f"covariance has the shape {matrix.shape}, but {(rows, 4, 4)} is needed here, in the order "
            f"{', '.join(STOKES)}"
        )
    matrix = np.broadcast_to(matrix, (rows, 4, 4))
    filled = dict(std)
    with np.errstate(invalid="ignore", over="ignore"):
        scale = np.sqrt(np.diagonal(matrix, axis1=1, axis2=2))
        turned = matrix.transpose(0, 2, 1)
        near = np.abs(matrix - turned) <= SYMMETRY * scale[:, :, None] * scale[:, None, :]
        matrix = np.where(near & (matrix != turned), 0.5 * matrix + 0.5 * turned, matrix)
    for i, name in enumerate(STOKES):
        variance = matrix[:, i, i]
        if name in channels and name not in std and np.isfinite(variance).any():
            known = variance > 0.0
            filled[name] = np.where(known, scale[:, i], np.nan)
            matrix[:, i, i] = np.where(known, square(scale[:, i]), variance)
    return matrix, filled


def derived_variance(ds: xr.Dataset, name: str) -> NDArray[np.float64]:
    """Square of the standard uncertainty of I, Q, U or V, shape (N,); NaN where it is not known."""
    if std_name(name) not in ds.data_vars:
        return np.full(ds.sizes["geometry"], np.nan)
    return square(ds[std_name(name)].values)


def correlations(covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Correlation matrices, shape (N, 4, 4): 1 on the diagonal, 0 where a covariance is not known."""
    with np.errstate(all="ignore"):
        scale = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        found = covariance / scale[:, :, None] / scale[:, None, :]
    found = np.where(np.isfinite(found), found, 0.0)
    found[:, range(4), range(4)] = 1.0
    return found


def covariance_problems(ds: xr.Dataset) -> Iterator[tuple[str, NDArray[np.intp]]]:
    """What is wrong with the covariance of a data set, in words about the first of the rows; and the rows.

    A row is named once, with the first thing that is wrong there.
    """
    matrix = ds[COVARIANCE].values
    finite = np.isfinite(matrix)
    variance = np.diagonal(matrix, axis1=1, axis2=2)
    left = ~np.isinf(matrix).any(axis=(1, 2))  # what is infinite is found for every variable alike

    def rows(bad: NDArray[np.bool_]) -> NDArray[np.intp]:
        """Rows with something bad, bad having the shape (N, ...), which are then done with."""
        found = bad.reshape(len(bad), -1).any(axis=1) & left
        left[found] = False
        return np.flatnonzero(found)

    turned = matrix.transpose(0, 2, 1)
    uneven = (matrix != turned) & ~(np.isnan(matrix) & np.isnan(turned))
    if (bad := rows(uneven)).size:
        i, j = np.argwhere(uneven[bad[0]])[0]
        a, b = matrix[bad[0], i, j], matrix[bad[0], j, i]
        yield f"({_pair(i, j)}) is {a:.6g} but ({_pair(j, i)}) is {b:.6g}; a covariance is symmetric", bad
    for i, name in enumerate(STOKES):
        if name not in ds.data_vars and (bad := rows(finite[:, i])).size:
            yield f"there is a covariance of {name} but no {name}; put NaN there", bad
    for i, name in enumerate(STOKES):
        if (bad := rows(variance[:, i] <= 0.0)).size:
            value = variance[bad[0], i]
            yield f"the variance of {name} must be positive, not {value:.6g}; use NaN if it is not known", bad
    lone = finite & ~(np.isfinite(variance)[:, :, None] & np.isfinite(variance)[:, None, :])
    if (bad := rows(lone)).size:
        i, j = np.argwhere(lone[bad[0]])[0]
        without = STOKES[i if np.isnan(variance[bad[0], i]) else j]
        yield f"there is a covariance ({_pair(i, j)}) but no variance of {without}", bad
    for i, name in enumerate(STOKES):
        stated = derived_variance(ds, name)
        with np.errstate(invalid="ignore"):
            agree = np.abs(variance[:, i] - stated) <= AGREEMENT * stated
        if (bad := rows(finite[:, i, i] & ~agree)).size:
            std = np.sqrt(stated[bad[0]])
            said = f"{std_name(name)} is {std:.6g}" if np.isfinite(std) else f"{std_name(name)} is not stated"
            yield (
                f"the variance of {name} is {variance[bad[0], i]:.6g}, that is {np.sqrt(variance[bad[0], i]):.6g}², "
                f"but {said}; the diagonal is the square of the standard uncertainties",
                bad,
            )
    correlation = np.where(left[:, None, None], correlations(matrix), np.eye(4))
    lowest = np.linalg.eigvalsh(correlation)[:, 0]
    if (bad := rows(lowest < -INDEFINITE)).size:
        off = np.abs(np.triu(correlation[bad[0]], 1))
        i, j = np.unravel_index(off.argmax(), off.shape)
        yield (
            f"no covariance: it is not positive semidefinite (the largest correlation, ({_pair(i, j)}), is "
            f"{correlation[bad[0], i, j]:.6g}; what is NaN counts as 0)",
            bad,
        )


def square(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Variances of standard uncertainties; everywhere the same product, so that the bits agree."""
    with np.errstate(over="ignore", under="ignore"):
        return values * values


def _pair(i: int | np.integer, j: int | np.integer) -> str:
    return f"{STOKES[int(i)]}, {STOKES[int(j)]}"
