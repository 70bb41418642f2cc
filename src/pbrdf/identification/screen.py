"""Which materials a pixel cannot be: a first look that leaves few likelihoods to compute.

The light of a material's specimens is distributed with a mean and a covariance V; with errors R, what is measured of
some of the data lies at a squared Mahalanobis distance from them that is no larger than that of all data, and larger
errors make it smaller. So pixels that are about as uncertain share one R, no smaller than theirs, and with it one
matrix for each material; where single errors are larger by a factor f all the same, the distance is divided by f². A
material is left out where even this bound is beyond what its true pixels reach. The same matrices tell what specimen a
pixel shows by the best linear estimate, from which the mode is looked for.

Of a gain that is not known only the ratios to the mean intensity are compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pbrdf.data.schema import is_ratio
from pbrdf.identification.emulator import REACH, Emulator

__all__ = ["DATA", "Screen"]

#: Data that are looked at, at most, and random specimens of each material.
DATA, SPECIMENS = 36, 1024
#: Signals are no linear functions of the specimen: extremes are more frequent than of a normal distribution.
WIDER = 1.5
#: A datum is looked at that so many of the pixels have.
PART = 0.7
#: Pixels share errors R whose logarithms to base 2 are that near each other; R is above those of so many of them, as
#: so many show.
NEAR, ABOVE, SHOWN = 0.5, 0.995, 2048
#: By how much more the data scatter where they are divided by their mean intensity.
NORMALISED = 1.5
#: Pixels that are looked at together: what is made of them stays in a processor's cache.
TOGETHER = 512


@dataclass(frozen=True, eq=False)
class Screen:
    """Specimens' signals of C materials.

    Attributes
    ----------
    signals
        Of random specimens, shape (C, S, D), all data of a pixel in a row, channel by channel.
    specimens
        Their standard normal numbers, shape (C, S, P), 0 where a material has fewer than P unknowns.
    intensities
        Which data are intensities and not ratios, shape (D,).
    gain
        Whether intensities are known up to a factor.
    """

    signals: np.ndarray
    specimens: np.ndarray
    intensities: np.ndarray
    gain: bool

    @classmethod
    def of(cls, emulators: Sequence[Emulator], channels: Sequence[str], gain: bool) -> Screen:
        """The first look at materials with these emulators."""
        random = np.random.default_rng(0)
        signals = []
        most = max(len(emulator.material.mean) for emulator in emulators)
        specimens = np.zeros((len(emulators), SPECIMENS, most))
        for emulator, z in zip(emulators, specimens, strict=True):
            own = emulator.material
            z[:, : len(own.mean)] = random.standard_normal((SPECIMENS, len(own.mean)))
            unknowns = own.mean + z[:, : len(own.mean)] @ own.root.T
            signals.append(emulator.values(np.clip(unknowns, *own.space.box)))
        geometries = emulators[0].table.shape[2] // len(channels)
        intensities = np.repeat([not is_ratio(channel) for channel in channels], geometries)
        return cls(np.array(signals), specimens, intensities, gain)

    def distance(self, values: np.ndarray, std: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Lower bounds of the squared distances of N pixels from C materials, and rough estimates of the specimens.

        Parameters
        ----------
        values, std
            Shape (D, N), infinite ``std`` where nothing was measured.

        Returns
        -------
        distance, specimen, seen
            Shapes (C, N), (C, P, N) and (N,): 0 and False where a pixel lacks some of the data.
        """
        kinds, _, size = self.specimens.shape
        bound = np.zeros((kinds, values.shape[1]), dtype=np.float32)
        specimen = np.zeros((kinds, size, values.shape[1]), dtype=np.float32)
        seen = np.zeros(values.shape[1], dtype=bool)
        usable = np.flatnonzero(np.isfinite(std).mean(axis=1) >= PART)
        if not usable.size:
            return bound, specimen, seen
        chosen = usable[np.unique(np.linspace(0, len(usable) - 1, DATA).astype(int))]
        y, error = values[chosen], std[chosen]
        signals = self.signals[:, :, chosen]
        seen = np.isfinite(error).all(axis=0)
        if self.gain:
            own = self.intensities[chosen]
            first = own & (np.arange(len(chosen)) < np.searchsorted(chosen, self._first))
            first = first if first.any() else own
            mean_size = y[first].mean(axis=0)
            seen &= mean_size > 0.0
            factor = np.where(own[:, None], np.where(mean_size > 0.0, mean_size, 1.0), 1.0)
            y, error = y / factor, NORMALISED * error / factor
            signals = np.where(own, signals / signals[:, :, first].mean(axis=2, keepdims=True), signals)
        mean = signals.mean(axis=1)
        centre = mean.mean(axis=0)
        apart = signals - mean[:, None]
        covariance = WIDER * np.swapaxes(apart, 1, 2) @ apart / SPECIMENS
        along = np.swapaxes(apart, 1, 2) @ self.specimens / SPECIMENS
        whole = np.flatnonzero(seen)
        level = np.rint(np.log2(error[:, whole].astype(np.float32)).mean(axis=0) / NEAR).astype(int)
        for number in np.unique(level):
            columns = whole[level == number]
            shared = np.quantile(error[:, columns[:: -(-len(columns) // SHOWN)]], ABOVE, axis=1)
            root = np.linalg.inv(np.linalg.cholesky(covariance + np.diag(shared**2)))
            guess = np.swapaxes(along, 1, 2) @ np.swapaxes(root, 1, 2) @ root
            whiten = (root * shared).reshape(-1, len(chosen)).astype(np.float32)
            estimate = (guess * shared).reshape(-1, len(chosen)).astype(np.float32)
            offset = np.einsum("cij,cj->ci", root, mean - centre).reshape(-1, 1).astype(np.float32)
            shift = np.einsum("cij,cj->ci", guess, mean - centre).reshape(-1, 1).astype(np.float32)
            for begin in range(0, len(columns), TOGETHER):
                at = columns[begin : begin + TOGETHER]
                larger = np.maximum((error[:, at] / shared[:, None]).max(axis=0), 1.0)
                apart_by = ((y[:, at] - centre[:, None]) / shared[:, None]).astype(np.float32)
                white = (whiten @ apart_by - offset).reshape(kinds, len(chosen), -1)
                bound[:, at] = np.einsum("cdn,cdn->cn", white, white) / larger**2
                found = (estimate @ apart_by - shift).reshape(kinds, size, -1)
                specimen[:, :, at] = np.clip(found, -REACH, REACH)
        return bound, specimen, seen

    @property
    def _first(self) -> int:
        """End of the first channel's data."""
        changes = np.flatnonzero(np.diff(self.intensities))
        return int(changes[0]) + 1 if changes.size else len(self.intensities) // 3 or 1
