"""Which reading would tell the remaining materials apart best.

Given the data so far, each remaining material predicts the next reading: its specimen and the unknown gain and offset
of the sample's angle, which the next reading shares, have a posterior that is normal about its mode
(:func:`pbrdf.identification.evidence.posterior`), and with the model linearised there the reading is normal with mean
m and covariance J H⁻¹ Jᵀ + R. Both are corrected for the model's curvature: of points drawn in pairs on either side of
the mode, the mean of a pair less the value at the mode has no linear part; its mean shifts m, its covariance adds to
that of the reading. Readings are looked at as ln I, Q/I, U/I …, as gain and specimen act as factors, and as I, Q, U …
where the noise is as large as the signal. Over the materials the reading is a mixture of normals with their
probabilities p as weights. What it is expected to tell is the mutual information of material and reading,

    Σ_c p_c E_c[log₂ p(y | c) − log₂ Σ_k p_k p(y | k)]  bits

(Lindley, Ann. Math. Statist. 27, 986 (1956)), from 0 to the entropy of the probabilities. The expectation is a mean
over a shifted Sobol' sequence, the same for all geometries: their differences are less uncertain than each. Beside it
stands how often the most probable material is expected to be the true one afterwards, E[max_c p(c | y)], and how many
materials are expected to be left in the set: the squared distance of all data from a material is that of the data so
far and that of the reading from its prediction, by the chain rule of the normal distribution. A temperature of the
calibration widens all covariances by that factor, which divides squared distances by it.

Against simulated specimens the information is within 0.04 bits for 17 of 20 geometries, all of the best ones among
them, and too small by 0.07 to 0.12 for three (docs/identification-accuracy.md).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from pbrdf.data.schema import is_ratio
from pbrdf.errors import FitError
from pbrdf.identification.evidence import GAIN_SPREAD, linearised, posterior
from pbrdf.identification.identify import Identification
from pbrdf.identification.material import Material
from pbrdf.identification.predictive import specimens_shown
from pbrdf.instruments.goniometer.protocols import Protocol
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.starts import sobol_points
from pbrdf.inversion.statistics import typical
from pbrdf.planning.candidates import in_plane_candidates

__all__ = ["NextMeasurement", "next_measurement"]

#: Points of the sequence, and numbers of a block of geometries.
SAMPLES, _BLOCK = 256, 1 << 17
#: Pairs of points by which the curvature of a model is found.
PAIRS = 32
#: Readings of so many standard deviations of the noise are looked at as a logarithm and ratios.
_BRIGHT = 3.0
#: Remaining materials at most, the most probable.
_MOST = 8


@dataclass(frozen=True)
class NextMeasurement:
    """What a reading at each of G geometries is expected to tell, the best geometry first.

    Attributes
    ----------
    materials, probability
        The C remaining materials, and their probabilities given that it is one of these, shape (C,).
    geometries
        Where the reading is taken.
    information
        Expected information on the material in bits, shape (G,).
    expected_right
        How often the most probable material is the true one after the reading, shape (G,).
    expected_left
        How many of the remaining materials the set holds after the reading, at the confidence of the set so far,
        shape (G,).
    channels
        What is read, K of them.
    mean, std
        What each material predicts of the reading, on the scale of the data so far, and its standard deviation: of the
        specimen, of gain and angle, and of the noise; shape (G, C, K).
    noise
        Relative and absolute part of the noise of each channel, shape (K, 2).
    """

    materials: tuple[str, ...]
    probability: np.ndarray
    geometries: Protocol = field(repr=False)
    information: np.ndarray = field(repr=False)
    expected_right: np.ndarray = field(repr=False)
    expected_left: np.ndarray = field(repr=False)
    channels: tuple[str, ...]
    mean: np.ndarray = field(repr=False)
    std: np.ndarray = field(repr=False)
    noise: np.ndarray = field(repr=False)

    @property
    def entropy(self) -> float:
        """What is not yet known of the material, in bits: no reading tells more."""
        p = self.probability[self.probability > 0.0]
        return float(-(p * np.log2(p)).sum())

    @property
    def right_now(self) -> float:
        """Probability of the most probable material before the reading."""
        return float(self.probability.max())


def next_measurement(
    identification: Identification,
    geometries: Protocol | tuple[ArrayLike, ArrayLike, ArrayLike] | None = None,
    *,
    noise: float | None = None,
) -> NextMeasurement:
    """Rank geometries by what one more reading there would tell about the material.

    Parameters
    ----------
    identification
        Of the data so far. The eight most probable materials of its set count; where that has fewer than two, the two
        most probable ones.
    geometries
        Where the reading could be taken, a protocol or θ_i, θ_r, φ in radians; None takes those in the plane of
        incidence that resolve each remaining material's lobe (:func:`pbrdf.planning.candidates.in_plane_candidates`).
    noise
        Standard uncertainty of the next reading as a part of its intensity; None takes the relative and the absolute
        part that describe the uncertainties of the data so far best, channel by channel.

    Raises
    ------
    FitError
        If the library has fewer than two materials, ``noise`` is not above 0, or parameters of a fit were identified.
    """
    if noise is not None and not (math.isfinite(noise) and noise > 0.0):
        raise FitError(f"noise={noise:g}: give the next reading's as a part of its intensity, like 0.01")
    materials, probability = _remaining(identification)
    data = identification.data
    if data is None:
        raise FitError(
            "fitted parameters were identified: what to measure next is told where the data are at hand"
        )
    protocol = _protocol(geometries, materials)
    form = _at(protocol, data)
    parts = _parts(data) if noise is None else np.array([(noise, 0.0)] * len(data.channels))
    shape = (len(protocol.theta_i), len(materials), len(data.channels))
    mean, covariance = np.empty(shape), np.empty((*shape, shape[-1]))
    angle, found = identification.angle, []
    for c, material in enumerate(materials):
        z, information, centre = posterior(material, [data], gain=identification.gain, angle=angle)
        found.append((z[0], np.linalg.inv(information[0]), None if centre is None else float(centre[0])))
        mean[:, c], J = linearised(material, z[0], found[c][2], angle, form)
        covariance[:, c] = J @ found[c][1] @ J.transpose(0, 2, 1)
    variance, bright = _noise(mean, probability, data, parts)
    covariance = identification.temperature * (covariance + variance[..., None] * np.eye(shape[-1]))
    limit = _limits(identification, materials, len(data.channels))
    written, spread = _as_ratios(mean, covariance, bright, data)
    for c, material in enumerate(materials):
        shift, more = _curvature(material, *found[c], form, bright)
        written[:, c] += shift
        spread[:, c] += identification.temperature * more
    try:
        information, right, left = expected_information(probability, written, spread, limit)
    except np.linalg.LinAlgError as error:
        raise FitError(
            "what a reading would tell cannot be computed: its noise is next to nothing"
        ) from error
    order = np.argsort(-information, kind="stable")
    return NextMeasurement(
        materials=tuple(material.name for material in materials),
        probability=probability,
        geometries=protocol.subset(order),
        information=information[order],
        expected_right=right[order],
        expected_left=left[order],
        channels=data.channels,
        mean=mean[order],
        std=np.sqrt(np.einsum("gckk->gck", covariance[order])),
        noise=parts,
    )


def expected_information(
    probability: np.ndarray, mean: np.ndarray, covariance: np.ndarray, limit: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mutual information of a class and a reading that is normal in each class, and what a choice after it is worth.

    Parameters
    ----------
    probability
        Of the C classes, shape (C,).
    mean, covariance
        Of the K numbers of the reading at G geometries, shapes (G, C, K) and (G, C, K, K).
    limit
        Squared distance of a reading beyond which a class is out, shape (C,).

    Returns
    -------
    information, right, left
        Bits, expected rate of right choices and expected number of classes that are not out; shape (G,) each.
    """
    from scipy.special import ndtri

    count, classes, size = mean.shape
    normal = ndtri(sobol_points(size, SAMPLES)).T
    with np.errstate(divide="ignore"):
        log_p = np.log(probability)
    information, right, left = np.empty((3, count))
    step = max(_BLOCK // (classes**2 * size * SAMPLES), 1)
    for begin in range(0, count, step):
        rows = slice(begin, begin + step)
        m, root = mean[rows], np.linalg.cholesky(covariance[rows])
        inverse = np.linalg.inv(root)
        log_det = np.log(np.einsum("gckk->gck", root)).sum(axis=-1)
        # [g, k, c]: drawn from class c, looked at as of class k
        off = np.einsum("gkij,gkcj->gkci", inverse, m[:, None] - m[:, :, None])
        turned = inverse[:, :, None] @ root[:, None]
        squares = np.square(turned @ normal + off[..., None]).sum(axis=-2)
        log_likelihood = -0.5 * squares - log_det[:, :, None, None]
        joint = log_likelihood + log_p[:, None, None]
        top = joint.max(axis=1)
        total = top + np.log(np.exp(joint - top[:, None]).sum(axis=1))
        own = np.einsum("gccs->gcs", log_likelihood)
        # -inf of a class that cannot be meets a weight of 0
        information[rows] = np.einsum("c,gc->g", probability, (own - total).mean(axis=-1))
        right[rows] = np.einsum("c,gc->g", probability, np.exp(top - total).mean(axis=-1))
        inside = (squares < limit[:, None, None]).mean(axis=-1).sum(axis=1)
        left[rows] = np.einsum("c,gc->g", probability, inside)
    return np.maximum(information, 0.0) / math.log(2.0), right, left


def _limits(identification: Identification, materials: Sequence[Material], channels: int) -> np.ndarray:
    """Squared distances of the next reading, over the temperature, beyond which materials leave the set; (C,)."""
    from scipy.special import gammainccinv

    used = identification.library.calibration
    least = np.full(len(materials), 1.0 - identification.confidence)
    if used is not None:
        names = list(used.names)
        least = used.least_scores(identification.confidence)[[names.index(m.name) for m in materials]]
    freedom = identification.degrees_of_freedom + channels
    so_far = np.array([identification[material.name].distance for material in materials])
    return np.asarray((2.0 * gammainccinv(0.5 * freedom, least) - so_far) / identification.temperature)


def _remaining(identification: Identification) -> tuple[list[Material], np.ndarray]:
    """Materials to be told apart, and their probabilities."""
    ranked = identification.candidates
    if len(ranked) < 2:
        raise FitError("the library has one material: there is nothing to tell it apart from")
    chosen = [candidate for candidate in ranked if candidate.accepted][:_MOST]
    if len(chosen) < 2:
        chosen = list(ranked[:2])
    probability = np.array([candidate.probability for candidate in chosen])
    return [identification.library[c.name] for c in chosen], probability / probability.sum()


def _curvature(
    material: Material,
    z: np.ndarray,
    covariance: np.ndarray,
    centre: float | None,
    form: Observations,
    bright: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """What the curvature of the model adds to the mean (G, K) and the covariance (G, K, K) of a reading as written.

    Of points drawn in pairs about the mode the mean of a pair less the value at the mode has no linear part; the rest
    of a pair is all but linear. An offset of the angle is as good as linear.
    """
    from scipy.special import ndtri

    off = ndtri(sobol_points(len(z), PAIRS, seed=1)) @ np.linalg.cholesky(covariance).T
    points = z + np.concatenate([np.zeros_like(z)[None], off, -off])
    size = len(material.mean)
    unknowns = np.clip(material.mean + points[:, :size] @ material.root.T, *material.space.box)
    shown = specimens_shown(material, material.space.to_parameters(unknowns), form, form.channels)
    if centre is not None:
        gain = np.exp(GAIN_SPREAD * (points[:, size] - z[size]))[:, None]
        shown = {name: values if is_ratio(name) else gain * values for name, values in shown.items()}
    place = _intensity(form)
    if place is not None:
        intensity = np.maximum(shown[form.channels[place]], np.finfo(float).tiny)
        shown = {
            name: np.where(bright, np.log(intensity) if k == place else values / intensity, values)
            if k == place or not is_ratio(name)
            else values
            for k, (name, values) in enumerate(shown.items())
        }
    stacked = np.stack([shown[name] for name in form.channels], axis=-1)
    even = 0.5 * (stacked[1 : PAIRS + 1] + stacked[PAIRS + 1 :]) - stacked[0]
    mean = even.mean(axis=0)
    even -= mean
    return mean, np.einsum("sgk,sgl->gkl", even, even) / PAIRS


def _protocol(
    geometries: Protocol | tuple[ArrayLike, ArrayLike, ArrayLike] | None, materials: list[Material]
) -> Protocol:
    if isinstance(geometries, Protocol):
        return geometries
    if geometries is not None:
        theta_i, theta_r, phi = np.broadcast_arrays(
            *(np.atleast_1d(np.asarray(angle, dtype=float)) for angle in geometries)
        )
        return Protocol(
            theta_i,
            theta_r,
            phi,
            np.ones(len(phi), dtype=int),
            np.full(len(phi), np.nan),
            name="given geometries",
        )
    found = [in_plane_candidates(material.model) for material in materials]

    def joined(name: str) -> np.ndarray:
        return np.concatenate([getattr(one, name) for one in found])

    # positions of the camera are the same for all, sample angles of wide lobes may stand among those of narrow ones
    group, sample_angle = joined("group"), joined("sample_angle")
    _, kept = np.unique(np.round(np.stack([group, sample_angle], axis=1), 6), axis=0, return_index=True)
    return Protocol(
        joined("theta_i")[kept],
        joined("theta_r")[kept],
        joined("phi")[kept],
        group[kept],
        sample_angle[kept],
        "scattering",
        found[0].name,
    )


def _at(protocol: Protocol, data: Observations) -> Observations:
    """What is read there: channels and illumination of the data so far."""
    shape = (len(data.channels), len(protocol.theta_i))
    return Observations(
        protocol.theta_i,
        protocol.theta_r,
        protocol.phi,
        data.channels,
        np.zeros(shape),
        np.ones(shape),
        data.illumination,
        data.std_known,
    )


def _intensity(data: Observations) -> int | None:
    """Number of the channel of the intensity."""
    for name in ("I", "m00"):
        if name in data.channels:
            return data.channels.index(name)
    return None


def _parts(data: Observations) -> np.ndarray:
    """Relative and absolute part of each channel's noise that describe the data's uncertainties best, shape (K, 2).

    A ratio, and all where there is no intensity, has an absolute part only.
    """
    place = _intensity(data)
    parts = np.zeros((len(data.channels), 2))
    for k, (name, std) in enumerate(zip(data.channels, data.std, strict=True)):
        known = np.isfinite(std)
        if place is not None and not is_ratio(name):
            known &= np.isfinite(data.std[place])
        if not known.any():
            continue
        if place is None or is_ratio(name):
            parts[k, 1] = np.sqrt(typical(std[known] ** 2))
            continue
        size = np.abs(data.values[place, known])
        unit = typical(size)
        # equal relative weights of the variances; the relative part first, for which one of two is enough
        columns = np.stack([size**2, np.full_like(size, unit**2)], axis=1) / std[known, None] ** 2
        relative, absolute = np.sqrt(non_negative(columns))
        parts[k] = relative, absolute * unit
    return parts


def non_negative(columns: np.ndarray) -> np.ndarray:
    """Coefficients, none below 0, of two columns of non-negative numbers whose sum is closest to ones."""
    products, sums = columns.T @ columns, columns.sum(axis=0)
    alone = sums / np.diag(products)
    determinant = products[0, 0] * products[1, 1] - products[0, 1] ** 2
    if determinant > 1e-12 * products[0, 0] * products[1, 1]:
        both = np.linalg.solve(products, sums)
        if (both >= 0.0).all():
            return both
    # of one column alone the sum of squares falls by sum * coefficient
    best = 0 if sums[0] * alone[0] >= sums[1] * alone[1] else 1
    return np.where(np.arange(2) == best, alone, 0.0)


def _noise(
    mean: np.ndarray, probability: np.ndarray, data: Observations, parts: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Variances of the noise of predicted readings (G, C, K), and which geometries are bright for all, shape (G,).

    Where the noise drowns the signal it tells nothing, so that it is the same for all materials there.
    """
    place = _intensity(data)
    of_ratio = np.array([is_ratio(name) for name in data.channels])
    size = np.ones(mean.shape[:2]) if place is None else np.abs(mean[..., place])
    bright = np.zeros(len(mean), dtype=bool)
    if place is not None:
        bright = (mean[..., place] > _BRIGHT * np.hypot(parts[place, 0] * size, parts[place, 1])).all(axis=1)
        size = np.where(bright[:, None], size, (size @ probability)[:, None])
    relative = np.where(of_ratio, 1.0, size[..., None]) * parts[:, 0]
    return np.maximum(relative**2 + parts[:, 1] ** 2, np.finfo(float).tiny), bright


def _as_ratios(
    mean: np.ndarray, covariance: np.ndarray, bright: np.ndarray, data: Observations
) -> tuple[np.ndarray, np.ndarray]:
    """ln I and channels over I at bright geometries; the information does not depend on how a reading is written."""
    place = _intensity(data)
    if place is None:
        return mean, covariance
    own = mean[bright]
    size = own[..., place]
    slope = np.broadcast_to(np.eye(own.shape[-1]), (*own.shape, own.shape[-1])).copy()
    slope[..., place, place] = 1.0 / size
    written = own.copy()
    written[..., place] = np.log(size)
    for k, name in enumerate(data.channels):
        if k != place and not is_ratio(name):
            written[..., k] = own[..., k] / size
            slope[..., k, k] = 1.0 / size
            slope[..., k, place] = -own[..., k] / size**2
    mean, covariance = mean.copy(), covariance.copy()
    mean[bright], covariance[bright] = written, slope @ covariance[bright] @ slope.swapaxes(-1, -2)
    return mean, covariance
