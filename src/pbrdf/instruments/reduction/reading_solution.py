"""Stokes parameters of geometries from single readings behind an analyser, with covariance, and whether they agree.

The readings of a geometry are the equations y_j = W_j · S; :func:`.stokes_solution.solve_stokes` solves those of all
geometries with the same states at once. Uncertainties, in this order: those that are stated; shot noise, y/gain,
from the readings that the first, unweighted solution expects (weights from the noisy readings themselves would make I
too small); the scatter of repeated readings of a state at a geometry, as one standard deviation for all states there,
or, where fewer than four repeats tell it, relative to I from all geometries; else none, and no weights.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrdf.instruments.polarimeter.stokes_solution import RANK_TOLERANCE, solve_stokes

__all__ = ["Readings", "Solution", "disagreements", "solve_readings"]

#: Repeats beyond the first that tell the noise of one geometry by themselves.
_ENOUGH_REPEATS = 4
#: Probability, for the whole table, that a geometry is named though nothing is wrong.
_FALSE_ALARM = 1e-3
#: Readings without uncertainties that contradict each other by more than this share of I are named.
_SUSPICIOUS = 0.02
#: So many times the usual disagreement of the table, too.
_UNUSUAL = 6.0


@dataclass(frozen=True, eq=False)
class Readings:
    """Readings of N single exposures.

    Attributes
    ----------
    geometry, state
        Of each, counted from 0, shape (N,).
    value
        Readings without dark signal, shape (N,); NaN where there is none.
    deviation
        Their standard uncertainties, shape (N,), NaN where they are not known; None if none is stated.
    vectors
        Analyser vectors of the states, shape (states, 4).
    gain
        Electrons per unit of each reading, shape (N,); None where shot noise is not to count.
    dark
        Dark signal that was taken from the readings, whose shot noise is still in them.
    """

    geometry: NDArray[np.intp]
    state: NDArray[np.intp]
    value: NDArray[np.float64]
    deviation: NDArray[np.float64] | None
    vectors: NDArray[np.float64]
    gain: NDArray[np.float64] | None = None
    dark: float = 0.0


@dataclass(frozen=True, eq=False)
class Solution:
    """What the readings say of G geometries.

    Attributes
    ----------
    stokes, covariance
        Shapes (G, 4) and (G, 4, 4); NaN in what the states do not determine, the covariance also where no uncertainty
        is known.
    chi2, freedom
        Of the readings about the solution, and how many more readings there are than what they determine; NaN without
        uncertainties.
    miss
        Root mean square of the readings about the solution, √(Σ r²/freedom), relative to I; 0 without freedom.
    noise
        Where the uncertainties come from: ``stated``, ``shot``, ``repeats`` or ``none``.
    """

    stokes: NDArray[np.float64]
    covariance: NDArray[np.float64]
    chi2: NDArray[np.float64]
    freedom: NDArray[np.intp]
    miss: NDArray[np.float64]
    noise: str


def solve_readings(readings: Readings, geometries: int) -> Solution:
    """Stokes parameters of each geometry; the order of the readings does not matter.

    Parameters
    ----------
    readings
        The readings. Those that are NaN count as not taken.
    geometries
        Number G of geometries.
    """
    good = np.isfinite(readings.value)
    geometry, state, value = readings.geometry[good], readings.state[good], readings.value[good]
    stated = None if readings.deviation is None else readings.deviation[good]
    order = np.lexsort((value, state, geometry))
    geometry, state, value = geometry[order], state[order], value[order]
    plain = _solved(geometry, state, value, None, readings.vectors, geometries)
    expected = np.einsum("nk,nk->n", readings.vectors[state], np.nan_to_num(plain.stokes)[geometry])
    if stated is not None:
        variance: NDArray[np.float64] | None = stated[order] ** 2
        noise = "stated"
    elif readings.gain is not None:
        # At least one electron: a reading near 0 is not known without error.
        gain = readings.gain[good][order]
        variance = np.maximum((expected + readings.dark) / gain, gain**-2)
        noise = "shot"
    else:
        variance = _scatter(geometry, state, value, plain.stokes[:, 0], geometries)
        noise = "none" if variance is None else "repeats"
    if variance is None:
        return plain
    return _solved(geometry, state, value, variance, readings.vectors, geometries, noise)


def _solved(
    geometry: NDArray[np.intp],
    state: NDArray[np.intp],
    value: NDArray[np.float64],
    variance: NDArray[np.float64] | None,
    vectors: NDArray[np.float64],
    geometries: int,
    noise: str = "none",
) -> Solution:
    """The solution of sorted readings; without weights where a variance is not known."""
    stokes = np.full((geometries, 4), np.nan)
    covariance = np.full((geometries, 4, 4), np.nan)
    chi2 = np.full(geometries, np.nan)
    freedom = np.zeros(geometries, dtype=np.intp)
    miss = np.zeros(geometries)
    counts = np.bincount(geometry, minlength=geometries)
    starts = np.concatenate([[0], np.cumsum(counts)])
    sets: dict[bytes, list[int]] = {}
    for g in np.flatnonzero(counts).tolist():
        sets.setdefault(state[starts[g] : starts[g + 1]].tobytes(), []).append(g)
    for members in sets.values():
        rows = starts[members][:, None] + np.arange(counts[members[0]])  # (geometries, readings)
        W = vectors[state[rows[0]]]
        y = value[rows].T
        spread = np.ones_like(y) if variance is None else variance[rows].T
        known = (np.isfinite(spread) & (spread > 0.0)).all(axis=0)
        left = len(W) - int(np.linalg.matrix_rank(W, tol=RANK_TOLERANCE * np.linalg.norm(W, 2)))
        for weighted in (False, True) if variance is not None else (False,):
            which = known if weighted else ~known if variance is not None else known
            if not which.any():
                continue
            own = np.array(members)[which]
            found, spreads = solve_stokes(
                y[:, which], spread[:, which] if weighted else np.ones_like(y[:, which]), W, weighted=weighted
            )
            stokes[own] = found.T
            if weighted:
                covariance[own] = spreads.transpose(2, 0, 1)
            freedom[own] = left
            if left == 0:
                continue
            full = _shortest(y[:, which], spread[:, which], W, weighted)
            residual = y[:, which] - W @ full
            with np.errstate(divide="ignore", invalid="ignore"):
                miss[own] = np.sqrt((residual**2).sum(axis=0) / left) / np.abs(full[0])
            if weighted:
                chi2[own] = (residual**2 / spread[:, which]).sum(axis=0)
    return Solution(stokes, covariance, chi2, freedom, miss, noise)


def _shortest(
    y: NDArray[np.float64],
    variance: NDArray[np.float64],
    W: NDArray[np.float64],
    weighted: bool,
) -> NDArray[np.float64]:
    """The shortest least-squares solution, with a number in every component, shape (4, P)."""
    root = 1.0 / np.sqrt(variance) if weighted else np.ones_like(y)
    inverse = np.linalg.pinv(W[None] * root.T[:, :, None], rcond=RANK_TOLERANCE)
    return np.asarray(np.einsum("pkn,np->kp", inverse, y * root))


def _scatter(
    geometry: NDArray[np.intp],
    state: NDArray[np.intp],
    value: NDArray[np.float64],
    intensity: NDArray[np.float64],
    geometries: int,
) -> NDArray[np.float64] | None:
    """Variance of each reading from the scatter of repeats; None if nothing is repeated or nothing scatters."""
    pairs, place = np.unique(np.stack([geometry, state]), axis=1, return_inverse=True)
    place = place.ravel()
    counts = np.bincount(place)
    means = np.bincount(place, value) / counts
    squares = np.bincount(pairs[0][place], (value - means[place]) ** 2, minlength=geometries)
    repeats = np.bincount(pairs[0], counts - 1, minlength=geometries)
    if not repeats.any() or not squares.any():
        return None
    with np.errstate(divide="ignore", invalid="ignore"):
        own = squares / repeats
        usable = (repeats > 0) & (np.abs(intensity) > 0.0)
        relative = (squares[usable] / intensity[usable] ** 2).sum() / max(repeats[usable].sum(), 1)
    pooled = relative * intensity**2
    return np.where((repeats >= _ENOUGH_REPEATS) & (squares > 0.0), own, pooled)[geometry]


def disagreements(
    solution: Solution, lines: Sequence[int], sums: Sequence[tuple[str, NDArray[np.float64]]]
) -> list[str]:
    """Sentences on readings that contradict each other.

    Parameters
    ----------
    solution
        The solution.
    lines
        Line of the file of each geometry.
    sums
        Names and values, shape (G,), of the sums that all should be I: the pairs of crossed polarisers.
    """
    from scipy.special import gammaincc

    told = solution.freedom > 0
    if not told.any():
        return []
    shown = _sums_in_words(sums)
    known = told & np.isfinite(solution.chi2)
    sentences = []
    unbalanced = _unbalanced(sums, told)
    if known.any():
        half = 0.5 * solution.freedom[known]
        chance = gammaincc(half, 0.5 * solution.chi2[known])
        rows = np.flatnonzero(known)[chance < _FALSE_ALARM / known.sum()]
        total, freedom = float(solution.chi2[known].sum()), int(solution.freedom[known].sum())
        if rows.size:
            worst = rows[np.argmax(solution.chi2[rows] / solution.freedom[rows])]
            sentences.append(
                f"readings contradict each other beyond their uncertainties in {_named(lines, rows)}; at worst, in "
                f"line {lines[worst]}{shown(worst)}, χ² is {solution.chi2[worst]:.3g} for {solution.freedom[worst]} "
                "more readings than needed: look for saturation, unequal gains, or light that has changed between them"
            )
        elif gammaincc(0.5 * freedom, 0.5 * total) < _FALSE_ALARM:
            sentences.append(
                "the readings of all geometries together contradict each other by "
                f"{np.sqrt(total / freedom):.2g} times their uncertainties; these are too small, or the analysers are "
                "not what they are said to be"
            )
    elif not unbalanced:
        typical = float(np.median(solution.miss[told]))
        rows = np.flatnonzero(told & (solution.miss > max(_SUSPICIOUS, _UNUSUAL * typical)))
        if rows.size:
            worst = rows[np.argmax(solution.miss[rows])]
            sentences.append(
                f"readings contradict each other in {_named(lines, rows)}; at worst, in line "
                f"{lines[worst]}{shown(worst)}, they miss every Stokes vector by {100 * solution.miss[worst]:.2g} % "
                "of I: look for saturation, unequal gains, or "
                "a light that has changed between them"
            )
    return sentences + unbalanced


def _unbalanced(sums: Sequence[tuple[str, NDArray[np.float64]]], told: NDArray[np.bool_]) -> list[str]:
    """Whether one pair of crossed polarisers reads more than another everywhere."""
    sentences = []
    for name, values in sums[1:]:
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = (values / sums[0][1] - 1.0)[told]
        ratio = ratio[np.isfinite(ratio)]
        if ratio.size < 3:
            continue
        middle = float(np.median(ratio))
        scatter = 1.4826 * float(np.median(np.abs(ratio - middle)))
        if abs(middle) > max(0.5 * _SUSPICIOUS, 3.0 * scatter / np.sqrt(ratio.size)):
            more = "larger" if middle > 0.0 else "smaller"
            sentences.append(
                f"{name} is {100 * abs(middle):.2g} % {more} than {sums[0][0]} on the median of {ratio.size} "
                "geometries, but both are I: the channels have unequal gains, or a dark signal is left in them"
            )
    return sentences


def _sums_in_words(sums: Sequence[tuple[str, NDArray[np.float64]]]) -> Callable[[int | np.integer], str]:
    def words(row: int | np.integer) -> str:
        if len(sums) < 2:
            return ""
        return " (" + ", ".join(f"{name} = {values[row]:.4g}" for name, values in sums) + ")"

    return words


def _named(lines: Sequence[int], rows: NDArray[np.intp]) -> str:
    names = [str(lines[row]) for row in rows[:5]]
    more = f" and {rows.size - 5} more" if rows.size > 5 else ""
    return f"line{'s' if rows.size > 1 else ''} {', '.join(names)}{more}"
