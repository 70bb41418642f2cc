"""Quick fits to part of the data, by which one way of fitting is compared with another."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.errors import PbrdfError
from pbrdf.inversion.fit import fit
from pbrdf.inversion.holdout import HoldOut
from pbrdf.inversion.result import FitResult

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Clock", "Suggestion", "some_of", "trial", "trial_arguments", "trial_hold_out"]

#: Geometries of a trial at most: enough to tell 10 % from 20 %, few enough for a second.
GEOMETRIES = 240
#: Starts of a trial; the first is the optimum that was found.
STARTS = 3
#: Steps of each start at most.
ITERATIONS = 40


@dataclass(frozen=True)
class Suggestion:
    """Something that a quick trial found better.

    Attributes
    ----------
    option
        What to add to the command, for example ``"--loss cauchy"``.
    before, after
        Median relative error of the intensity in the trial with and without it, held out where something was.
    chi2_before, chi2_after
        χ² of the trial over what was fitted; NaN where the two are not of the same kind.
    sentence
        The same in words.
    """

    option: str
    before: float
    after: float
    chi2_before: float
    chi2_after: float
    sentence: str


class Clock:
    """Time that is left for trials."""

    def __init__(self, until: float) -> None:
        self.until = until
        self._spent: list[float] = []

    def allows(self) -> bool:
        """Whether another trial as long as those so far, in the mean, ends in time."""
        mean = sum(self._spent) / len(self._spent) if self._spent else 0.0
        return time.monotonic() + mean <= self.until

    def measured(self, start: float) -> None:
        """Take note of a trial that began at ``start`` and ends now."""
        self._spent.append(time.monotonic() - start)


def some_of(dataset: xr.Dataset, seed: int = 0, most: int = GEOMETRIES) -> np.ndarray:
    """Geometries of a trial, drawn by chance, ascending: no stride that could fall in step with a grid."""
    size = dataset.sizes["geometry"]
    if size <= most:
        return np.arange(size)
    return np.sort(np.random.default_rng(seed).choice(size, most, replace=False))


def trial_hold_out(result: FitResult, dataset: xr.Dataset) -> HoldOut | None:
    """What a trial predicts: what the fit held out, else the middle angle of incidence or group of three or more."""
    if result.hold_out is not None:
        return result.hold_out
    incidence = np.unique(np.round(np.rad2deg(dataset["theta_i"].values) * 20.0) / 20.0)
    if 3 <= len(incidence) <= 30:
        return HoldOut("theta_i", (f"{incidence[len(incidence) // 2]:g}",))
    groups = np.unique(dataset["group"].values)
    if 3 <= len(groups) <= 30:
        return HoldOut("group", (str(groups[len(groups) // 2]),))
    return None


def trial_arguments(result: FitResult, arguments: Mapping[str, Any], used: np.ndarray) -> dict[str, Any]:
    """Arguments of a trial: those of the fit, from its optimum, with few starts and the draft accuracy."""
    left_out = ("model", "starts", "start", "hold_out", "strategy", "polish", "diffuse_tilt", "progress")
    kept = {name: value for name, value in arguments.items() if name not in left_out}
    if kept.get("covariance") is not None:
        kept["covariance"] = np.asarray(kept["covariance"])[used]
    model = result.model.with_accuracy("draft")
    kept["options"] = dict(model.chosen)
    return {**kept, "model": model, "starts": STARTS, "max_iterations": ITERATIONS}


def trial(dataset: xr.Dataset, clock: Clock, **arguments: Any) -> FitResult | None:
    """A quick fit; None where these data do not allow it."""
    start = time.monotonic()
    try:
        return fit(dataset, **arguments)
    except PbrdfError:
        return None
    finally:
        clock.measured(start)
