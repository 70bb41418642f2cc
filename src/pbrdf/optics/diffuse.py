"""Angular shapes of bodies: the Rahman-Pinty-Verstraete function and the modified one, paper eqs (9)-(10).

The MRPV function (Martonchik et al. 1998; Engelsen et al. 1996) stands here without hot spot, divided by π; the paper
cites Rahman, Pinty and Verstraete, J. Geophys. Res. 98, 20791 (1993), whose own function is :func:`rpv`. That one is
written as VLIDORT, GRASP and the i3rc code have it, with the phase angle g = π − ω and their azimuth (0 in backscatter)
turned into ours (0 forward): cos g = −cosω, and the sign of the last term under the root of G is plus.
"""

from __future__ import annotations

import math
from typing import Any

import drjit as dr

from pbrdf.optics.geometry import Geometry
from pbrdf.optics.powers import exp2, log2, power

__all__ = ["henyey_greenstein", "hot_spot", "minnaert_shape", "mrpv", "rpv"]


def minnaert_shape(cos_i: Any, cos_r: Any, k: Any, scale: Any | None = None) -> Any:
    """W = [c (μ_r + μ_i) μ_r μ_i]^(k−1); the cosines must be positive.

    The factor c, ``scale``, is 1 unless given: where only ratios of W are wanted, it keeps W within the range of
    floating-point numbers; products that it brings beyond 1e5 count as 1e5.
    """
    product = (cos_r + cos_i) * cos_r * cos_i
    if scale is not None:
        product = product * scale
        product = dr.select(product > 1e5, 1e5, product)
    return power(product, k - 1.0)


def mrpv(cos_i: Any, cos_r: Any, cos_scattering: Any, a: Any, k: Any, b: Any) -> Any:
    """f_rpv = (a/π) [(μ_r + μ_i) μ_r μ_i]^(k−1) exp(b cosω) in 1/sr, paper eq. (9)."""
    exponent = dr.fma(
        k - 1.0, log2((cos_r + cos_i) * cos_r * cos_i), b * cos_scattering * (1.0 / math.log(2.0))
    )
    return a * (1.0 / math.pi) * exp2(exponent)


def henyey_greenstein(cos_scattering: Any, asymmetry: Any) -> Any:
    """F = (1 − Θ²)/(1 − 2Θ cosω + Θ²)^{3/2}, 1 for Θ = 0; Θ < 0 scatters backwards, |Θ| < 1."""
    base = 1.0 + asymmetry * (asymmetry - 2.0 * cos_scattering)
    return (1.0 - asymmetry * asymmetry) / (base * dr.sqrt(base))


def hot_spot(geometry: Geometry, rho_c: Any) -> Any:
    """1 + R = 1 + (1 − ρ_c)/(1 + G), G = √(tan²θ_i + tan²θ_r + 2 tanθ_i tanθ_r cosφ); 2 − ρ_c in exact backscatter."""
    i, r = geometry.omega_i, geometry.omega_r
    # G is the distance between the points where the two rays pierce the plane z = 1
    x, y = i[0] / i[2] - r[0] / r[2], i[1] / i[2] - r[1] / r[2]
    distance = dr.sqrt(dr.maximum(dr.fma(x, x, y * y), 1e-30))
    return 1.0 + (1.0 - rho_c) / (1.0 + distance)


def rpv(geometry: Geometry, rho_0: Any, k: Any, asymmetry: Any, rho_c: Any) -> Any:
    """f = (ρ_0/π) [μ_i μ_r (μ_i + μ_r)]^(k−1) F(ω) (1 + R) in 1/sr.

    Parameters
    ----------
    geometry
        Both rays above the horizon.
    rho_0, k, asymmetry, rho_c
        Amplitude, exponent, Henyey-Greenstein asymmetry Θ and hot-spot parameter; ρ_c = 1 is no hot spot.
    """
    shape = minnaert_shape(geometry.cos_i, geometry.cos_r, k)
    scattered = henyey_greenstein(geometry.cos_scattering, asymmetry)
    return rho_0 * (1.0 / math.pi) * shape * scattered * hot_spot(geometry, rho_c)
