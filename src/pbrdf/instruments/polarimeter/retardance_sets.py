"""Retardances for two variable retarders at 0° and 45° before an analyser at 0°.

Every state analyses one point of the Poincaré sphere; the sets below put these points on the corners of a regular body,
which makes the noise of Q, U and V equal and small (Foreman & Goudail, Optical Engineering 58, 082410 (2019)).
"""

from __future__ import annotations

import numpy as np

from pbrdf.errors import DataError

__all__ = ["RETARDANCE_SETS", "retardance_set"]

_MAGIC = float(np.rad2deg(np.arccos(1.0 / np.sqrt(3.0))))
_TETRAHEDRAL = float(np.rad2deg(np.arccos(-1.0 / 3.0)))

#: Named sets: (δ1, δ2) of each state in degrees.
RETARDANCE_SETS: dict[str, tuple[tuple[float, float], ...]] = {
    "tetrahedron": ((135.0, _MAGIC), (315.0, _MAGIC), (45.0, 180.0 - _MAGIC), (225.0, 180.0 - _MAGIC)),
    "tetrahedron_b": ((0.0, 0.0), (0.0, _TETRAHEDRAL), (120.0, _TETRAHEDRAL), (240.0, _TETRAHEDRAL)),
    "six_states": ((0.0, 0.0), (0.0, 180.0), (90.0, 90.0), (270.0, 90.0), (180.0, 90.0), (0.0, 90.0)),
    "three_linear_one_circular": ((0.0, 0.0), (0.0, 180.0), (90.0, 90.0), (180.0, 90.0)),
    "four_linear_one_circular": ((0.0, 0.0), (0.0, 180.0), (90.0, 90.0), (270.0, 90.0), (180.0, 90.0)),
}


def retardance_set(name: str) -> np.ndarray:
    """Retardances of a named set, radians, shape (N, 2).

    Raises
    ------
    DataError
        If there is no set of this name.
    """
    if name not in RETARDANCE_SETS:
        raise DataError(f"no retardance set is called {name!r}; use one of {', '.join(RETARDANCE_SETS)}")
    return np.deg2rad(RETARDANCE_SETS[name])
