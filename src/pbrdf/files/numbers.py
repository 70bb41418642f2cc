"""Decimal numbers in text: what is one, and a column of them at once.

A number is ``-1.5``, ``.5``, ``5.``, ``1e-3`` or Fortran's ``1.0D-3``, ASCII digits only, or ``nan`` or ``inf`` with
or without sign; ``1_0``, ``0x1F``, ``True``, ``1,234.5`` and digits of other scripts are none. The Unicode minus sign
is understood.

Columns are parsed on arrays of bytes: the characters that are no digits show the parts of each number, eight digits
at a time become an integer (the multiplications that join neighbouring digits are those of D. Lemire, "Quickly parsing
eight digits", 2018). With M < 2⁵³ and a power of ten to 10²² one division rounds correctly (W. D. Clinger, "How to read
floating point numbers accurately", PLDI 1990); beyond that the division is done with a remainder (T. J. Dekker, Numer.
Math. 18, 224 (1971)), and the few results that lie too near to the middle between two numbers are left to
:class:`float`. So every number is the one that ``float`` gives, bit for bit.
"""

from __future__ import annotations

import math
import os
import re
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

__all__ = ["parse_cells", "to_number"]

#: No number that is meant is longer.
_LONGEST = 400
_NUMBER = re.compile(r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eEdD][-+]?[0-9]+)?")
_COMMA = re.compile(r"[-+]?(?:[0-9]+(?:,[0-9]*)?|,[0-9]+)(?:[eEdD][-+]?[0-9]+)?")
#: The last form of nan is that of Microsoft's compilers.
_WORD = re.compile(r"[-+]?(?:inf|infinity|nan(?:\((?:ind|snan)\))?|1\.#(?:QNAN|SNAN|IND))", re.IGNORECASE)

_BLOCK = 2**15
_THREADS = min(4, os.cpu_count() or 1)
_PLUS, _COMMA_SIGN, _MINUS, _POINT, _D, _E = (np.uint8(code) for code in b"+,-.de")
_SCALE = 44  # 10^44 is the sum of two doubles, exactly
_POWERS = np.array([float(10**k) for k in range(_SCALE + 1)])
_POWERS_REST = np.array([float(10**k - int(float(10**k))) for k in range(_SCALE + 1)])
_INTEGER_POWERS = np.array([10**k for k in range(20)], dtype=np.uint64)
#: Of 8, 16 or 24 characters read as integers, little-endian, those of the last n.
_LAST = {
    many: np.array(
        [
            [(2**64 - 1) << 8 * min(max(8 * (k + 1) - n, 0), 8) & (2**64 - 1) for k in range(many)][::-1]
            for n in range(8 * many + 1)
        ],
        dtype=np.uint64,
    )
    for many in (1, 2, 3)
}
#: Bytes that must stand before and after the text that :func:`parse_cells` reads.
PADDING = 32


def to_number(text: str, decimal_comma: bool = False) -> float | None:
    """The number that a text is, None if it is none.

    Parameters
    ----------
    text
        Without white space around it.
    decimal_comma
        Whether a comma may stand for the point.
    """
    text = text.replace("\u2212", "-")
    if len(text) > _LONGEST:
        return None
    if not _NUMBER.fullmatch(text):
        if _WORD.fullmatch(text):
            return float(text) if text.lstrip("+-")[0] in "iI" else math.nan
        if not (decimal_comma and _COMMA.fullmatch(text)):
            return None
        text = text.replace(",", ".")
    return float(text.replace("d", "e").replace("D", "e"))


def parse_cells(
    buffer: NDArray[np.uint8],
    special: NDArray[np.intp],
    before: NDArray[np.intp],
    after: NDArray[np.intp],
    decimal_comma: bool,
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Plain numbers of many cells.

    Parameters
    ----------
    buffer
        The text, with :data:`PADDING` further bytes at either end.
    special
        Positions in it of all characters that are no digits, ascending.
    before, after
        Of each cell, which of `special` are the last before and the first after it.
    decimal_comma
        Whether a comma may stand for the point.

    Returns
    -------
    values
        float64, as many as cells; NaN for those not understood here.
    odd
        Which are not: no numbers at all, or of a rare form.
    """
    values = np.empty(len(before))

    def parse(begin: int) -> NDArray[np.intp]:
        block = slice(begin, begin + _BLOCK)
        values[block], good = _parse_block(buffer, special, before[block], after[block], decimal_comma)
        return begin + np.flatnonzero(~good)

    begins = range(0, len(before), _BLOCK)
    if len(begins) < 3:
        odd = [parse(begin) for begin in begins]
    else:  # NumPy works on several blocks at once
        with ThreadPoolExecutor(min(_THREADS, len(begins))) as pool:
            odd = list(pool.map(parse, begins))
    return values, np.concatenate([*odd, np.empty(0, dtype=np.intp)])


def _parse_block(
    buffer: NDArray[np.uint8],
    special: NDArray[np.intp],
    before: NDArray[np.intp],
    after: NDArray[np.intp],
    decimal_comma: bool,
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    start, end = special[before] + 1, special[after]
    # The cursor walks over the special characters of each cell: sign, point, exponent, its sign.
    cursor = before + 1
    position = special[cursor]
    character = buffer[position]
    signed = _is_sign(character)
    negative = None
    if signed.any():
        signed &= position == start
        negative = signed & (character == _MINUS)
        start += signed
        cursor += signed
        position = special[cursor]
        character = buffer[position]
    pointed = character == _POINT
    if decimal_comma:
        pointed |= character == _COMMA_SIGN
    whole = position - start  # digits before the point; without one, all
    whole_end = position
    cursor += pointed
    digits_end, good = end, cursor == after
    power = np.zeros(len(end), dtype=np.int64)
    rest = np.flatnonzero(~good)
    if rest.size:
        letter = special[cursor[rest]]
        lower = buffer[letter] | 0x20
        scaled = (lower == _E) | (lower == _D)
        rest, letter = rest[scaled], letter[scaled]
        digits_end = end.copy()
        digits_end[rest] = letter
        power[rest], good[rest] = _exponents(buffer, special, cursor[rest] + 1, after[rest], letter + 1)
    part = digits_end - whole_end
    part -= pointed
    good &= (whole + part > 0) & (whole <= 19) & (part <= 24)
    if not good.all():
        whole, part = whole * good, part * good

    mantissa, fits = _integers(buffer, whole_end, whole)
    if fits is not True:
        good &= fits
    longest = int(part.max(initial=0))
    if longest:
        fraction, fits = _integers(buffer, digits_end, part)
        if fits is not True:
            good &= fits
        if longest + int(whole.max()) > 19:
            good &= (mantissa == 0) | (whole + part <= 19)
        mantissa = mantissa * _INTEGER_POWERS[np.minimum(part, 19)] + fraction
    values, sure = _scaled(mantissa, power - part)
    if negative is not None:
        values *= 1.0 - 2.0 * negative
    good &= sure
    if not good.all():
        values[~good] = np.nan
    return values, good


def _exponents(
    buffer: NDArray[np.uint8],
    special: NDArray[np.intp],
    cursor: NDArray[np.intp],
    after: NDArray[np.intp],
    begin: NDArray[np.intp],
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Powers of ten that begin after the letter of one, and which cells end there as they should."""
    position = special[cursor]
    character = buffer[position]
    signed = _is_sign(character) & (position == begin)
    end = special[after]
    count = end - begin - signed
    good = (cursor + signed == after) & (count > 0) & (count <= 8)
    size = _integers(buffer, end, count * good)[0].astype(np.int64)
    return np.where(signed & (character == _MINUS), -size, size), good


def _is_sign(character: NDArray[np.uint8]) -> NDArray[np.bool_]:
    values: NDArray[np.bool_] = (character == _MINUS) | (character == _PLUS)
    return values


def _integers(
    buffer: NDArray[np.uint8], end: NDArray[np.intp], count: NDArray[np.intp]
) -> tuple[NDArray[np.uint64], NDArray[np.bool_] | bool]:
    """The integers of the `count` digits (24 or fewer) that end before `end`, and which are below 10¹⁹."""
    longest = int(count.max(initial=0))
    if longest <= 1:
        return (buffer[end - 1] & np.uint8(0x0F)) * count.astype(np.uint64), True
    many = -(-longest // 8)
    places = np.ndarray((len(buffer) - 8 * many + 1,), dtype=f"V{8 * many}", buffer=buffer, strides=(1,))
    w = places[end - 8 * many].view("<u8").reshape(-1, many)
    w &= _LAST[many].take(count, axis=0)
    w &= np.uint64(0x0F0F0F0F0F0F0F0F)
    w *= np.uint64(10 * 2**8 + 1)
    w >>= np.uint64(8)
    w &= np.uint64(0x00FF00FF00FF00FF)
    w *= np.uint64(100 * 2**16 + 1)
    w >>= np.uint64(16)
    w &= np.uint64(0x0000FFFF0000FFFF)
    w *= np.uint64(10000 * 2**32 + 1)
    w >>= np.uint64(32)
    total = w[:, -1]
    for k in range(1, many):
        total = total + w[:, -1 - k] * np.uint64(10 ** (8 * k))
    return total, w[:, 0] < 1000 if many == 3 else True


def _scaled(
    mantissa: NDArray[np.uint64], power: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """mantissa · 10^power, correctly rounded, and where that is sure."""
    size = np.abs(power)
    largest = int(size.max(initial=0))
    sure = size <= _SCALE
    if largest > _SCALE:
        size = np.minimum(size, _SCALE)
    whole = mantissa.astype(np.float64)
    scale = _POWERS[size]
    up = power > 0
    if up.any():
        values = np.where(up, whole * scale, whole / scale)
    else:
        values = whole / scale
    difficult = mantissa >= np.uint64(2**53)
    if largest > 22:
        difficult |= size > 22
    hard = np.flatnonzero(difficult)
    if hard.size:
        corrected, certain = _corrected(mantissa[hard], size[hard], up[hard])
        values[hard] = corrected
        sure[hard] &= certain
    return values, sure


def _corrected(
    mantissa: NDArray[np.uint64], size: NDArray[np.intp], up: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    high = mantissa.astype(np.float64)
    low = (mantissa - high.astype(np.uint64)).view(np.int64).astype(np.float64)
    scale, rest = _POWERS[size], _POWERS_REST[size]
    first = np.where(up, high * scale, high / scale)
    product, error = _exact_product(np.where(up, high, first), scale)
    correction = np.where(
        up,
        error + (low * scale + high * rest),
        (((high - product) - error + low) - first * rest) / scale,
    )
    values = first + correction
    left = np.abs(correction - (values - first))
    spacing = np.spacing(values)
    # Below a power of two numbers lie twice as dense.
    near = np.abs(left - 0.5 * spacing) < 1e-4 * spacing
    near |= (np.frexp(values)[0] == 0.5) & (left > 0.2 * spacing)
    return values, ~near | (mantissa == 0)


def _exact_product(
    a: NDArray[np.float64], b: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """a·b and what rounding took from it."""
    product = a * b
    a_high, a_low = _halves(a)
    b_high, b_low = _halves(b)
    return product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low


def _halves(a: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    shifted = 134217729.0 * a  # 2²⁷ + 1
    high = shifted - (shifted - a)
    return high, a - high
