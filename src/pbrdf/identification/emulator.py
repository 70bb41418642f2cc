"""What specimens of materials reflect at geometries that many pixels share, from tables of second order.

Along the unknown in which the signal bends most, nodes lie half a standard deviation of the scatter apart, up to four
from the mean; there the other unknowns have the values most likely with it. About each node the signal is a polynomial
of second order of all unknowns, with the exact value and derivatives at the node and second derivatives by central
differences of exact first ones. What is left is of third order in a quarter of a standard deviation of the unknown that
bends most, and of the scatter of the others: :attr:`Emulator.error` is what it comes to for random specimens.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbrdf.identification.material import Material
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.problem import derivatives

__all__ = ["Emulator"]

#: How far from the mean the nodes reach, and how far apart they are, in standard deviations of the scatter.
REACH, SPACING = 4.0, 0.5
#: Steps of the second derivatives along the unknown of the nodes and the others, in the same unit.
ALONG, ACROSS = 0.35, 1.0
#: Specimens that tell the error.
DRAWS = 48
#: Sets of unknowns of a kernel: what it brings back is bounded.
BATCH = 1 << 12


@dataclass(frozen=True, eq=False)
class Emulator:
    """Signals of one material; P unknowns, K nodes, C channels, G geometries.

    Attributes
    ----------
    material
        Whose specimens they are of.
    axis
        Number of the unknown along which the nodes lie.
    nodes
        Unknowns at the nodes, shape (K, P).
    table
        Value, P first derivatives and P (P + 1)/2 coefficients of second order (lower triangle by rows) at the nodes,
        shape (K, G, C, 1 + P + P (P + 1)/2).
    error
        Root mean square of the difference from the model for random specimens, shape (C, G).
    """

    material: Material
    axis: int
    nodes: np.ndarray
    table: np.ndarray
    error: np.ndarray

    @classmethod
    def of(cls, material: Material, data: Observations) -> Emulator:
        """The emulator of a material.

        Parameters
        ----------
        material
            Any.
        data
            Geometries, channels and illumination.
        """
        low, high = material.space.box
        mean = np.clip(material.mean, low, high)
        spread = np.sqrt(np.diag(material.covariance))
        size = len(mean)

        def around(centre: np.ndarray, steps: np.ndarray) -> np.ndarray:
            """(…, P) to (…, 1 + 2 P, P)."""
            offsets = np.concatenate([np.zeros((1, size)), np.diag(steps), -np.diag(steps)])
            values: np.ndarray = np.clip(centre[..., None, :] + offsets, low, high)
            return values

        at = around(mean, spread)
        _, slopes = _signal(material, at, data)
        axis = int(np.argmax(_bend(slopes, spread)))
        numbers = np.arange(-REACH, REACH + 0.5 * SPACING, SPACING)
        regression = material.covariance[:, axis] / material.covariance[axis, axis]
        nodes = np.clip(mean + np.outer(numbers * spread[axis], regression), low, high)
        steps = np.where(np.arange(size) == axis, ALONG, ACROSS) * spread
        at = around(nodes, steps)
        values, slopes = _signal(material, at.reshape(-1, size), data)
        slopes = slopes.reshape(len(nodes), 1 + 2 * size, *slopes.shape[1:])
        values = values.reshape(len(nodes), 1 + 2 * size, *values.shape[1:])
        second = np.stack(
            [
                (slopes[:, 1 + j] - slopes[:, 1 + size + j])
                / np.maximum(at[:, 1 + j, j] - at[:, 1 + size + j, j], 1e-300)[:, None, None, None]
                for j in range(size)
            ],
            axis=-1,
        )
        second = 0.5 * (second + np.swapaxes(second, -1, -2))
        rows, columns = np.tril_indices(size)
        factor = np.where(rows == columns, 0.5, 1.0)
        table = np.concatenate(
            [values[:, 0, ..., None], slopes[:, 0], factor * second[..., rows, columns]], axis=-1
        )
        result = cls(material, axis, nodes, table, np.empty(0))
        random = np.random.default_rng(0)
        drawn = np.clip(mean + random.standard_normal((DRAWS, size)) @ material.root.T, low, high)
        off = result.values(drawn) - np.moveaxis(_signal(material, drawn, data)[0], -1, 1)
        return cls(material, axis, nodes, table, np.sqrt((off**2).mean(axis=0)))

    @property
    def first(self) -> tuple[float, float]:
        """The unknown of the nodes at the first one, and the inverse of their distance."""
        step = SPACING * float(np.sqrt(self.material.covariance[self.axis, self.axis]))
        return float(self.material.mean[self.axis]) - REACH / SPACING * step, 1.0 / step

    def values(self, unknowns: np.ndarray) -> np.ndarray:
        """Signals of specimens, shapes (S, P) to (S, C, G)."""
        begin, inverse = self.first
        number = np.rint((unknowns[:, self.axis] - begin) * inverse)
        number = np.clip(number, 0, len(self.nodes) - 1).astype(int)
        step = unknowns - self.nodes[number]
        rows, columns = np.tril_indices(unknowns.shape[1])
        powers = np.concatenate([np.ones((len(step), 1)), step, step[:, rows] * step[:, columns]], axis=1)
        result = np.empty((len(step), *self.table.shape[1:3]))
        for k in np.unique(number):
            own = number == k
            result[own] = np.einsum("sq,gcq->sgc", powers[own], self.table[k], optimize=True)
        return np.swapaxes(result, 1, 2)


def _signal(material: Material, unknowns: np.ndarray, data: Observations) -> tuple[np.ndarray, np.ndarray]:
    """Signals (S, G, C) and their derivatives (S, G, C, P)."""
    step = max(BATCH // len(data.theta_i), 1)
    parts = [
        derivatives(material.space, unknowns[i : i + step], data, data.channels)
        for i in range(0, len(unknowns), step)
    ]
    return np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts])


def _bend(slopes: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """How much the signal's second derivative along each unknown changes over its scatter, shape (P,)."""
    size = len(spread)
    return np.array(
        [
            np.linalg.norm((slopes[1 + j] + slopes[1 + size + j] - 2.0 * slopes[0])[..., j] * spread[j])
            for j in range(size)
        ]
    )
