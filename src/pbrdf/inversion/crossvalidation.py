"""Cross-validation: every measured point predicted by a fit that has not seen it.

The data are divided into folds. For each fold the model is fitted to the others and predicts it. A fold is the
whole data set with the fold's points given no weight, so that all folds have one form and are searched, from all
starts, in a single batch; the best end of each fold is then refined.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.data.schema import with_group
from pbrdf.errors import FitError
from pbrdf.inversion.comparison import compare
from pbrdf.inversion.fit import fit
from pbrdf.inversion.holdout import Prediction, prediction_errors
from pbrdf.inversion.minimise import solve
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.problem import Space, residuals
from pbrdf.inversion.result import FitResult
from pbrdf.inversion.solver import Solution, Status
from pbrdf.inversion.thinning import draw
from pbrdf.models import DoubleGauss, Model

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["SCHEMES", "CrossValidation", "Fold", "cross_validate", "divide"]

#: Ways to divide a data set into folds.
SCHEMES = ("group", "theta_i", "angle", "fraction")
#: Number of folds by angle or fraction, if the user states none.
DEFAULT_FOLDS = 5
#: Starts whose χ² after the search exceeds the best by at most this share reached the same optimum.
SAME_OPTIMUM = 1e-3


@dataclass(frozen=True)
class Fold:
    """One fold: what was left out, and the fit to the rest.

    Attributes
    ----------
    label
        What was left out, in words.
    held_out
        Its geometries, mask of shape (G,).
    values
        Free parameters of the fit to the rest, by name.
    chi2
        Σ (residual/std)² of the fitted rest.
    converged
        Whether the best start ended at a minimum.
    reached
        How many starts reached the best optimum.
    prediction
        Errors of the prediction of what was left out.
    """

    label: str
    held_out: np.ndarray = field(repr=False)
    values: dict[str, float]
    chi2: float
    converged: bool
    reached: int
    prediction: Prediction


@dataclass(frozen=True)
class CrossValidation:
    """Result of :func:`cross_validate`.

    Attributes
    ----------
    by
        How the data were divided.
    folds
        The folds.
    starts
        Starts for each fold.
    prediction
        Errors over all points, each predicted by the fold that left it out.
    fitted
        Errors over the same points of one fit to all of them: what cross-validation corrects.
    score, fitted_score
        Root mean square of (model − measured)/std over all measured values, predicted and fitted. About 1 for a
        right model with known uncertainties; their ratio tells how much the fit flatters itself.
    parameters
        Over ``parameter``: ``value`` of each fold (dimension ``fold`` first), and the ``full`` fit's value; ``mean``
        and ``std`` (ddof = 1) over the folds; ``jackknife``, the standard error √((K−1)/K Σ(value − mean)²) that
        the scatter of K folds of equal size implies; ``standard_error``, the one that the full fit reports. A
        jackknife far above the reported error says that parts of the data disagree about the parameter.
    comparison
        Measured, predicted (named ``_modelled``) and residual values as in :class:`FitResult`, and ``fold``, the
        number of the fold that left the geometry out.
    full
        The fit to all data.
    """

    by: str
    folds: list[Fold]
    starts: int
    prediction: Prediction
    fitted: Prediction
    score: float
    fitted_score: float
    parameters: xr.Dataset
    comparison: xr.Dataset
    full: FitResult = field(repr=False)

    def sentences(self) -> list[str]:
        """What the numbers say, in plain words."""
        worst = max(self.folds, key=lambda f: _badness(f.prediction))
        lines = [
            f"{len(self.folds)} folds by {self.by}: predictions miss {_text(self.prediction)}; the "
            f"fit to all data misses {_text(self.fitted)}.",
            f"In units of the standard uncertainty predictions miss by {self.score:.3g} (root mean square), the fit "
            f"by {self.fitted_score:.3g}.",
            f"Worst predicted: {worst.label}, {_text(worst.prediction)}.",
        ]
        table = self.parameters
        for name in table["parameter"].values:
            row = table.sel(parameter=name)
            jackknife, stated = float(row["jackknife"]), float(row["standard_error"])
            if jackknife > 3.0 * stated:  # False where the fit states none
                found, claimed = (
                    self.full.estimates[name].parameter.shown(x, ".2g") for x in (jackknife, stated)
                )
                lines.append(
                    f"{name} differs between folds more than its standard error allows ({found} against "
                    f"{claimed}): parts of the data disagree about it."
                )
        failed = [f.label for f in self.folds if not f.converged]
        if failed:
            lines.append(f"Not converged: {', '.join(failed)}; try more starts.")
        return lines


def cross_validate(
    dataset: xr.Dataset,
    model: type[Model] | Model | str = DoubleGauss,
    *,
    by: str = "group",
    folds: int | None = None,
    starts: int = 16,
    seed: int = 0,
    max_iterations: int = 100,
    progress: Callable[[int, int], None] | None = None,
    **arguments: Any,
) -> CrossValidation:
    """Predict every part of a data set from the rest.

    One fit to all data states the problem (free parameters, bounds, weights); then all folds are searched in one
    batch, each from the optimum of all data and from the first ``starts`` − 1 starts of that fit. Whatever the
    strategy of that fit, the folds are fitted jointly.

    Parameters
    ----------
    dataset
        Data set of the project's schema.
    model
        As in :func:`pbrdf.fit`.
    by
        ``"group"``: whole groups; ``"theta_i"``: all points of one angle of incidence; ``"angle"``: blocks of
        neighbouring θ_r, counted negative on the source's side (cosφ < 0); ``"fraction"``: equal parts drawn by
        chance. Neighbouring points share what the model gets wrong, so that ``"fraction"`` flatters most and
        ``"group"`` and ``"theta_i"`` least.
    folds
        Number of folds; None takes one for each group or angle of incidence, and 5 by ``"angle"`` and
        ``"fraction"``.
    starts
        Starts for each fold, 1 or more.
    seed
        Seed of the starts and of the division by fraction.
    max_iterations
        Steps per start at most.
    progress
        Called with the number of finished lanes of the batch and of all.
    **arguments
        Passed to :func:`pbrdf.fit` (``fix``, ``bounds``, ``noise``, …) and so valid for every fold; not
        ``hold_out``.

    Returns
    -------
    CrossValidation

    Raises
    ------
    FitError
        If the data cannot be divided so, or a fold leaves too little to fit; and as :func:`pbrdf.fit`.
    """
    if "hold_out" in arguments:
        raise FitError("cross-validation holds every part out in turn: leave hold_out away")
    if by not in SCHEMES:
        raise FitError(f"by={by!r}: choose one of {', '.join(map(repr, SCHEMES))}")
    if starts < 1:
        raise FitError(f"starts={starts}: at least one start is needed")
    if folds is not None and folds < 2:
        raise FitError(f"folds={folds}: at least two folds are needed")
    dataset = with_group(dataset)
    full = fit(dataset, model, starts=starts, seed=seed, max_iterations=max_iterations, **arguments)
    number, labels = divide(dataset, by, folds, seed)
    held = [number == k for k in range(len(labels))]
    data = [_without(full.data, mask) for mask in held]
    for label, masked in zip(labels, data, strict=True):
        if masked.count <= len(full.space.free):
            raise FitError(
                f"without {label} {masked.count} measured values are left, too few for {len(full.space.free)} "
                "parameters: make more folds, or fix parameters"
            )
    solution, reached = _search(full, data, starts, max_iterations, progress)
    for label, cost in zip(labels, solution.cost, strict=True):
        if not math.isfinite(cost):
            raise FitError(f"without {label} no start gave finite residuals: check the data and the bounds")
    return _summarise(dataset, by, full, held, labels, number, solution, reached, starts)


def _search(
    full: FitResult,
    data: list[Observations],
    starts: int,
    max_iterations: int,
    progress: Callable[[int, int], None] | None,
) -> tuple[Solution, np.ndarray]:
    """Best solution of each fold, and how many starts reached it, shape (K,).

    All folds are searched from all starts in one batch with the draft accuracy: lane l is start l % starts of
    fold l // starts. The best end of each is refined with the model's own accuracy. Of many geometries a part is
    searched (:mod:`pbrdf.inversion.thinning`), the same in every fold.
    """
    space = full.space
    low, high = space.box
    part = draw(space, full.data)
    whole, data = data, data if part is None else [part.of(fold) for fold in data]
    begin = np.concatenate([full.unknowns[None], space.to_unknowns(full.start_values)])[:starts]
    search = solve(
        residuals(space, data, starts, accuracy="draft"),
        np.tile(begin, (len(data), 1)),
        low,
        high,
        max_iterations=max_iterations,
        tolerance=1e-6,
        progress=progress,
    )
    cost = np.where(np.isfinite(search.cost), search.cost, np.inf).reshape(len(data), starts)
    reached = (cost <= cost.min(axis=1, keepdims=True) * (1.0 + SAME_OPTIMUM)).sum(axis=1)
    best = np.arange(len(data)) * starts + cost.argmin(axis=1)
    refined = solve(residuals(space, whole), search.u[best], low, high, max_iterations=max_iterations)
    return refined, reached


def _with_labels_filled(
    space: Space, unknowns: np.ndarray, data: Observations, held: np.ndarray
) -> np.ndarray:
    """Give unknowns of groups or wavelengths that were left out whole the mean of the others.

    Nothing in the fold speaks for them; a fit that holds such a group out predicts it in the same way.
    """
    filled = unknowns.copy()
    missing = [t.split is not None and held[getattr(data, t.split) == t.label].all() for t in space.terms]
    for i, term in enumerate(space.terms):
        others = [j for j, o in enumerate(space.terms) if o.role == term.role and not missing[j]]
        if missing[i] and others:
            filled[i] = unknowns[others].mean()
    return filled


def _without(data: Observations, mask: np.ndarray) -> Observations:
    """The same observations, those of a mask given no weight: every fold keeps the form of the whole."""
    return replace(data, std=np.where(mask, np.inf, data.std))


def divide(dataset: xr.Dataset, by: str, folds: int | None, seed: int) -> tuple[np.ndarray, list[str]]:
    """Number of the fold of each geometry, shape (G,), and what each fold leaves out in words.

    Parameters
    ----------
    dataset, by, folds, seed
        As of :func:`cross_validate`.

    Raises
    ------
    FitError
        If the data cannot be divided so.
    """
    if by == "fraction":
        return _parts(dataset.sizes["geometry"], folds or DEFAULT_FOLDS, seed)
    if by == "angle":
        return _blocks(dataset, folds or DEFAULT_FOLDS)
    if by == "theta_i":
        # 0.05° apart, as elsewhere: a set angle is one angle even if its readings differ a little
        keys = np.round(np.rad2deg(dataset["theta_i"].values) * 20.0) / 20.0
        noun, unit = "angle of incidence", "°"
    else:
        keys = dataset["group"].values
        noun, unit = "group", ""
    distinct, member = np.unique(keys, return_inverse=True)
    if len(distinct) < 2:
        raise FitError(f"by={by!r}: the data set has only one {noun}; divide it by 'angle' or 'fraction'")
    count = len(distinct) if folds is None else folds
    if count > len(distinct):
        raise FitError(f"folds={count}: the data set has only {len(distinct)} values of {noun}")
    number = (np.arange(len(distinct)) % count)[member]
    labels = [
        f"{noun} {', '.join(_shown(value) + unit for value in distinct[k::count].tolist())}"
        for k in range(count)
    ]
    return number, labels


def _shown(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _parts(size: int, folds: int, seed: int) -> tuple[np.ndarray, list[str]]:
    if folds > size:
        raise FitError(f"folds={folds}: the data set has only {size} geometries")
    number = np.random.default_rng(seed).permutation(np.arange(size) % folds)
    return number, [f"part {k + 1} of {folds}" for k in range(folds)]


def _blocks(dataset: xr.Dataset, folds: int) -> tuple[np.ndarray, list[str]]:
    """Blocks of neighbouring signed θ_r with about as many points each; equal angles stay together."""
    theta_r, phi = dataset["theta_r"].values, dataset["phi"].values
    signed = np.round(np.rad2deg(np.where(np.cos(phi) < 0.0, -theta_r, theta_r)), 2)
    distinct, member, counts = np.unique(signed, return_inverse=True, return_counts=True)
    middle = np.cumsum(counts) - 0.5 * counts
    block = np.floor(middle * folds / counts.sum()).astype(int)
    # an angle with very many points can swallow a block
    if len(np.unique(block)) < folds:
        raise FitError(f"folds={folds}: {len(distinct)} distinct angles θ_r do not make that many blocks")
    labels = [
        f"θ_r {distinct[block == k].min():.3g}° … {distinct[block == k].max():.3g}°" for k in range(folds)
    ]
    return block[member], labels


def _summarise(
    dataset: xr.Dataset,
    by: str,
    full: FitResult,
    held: list[np.ndarray],
    labels: list[str],
    number: np.ndarray,
    solution: Solution,
    reached: np.ndarray,
    starts: int,
) -> CrossValidation:
    space = full.space
    pooled = full.comparison.copy(deep=True)
    folds, values = [], []
    for k, (label, mask) in enumerate(zip(labels, held, strict=True)):
        unknowns = _with_labels_filled(space, solution.u[k], full.data, mask)
        found = np.clip(space.to_parameters(unknowns), space.lower, space.upper)
        table = compare(space, space.to_unknowns(found), full.data, dataset)
        for name in table.data_vars:
            if name in pooled:
                pooled[name].values[mask] = table[name].values[mask]
        values.append(found)
        folds.append(
            Fold(
                label=label,
                held_out=mask,
                values=dict(zip(space.names, map(float, found), strict=True)),
                chi2=2.0 * float(solution.cost[k]),
                # a stalled lane has found nothing lower however short the step: a minimum but for rounding
                converged=bool(solution.converged[k] or solution.status[k] == Status.STALLED),
                reached=int(reached[k]),
                prediction=prediction_errors(table, mask),
            )
        )
    pooled["fold"] = ("geometry", number)
    pooled["held_out"] = ("geometry", np.ones(len(number), dtype=bool))
    everything = np.ones(len(number), dtype=bool)
    return CrossValidation(
        by=by,
        folds=folds,
        starts=starts,
        prediction=prediction_errors(pooled, everything),
        fitted=prediction_errors(full.comparison, everything),
        score=_score(pooled, full.data),
        fitted_score=_score(full.comparison, full.data),
        parameters=_parameter_table(full, folds, np.array(values)),
        comparison=pooled,
        full=full,
    )


def _score(table: xr.Dataset, data: Observations) -> float:
    """Root mean square of residual/std over the measured values."""
    errors = np.stack([table[f"{c}_residual"].values for c in data.channels]) * data.weights
    return float(np.sqrt(np.mean(errors[np.isfinite(data.std)] ** 2)))


def _parameter_table(full: FitResult, folds: list[Fold], values: np.ndarray) -> xr.Dataset:
    import xarray as xr

    names = full.space.names
    count = len(folds)
    spread = values.std(axis=0, ddof=1)
    return xr.Dataset(
        {
            "value": (("fold", "parameter"), values),
            "full": ("parameter", [full.estimates[n].value for n in names]),
            "mean": ("parameter", values.mean(axis=0)),
            "std": ("parameter", spread),
            "jackknife": ("parameter", spread * (count - 1) / math.sqrt(count)),
            "standard_error": ("parameter", [full.estimates[n].std for n in names]),
        },
        coords={"fold": [f.label for f in folds], "parameter": names},
    )


def _badness(prediction: Prediction) -> float:
    """Error by which folds are ranked: of the intensity, or of DoLP or ratios where only these can be judged."""
    sizes = (prediction.intensity_rms, prediction.dolp_rms, prediction.ratio_rms)
    return next((rms for rms in sizes if math.isfinite(rms)), math.nan)


def _text(prediction: Prediction) -> str:
    parts = []
    if math.isfinite(prediction.intensity_rms):
        parts.append(
            f"the intensity by {prediction.intensity_rms:.2%} rms (median {prediction.intensity_median:.2%}, at most "
            f"{prediction.intensity_max:.2%})"
        )
    if math.isfinite(prediction.dolp_rms):
        parts.append(f"the DoLP by {prediction.dolp_rms:.4f} rms")
    elif math.isfinite(prediction.ratio_rms):
        parts.append(f"the ratios by {prediction.ratio_rms:.4f} rms")
    return ", ".join(parts)
