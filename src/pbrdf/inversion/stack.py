"""Observations of many data sets of one form, as whole arrays: the pixels of a map, or sets that are fitted together.

Arrays run over the geometries first, then over the data sets: lanes side by side, one for each data set, read numbers
side by side, and a map's arrays lie like that in files.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from pbrdf.backend import get_backend
from pbrdf.data.schema import COVARIANCE, is_ratio
from pbrdf.errors import FitError
from pbrdf.inversion.noise import Noise
from pbrdf.inversion.observations import SINGULAR, Observations, measurements
from pbrdf.inversion.statistics import middle
from pbrdf.optics.angles import rounded_azimuth
from pbrdf.optics.stokes import STOKES

__all__ = ["Stack"]


@dataclass(frozen=True, eq=False)
class Stack:
    """What :class:`~pbrdf.inversion.observations.Observations` are for one data set, for B of them.

    Attributes
    ----------
    theta_i, theta_r, phi
        Angles in radians, shape (G, 1) where all data sets share the three of them, else (G, B).
    channels, illumination
        As of one data set; the same for all. A channel may be missing in some.
    values, std
        Shape (C, G, B). Not measured: ``values`` 0 and ``std`` infinite.
    std_known, unstated
        Shape (B,).
    group, wavelength
        Shape (G,), the same for all, or None.
    scale
        Factor that brought the data to the scale of a BRDF, shape (G, 1) or (G, B); None for 1.
    whitening
        Entries (i, j) of :attr:`Observations.whitening`, each of shape (G, B); None where errors are independent.
    """

    theta_i: np.ndarray
    theta_r: np.ndarray
    phi: np.ndarray
    channels: tuple[str, ...]
    values: np.ndarray
    std: np.ndarray
    illumination: tuple[float, float, float, float]
    std_known: np.ndarray
    unstated: np.ndarray
    group: np.ndarray | None = None
    wavelength: np.ndarray | None = None
    scale: np.ndarray | None = None
    whitening: Mapping[tuple[int, int], np.ndarray] | None = None
    _uploaded: dict[tuple[str, Any], Any] = field(default_factory=dict, repr=False)

    @classmethod
    def of(cls, data: Sequence[Observations]) -> Stack:
        """From data sets of the same form.

        Raises
        ------
        FitError
            If the data sets differ in form.
        """
        first = data[0]
        for other in data[1:]:
            if other.channels != first.channels or other.values.shape != first.values.shape:
                raise FitError(
                    "data sets fitted together must have the same channels and number of geometries"
                )
            if other.illumination != first.illumination:
                raise FitError("data sets fitted together must have the same illumination")

        def is_first(o: Observations, name: str) -> bool:
            own, kept = getattr(o, name), getattr(first, name)
            return own is kept or np.array_equal(own, kept)

        angles = ("theta_i", "theta_r", "phi")
        same = all(is_first(o, name) for o in data[1:] for name in angles)
        seen = data[:1] if same else data
        whitening = None
        if any(o.correlation is not None for o in data):
            whole = np.stack([o.whitening for o in data], axis=-1)
            size = len(first.channels)
            whitening = {(i, j): whole[i, j] for i in range(size) for j in range(i + 1)}
        theta_i, theta_r, phi = (np.stack([getattr(o, name) for o in seen], axis=-1) for name in angles)
        return cls(
            theta_i,
            theta_r,
            phi,
            channels=first.channels,
            values=np.ascontiguousarray(np.stack([o.values for o in data]).transpose(1, 2, 0)),
            std=np.ascontiguousarray(np.stack([o.std for o in data]).transpose(1, 2, 0)),
            illumination=first.illumination,
            std_known=np.array([o.std_known for o in data]),
            unstated=np.array([o.unstated for o in data]),
            group=first.group,
            wavelength=first.wavelength,
            scale=None if first.scale is None else first.scale[:, None],
            whitening=whitening,
        )

    @classmethod
    def from_columns(
        cls,
        columns: Mapping[str, np.ndarray],
        angles: Mapping[str, np.ndarray],
        quantity: str,
        illumination: Sequence[float],
        *,
        noise: Noise | None = None,
        objective: str = "stokes",
        covariance: tuple[Sequence[str], np.ndarray] | None = None,
        group: np.ndarray | None = None,
        wavelength: np.ndarray | None = None,
    ) -> Stack:
        """From the variables of a map; whatever no measurement can be at a pixel and geometry is left out there.

        That are directions at or below the horizon, infinite values, uncertainties of 0 or less, and covariances that
        are not positive definite.

        Parameters
        ----------
        columns
            Data variables of the schema by name, shape (G, B), matrices (4, 4, G, B).
        angles
            ``theta_i``, ``theta_r``, ``phi`` in radians, all of shape (G, 1) or all of (G, B).
        quantity, illumination
            Attributes of the data set.
        noise, objective
            See :meth:`Observations.from_dataset`.
        covariance
            Names of Stokes components and their covariance at each geometry, shape (G, C, C), on the data's own scale,
            for all data sets; it replaces all other statements of noise.
        group, wavelength
            Shape (G,).

        Raises
        ------
        FitError
            If nothing was measured.
        """
        stated = None if covariance is not None else columns.get(COVARIANCE)
        kept = {
            name: values
            for name, values in columns.items()
            if name != COVARIANCE and not (covariance is not None and name.endswith("_std"))
        }
        possible = _possible(angles)
        found = measurements(
            {name: _leading(_usable(name, v, kept, possible)) for name, v in kept.items()},
            angles["theta_i"].T,
            quantity,
            noise,
            objective,
        )
        size, shape = len(found.channels), found.values[0].T.shape

        def whole(of: list[np.ndarray]) -> np.ndarray:
            return np.ascontiguousarray(np.stack([channel.T for channel in of]))

        theta_i, theta_r, phi = (np.nan_to_num(angles[name]) for name in ("theta_i", "theta_r", "phi"))
        stack = cls(
            theta_i,
            theta_r,
            phi,
            channels=found.channels,
            values=whole(found.values),
            std=whole(found.std),
            illumination=tuple(float(v) for v in illumination),  # type: ignore[arg-type]
            std_known=np.broadcast_to(found.std_known, shape[1]),
            unstated=np.broadcast_to(found.unstated, shape[1]),
            group=group,
            wavelength=wavelength,
            scale=None if quantity in ("brdf", "normalised") else found.scale.T,
        )
        if covariance is not None:
            return stack._with_covariance(*covariance)
        if noise is not None or objective == "paper":
            return stack
        if found.turned is not None and found.turned.any():
            q, u = stack.channels.index("Q_over_I"), stack.channels.index("U_over_I")
            return stack._whitened({(u, q): found.turned.T})
        if stated is None:
            return stack
        index = [STOKES.index(name) for name in found.channels]
        with np.errstate(all="ignore"):
            correlation = {
                (i, j): np.nan_to_num(
                    stated[index[i], index[j]]
                    / np.sqrt(stated[index[i], index[i]] * stated[index[j], index[j]]),
                    posinf=0.0,
                    neginf=0.0,
                )
                for i in range(size)
                for j in range(i)
            }
        return stack._whitened(correlation) if any(c.any() for c in correlation.values()) else stack

    def __len__(self) -> int:
        found: int = self.values.shape[-1]
        return found

    @property
    def points(self) -> int:
        """Number of geometries G."""
        found: int = self.values.shape[1]
        return found

    @property
    def count(self) -> np.ndarray:
        """Number of measured values of each data set, shape (B,)."""
        values: np.ndarray = np.isfinite(self.std).sum(axis=(0, 1))
        return values

    def take(self, chosen: np.ndarray) -> Stack:
        """Only some data sets; ``chosen`` is a mask of shape (B,) or an index array."""

        def some(values: np.ndarray) -> np.ndarray:
            return values if values.shape[-1] == 1 else values[..., chosen]

        return replace(
            self,
            theta_i=some(self.theta_i),
            theta_r=some(self.theta_r),
            phi=some(self.phi),
            values=self.values[..., chosen],
            std=self.std[..., chosen],
            std_known=self.std_known[chosen],
            unstated=self.unstated[chosen],
            scale=None if self.scale is None else some(self.scale),
            whitening=None
            if self.whitening is None
            else {k: w[:, chosen] for k, w in self.whitening.items()},
            _uploaded={},
        )

    def typical_intensity(self) -> np.ndarray:
        """Median of what was measured of the intensity above 0, shape (B,); NaN where there is nothing."""
        found = [c for c, name in enumerate(self.channels) if name in ("I", "m00")]
        if not found:
            return np.full(len(self), np.nan)
        intensity = self.values[found].reshape(-1, len(self))
        median = middle(intensity, intensity > 0.0, axis=0)[0]
        return np.where(np.isfinite(median), median, np.nan)

    def different_values(self) -> np.ndarray:
        """Number of values that a model can tell apart, shape (B,): see :meth:`Observations.distinct`."""
        # several numbers in one: it differs where any of them does
        place = (
            np.round(self.theta_i, 9) + np.pi * np.round(self.theta_r, 9) + math.e * rounded_azimuth(self.phi)
        )
        for factor, column in ((math.sqrt(2.0), self.group), (math.sqrt(3.0), self.wavelength)):
            if column is not None:
                place = place + factor * np.unique(column, return_inverse=True)[1][:, None]
        measured = np.isfinite(self.std)
        if place.shape[1] == 1 and len(np.unique(place)) == len(place):
            values: np.ndarray = measured.sum(axis=(0, 1))
            return values
        total = np.zeros(len(self), dtype=int)
        for channel in measured:
            ordered = np.sort(np.where(channel, place, np.inf), axis=0)
            with np.errstate(invalid="ignore"):
                new = np.diff(ordered, axis=0, prepend=-np.inf) > 0.0
            total += (new & np.isfinite(ordered)).sum(axis=0)
        return total

    def upload(self, name: str, Float: Any) -> list[Any]:
        """Arrays of one attribute in memory of Dr.Jit's own, as they are read by a fit; kept for the next."""
        key = (name, Float)
        if key not in self._uploaded:
            arrays: list[np.ndarray]
            if name == "weights":
                arrays = list(1.0 / self.std)
            elif name == "whitening":
                arrays = list((self.whitening or {}).values())
            elif name == "values":
                arrays = list(self.values)
            else:
                arrays = [getattr(self, name)]
            self._uploaded[key] = [get_backend().upload(Float, array.ravel()) for array in arrays]
        found: list[Any] = self._uploaded[key]
        return found

    def _with_covariance(self, names: Sequence[str], covariance: np.ndarray) -> Stack:
        """With the covariance of channels at each geometry, shape (G, C, C), for all data sets."""
        size = len(self.channels)
        index = [names.index(name) for name in self.channels]
        covariance = covariance[:, index][:, :, index]
        diagonal = np.sqrt(np.einsum("gcc->cg", covariance))[..., None]
        scale = np.ones((size, 1, 1))
        if self.scale is not None:
            scale = np.stack(
                [np.ones_like(self.scale) if is_ratio(name) else self.scale for name in self.channels]
            )
        std = np.where(np.isfinite(self.std), diagonal * scale, np.inf)
        known = replace(self, std=std, std_known=np.ones(len(self), dtype=bool))
        return known._whitened(
            {
                (i, j): (covariance[:, i, j] / (diagonal[i, :, 0] * diagonal[j, :, 0]))[:, None]
                for i in range(size)
                for j in range(i)
            }
        )

    def _whitened(self, correlation: Mapping[tuple[int, int], np.ndarray]) -> Stack:
        """With correlations of channels i > j; what makes a matrix singular is left out with its geometry."""
        size = len(self.channels)
        measured = np.isfinite(self.std)
        factor: dict[tuple[int, int], np.ndarray] = {}
        singular = np.zeros(measured.shape[1:], dtype=bool)
        for i in range(size):
            for j in range(i + 1):
                value = np.ones(measured.shape[1:]) if i == j else np.zeros(measured.shape[1:])
                if (i, j) in correlation:
                    value = np.where(measured[i] & measured[j], correlation[i, j], 0.0)
                for q in range(j):
                    value = value - factor[i, q] * factor[j, q]
                if i == j:
                    singular |= ~(value > SINGULAR)
                    factor[i, i] = np.sqrt(np.maximum(value, SINGULAR))
                else:
                    factor[i, j] = value / factor[j, j]
        std = np.where(singular, np.inf, self.std)
        inverse: dict[tuple[int, int], np.ndarray] = {}
        whitening: dict[tuple[int, int], np.ndarray] = {}
        for i in range(size):
            inverse[i, i] = 1.0 / factor[i, i]
            for j in range(i):
                total = sum(factor[i, q] * inverse[q, j] for q in range(j, i))
                inverse[i, j] = -total * inverse[i, i]
            for j in range(i + 1):
                whitening[i, j] = inverse[i, j] / std[j]
        return replace(self, std=std, whitening=whitening, _uploaded={})


def _leading(values: np.ndarray) -> np.ndarray:
    """(…, G, B) as (B, G, …): a view."""
    if values.ndim == 2:
        return values.T
    return values.transpose(3, 2, 0, 1)


def _possible(angles: Mapping[str, np.ndarray]) -> np.ndarray:
    """Where source and viewer are above the horizon."""
    with np.errstate(invalid="ignore"):
        above = [(angles[name] >= 0.0) & (angles[name] < 0.5 * np.pi) for name in ("theta_i", "theta_r")]
    values: np.ndarray = above[0] & above[1] & np.isfinite(angles["phi"])
    return values


def _usable(
    name: str, values: np.ndarray, columns: Mapping[str, np.ndarray], possible: np.ndarray
) -> np.ndarray:
    """Values of a variable, NaN where they, their uncertainty or their directions are none."""
    if name.endswith("_std"):
        return values
    with np.errstate(invalid="ignore"):
        impossible = np.isinf(values) | ~possible
        if (std := columns.get(f"{name}_std")) is not None:
            impossible |= (std <= 0.0) | np.isinf(std)
    return np.where(impossible, np.nan, values) if impossible.any() else values
