"""Several models on the same data: which predicts best what it has not seen, and what each assumption costs.

Every rung of the ladder is fitted to the same data with the same weights and predicts the same geometries that it has
not seen. Rungs are ranked by the score of these predictions (:mod:`pbrdf.inversion.heldout_errors`), its uncertainty
and that of differences from resampled folds, the same for all. The best rungs are tried again with a robust loss and
with a finite source. As the ranking chooses among many by their held-out error, the winner's own is a little too good.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.data.schema import with_group
from pbrdf.data.validation import validate
from pbrdf.errors import FitError, PbrdfError
from pbrdf.inversion.crossvalidation import SCHEMES, cross_validate, divide
from pbrdf.inversion.estimates import Estimate
from pbrdf.inversion.fit import fit
from pbrdf.inversion.heldout_errors import Paired, PointErrors, Resampling, score, units_of
from pbrdf.inversion.holdout import HoldOut
from pbrdf.inversion.ladder import Rung, Step, ladder, with_robust_loss, with_source
from pbrdf.inversion.result import FitResult
from pbrdf.models import Model
from pbrdf.presentation import presenter_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["Comparison", "Contender", "Failure", "compare_models"]

#: Held-out score up to which a model describes the data, and up to which in part: the tolerances of the verdict on a
#: fit for the median error of the intensity.
DESCRIBES, IN_PART = 0.10, 0.50
#: A region fails where its median error is this many times that of all held-out data, and above DESCRIBES.
FAILS = 1.5
#: Angles of incidence from which on data are divided by them, and above which they are no set angles.
_FEWEST_ANGLES, _MOST_ANGLES = 3, 20
#: Folds at most.
_MOST_FOLDS = 8
#: Wavelengths whose amplitudes are fitted apart; more are fitted one after the other.
_MOST_WAVELENGTHS = 8
#: Models that are tried with a robust loss for each that is tried with a source, which takes many times as long.
_ROBUST = 4
#: Starts of a model that is fitted again with something added.
_VARIED_STARTS = 6
#: Uncertainty in per cent below which a difference is one of rounding.
_EXACT = 1e-3
_GRAZING = math.radians(60.0)


@dataclass(frozen=True)
class Contender:
    """A rung that was fitted.

    Attributes
    ----------
    rung
        The model as it was fitted.
    result
        The fit: to what was not held out, or, with folds, to all data.
    errors
        What it misses at the held-out geometries, which are the same for all.
    comparison
        Measured and predicted values of all geometries; only the held-out ones are predictions.
    score, uncertainty
        Score of the predictions, and its standard uncertainty over the units; NaN for a single one.
    behind
        Its score minus the best one's.
    aic, bic
        Information criteria of the fit; NaN for a robust loss, whose sum is no likelihood of the same errors.
    seconds
        Time that it took.
    remarks
        What to know about it, in a few words each.
    """

    rung: Rung
    result: FitResult = field(repr=False)
    errors: PointErrors = field(repr=False)
    comparison: xr.Dataset = field(repr=False)
    score: float
    uncertainty: float
    behind: Paired
    aic: float
    bic: float
    seconds: float
    remarks: tuple[str, ...]

    @property
    def name(self) -> str:
        """Name of the rung."""
        return self.rung.name

    @property
    def free(self) -> int:
        """Number of free parameters."""
        return self.result.goodness.free


@dataclass(frozen=True)
class Failure:
    """A rung that could not be fitted, and why."""

    rung: Rung
    reason: str


@dataclass(frozen=True, repr=False)
class Comparison:
    """Result of :func:`compare_models`.

    Attributes
    ----------
    dataset
        The data set.
    ranking
        The rungs that were fitted, the best prediction first.
    failures
        Those that could not be.
    steps
        The assumptions between them.
    held_out
        Which geometries were predicted, mask of shape (G,).
    by
        In words, how they were held out.
    folds
        Number of the fold of each held-out geometry, shape (N,), and what each fold held out in words.
    units
        In words, what the uncertainties are taken over.
    polarised, with_intensity
        Whether the score contains polarised components and intensities.
    resampling
        The resampled units.
    """

    dataset: xr.Dataset
    ranking: list[Contender]
    failures: list[Failure]
    steps: list[Step]
    held_out: np.ndarray
    by: str
    folds: tuple[np.ndarray, list[str]]
    units: str
    polarised: bool
    with_intensity: bool
    resampling: Resampling = field(repr=False)

    def __repr__(self) -> str:
        return f"<Comparison: {len(self.ranking)} models, {self.best.name} predicts best>"

    def __str__(self) -> str:
        return self.summary().rstrip()

    def _repr_html_(self) -> str:
        return str(presenter_of("comparison").html(self))

    def summary(self) -> str:
        """What ``pbrdf compare`` prints: the verdict, the ranking, what each assumption costs, what failed."""
        return str(presenter_of("comparison").summary(self))

    def plot(self) -> Figure:
        """The held-out error of every model with its uncertainty.

        Returns
        -------
        matplotlib.figure.Figure
            Bound to no window; a notebook shows it, ``savefig`` writes it.
        """
        figure: Figure = presenter_of("comparison").figure(self)
        return figure

    def save(self, folder: str | os.PathLike[str], *, figure_format: str = "png") -> list[Path]:
        """Write the folder of ``pbrdf compare``.

        Parameters
        ----------
        folder
            Made if it is missing; files of other names in it are left alone.
        figure_format
            ``"png"``, ``"pdf"`` or ``"svg"``.

        Returns
        -------
        list of Path
            The files, in the order of their importance to a reader.

        Raises
        ------
        DataError
            If the folder cannot be written.
        PbrdfError
            If the format is not one of them.
        """
        written: list[Path] = presenter_of("comparison").save(self, Path(folder), figure_format)
        return written

    @property
    def best(self) -> Contender:
        """The rung that predicts best."""
        return self.ranking[0]

    def __getitem__(self, name: str) -> Contender:
        """A rung by its name."""
        for contender in self.ranking:
            if contender.name == name:
                return contender
        raise KeyError(name)

    def __contains__(self, name: str) -> bool:
        return any(contender.name == name for contender in self.ranking)

    def paired(self, first: str, second: str) -> Paired:
        """Score of one rung minus that of another, over the same geometries."""
        return self.resampling.paired(self[first].errors, self[second].errors)

    @property
    def leaders(self) -> list[Contender]:
        """The best rung and those that cannot be told apart from it."""
        return [c for c in self.ranking if not c.behind.apart]

    @property
    def score_in_words(self) -> str:
        """What the score is."""
        intensity = "median relative error of the intensity"
        polarised = "rms error of the normalised polarised components"
        if self.polarised and self.with_intensity:
            return f"root of the sum of squares of the {intensity} and the {polarised}"
        return polarised if self.polarised else intensity

    def sentences(self) -> list[str]:
        """What the ranking says, in plain words: the verdict first."""
        return [*self._verdict(), *self._leaders(), *self._steps(), *self._where_it_fails(), self._method()]

    def _verdict(self) -> list[str]:
        best = self.best
        if not best.result.settled:
            return [
                f"The fit of {best.name}, which predicts best, has not converged: its numbers are no result; try more "
                "--starts."
            ]
        missed = f"it misses what it has not seen by {_error(best.score, best.uncertainty)} ({self.score_in_words})"
        if best.score <= DESCRIBES:
            return [f"{best.name} predicts best: {missed}."]
        if best.score <= IN_PART:
            return [
                f"No model of this ladder describes the sample more than in part. The best is {best.name}: {missed}."
            ]
        return [
            f"No model of this ladder describes this sample: do not quote their parameters. The best is {best.name}: "
            f"{missed}."
        ]

    def _leaders(self) -> list[str]:
        leaders = self.leaders
        if len(self.ranking) == 1:
            return []
        if len(leaders) == 1:
            second = self.ranking[1]
            return [
                f"It is told apart from every other: the next, {second.name}, is {_difference(second.behind)} behind."
            ]
        simplest = min(leaders, key=lambda c: (c.free, c.score))
        sentence = (
            f"{len(leaders) - 1} of the other {len(self.ranking) - 1} cannot be told apart from it by these data: "
            f"{', '.join(c.name for c in leaders[1:])}."
        )
        if simplest.name != self.best.name and simplest.free < self.best.free:
            sentence += f" The simplest of them is {simplest.name} with {simplest.free} free parameters."
        return [sentence]

    def _steps(self) -> list[str]:
        lines = []
        for step in self.steps:
            if step.simple not in self or step.rich not in self:
                continue
            paired = self.paired(step.simple, step.rich)
            simple, rich = self[step.simple].score, self[step.rich].score
            change = f"{_per_cent(simple)} with it, {_per_cent(rich)} without"
            if not paired.apart:
                said = f"costs nothing that these data show ({change}; difference {_difference(paired)})"
            elif paired.difference > 0.0:
                said = f"costs {_difference(paired)} of held-out error ({change})"
            else:
                said = f"saves held-out error ({change}; difference {_difference(paired)}): what it frees is misled"
            lines.append(f"The assumption {step.assumption} in {step.rich} {said}.")
        return lines

    def regions(self) -> list[tuple[str, int, float, float]]:
        """Name, number of geometries, median size and median of the intensity's relative error of the best rung.

        Everything that was held out first, then parts of it: each fold, near and off the specular direction, grazing.
        """
        best = self.best
        near = best.comparison["near_specular"].values[self.held_out]
        grazing = (
            np.maximum(self.dataset["theta_i"].values, self.dataset["theta_r"].values)[self.held_out]
            > _GRAZING
        )
        number, labels = self.folds
        parts = [("all that was held out", np.ones(len(near), dtype=bool))]
        if len(labels) > 1:
            parts += [(label, number == k) for k, label in enumerate(labels)]
        parts += [("near the specular direction", near), ("off the specular direction", ~near)]
        parts += [("beyond 60° from the normal", grazing), ("within 60° of the normal", ~grazing)]
        found = []
        for name, chosen in parts:
            errors = best.errors.intensity[chosen]
            errors = errors[~np.isnan(errors)]
            if errors.size:
                found.append(
                    (name, int(errors.size), float(np.median(np.abs(errors))), float(np.median(errors)))
                )
        return found

    def _where_it_fails(self) -> list[str]:
        regions = self.regions()
        if not regions:
            return []
        overall = regions[0][2]
        worst = sorted(
            (r for r in regions[1:] if r[2] > max(FAILS * overall, DESCRIBES)),
            key=lambda r: r[2],
            reverse=True,
        )
        if not worst and overall > DESCRIBES:
            worst = regions[:1]
        if not worst:
            return []
        said = [
            f"{name} ({_per_cent(size)}, the model too {_side(bias)})" for name, _, size, bias in worst[:4]
        ]
        return [f"Where {self.best.name} fails: {'; '.join(said)}."]

    def _method(self) -> str:
        count = int(self.held_out.sum())
        return (
            f"Every model was fitted to the same data with the same weights and predicted the same {count} geometries "
            f"({self.by}); uncertainties are over {self.units}, differences paired. The best of many was chosen by "
            "these predictions, so that its own error is a little too good."
        )


def compare_models(
    dataset: xr.Dataset,
    models: Sequence[str | type[Model] | Model | Rung] | None = None,
    *,
    hold_out: HoldOut | str | None = None,
    by: str | None = None,
    folds: int | None = None,
    vary: int = 2,
    starts: int = 16,
    seed: int = 0,
    max_iterations: int = 100,
    progress: Callable[[str, int, int], None] | None = None,
    **arguments: Any,
) -> Comparison:
    """Fit several models to the same data and rank them by how they predict what they have not seen.

    Parameters
    ----------
    dataset
        Data set of the project's schema. Of several wavelengths each has amplitudes of its own.
    models
        As of :func:`~pbrdf.inversion.ladder.ladder`; None takes every registered model.
    hold_out
        Data left out of every fit and then predicted, for example ``"theta_i=50"``. None divides all data into folds,
        each predicted by fits to the others.
    by, folds
        How to divide them, as of :func:`~pbrdf.inversion.crossvalidation.cross_validate`. None takes the angles of
        incidence where there are 3 to 20, else groups, else blocks of viewing angles; 8 folds at most.
    vary
        How many of the best models, each in its best reading, are fitted again with a finite source; four times as many
        are first fitted again with a robust loss.
    starts
        Starts of each fit, and of each fold.
    seed
        Seed of starts, folds and resampling.
    max_iterations
        Steps per start at most.
    progress
        Called with the name of the rung, the number of finished rungs and of all known so far.
    **arguments
        What all fits share, passed to :func:`pbrdf.fit`: ``noise``, ``objective``, ``covariance``, ``strategy``.

    Returns
    -------
    Comparison

    Raises
    ------
    FitError, DataError, ModelError
        If nothing can be held out so, or no model can be fitted; the message says why.
    """
    validate(dataset)
    dataset = with_group(dataset)
    if isinstance(hold_out, str):
        hold_out = HoldOut.parse(hold_out)
    if hold_out is not None and (by is not None or folds is not None):
        raise FitError("hold_out leaves data out once, by and folds all in turn: give one of the two")
    if by is not None and by not in SCHEMES:
        raise FitError(f"by={by!r}: choose one of {', '.join(map(repr, SCHEMES))}")
    if starts < 1:
        raise FitError(f"starts={starts}: at least one start is needed")
    if vary < 0:
        raise FitError(f"vary={vary}: a number of models, 0 for none")
    splits = _by_wavelength(dataset)
    first = ladder(models)
    plan = _Plan.of(dataset, hold_out, by, folds, seed, starts, max_iterations, arguments, splits)
    fitted: list[_Fitted] = []
    failures: list[Failure] = []
    classes = len({rung.cls for rung in first.rungs})
    stages = ((with_robust_loss, min(_ROBUST * vary, classes)), (with_source, min(vary, classes)))
    total = len(first.rungs) + sum(count for _, count in stages)
    _run(plan, first.rungs, fitted, failures, total, progress)
    if not fitted:
        reasons = "; ".join(dict.fromkeys(f.reason for f in failures))
        raise FitError(f"no model could be fitted: {reasons}")
    steps = list(first.steps)
    fewer = replace(plan, starts=min(starts, _VARIED_STARTS))
    for vary_rung, count in stages:
        for best in _best_of_each(fitted)[:count]:
            # from where the fit without it ended: few other starts are needed
            varied = vary_rung(replace(best.rung, model=best.result.model, options={}))
            if varied is not None:
                _run(fewer, varied[:1], fitted, failures, total, progress)
                steps.append(varied[1])
    if progress is not None:
        progress("done", total, total)
    return _ranked(plan, fitted, failures, steps)


@dataclass(frozen=True)
class _Plan:
    """What is the same for every rung."""

    dataset: xr.Dataset
    hold_out: HoldOut | None
    by: str | None
    count: int | None
    held_out: np.ndarray
    fold: np.ndarray
    labels: list[str]
    seed: int
    starts: int
    max_iterations: int
    arguments: dict[str, Any]
    split_amplitudes: bool

    @classmethod
    def of(
        cls,
        dataset: xr.Dataset,
        hold_out: HoldOut | None,
        by: str | None,
        folds: int | None,
        seed: int,
        starts: int,
        max_iterations: int,
        arguments: dict[str, Any],
        split_amplitudes: bool,
    ) -> _Plan:
        size = dataset.sizes["geometry"]
        held = np.ones(size, dtype=bool)
        if hold_out is not None:
            held = hold_out.mask(dataset, seed)
            fold, labels = _parts_of(dataset, hold_out, held)
        else:
            if by is None:
                by, distinct = _scheme(dataset)
                folds = folds or (None if distinct <= _MOST_FOLDS else _MOST_FOLDS)
            number, labels = divide(dataset, by, folds, seed)
            fold = number
        return cls(
            dataset,
            hold_out,
            by,
            folds,
            held,
            fold,
            labels,
            seed,
            starts,
            max_iterations,
            arguments,
            split_amplitudes,
        )

    def fit(self, rung: Rung) -> tuple[FitResult, xr.Dataset, list[str]]:
        """The fit of a rung, measured beside predicted values, and the folds that did not converge."""
        amplitudes = [
            p.name for p in rung.cls.parameters if p.amplitude and p.fitted and p.name not in rung.fix
        ]
        shared: dict[str, Any] = {
            "options": dict(rung.options),
            "fix": dict(rung.fix),
            "nuisances": rung.nuisances,
            "loss": rung.loss,
            "split": dict.fromkeys(amplitudes, "wavelength") if self.split_amplitudes else {},
            "starts": self.starts,
            "seed": self.seed,
            "max_iterations": self.max_iterations,
            **self.arguments,
        }
        if self.hold_out is not None:
            result = fit(self.dataset, rung.model, hold_out=self.hold_out, **shared)
            return result, result.comparison, []
        assert self.by is not None
        validated = cross_validate(self.dataset, rung.model, by=self.by, folds=self.count, **shared)
        bad = [fold.label for fold in validated.folds if not fold.converged]
        return validated.full, validated.comparison, bad


@dataclass(frozen=True)
class _Fitted:
    rung: Rung
    result: FitResult
    comparison: xr.Dataset
    errors: PointErrors
    bad_folds: list[str]
    seconds: float


def _run(
    plan: _Plan,
    rungs: Sequence[Rung],
    fitted: list[_Fitted],
    failures: list[Failure],
    total: int,
    progress: Callable[[str, int, int], None] | None,
) -> None:
    for rung in rungs:
        if progress is not None:
            progress(rung.name, len(fitted) + len(failures), total)
        clock = time.perf_counter()
        # whatever is wrong with one model, a user's own among them, the others must be compared
        try:
            result, comparison, bad = plan.fit(rung)
        except Exception as error:
            failures.append(Failure(rung, _reason(error)))
            continue
        errors = PointErrors.of(comparison, result.data.channels, plan.held_out)
        fitted.append(_Fitted(rung, result, comparison, errors, bad, time.perf_counter() - clock))


def _best_of_each(fitted: Sequence[_Fitted]) -> list[_Fitted]:
    """The best rung of each model, the best model first: readings and ablations of one are much alike."""
    best: dict[type[Model], _Fitted] = {}
    for one in sorted(fitted, key=lambda f: score(f.errors)):
        best.setdefault(one.rung.cls, one)
    return list(best.values())


def _reason(error: BaseException) -> str:
    """What went wrong first: Dr.Jit wraps what a kernel raises."""
    while error.__cause__ is not None:
        error = error.__cause__
    return str(error) if isinstance(error, PbrdfError) else f"{type(error).__name__}: {error}"


def _ranked(plan: _Plan, fitted: list[_Fitted], failures: list[Failure], steps: list[Step]) -> Comparison:
    ds, held = plan.dataset, plan.held_out
    angles = [ds[name].values[held] for name in ("theta_i", "theta_r", "phi")]
    unit, words = units_of(plan.fold, *angles)
    resampling = Resampling(unit, plan.seed)
    resampled = [resampling.scores(f.errors) for f in fitted]
    scores = [score(f.errors) for f in fitted]
    order = sorted(range(len(fitted)), key=lambda i: (math.isnan(scores[i]), scores[i]))
    lead = order[0]
    ranking = []
    for i in order:
        f = fitted[i]
        behind = resampling.paired(f.errors, fitted[lead].errors, (resampled[i], resampled[lead]))
        robust = f.rung.loss != "linear"
        ranking.append(
            Contender(
                rung=f.rung,
                result=f.result,
                errors=f.errors,
                comparison=f.comparison,
                score=scores[i],
                uncertainty=resampling.uncertainty(resampled[i]),
                behind=behind,
                aic=math.nan if robust else f.result.goodness.aic,
                bic=math.nan if robust else f.result.goodness.bic,
                seconds=f.seconds,
                remarks=tuple(_remarks(f, i == lead, behind)),
            )
        )
    errors = fitted[lead].errors
    if plan.hold_out is not None:
        by = f"{plan.hold_out} held out"
    else:
        by = f"{len(plan.labels)} folds by {plan.by}, each predicted from the others"
    return Comparison(
        dataset=ds,
        ranking=ranking,
        failures=failures,
        steps=steps,
        held_out=held,
        by=by,
        folds=(plan.fold, plan.labels),
        units=words,
        polarised=bool((~np.isnan(errors.polarised)).any()),
        with_intensity=bool((~np.isnan(errors.intensity)).any()),
        resampling=resampling,
    )


def _remarks(f: _Fitted, leads: bool, behind: Paired) -> list[str]:
    remarks = []
    if leads:
        remarks.append("best")
    elif not behind.apart:
        remarks.append("not told apart")
    if not f.result.settled:
        remarks.append("not converged")
    if f.bad_folds:
        remarks.append(f"not converged without {', '.join(f.bad_folds)}")
    on_bounds = [name for name, e in f.result.estimates.items() if _on_bound(e)]
    if on_bounds:
        remarks.append(f"on a bound: {', '.join(on_bounds)}")
    return remarks


def _on_bound(estimate: Estimate) -> bool:
    return "bound" in estimate.verdict


def _scheme(dataset: xr.Dataset) -> tuple[str, int]:
    """How data are divided if the user does not say, and into how many parts they fall."""
    angles = len(np.unique(np.round(np.rad2deg(dataset["theta_i"].values) * 20.0)))
    groups = len(np.unique(dataset["group"].values))
    if _FEWEST_ANGLES <= angles <= _MOST_ANGLES:
        return "theta_i", angles
    if groups >= _FEWEST_ANGLES:
        return "group", groups
    return "angle", 5


def _parts_of(dataset: xr.Dataset, hold_out: HoldOut, held: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """The values that were held out, each a fold of its own."""
    if hold_out.kind == "fraction":
        return np.zeros(int(held.sum()), dtype=int), [str(hold_out)]
    fold = np.zeros(int(held.sum()), dtype=int)
    labels = []
    remaining = np.ones(len(fold), dtype=bool)
    for k, value in enumerate(hold_out.values):
        one = HoldOut(hold_out.kind, (value,))
        here = one.mask(dataset)[held] & remaining
        fold[here] = k
        remaining &= ~here
        labels.append(str(one))
    return fold, labels


def _by_wavelength(dataset: xr.Dataset) -> bool:
    """Whether amplitudes are fitted for each wavelength apart."""
    if "wavelength" not in dataset.coords:
        return False
    count = len(np.unique(dataset["wavelength"].values))
    if count > _MOST_WAVELENGTHS:
        raise FitError(
            f"the data hold {count} wavelengths, each with an amplitude of its own: compare at most "
            f"{_MOST_WAVELENGTHS} at once, for example with --wavelength 550"
        )
    return count > 1


def _side(bias: float) -> str:
    return "bright" if bias > 0.0 else "dark"


def _per_cent(share: float) -> str:
    """A share as per cent with two significant digits."""
    return f"{100.0 * share:.2g} %" if share < 0.0995 else f"{100.0 * share:.0f} %"


def _error(value: float, uncertainty: float) -> str:
    if not math.isfinite(value):
        return "∞"
    if not (math.isfinite(uncertainty) and 100.0 * uncertainty > _EXACT):
        return _per_cent(value)
    digits = max(0, 1 - math.floor(math.log10(100.0 * uncertainty)))
    digits = min(digits, 4)
    return f"({100.0 * value:.{digits}f} ± {100.0 * uncertainty:.{digits}f}) %"


def _difference(paired: Paired) -> str:
    """A difference with its standard uncertainty and its interval."""
    text = _error(paired.difference, paired.uncertainty)
    if not (math.isfinite(paired.lower) and 100.0 * paired.uncertainty > _EXACT):
        return text
    ends = " … ".join(f"{float(f'{100.0 * end:.2g}'):g}" for end in (paired.lower, paired.upper))
    return f"{text} [95 %: {ends}]".replace("-", "−")
