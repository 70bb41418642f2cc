"""Angular shape of the diffuse part: the modified Rahman-Pinty-Verstraete function, paper eqs (9)-(10).

This is the MRPV function (Martonchik et al. 1998; Engelsen et al. 1996) without hot spot, divided by π;
the paper cites Rahman, Pinty and Verstraete, J. Geophys. Res. 98, 20791 (1993).
"""

from __future__ import annotations

import math
from typing import Any

import drjit as dr

from pbrdf.optics.powers import power

__all__ = ["minnaert_shape", "mrpv"]


def minnaert_shape(cos_i: Any, cos_r: Any, k: Any) -> Any:
    """W = [(μ_r + μ_i) μ_r μ_i]^(k−1); the cosines must be positive."""
    return power((cos_r + cos_i) * cos_r * cos_i, k - 1.0)


def mrpv(cos_i: Any, cos_r: Any, cos_scattering: Any, a: Any, k: Any, b: Any) -> Any:
    """f_rpv = (a/π) [(μ_r + μ_i) μ_r μ_i]^(k−1) exp(b cosω) in 1/sr, paper eq. (9)."""
    return a * (1.0 / math.pi) * minnaert_shape(cos_i, cos_r, k) * dr.exp(b * cos_scattering)
