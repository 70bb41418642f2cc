"""Powers with a real exponent, the costliest operation of the diffuse part.

x^y = 2^(y log₂x), by polynomials: Dr.Jit's exp and log together take two to three times as many vector instructions.
The logarithm of the mantissa m is log₂m = 2/ln2 · artanh[(m − 1)/(m + 1)] in double precision, or a polynomial in
m − 1 in single. Relative errors are 1e-14·|y| + 3e-14 and 1e-6·|y|, besides the rounding of y log₂x.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import drjit as dr

__all__ = ["exp2", "is_single", "log2", "polynomial", "power", "with_slope"]

#: log2(1 + f)/f for |f| ≤ 1/3, absolute error of f times it 3e-7 (minimax).
_LOG2 = (1.44269359, -0.721402698, 0.481066781, -0.357728874, 0.283652863, -0.284250975, 0.257091115)
#: 2^g for |g| ≤ 1/2, relative error 8e-8 (minimax).
_EXP2 = (1.00000007, 0.693146967, 0.240221197, 0.0555071328, 0.00967554154, 0.00132764718)
#: 2/ln2 · artanh(s)/s as a polynomial in s² for m from √½ to √2, absolute error of s times it 1.4e-14.
_ARTANH = (
    2.885390081777851,
    0.9617966941122649,
    0.5770779426603044,
    0.41220922406110433,
    0.31990680380701336,
    0.28288502340748234,
)
#: 2^g for |g| ≤ 1/2, relative error 3e-14, exact for g = 0.
_EXP2_DOUBLE = (
    1.0,
    0.6931471805599453,
    0.2402265069581299,
    0.055504108664760424,
    0.009618129159402558,
    0.0013333558179043112,
    0.00015403455852453838,
    1.525268684626772e-05,
    1.3255224878668817e-06,
    1.0203121063391729e-07,
)


class _Format(NamedTuple):
    """Floating-point numbers: bits of the mantissa, least mantissa of the logarithm, range of exponents, 2^g."""

    mantissa: int
    lowest: int
    least: float
    largest: float
    exp2: tuple[float, ...]


#: The least mantissas are 2/3 and √½.
_SINGLE = _Format(23, 0x3F2AAAAB, -126.0, 127.0, _EXP2)
_DOUBLE = _Format(52, 0x3FE6A09E667F3BCD, -1022.0, 1023.0, _EXP2_DOUBLE)
_LN2 = math.log(2.0)


def power(base: Any, exponent: Any) -> Any:
    """base^exponent for a base > 0."""
    return exp2(exponent * log2(base))


def log2(x: Any) -> Any:
    """log₂x, x > 0."""
    if not dr.is_jit_v(x):
        return dr.log2(x)
    F, Int, own = _format(x)
    bits: Any = dr.reinterpret_array(Int, dr.detach(x))
    octave = (bits - own.lowest) >> own.mantissa
    mantissa: Any = dr.reinterpret_array(F, bits - (octave << own.mantissa))
    f = mantissa - 1.0
    if own is _SINGLE:
        value = dr.fma(f, polynomial(f, _LOG2), F(octave))
    else:
        s = f / (mantissa + 1.0)
        value = dr.fma(s, polynomial(s * s, _ARTANH), F(octave))
    return with_slope(value, x, lambda: dr.rcp(dr.detach(x) * _LN2))


def exp2(x: Any) -> Any:
    """2^x, between the numbers' least and largest power of two."""
    if not dr.is_jit_v(x):
        return dr.exp2(x)
    F, Int, own = _format(x)
    y = dr.detach(x)
    # selects in this order keep NaN, in one instruction each
    y = dr.select(y < own.least, own.least, dr.select(y > own.largest, own.largest, y))
    # adding 1.5·2^(bits of the mantissa) rounds to a whole number, which then stands in the lowest bits
    rounding = 1.5 * 2.0**own.mantissa
    shifted = y + rounding
    whole: Any = dr.reinterpret_array(Int, shifted)
    part: Any = dr.reinterpret_array(Int, polynomial(y - (shifted - rounding), own.exp2))
    value: Any = dr.reinterpret_array(F, part + (whole << own.mantissa))
    return with_slope(value, x, lambda: value * _LN2)


def with_slope(value: Any, x: Any, slope: Callable[[], Any]) -> Any:
    """A value with its derivative by a variable."""
    if not dr.grad_enabled(x):
        return value
    tied: Any = dr.replace_grad  # its stub says that it returns nothing
    return tied(value, dr.fma(slope(), x, value))


def polynomial(x: Any, coefficients: tuple[Any, ...]) -> Any:
    """Σ c_j x^j by Horner's rule."""
    total: Any = coefficients[-1]
    for c in reversed(coefficients[:-1]):
        total = dr.fma(total, x, c)
    return total


def _format(x: Any) -> tuple[Any, Any, _Format]:
    """Type of an array, that of the integers of its bits, and its format."""
    F = type(x)
    return (F, dr.int32_array_t(F), _SINGLE) if is_single(x) else (F, dr.int64_array_t(F), _DOUBLE)


def is_single(x: Any) -> bool:
    """Whether x is an array of float32."""
    return dr.is_jit_v(x) and dr.type_v(x) == dr.VarType.Float32
