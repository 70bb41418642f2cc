"""What a fit is worth, in a sentence, by stated criteria (``docs/validation.md``).

The question is whether the fitted model is a *useful description* of what was measured, not whether its residuals are
noise: with uncertainties of 1 % a description to 5 % has a reduced χ² of 25 and is a good one. An error is therefore
judged against a tolerance first, and excused where it is no more than twice the stated uncertainty. Judged are the
fitted and the held-out data as a whole, and strata: near and off the mirror direction, the brightest tenth, every angle
of incidence, wavelength and group; intensity and polarisation apart.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from pbrdf.data.schema import is_ratio
from pbrdf.inversion.erroranalysis import SIGNIFICANCE, sign_test
from pbrdf.inversion.estimates import Estimate
from pbrdf.inversion.optimum import Optimum
from pbrdf.inversion.statistics import dark_below, relative_errors
from pbrdf.wording import joined

__all__ = ["Level", "Stratum", "Verdict", "percent", "quotable", "verdict"]

#: Median error of the intensity over all data up to which they are described: the uncertainty of a careful
#: goniometer is 2 to 5 %, so this is two to five times what was known of the sample.
TOLERANCE = 0.10
#: The same for one stratum, which holds fewer points and may be the worst of many: twice as much.
STRATUM_TOLERANCE = 0.20
#: Median signed error of a stratum that counts even where the scatter is allowed, if chance does not explain it.
BIAS_TOLERANCE = 0.10
#: Median error beyond which the numbers of the fit are not those of the sample: half of the signal is missed.
HOPELESS = 0.50
#: RMS error of the polarisation (channels over intensity) that is always allowed: twice the 1 % that the imaging
#: polarimeter of the paper states, for Q and U together; of n channels √(n/2) times that, as their squares are summed.
POLARISATION_FLOOR = 0.02
#: Else it may be this share of the measured polarisation (rms), and beyond the second it is as good as not described.
POLARISATION_TOLERANCE, POLARISATION_HOPELESS = 0.25, 0.80
#: Share of χ² against that of a constant (of no polarisation) below which the model explains nothing.
EXPLAINS = 0.10
#: Errors of no more than so many stated uncertainties (rms) are excused: nothing better can be asked of a model.
WITHIN = 2.0
#: Fewer points than these are no stratum.
POINTS = 5
#: Angle of incidence from which on a miss is told but does not lower the verdict: an error of 1° in it changes the
#: irradiance by 6 % there and by 27 % at 86°, and the light spot outgrows the sample. Radians.
GRAZING = math.radians(75.0)
#: Facet tilt from the mirror direction that counts as near it, whatever width the fit gives the lobe; radians.
NEAR_MIRROR = math.radians(10.0)
#: Angles of incidence of more different values than this are taken together in bins of so many degrees; groups and
#: wavelengths of more are not looked at apart.
DISTINCT, BIN = 60, 5.0
#: So many parts of the data that fail are listed.
PLACES = 3
#: RMS of a channel in stated uncertainties below which it holds no signal.
NO_SIGNAL = 1.5


class Level(enum.StrEnum):
    """What a fit is worth."""

    DESCRIBES = "describes"
    IN_PART = "in_part"
    DOES_NOT = "does_not"
    NOT_CONVERGED = "not_converged"

    @property
    def usable(self) -> bool:
        """Whether the parameters say anything of the sample."""
        return self in (Level.DESCRIBES, Level.IN_PART)


@dataclass(frozen=True)
class Stratum:
    """How well one quantity is described over some of the data.

    Attributes
    ----------
    where
        In words, after "not": ``"at θ_i = 60°"``; ``""`` for everything.
    quantity
        ``"intensity"`` or ``"polarisation"``.
    count
        Number of points.
    error
        Of the intensity the median size of the relative error; of the polarisation the rms error of the channels
        divided by the intensity, 1.
    bias
        Median of the signed relative error of the intensity; NaN for the polarisation.
    signal
        RMS of the measured polarisation, 1; NaN for the intensity.
    tolerance
        What the error may be.
    in_uncertainties
        RMS of (model − measured)/std; NaN where the data state no uncertainty.
    biased
        Whether the bias is beyond its tolerance and no chance.
    grazing
        Whether all of it lies at grazing incidence.
    held_out
        Whether none of it was fitted.
    """

    where: str
    quantity: str
    count: int
    error: float
    bias: float
    signal: float
    tolerance: float
    in_uncertainties: float
    biased: bool
    grazing: bool
    held_out: bool

    @property
    def excused(self) -> bool:
        """Whether the errors are no more than what the measurement itself may be wrong by."""
        return self.in_uncertainties <= WITHIN

    @property
    def fails(self) -> bool:
        """Whether it is not described."""
        return not self.excused and (self.error > self.tolerance or self.biased)

    @property
    def severity(self) -> float:
        """Error in units of its tolerance."""
        return max(self.error / self.tolerance, abs(self.bias) / BIAS_TOLERANCE if self.biased else 0.0)

    @property
    def size(self) -> str:
        """The error in words."""
        if self.quantity == "polarisation":
            return f"rms error {self.error:.2g} of a measured {self.signal:.2g}"
        if self.biased and self.error <= self.tolerance:
            return f"{'above' if self.bias > 0 else 'below'} the measurement by {percent(abs(self.bias))}"
        return f"median error {percent(self.error)}"

    def sentence(self) -> str:
        """Where it is not described, and by how much."""
        what = "its polarisation" if self.quantity == "polarisation" else ""
        seen = " (held out)" if self.held_out and self.where else ""
        return f"not {' '.join(filter(None, [what, self.where]))}{seen}, {self.size}"


@dataclass(frozen=True)
class Verdict:
    """What a fit is worth.

    Attributes
    ----------
    level
        :class:`Level`.
    sentence
        The first line of every report.
    reasons
        What led there, a sentence each, the weightiest first.
    do_not_quote
        Fitted parameters whose values are none of the sample: all of them where the model does not describe the data,
        else those that stand on a bound or are not determined.
    strata
        Everything that was judged.
    """

    level: Level
    sentence: str
    reasons: list[str] = field(default_factory=list)
    do_not_quote: list[str] = field(default_factory=list)
    strata: list[Stratum] = field(default_factory=list, repr=False)


def quotable(estimate: Estimate) -> bool:
    """Whether a parameter, were the model right, is one that the data determine; fixed ones are not asked."""
    return estimate.verdict in ("determined", "fixed")


def verdict(result: Optimum) -> Verdict:
    """Judge a fit.

    Parameters
    ----------
    result
        The fit.

    Returns
    -------
    Verdict
        ``does_not`` if half of the fitted or of the held-out intensity is missed (median error above 50 %), if 80 % of
        the polarisation is and the intensity fails as well or was not measured, or if something fails and the model
        explains no channel better than a constant; ``describes`` if neither the whole nor any stratum fails, those at
        grazing incidence aside; else ``in_part``. ``not_converged`` before all these if the fit stands at no minimum.
    """
    strata = list(_strata(result))
    whole = [s for s in strata if not s.where]
    failing = sorted((s for s in strata if s.fails), key=lambda s: (s.grazing, -s.severity))
    explained = _explained(result)
    nothing = bool(explained) and max(explained.values()) < EXPLAINS
    counting = [s for s in failing if not s.grazing]
    if not result.settled:
        level = Level.NOT_CONVERGED
    elif any(_hopeless(s, whole, counting) for s in whole) or (counting and nothing):
        level = Level.DOES_NOT
    elif counting:
        level = Level.IN_PART
    else:
        level = Level.DESCRIBES
    unsure = [name for name, e in result.estimates.items() if not quotable(e)]
    on_bounds = [name for name in unsure if result.estimates[name].verdict.startswith("at ")]
    silent = [n for n, e in result.estimates.items() if e.verdict != "fixed"] if not level.usable else unsure
    return Verdict(
        level,
        _sentence(level, whole, failing, (on_bounds, [n for n in unsure if n not in on_bounds]), nothing),
        list(_reasons(result, level, whole, failing, explained)),
        silent,
        strata,
    )


def _hopeless(stratum: Stratum, whole: list[Stratum], failing: list[Stratum]) -> bool:
    """Whether the error of everything fitted or held out is beyond all use."""
    if stratum.excused:
        return False
    if stratum.quantity == "intensity":
        return stratum.error > HOPELESS
    decides = all(s.quantity == "polarisation" for s in whole) or any(
        s.quantity == "intensity" for s in failing
    )
    return decides and stratum.error > max(POLARISATION_FLOOR, POLARISATION_HOPELESS * stratum.signal)


def _strata(result: Optimum) -> Iterator[Stratum]:
    """Everything that is judged: the whole first, then the parts."""
    table = result.comparison
    held = table["held_out"].values
    intensity = _intensity_errors(result)
    errors, signals = _polarisation(result)
    uncertain = _in_uncertainties(result)
    parts = list(_parts(result))
    chance = SIGNIFICANCE / max(len(parts), 1)
    floor = POLARISATION_FLOOR * math.sqrt(max(1.0, 0.5 * len(_polarising(result))))

    def judged(where: str, mask: np.ndarray, whole: bool) -> Iterator[Stratum]:
        unseen = bool(held[mask].all())
        grazing = bool(where) and bool((table["theta_i"].values[mask] >= GRAZING).all())
        used = mask & np.isfinite(intensity)
        if used.sum() >= (1 if whole else POINTS):
            signed = intensity[used]
            bias = float(np.median(signed))
            odds = sign_test(int((signed > 0.0).sum()), int((signed < 0.0).sum()))
            yield Stratum(
                where=where,
                quantity="intensity",
                count=int(used.sum()),
                error=float(np.median(np.abs(signed))),
                bias=bias,
                signal=math.nan,
                tolerance=TOLERANCE if whole else STRATUM_TOLERANCE,
                in_uncertainties=_rms(uncertain["intensity"][..., used]),
                biased=abs(bias) > BIAS_TOLERANCE and odds < chance,
                grazing=grazing,
                held_out=unseen,
            )
        used = mask & np.isfinite(errors)
        if used.sum() >= (1 if whole else POINTS):
            signal = _rms(signals[used])
            yield Stratum(
                where=where,
                quantity="polarisation",
                count=int(used.sum()),
                error=_rms(errors[used]),
                bias=math.nan,
                signal=signal,
                tolerance=max(floor, POLARISATION_TOLERANCE * signal) * (1.0 if whole else 1.5),
                in_uncertainties=_rms(uncertain["polarisation"][..., used]),
                biased=False,
                grazing=grazing,
                held_out=unseen,
            )

    for mask in (~held, held):
        if mask.any():
            yield from judged("", mask, True)
    for where, mask in parts:
        yield from judged(where, mask, False)


def _parts(result: Optimum) -> Iterator[tuple[str, np.ndarray]]:
    """Strata of the data in words and as masks; what is all of the data, or came before, is none."""
    table = result.comparison
    size = table.sizes["geometry"]
    told = {np.ones(size, dtype=bool).tobytes()}
    for where, mask in _all_parts(result):
        if mask.any() and mask.tobytes() not in told:
            told.add(mask.tobytes())
            yield where, mask


def _all_parts(result: Optimum) -> Iterator[tuple[str, np.ndarray]]:
    table = result.comparison
    near = table["facet_tilt"].values < NEAR_MIRROR
    yield f"within {math.degrees(NEAR_MIRROR):.0f}° of facet tilt of the mirror direction", near
    yield f"more than {math.degrees(NEAR_MIRROR):.0f}° of facet tilt off the mirror direction", ~near
    if "I_measured" in table:
        bright = table["I_measured"].values
        present = np.isfinite(bright)
        if present.sum() >= POINTS:
            limit = np.sort(bright[present])[-max(POINTS, round(0.1 * present.sum()))]
            yield "where it is brightest (a tenth of the points)", present & (bright >= limit)
    degrees = np.rad2deg(table["theta_i"].values)
    incidence = np.round(degrees * 20.0) / 20.0
    if len(np.unique(incidence)) <= DISTINCT:
        yield from _by_value(incidence, "at θ_i = {:.4g}°")
    else:
        yield from _by_value(np.round(degrees / BIN) * BIN, f"at θ_i = {{:.4g}}° ± {0.5 * BIN:g}°")
    if "wavelength" in table.coords:
        yield from _by_value(table["wavelength"].values, "at {:.5g} nm")
    yield from _by_value(table["group"].values, "in group {}")


def _by_value(column: np.ndarray, words: str) -> Iterator[tuple[str, np.ndarray]]:
    """A part for each value that occurs often enough; none where there are too many of them to be told."""
    values, counts = np.unique(column, return_counts=True)
    if len(values) <= DISTINCT:
        for value in values[counts >= POINTS]:
            yield words.format(value), column == value


def _intensity_errors(result: Optimum) -> np.ndarray:
    """Signed relative errors as in :func:`pbrdf.inversion.holdout.prediction_errors`, NaN where not measured."""
    table = result.comparison
    if "I_measured" not in table:
        return np.full(table.sizes["geometry"], np.nan)
    measured = table["I_measured"].values
    if not np.isfinite(measured).any():
        return np.full(len(measured), np.nan)
    return relative_errors(table["I_modelled"].values, measured)


def _polarising(result: Optimum) -> list[str]:
    """Fitted channels that carry polarisation."""
    return [c for c in result.data.channels if c not in ("I", "m00")]


def _polarisation(result: Optimum) -> tuple[np.ndarray, np.ndarray]:
    """Errors of the channels over the intensity, root of their sum of squares, and the same of the measured values.

    NaN where the intensity is dark or polarisation was not measured.
    """
    table = result.comparison
    size = table.sizes["geometry"]
    channels = _polarising(result)
    if not channels:
        return np.full(size, np.nan), np.full(size, np.nan)
    modelled = table["I_modelled"].values
    measured = table["I_measured"].values if "I_measured" in table else modelled
    light = np.where(measured > dark_below(measured), measured, np.nan)
    shining = np.where(modelled == 0.0, np.nan, modelled)
    error, signal, present = np.zeros(size), np.zeros(size), np.zeros(size, dtype=bool)
    for channel in channels:
        by = (1.0, 1.0) if is_ratio(channel) else (shining, light)
        value = table[f"{channel}_measured"].values / by[1]
        wrong = table[f"{channel}_modelled"].values / by[0] - value
        here = np.isfinite(wrong)
        error[here] += wrong[here] ** 2
        signal[here] += value[here] ** 2
        present |= here
    return np.where(present, np.sqrt(error), np.nan), np.where(present, np.sqrt(signal), np.nan)


def _in_uncertainties(result: Optimum) -> dict[str, np.ndarray]:
    """(model − measured)/std of the channels of either quantity, shape (C, G); NaN where none is stated."""
    table = result.comparison
    size = table.sizes["geometry"]
    found = {}
    for quantity in ("intensity", "polarisation"):
        channels = [c for c in result.data.channels if (c in ("I", "m00")) == (quantity == "intensity")]
        known = result.std_known and channels
        rows = [table[f"{c}_residual"].values / table[f"{c}_std"].values for c in channels] if known else []
        found[quantity] = np.stack(rows) if rows else np.full((1, size), np.nan)
    return found


def _explained(result: Optimum) -> dict[str, float]:
    """By fitted channel with a signal, the share of χ² against a constant (or no polarisation) that is explained."""
    table = result.comparison
    kept = ~table["held_out"].values
    shares = {}
    for channel in result.data.channels:
        measured, std = table[f"{channel}_measured"].values, table[f"{channel}_std"].values
        used = kept & np.isfinite(measured) & np.isfinite(std) & (std > 0.0)
        if not used.any():
            continue
        y, weight = measured[used], 1.0 / std[used] ** 2
        signal = float((y * y * weight).sum())
        if signal < NO_SIGNAL**2 * used.sum():
            continue
        constant = float((y * weight).sum() / weight.sum()) if channel in ("I", "m00") else 0.0
        spread = float(((y - constant) ** 2 * weight).sum())
        misfit = float((table[f"{channel}_residual"].values[used] ** 2 * weight).sum())
        if spread > 0.0:
            shares[channel] = 1.0 - misfit / spread
    return shares


def _sentence(
    level: Level,
    whole: list[Stratum],
    failing: list[Stratum],
    unsure: tuple[list[str], list[str]],
    nothing: bool,
) -> str:
    overall = "; ".join(_overall(whole))
    if level == Level.NOT_CONVERGED:
        return f"The fit has not converged: its numbers are no result, do not quote them; {overall}."
    if level == Level.DOES_NOT:
        also = ", and the fit explains no more than a constant would" if nothing else ""
        return f"The model does not describe this sample, do not quote its parameters: {overall}{also}."
    why = ("on a bound", "not determined")
    listed = [
        f"{joined(names, 'and')} ({reason})" for names, reason in zip(unsure, why, strict=True) if names
    ]
    ending = f"; do not quote {' and '.join(listed)}" if listed else ""
    if level == Level.DESCRIBES:
        but = f", but {'; '.join(_where_not(failing))} (grazing)" if failing else ""
        return f"The model describes the data: {overall}{but}{ending}."
    return f"The model describes the data in part: {'; '.join(_where_not(failing))}; {overall}{ending}."


def _where_not(failing: list[Stratum]) -> Iterator[str]:
    """The worst place of either quantity."""
    for quantity in ("intensity", "polarisation"):
        own = [s for s in failing if s.quantity == quantity]
        own = [s for s in own if not s.grazing] or own
        places = [s for s in own if s.where]
        whole = [s for s in own if not s.where]
        if quantity == "polarisation" and whole:
            yield whole[0].sentence()
        elif places:
            yield places[0].sentence()
        elif whole:
            yield f"not closely anywhere, {whole[0].size}"


def _overall(whole: list[Stratum]) -> Iterator[str]:
    """Errors over everything held out and fitted."""
    for quantity in ("intensity", "polarisation"):
        own = sorted((s for s in whole if s.quantity == quantity), key=lambda s: not s.held_out)
        shown = [f"{_overall_size(s)} {'held out' if s.held_out else 'fitted'}" for s in own]
        if shown:
            kind = (
                "median error of the intensity"
                if quantity == "intensity"
                else "rms error of the polarisation"
            )
            yield f"{kind} {', '.join(shown)}"


def _overall_size(stratum: Stratum) -> str:
    if stratum.quantity == "intensity":
        return percent(stratum.error)
    return f"{stratum.error:.2g} of a measured {stratum.signal:.2g}"


def _reasons(
    result: Optimum,
    level: Level,
    whole: list[Stratum],
    failing: list[Stratum],
    explained: dict[str, float],
) -> Iterator[str]:
    places = [s for s in failing if s.where]
    for stratum in places[:PLACES]:
        yield f"{stratum.sentence()[0].upper()}{stratum.sentence()[1:]} ({stratum.count} points)."
    if len(places) > PLACES:
        more = len(places) - PLACES
        yield f"{more} further part{'s' if more > 1 else ''} of the data: missed by more than allowed."
    if explained and max(explained.values()) < EXPLAINS:
        yield "Against a constant the fit lowers χ² by less than a tenth in every channel with a signal."
    if not any(s.held_out for s in whole):
        yield "Nothing was held out: how the model predicts what it has not seen is not known."
    if not any(s.quantity == "polarisation" for s in whole):
        yield "No polarisation was measured: this is about the intensity alone."
    if not any(s.quantity == "intensity" for s in whole):
        yield "No intensity was measured, only ratios: this is about the polarisation alone."
    reduced = result.goodness.reduced_chi2
    if result.std_known and math.isfinite(reduced):
        times = math.sqrt(reduced)
        if times > WITHIN and level == Level.DESCRIBES:
            yield (
                f"The residuals are {times:.2g} times the stated uncertainty: a useful description, yet not the whole "
                "truth, and the standard errors are too small by about that factor."
            )
        elif times <= WITHIN:
            yield f"The residuals are {times:.2g} times the stated uncertainty: nothing closer can be asked for."
    edges = [n for n, e in result.estimates.items() if _on_inner_bound(e)]
    if edges:
        yield (
            f"{joined(edges, 'and')} {'stands' if len(edges) == 1 else 'stand'} on a bound of the search that is none "
            "of the model: the data ask for something that the model does not have."
        )


def _on_inner_bound(estimate: Estimate) -> bool:
    """Whether it stands on a bound that is not the edge of what the model is defined for."""
    if not estimate.verdict.startswith("at "):
        return False
    low, high = estimate.parameter.domain
    bound, edge = (estimate.lower, low) if "lower" in estimate.verdict else (estimate.upper, high)
    return bound != edge


def _rms(values: np.ndarray) -> float:
    finite = values[np.isfinite(values)]
    return float(np.sqrt((finite**2).mean())) if finite.size else math.nan


def percent(share: float) -> str:
    return f"{100.0 * share:.2g} %" if share < 0.995 else f"{100.0 * share:.0f} %"
