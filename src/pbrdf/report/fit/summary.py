"""What a fit found, for a person: tables and sentences."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.data.schema import written
from pbrdf.inversion.comparison import NEAR_SPECULAR, near_specular_tilt
from pbrdf.inversion.estimates import Estimate
from pbrdf.inversion.result import FitResult
from pbrdf.inversion.verdict import Verdict
from pbrdf.models.parameters import shown_unit
from pbrdf.report.dataset.describe import (
    cautions,
    columns_in_words,
    illumination_in_words,
    wavelengths_in_words,
)
from pbrdf.report.fit.subject import Report
from pbrdf.report.numbers import brief, per_cent, with_error
from pbrdf.report.printing import bare_table, print_parts, printing_console

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.table import Table

    from pbrdf.report.fit.checks import Checks

__all__ = [
    "correlation_in_words",
    "goodness_in_words",
    "optima_in_words",
    "print_summary",
    "summary_text",
    "value_in_words",
    "verdict_in_words",
]

#: Correlation from which on two parameters are named as a pair.
STRONG = 0.9
#: A standard error of this share of the value no longer determines it well.
_POOR = 0.3
#: Deviation of χ² from its expectation, in standard deviations, that is called a coincidence.
_COINCIDENCE = 3.0
#: Reduced χ² of data without noise, simulated with the model itself.
_EXACT = 1e-12
#: Root mean square of measured values, in standard uncertainties, up to which they are noise.
_NO_SIGNAL = 1.5

#: Ratio of the rms to the median of relative errors from which on a few geometries make up the rms.
_DARK_DOMINATES = 10.0
#: Relative rms from which on that is worth a remark.
_LARGE = 0.5
#: Width of the console below which the meaning of the parameters is left out.
_NARROW = 100

_TEXT_WIDTH = 110
_NOTHING_HELD_OUT = (
    "nothing, so that no prediction was tested: try --hold-out theta_i=… or --cross-validate theta_i"
)


def summary_text(report: Report, *, verbose: bool = False) -> str:
    """The summary as plain text, for a file."""
    console = printing_console(file=io.StringIO(), width=_TEXT_WIDTH, color_system=None, force_terminal=False)
    print_summary(report, console, verbose=verbose)
    return "\n".join(line.rstrip() for line in console.file.getvalue().splitlines()) + "\n"  # type: ignore[attr-defined]


def print_summary(report: Report, console: Console, *, verbose: bool = False) -> None:
    """Print what the fit is worth, how well it predicts and fits, the parameters, and what to know about them.

    Parameters
    ----------
    report
        What is reported on.
    console
        Where to.
    verbose
        Also the full correlation matrix.
    """
    print_parts(_parts(report, verbose, wide=console.width >= _NARROW), console)


def _parts(report: Report, verbose: bool, wide: bool) -> Iterator[RenderableType]:
    from rich.text import Text

    result = report.result
    verdict = result.verdict()
    yield _headed([("Verdict", [verdict.sentence]), ("", verdict.reasons)])
    yield ""
    if not result.predicted:
        yield _headed([("Held out", [_NOTHING_HELD_OUT])])
        yield ""
    yield _error_table(result)
    yield Text("; ".join(_remarks_on_errors(result)), style="italic")
    yield ""
    yield _parameter_table(result, wide, verdict)
    yield ""
    if report.checks is not None and (advice := report.checks.advice()):
        yield _headed([("Try next" if i == 0 else "", [line]) for i, line in enumerate(advice)])
        yield ""
    yield _headed(_heading(report))
    yield ""
    sections = [
        ("Correlation", correlation_in_words(result)),
        ("Goodness", goodness_in_words(result)),
        ("Optima", optima_in_words(result)),
    ]
    yield _headed(sections)
    if verbose and result.correlation.size:
        yield ""
        yield _correlation_table(result)
    if report.checks is not None:
        yield from _check_parts(report.checks, result, verbose)
    notes = [*result.notes, *cautions(report.dataset)]
    if notes:
        yield ""
        yield _headed([("Notes" if i == 0 else "", [note]) for i, note in enumerate(notes)])


def _check_parts(checks: Checks, result: FitResult, verbose: bool) -> Iterator[RenderableType]:
    """Findings beyond the fit: what was objected to, and with ``verbose`` all that was looked at."""
    objections = [f.sentence for f in checks.plausibility if verbose or f.severity != "ok"]
    sections = [
        ("Plausible?", objections or ["nothing to object: energy, realisability, parameters, lobe, range"]),
        ("Determined", list(checks.identifiability.sentences)),
    ]
    errors = checks.errors.sentences()
    sections.append(("Residuals", errors if verbose else [errors[0], errors[-1]]))
    if checks.cross_validation is not None:
        sections.append(("Folds", checks.cross_validation.sentences()))
    yield ""
    yield _headed(
        [(head if i == 0 else "", [line]) for head, lines in sections for i, line in enumerate(lines)]
    )
    if checks.profile is not None or checks.bootstrap is not None:
        yield ""
        yield _interval_table(checks, result)
        notes = [
            *(checks.profile.notes if checks.profile else ()),
            *(checks.bootstrap.notes if checks.bootstrap else ()),
        ]
        if notes:
            yield _headed([("Intervals" if i == 0 else "", [note]) for i, note in enumerate(notes)])
    regions = [f"{c.a}, {c.b}: {note}" for c in checks.contours for note in c.notes]
    if regions:
        yield ""
        yield _headed([("Contours" if i == 0 else "", [note]) for i, note in enumerate(regions)])


def _interval_table(checks: Checks, result: FitResult) -> Table:
    """Intervals of the free parameters by every method that was used."""
    table = bare_table()
    table.add_column("parameter")
    table.add_column("± 1.96 standard errors")
    if checks.profile is not None:
        table.add_column(f"profile, {checks.profile.level:.0%}")
    if checks.bootstrap is not None:
        table.add_column(f"bootstrap, {checks.bootstrap.level:.0%}")
    for name, estimate in result.estimates.items():
        if estimate.verdict == "fixed":
            continue
        factor, _ = shown_unit(estimate.parameter)
        spread = 1.96 * estimate.std
        cells = [
            "" if math.isnan(spread) else _interval(factor, estimate.value - spread, estimate.value + spread)
        ]
        if checks.profile is not None:
            found = checks.profile.intervals.get(name)
            cells.append("" if found is None else _interval(factor, found.lower, found.upper))
        if checks.bootstrap is not None:
            ends = checks.bootstrap.percentiles.sel(parameter=name).values
            cells.append(_interval(factor, float(ends[0]), float(ends[1])))
        table.add_row(name, *cells)
    return table


def _interval(factor: float, lower: float, upper: float) -> str:
    width = abs(upper - lower) * factor
    digits = 4 if width == 0.0 else max(0, 1 - math.floor(math.log10(width)))
    return f"{factor * lower:.{digits}f} … {factor * upper:.{digits}f}".replace("-", "−")


def _heading(report: Report) -> list[tuple[str, list[str]]]:
    result, ds = report.result, report.dataset
    held = int(result.comparison["held_out"].values.sum())
    total = ds.sizes["geometry"]
    model = result.model
    options = [f"{k}={v}" for k, v in model.chosen.items() if v != model.options[k][0]]
    title = ds.attrs.get("title")
    count = f"{total - held} of {total} geometries" if held else f"{total} geometries"
    fitted = result.data
    missing = fitted.std.size - fitted.count - fitted.unstated
    left_out = f" ({missing} more are NaN and left out)" if missing else ""
    data = (
        f"{count}, {result.goodness.data} measured values of {_channels(result)}{left_out}; "
        f"{wavelengths_in_words(ds)}, {illumination_in_words(ds)}"
    )
    rows = [
        ("Fitted to", [report.name + (f" ({title})" if title and title != report.name else "")]),
        ("Model", [", ".join([model.name, *options])]),
        ("Data", [data + ("; simulated, not measured" if ds.attrs.get("simulated") else "")]),
        ("Noise", [result.noise]),
    ]
    if reading := report.settings.get("reading"):
        rows.insert(1, ("Read with", [", ".join(_options_in_words(reading))]))
    if columns := columns_in_words(ds):
        rows.insert(1, ("Columns", columns))
    if len(result.stages) > 1:
        rows.append(("Steps", [", then ".join(f"{s.name} ({s.points} geometries)" for s in result.stages)]))
    if result.hold_out is not None:
        rows.append(("Held out", [f"{result.hold_out}: {held} geometries"]))
    return rows


def _options_in_words(options: Mapping[str, Any]) -> Iterator[str]:
    for name, value in options.items():
        for one in value if isinstance(value, list) else [value]:
            yield name.replace("_", " ") + ("" if one is True else f" {one}")


def _channels(result: FitResult) -> str:
    names = list(result.goodness.r_squared)
    if names[0].startswith("m") and len(names) == 16:
        return "all 16 Mueller elements"
    ratios = [name for name in names if name.endswith("_over_m00")]
    if len(ratios) == 15:
        names = [name for name in names if name not in ratios]
        return ", ".join([*names, "all 15 Mueller elements over m00"])
    return ", ".join("DoLP" if name == "dolp" else written(name) for name in names)


def _headed(rows: list[tuple[str, list[str]]]) -> Table:
    """Lines of text, each block with a word in the margin."""
    from rich.text import Text

    table = bare_table(header=False)
    table.add_column(no_wrap=True, style="bold", width=11)
    table.add_column(overflow="fold")
    for head, lines in rows:
        for i, line in enumerate(lines):
            table.add_row(head if i == 0 else "", Text(line))
    return table


def _parameter_table(result: FitResult, wide: bool, of: Verdict) -> Table:
    from rich.text import Text

    table = bare_table()
    table.add_column("parameter", no_wrap=True)
    if wide:
        table.add_column("meaning", overflow="fold", min_width=24)
    table.add_column("value ± standard error", no_wrap=True)
    table.add_column("unit")
    table.add_column("bounds", no_wrap=True)
    table.add_column("verdict", overflow="fold")
    for e in result.estimates.values():
        p = e.parameter
        factor, unit = shown_unit(p)
        label = p.name if p.symbol == p.name else f"{p.symbol} ({p.name})"
        limits = (
            "" if e.verdict == "fixed" else f"{brief(factor * e.lower, 3)} … {brief(factor * e.upper, 3)}"
        )
        meaning = [p.description.partition(",")[0]] if wide else []
        style = {"determined": "green", "fixed": "dim"}.get(e.verdict, "yellow")
        described = of.level.usable
        verdict = Text(verdict_in_words(e, described=described), style=style if described else "yellow")
        table.add_row(label, *meaning, value_in_words(e), unit, limits, verdict)
    return table


def value_in_words(estimate: Estimate) -> str:
    """A value with its standard error, in the unit that people see; in brackets where the data do not determine it."""
    e = estimate
    factor, _ = shown_unit(e.parameter)
    if e.verdict == "undetermined":
        return f"({brief(factor * e.value, 3)})"
    if e.verdict == "fixed" and e.lower < e.upper:
        return f"{brief(factor * e.lower)} … {brief(factor * e.upper)}"
    return with_error(factor * e.value, factor * e.std)


def verdict_in_words(estimate: Estimate, *, described: bool = True) -> str:
    """What the data say about one parameter, for example ``determined to 0.4 %``.

    Parameters
    ----------
    estimate
        The parameter.
    described
        Whether the model describes the data; if not, nothing is determined.
    """
    if estimate.verdict == "undetermined":
        return "not determined by these data"
    if estimate.verdict.startswith("at "):
        return f"at its {estimate.verdict.removeprefix('at ')}"
    if estimate.verdict == "fixed" and estimate.lower < estimate.upper:
        return "fixed at each wavelength"
    if estimate.verdict in ("fixed", "not converged"):
        return estimate.verdict
    if not described:
        return "do not quote"
    share = estimate.std / abs(estimate.value) if estimate.value else math.inf
    # A parameter that may have either sign is not known "to 300 %" when it is near 0.
    if estimate.lower < 0.0 < estimate.upper:
        factor, unit = shown_unit(estimate.parameter)
        return f"determined to ±{brief(factor * estimate.std, 2)}{unit if unit == '°' else ''}"
    return f"{'poorly determined, to' if share > _POOR else 'determined to'} {per_cent(share)}"


def correlation_in_words(result: FitResult) -> list[str]:
    """One sentence per pair of parameters that the data hardly tell apart."""
    matrix, names = result.correlation.values, [str(n) for n in result.correlation["parameter"].values]
    lines = []
    for i, j in zip(*np.triu_indices(len(names), 1), strict=True):
        r = float(matrix[i, j])
        if abs(r) > STRONG:
            how = "raising both together" if r > 0.0 else "raising one and lowering the other"
            lines.append(f"{names[i]} and {names[j]} (r = {brief(r, 2)}): {how} hardly changes the fit")
    if lines:
        return lines
    if len(names) < 2:
        return ["fewer than two parameters have a standard error"]
    return [f"no pair of parameters is strongly correlated (all |r| ≤ {STRONG:g})"]


def goodness_in_words(result: FitResult) -> list[str]:
    """Reduced χ² and what it means, R² by channel, information criteria."""
    g = result.goodness
    freedom = g.data - g.free
    lines = []
    if freedom > 0:
        reduced = g.reduced_chi2
        lines.append(
            f"reduced χ² = {brief(reduced, 3)} ({freedom} degrees of freedom): {_chi2_verdict(result)}"
        )
    else:
        lines.append("no degrees of freedom: there are as many parameters as values")
    without_signal = [name for name in g.r_squared if _is_noise(result, name)]
    r_squared = {name: value for name, value in g.r_squared.items() if name not in without_signal}
    if r_squared:
        lines.append(
            "R²: " + ", ".join(f"{written(name)} {_r_squared(value)}" for name, value in r_squared.items())
        )
    if without_signal:
        lines.append(f"within their noise of 0, so without an R²: {', '.join(map(written, without_signal))}")
    lines.append(
        f"AIC {brief(g.aic, 5)}, BIC {brief(g.bic, 5)} (lower is better, among models of the same data)"
    )
    return lines


def _chi2_verdict(result: FitResult) -> str:
    reduced = result.goodness.reduced_chi2
    residuals = f"the residuals are {brief(math.sqrt(reduced), 2)} times"
    if reduced < _EXACT:
        return "the model reproduces the data exactly"
    if not result.std_known:
        return (
            f"relative only, as the data state no uncertainty; {residuals} the noise named above, and the "
            "standard errors are scaled by that"
        )
    tolerance = _COINCIDENCE * math.sqrt(2.0 / (result.goodness.data - result.goodness.free))
    if reduced > 1.0 + tolerance:
        return f"{residuals} the stated noise: the model misses something, or the noise is understated"
    if reduced < 1.0 - tolerance:
        return f"{residuals} the stated noise: the noise is overstated"
    return "consistent with the stated noise"


def _is_noise(result: FitResult, channel: str) -> bool:
    """Whether the measured values of a channel, by their uncertainty, could all be 0."""
    kept = ~result.comparison["held_out"].values
    ratio = (
        result.comparison[f"{channel}_measured"].values[kept]
        / result.comparison[f"{channel}_std"].values[kept]
    )
    ratio = ratio[np.isfinite(ratio)]
    return bool(ratio.size) and float(np.sqrt((ratio**2).mean())) < _NO_SIGNAL


def _r_squared(value: float) -> str:
    """Enough digits that 0.99998 does not become 1."""
    if not math.isfinite(value) or value < 0.9:
        return brief(value, 2)
    digits = 2 if value == 1.0 else max(2, min(2 - math.floor(math.log10(1.0 - value)) - 1, 8))
    return f"{value:.{digits}f}"


def optima_in_words(result: FitResult) -> list[str]:
    """How many starts reached the best optimum, and what the next best is."""
    alone = result.starts == 1
    if not result.optima:
        return ["the only start has not converged" if alone else f"none of {result.starts} starts converged"]
    best, *others = result.optima
    lines = [f"{best.count} of {result.starts} starts reached the best optimum (χ² = {brief(best.chi2)})"]
    if alone:
        ended = "reached an optimum" if result.settled else "has not converged"
        lines = [f"the only start {ended} (χ² = {brief(best.chi2)})"]
    elif not result.settled:
        lines = [f"the best of {result.starts} starts (χ² = {brief(best.chi2)}) has not converged"]
    if others:
        second = others[0]
        times = second.chi2 / best.chi2 if best.chi2 > 0.0 else math.inf
        worse = (
            f"{brief(times, 3)} times the χ²"
            if times >= 1.01
            else f"χ² higher by {brief(second.chi2 - best.chi2, 2)}"
        )
        values = ", ".join(f"{name} {brief(value, 3)}" for name, value in second.values.items())
        lines.append(
            f"the next best has {worse} ({second.count} start{'s' if second.count > 1 else ''}): {values}"
        )
    elif not alone:
        lines.append("no other optimum was found")
    if (missed := result.starts - result.converged) and not alone:
        lines.append(f"{missed} start{'s' if missed > 1 else ''} did not converge")
    return lines


def _correlation_table(result: FitResult) -> Table:
    names = [str(n) for n in result.correlation["parameter"].values]
    table = bare_table()
    table.add_column("correlation")
    for name in names:
        table.add_column(name, justify="right")
    for name, row in zip(names, result.correlation.values, strict=True):
        table.add_row(name, *(f"{r:+.3f}".replace("-", "−") for r in row))
    return table


def _error_table(result: FitResult) -> Table:
    """Errors model − measured by region, of what was fitted and of what was predicted."""
    everywhere = (*result.fitted.values(), *result.predicted.values())
    intensity = any(math.isfinite(p.intensity_rms) for p in everywhere)
    polarised = any(math.isfinite(p.dolp_rms) for p in everywhere)
    ratios = any(math.isfinite(p.ratio_rms) for p in everywhere)
    table = bare_table()
    table.add_column("errors,\nmodel − measured", no_wrap=True)
    table.add_column("\nnumber", justify="right")
    heads = ["intensity\nmedian", "\nrms", "\nlargest"] if intensity else []
    heads += ["DoLP\nrms", "\nlargest"] if polarised else []
    heads += ["ratios\nrms", "\nlargest"] if ratios else []
    for head in heads:
        table.add_column(head, justify="right")
    for what, regions in (("predicted", result.predicted), ("fitted", result.fitted)):
        for region, p in regions.items():
            cells = []
            if intensity:
                cells += [per_cent(p.intensity_median), per_cent(p.intensity_rms), per_cent(p.intensity_max)]
            if polarised:
                cells += [_dolp(p.dolp_rms), _dolp(p.dolp_max)]
            if ratios:
                cells += [_dolp(p.ratio_rms), _dolp(p.ratio_max)]
            style = "bold" if what == "predicted" else None
            table.add_row(f"{what}, {region}", str(p.count), *cells, style=style)
    return table


def _dolp(error: float) -> str:
    return f"{error:.4f}" if error >= 1e-4 else brief(error, 2)


def _remarks_on_errors(result: FitResult) -> list[str]:
    tilt = near_specular_tilt(result.model)
    in_sigma = math.tan(tilt) / float(result.model.lobe_width())
    width = f"{NEAR_SPECULAR:g} σ = " if in_sigma > NEAR_SPECULAR - 1e-6 else ""
    remarks = [
        f"near-specular: the mirroring facet is tilted by less than {width}{brief(math.degrees(tilt), 2)}°"
    ]
    errors = [*result.fitted.values(), *result.predicted.values()]
    if any(p.intensity_rms > max(_DARK_DOMINATES * p.intensity_median, _LARGE) for p in errors):
        remarks.append("a few dark geometries rule the relative rms: trust the median")
    return remarks
