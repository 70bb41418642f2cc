"""Optimal experimental design: which readings to take so that the inverse of their information is small.

A design ξ gives weights to candidate readings with information matrices M_x; M(ξ) = Σ ξ_x M_x. Both criteria are
written as the logarithm Φ of an information function φ (concave, positively homogeneous), for the covariance C = M⁻¹ of
a reading and averaged over K possible values of the parameters:

* D: Φ = −mean_k (1/s) log det C_ss, with C_ss the block of the s parameters of interest;
* A: Φ = −mean_k log mean_j C_jj/scale_j².

exp(−Φ) is a typical variance. The sensitivity d(x) = tr(∇Φ M_x) has Σ ξ_x d(x) = 1 at every design, and by the
equivalence theorem a design is optimal if and only if d(x) ≤ 1 everywhere; φ(any design) ≤ φ(ξ) max_x d(x) bounds what
can still be gained (Kiefer and Wolfowitz (1960); Pukelsheim, *Optimal Design of Experiments* (1993), ch. 5-7).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pbrdf.errors import FitError

__all__ = ["CRITERIA", "ContinuousDesign", "Criterion", "choose_labels", "continuous_design", "exact_design"]

CRITERIA = ("D", "A")

#: Exchanges tried at a time, and gains of Φ that count as one.
_BATCH, _GAIN = 128, 1e-9
#: Smallest eigenvalue of information at unit diagonal that is no rounding.
_SINGULAR = 1e-13
#: Continuous designs: steps and moves of a round, how many candidates join after it, their first share, and a share
#: that is none.
_STEPS, _MOVES, _JOINING, _ENTRY, _SPENT = 20, 20, 8, 0.02, 1e-7
#: Multiplicative steps by which a choice of labels is judged.
_LOOK = 60


@dataclass(frozen=True)
class Criterion:
    """What a design should make small.

    Attributes
    ----------
    kind
        ``"D"`` or ``"A"``.
    interest
        Indices of the parameters of interest, shape (s,); the others are known only from the same data.
    scale
        For A: units of the errors of the parameters of interest for each set of parameters, shape (K, s).
    """

    kind: str
    interest: np.ndarray
    scale: np.ndarray

    def __post_init__(self) -> None:
        if self.kind not in CRITERIA:
            raise FitError(f"criterion {self.kind!r}: choose one of {', '.join(CRITERIA)}")

    def value(self, matrices: np.ndarray) -> np.ndarray:
        """Φ of information matrices of shape (..., K, P, P); −inf where one is singular. Shape (...)."""
        scale, unit, definite = _unit_diagonal(matrices)
        with np.errstate(divide="ignore", invalid="ignore"):
            if self.kind == "D" and len(self.interest) == matrices.shape[-1]:
                # −log det M: the scales back in
                each = -np.linalg.slogdet(unit)[1] + 2.0 * np.log(scale).sum(axis=-1)
                each /= len(self.interest)
            else:
                block = np.linalg.inv(unit)[..., self.interest[:, None], self.interest]
                size = scale[..., self.interest]
                if self.kind == "D":
                    log = np.linalg.slogdet(block)[1] + 2.0 * np.log(size).sum(axis=-1)
                    each = log / len(self.interest)
                else:
                    relative = np.einsum("...jj->...j", block) * np.square(size / self.scale)
                    each = np.log(relative.mean(axis=-1))
        return np.where(definite.all(axis=-1), -np.where(definite, each, 0.0).mean(axis=-1), -np.inf)

    def gradient(self, matrices: np.ndarray) -> np.ndarray:
        """∇Φ at regular information matrices of shape (K, P, P); d(x) = Σ_k tr(∇Φ_k M_xk). Shape (K, P, P)."""
        inverse = np.linalg.inv(matrices)
        columns = inverse[:, :, self.interest]
        if self.kind == "D":
            block = np.linalg.inv(columns[:, self.interest, :])
            share = 1.0 / len(self.interest)
        else:
            variances = np.einsum("kjj->kj", columns[:, self.interest, :]) / self.scale**2
            block = np.einsum("kj,ij->kij", self.scale**-2.0, np.eye(len(self.interest)))
            block = block / variances.sum(axis=1)[:, None, None]
            share = 1.0
        return share / len(matrices) * columns @ block @ columns.transpose(0, 2, 1)


@dataclass(frozen=True)
class ContinuousDesign:
    """Optimal shares of the readings, the number of readings left open.

    Attributes
    ----------
    weights
        Share of each candidate, shape (G,), sum 1.
    sensitivity
        d(x) of each candidate there, shape (G,).
    value
        Φ of one reading at these shares.
    """

    weights: np.ndarray
    sensitivity: np.ndarray
    value: float

    @property
    def efficiency(self) -> float:
        """φ of these shares is at least this part of the largest possible, by the equivalence theorem."""
        return 1.0 / max(float(self.sensitivity.max()), 1.0)


def continuous_design(
    matrices: np.ndarray, criterion: Criterion, *, tolerance: float = 1e-3, max_rounds: int = 300
) -> ContinuousDesign:
    """Optimal shares: multiplicative steps on a set of candidates that sensitive ones join and spent ones leave.

    The step multiplies each share with d(x), or with its root unless D counts all parameters (Titterington 1976; Yu,
    Ann. Statist. 38, 1593 (2010)); after some, share is moved from the least to the most sensitive candidates
    (Böhning, Metrika 33, 337 (1986)), which empties the neighbours of the best.

    Parameters
    ----------
    matrices
        Information of one reading at each candidate for each set of parameters, shape (K, G, P, P).
    criterion
        What to make small.
    tolerance
        Stop when the efficiency is known to be at least 1 − tolerance.
    max_rounds
        Rounds of multiplicative steps, after each of which all candidates are looked at.

    Raises
    ------
    FitError
        If all candidates together do not determine the parameters.
    """
    sets, count = matrices.shape[:2]
    flat = matrices.reshape(sets, count, -1)
    weights = np.full(count, 1.0 / count)
    if not np.isfinite(criterion.value(_total(flat, weights))):
        raise FitError(
            "the candidate geometries together do not determine the parameters: fix some, or allow more geometries"
        )
    for number in range(max_rounds + 1):
        sensitivity = _sensitivity(flat, criterion.gradient(_total(flat, weights)))
        if sensitivity.max() <= 1.0 + tolerance or number == max_rounds:
            break
        if number:
            weights[(weights < _SPENT) & (sensitivity < 1.0)] = 0.0
            joining = np.argsort(-sensitivity)[:_JOINING]
            joining = joining[sensitivity[joining] > 1.0]
            weights[joining] = np.maximum(
                weights[joining], _ENTRY * (sensitivity[joining] - 1.0).clip(max=1.0)
            )
        weights = _multiplied(flat, criterion, weights, _STEPS)
        weights = _vertex_exchange(flat, criterion, weights)
    return ContinuousDesign(weights, sensitivity, float(criterion.value(_total(flat, weights))))


def exact_design(
    matrices: np.ndarray,
    criterion: Criterion,
    size: int,
    *,
    repeats: int = 1,
    shares: ContinuousDesign | None = None,
    starts: int = 4,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> np.ndarray:
    """The best so many readings by exchange (Fedorov 1972), from several starts.

    Every start is improved until no exchange of one reading for another raises Φ. Exchanges that cannot are told
    without trying: Φ is concave, so that the gain is at most d(added) − d(removed).

    Parameters
    ----------
    matrices
        As for :func:`continuous_design`.
    criterion
        What to make small.
    size
        Number of readings.
    repeats
        How often one candidate may be read at most.
    shares
        The continuous design, from which starts are made; None computes it.
    starts
        The first rounds the shares, the others draw readings by them.
    seed
        Of the draws.
    progress
        Called with the number of finished starts and of all.

    Returns
    -------
    ndarray
        Number of readings at each candidate, shape (G,), integers.

    Raises
    ------
    FitError
        If there are too few candidates, or so few readings do not determine the parameters.
    """
    count = matrices.shape[1]
    if size < 1 or count * repeats < size:
        raise FitError(
            f"{count} candidate geometries, each read {repeats} times at most, cannot make {size} readings: allow more "
            "candidates or repeats, or take fewer readings"
        )
    shares = shares or continuous_design(matrices, criterion)
    flat = matrices.reshape(len(matrices), count, -1)
    # candidates without a share stand in the order of their sensitivity
    wish = shares.weights + 1e-6 * shares.sensitivity / shares.sensitivity.sum()
    rng = np.random.default_rng(seed)
    best, best_value = None, -np.inf
    for number in range(starts):
        drawn = wish if number == 0 else (wish + 0.1 / count) * rng.exponential(size=count)
        chosen, value = _exchange(flat, criterion, _rounded(drawn, size, repeats), repeats)
        if best is None or value > best_value + _GAIN:
            best, best_value = chosen, value
        if progress is not None:
            progress(number + 1, starts)
    assert best is not None
    if not np.isfinite(best_value):
        raise FitError(
            f"{size} readings do not determine the parameters: raise the budget or fix some of them"
        )
    return best


def choose_labels(matrices: np.ndarray, criterion: Criterion, labels: np.ndarray, number: int) -> np.ndarray:
    """The best so many labels (camera positions) if only candidates with these may be read.

    One label after the other is added, then each is exchanged for any other while that helps; a choice is judged by
    shares near the best.

    Parameters
    ----------
    matrices
        As for :func:`continuous_design`.
    criterion
        What to make small.
    labels
        Of the candidates, shape (G,).
    number
        How many labels.

    Returns
    -------
    ndarray
        The labels chosen, ascending.

    Raises
    ------
    FitError
        If there are fewer labels, or no choice determines the parameters.
    """
    every = np.unique(labels)
    if not 1 <= number <= len(every):
        raise FitError(f"{number} camera positions cannot be chosen from {len(every)}")
    flat = matrices.reshape(len(matrices), len(labels), -1)
    # what no choice determines yet is told apart by a little of everything
    flat = flat + 1e-6 * flat.mean(axis=1, keepdims=True)
    known: dict[tuple[int, ...], float] = {}

    def value(chosen: list[int]) -> float:
        key = tuple(sorted(chosen))
        if key not in known:
            part = flat[:, np.isin(labels, every[list(key)])]
            weights = _multiplied(part, criterion, np.full(part.shape[1], 1.0 / part.shape[1]), _LOOK)
            known[key] = float(criterion.value(_total(part, weights)))
        return known[key]

    chosen: list[int] = []
    while len(chosen) < number:
        rest = [i for i in range(len(every)) if i not in chosen]
        chosen.append(max(rest, key=lambda i: value([*chosen, i])))
    improved = True
    while improved:
        improved = False
        for place in range(number):
            others = chosen[:place] + chosen[place + 1 :]
            rest = [i for i in range(len(every)) if i not in others]
            best = max(rest, key=lambda i, others=others: value([*others, i]))  # type: ignore[misc]
            if value([*others, best]) > value(chosen) + _GAIN:
                chosen[place], improved = best, True
    return np.sort(every[chosen])


def _rounded(shares: np.ndarray, size: int, repeats: int) -> np.ndarray:
    """Whole numbers of readings, at most ``repeats`` each, by the largest quotients of share and number (Sainte-Laguë).

    Where nothing of a share is left to give, the readings go to the candidates with the largest shares.
    """
    steps = np.arange(repeats) + 0.5
    quotients = (shares[:, None] / steps).ravel()
    order = np.argsort(-quotients, kind="stable")[:size]
    return np.bincount(order // repeats, minlength=len(shares))


def _multiplied(flat: np.ndarray, criterion: Criterion, weights: np.ndarray, steps: int) -> np.ndarray:
    """Weights after multiplicative steps; what is 0 stays 0."""
    used = np.flatnonzero(weights)
    part, share = flat[:, used], weights[used] / weights.sum()
    # with whole steps the shares would overshoot unless all parameters count in the determinant
    power = 1.0 if criterion.kind == "D" and len(criterion.interest) == round(part.shape[-1] ** 0.5) else 0.5
    for _ in range(steps):
        share = share * _sensitivity(part, criterion.gradient(_total(part, share))) ** power
        share /= share.sum()
    result = np.zeros_like(weights)
    result[used] = share
    return result


def _vertex_exchange(flat: np.ndarray, criterion: Criterion, weights: np.ndarray) -> np.ndarray:
    """Move share from the least sensitive candidate that has one to the most sensitive, some times."""
    weights = weights.copy()
    for _ in range(_MOVES):
        total = _total(flat, weights)
        sensitivity = _sensitivity(flat, criterion.gradient(total))
        best, worst = (
            int(np.argmax(sensitivity)),
            int(np.argmin(np.where(weights > 0.0, sensitivity, np.inf))),
        )
        change = (flat[:, best] - flat[:, worst]).reshape(total.shape)
        # Φ is concave along the move: its best amount lies beside the best of a grid
        low, high = 0.0, weights[worst]
        for _ in range(3):
            amounts = np.linspace(low, high, 9)
            values = criterion.value(total + amounts[:, None, None, None] * change)
            k = int(np.argmax(values))
            low, high = amounts[max(k - 1, 0)], amounts[min(k + 1, 8)]
        weights[best] += amounts[k]
        weights[worst] = max(weights[worst] - amounts[k], 0.0)
    return weights


def _exchange(
    flat: np.ndarray, criterion: Criterion, chosen: np.ndarray, repeats: int
) -> tuple[np.ndarray, float]:
    """Exchange one reading for another while Φ rises."""
    chosen = chosen.copy()
    total = _total(flat, chosen.astype(float))
    value = float(criterion.value(total))
    side = total.shape[-1]
    if not np.isfinite(value):
        return _exchange_singular(flat, criterion, chosen, repeats)
    while True:
        sensitivity = _sensitivity(flat, criterion.gradient(total))
        inside, free = np.flatnonzero(chosen > 0), np.flatnonzero(chosen < repeats)
        bound = sensitivity[free][None, :] - sensitivity[inside][:, None]
        pairs = np.flatnonzero(bound.ravel() > _GAIN)
        pairs = pairs[np.argsort(-bound.ravel()[pairs], kind="stable")]
        for start in range(0, len(pairs), _BATCH):
            out, new = np.unravel_index(pairs[start : start + _BATCH], bound.shape)
            removed, added = inside[out], free[new]
            trial = total + (flat[:, added] - flat[:, removed]).transpose(1, 0, 2).reshape(-1, *total.shape)
            values = criterion.value(trial)
            k = int(np.argmax(values))
            if values[k] > value + _GAIN:
                chosen[removed[k]] -= 1
                chosen[added[k]] += 1
                break
        else:
            return chosen, value
        # summed anew, so that rounding does not add up over the exchanges
        total = _total(flat, chosen.astype(float)).reshape(-1, side, side)
        value = float(criterion.value(total))


def _exchange_singular(
    flat: np.ndarray, criterion: Criterion, chosen: np.ndarray, repeats: int
) -> tuple[np.ndarray, float]:
    """From readings that do not determine the parameters: exchange with a little of everything added, then without."""
    everything = flat.sum(axis=1, keepdims=True) / flat.shape[1]
    better, _ = _exchange(flat + 1e-6 * everything, criterion, chosen, repeats)
    value = float(criterion.value(_total(flat, better.astype(float))))
    return _exchange(flat, criterion, better, repeats) if np.isfinite(value) else (better, value)


def _total(flat: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Σ weights M, shape (K, P, P)."""
    side = round(flat.shape[-1] ** 0.5)
    used = np.flatnonzero(weights)
    values: np.ndarray = np.einsum("g,kgq->kq", weights[used], flat[:, used]).reshape(-1, side, side)
    return values


def _sensitivity(flat: np.ndarray, gradient: np.ndarray) -> np.ndarray:
    """d(x) of every candidate, shape (G,)."""
    values: np.ndarray = np.einsum("kgq,kq->g", flat, gradient.reshape(len(flat), -1), optimize=True)
    return values


def _unit_diagonal(matrices: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Scales (..., P), scale M scale with unit diagonal, and which are positive definite beyond rounding.

    The last ones are replaced by the unit matrix, so that they can be inverted with the others.
    """
    diagonal = np.einsum("...jj->...j", matrices)
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    unit = matrices * scale[..., :, None] * scale[..., None, :]
    definite = (diagonal > 0.0).all(axis=-1)
    # the smallest eigenvalue is at least det/e for a unit diagonal: where that does not tell, look at it
    unsure = definite & ~(np.linalg.det(unit) > 3.0 * _SINGULAR)
    if unsure.any():
        definite[unsure] = np.linalg.eigvalsh(unit[unsure])[:, 0] > _SINGULAR
    unit = np.where(definite[..., None, None], unit, np.eye(matrices.shape[-1]))
    return scale, unit, definite
