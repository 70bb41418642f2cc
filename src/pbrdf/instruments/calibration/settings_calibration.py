"""Calibration of a polarimeter's settings: axes, retardances, diattenuation, gain and offset from known inputs.

The readings are I_nk = g_n W_n(settings) · S_k + b of N states at K inputs. Fewer unknowns than the 4N elements of W,
and numbers that say what is wrong with the instrument; but wrong where the instrument is not what its model says.

Not every setting can be told from every set of inputs. Two retarders with a retardance of their own in each state reach
every point of the Poincaré sphere from (almost) any axes, so that the axes are free to choose: therefore states that
are driven alike share a retardance. With inputs that are all of the same intensity the offset is part of the gain and
the diattenuation. What the readings do not tell is kept at its nominal value, and said so; values and errors of the
others hold if that value is true, the analyser vectors in any case.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from pbrdf.errors import DataError, FitError
from pbrdf.instruments.calibration.analyzer_calibration import Accuracy, accuracy_of, reduced_inputs
from pbrdf.instruments.calibration.parametric_polarimeter import ParametricPolarimeter
from pbrdf.instruments.polarimeter.polarimeter import Polarimeter

__all__ = ["ModelCalibration", "calibrate_model"]

#: A setting is not determined if its derivative keeps less than this share of its length across all those before it.
_INDEPENDENT = 1e-5

#: A derivative shorter than this share of the longest is rounding.
_NO_EFFECT = 1e-10

#: Radians by which settings are moved at random to judge that: a nominal design may be a singular point.
_NUDGE = 0.03


@dataclass(frozen=True, eq=False)
class ModelCalibration:
    """Calibrated settings.

    Attributes
    ----------
    names
        Of all settings, with the state or the retarder they belong to.
    values, errors
        Of the settings and their standard errors; angles and retardances in degrees. The error is 0 for a fixed one,
        and NaN if there are no more readings than settings and no variances.
    start
        Nominal values, in the same units; of a gain what the readings are at first sight.
    fixed
        Why a setting was kept at its nominal value, by name.
    covariance
        Of the settings that were fitted, in the order of `names`, in the same units.
    polarimeter
        With the analyser vectors of the settings, gain included.
    residual
        Rms of what the model leaves, over the mean intensity.
    chi2
        Σ (residual/σ)²; None without variances.
    freedom
        Readings minus settings fitted.
    accuracy
        Rms errors at the inputs held out; None if none was.
    held_out
        Their indices.
    found
        Stokes vectors that the readings give, shape (4, K); of an input held out by settings in which it has no part.
    """

    names: tuple[str, ...]
    values: np.ndarray
    errors: np.ndarray
    start: np.ndarray
    fixed: dict[str, str]
    covariance: np.ndarray
    polarimeter: Polarimeter
    residual: float
    chi2: float | None
    freedom: int
    accuracy: Accuracy | None
    held_out: tuple[int, ...]
    found: np.ndarray

    def value(self, name: str) -> float:
        """Value of a setting."""
        return float(self.values[self.names.index(name)])

    def error(self, name: str) -> float:
        """Standard error of a setting."""
        return float(self.errors[self.names.index(name)])


def calibrate_model(
    nominal: Polarimeter,
    intensities: ArrayLike,
    stokes: ArrayLike,
    *,
    variance: ArrayLike | None = None,
    gain: Literal["common", "each", "fixed"] = "common",
    fixed: Sequence[str] = ("analyzer",),
    shared: bool = True,
    held_out: Sequence[int] | Literal["each"] = (),
) -> ModelCalibration:
    """Fit the settings of a polarimeter to readings at known inputs.

    Parameters
    ----------
    nominal
        Made by its settings (`lcvr`, `rotating_retarder`, `rotating_polarizer`, `division_of_focal_plane`); the fit
        starts from them.
    intensities
        Signal above black level, shape (N, K).
    stokes
        The inputs, shape (4, K). An input without light, S = 0, tells the offset.
    variance
        Of the intensities, the same shape; without it all weigh the same, and standard errors follow the residuals.
    gain
        One for all states, one for each (a source that drifts, exposures that differ), or 1.
    fixed
        Names of settings to keep at their nominal value; a name without its number stands for all of that name. The
        axes of the inputs are the reference for all angles.
    shared
        Whether states with the same nominal retardance share it (they are driven by the same voltage).
    held_out
        Indices of inputs that only verify; or ``"each"``: the settings come from all inputs, and each in turn that is
        not dark is reduced with those of a fit without it.

    Returns
    -------
    ModelCalibration

    Raises
    ------
    DataError
        If the shapes do not fit, the polarimeter is not made by its settings, or a name is not known.
    FitError
        If the fit does not converge.
    """
    from scipy.optimize import least_squares

    read, S = np.asarray(intensities, dtype=float), np.asarray(stokes, dtype=float)
    spread = np.ones_like(read) if variance is None else np.asarray(variance, dtype=float)
    if read.ndim != 2 or read.shape[0] != nominal.size or S.shape != (4, read.shape[1]):
        raise DataError(
            f"intensities {read.shape} at Stokes vectors {S.shape}: give ({nominal.size}, inputs) and (4, inputs)"
        )
    if (
        spread.shape != read.shape
        or not (np.isfinite(read) & (spread > 0.0)).all()
        or not np.isfinite(S).all()
    ):
        raise DataError(
            "intensities and inputs must be finite, and their variances positive and of the same shape"
        )
    if isinstance(held_out, str):
        if held_out != "each":
            raise DataError(f"held_out is {held_out!r}: give indices of inputs, or 'each'")

        def without(*out: int) -> ModelCalibration:
            return calibrate_model(
                nominal, read, S, variance=variance, gain=gain, fixed=fixed, shared=shared, held_out=out
            )

        out = [k for k in range(S.shape[1]) if S[0, k] > 0.0]
        found = np.stack([without(k).found[:, k] for k in out], axis=1)
        return _verified(without(), out, found, S)
    kept = [k for k in range(S.shape[1]) if k not in set(held_out)]
    if len(set(held_out)) != S.shape[1] - len(kept):
        raise DataError(f"an input held out is not one of 0 … {S.shape[1] - 1}")
    train, sigma = S[:, kept], np.sqrt(spread[:, kept])
    settings = ParametricPolarimeter(
        nominal, gain, shared, start_gain=_start_gain(nominal, read[:, kept], train)
    )
    reasons = settings.reasons(fixed)

    def residuals(x: np.ndarray) -> np.ndarray:
        W, b, _ = settings.evaluate(x)
        values: np.ndarray = ((W @ train + b - read[:, kept]) / sigma).ravel()
        return values

    def slopes(x: np.ndarray) -> np.ndarray:
        _, _, rates = settings.evaluate(x)
        by_offset = settings.by_offset[:, None, None]
        values: np.ndarray = (
            ((np.einsum("pna,ak->pnk", rates, train) + by_offset) / sigma).reshape(len(x), -1).T
        )
        return values

    movable = settings.angular & np.array([name not in reasons for name in settings.names])
    nudge = np.random.default_rng(0).standard_normal(len(movable)) * _NUDGE * movable
    reasons |= _dependent(slopes(settings.start + nudge), settings, reasons)
    x = settings.start.copy()
    while True:
        free = np.array([name not in reasons for name in settings.names])
        fit = least_squares(
            lambda y, at=x, of=free: residuals(_put(at, of, y)),
            np.clip(x[free], settings.low[free], settings.high[free]),
            jac=lambda y, at=x, of=free: slopes(_put(at, of, y))[:, of],
            bounds=(settings.low[free], settings.high[free]),
            x_scale="jac",
            xtol=1e-12,
            ftol=1e-12,
            gtol=1e-12,
        )
        if fit.status <= 0:
            raise FitError(f"the calibration of {nominal.name} does not converge: {fit.message}")
        x = _put(x, free, fit.x)
        at_limit = free & ((x <= settings.low + 1e-9) | (x >= settings.high - 1e-9))
        if not at_limit.any():
            break
        # the others are fitted again with it held: there is no standard error at a limit
        x = np.where(at_limit, np.clip(x, settings.low, settings.high), x)
        reasons |= {settings.names[i]: "at its physical limit" for i in np.flatnonzero(at_limit)}
    J = slopes(x)[:, free]
    freedom = J.shape[0] - J.shape[1]
    left = residuals(x)
    covariance = np.linalg.pinv(J.T @ J, hermitian=True)
    if variance is None:
        covariance = covariance * (left @ left / freedom if freedom else np.nan)
    W, b, _ = settings.evaluate(x)
    errors = np.zeros(len(x))
    errors[free] = np.sqrt(np.diag(covariance))
    units = np.where(settings.angular, 180.0 / np.pi, 1.0)
    scale = units[free]
    details = {**settings.described(x), "calibrated": True}
    polarimeter = replace(nominal, analyzer=W, name=f"{nominal.name}, calibrated", details=details)
    made = ModelCalibration(
        names=tuple(settings.names),
        values=x * units,
        errors=errors * units,
        start=settings.start * units,
        fixed=reasons,
        covariance=covariance * np.outer(scale, scale),
        polarimeter=polarimeter,
        residual=float(np.sqrt(np.mean((left * sigma.ravel()) ** 2)) / np.mean(read[:, kept])),
        chi2=float(left @ left) if variance is not None else None,
        freedom=freedom,
        accuracy=None,
        held_out=(),
        found=reduced_inputs(W, read - b),
    )
    out = sorted(set(held_out))
    return _verified(made, out, made.found[:, out], S)


def _verified(made: ModelCalibration, out: list[int], found: np.ndarray, S: np.ndarray) -> ModelCalibration:
    """The calibration with what it finds at inputs held out, and the accuracy that follows."""
    everywhere = made.found.copy()
    everywhere[:, out] = found
    accuracy = accuracy_of(everywhere, S, out)
    polarimeter = made.polarimeter
    if accuracy is not None:
        polarimeter = polarimeter.with_accuracy(accuracy.linear, np.nan_to_num(accuracy.circular))
    return replace(made, polarimeter=polarimeter, accuracy=accuracy, held_out=tuple(out), found=everywhere)


def _put(x: np.ndarray, where: np.ndarray, values: np.ndarray) -> np.ndarray:
    full = x.copy()
    full[where] = values
    return full


def _start_gain(nominal: Polarimeter, read: np.ndarray, S: np.ndarray) -> float:
    expected = nominal.intensities(S)
    found = float((expected * read).sum() / (expected**2).sum()) if expected.any() else 0.0
    if not found > 0.0:
        raise DataError(
            "the intensities have nothing in common with those that the nominal polarimeter expects"
        )
    return found


def _dependent(J: np.ndarray, settings: ParametricPolarimeter, known: dict[str, str]) -> dict[str, str]:
    """Settings that the readings do not tell from those before them in the order of preference."""
    basis: list[np.ndarray] = []
    found = {}
    longest = np.linalg.norm(J, axis=0).max()
    for i in sorted(range(len(settings.names)), key=lambda i: settings.rank[i]):
        name = settings.names[i]
        if name in known:
            continue
        column = J[:, i].copy()
        length = np.linalg.norm(column)
        if length < _NO_EFFECT * longest:
            found[name] = "without effect"
            continue
        for _ in range(2):
            for vector in basis:
                column -= (vector @ column) * vector
        rest = np.linalg.norm(column)
        if rest < _INDEPENDENT * length:
            found[name] = "these inputs do not tell it from the other settings"
        else:
            basis.append(column / rest)
    return found
