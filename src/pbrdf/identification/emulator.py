"""What specimens of materials reflect at geometries that many pixels share, from tables of second order.

Along the unknown in which the signal bends most, nodes lie half a standard deviation of the scatter apart, up to four
from the mean; there the other unknowns have the values most likely with it. About each node the signal is a polynomial
of second order of all unknowns, with the exact value and derivatives at the node and second derivatives by central
differences of exact first ones; terms of second order that say less than what is left out anyway are dropped. What is
left is of third order in a quarter of a standard deviation of the unknown that bends most, and of the scatter of the
others: :attr:`Emulator.error` is what it comes to for random specimens.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pbrdf.identification.material import Material
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.problem import derivatives

__all__ = ["Emulator", "emulators_of"]

#: How far from the mean the nodes reach, and how far apart they are, in standard deviations of the scatter.
REACH, SPACING = 4.0, 0.5
#: Steps of the second derivatives along the unknown of the nodes and the others, in the same unit.
ALONG, ACROSS = 0.35, 1.0
#: Specimens that tell the error.
DRAWS = 48
#: A term of second order is dropped whose square is less than this part of the squared error without dropping any.
DROPPED = 0.1
#: Sets of unknowns of a kernel: what it brings back is bounded.
BATCH = 1 << 12


@dataclass(frozen=True, eq=False)
class Emulator:
    """Signals of one material; P unknowns, K nodes, D data (channel by channel, geometries in a row), Q terms.

    Attributes
    ----------
    material
        Whose specimens they are of.
    axis
        Number of the unknown along which the nodes lie.
    nodes
        Unknowns at the nodes, shape (K, P).
    pairs
        Numbers of the unknowns whose products are terms, shape (Q − 1 − P, 2).
    table
        Value, first derivatives and coefficients of the products at the nodes, shape (K, Q, D).
    error
        Root mean square of the difference from the model for random specimens, shape (D,).
    """

    material: Material
    axis: int
    nodes: np.ndarray
    pairs: np.ndarray
    table: np.ndarray
    error: np.ndarray

    @property
    def first(self) -> tuple[float, float]:
        """The unknown of the nodes at the first one, and the inverse of their distance."""
        step = SPACING * float(np.sqrt(self.material.covariance[self.axis, self.axis]))
        return float(self.material.mean[self.axis]) - REACH / SPACING * step, 1.0 / step

    def position(self, unknowns: np.ndarray) -> np.ndarray:
        """Where specimens lie along the nodes, which have whole numbers; shapes (S, P) to (S,)."""
        begin, inverse = self.first
        place: np.ndarray = (unknowns[:, self.axis] - begin) * inverse
        return place

    def terms(self, unknowns: np.ndarray, node: np.ndarray | int) -> np.ndarray:
        """What the table is multiplied by, shapes (S, P) and (S,) to (Q, S)."""
        step = (unknowns - self.nodes[node]).T
        first, second = self.pairs.T
        return np.concatenate([np.ones((1, step.shape[1])), step, step[first] * step[second]])

    def values(self, unknowns: np.ndarray) -> np.ndarray:
        """Signals of specimens, shapes (S, P) to (S, D)."""
        number = np.clip(np.rint(self.position(unknowns)), 0, len(self.nodes) - 1).astype(int)
        result = np.empty((len(unknowns), self.table.shape[2]))
        for k in np.unique(number):
            own = number == k
            result[own] = self.terms(unknowns[own], int(k)).T @ self.table[k]
        return result


def emulators_of(materials: Sequence[Material], data: Observations) -> tuple[Emulator, ...]:
    """Emulators of materials with the same free parameters: they have the same terms.

    Parameters
    ----------
    materials
        Any that share their form.
    data
        Geometries, channels and illumination.
    """
    whole = [_expanded(material, data) for material in materials]
    drawn = [_drawn(material) for material in materials]
    exact = [
        np.moveaxis(_signal(m, u, data)[0], -1, 1).reshape(DRAWS, -1)
        for m, u in zip(materials, drawn, strict=True)
    ]
    pairs = whole[0].pairs
    needed = np.zeros(len(pairs), dtype=bool)
    for emulator, unknowns, signal in zip(whole, drawn, exact, strict=True):
        unit = np.linalg.norm(signal.mean(axis=0).reshape(len(data.channels), -1), axis=0)
        weight = np.tile(1.0 / np.maximum(unit, 1e-12 * unit.max()) ** 2, len(data.channels))
        missed = (((emulator.values(unknowns) - signal) ** 2) @ weight).mean()
        says = np.zeros(len(pairs))
        number = np.clip(np.rint(emulator.position(unknowns)), 0, len(emulator.nodes) - 1).astype(int)
        powers = emulator.terms(unknowns, number)[-len(pairs) :]
        for power, k in zip(powers.T, number, strict=True):
            says += power**2 * (emulator.table[k, -len(pairs) :] ** 2 @ weight) / DRAWS
        needed |= says > DROPPED * missed
    columns = np.concatenate([np.ones(len(whole[0].nodes[0]) + 1, dtype=bool), needed])
    kept = [replace(e, pairs=pairs[needed], table=np.ascontiguousarray(e.table[:, columns])) for e in whole]
    return tuple(
        replace(e, error=np.sqrt(((e.values(u) - s) ** 2).mean(axis=0)))
        for e, u, s in zip(kept, drawn, exact, strict=True)
    )


def _drawn(material: Material) -> np.ndarray:
    """Unknowns of random specimens, shape (DRAWS, P)."""
    normal = np.random.default_rng(0).standard_normal((DRAWS, len(material.mean)))
    return np.clip(material.mean + normal @ material.root.T, *material.space.box)


def _expanded(material: Material, data: Observations) -> Emulator:
    """All terms of second order; the error is left open."""
    low, high = material.space.box
    mean = np.clip(material.mean, low, high)
    spread = np.sqrt(np.diag(material.covariance))
    size = len(mean)

    def around(centre: np.ndarray, steps: np.ndarray) -> np.ndarray:
        """(…, P) to (…, 1 + 2 P, P)."""
        offsets = np.concatenate([np.zeros((1, size)), np.diag(steps), -np.diag(steps)])
        return np.clip(centre[..., None, :] + offsets, low, high)

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
    table = np.concatenate([values[:, 0, ..., None], slopes[:, 0], factor * second[..., rows, columns]], axis=-1)
    table = table.transpose(0, 3, 2, 1).reshape(len(nodes), table.shape[-1], -1)
    return Emulator(material, axis, nodes, np.stack([rows, columns], axis=1), table, np.empty(0))


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
