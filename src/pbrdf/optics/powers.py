"""Powers with a real exponent, the costliest operation of the diffuse part.

In double precision and under differentiation x^y = exp(y log x). In single precision Dr.Jit's exp and log take about
seventy vector instructions together; the polynomials here take thirty, with a relative error of about 1e-6·|y|.
"""

from __future__ import annotations

from typing import Any

import drjit as dr

__all__ = ["is_single", "log2", "polynomial", "power"]

#: log2(1 + f)/f for |f| ≤ 1/3, absolute error of f times it 3e-7 (minimax).
_LOG2 = (1.44269359, -0.721402698, 0.481066781, -0.357728874, 0.283652863, -0.284250975, 0.257091115)
#: 2^g for |g| ≤ 1/2, relative error 8e-8 (minimax).
_EXP2 = (1.00000007, 0.693146967, 0.240221197, 0.0555071328, 0.00967554154, 0.00132764718)
#: Bits of the float32 number 2/3, and of its mantissa.
_TWO_THIRDS, _MANTISSA = 0x3F2AAAAB, 23
_ROUNDING = 1.5 * 2.0**23


def power(base: Any, exponent: Any) -> Any:
    """base^exponent for a base > 0; in single precision within 2^−126 … 2^127."""
    if not is_single(base) or dr.grad_enabled(base) or dr.grad_enabled(exponent):
        return dr.exp(exponent * dr.log(base))
    F, Int = type(base), dr.int32_array_t(type(base))
    y: Any = dr.clip(exponent * log2(base), -126.0, 127.0)
    # adding 1.5·2²³ rounds to a whole number, which then stands in the lowest bits
    shifted = y + _ROUNDING
    whole: Any = dr.reinterpret_array(Int, shifted)
    scale: Any = dr.reinterpret_array(F, (whole + 127) << _MANTISSA)
    return polynomial(y - (shifted - _ROUNDING), _EXP2) * scale


def log2(x: Any) -> Any:
    """Logarithm to base 2 of x > 0; in single precision with an absolute error of 3e-7."""
    if not is_single(x) or dr.grad_enabled(x):
        return dr.log2(x)
    F, Int = type(x), dr.int32_array_t(type(x))
    bits: Any = dr.reinterpret_array(Int, x)
    octave = (bits - _TWO_THIRDS) >> _MANTISSA
    mantissa: Any = dr.reinterpret_array(F, bits - (octave << _MANTISSA))
    f = mantissa - 1.0
    return dr.fma(f, polynomial(f, _LOG2), F(octave))


def polynomial(x: Any, coefficients: tuple[Any, ...]) -> Any:
    """Σ c_j x^j by Horner's rule."""
    total: Any = coefficients[-1]
    for c in reversed(coefficients[:-1]):
        total = dr.fma(total, x, c)
    return total


def is_single(x: Any) -> bool:
    """Whether x is an array of float32."""
    return dr.is_jit_v(x) and dr.type_v(x) == dr.VarType.Float32
