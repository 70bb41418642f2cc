"""Which geometries determine the parameters best: a plan for a measurement that has not been made.

The information of a reading is Jᵀ C⁻¹ J with the exact derivatives J of its Stokes vector by the parameters and the
covariance C that the instrument will have there; readings are independent, so their information adds up and its inverse
is the covariance of the fitted parameters. The choice follows :mod:`pbrdf.planning.design`. It holds for the model and
near the guess: where the guess is rough, ``uncertainty`` averages the criterion over models about it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pbrdf.errors import DataError, FitError
from pbrdf.instruments.goniometer.protocols import Protocol
from pbrdf.instruments.polarimeter.expected_noise import expected_covariance
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.inversion.noise import Noise, parse_noise
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.problem import Space, derivatives
from pbrdf.inversion.statistics import covariance, prior_spread
from pbrdf.models.base import Model
from pbrdf.optics.elements import rotate_frame
from pbrdf.optics.stokes import STOKES
from pbrdf.planning.candidates import in_plane_candidates
from pbrdf.planning.design import (
    CRITERIA,
    ContinuousDesign,
    Criterion,
    choose_labels,
    continuous_design,
    exact_design,
)

__all__ = ["Plan", "information", "plan"]

#: Models that stand for an uncertain guess, the guess itself among them.
SAMPLES = 16
#: Errors of a parameter near 0 are relative to this part of its natural spread.
_NEAR_ZERO = 0.1
#: Readings of this part of the brightest tell nothing.
DARK = 1e-12


@dataclass(frozen=True)
class Plan:
    """A plan and what it promises; P parameters.

    Attributes
    ----------
    model
        The guess.
    protocol
        The chosen geometries, by camera position and sample angle; one that is read twice stands there twice.
    criterion
        ``"D"`` or ``"A"``.
    names, values
        The free parameters and their guessed values.
    sizes
        What a relative error is relative to, shape (P,): the guess, or a tenth of the parameter's natural spread where
        the guess is nearer to 0.
    std
        Expected standard errors with this plan, shape (P,).
    reference
        The protocol that it is compared with.
    reference_std
        Expected standard errors with that, shape (P,).
    gain
        Typical variance of a reading of the reference over that of a reading of the plan: how many times as many
        readings the reference would need, by the criterion.
    efficiency
        By the criterion the plan is at least this good as a part of the best shares of the same candidates, with any
        number of repeated readings (equivalence theorem).
    candidates
        From which was chosen.
    counts
        How often each candidate is read, shape (G,).
    shares
        The best shares of the candidates, if any number of readings could be made.
    noise
        In words, the uncertainties that were assumed.
    angle_error
        Of the sample angle that was assumed, radians.
    """

    model: Model
    protocol: Protocol
    criterion: str
    names: tuple[str, ...]
    values: np.ndarray
    sizes: np.ndarray
    std: np.ndarray
    reference: Protocol
    reference_std: np.ndarray
    gain: float
    efficiency: float
    candidates: Protocol = field(repr=False)
    counts: np.ndarray = field(repr=False)
    shares: ContinuousDesign = field(repr=False)
    noise: str = ""
    angle_error: float = 0.0


def plan(
    model: Model,
    noise: Instrument | Noise | str,
    budget: int,
    *,
    criterion: str = "D",
    candidates: Protocol | None = None,
    parameters: Sequence[str] | None = None,
    fix: Sequence[str] = (),
    free: Sequence[str] = (),
    weights: Mapping[str, float] | None = None,
    uncertainty: float = 0.0,
    camera_positions: int | None = None,
    repeats: int = 1,
    pixels: int = 400,
    angle_error: float = 0.0,
    normalised: bool = False,
    reference: Protocol | None = None,
    starts: int = 4,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> Plan:
    """Choose the geometries that determine the parameters best.

    Parameters
    ----------
    model
        The guess, single numbers as parameters.
    noise
        What will measure, or uncertainties as a fit takes them (an object or text of :mod:`pbrdf.inversion.noise`);
        an absolute part of such a statement refers to the median intensity of all candidates and the reference.
    budget
        Number of readings.
    criterion
        ``"D"``: the volume of the joint confidence region; ``"A"``: the mean square of the relative standard errors.
    candidates
        From which is chosen; None takes :func:`~pbrdf.planning.candidates.in_plane_candidates`.
    parameters
        Those of interest, whose errors count; None for all free ones.
    fix, free
        Parameters that the fit will hold, and those that it will free though they are held by default, as in
        :func:`pbrdf.fit`.
    weights
        For A: how much the relative error of a parameter counts, 1 by default.
    uncertainty
        Relative standard deviation of the guess; above 0 the criterion is averaged over 16 models about it.
    camera_positions
        Restrict the plan to so many groups of the candidates (camera positions); None for any.
    repeats
        How often one geometry may be read. The default, once, costs little where candidates lie close, and neighbouring
        angles show where the model fails, which repeated readings do not.
    pixels
        Number of pixels that a reading averages, for an instrument.
    angle_error
        Standard deviation of the sample angle, and out of plane of its tilt too, radians: an error of the intensity on
        the lobe, which otherwise would be taken for the most telling place. A fit of such data must know it too (its
        argument ``covariance``).
    normalised
        Whether only Q/I, U/I and V/I count, as where the scale of the readings is not known.
    reference
        Protocol to compare with; None is the paper's, 3 × 21.
    starts, seed
        Of the exchange, and of the models about the guess.
    progress
        Called with the number of finished starts and of all.

    Returns
    -------
    Plan

    Raises
    ------
    FitError, DataError, ModelError
        If a name is unknown or the readings do not determine the parameters; the message says what to do.
    """
    if criterion not in CRITERIA:
        raise FitError(f"criterion {criterion!r}: choose one of {', '.join(CRITERIA)}")
    if not 0.0 <= uncertainty < 1.0:
        raise FitError(f"uncertainty {uncertainty!r}: give a part from 0 to below 1, for example 0.1")
    if repeats < 1:
        raise FitError(f"repeats={repeats}: a geometry is read at least once")
    space = _space(model, fix, free)
    interest = _interest(space, parameters)
    guesses = _guesses(space, model, uncertainty, seed)
    candidates = in_plane_candidates(model) if candidates is None else candidates
    reference = Protocol.in_plane() if reference is None else reference
    stated = parse_noise(noise) if isinstance(noise, str) else noise
    matrices = information(
        space,
        guesses,
        (candidates, reference),
        stated,
        pixels=pixels,
        angle_error=angle_error,
        normalised=normalised,
    )
    own, other = matrices[:, : len(candidates)], matrices[:, len(candidates) :]
    goal = Criterion(criterion, interest, _scale(space, guesses, interest, weights or {}))

    usable = np.ones(len(candidates), dtype=bool)
    if camera_positions is not None:
        chosen = choose_labels(own, goal, candidates.group, camera_positions)
        usable = np.isin(candidates.group, chosen)
    shares = continuous_design(own[:, usable], goal)
    counts = np.zeros(len(candidates), dtype=int)
    counts[usable] = exact_design(
        own[:, usable],
        goal,
        budget,
        repeats=repeats,
        shares=shares,
        starts=starts,
        seed=seed,
        progress=progress,
    )
    whole = np.zeros(len(candidates)), np.zeros(len(candidates))
    for column, part in zip(whole, (shares.weights, shares.sensitivity), strict=True):
        column[usable] = part
    total = np.einsum("g,kgpq->kpq", counts.astype(float), own)
    _require_determined(space, guesses[0], total[0], interest, budget)
    value = float(goal.value(total)) - math.log(budget)
    compared = other.sum(axis=1)
    with np.errstate(over="ignore"):
        gain = float(np.exp(value - (goal.value(compared) - math.log(len(reference)))))
    return Plan(
        model=model,
        protocol=_protocol(candidates, counts),
        criterion=criterion,
        names=tuple(space.names),
        values=space.to_parameters(guesses[0]),
        sizes=_sizes(space, space.to_parameters(guesses[0])),
        std=_errors(space, guesses[0], total[0]),
        reference=reference,
        reference_std=_errors(space, guesses[0], compared[0]),
        gain=gain,
        efficiency=min(math.exp(value - shares.value) * shares.efficiency, 1.0),
        candidates=candidates,
        counts=counts,
        shares=ContinuousDesign(*whole, shares.value),
        noise=_in_words(stated, pixels, angle_error) + (", ratios over I alone" if normalised else ""),
        angle_error=angle_error,
    )


def information(
    space: Space,
    unknowns: np.ndarray,
    protocols: Sequence[Protocol],
    noise: Instrument | Noise,
    *,
    pixels: int = 400,
    angle_error: float = 0.0,
    normalised: bool = False,
) -> np.ndarray:
    """Information of one reading at each geometry about the solver's unknowns.

    Parameters
    ----------
    space
        Free and fixed parameters.
    unknowns
        Sets of the solver's unknowns, shape (K, P).
    protocols
        With G geometries together.
    noise, pixels, angle_error, normalised
        As for :func:`plan`.

    Returns
    -------
    ndarray
        Jᵀ C⁻¹ J, shape (K, G, P, P).
    """
    angles = {
        name: np.concatenate([getattr(p, name) for p in protocols])
        for name in ("theta_i", "theta_r", "phi", "reference_angle")
    }
    turned = angles.pop("reference_angle")
    blank = np.zeros((4, len(turned)))
    data = Observations(
        theta_i=angles["theta_i"],
        theta_r=angles["theta_r"],
        phi=angles["phi"],
        channels=STOKES,
        values=blank,
        std=blank + 1.0,
        illumination=(1.0, 0.0, 0.0, 0.0),
        std_known=True,
    )
    values, jacobian = derivatives(space, unknowns, data, STOKES)
    cos_i = np.cos(data.theta_i)
    seen = np.arange(4)
    if isinstance(noise, Instrument):
        noise.polarimeter.require_intensity()
        seen = np.flatnonzero(noise.polarimeter.determined)
        spread = expected_covariance(
            noise,
            values * cos_i[:, None],
            reference_angle=noise.reference_angle + turned,
            pixels=pixels,
        )
        spread = spread / np.square(cos_i)[:, None, None]
    else:
        spread = np.square(_stated(noise, values[..., 0], cos_i))[..., None] * np.eye(4)
    if angle_error:
        parts = [_angle_covariance(space, unknowns, p, angle_error) for p in protocols]
        spread = spread + np.concatenate(parts, axis=1)
    # a statement of relative errors alone would find the far tail of a lobe as telling as its peak
    dark = values[..., 0] <= DARK * values[..., 0].max(axis=-1, keepdims=True)
    jacobian, spread = jacobian[..., seen, :], spread[..., seen[:, None], seen]
    if normalised:
        with np.errstate(divide="ignore", invalid="ignore"):
            over = _slopes_of_ratios(values[..., seen])
            jacobian = over @ jacobian
            spread = over @ spread @ np.swapaxes(over, -1, -2)
    jacobian = np.where(dark[..., None, None], 0.0, jacobian)
    spread = np.where(dark[..., None, None], np.eye(spread.shape[-1]), spread)
    weighted = np.linalg.solve(spread, jacobian)
    found = np.swapaxes(jacobian, -1, -2) @ weighted
    answer: np.ndarray = 0.5 * (found + np.swapaxes(found, -1, -2))
    return answer


def _slopes_of_ratios(values: np.ndarray) -> np.ndarray:
    """Derivatives of all components but the first over the first, by the components: (K, G, C) to (K, G, C − 1, C)."""
    slopes: np.ndarray = np.eye(values.shape[-1])[1:] / values[..., :1, None]
    slopes[..., 0] = -values[..., 1:] / values[..., :1] ** 2
    return slopes


def _stated(noise: Noise, intensity: np.ndarray, cos_i: np.ndarray) -> np.ndarray:
    """Standard uncertainties by a statement, for each set of parameters apart; shape (K, G, 4)."""
    each = [[noise.standard_uncertainty(name, row, 1.0 / cos_i) for row in intensity] for name in STOKES]
    return np.moveaxis(np.array(each), 0, -1)


def _angle_covariance(
    space: Space, unknowns: np.ndarray, protocol: Protocol, angle_error: float
) -> np.ndarray:
    """Mean squares of the errors of Stokes vectors, on the scale of a BRDF, by the sample's angles; (K, G, 4, 4).

    To second order, which is all there is on the peak of the lobe: L'δ + ½ L''δ² has σ² L'L'ᵀ + ¾ σ⁴ L''L''ᵀ.
    """
    moves = [(angle_error, 0.0)]
    if (np.abs(np.sin(protocol.phi)) > 1e-6).any():
        moves.append((0.0, angle_error))
    try:
        places = [(protocol.displaced(-a, 0.0, -b), protocol.displaced(a, 0.0, b)) for a, b in moves]
    except DataError:
        raise FitError(
            f"angle error {math.degrees(angle_error):g}°: it brings source or camera below the horizon; state a "
            "smaller one, or stay farther from the horizon (largest zenith angle)"
        ) from None
    cos_i = np.cos(protocol.theta_i)[:, None]
    found = np.zeros((len(unknowns), len(protocol), 4, 4))
    for total, values in zip(found, space.to_parameters(unknowns), strict=True):
        model = space.build(values)

        def seen(p: Protocol, model: Model = model) -> np.ndarray:
            """As the camera sees it, taken for light of the nominal geometry: its angle of incidence, its p."""
            stokes = (
                np.asarray(model.stokes(p.theta_i, p.theta_r, p.phi)) * np.cos(p.theta_i)[:, None] / cos_i
            )
            turn = rotate_frame(p.reference_angle - protocol.reference_angle)
            values: np.ndarray = np.einsum("gij,gj->gi", turn, stokes)
            return values

        here = seen(protocol)
        for before, after in places:
            low, high = seen(before), seen(after)
            first, second = 0.5 * (high - low), high - 2.0 * here + low
            total += first[:, :, None] * first[:, None, :] + 0.75 * second[:, :, None] * second[:, None, :]
    return found


def _space(model: Model, fix: Sequence[str], free: Sequence[str]) -> Space:
    """What a fit of this model will have free."""
    names = [p.name for p in model.parameters]
    for what, given in (("fix", fix), ("free", free)):
        for name in given:
            if name not in names:
                raise FitError(f"{what}: {model.name} has no parameter {name!r}; it has {', '.join(names)}")
    if any(np.ndim(value) for value in model.values.values()):
        raise FitError("the guess holds arrays: give a model with single numbers")
    chosen = tuple(p for p in model.parameters if p.name not in fix and (p.fitted or p.name in free))
    if not chosen:
        raise FitError("every parameter is fixed: there is nothing to plan for")
    kept = [p.name for p in chosen]
    fixed = {name: float(v) for name, v in model.values.items() if name not in kept}
    values = np.array([float(model.values[name]) for name in kept])
    return Space(
        type(model),
        model.chosen,
        chosen,
        fixed,
        np.minimum(values, [p.lower for p in chosen]),
        np.maximum(values, [p.upper for p in chosen]),
    )


def _interest(space: Space, parameters: Sequence[str] | None) -> np.ndarray:
    for name in parameters or ():
        if name not in space.names:
            raise FitError(f"parameters: {name!r} is not free; free are {', '.join(space.names)}")
    chosen = space.names if parameters is None else parameters
    if not chosen:
        raise FitError("parameters: name at least one whose error counts")
    return np.array([space.names.index(name) for name in dict.fromkeys(chosen)])


def _guesses(space: Space, model: Model, uncertainty: float, seed: int) -> np.ndarray:
    """Unknowns of the guess and, if it is uncertain, of models about it; shape (K, P)."""
    from scipy.stats import norm, qmc

    values = np.array([float(model.values[name]) for name in space.names])
    if uncertainty == 0.0:
        return space.to_unknowns(values)[None]
    draws = qmc.Sobol(len(values), scramble=True, rng=np.random.default_rng(seed)).random(SAMPLES)
    normal = norm.ppf(draws)
    normal[0] = 0.0
    logarithmic = np.array([p.logarithmic for p in space.free])
    size = _sizes(space, values)
    sampled = np.where(
        logarithmic, values * np.exp(uncertainty * normal), values + uncertainty * size * normal
    )
    # within the bounds and not on them, where derivatives may end
    margin = 1e-3 * (space.upper - space.lower)
    inside = np.clip(
        sampled, np.minimum(space.lower + margin, values), np.maximum(space.upper - margin, values)
    )
    return space.to_unknowns(inside)


def _sizes(space: Space, values: np.ndarray) -> np.ndarray:
    """What errors of the parameters are relative to, shape of the values."""
    logarithmic = np.array([p.logarithmic for p in space.free])
    near_zero = np.where(logarithmic, 0.0, _NEAR_ZERO * prior_spread(space.lower, space.upper))
    found: np.ndarray = np.maximum(np.abs(values), near_zero)
    return found


def _scale(
    space: Space, guesses: np.ndarray, interest: np.ndarray, weights: Mapping[str, float]
) -> np.ndarray:
    """Units of the unknowns' errors for the criterion A, shape (K, s)."""
    names = [space.names[i] for i in interest]
    for name, weight in weights.items():
        if name not in names:
            raise FitError(f"weights: {name!r} is not of interest; of interest are {', '.join(names)}")
        if not (math.isfinite(weight) and weight > 0.0):
            raise FitError(f"weights: that of {name} is {weight!r}, it must be above 0")
    values = space.to_parameters(guesses)
    logarithmic = np.array([p.logarithmic for p in space.free])
    unit = np.where(logarithmic, 1.0, _sizes(space, values))
    found: np.ndarray = unit[:, interest] / np.array([weights.get(name, 1.0) for name in names])
    return found


def _require_determined(
    space: Space, unknowns: np.ndarray, matrix: np.ndarray, interest: np.ndarray, budget: int
) -> None:
    """Refuse a plan after which a parameter of interest would be known no better than by its bounds."""
    spread = prior_spread(*space.box)
    std = np.sqrt(np.diag(covariance(matrix, spread)))
    lost = [space.names[i] for i in interest if std[i] >= spread[i]]
    if lost:
        raise FitError(
            f"{budget} readings do not determine {', '.join(lost)} better than the bounds do: raise the budget, or fix "
            "some parameters"
        )


def _errors(space: Space, unknowns: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Expected standard errors of the parameters, shape (P,)."""
    low, high = space.box
    spread = np.sqrt(np.diag(covariance(matrix, prior_spread(low, high))))
    values: np.ndarray = spread * np.abs(space.derivative(space.to_parameters(unknowns)))
    return values


def _protocol(candidates: Protocol, counts: np.ndarray) -> Protocol:
    """The chosen geometries by camera position and sample angle, positions numbered anew from 1."""
    order = np.lexsort((candidates.phi, candidates.theta_i, candidates.sample_angle, candidates.group))
    chosen = candidates.subset(order.repeat(counts[order]))
    _, number = np.unique(chosen.group, return_inverse=True)
    return replace(chosen, group=number + 1, name="plan", notes=())


def _in_words(noise: Instrument | Noise, pixels: int, angle_error: float) -> str:
    if isinstance(noise, Instrument):
        words = f"{noise.polarimeter.name}, {noise.detector.bits} bits, {pixels} pixels a reading"
    else:
        words = str(noise)
    return words + (f", sample angle ± {math.degrees(angle_error):g}°" if angle_error else "")
