"""Ten nodes that move into the wedge of lit and seen facets: the average at rendering speed.

The rules of :mod:`pbrdf.optics.quadrature` take up to 225 nodes where the wedge cuts in, too many for a renderer,
whose packets of rays nearly always hold one such ray. Here one rule serves every ray, without branches. Its nodes
are carried into the wedge by the map that turns a normal variable into a truncated one,
x = Φ⁻¹[Φ(low) + (Φ(high) − Φ(low)) Φ(z)]: the weights stay those of the whole plane, times the share
Φ(high) − Φ(low), and far from the edges the map is the identity.

The rows of the rule run across the slope towards the viewer, so that the local exit angle, on which the light that
leaves depends most, is the same for both nodes of a row: the edge of the seen facets ends the sequence of rows, the
edge of the lit ones ends each row. Φ and its inverse are rational approximations.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import drjit as dr

from pbrdf.optics.powers import polynomial

__all__ = ["Row", "transported_rows"]


class Row(NamedTuple):
    """Facets with the same slope towards the viewer.

    Attributes
    ----------
    u
        That slope in standard deviations, positive where the facets turn away from the viewer.
    nodes
        Slopes across, positive where the facets turn away from the source, and weights.
    """

    u: Any
    nodes: list[tuple[Any, Any]]


#: Gauss-Hermite rule of four points for the rows: point (of either sign) and weight.
_ROWS = (
    (math.sqrt(3.0 - math.sqrt(6.0)), (3.0 + math.sqrt(6.0)) / 12.0),
    (math.sqrt(3.0 + math.sqrt(6.0)), (3.0 - math.sqrt(6.0)) / 12.0),
)
#: The rules within these rows, of three and of two points: the outer rows weigh little.
_ACROSS = (
    ((0.0, 2.0 / 3.0), (math.sqrt(3.0), 1.0 / 6.0), (-math.sqrt(3.0), 1.0 / 6.0)),
    ((1.0, 0.5), (-1.0, 0.5)),
)
#: The rows end where their own end lies this many standard deviations below the mean.
_REACH = 1.5
#: Edges farther out than this, in standard deviations, count as this far: they cut off 3e-5.
_CLEAR = 4.0


def transported_rows(c_r: Any, c_i: Any, cos_d: Any, sin_d: Any) -> Iterator[Row]:
    """Yield the rows of the rule.

    Parameters
    ----------
    c_r, c_i
        Distances of the edges of the seen and of the lit facets from the origin, in standard deviations.
    cos_d, sin_d
        Cosine and sine (≥ 0) of the angle between the outward normals of the two edges.
    """
    # where both edges have a component along the rows' axis, the rows also end with the lit facets
    reach = dr.fma(_REACH, sin_d, c_i) / dr.maximum(dr.abs(cos_d), 1e-4)
    low = _erf(dr.select(cos_d < 0.0, -reach, -_CLEAR))
    high = _erf(dr.select(cos_d > 0.0, dr.minimum(reach, c_r), c_r))
    inverse = dr.rcp(dr.maximum(sin_d, 1e-4))
    for (point, weight), across in zip(_ROWS, _ACROSS, strict=True):
        for z in (point, -point):
            u = _slope(dr.fma(high - low, _phi(z), low))
            end = _erf(dr.fma(-u, cos_d, c_i) * inverse)
            share = (0.25 * weight) * (high - low) * (1.0 + end)
            yield Row(u, [(_slope(dr.fma(1.0 + end, _phi(v), -1.0)), w * share) for v, w in across])


def _phi(z: float) -> float:
    return 0.5 * math.erfc(-z / math.sqrt(2.0))


_ERF_NUMERATOR = (3.19155946, 3.46381983, 7.84547649, 1.09845407)
_ERF_DENOMINATOR = (1.0, 3.7525312, 6.05202037, 4.79576095)


def _erf(x: Any) -> Any:
    """2Φ(x) − 1 = erf(x/√2), ends at ±4; absolute error 1e-6 (minimax)."""
    s = dr.clip(x * (1.0 / _CLEAR), -1.0, 1.0)
    t = s * s
    return s * polynomial(t, _ERF_NUMERATOR) / polynomial(t, _ERF_DENOMINATOR)


_SLOPE_NUMERATOR = (7.719162e-6, 3.675508e-3, 0.16217, 0.8191704, 0.268948)
_SLOPE_DENOMINATOR = (2.041453e-6, 1.226081e-3, 6.983597e-2, 0.520064, 0.4088719)


def _slope(y: Any) -> Any:
    """x with 2Φ(x) − 1 = y; absolute error 9e-5 up to |x| = 3.19 (minimax), ends at ±3.8."""
    s = dr.fma(-y, y, 1.0)
    return y * polynomial(s, _SLOPE_NUMERATOR) / polynomial(s, _SLOPE_DENOMINATOR)
