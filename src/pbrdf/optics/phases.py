"""Phases of many turns: formed and reduced in double precision, whatever the precision of the kernel.

In float32 the product of an order and a cosine keeps 7 digits in all, and Dr.Jit's sine is made for arguments below
8192: that of 1.5.0 is off by 0.03 at 1e6 rad and leaves −1 … 1 at 3e7 (in float64 at 3e9). Casts pass derivatives on,
and a rounded number has none.
"""

from __future__ import annotations

import math
from typing import Any

import drjit as dr

__all__ = ["cos_of_turns", "in_double", "less_whole_turns"]


def in_double(x: Any) -> Any:
    """The same number as a float64: an array of them where x is one."""
    Double: Any = dr.float64_array_t(type(x))
    return Double(x)


def cos_of_turns(turns: Any) -> Any:
    """cos 2πx of turns x in float64, to 4e-16 and the last digit of x."""
    return dr.cos(2.0 * math.pi * (turns - dr.round(turns)))


def less_whole_turns(angle: Any) -> Any:
    """An angle in radians less whole turns, within [−π, π], in the precision that it came in."""
    wide = in_double(angle)
    # of an angle beyond all digits nothing is left but that it is one
    return type(angle)(dr.clip(wide - 2.0 * math.pi * dr.round(wide * (0.5 / math.pi)), -math.pi, math.pi))
