"""Statements on the parameters: table 1, and what the starts of an inversion agree on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pbrdf.report.numbers import with_error
from pbrdf.reproduction.experiment.sample import Sample
from pbrdf.reproduction.statements.statement import Outcome, listed

__all__ = ["Agreement", "agreement", "polarised_shares", "roughnesses", "starts_agree"]

#: Starts whose χ² exceeds the best by no more than this share (and a trifle, for data without noise) agree with it.
_SAME, _TRIFLE = 1e-4, 1e-6


def roughnesses(sigma: Sequence[float], std: Sequence[float] = ()) -> Outcome:
    """Statement 7: sample 1 is the smoothest, and the thin matte white (2) is smoother than the thick one (3).

    Value: σ of the five samples, as given; their standard errors are only shown.
    """
    passed = sigma[0] < min(sigma[1:]) and sigma[1] < sigma[2]
    return Outcome(tuple(sigma), bool(passed), _shown("σ", sigma, std))


def _shown(symbol: str, values: Sequence[float], std: Sequence[float]) -> str:
    if not std:
        return f"{symbol} = {listed(values, '.4f')}"
    return f"{symbol} = " + ", ".join(with_error(v, s) for v, s in zip(values, std, strict=True))


def polarised_shares(t: Sequence[float], std: Sequence[float] = ()) -> Outcome:
    """Statement 8: the polarised shares of samples 1 and 3 are larger than those of the others.

    Value: t of the five samples, as given; their standard errors are only shown.
    """
    passed = min(t[0], t[2]) > max(t[1], t[3], t[4])
    return Outcome(tuple(t), bool(passed), _shown("t", t, std))


@dataclass(frozen=True)
class Agreement:
    """What the starts of one inversion agree on.

    Attributes
    ----------
    starts, reached
        Number of starts, and of those that ended at the best optimum.
    optima
        Number of distinct optima.
    reached_sigma, missed_sigma
        Largest σ at which a start began that reached the best optimum, smallest of one that did not; NaN without any.
    """

    starts: int
    reached: int
    optima: int
    reached_sigma: float
    missed_sigma: float


def agreement(sample: Sample) -> Agreement:
    """How many starts ended at the best optimum, and where the others began."""
    result = sample.result
    best = float(np.nanmin(result.chi2_by_start))
    reached = result.chi2_by_start <= best * (1.0 + _SAME) + _TRIFLE
    sigma = result.start_values[:, result.space.names.index("sigma")]
    return Agreement(
        starts=result.starts,
        reached=int(reached.sum()),
        optima=len(result.optima),
        reached_sigma=float(sigma[reached].max()),
        missed_sigma=float(sigma[~reached].min()) if not reached.all() else float("nan"),
    )


def starts_agree(samples: Sequence[Sample]) -> Outcome:
    """Statement 25: inversions from many initial values end at the same parameters.

    Every start must end at the best optimum, for every sample. The starts fill the whole range of all parameters.

    Value: the share of starts that do, for each sample.
    """
    found = [agreement(sample) for sample in samples]
    shares = [a.reached / a.starts for a in found]
    text = f"of {found[0].starts} starts {', '.join(str(a.reached) for a in found)}"
    return Outcome(tuple(shares), min(shares) == 1.0, text)
