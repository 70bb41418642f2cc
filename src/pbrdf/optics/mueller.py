"""What a Mueller matrix says undecomposed: Cloude's coherency matrix and its entropy, the depolarisation index.

Sources: Cloude, Optik 75, 26 (1986): H = ¼ Σ_ij M_ij (σ_i ⊗ σ_j*) with the Pauli matrices in the order of the
Stokes parameters; M is a passive mixture of Jones matrices exactly if H has no negative eigenvalue. Cloude and Pottier,
Opt. Eng. 34, 1599 (1995): the entropy. Gil and Bernabeu, Opt. Acta 33, 185 (1986): the depolarisation index. None of
them needs a decomposition or depends on the sign of V.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from pbrdf.errors import DataError
from pbrdf.optics.stokes import stokes_places

__all__ = ["cloude_entropy", "coherency_eigenvalues", "depolarization_index", "matrices_of", "normalized"]

_PAULI = np.array(
    [
        [[1, 0], [0, 1]],
        [[1, 0], [0, -1]],
        [[0, 1], [1, 0]],
        [[0, -1j], [1j, 0]],
    ]
)
#: An element of so many times M00 is no measurement, and overflows in products.
_BEYOND = 1e30
_BASIS = 0.25 * np.einsum("iab,jcd->ijacbd", _PAULI, _PAULI.conj()).reshape(4, 4, 4, 4)


def coherency_eigenvalues(mueller: Any) -> np.ndarray:
    """Eigenvalues of Cloude's coherency matrix, ascending.

    Parameters
    ----------
    mueller
        As for :func:`depolarization_index`.

    Returns
    -------
    ndarray
        Shape (..., 4), in the unit of M00; their sum is M00. NaN where an element is not finite.

    Raises
    ------
    DataError
        If these are not 4 × 4 matrices.
    """
    matrices, _ = matrices_of(mueller)
    known = np.isfinite(matrices).all(axis=(-2, -1))[..., None]
    H = np.einsum("...ij,ijab->...ab", np.where(known[..., None], matrices, 0.0), _BASIS)
    return np.where(known, np.linalg.eigvalsh(H), np.nan)


def depolarization_index(mueller: Any) -> Any:
    """Depolarisation index of Gil and Bernabeu, √((Σ M_ij² − M00²)/3)/M00.

    Parameters
    ----------
    mueller
        Mueller matrices, shape (..., 4, 4), normalised or not; or an xarray array with the dimensions ``stokes_out``
        and ``stokes_in``, in any order of the dimensions and of the labels I, Q, U, V. What is masked counts as NaN.

    Returns
    -------
    ndarray or xarray.DataArray
        Of the leading dimensions: 1 for a matrix that depolarises nothing, 0 for the ideal depolariser; NaN where M00
        is not above 0 or an element is not finite.

    Raises
    ------
    DataError
        If these are not 4 × 4 matrices.
    """
    matrices, scalar = matrices_of(mueller)
    M, known = normalized(matrices)
    squares = np.square(M).sum(axis=(-2, -1)) - 1.0
    return scalar(np.where(known, np.sqrt(squares / 3.0), np.nan))


def cloude_entropy(mueller: Any) -> Any:
    """Entropy of the eigenvalues of Cloude's coherency matrix, −Σ p_i log₄ p_i with p_i = λ_i/Σλ.

    Parameters
    ----------
    mueller
        As for :func:`depolarization_index`.

    Returns
    -------
    ndarray or xarray.DataArray
        Of the leading dimensions: 0 for one Jones matrix, 1 for the ideal depolariser, NaN as for
        :func:`depolarization_index`. Negative eigenvalues, which noise gives, count as 0.

    Raises
    ------
    DataError
        If these are not 4 × 4 matrices.
    """
    matrices, scalar = matrices_of(mueller)
    M, known = normalized(matrices)
    shares = np.maximum(coherency_eigenvalues(M), 0.0)
    shares /= shares.sum(axis=-1, keepdims=True)
    logarithms = np.log2(np.where(shares > 0.0, shares, 1.0))
    # + 0.0: no -0.0
    return scalar(np.where(known, -0.5 * (shares * logarithms).sum(axis=-1) + 0.0, np.nan))


def matrices_of(mueller: Any) -> tuple[np.ndarray, Callable[..., Any]]:
    """Mueller matrices as a NumPy array (..., 4, 4), and what makes results the kind that was given.

    The callable takes an array of the leading dimensions and the names of dimensions that follow these: none,
    ``stokes_out`` and ``stokes_in``, or ``stokes`` for the three numbers Q, U, V of a direction on the Poincaré sphere.

    Raises
    ------
    DataError
        If these are not 4 × 4 matrices, or an xarray array has not the dimensions of a Mueller matrix.
    """
    dims = getattr(mueller, "dims", None)
    if dims is None:
        matrices = _numbers(mueller)
        if matrices.shape[-2:] != (4, 4):
            raise DataError(f"Mueller matrices have the shape (..., 4, 4), these have {matrices.shape}")
        return matrices, lambda values, *_: values[()]
    import xarray as xr

    own = ("stokes_out", "stokes_in")
    if not isinstance(mueller, xr.DataArray):
        raise DataError('Mueller matrices are one array, of a data set dataset["mueller"]')
    if not {*own} <= {*dims} or mueller.sizes["stokes_out"] != 4 or mueller.sizes["stokes_in"] != 4:
        raise DataError(
            f"Mueller matrices have the dimensions {' and '.join(own)} of the length 4, these have "
            f"{dict(mueller.sizes)}"
        )
    for dim in own:
        # other labels, numbers for instance, are taken in their order
        if dim in mueller.coords and (places := stokes_places(mueller[dim].values.astype(str))) is not None:
            mueller = mueller.isel({dim: places})
    labelled = mueller.transpose(..., *own)
    leading = labelled.isel(dict.fromkeys(own, 0), drop=True)

    def made(values: np.ndarray, *following: str) -> xr.DataArray:
        coords = labelled.coords if following == own else leading.coords
        if following == ("stokes",):
            coords = {**coords, "stokes": list("QUV")}
        return xr.DataArray(values, dims=(*leading.dims, *following), coords=coords)

    return _numbers(labelled.values), made


def _numbers(values: Any) -> np.ndarray:
    """Real numbers, NaN where they are masked; raises DataError where there are others."""
    try:
        # a masked array would lose its mask as a plain one
        found = values if isinstance(values, np.ndarray) else np.asarray(values)
        if not np.iscomplexobj(found):
            return np.ma.filled(found.astype(float, copy=False), np.nan)
    except (TypeError, ValueError) as error:
        raise DataError(f"Mueller matrices are numbers, shape (..., 4, 4): {error}") from error
    raise DataError("Mueller matrices are real numbers, these are complex")


def normalized(matrices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """M/M00, and where that is known: M00 > 0 and all elements finite. The unit matrix stands where it is not."""
    largest = np.abs(matrices).max(axis=(-2, -1))
    known = np.isfinite(largest) & (largest / _BEYOND < matrices[..., 0, 0])
    safe = np.where(known[..., None, None], matrices, np.eye(4))
    return safe / safe[..., :1, :1], known
