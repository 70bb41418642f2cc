"""How well each material explains pixels that share their geometries: the likelihoods of
:mod:`pbrdf.identification.evidence`, with the models' signals from tables (:mod:`pbrdf.identification.emulator`).

A first look (:mod:`pbrdf.identification.screen`) leaves out, pixel by pixel, the materials that it cannot be. The mode
and the information of the others are found by the same solver; a lane is a pixel and a material that is left. Where the
tables' error counts beside the errors of the data, the model itself is evaluated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import gammainccinv

from pbrdf.data.schema import is_ratio
from pbrdf.identification.emulator import Emulator
from pbrdf.identification.evidence import GAIN_SPREAD, evidence
from pbrdf.identification.material import Material
from pbrdf.identification.quadratic_modes import Tables
from pbrdf.identification.screen import DATA, Screen
from pbrdf.inversion.observations import Observations

__all__ = ["SharedGeometry"]

#: A material is left out whose distance is beyond what one in so many of its pixels reach, and farther than the nearest
#: by so much that nothing is left of its probability.
BEYOND, FARTHER = 1e-6, 40.0
#: The tables' squared errors in units of the data's, summed, are no more than this part of the spread of the distance,
#: which is √(2 D) for D data; else the model itself is evaluated. Judged by so many pixels.
TOLERATED, JUDGES = 0.1, 1000


@dataclass(frozen=True, eq=False)
class SharedGeometry:
    """C materials seen at G geometries.

    Attributes
    ----------
    like
        Observations of one pixel: geometries, channels, illumination.
    emulators
        Of the materials.
    screen
        The first look.
    gain
        Whether the intensities of a pixel have a common factor that is not known.
    least
        Nominal probabilities below which no calibrated set reaches, shape (C,).
    temperature
        What the logarithms of likelihoods are divided by.
    """

    like: Observations
    emulators: tuple[Emulator, ...]
    screen: Screen
    gain: bool
    least: np.ndarray
    temperature: float

    @classmethod
    def of(
        cls,
        materials: Sequence[Material],
        like: Observations,
        *,
        gain: bool,
        least: np.ndarray | None = None,
        temperature: float = 1.0,
    ) -> SharedGeometry:
        """Tables of the materials; ``least`` is 1 where there is no calibration."""
        gain = gain and not all(is_ratio(channel) for channel in like.channels)
        emulators = tuple(Emulator.of(material, like) for material in materials)
        screen = Screen.of(emulators, like.channels, gain)
        least = np.ones(len(materials)) if least is None else least
        return cls(like, emulators, screen, gain, least, temperature)

    def evidence(self, values: np.ndarray, std: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Integrated likelihoods of N pixels.

        Parameters
        ----------
        values, std
            Shape (N, C, G), on the scale of a BRDF; not measured: 0 and infinite.

        Returns
        -------
        log_evidence, distance, degrees_of_freedom
            Shapes (N, C), (N, C) and (N,), as in :class:`~pbrdf.identification.evidence.Evidence`; minus infinity and
            infinity for materials that the first look left out.
        """
        count, kinds = len(values), len(self.emulators)
        measured = np.isfinite(std)
        freedom = measured.sum(axis=(1, 2)) - int(self.gain)
        flat = values.reshape(count, -1), std.reshape(count, -1)
        bound, specimen = self.screen.distance(*flat)
        rare = np.minimum(BEYOND, 0.01 * self.least)
        different, place = np.unique(np.maximum(freedom, 1), return_inverse=True)
        # a calibration speaks of the distance of all data
        looked = np.where(self.least < 1.0, different[:, None], np.minimum(different, DATA)[:, None])
        limit = 2.0 * gammainccinv(0.5 * looked, rare)[place]
        nearest = bound.min(axis=1, keepdims=True)
        keep = bound <= np.maximum(limit, nearest + FARTHER * max(self.temperature, 1.0))
        log_evidence = np.full((count, kinds), -np.inf)
        distance = np.full((count, kinds), np.inf)
        gains = self._gains(*flat) if self.gain else None
        for group in self._groups(keep, std):
            # ordered by material: its tables stay in the cache
            kind, pixel = np.nonzero(keep[:, group].T)
            kind = np.asarray(group)[kind]
            if isinstance(group, list):
                found = self._solved(kind, pixel, values, std, gains, specimen)
            else:
                found = self._exact(kind, pixel, values, std)
            log_evidence[pixel, kind], distance[pixel, kind] = found
        return log_evidence, distance, freedom

    def _groups(self, keep: np.ndarray, std: np.ndarray) -> list[Any]:
        """Numbers of the materials whose tables will do, in lists of as many unknowns; others in tuples."""
        groups: dict[int, list[int]] = {}
        exact = []
        for number, emulator in enumerate(self.emulators):
            own = np.flatnonzero(keep[:, number])
            weights = (1.0 / std[own[:: max(len(own) // JUDGES, 1)]] ** 2).reshape(-1, emulator.error.size)
            missed = weights @ emulator.error.ravel() ** 2
            spread = np.sqrt(2.0 * np.maximum((weights > 0.0).sum(axis=1), 1))
            if not own.size or np.median(missed / spread) <= TOLERATED:
                groups.setdefault(emulator.nodes.shape[1], []).append(number)
            else:
                exact.append((number,))
        return [*groups.values(), *exact]

    def _gains(self, values: np.ndarray, std: np.ndarray) -> np.ndarray:
        """Logarithm of the gain at which the mean of each material fits the intensities best, shape (N, C)."""
        middle = len(self.emulators[0].nodes) // 2
        own = self.screen.intensities
        means = np.array([np.swapaxes(e.table[middle, ..., 0], 0, 1).ravel()[own] for e in self.emulators])
        weights = 1.0 / std[:, own] ** 2
        along = (weights * values[:, own]) @ means.T
        found: np.ndarray = np.log(np.maximum(along / np.maximum(weights @ (means**2).T, 1e-300), 1e-12))
        return found

    def _exact(
        self, kind: np.ndarray, pixel: np.ndarray, values: np.ndarray, std: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        if not len(pixel):
            return np.empty(0), np.empty(0)
        data = [replace(self.like, values=values[n], std=std[n]) for n in pixel]
        found = evidence([self.emulators[kind[0]].material], data, gain=self.gain)
        return found.log_evidence[:, 0], found.distance[:, 0]

    def _solved(
        self,
        kind: np.ndarray,
        pixel: np.ndarray,
        values: np.ndarray,
        std: np.ndarray,
        gains: np.ndarray | None,
        specimen: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Log evidence and distance of pairs, shape (L,) each."""
        if not len(pixel):
            return np.empty(0), np.empty(0)
        used, own = np.unique(kind, return_inverse=True)
        emulators = [self.emulators[c] for c in used]
        centre = None if gains is None else gains.mean(axis=1)
        scaled = self.screen.intensities
        tables = Tables(emulators, values.reshape(len(values), -1), std.reshape(len(std), -1), scaled, centre)
        size = emulators[0].nodes.shape[1]
        start = np.zeros((len(pixel), size + int(self.gain)))
        start[:, :size] = specimen[pixel, kind, :size]
        if gains is not None and centre is not None:
            start[:, size] = (gains[pixel, kind] - centre[pixel]) / GAIN_SPREAD
        cost, half_log, z = tables.modes(own, pixel, start)
        of_gain = z[:, size] ** 2 if self.gain else 0.0
        return -cost - half_log, 2.0 * cost - of_gain
