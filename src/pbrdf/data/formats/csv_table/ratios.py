"""Columns of normalised polarisation: Q/I, S1/S0, M12/M11 and how else they are written.

A ratio is read from a name that says what was divided by what, with a stroke or the word ``over``: ``Q/I``, ``S1/S0``,
``q_over_i``, ``M12/M11``, ``m01_over_m00``, ``f_r12/f_r11``. Which element the rows and columns are counted from is
seen in the divisor: m00 or m11. ``Q_norm`` and the like are normalised by I. A minus before the name, as in −M12/M11,
turns the sign. The quantity ``normalised`` says of the columns I, Q, U, V and m00 … m33 that they are
divided by the intensity already.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrdf.data import conventions
from pbrdf.data.schema import NORMALISED, std_name, written
from pbrdf.errors import DataError
from pbrdf.optics.angles import within_half_turn

__all__ = [
    "RATIO_ELEMENTS",
    "already_divided",
    "gather_ratios",
    "ratio_variable",
    "signed_ratio",
    "swap_sp_of_ratios",
    "without_derived",
]

#: Columns of the elements of mueller_over_m00, row by row.
RATIO_ELEMENTS = tuple(f"m{i}{j}_over_m00" for i in range(4) for j in range(4))

_STOKES = {"q": "Q", "u": "U", "v": "V", "s1": "Q", "s2": "U", "s3": "V"}
_INTENSITY = {"q": "i", "u": "i", "v": "i", "s1": "s0", "s2": "s0", "s3": "s0"}
_NORMALISED = re.compile(r"([quv]|s[123])norm(?:ali[sz]ed)?|norm(?:ali[sz]ed)?([quv]|s[123])")
#: What may stand between the parts of a name, a minus before it included.
_PUNCTUATION = re.compile(r"[\s_.,()\[\]{}\-\u2010-\u2015\u2212]")
_MINUS = re.compile(r"\s*\(?\s*[-\u2010-\u2015\u2212]")
_DIVISION = re.compile(r"(.+?)(?:/|over)(.+)")
#: An element: mueller matrices are called m, mm, f_r and, with volumes that scatter, s, p or f.
_ELEMENT = re.compile(r"(m|mm|mueller|fr|f|s|p|a)([0-4])([0-4])")
#: How far the intensity of normalised values may be from 1: rounding.
_ONE = 1e-3
#: Rounding up to which a derived column repeats others; light less polarised than this has no angle to compare.
_ROUNDED, _UNPOLARISED = 0.02, 0.05


def ratio_variable(key: str) -> str | None:
    """Variable that a column name stands for; None where it is no ratio known here.

    Parameters
    ----------
    key
        The name without unit and the word for its uncertainty: ``Q/I``, ``m12overm11``, ``M(1,2)/M(1,1)``.

    Returns
    -------
    str or None
        ``Q_over_I``, ``U_over_I``, ``V_over_I``, or ``m00_over_m00`` … ``m33_over_m00``.
    """
    key = _PUNCTUATION.sub("", unicodedata.normalize("NFKC", key).lower())
    normalised = _NORMALISED.fullmatch(key)
    if normalised is not None:
        return f"{_STOKES[normalised[1] or normalised[2]]}_over_I"
    division = _DIVISION.fullmatch(key)
    if division is None:
        return None
    part, whole = division.groups()
    if whole in ("i", "s0") and _INTENSITY.get(part) == whole:
        return f"{_STOKES[part]}_over_I"
    upper, lower = _ELEMENT.fullmatch(part), _ELEMENT.fullmatch(whole)
    if upper is None or lower is None or upper[1] != lower[1] or lower[2] != lower[3]:
        return None
    first = int(lower[2])
    i, j = (int(digit) - first for digit in upper.groups()[1:])
    if first > 1 or not (0 <= i <= 3 and 0 <= j <= 3):
        return None
    return f"m{i}{j}_over_m00"


def signed_ratio(values: NDArray[np.float64], name: str) -> NDArray[np.float64]:
    """Values of a column of a ratio, turned by a minus before its name in the file."""
    return -values if _MINUS.match(name) else values


def gather_ratios(values: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Replace the columns m00_over_m00 … by one array (N, 4, 4); elements without a column are NaN."""
    rest = {name: value for name, value in values.items() if name not in RATIO_ELEMENTS}
    elements = {name: value for name, value in values.items() if name in RATIO_ELEMENTS}
    if elements:
        missing = np.full(len(next(iter(elements.values()))), np.nan)
        stacked = np.stack([elements.get(name, missing) for name in RATIO_ELEMENTS], axis=-1)
        rest["mueller_over_m00"] = stacked.reshape(-1, 4, 4)
    return rest


def already_divided(
    channels: Mapping[str, NDArray[Any]], std: Mapping[str, NDArray[Any]]
) -> tuple[dict[str, NDArray[Any]], dict[str, NDArray[Any]]]:
    """Channels of a file whose quantity is ``normalised``, and their uncertainties, as the ratios that they are.

    Raises
    ------
    DataError
        If the intensity, or m00, is not 1.
    """
    own = channels.get("I", channels["mueller"][:, 0, 0] if "mueller" in channels else None)
    if own is not None and (off := np.abs(own - 1.0) > _ONE).any():
        name = "I" if "I" in channels else "m00"
        raise DataError(
            f"the quantity is stated as {NORMALISED!r}, but {name} is {own[off][0]:.6g}, not 1: state what {name} is "
            f"(brdf, reflectance_factor, radiance or dn); what is divided by it is called Q/I or m01/m00"
        )
    divided = {"Q": "Q_over_I", "U": "U_over_I", "V": "V_over_I", "mueller": "mueller_over_m00"}
    found = [
        {divided.get(name, name): value for name, value in part.items() if name != "I"}
        for part in (channels, std)
    ]
    return found[0], found[1]


def without_derived(channels: dict[str, NDArray[Any]], std: dict[str, NDArray[Any]]) -> list[str]:
    """Take out, in place, what only repeats others: DoLP, AoLP and Q/I beside I, Q, U; DoLP and AoLP beside Q/I, U/I.

    Returns
    -------
    list of str
        A sentence on each, which says where it disagrees with what it should follow from.
    """
    stokes = [channels.get(name) for name in "IQUV"]
    ratios: dict[str, NDArray[np.float64]] = {}
    with np.errstate(all="ignore"):
        if stokes[0] is not None:
            ratios = {
                f"{n}_over_I": v / stokes[0] for n, v in zip("QUV", stokes[1:], strict=True) if v is not None
            }
        expected = dict(ratios)
        whole = ratios or channels
        if {"dolp", "aolp"} & channels.keys() and "Q_over_I" in whole and "U_over_I" in whole:
            shares = np.column_stack([np.ones(len(whole["Q_over_I"])), whole["Q_over_I"], whole["U_over_I"]])
            expected["dolp"], expected["aolp"] = conventions.dolp_aolp_from_stokes(shares)
    sentences = []
    for name in [name for name in expected if name in channels]:
        if (np.isfinite(channels[name]) & ~np.isfinite(expected[name])).any():
            continue  # it says more than they do somewhere
        values = channels.pop(name)
        std.pop(std_name(name), None)
        difference = np.abs(values - expected[name])
        if name == "aolp":
            difference = np.abs(within_half_turn(values - expected[name], np.pi / 2))
            difference = np.where(expected["dolp"] < _UNPOLARISED, np.nan, difference)
        parents = "Q, U" if ratios else "Q/I, U/I"
        known = difference[np.isfinite(difference)]
        if known.size and known.max() > _ROUNDED:
            unit, factor = ("°", np.rad2deg(1.0)) if name == "aolp" else ("", 1.0)
            sentences.append(
                f"{written(name)} was not used and disagrees with {parents}, which were, by up to "
                f"{factor * known.max():.3g}{unit}: check units and signs"
            )
        else:
            sentences.append(f"{written(name)} was not used, as it follows from {parents}")
    return sentences


def swap_sp_of_ratios(channels: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """The same channels with Q > 0 and U > 0 counted the other way in the ratios among them."""
    swapped = dict(channels)
    for name in swapped.keys() & {"Q_over_I", "U_over_I"}:
        swapped[name] = -swapped[name]
    if "mueller_over_m00" in swapped:
        swapped["mueller_over_m00"] = conventions.mueller_swap_sp(swapped["mueller_over_m00"])
    return swapped
