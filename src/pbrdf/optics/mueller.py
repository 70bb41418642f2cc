"""Physical realisability of Mueller matrices: Cloude's coherency matrix.

Source: Cloude, Optik 75, 26 (1986): H = ¼ Σ_ij M_ij (σ_i ⊗ σ_j*) with the Pauli matrices in the order of the
Stokes parameters; M is a passive mixture of Jones matrices exactly if H has no negative eigenvalue.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

__all__ = ["coherency_eigenvalues"]

_PAULI = np.array(
    [
        [[1, 0], [0, 1]],
        [[1, 0], [0, -1]],
        [[0, 1], [1, 0]],
        [[0, -1j], [1j, 0]],
    ]
)
_BASIS = 0.25 * np.einsum("iab,jcd->ijacbd", _PAULI, _PAULI.conj()).reshape(4, 4, 4, 4)


def coherency_eigenvalues(mueller: ArrayLike) -> np.ndarray:
    """Eigenvalues of Cloude's coherency matrix, ascending.

    Parameters
    ----------
    mueller
        Mueller matrices, shape (..., 4, 4).

    Returns
    -------
    ndarray
        Shape (..., 4), in the unit of M00; their sum is M00.
    """
    H = np.einsum("...ij,ijab->...ab", np.asarray(mueller, dtype=float), _BASIS)
    return np.linalg.eigvalsh(H)
