"""Statements on the degree of polarisation. For natural light V = 0: it is the degree of linear polarisation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pbrdf.models import Model
from pbrdf.optics.stokes import dolp
from pbrdf.reproduction.interpretations import Interpretation
from pbrdf.reproduction.paper import FIGURE_3_INCIDENCE
from pbrdf.reproduction.plane import in_plane, offsets, turned, zero_crossings
from pbrdf.reproduction.statements.statement import Outcome, listed

__all__ = [
    "crossed_and_growing",
    "diffuse_dop",
    "equal_view_equal_dop",
    "falls_off_the_peak",
    "falls_to_zero_and_rises",
    "figure_3_cut",
    "maximum_grows",
    "ten_per_cent_angles",
    "zeros_beside_the_peak",
]

#: Statement 1: degree that "about 10 %" is, and angles of view (degrees) within which the paints must reach it.
_TEN_PER_CENT, _WITHIN = 0.10, (50.0, 75.0)
#: Turn of the sample off the peak (degrees) at which at most this share of the peak's degree must be left.
_OFF, _SHARE = 15.0, 0.5
#: Statement 17: from so far off the mirror direction, up to which angle of view, and which degree is not 0.
_CLEAR, _FARTHEST, _NOT_ZERO = 17.0, 78.0, 0.01
#: Statement 19: what an imager of 1 % linear accuracy cannot tell apart.
_SAME = 0.01


def ten_per_cent_angles(models: Sequence[Model]) -> np.ndarray:
    """θ_r in degrees from which the diffuse light is 10 % polarised, at θ_i = 10°; NaN where it never is."""
    theta_r = np.deg2rad(np.arange(0.0, 89.0, 0.25))
    found = []
    for model in models:
        degree = dolp(in_plane(model, np.deg2rad(10.0), theta_r, "diffuse"))
        reached = degree >= _TEN_PER_CENT
        found.append(float(np.rad2deg(theta_r[reached.argmax()])) if reached.any() else np.nan)
    return np.array(found)


def diffuse_dop(interpretation: Interpretation, positions: Sequence[float]) -> Outcome:
    """Statement 1: some paints have diffuse light that is polarised by about 10 %.

    The degree of polarisation of the diffuse part must reach 10 % at an angle of view between 50° and 75° for at
    least one sample.

    Value: that angle (degrees) of each sample, NaN where 10 % is never reached.
    """
    angles = ten_per_cent_angles(interpretation.samples())
    passed = bool(((angles >= _WITHIN[0]) & (angles <= _WITHIN[1])).any())
    shown = ", ".join("never" if np.isnan(a) else f"{a:.0f}°" for a in angles)
    return Outcome(tuple(map(float, angles)), passed, f"10 % at θr = {shown}")


def figure_3_cut(model: Model, theta_r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Intensity (1/sr) and signed polarisation Q/I at signed angles of view (radians) with figure 3's incidence."""
    stokes = in_plane(model, np.deg2rad(FIGURE_3_INCIDENCE), theta_r)
    return stokes[..., 0], stokes[..., 1] / stokes[..., 0]


def falls_to_zero_and_rises(interpretation: Interpretation, positions: Sequence[float]) -> Outcome:
    """Statement 4: figure 3, away from the mirror direction the degree of polarisation falls to 0 and then rises.

    In the plane of incidence, on both sides of the largest degree about the mirror direction: Q/I must pass through 0
    exactly once between there and 85°, the degree must fall on the way to that zero, and beyond it a degree of at least
    1 % must be reached.

    Value: zeros behind and ahead (degrees), the largest degree near the mirror direction and its angle.
    """
    theta_r = np.deg2rad(np.arange(-85.0, 85.001, 0.05))
    _, q = figure_3_cut(interpretation.figure_3(), theta_r)
    near = np.abs(theta_r - np.deg2rad(FIGURE_3_INCIDENCE)) < np.deg2rad(20.0)
    peak = int(np.argmax(np.where(near, -q, -np.inf)))
    zeros, good = [], True
    for side in (slice(peak, None, -1), slice(peak, None)):
        x, y = theta_r[side], q[side]
        crossings = zero_crossings(x, y)
        good &= len(crossings) == 1
        if not len(crossings):
            zeros.append(np.nan)
            continue
        first = float(crossings[0])
        before = np.abs(x - x[0]) < abs(first - x[0])
        good &= bool((np.diff(np.abs(y[before])) < 0.0).all()) and bool(y[~before].max() > 0.01)
        zeros.append(float(np.rad2deg(first)))
    behind, ahead = zeros
    where = float(np.rad2deg(theta_r[peak]))
    crossings = np.rad2deg(zero_crossings(theta_r, q))
    text = f"zeros at {listed(crossings, '.2f', '°')}; maximum {-100 * q[peak]:.1f} % at {where:.1f}°"
    return Outcome((behind, ahead, float(-q[peak]), where), bool(good and q[peak] < 0.0), text)


def falls_off_the_peak(interpretation: Interpretation, positions: Sequence[float]) -> Outcome:
    """Statement 15: a specular peak and a diffuse slope; off the peak the degree of polarisation falls quickly.

    15° of turn to either side of the mirror direction at most half of the peak's degree is left, for every sample and
    position.

    Value: for each sample the largest share that is left.
    """
    turn = np.concatenate([offsets(3.0), np.deg2rad([-_OFF, _OFF])])
    shares = []
    for model in interpretation.samples():
        degrees = dolp(in_plane(model, *turned(positions, turn)))
        shares.append(float((degrees[:, -2:].max(axis=1) / degrees[:, :-2].max(axis=1)).max()))
    return Outcome(
        tuple(shares),
        max(shares) <= _SHARE,
        f"left at ±15°: {listed([100 * s for s in shares], '.0f', ' %')}",
    )


def maximum_grows(interpretation: Interpretation, positions: Sequence[float]) -> Outcome:
    """Statement 16: the largest degree of polarisation grows from position 1 to 3, as β stays below Brewster's angle.

    For every sample the maxima must grow with the position, and Ψ/2 of the last position must be less than arctan n.

    Value: maxima of sample 3, then Ψ/2 of the last position and the smallest Brewster angle, degrees.
    """
    turn = offsets(9.0)
    maxima = np.array(
        [dolp(in_plane(model, *turned(positions, turn))).max(axis=1) for model in interpretation.samples()]
    )
    brewster = min(float(np.rad2deg(np.arctan(model.values["n"]))) for model in interpretation.samples())
    beta = float(np.rad2deg(positions[-1])) / 2.0
    passed = bool((np.diff(maxima, axis=1) > 0.0).all()) and beta < brewster
    text = f"sample 3: {listed(maxima[2], '.3f')}; Ψ/2 ≤ {beta:g}° < {brewster:.1f}°"
    return Outcome((*map(float, maxima[2]), beta, brewster), passed, text)


def crossed_and_growing(interpretation: Interpretation, positions: Sequence[float]) -> Outcome:
    """Statement 17: at large angles of view the degree of polarisation is not 0 and grows, and its plane is crossed.

    From 17° off the mirror direction to θ_r = 78°, every sample and position: the degree must exceed 1 % and grow
    with θ_r, with Q > 0 there and Q < 0 at the mirror direction, which is an AoLP 90° away from that of the peak.
    (The paper's absolute 90° counts from an axis of its instrument.)

    Value: smallest degree of each sample, then the number of samples for which it grows all the way, and 1 or 0
    for crossed or not.
    """
    least, growing, crossed = [], 0, True
    for model in interpretation.samples():
        degrees, grows = [], True
        for psi in positions:
            theta_r = np.deg2rad(np.arange(np.rad2deg(psi) / 2.0 + _CLEAR, _FARTHEST + 1e-9, 1.0))
            if len(theta_r) < 2:
                continue
            stokes = in_plane(model, psi - theta_r, theta_r)
            degrees.append(dolp(stokes))
            grows &= bool((np.diff(degrees[-1]) > 0.0).all())
            peak = in_plane(model, psi / 2.0, psi / 2.0)
            crossed &= bool((stokes[:, 1] > 0.0).all()) and bool(peak[1] < 0.0)
        least.append(float(np.concatenate(degrees).min()) if degrees else np.nan)
        growing += grows
    passed = crossed and growing == len(least) and min(least) > _NOT_ZERO
    shown = listed([100 * v for v in least], ".1f", " %")
    text = f"at least {shown}; grows for {growing} of {len(least)}; {'crossed' if crossed else 'not crossed'}"
    return Outcome((*least, float(growing), float(crossed)), bool(passed), text)


def zeros_beside_the_peak(interpretation: Interpretation, positions: Sequence[float]) -> Outcome:
    """Statement 18: the degree of polarisation passes through 0 on both sides of the peak.

    Q/I must change sign within 16° of turn on both sides of the mirror direction, for every sample and position.

    Value: turns (degrees) of the zeros left and right of the peak at the first position, of sample 1, then of sample 3.
    """
    turn = offsets(16.0)
    shown, passed = [], True
    for number, model in enumerate(interpretation.samples(), start=1):
        stokes = in_plane(model, *turned(positions, turn))
        for position, q in enumerate(stokes[..., 1] / stokes[..., 0]):
            zeros = np.rad2deg(zero_crossings(turn, q))
            left, right = zeros[zeros < 0.0], zeros[zeros > 0.0]
            passed &= bool(len(left) and len(right)) and bool(q[turn == 0.0][0] < 0.0)
            if number in (1, 3) and position == 0:
                shown += [float(left[-1]) if len(left) else np.nan, float(right[0]) if len(right) else np.nan]
    text = (
        f"position 1, sample 1: {listed(shown[:2], '+.2f', '°')}; sample 3: {listed(shown[2:], '+.2f', '°')}"
    )
    return Outcome(tuple(shown), passed, text)


def equal_view_equal_dop(interpretation: Interpretation, positions: Sequence[float]) -> Outcome:
    """Statement 19: right of the peak equal θ_r mean equal diffuse degree of polarisation, whatever the position.

    The degree of the diffuse part at θ_r = 40°, 60°, 70° must not vary by more than 0.01 (the imager's linear
    accuracy) over θ_i = 0°, 20°, 40°, 60°, for any sample.

    Value: largest variation of each sample.
    """
    theta_i, theta_r = np.deg2rad([[0.0], [20.0], [40.0], [60.0]]), np.deg2rad([40.0, 60.0, 70.0])
    spread = [
        float(np.ptp(dolp(in_plane(model, theta_i, theta_r, "diffuse")), axis=0).max())
        for model in interpretation.samples()
    ]
    return Outcome(tuple(spread), max(spread) <= _SAME, f"varies by {listed(spread, '.4f')}")
