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

from pbrdf.backend import get_backend
from pbrdf.data.schema import is_ratio
from pbrdf.identification.emulator import Emulator
from pbrdf.identification.evidence import GAIN_SPREAD, evidence
from pbrdf.identification.evidence import REACH as LIMIT
from pbrdf.identification.material import Material
from pbrdf.identification.screen import Screen
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.solver import Residuals, solve

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
        bound = self.screen.distance(*flat)
        rare = np.minimum(BEYOND, 0.01 * self.least)
        different, place = np.unique(np.maximum(freedom, 1), return_inverse=True)
        limit = 2.0 * gammainccinv(0.5 * different[:, None], rare)[place]
        nearest = bound.min(axis=1, keepdims=True)
        keep = bound <= np.maximum(limit, nearest) + FARTHER * max(self.temperature, 1.0)
        log_evidence = np.full((count, kinds), -np.inf)
        distance = np.full((count, kinds), np.inf)
        gains = self._gains(*flat) if self.gain else None
        for group in self._groups(keep, std):
            # ordered by material: its tables stay in the cache
            kind, pixel = np.nonzero(keep[:, group].T)
            kind = np.asarray(group)[kind]
            if isinstance(group, list):
                found = self._solved(kind, pixel, values, std, gains)
            else:
                found = self._exact(kind, pixel, values, std)
            log_evidence[pixel, kind], distance[pixel, kind] = found
        return log_evidence, distance, freedom

    def _groups(self, keep: np.ndarray, std: np.ndarray) -> list[Any]:
        """Numbers of the materials whose tables will do, by the number of their unknowns, in lists; others in tuples."""
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
        return np.log(np.maximum(along / np.maximum(weights @ (means**2).T, 1e-300), 1e-12))

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
    ) -> tuple[np.ndarray, np.ndarray]:
        """Log evidence and distance of pairs, shape (L,) each."""
        import drjit as dr

        backend = get_backend()
        Float, UInt32 = backend.Float, backend.UInt32
        if not len(pixel):
            return np.empty(0), np.empty(0)
        used, own_kind = np.unique(kind, return_inverse=True)
        emulators = [self.emulators[c] for c in used]
        materials = [e.material for e in emulators]
        channels = range(values.shape[1])
        points = values.shape[2]
        size = emulators[0].nodes.shape[1]
        terms = emulators[0].table.shape[-1]
        nodes = len(emulators[0].nodes)
        measured = [backend.upload(Float, values[:, c].ravel()) for c in channels]
        weights = [backend.upload(Float, (1.0 / std[:, c]).ravel()) for c in channels]
        table = backend.upload(Float, np.concatenate([e.table.ravel() for e in emulators]))
        centres = backend.upload(Float, np.concatenate([e.nodes.ravel() for e in emulators]))
        of_kind = np.array([_described(e) for e in emulators])
        described = backend.upload(Float, of_kind.ravel())
        width = of_kind.shape[1]
        axes = backend.upload(UInt32, np.array([e.axis for e in emulators], dtype=np.uint32))
        numbers = backend.upload(UInt32, pixel.astype(np.uint32))
        kinds = backend.upload(UInt32, own_kind.astype(np.uint32))
        centre = None
        if gains is not None:
            centre = backend.upload(Float, gains.mean(axis=1))
        stride = dr.opaque(UInt32, points)
        scaled = [not is_ratio(channel) for channel in self.like.channels]

        def function(z: list[Any], lane: Any, point: Any) -> tuple[list[Any], Any]:
            number, own = dr.gather(UInt32, numbers, lane), dr.gather(UInt32, kinds, lane)
            row = own * width
            read = lambda i: dr.gather(Float, described, row + i)  # noqa: E731
            u, at = [], 4 * size
            for i in range(size):
                value = read(i)
                for j in range(i + 1):
                    value = dr.fma(read(at), z[j], value)
                    at += 1
                u.append(dr.clip(value, read(size + i), read(2 * size + i)))
            axis = dr.gather(UInt32, axes, own)
            along = u[0]
            for i in range(1, size):
                along = dr.select(axis == i, u[i], along)
            # the node nearest to it
            position = (dr.detach(along) - read(3 * size)) * read(3 * size + 1)
            node = own * nodes + UInt32(dr.clip(position + 0.5, 0.0, nodes - 1.0))
            step = [u[i] - dr.gather(Float, centres, node * size + i) for i in range(size)]
            factor = None
            if centre is not None:
                factor = dr.exp(dr.fma(GAIN_SPREAD, z[size], dr.gather(Float, centre, number)))
            here = number * stride + point
            place = (node * stride + point) * (len(channels) * terms)
            residuals = []
            for c in channels:
                term = lambda i, c=c: dr.gather(Float, table, place + (c * terms + i))  # noqa: E731
                value, at = term(0), 1 + size
                for i in range(size):
                    slope = term(1 + i)
                    for j in range(i + 1):
                        slope = dr.fma(term(at), step[j], slope)
                        at += 1
                    value = dr.fma(slope, step[i], value)
                if factor is not None and scaled[c]:
                    value = value * factor
                residuals.append(
                    (value - dr.gather(Float, measured[c], here)) * dr.gather(Float, weights[c], here)
                )
            return residuals, None

        def penalty(z: list[Any]) -> list[tuple[int, Any, Any]]:
            return [(i, value, 1.0) for i, value in enumerate(z)]

        unknowns = size + int(gains is not None)
        start = np.zeros((len(pixel), unknowns))
        if gains is not None:
            start[:, size] = (gains[pixel, kind] - gains.mean(axis=1)[pixel]) / GAIN_SPREAD
        limit = np.full(unknowns, LIMIT)
        solution = solve(
            Residuals(function, points, penalty), start, -limit, limit, max_iterations=50, tolerance=1e-6
        )
        of_gain = solution.u[:, size] ** 2 if gains is not None else 0.0
        return -solution.cost - _half_logdet(solution.information), 2.0 * solution.cost - of_gain


def _described(emulator: Emulator) -> np.ndarray:
    """Mean, bounds, first node with the inverse distance of nodes, and root of a material, in a row."""
    own = emulator.material
    size = len(own.mean)
    first = np.zeros(size)
    first[:2] = emulator.first[: min(size, 2)]
    rows, columns = np.tril_indices(size)
    return np.concatenate([own.mean, *own.space.box, first, own.root[rows, columns]])


def _half_logdet(matrices: np.ndarray) -> np.ndarray:
    """½ log det of positive definite matrices, shape (L, P, P), all at a time."""
    size = matrices.shape[1]
    A = [[np.ascontiguousarray(matrices[:, i, j]) for j in range(i + 1)] for i in range(size)]
    result = np.zeros(len(matrices))
    for k in range(size):
        result += np.log(A[k][k])
        for i in range(k + 1, size):
            factor = A[i][k] / A[k][k]
            for j in range(k + 1, i + 1):
                A[i][j] = A[i][j] - factor * A[j][k]
    return 0.5 * result
