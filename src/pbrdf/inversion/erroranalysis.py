"""Where and how a fitted model misses the measurement, as in section 2.3 and figures 6 and 8 of the paper.

Zhang, Song, Zhao, Infrared and Laser Engineering 46(11), 1117002 (2017) report, for each camera position, the
errors of intensity and of the degree of linear polarisation (DoLP) against angle, their standard deviation and
maximum, the errors at the strongest diffuse and at the strongest specular point, and that right of the specular
peak the modelled DoLP lies below the measured one. All errors here are model − measured.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pbrdf.data.schema import written
from pbrdf.inversion.optimum import Optimum
from pbrdf.inversion.statistics import relative_errors

if TYPE_CHECKING:
    import xarray as xr


__all__ = [
    "ErrorAnalysis",
    "ErrorStatistics",
    "GroupErrors",
    "PointError",
    "Structure",
    "error_analysis",
    "residual_structure",
    "sign_test",
]

#: Below this probability, residuals without structure do not explain what is seen.
SIGNIFICANCE = 0.01


@dataclass(frozen=True)
class PointError:
    """Errors of the model at one measured point.

    Attributes
    ----------
    index
        Position along ``geometry``.
    group
        Group of the point.
    theta_i, theta_r, phi
        Angles in radians.
    intensity
        Measured intensity, 1/sr.
    intensity_error, relative_error
        Model − measured in 1/sr, and relative to the measured value, but to no less than 5 % of the data's median.
    dolp, dolp_error
        Measured DoLP and model − measured, 1; NaN where no polarisation was measured.
    """

    index: int
    group: str
    theta_i: float
    theta_r: float
    phi: float
    intensity: float
    intensity_error: float
    relative_error: float
    dolp: float
    dolp_error: float

    @property
    def where(self) -> str:
        """The direction in words."""
        i, r = np.rad2deg([self.theta_i, self.theta_r])
        azimuth = math.degrees(math.atan2(math.sin(self.phi), math.cos(self.phi)))
        side = {0: "", 180: " in backscatter"}.get(round(abs(azimuth)), f", φ = {azimuth:.3g}°")
        return f"θ_i = {i:.3g}°, θ_r = {r:.3g}°{side}"


@dataclass(frozen=True)
class ErrorStatistics:
    """Errors of one quantity over some points.

    Attributes
    ----------
    count
        Number of points; with 0 all else is NaN and ``worst`` None.
    mean, std
        Mean and standard deviation (about the mean, divided by ``count``).
    largest
        Error of the largest size, with its sign.
    worst
        The point where that is, or None.
    """

    count: int
    mean: float
    std: float
    largest: float
    worst: PointError | None


@dataclass(frozen=True)
class Structure:
    """Whether the signs of residuals look like chance.

    Independent residuals of a right model are as often positive as negative, in every group and at every wavelength,
    and change sign every other time. Runs are stretches of equal sign in the order of the angle; few long runs mean
    that the model departs from the measurement in a smooth way that noise does not explain.

    Attributes
    ----------
    positive, negative
        Numbers of residuals above and below 0.
    runs, expected_runs
        Number of runs, and its mean under independence.
    p_sign
        Probability, for an unbiased model, of signs at least as uneven in any stratum or in all (exact binomial test,
        two-sided, the least probability times the number of tests: Bonferroni).
    p_runs
        Probability, for independent residuals with these numbers of signs, of at most as many runs (exact
        Wald-Wolfowitz test, one-sided); 1 where all have one sign.
    stratum, above, below
        Where the signs are the least even, in words, and their numbers there; ``""`` for all together.
    """

    positive: int
    negative: int
    runs: int
    expected_runs: float
    p_sign: float
    p_runs: float
    stratum: str = ""
    above: int = 0
    below: int = 0

    @property
    def structured(self) -> bool:
        """Whether chance explains neither the signs nor their order (1 % in all)."""
        return min(self.p_sign, self.p_runs) < 0.5 * SIGNIFICANCE


@dataclass(frozen=True)
class GroupErrors:
    """Errors of one group (camera position, angle of incidence, …).

    Attributes
    ----------
    group
        Its label.
    held_out
        Whether none of its points was fitted: the errors are those of a prediction.
    intensity, relative, dolp
        Errors of the intensity in 1/sr, of the intensity relative to the measured one, but to no less than 5 % of the
        data's median, and of the DoLP.
    strongest_specular, strongest_diffuse
        The brightest measured points near the mirror direction and away from it; None where there is none.
    relative_right_of_peak, dolp_right_of_peak
        Mean relative error of the intensity and mean error of the DoLP over the diffuse points right of the peak,
        where the viewer stands farther out than the mirror direction; NaN without such points. Negative: the model
        lies below the measurement, as the paper finds for the DoLP.
    structure
        By fitted channel, whether the residuals look like chance.
    """

    group: str
    held_out: bool
    intensity: ErrorStatistics
    relative: ErrorStatistics
    dolp: ErrorStatistics
    strongest_specular: PointError | None
    strongest_diffuse: PointError | None
    relative_right_of_peak: float
    dolp_right_of_peak: float
    structure: dict[str, Structure]


@dataclass(frozen=True)
class ErrorAnalysis:
    """Errors of a fit against angle, by group and in all.

    Attributes
    ----------
    errors
        Over ``geometry``, in the order of the data set: ``intensity_error`` (1/sr), ``relative_error``,
        ``dolp_error``, the signed ``offset`` from the mirror direction (rad), ``near_specular`` and ``held_out``.
    groups
        One entry a group, sorted.
    intensity, relative, dolp
        Errors over all points.
    structure
        By fitted channel, over all fitted points.
    """

    errors: xr.Dataset
    groups: list[GroupErrors]
    intensity: ErrorStatistics
    relative: ErrorStatistics
    dolp: ErrorStatistics
    structure: dict[str, Structure]

    def sentences(self) -> list[str]:
        """What the numbers say, in plain words."""
        lines = [_overall_sentence(self)]
        for group in self.groups:
            lines.extend(_group_sentences(group))
        lines.extend(_structure_sentences(self.structure))
        return lines


def error_analysis(result: Optimum) -> ErrorAnalysis:
    """Errors of a fit against angle: standard deviation, maximum, strongest points, structure.

    Points without a measured intensity count in no error of the intensity, points without polarisation in none of
    the DoLP. Held-out points are part of the analysis; only the test for structure over everything leaves them
    out.

    Parameters
    ----------
    result
        The fit.

    Returns
    -------
    ErrorAnalysis
    """
    import xarray as xr

    table = result.comparison
    size = table.sizes["geometry"]
    nan = np.full(size, np.nan)

    def column(name: str) -> np.ndarray:
        return table[name].values if name in table else nan

    measured, intensity_error = column("I_measured"), column("I_residual")
    relative_error = relative_errors(column("I_modelled"), measured)
    theta_i, theta_r, phi = (table[name].values for name in ("theta_i", "theta_r", "phi"))
    # tilt of the mirror facet along the plane of incidence, positive where the viewer is farther out
    offset = np.arctan2(np.sin(theta_r) * np.cos(phi) - np.sin(theta_i), np.cos(theta_i) + np.cos(theta_r))
    errors = xr.Dataset(
        {
            "intensity_error": ("geometry", intensity_error, {"units": "1/sr"}),
            "relative_error": ("geometry", relative_error, {"units": "1"}),
            "dolp_error": ("geometry", column("dolp_residual"), {"units": "1"}),
            "offset": ("geometry", offset, {"units": "rad"}),
            "near_specular": table["near_specular"],
            "held_out": table["held_out"],
        },
        coords=table.coords,
    )
    labels = table["group"].values

    def point(index: int) -> PointError:
        return PointError(
            index=index,
            group=str(labels[index]),
            theta_i=float(theta_i[index]),
            theta_r=float(theta_r[index]),
            phi=float(phi[index]),
            intensity=float(measured[index]),
            intensity_error=float(intensity_error[index]),
            relative_error=float(relative_error[index]),
            dolp=float(column("dolp_measured")[index]),
            dolp_error=float(errors["dolp_error"].values[index]),
        )

    def statistics(name: str, where: np.ndarray) -> ErrorStatistics:
        values = errors[name].values
        index = np.flatnonzero(where & np.isfinite(values))
        if not len(index):
            return ErrorStatistics(0, math.nan, math.nan, math.nan, None)
        chosen = values[index]
        worst = int(index[np.argmax(np.abs(chosen))])
        return ErrorStatistics(
            len(index), float(chosen.mean()), float(chosen.std()), float(values[worst]), point(worst)
        )

    def brightest(where: np.ndarray) -> PointError | None:
        index = np.flatnonzero(where & np.isfinite(measured))
        return point(int(index[np.argmax(measured[index])])) if len(index) else None

    def mean(name: str, where: np.ndarray) -> float:
        return statistics(name, where).mean

    near, held = table["near_specular"].values, table["held_out"].values
    everything = np.ones(size, dtype=bool)
    order = np.argsort(offset, kind="stable")

    colour = table["wavelength"].values if "wavelength" in table.coords else np.zeros(size)
    colours = [] if len(np.unique(colour)) < 2 else [c for c in np.unique(colour) if np.isfinite(c)]

    def structure(members: np.ndarray, by_group: bool) -> dict[str, Structure]:
        """Signs by group and by wavelength; runs along the angle within either."""
        strata: dict[str, np.ndarray] = {}
        if by_group and len(np.unique(labels[members])) > 1:
            strata = {f"group {label}": members & (labels == label) for label in np.unique(labels[members])}
        strata |= {f"{c:g} nm": members & (colour == c) for c in colours if (members & (colour == c)).any()}
        runs_in = [members & (labels == label) for label in np.unique(labels[members])]
        if colours:
            runs_in = [where & (colour == c) for where in runs_in for c in colours]
        found = {}
        for channel in result.data.channels:
            residual = column(f"{channel}_residual")
            here = np.isfinite(residual)
            found[channel] = residual_structure(
                [residual[order[(where & here)[order]]] for where in runs_in],
                {name: residual[where & here] for name, where in strata.items()},
            )
        return found

    groups = []
    for label in np.unique(labels):
        members = labels == label
        right = members & ~near & (offset > 0.0)
        groups.append(
            GroupErrors(
                group=str(label),
                held_out=bool(held[members].all()),
                intensity=statistics("intensity_error", members),
                relative=statistics("relative_error", members),
                dolp=statistics("dolp_error", members),
                strongest_specular=brightest(members & near),
                strongest_diffuse=brightest(members & ~near),
                relative_right_of_peak=mean("relative_error", right),
                dolp_right_of_peak=mean("dolp_error", right),
                structure=structure(members, by_group=False),
            )
        )
    return ErrorAnalysis(
        errors=errors,
        groups=groups,
        intensity=statistics("intensity_error", everything),
        relative=statistics("relative_error", everything),
        dolp=statistics("dolp_error", everything),
        structure=structure(~held, by_group=True),
    )


def residual_structure(
    sequences: Sequence[np.ndarray], strata: Mapping[str, np.ndarray] | None = None
) -> Structure:
    """Test the signs of residuals and their order against chance.

    Parameters
    ----------
    sequences
        Residuals in the order of the angle, one array of shape (N,) for each group; runs do not go across groups.
        Residuals of exactly 0 are left out.
    strata
        Residuals of parts of the data by name, whose signs are tested as well: what is too high at one wavelength and
        too low at the next may be even in all.

    Returns
    -------
    Structure
        Of all sequences together.
    """
    positive = negative = runs = 0
    distribution = np.ones(1)  # of the number of runs over the sequences so far
    for sequence in sequences:
        signs = np.sign(sequence[sequence != 0.0])
        if not len(signs):
            continue
        above = int((signs > 0.0).sum())
        positive, negative = positive + above, negative + len(signs) - above
        runs += 1 + int((signs[1:] != signs[:-1]).sum())
        distribution = np.convolve(distribution, _run_probabilities(above, len(signs) - above))
    tested = {"": (positive, negative)}
    for name, values in (strata or {}).items():
        tested[name] = (int((values > 0.0).sum()), int((values < 0.0).sum()))
    odds = {name: sign_test(*signs) for name, signs in tested.items()}
    worst = min(odds, key=lambda name: odds[name])
    return Structure(
        positive=positive,
        negative=negative,
        runs=runs,
        expected_runs=float(np.arange(len(distribution)) @ distribution),
        p_sign=min(1.0, len(odds) * odds[worst]),
        p_runs=min(float(distribution[: runs + 1].sum()), 1.0),
        stratum=worst,
        above=tested[worst][0],
        below=tested[worst][1],
    )


def sign_test(positive: int, negative: int) -> float:
    """Two-sided binomial test of p = ½, whose tails are equal.

    Parameters
    ----------
    positive, negative
        Numbers of signs of either kind.

    Returns
    -------
    float
        Probability of signs at least as uneven.
    """
    total, fewer = positive + negative, min(positive, negative)
    tail = _log_choices(total, np.arange(fewer + 1)) - total * math.log(2.0)
    return min(1.0, 2.0 * float(np.exp(tail).sum()))


def _log_choices(total: int, chosen: np.ndarray) -> np.ndarray:
    """Logarithms of the numbers of ways to choose so many of a total; −∞ where there is none."""
    log_factorial = np.concatenate([[0.0], np.cumsum(np.log(np.arange(1, total + 1)))])
    k = np.minimum(chosen, total)
    return np.where(
        chosen <= total, log_factorial[total] - log_factorial[k] - log_factorial[total - k], -np.inf
    )


def _run_probabilities(positive: int, negative: int) -> np.ndarray:
    """Probability of 0, 1, 2, … runs if every order of the signs is equally likely (Wald and Wolfowitz 1940)."""
    if positive == 0 or negative == 0:
        return np.array([0.0, 1.0])
    most = 2 * min(positive, negative) + (positive != negative)
    probability = np.zeros(most + 1)
    half = np.arange(1, min(positive, negative) + 1)
    total = positive + negative
    orders = float(_log_choices(total, np.array(positive)))

    def share(parts_above: np.ndarray, parts_below: np.ndarray) -> np.ndarray:
        ways = _log_choices(positive - 1, parts_above - 1) + _log_choices(negative - 1, parts_below - 1)
        values: np.ndarray = np.exp(ways - orders)
        return values

    # the first run may be of either sign; an odd number of runs has one more of the first sign
    probability[2::2] = 2.0 * share(half, half)
    odd = share(half + 1, half) + share(half, half + 1)
    probability[3::2] = odd[: len(probability[3::2])]
    return probability


def _overall_sentence(analysis: ErrorAnalysis) -> str:
    relative, dolp = analysis.relative, analysis.dolp
    parts = []
    if relative.worst is not None:
        parts.append(
            f"intensity {relative.std:.2%} (largest {relative.largest:+.2%} at {relative.worst.where}, group "
            f"{relative.worst.group})"
        )
    if dolp.worst is not None:
        parts.append(
            f"DoLP {dolp.std:.4f} (largest {dolp.largest:+.4f} at {dolp.worst.where}, group {dolp.worst.group})"
        )
    if not parts:
        return "Neither intensity nor DoLP was measured: there are no errors of these to analyse."
    return f"Standard deviation of model − measured over all points: {'; '.join(parts)}."


def _group_sentences(group: GroupErrors) -> list[str]:
    name = f"Group {group.group}{' (held out)' if group.held_out else ''}"
    parts = []
    for what, point in (("specular", group.strongest_specular), ("diffuse", group.strongest_diffuse)):
        if point is None:
            continue
        dolp = f" and {point.dolp_error:+.4f} in DoLP" if math.isfinite(point.dolp_error) else ""
        parts.append(f"{point.relative_error:+.2%} in intensity{dolp} at the strongest {what} point")
    lines = [f"{name}: {'; '.join(parts)}."] if parts else []
    right = group.dolp_right_of_peak
    if math.isfinite(right):
        side = "below" if right < 0.0 else "above"
        lines.append(
            f"{name}: right of the peak the modelled DoLP lies on average {abs(right):.4f} {side} the measured one."
        )
    return lines


def _structure_sentences(structure: dict[str, Structure]) -> list[str]:
    found = {channel: s for channel, s in structure.items() if s.structured}
    if not found:
        return [
            "The signs of the residuals look like chance in every fitted channel, and so they do by group and "
            "wavelength."
        ]
    return [
        f"The residuals of {written(channel)} are structured ({s.runs} runs of equal sign where "
        f"{s.expected_runs:.0f} were to be expected, {s.positive} above 0 and {s.negative} below{_uneven(s)}): the "
        "model departs from the measurement in a way that noise does not explain."
        for channel, s in found.items()
    ]


def _uneven(structure: Structure) -> str:
    if not structure.stratum:
        return ""
    return f"; {structure.above} above and {structure.below} below at {structure.stratum}".replace(
        "at group", "in group"
    )
