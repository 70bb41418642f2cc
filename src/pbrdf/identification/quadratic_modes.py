"""Modes of the posteriors of specimens whose signals come from tables, many pixels and materials at a time.

About a node of its table a signal is f = Σ_q c_q p_q(u), with as few terms p_q as :mod:`pbrdf.identification.emulator`
leaves. What :mod:`pbrdf.identification.evidence` minimises depends on the data y and their weights w by

    Σ w (f − y)² = Σ w y² − 2 bᵀp + pᵀM p,    b_q = Σ w y c_q,    M_qr = Σ w c_q c_r,

sums over the data that are matrix products for all pixels that show a material near a node. With them Gauss's and
Newton's method needs the data no more: one kernel follows each pair of a pixel and a material to its mode, a step that
raises the cost is halved. It stops where the step promises next to nothing; that is taken unseen.

Data that a gain g multiplies have sums of their own, in which f becomes g f.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np

from pbrdf.backend import get_backend
from pbrdf.identification.emulator import Emulator
from pbrdf.identification.evidence import GAIN_SPREAD, REACH

__all__ = ["Moments", "Tables"]

#: A pair stops where its cost is this near its minimum by the quadratic model, or after so many passes.
NEAR, PASSES = 5e-3, 12
#: Bytes of products of tables that are kept.
KEPT = 1 << 26


@dataclass(frozen=True, eq=False)
class Moments:
    """Sums over the data of L pairs of a pixel and a material; Q terms, S parts: data with a gain, data without.

    Attributes
    ----------
    M
        Lower triangles by rows, shape (S, Q (Q + 1)/2, L).
    b
        Shape (S, Q, L).
    squares
        Σ w y², shape (L,).
    """

    M: np.ndarray
    b: np.ndarray
    squares: np.ndarray

    def take(self, chosen: np.ndarray) -> Moments:
        """Of some pairs."""
        return Moments(self.M[..., chosen], self.b[..., chosen], self.squares[chosen])


class Tables:
    """Tables where kernels read them; P unknowns, Q terms, D data.

    Parameters
    ----------
    emulators
        Of materials with the same terms.
    scaled
        Which data a gain multiplies that is not known, shape (D,); None where it is known.
    """

    def __init__(self, emulators: Sequence[Emulator], scaled: np.ndarray | None) -> None:
        backend = get_backend()
        Float = backend.Float
        first = emulators[0]
        self.emulators = tuple(emulators)
        self.gain = scaled is not None
        self.size, self.nodes = first.nodes.shape[1], len(first.nodes)
        self.terms = first.table.shape[1]
        self.parts: list[Any] = [slice(None)]
        if scaled is not None and not scaled.all():
            self.parts = [np.flatnonzero(scaled), np.flatnonzero(~scaled)]
        self.products = first.products
        self.centres = backend.upload(Float, np.concatenate([e.nodes.ravel() for e in emulators]))
        described = np.array([_described(e) for e in emulators])
        self.described, self.width = backend.upload(Float, described.ravel()), described.shape[1]
        materials = [e.material for e in emulators]
        self.means, self.roots = np.array([m.mean for m in materials]), np.array([m.root for m in materials])
        boxes = np.array([m.space.box for m in materials])
        self.low, self.high = boxes[:, 0], boxes[:, 1]
        self.axis, self.first = np.array([e.axis for e in emulators]), np.array([e.first for e in emulators])
        bytes_of_one = 4 * self.terms * (self.terms + 1) * first.table.shape[2]
        self._products = lru_cache(maxsize=max(KEPT // bytes_of_one, 1))(self._multiplied)

    def unknowns(self, kind: np.ndarray, z: np.ndarray) -> np.ndarray:
        """The solver's unknowns of L specimens, shapes (L,) and (Z, L) to (P, L)."""
        u = self.means[kind].T + np.einsum("lij,jl->il", self.roots[kind], z[: self.size])
        result: np.ndarray = np.clip(u, self.low[kind].T, self.high[kind].T)
        return result

    def positions(self, kind: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Where L specimens lie along the nodes of their tables, from 0 to K − 1; shapes (L,) and (Z, L) to (L,)."""
        u = self.unknowns(kind, z)
        begin, inverse = self.first[kind].T
        along = (u[self.axis[kind], np.arange(len(kind))] - begin) * inverse
        result: np.ndarray = np.clip(along, 0.0, self.nodes - 1.0)
        return result

    def values(self, kind: np.ndarray, node: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Signals of L specimens that lie ordered by material and node, shape (D, L)."""
        u = self.unknowns(kind, z).T
        result = np.empty((self.emulators[0].table.shape[2], len(kind)))
        for begin, end in _runs(kind, node):
            emulator, k = self.emulators[kind[begin]], int(node[begin])
            result[:, begin:end] = emulator.table[k].T @ emulator.terms(u[begin:end], k)
        return result

    def _multiplied(self, kind: int, node: int) -> np.ndarray:
        """c_q c_r of a node, shape (Q (Q + 1)/2, D)."""
        table = self.emulators[kind].table[node]
        rows, columns = np.tril_indices(self.terms)
        product: np.ndarray = table[rows] * table[columns]
        return product

    def moments(
        self,
        kind: np.ndarray,
        node: np.ndarray,
        pixel: np.ndarray,
        weights: np.ndarray,
        weighted: np.ndarray,
        squares: np.ndarray,
        offset: np.ndarray | None = None,
    ) -> Moments:
        """Sums over the data for L pairs that lie ordered by material and node.

        Parameters
        ----------
        kind, node, pixel
            Numbers of the material, of the node of its table and of the pixel, shape (L,).
        weights, weighted
            w and w y of N pixels, shape (D, N).
        squares
            Σ w y² of N pixels, shape (N,).
        offset
            What is added to the signal of each pair, shape (D, L); None for nothing.
        """
        count = len(pixel)
        M = np.empty((len(self.parts), self.terms * (self.terms + 1) // 2, count))
        b = np.empty((len(self.parts), self.terms, count))
        first = np.arange(self.terms) * (np.arange(self.terms) + 1) // 2
        for begin, end in _runs(kind, node):
            own = pixel[begin:end]
            w, wy = weights.take(own, axis=1), weighted.take(own, axis=1)
            products = self._products(int(kind[begin]), int(node[begin]))
            table = self.emulators[kind[begin]].table[node[begin]]
            for s, rows in enumerate(self.parts):
                M[s, :, begin:end] = products[:, rows] @ w[rows]
                b[s, :, begin:end] = table[:, rows] @ wy[rows]
                if offset is not None:
                    # a part of the first term, 1: c_0 + offset
                    more = offset[rows, begin:end]
                    along = w[rows] * more
                    across = table[:, rows] @ along
                    M[s, first, begin:end] += across
                    M[s, 0, begin:end] += across[0] + np.einsum("dl,dl->l", along, more)
                    b[s, 0, begin:end] += np.einsum("dl,dl->l", wy[rows], more)
        return Moments(M, b, squares[pixel])

    def modes(
        self,
        of: Moments,
        kind: np.ndarray,
        node: np.ndarray,
        start: np.ndarray,
        centre: np.ndarray | None,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Minima for L pairs of a material and a pixel.

        Parameters
        ----------
        of
            Sums over the data.
        kind, node
            Shape (L,).
        start
            Standard normal numbers of the specimen, and of the gain where it is not known; shape (Z, L).
        centre
            Logarithm of the gain about which the unknown one is counted, shape (L,); None where it is known.

        Returns
        -------
        cost, half_log, z, promised
            The minimum, half the logarithm of the determinant of the information, where it is, and what the first step
            promised; shapes (L,), (L,), (Z, L) and (L,).
        """
        import drjit as dr

        count = len(kind)
        if count == 1:
            twice = np.zeros(2, dtype=int)
            found = self.modes(
                of.take(twice),
                kind[twice],
                node[twice],
                start[:, twice],
                None if centre is None else centre[twice],
            )
            return found[0][:1], found[1][:1], found[2][:, :1], found[3][:1]
        backend = get_backend()
        Float, UInt32, Bool = backend.Float, backend.UInt32, backend.Bool
        own = backend.upload(UInt32, kind.astype(np.uint32))
        place = own * self.nodes + backend.upload(UInt32, node.astype(np.uint32))
        M = [backend.upload(Float, part.ravel()) for part in of.M]
        b = [backend.upload(Float, part.ravel()) for part in of.b]
        squares = backend.upload(Float, of.squares)
        z = [backend.upload(Float, row) for row in start]
        about = None if centre is None else backend.upload(Float, centre)
        lane, stride = dr.arange(UInt32, count), dr.opaque(UInt32, count)
        evaluate = _Evaluation(self, own, place, M, b, squares, about, lane, stride)
        zero = dr.zeros(Float, count)

        def body(
            k: Any, z: list[Any], step: list[Any], cost: Any, half_log: Any, gain: Any, first: Any
        ) -> tuple[Any, ...]:
            trial = [dr.clip(a + b, -REACH, REACH) for a, b in zip(z, step, strict=True)]
            found, logarithm, promised, onward = evaluate(trial)
            better = found <= cost
            # what half a step still gains, by the quadratic model
            return (
                k + 1,
                [dr.select(better, a, b) for a, b in zip(trial, z, strict=True)],
                [dr.select(better, a, 0.5 * b) for a, b in zip(onward, step, strict=True)],
                dr.select(better, found, cost),
                dr.select(better, logarithm, half_log),
                dr.select(better, promised, 0.5 * gain),
                dr.select(k == 0, promised, first),
            )

        def going(k: Any, z: Any, step: Any, cost: Any, half_log: Any, gain: Any, first: Any) -> Any:
            return Bool((k < PASSES) & (gain > NEAR))

        _, z, step, cost, half_log, gain, first = dr.while_loop(
            (
                UInt32(0) + dr.zeros(UInt32, count),
                z,
                [Float(zero) for _ in z],
                zero + np.inf,
                Float(zero),
                zero + np.inf,
                Float(zero),
            ),
            going,
            body,
            mode="symbolic",
            label="quadratic modes",
        )
        near = gain <= NEAR
        cost = dr.select(near, cost - gain, cost)
        z = [dr.select(near, a + b, a) for a, b in zip(z, step, strict=True)]
        dr.eval(cost, half_log, z, first)
        return cost.numpy(), half_log.numpy(), np.stack([x.numpy() for x in z]), first.numpy()


class _Evaluation:
    """Cost, ½ log det of the information, what a step promises, and the step, of pairs at z: Dr.Jit floats."""

    def __init__(
        self,
        tables: Tables,
        own: Any,
        node: Any,
        M: list[Any],
        b: list[Any],
        squares: Any,
        centre: Any,
        lane: Any,
        stride: Any,
    ) -> None:
        self.tables, self.own, self.node, self.centre = tables, own, node, centre
        self.M, self.b, self.squares = M, b, squares
        self.lane, self.stride = lane, stride

    def __call__(self, z: list[Any]) -> tuple[Any, Any, Any, list[Any]]:
        import drjit as dr

        tables, size = self.tables, self.tables.size
        Float = type(z[0])
        width = len(z)
        row = self.own * tables.width
        root = {}
        free, step, place = [], [], 3 * size
        for i in range(size):
            value = dr.gather(Float, tables.described, row + i)
            for j in range(i + 1):
                root[i, j] = dr.gather(Float, tables.described, row + place)
                value = dr.fma(root[i, j], z[j], value)
                place += 1
            low, high = (dr.gather(Float, tables.described, row + (k * size + i)) for k in (1, 2))
            inside = dr.clip(value, low, high)
            free.append(inside == value)
            step.append(inside - dr.gather(Float, tables.centres, self.node * size + i))
        cost, g, A = self._sums(step, z, width)
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
            [
                _total([A[max(i, k), min(i, k)] * R[k][b] for k in range(b, width) if _there(R[k][b])])
                for b in range(width)
            ]
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
        return 0.5 * (cost + _total([v * v for v in z])), half_log, promised, onward

    def _sums(self, step: list[Any], z: list[Any], width: int) -> tuple[Any, list[Any], dict[Any, Any]]:
        """Sum of squares, and its gradient and matrix of second order (Gauss's) by unknowns and the gain's number."""
        import drjit as dr

        tables, size, terms = self.tables, self.tables.size, self.tables.terms
        Float = type(z[0])
        p = [Float(1.0), *step, *(_product([step[i] for i in of]) for of in tables.products)]
        # derivatives of the terms: those of each unknown that are not 0, by their numbers
        slopes: list[dict[int, Any]] = [{1 + i: Float(1.0)} for i in range(size)]
        for q, of in enumerate(tables.products, 1 + size):
            for i in dict.fromkeys(of):
                rest = list(of)
                rest.remove(i)
                slopes[i][q] = float(of.count(i)) * _product([step[j] for j in rest])
        cost: Any = self.squares
        g: list[Any] = [Float(0.0) for _ in range(width)]
        A: dict[Any, Any] = {(i, j): Float(0.0) for i in range(width) for j in range(i + 1)}
        for s in range(len(tables.parts)):
            factor: Any = None
            if tables.gain and s == 0:
                factor = dr.exp(dr.fma(GAIN_SPREAD, z[size], self.centre))

            def scaled(value: Any, by: Any = factor) -> Any:
                return value if by is None else value * by

            M = [
                dr.gather(Float, self.M[s], self.lane + k * self.stride)
                for k in range(terms * (terms + 1) // 2)
            ]
            b = [dr.gather(Float, self.b[s], self.lane + q * self.stride) for q in range(terms)]

            def entry(q: int, r: int, of: list[Any] = M) -> Any:
                return of[max(q, r) * (max(q, r) + 1) // 2 + min(q, r)]

            Mp = [scaled(_inner([entry(q, r) for r in range(terms)], p)) for q in range(terms)]
            modelled, measured = scaled(_inner(Mp, p)), scaled(_inner(b, p))
            cost = cost + (modelled - 2.0 * measured)
            away = [scaled(m - v) for m, v in zip(Mp, b, strict=True)]
            for i in range(size):
                g[i] = g[i] + _total([slope * away[q] for q, slope in slopes[i].items()])
                across = [
                    scaled(scaled(_total([s * entry(q, r) for q, s in slopes[i].items()])))
                    for r in range(terms)
                ]
                for j in range(i + 1):
                    A[i, j] = A[i, j] + _total([slope * across[r] for r, slope in slopes[j].items()])
            if factor is not None:
                g[size] = g[size] + GAIN_SPREAD * (modelled - measured)
                A[size, size] = A[size, size] + GAIN_SPREAD**2 * modelled
                for i in range(size):
                    along = _total([slope * scaled(Mp[q]) for q, slope in slopes[i].items()])
                    A[size, i] = A[size, i] + GAIN_SPREAD * along
        return cost, g, A


def _runs(kind: np.ndarray, node: np.ndarray) -> list[tuple[int, int]]:
    """Begins and ends of runs of the same material and node."""
    changes = np.flatnonzero((np.diff(kind) != 0) | (np.diff(node) != 0)) + 1
    edges = [0, *changes.tolist(), len(kind)]
    return list(pairwise(edges)) if len(kind) else []


def _described(emulator: Emulator) -> np.ndarray:
    """Mean, bounds and root of a material, in a row."""
    own = emulator.material
    rows, columns = np.tril_indices(len(own.mean))
    return np.concatenate([own.mean, *own.space.box, own.root[rows, columns]])


def _there(value: Any) -> bool:
    return not isinstance(value, float)


def _inner(a: Sequence[Any], b: Sequence[Any]) -> Any:
    import drjit as dr

    total = a[0] * b[0]
    for x, y in zip(a[1:], b[1:], strict=True):
        total = dr.fma(x, y, total)
    return total


def _product(factors: Sequence[Any]) -> Any:
    product = factors[0]
    for factor in factors[1:]:
        product = product * factor
    return product


def _total(terms: Sequence[Any]) -> Any:
    total = terms[0]
    for term in terms[1:]:
        total = total + term
    return total
