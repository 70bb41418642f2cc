"""What to try next where a fit does not describe its data: only what a quick trial shows to help.

Each candidate (a robust loss, a finite source, an amplitude of its own for each wavelength, another model) is fitted to
a few hundred of the geometries with few starts, and so is the fit as it is. Both predict the same held-out data; what
lowers the error by a fifth or more, to what describes the data at least in part, is suggested, with the numbers.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.inversion.nuisance import Nuisance
from pbrdf.inversion.result import FitResult
from pbrdf.inversion.trials import Clock, Suggestion, some_of, trial, trial_arguments, trial_hold_out
from pbrdf.inversion.verdict import Level, Stratum, percent
from pbrdf.models import MODELS

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["TIME", "suggestions"]

#: Time for all trials, seconds.
TIME = 5.0
#: A suggestion lowers the error of the trial to this share of what it was.
GAIN = 0.8
#: Two together are suggested where the error is this share of what the better one alone leaves.
TOGETHER = 0.9
#: So many suggestions are made.
MOST = 3
#: What lowers the error of the intensity may raise that of the polarisation, and χ², to this share of what it was.
NO_WORSE = 1.1


def suggestions(
    dataset: xr.Dataset,
    result: FitResult,
    fit_arguments: Mapping[str, Any],
    *,
    until: float | None = None,
) -> list[Suggestion]:
    """Ways to fit the same data that predict them better.

    Parameters
    ----------
    dataset, result
        The data and the fit that does not describe them.
    fit_arguments
        Arguments of that fit, as for :func:`pbrdf.fit`.
    until
        When to stop, by :func:`time.monotonic`; None stops after :data:`TIME` seconds. A trial that would not end in
        time, as far as those before it tell, is not begun.

    Returns
    -------
    list of Suggestion
        The most helpful first, :data:`MOST` at most; empty where no trial helped.
    """
    clock = Clock(time.monotonic() + TIME if until is None else until)
    used = some_of(dataset)
    some = dataset.isel(geometry=used)
    held = trial_hold_out(result, some)
    arguments = {**trial_arguments(result, fit_arguments, used), "hold_out": held}
    before = trial(some, clock, **arguments)
    if before is None:
        return []
    found: list[tuple[float, str, dict[str, Any], Suggestion]] = []

    def attempt(option: str, changes: dict[str, Any], needed: float) -> None:
        after = trial(some, clock, **{**arguments, **changes}) if clock.allows() else None
        gain = None if after is None else _gain(before, after)
        if after is not None and gain is not None and gain <= needed:
            suggestion = _suggestion(option, before, after, some.sizes["geometry"], dataset)
            found.append((gain, option, changes, suggestion))

    for option, changes in _candidates(dataset, result, fit_arguments):
        attempt(option, changes, GAIN)
    found.sort(key=lambda one: one[0])
    # the best model may gain once more by the best of what is no model
    models = [one for one in found if "model" in one[2]][:1]
    others = [one for one in found if "model" not in one[2]][:1]
    for (first, option, changes, _), (second, another, more, _) in zip(models, others, strict=False):
        fits = all(name in [p.name for p in changes["model"].parameters] for name in more.get("split", {}))
        if fits:
            attempt(f"{option} {another}", {**changes, **more}, TOGETHER * min(first, second))
    return [one[3] for one in sorted(found, key=lambda one: one[0])[:MOST]]


def _candidates(
    dataset: xr.Dataset, result: FitResult, arguments: Mapping[str, Any]
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Options of the command with the arguments that they change."""
    split = dict(arguments.get("split") or {})
    amplitude = next((p.name for p in result.model.parameters if p.amplitude and p.fitted), None)
    by_wavelength = any(term.split == "wavelength" for term in result.space.terms)
    colours = np.unique(dataset["wavelength"].values) if "wavelength" in dataset.coords else np.empty(0)
    held_colour = result.hold_out is not None and result.hold_out.kind == "wavelength"
    coloured = np.isfinite(colours).sum() > 1 and not by_wavelength and not held_colour
    if amplitude in result.space.names and coloured:
        yield f"--split {amplitude}=wavelength", {"split": {**split, amplitude: "wavelength"}}
    if result.space.loss == "linear":
        yield "--loss cauchy", {"loss": "cauchy"}
    nuisances = list(arguments.get("nuisances") or ())
    kinds = [(Nuisance.parse(n) if isinstance(n, str) else n).kind for n in nuisances]
    if "source" not in kinds:
        yield "--nuisance source", {"nuisances": [*nuisances, "source"]}
    for name, model in MODELS.items():
        if name != result.model.name:
            yield f"--model {name}", _for_model(model, arguments)


def _for_model(model: Any, arguments: Mapping[str, Any]) -> dict[str, Any]:
    """Arguments for another model: what names parameters or options that it does not have is left out."""
    names = [p.name for p in model.parameters]
    changes: dict[str, Any] = {"model": model}
    for what in ("fix", "bounds", "priors", "split"):
        changes[what] = {n: v for n, v in (arguments.get(what) or {}).items() if n in names}
    changes["free"] = [n for n in arguments.get("free") or () if n in names]
    changes["options"] = {"accuracy": "draft"} if "draft" in model.options.get("accuracy", ()) else {}
    return changes


def _whole(result: FitResult, quantity: str) -> Stratum | None:
    """The error over what was held out, or else fitted."""
    own = [s for s in result.verdict().strata if not s.where and s.quantity == quantity]
    return max(own, key=lambda s: s.held_out, default=None)


def _gain(before: FitResult, after: FitResult) -> float | None:
    """Error after in units of the error before, of the quantity that gains most; None where neither does enough."""
    if after.verdict().level == Level.DOES_NOT:
        return None
    same = before.space.loss == after.space.loss
    if same and after.goodness.chi2 > NO_WORSE * before.goodness.chi2:
        return None
    ratio = {}
    for quantity in ("intensity", "polarisation"):
        pair = _whole(before, quantity), _whole(after, quantity)
        if pair[0] is not None and pair[1] is not None and pair[0].error > 0.0:
            ratio[quantity] = pair[1].error / pair[0].error
    if not ratio or not all(math.isfinite(r) for r in ratio.values()):
        return None
    least, worst = min(ratio.values()), max(ratio.values())
    return least if least <= GAIN and worst <= NO_WORSE else None


def _suggestion(
    option: str, before: FitResult, after: FitResult, size: int, dataset: xr.Dataset
) -> Suggestion:
    parts = []
    for quantity, words in (
        ("intensity", "median error of the intensity"),
        ("polarisation", "polarisation's rms error"),
    ):
        pair = _whole(before, quantity), _whole(after, quantity)
        if pair[0] is None or pair[1] is None:
            continue
        seen = "held-out " if pair[0].held_out else ""
        shown = [
            percent(s.error) if quantity == "intensity" else f"{s.error:.2g}" for s in pair if s is not None
        ]
        parts.append(f"{seen}{words} {shown[0]} → {shown[1]}")
    same = before.space.loss == after.space.loss
    chi2 = (before.goodness.chi2, after.goodness.chi2) if same else (math.nan, math.nan)
    if same:
        parts.append(f"χ² {chi2[0]:.4g} → {chi2[1]:.4g}")
    total = dataset.sizes["geometry"]
    of = f"a trial on {size} of {total} geometries" if size < total else "a trial"
    errors = [math.nan if s is None else s.error for s in (_whole(r, "intensity") for r in (before, after))]
    return Suggestion(
        option,
        errors[0],
        errors[1],
        chi2[0],
        chi2[1],
        f"{option}: {', '.join(parts)} ({of}).",
    )
