"""Modes of the posteriors of specimens whose signals come from tables, many pixels and materials at a time.

What :mod:`pbrdf.identification.evidence` minimises, by Gauss's and Newton's method with exact derivatives of the
tables' polynomials: a step that raises the cost is halved. A pass over the data is one kernel for all pairs of a pixel
and a material. A pair stops where the step promises next to nothing; that is taken unseen.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pbrdf.backend import get_backend
from pbrdf.identification.emulator import Emulator
from pbrdf.identification.evidence import GAIN_SPREAD, REACH

__all__ = ["Tables"]

#: A pair stops where its cost is this near its minimum by the quadratic model, or after so many passes.
NEAR, PASSES = 5e-3, 12
#: Numbers that are read together.
PACKET = 4


class Tables:
    """Tables and data where kernels read them; D data of each pixel in a row, P unknowns.

    Parameters
    ----------
    emulators
        Of materials with as many unknowns.
    values, std
        Of N pixels, shape (N, D).
    scaled
        Which data a gain multiplies, shape (D,).
    centre
        Logarithm of the gain about which the unknown one is counted, shape (N,); None where it is known.
    """

    def __init__(
        self,
        emulators: Sequence[Emulator],
        values: np.ndarray,
        std: np.ndarray,
        scaled: np.ndarray,
        centre: np.ndarray | None,
    ) -> None:
        import drjit as dr

        backend = get_backend()
        Float, UInt32 = backend.Float, backend.UInt32
        self.size = emulators[0].nodes.shape[1]
        self.nodes = len(emulators[0].nodes)
        terms = emulators[0].table.shape[-1]
        self.packets = -(-terms // PACKET)
        rows = np.zeros((len(emulators), self.nodes, values.shape[1], self.packets * PACKET))
        for row, emulator in zip(rows, emulators, strict=True):
            row[..., :terms] = np.swapaxes(emulator.table, 1, 2).reshape(self.nodes, -1, terms)
        self.table = backend.upload(Float, rows.ravel())
        self.centres = backend.upload(Float, np.concatenate([e.nodes.ravel() for e in emulators]))
        described = np.array([_described(e) for e in emulators])
        self.described, self.width = backend.upload(Float, described.ravel()), described.shape[1]
        self.axes = backend.upload(UInt32, np.array([e.axis for e in emulators], dtype=np.uint32))
        self.values = backend.upload(Float, values.ravel())
        self.weights = backend.upload(Float, (1.0 / std).ravel())
        self.data = dr.opaque(UInt32, values.shape[1])
        self.centre = None if centre is None else backend.upload(Float, centre)
        self.scaled = None if scaled.all() else backend.upload(Float, scaled.astype(float))

    def modes(
        self, kind: np.ndarray, pixel: np.ndarray, start: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Minima for L pairs of a material and a pixel.

        Parameters
        ----------
        kind, pixel
            Their numbers, shape (L,).
        start
            Standard normal numbers of the specimen, and of the gain where it is not known; shape (L, Z).

        Returns
        -------
        cost, half_log, z
            The minimum, half the logarithm of the determinant of the information, and where it is; shapes (L,), (L,)
            and (L, Z).
        """
        count = len(pixel)
        z, step = start.copy(), np.zeros_like(start)
        cost, half_log, gain = np.full(count, np.inf), np.zeros(count), np.zeros(count)
        lanes = np.arange(count)
        for _ in range(PASSES):
            trial = np.clip(z[lanes] + step[lanes], -REACH, REACH)
            found, logarithm, promised, onward = self._pass(kind[lanes], pixel[lanes], trial)
            better = found <= cost[lanes]
            accepted = lanes[better]
            z[accepted], step[accepted] = trial[better], onward[better]
            cost[accepted], half_log[accepted] = found[better], logarithm[better]
            gain[accepted] = promised[better]
            refused = lanes[~better]
            step[refused] *= 0.5
            # what half a step still gains, by the quadratic model
            gain[refused] *= 0.5
            lanes = lanes[gain[lanes] > NEAR]
            if not lanes.size:
                break
        near = gain <= NEAR
        cost[near] -= gain[near]
        z[near] += step[near]
        return cost, half_log, z

    def _pass(self, kind: np.ndarray, pixel: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, ...]:
        """Cost, ½ log det of the information, what a step promises, and the step; shapes (L,) thrice and (L, Z)."""
        import drjit as dr

        backend = get_backend()
        Float, UInt32 = backend.Float, backend.UInt32
        Packet = getattr(backend.module, f"Array{PACKET}f64")
        count, size, packets = len(kind), self.size, self.packets
        if count == 1:
            return tuple(x[:1] for x in self._pass(kind.repeat(2), pixel.repeat(2), at.repeat(2, axis=0)))
        own = backend.upload(UInt32, kind.astype(np.uint32))
        number = backend.upload(UInt32, pixel.astype(np.uint32))
        z = [backend.upload(Float, column) for column in np.ascontiguousarray(at.T)]
        row = own * self.width

        def read(i: int) -> Any:
            return dr.gather(Float, self.described, row + i)

        root = {}
        u, free, place = [], [], 3 * size + max(size, 2)
        for i in range(size):
            value = read(i)
            for j in range(i + 1):
                root[i, j] = read(place)
                value = dr.fma(root[i, j], z[j], value)
                place += 1
            inside = dr.clip(value, read(size + i), read(2 * size + i))
            free.append(inside == value)
            u.append(inside)
        axis = dr.gather(UInt32, self.axes, own)
        along = u[0]
        for i in range(1, size):
            along = dr.select(axis == i, u[i], along)
        position = (along - read(3 * size)) * read(3 * size + 1)
        node = own * self.nodes + UInt32(dr.clip(position + 0.5, 0.0, self.nodes - 1.0))
        step = [u[i] - dr.gather(Float, self.centres, node * size + i) for i in range(size)]
        factor = Float(1.0)
        if self.centre is not None:
            factor = dr.exp(dr.fma(GAIN_SPREAD, z[size], dr.gather(Float, self.centre, number)))
        width = len(z)
        begin, place = number * self.data, node * self.data

        def body(d: Any, cost: Any, g: list[Any], A: list[Any]) -> tuple[Any, ...]:
            term: list[Any] = []
            for p in range(packets):
                term.extend(dr.gather(Packet, self.table, (place + d) * packets + p))
            slope = list(term[1 : 1 + size])
            at = 1 + size
            for i in range(size):
                for j in range(i):
                    slope[i] = dr.fma(term[at], step[j], slope[i])
                    slope[j] = dr.fma(term[at], step[i], slope[j])
                    at += 1
                slope[i] = dr.fma(2.0 * term[at], step[i], slope[i])
                at += 1
            value = term[0]
            for i in range(size):
                value = dr.fma(0.5 * (term[1 + i] + slope[i]), step[i], value)
            weight = dr.gather(Float, self.weights, begin + d)
            scale = weight
            if self.centre is not None:
                scale = weight * factor
                if self.scaled is not None:
                    of_gain = dr.gather(Float, self.scaled, d)
                    scale = weight * dr.fma(of_gain, factor - 1.0, 1.0)
            r = dr.fma(value, scale, -dr.gather(Float, self.values, begin + d) * weight)
            J = [x * scale for x in slope]
            if self.centre is not None:
                along_gain = GAIN_SPREAD * value * scale
                J.append(along_gain if self.scaled is None else along_gain * of_gain)
            cost = dr.fma(r, r, cost)
            g = [dr.fma(a, r, b) for a, b in zip(J, g, strict=True)]
            A = [dr.fma(J[i], J[j], A[i * (i + 1) // 2 + j]) for i in range(width) for j in range(i + 1)]
            return d + 1, cost, g, A

        zero = dr.zeros(Float, count)
        _, cost, g, packed = dr.while_loop(
            (
                UInt32(0),
                Float(zero),
                [Float(zero) for _ in z],
                [Float(zero) for _ in range(width * (width + 1) // 2)],
            ),
            lambda d, *_: d < self.data,
            body,
            mode="symbolic",
            label="quadratic modes",
        )
        A = [
            [packed[max(i, j) * (max(i, j) + 1) // 2 + min(i, j)] for j in range(width)] for i in range(width)
        ]
        R = [
            [dr.select(free[i], root[i, j], 0.0) if j <= i else 0.0 for j in range(size)]
            + [0.0] * (width - size)
            for i in range(size)
        ]
        if width > size:
            R.append([0.0] * size + [Float(1.0)])
        gradient = [
            _total([R[i][a] * g[i] for i in range(a, width) if _there(R[i][a])]) + z[a] for a in range(width)
        ]
        half = [
            [_total([A[i][k] * R[k][b] for k in range(b, width) if _there(R[k][b])]) for b in range(width)]
            for i in range(width)
        ]
        L: list[list[Any]] = []
        half_log: Any = 0.0
        for a in range(width):
            L.append([])
            for b in range(a + 1):
                value = _total([R[i][a] * half[i][b] for i in range(a, width) if _there(R[i][a])])
                if a == b:
                    value = value + 1.0
                for q in range(b):
                    value = dr.fma(-L[a][q], L[b][q], value)
                if a == b:
                    half_log = half_log + 0.5 * dr.log(value)
                    L[a].append(dr.rsqrt(value))
                else:
                    L[a].append(value * L[b][b])
        y: list[Any] = []
        for a in range(width):
            value = -gradient[a]
            for q in range(a):
                value = dr.fma(-L[a][q], y[q], value)
            y.append(value * L[a][a])
        promised = 0.5 * _total([v * v for v in y])
        onward = list(y)
        for a in reversed(range(width)):
            value = y[a]
            for q in range(a + 1, width):
                value = dr.fma(-L[q][a], onward[q], value)
            onward[a] = value * L[a][a]
        total = 0.5 * (cost + _total([v * v for v in z]))
        dr.eval(total, half_log, promised, onward)
        return (
            total.numpy(),
            half_log.numpy(),
            promised.numpy(),
            np.stack([x.numpy() for x in onward], axis=1),
        )


def _described(emulator: Emulator) -> np.ndarray:
    """Mean, bounds, first node with the inverse distance of nodes, and root of a material, in a row."""
    own = emulator.material
    size = len(own.mean)
    rows, columns = np.tril_indices(size)
    first = np.zeros(max(size, 2))
    first[:2] = emulator.first
    return np.concatenate([own.mean, *own.space.box, first, own.root[rows, columns]])


def _there(value: Any) -> bool:
    return not isinstance(value, float)


def _total(terms: Sequence[Any]) -> Any:
    total = terms[0]
    for term in terms[1:]:
        total = total + term
    return total
