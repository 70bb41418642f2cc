"""What specimens of materials reflect at geometries that many pixels share, from tables of polynomials.

Along the unknown in which the signal bends most, nodes lie half a standard deviation of the scatter apart, up to four
from the mean; there the other unknowns have the values most likely with it. About each node the signal is a polynomial
of all unknowns, with the exact value and derivatives at the node and second derivatives by central
differences of exact first ones. What is left for random specimens is fitted by terms up to third order, the same at all
nodes; terms that hardly change the signal are dropped. :attr:`Emulator.error` is what other random
specimens miss by.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement

import numpy as np

from pbrdf.backend import get_backend
from pbrdf.identification.material import Material
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.problem import Space, derivatives, signals_of

__all__ = ["Emulator", "emulators_of", "shown"]

#: How far from the mean the nodes reach, and how far apart they are, in standard deviations of the scatter.
REACH, SPACING = 4.0, 0.5
#: Steps of the second derivatives along the unknown of the nodes and the others, in the same unit.
ALONG, ACROSS = 0.35, 1.0
#: Specimens that tell the error, and for each term of third order those that tell what it is.
DRAWS, FOR_A_TERM = 48, 4
#: A term is dropped that is less than this part of the signal, as root mean square over specimens and data.
DROPPED = 3e-4
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
    products
        Numbers of the unknowns whose products are terms, two or three each; Q − 1 − P of them.
    table
        Value, first derivatives and coefficients of the products at the nodes, shape (K, Q, D).
    error
        Root mean square of the difference from the model for random specimens, shape (D,).
    """

    material: Material
    axis: int
    nodes: np.ndarray
    products: tuple[tuple[int, ...], ...]
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
        products = [step[list(of)].prod(axis=0) for of in self.products]
        return np.stack([np.ones(step.shape[1]), *step, *products])

    def nearest(self, unknowns: np.ndarray) -> np.ndarray:
        """Numbers of the nodes that specimens belong to, shapes (S, P) to (S,)."""
        found: np.ndarray = np.clip(np.rint(self.position(unknowns)), 0, len(self.nodes) - 1).astype(int)
        return found

    def values(self, unknowns: np.ndarray) -> np.ndarray:
        """Signals of specimens, shapes (S, P) to (S, D)."""
        number = self.nearest(unknowns)
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
    size = len(materials[0].mean)
    cubes = tuple(combinations_with_replacement(range(size), 3))
    draws = DRAWS + FOR_A_TERM * (len(cubes) + size * (size + 1) // 2 + size + 1)
    normal = np.random.default_rng(0).standard_normal((draws, size))
    drawn = [np.clip(m.mean + normal @ m.root.T, *m.space.box) for m in materials]
    exact = shown(materials[0].space, np.concatenate(drawn).T, data).T.reshape(len(drawn), draws, -1)
    whole = [
        _fitted(_expanded(material, data), cubes, unknowns[DRAWS:], signal[DRAWS:])
        for material, unknowns, signal in zip(materials, drawn, exact, strict=True)
    ]
    products = whole[0].products
    needed = np.zeros(len(products), dtype=bool)
    for emulator, unknowns, signal in zip(whole, drawn, exact, strict=True):
        unit = np.linalg.norm(signal.mean(axis=0).reshape(len(data.channels), -1), axis=0)
        weight = np.tile(1.0 / np.maximum(unit, 1e-12 * unit.max()) ** 2, len(data.channels))
        number = emulator.nearest(unknowns[DRAWS:])
        powers = emulator.terms(unknowns[DRAWS:], number)[-len(products) :]
        coefficients = emulator.table[number, -len(products) :] ** 2 @ weight / len(weight)
        needed |= (powers.T**2 * coefficients).mean(axis=0) > DROPPED**2
    columns = np.concatenate([np.ones(1 + size, dtype=bool), needed])
    kept = tuple(of for of, own in zip(products, needed, strict=True) if own)
    smaller = [replace(e, products=kept, table=np.ascontiguousarray(e.table[:, columns])) for e in whole]
    return tuple(
        replace(e, error=np.sqrt(((e.values(u[:DRAWS]) - s[:DRAWS]) ** 2).mean(axis=0)))
        for e, u, s in zip(smaller, drawn, exact, strict=True)
    )


def shown(space: Space, unknowns: np.ndarray, data: Observations) -> np.ndarray:
    """What the model shows of L specimens at the geometries of a data set, shapes (P, L) to (D, L)."""
    import drjit as dr

    backend = get_backend()
    Float, UInt32 = backend.Float, backend.UInt32
    count, points = unknowns.shape[1], len(data.theta_i)
    columns = [backend.upload(Float, row) for row in unknowns]
    size = dr.opaque(UInt32, count)
    lane = dr.arange(UInt32, points * count)
    point = lane // size
    u = [dr.gather(Float, column, lane - point * size) for column in columns]
    values, _ = signals_of(space, [data])(u, UInt32(0), point, data.channels)
    arrays = [Float(value) + dr.zeros(Float, points * count) for value in values]
    dr.eval(arrays)
    return np.concatenate([array.numpy() for array in arrays]).reshape(-1, count)


def _fitted(
    emulator: Emulator, cubes: Sequence[tuple[int, ...]], unknowns: np.ndarray, signal: np.ndarray
) -> Emulator:
    """With terms of third order, which and the others take up what random specimens miss."""
    table = np.pad(emulator.table, ((0, 0), (0, len(cubes)), (0, 0)))
    result = replace(emulator, products=(*emulator.products, *cubes), table=table)
    terms = result.terms(unknowns, emulator.nearest(unknowns)).T
    unit = np.maximum(np.linalg.norm(terms, axis=0), 1e-300)
    found = np.linalg.lstsq(terms / unit, signal - emulator.values(unknowns), rcond=1e-6)[0]
    return replace(result, table=table + found / unit[:, None])


def _expanded(material: Material, data: Observations) -> Emulator:
    """All terms of second order; the error is left open."""
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
    table = table.transpose(0, 3, 2, 1).reshape(len(nodes), table.shape[-1], -1)
    products = tuple((int(i), int(j)) for i, j in zip(rows, columns, strict=True))
    return Emulator(material, axis, nodes, products, table, np.empty(0))


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
