"""The best retardances that variable retarders can do, within the limits of what they reach.

Sources: Peinado et al., Optics Express 18, 9815 (2010), for two variable retarders; Foreman & Goudail, Optical
Engineering 58, 082410 (2019): the Frobenius condition number, the equally weighted variance and, for four states, the
determinant have the same best sets. No set of N states has a smaller equally weighted variance than 40/N or a smaller
condition number than √3 (2-norm), √20 (Frobenius).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pbrdf.errors import DataError
from pbrdf.instruments.polarimeter.analyzer_chain import AnalyzerChain
from pbrdf.instruments.polarimeter.merit import Merit, merit
from pbrdf.instruments.polarimeter.polarimeter import Polarimeter, lcvr
from pbrdf.optics.elements import diattenuator, retarder

__all__ = ["BestRetardances", "Criterion", "search_retardances"]

Criterion = Literal["equally_weighted_variance", "condition_2", "condition_frobenius", "determinant"]

#: The 2-norm is the limit of high powers; the extreme eigenvalues themselves are not smooth where they are multiple.
_POWERS = (2, 8, 32, 128)

_TOLERANCES = {"ftol": 1e-15, "gtol": 1e-9}


@dataclass(frozen=True)
class BestRetardances:
    """Result of a search.

    Attributes
    ----------
    retardances
        Radians, shape (N, K).
    polarimeter, merit
        The instrument with these retardances, and how good it is.
    starts, agreeing
        How many starts there were, and how many ended at this value of the criterion (within 0.1 %).
    """

    retardances: np.ndarray
    polarimeter: Polarimeter
    merit: Merit
    starts: int
    agreeing: int


def search_retardances(
    states: int = 4,
    *,
    limits: Sequence[tuple[float, float]] | tuple[float, float] = (0.0, 2.0 * np.pi),
    axes: Sequence[float] = (0.0, np.pi / 4),
    analyzer: float = 0.0,
    criterion: Criterion = "equally_weighted_variance",
    starts: int = 24,
    seed: int = 0,
) -> BestRetardances:
    """Search for the best set of retardances from many starts.

    Parameters
    ----------
    states
        Number of states, 4 or more.
    limits
        Least and largest retardance, radians: of all retarders, or a pair for each.
    axes
        Fast axes of the retarders in the order the light meets them, radians.
    analyzer
        Axis of the analyser, radians.
    criterion
        What is made best: ``"equally_weighted_variance"``, ``"condition_2"``, ``"condition_frobenius"`` (all small) or
        ``"determinant"`` (large).
    starts, seed
        Random starts within the limits.

    Raises
    ------
    DataError
        If the options do not fit, or if retarders at these axes cannot measure the whole Stokes vector.
    """
    from scipy.optimize import minimize

    if states < 4:
        raise DataError(f"{states} states cannot determine I, Q, U and V: use 4 or more")
    if criterion not in _CRITERIA:
        raise DataError(f"no criterion is called {criterion!r}; use one of {', '.join(_CRITERIA)}")
    if starts < 1:
        raise DataError("a search needs one start or more")
    bounds = np.array(limits, dtype=float)
    bounds = np.tile(bounds, (len(axes), 1)) if bounds.shape == (2,) else bounds
    if bounds.shape != (len(axes), 2) or not (bounds[:, 0] < bounds[:, 1]).all():
        raise DataError(
            "limits: give the least and the largest retardance, for all retarders or a pair for each"
        )
    low, high = np.tile(bounds[:, 0], states), np.tile(bounds[:, 1], states)
    box = np.stack([low, high], axis=1)
    rng = np.random.default_rng(seed)
    retarders = _Retarders(axes, analyzer)
    found: list[tuple[float, np.ndarray]] = []
    for _ in range(starts):
        x = rng.uniform(low, high)
        for smooth in _CRITERIA[criterion]:

            def objective(
                x: np.ndarray, smooth: Callable[[np.ndarray], tuple[float, np.ndarray]] = smooth
            ) -> tuple[float, np.ndarray]:
                W, rates = retarders.evaluate(x.reshape(states, -1))
                value, slope = smooth(W.T @ W)
                return value, 2.0 * np.einsum("na,ab,nkb->nk", W, slope, rates).ravel()

            x = minimize(objective, x, jac=True, method="L-BFGS-B", bounds=box, options=_TOLERANCES).x
        W, _ = retarders.evaluate(x.reshape(states, -1))
        found.append((_exact(criterion, W), x))
    best, x = min(found, key=lambda pair: pair[0])
    if not np.isfinite(best):
        degrees = ", ".join(f"{a:g}" for a in np.rad2deg(axes))
        raise DataError(
            f"retarders at {degrees}° before an analyser at {np.rad2deg(analyzer):g}° do not measure the whole Stokes "
            "vector within these limits: add a retarder, turn one, or widen the limits"
        )
    polarimeter = lcvr(x.reshape(states, -1), axes, analyzer)
    agreeing = sum(value - best <= 1e-3 * abs(best) for value, _ in found)
    return BestRetardances(x.reshape(states, -1), polarimeter, merit(polarimeter), starts, agreeing)


class _Retarders:
    """Analyser vectors of retarders whose retardances change, quickly."""

    def __init__(self, axes: Sequence[float], analyzer: float) -> None:
        self._row = diattenuator(analyzer)[0]
        # a retarder is A + B cos δ + C sin δ
        self._parts = []
        for axis in axes:
            constant = 0.5 * (retarder(axis, 0.0) + retarder(axis, np.pi))
            rest = [retarder(axis, delta) - constant for delta in (0.0, 0.5 * np.pi)]
            self._parts.append((constant, np.stack(rest).reshape(2, 16)))

    def evaluate(self, delta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Analyser vectors (N, 4) and their derivatives (N, K, 4) by the retardances of their own state."""
        cos, sin = np.cos(delta), np.sin(delta)
        elements, slopes = [], []
        for k, (constant, rest) in enumerate(self._parts):
            elements.append(constant + (np.stack([cos[:, k], sin[:, k]], axis=1) @ rest).reshape(-1, 4, 4))
            slopes.append((np.stack([-sin[:, k], cos[:, k]], axis=1) @ rest).reshape(-1, 4, 4))
        chain = AnalyzerChain(self._row, elements)
        return chain.vectors, np.stack([chain.element_rate(k, s) for k, s in enumerate(slopes)], axis=1)


def _exact(criterion: str, W: np.ndarray) -> float:
    """The criterion itself, the smaller the better; infinite if the set does not measure everything."""
    singular = np.linalg.svd(W, compute_uv=False)
    if singular[-1] < 1e-4 * singular[0]:
        return np.inf
    if criterion == "determinant":
        return 1.0 / float(singular.prod())
    if criterion == "condition_2":
        return float(singular[0] / singular[-1])
    variance = float((singular**-2.0).sum())
    return (
        variance
        if criterion == "equally_weighted_variance"
        else float(np.sqrt((singular**2).sum() * variance))
    )


def _power(p: int) -> Callable[[np.ndarray], tuple[float, np.ndarray]]:
    """(log tr Gᵖ + log tr G⁻ᵖ)/p and its derivative by G; for p = 1 the log of the squared Frobenius number."""

    def smooth(gram: np.ndarray) -> tuple[float, np.ndarray]:
        values, vectors = _eigen(gram)
        high, low = (values / values[-1]) ** p, (values[0] / values) ** p
        value = (np.log(high.sum()) + np.log(low.sum())) / p + np.log(values[-1] / values[0])
        slope = (high / high.sum() - low / low.sum()) / values
        return value, (vectors * slope) @ vectors.T

    return smooth


def _variance(gram: np.ndarray) -> tuple[float, np.ndarray]:
    values, vectors = _eigen(gram)
    total = (1.0 / values).sum()
    return np.log(total), (vectors * (-(values**-2.0) / total)) @ vectors.T


def _determinant(gram: np.ndarray) -> tuple[float, np.ndarray]:
    values, vectors = _eigen(gram)
    return -np.log(values).sum(), (vectors * (-1.0 / values)) @ vectors.T


def _eigen(gram: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    values, vectors = np.linalg.eigh(gram)
    # keeps the logarithms finite at a set that does not measure everything
    return np.maximum(values, 1e-14), vectors


_CRITERIA: dict[str, tuple[Callable[[np.ndarray], tuple[float, np.ndarray]], ...]] = {
    "equally_weighted_variance": (_variance,),
    "condition_2": tuple(map(_power, _POWERS)),
    "condition_frobenius": (_power(1),),
    "determinant": (_determinant,),
}
