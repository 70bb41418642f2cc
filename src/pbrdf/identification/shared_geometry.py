"""How well each material explains pixels that share their geometries: the likelihoods of
:mod:`pbrdf.identification.evidence`, with the models' signals from tables (:mod:`pbrdf.identification.emulator`).

A first look (:mod:`pbrdf.identification.screen`) leaves out, pixel by pixel, the materials that it cannot be. The modes
and the information of the others are found in the tables (:mod:`pbrdf.identification.quadratic_modes`). Where the
tables' error counts beside the errors of the data and the material is in the running, the model itself is evaluated at
the mode: what the table's signal is off there is added to it, and the mode is followed from there with the tables'
derivatives, until it stays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import gammainccinv

from pbrdf.data.schema import is_ratio
from pbrdf.identification.emulator import Emulator, emulators_of, shown
from pbrdf.identification.evidence import GAIN_SPREAD
from pbrdf.identification.material import Material
from pbrdf.identification.quadratic_modes import Tables
from pbrdf.identification.screen import DATA, Screen
from pbrdf.inversion.observations import Observations

__all__ = ["SharedGeometry"]

#: A material is left out whose distance is beyond what one in so many of its pixels reach, and farther than the nearest
#: by so much that nothing is left of its probability.
BEYOND, FARTHER = 1e-6, 40.0
#: The tables' squared errors in units of the data's, summed, are no more than this part of the spread of the distance,
#: which is √(2 D) for D data; else the model itself is evaluated.
TOLERATED = 0.3
#: Pairs of a pixel and a material that are followed together.
TOGETHER = 1 << 14
#: A mode belongs to the node that is no farther than this in the distance of nodes, and is looked for in another one
#: else, so many times; not where the distance is so many times what leaves a material out.
OWN, MOVES, HOPELESS = 0.7, 5, 4.0
#: A mode stays where the first step from it promises no more, and is left alone after so many steps.
STAYS, STEPS = 0.3, 8
#: The model itself is evaluated for a material that one in so many of its pixels are as far from as this one.
RUNNING = 1e-4


@dataclass(frozen=True, eq=False)
class SharedGeometry:
    """C materials seen at G geometries; D data of a pixel, channel by channel.

    Attributes
    ----------
    like
        Observations of one pixel: geometries, channels, illumination.
    families
        Of materials that one kernel computes: their numbers and tables.
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
    families: tuple[tuple[np.ndarray, Tables], ...]
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
        forms: dict[Any, list[int]] = {}
        for number, material in enumerate(materials):
            forms.setdefault(material.kernel, []).append(number)
        by_form = [emulators_of([materials[c] for c in members], like) for members in forms.values()]
        found = {
            c: e
            for members, own in zip(forms.values(), by_form, strict=True)
            for c, e in zip(members, own, strict=True)
        }
        emulators = tuple(found[c] for c in range(len(materials)))
        screen = Screen.of(emulators, like.channels, gain)
        families = tuple(
            (np.array(members), Tables(own, screen.intensities if gain else None))
            for members, own in zip(forms.values(), by_form, strict=True)
        )
        least = np.ones(len(materials)) if least is None else least
        return cls(like, families, emulators, screen, gain, least, temperature)

    def evidence(self, values: np.ndarray, std: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Integrated likelihoods of N pixels.

        Parameters
        ----------
        values, std
            Shape (channels, G, N), on the scale of a BRDF; not measured: 0 and infinite.

        Returns
        -------
        log_evidence, distance, degrees_of_freedom
            Shapes (N, C), (N, C) and (N,), as in :class:`~pbrdf.identification.evidence.Evidence`; minus infinity and
            infinity for materials that the first look left out.
        """
        count, kinds = values.shape[-1], len(self.emulators)
        pixels = self._pixels(values.reshape(-1, count), std.reshape(-1, count))
        freedom = (pixels.weights > 0.0).sum(axis=0) - int(self.gain)
        bound, specimen, seen = self.screen.distance(pixels.values, pixels.std)
        # a calibration speaks of the distance of all data
        looked = np.where(self.least[:, None] < 1.0, freedom, np.minimum(freedom, DATA))
        keep = bound <= np.maximum(
            self._limit(looked), bound.min(axis=0) + FARTHER * max(self.temperature, 1.0)
        )
        whole = np.broadcast_to(freedom, (kinds, count))
        limit, running = self._limit(whole), self._limit(whole, RUNNING)
        log_evidence = np.full((kinds, count), -np.inf)
        distance = np.full((kinds, count), np.inf)
        for members, tables in self.families:
            kind, pixel = np.nonzero(keep[members])
            of = members[kind]
            z = np.zeros((tables.size + int(self.gain), len(kind)))
            z[: tables.size] = specimen[of, : tables.size, pixel].T
            if pixels.gains is not None and pixels.centre is not None:
                z[tables.size] = (pixels.gains[of, pixel] - pixels.centre[pixel]) / GAIN_SPREAD
            worth = np.where(seen[pixel], HOPELESS * limit[of, pixel], np.inf)
            found, far = np.empty(len(kind)), np.empty(len(kind))
            left = np.arange(len(kind))
            for _ in range(MOVES):
                node = np.rint(tables.positions(kind[left], z[:, left]))
                found[left], far[left], z[:, left], _ = self._followed(
                    tables, kind[left], pixel[left], z[:, left], pixels
                )
                moved = np.abs(tables.positions(kind[left], z[:, left]) - node) > OWN
                left = left[moved & (far[left] < worth[left])]
                if not left.size:
                    break
            # the squared error of a specimen twice as far from its mean is 64 times as large, or more
            farther = np.maximum((z[: tables.size] ** 2).mean(axis=0), 1.0) ** 3
            missed = farther * pixels.missed[of, pixel]
            within = running[of, pixel]
            tolerated = TOLERATED * np.sqrt(2.0 * np.maximum(freedom[pixel], 1))
            left = np.flatnonzero((missed > tolerated) & (far < within))
            for _ in range(STEPS):
                if not left.size:
                    break
                found[left], far[left], z[:, left], promised = self._followed(
                    tables, kind[left], pixel[left], z[:, left], pixels, exact=True
                )
                left = left[(promised > STAYS) & (far[left] < within[left])]
            # what is left has not come to rest: the best that is known of it is the model where it was last
            found[left] += 0.5 * far[left]
            far[left] = self._distance(tables, kind[left], pixel[left], z[:, left], pixels)
            found[left] -= 0.5 * far[left]
            log_evidence[of, pixel], distance[of, pixel] = found, far
        return log_evidence.T, distance.T, freedom

    def _limit(self, freedom: np.ndarray, beyond: float = BEYOND) -> np.ndarray:
        """Distances beyond which there are so few of a material's pixels, shape (C, N)."""
        rare = np.minimum(beyond, 0.01 * self.least)
        different, place = np.unique(np.maximum(freedom, 1), return_inverse=True)
        table = 2.0 * gammainccinv(0.5 * different, rare[:, None])
        result: np.ndarray = np.take_along_axis(table, place.reshape(freedom.shape), axis=1)
        return result

    def _pixels(self, values: np.ndarray, std: np.ndarray) -> _Pixels:
        weights = 1.0 / std**2
        weighted = weights * values
        errors = np.array([e.error for e in self.emulators])
        gains = None
        if self.gain:
            middle = len(self.emulators[0].nodes) // 2
            own = self.screen.intensities
            means = np.array([e.table[middle, 0, own] for e in self.emulators])
            along = means @ weighted[own]
            gains = np.log(np.maximum(along / np.maximum(means**2 @ weights[own], 1e-300), 1e-12))
        return _Pixels(
            values,
            std,
            weights,
            weighted,
            np.einsum("dn,dn->n", weighted, values),
            (errors**2) @ weights,
            gains,
            None if gains is None else gains.mean(axis=0),
        )

    def _distance(
        self, tables: Tables, kind: np.ndarray, pixel: np.ndarray, z: np.ndarray, pixels: _Pixels
    ) -> np.ndarray:
        """Squared distance of pairs by the model itself where they are, shape (L,)."""
        if not len(kind):
            return np.empty(0)
        modelled = shown(tables.emulators[0].material.space, tables.unknowns(kind, z), self.like)
        if pixels.centre is not None:
            scaled = self.screen.intensities
            modelled[scaled] *= np.exp(pixels.centre[pixel] + GAIN_SPREAD * z[tables.size])
        off = modelled - pixels.values.take(pixel, axis=1)
        result: np.ndarray = (pixels.weights.take(pixel, axis=1) * off**2).sum(axis=0)
        result += (z[: tables.size] ** 2).sum(axis=0)
        return result

    def _followed(
        self,
        tables: Tables,
        kind: np.ndarray,
        pixel: np.ndarray,
        start: np.ndarray,
        pixels: _Pixels,
        *,
        exact: bool = False,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Log evidence, distance and mode of pairs, and what the first step promised, from the nodes they start at.

        With ``exact``, what the signal of the model itself is off the tables' where they start is added to it.
        """
        node = np.rint(tables.positions(kind, start)).astype(int)
        log_evidence, distance, promised = (np.empty(len(kind)) for _ in range(3))
        z = np.empty_like(start)
        order = np.lexsort((node, kind))
        for begin in range(0, len(order), TOGETHER):
            at = order[begin : begin + TOGETHER]
            own, begun, seen_by = (kind[at], node[at]), start[:, at], pixel[at]
            centre = None if pixels.centre is None else pixels.centre[seen_by]
            offset = None
            if exact:
                space = tables.emulators[0].material.space
                modelled = shown(space, tables.unknowns(own[0], begun), self.like)
                offset = modelled - tables.values(*own, begun)
            sums = tables.moments(*own, seen_by, pixels.weights, pixels.weighted, pixels.squares, offset)
            cost, half_log, mode, promised[at] = tables.modes(sums, *own, begun, centre)
            log_evidence[at], z[:, at] = -cost - half_log, mode
            distance[at] = 2.0 * cost - (mode[tables.size] ** 2 if self.gain else 0.0)
        return log_evidence, distance, z, promised


@dataclass(frozen=True, eq=False)
class _Pixels:
    """N pixels, D data of each.

    Attributes
    ----------
    values, std, weights, weighted
        Data, their errors, 1/std² and that times the data, shape (D, N).
    squares
        Sum of weights times squared data, shape (N,).
    missed
        Squared errors of the tables in units of the data's, summed, shape (C, N).
    gains, centre
        Logarithm of the gain at which the mean of each material fits the intensities best, shape (C, N), and the mean
        of them, shape (N,); None where the gain is known.
    """

    values: np.ndarray
    std: np.ndarray
    weights: np.ndarray
    weighted: np.ndarray
    squares: np.ndarray
    missed: np.ndarray
    gains: np.ndarray | None
    centre: np.ndarray | None
