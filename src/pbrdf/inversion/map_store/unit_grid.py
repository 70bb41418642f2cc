"""The units of a map: blocks of pixels, each one shard of every array of the store."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pbrdf.errors import PbrdfError

__all__ = ["UNIT", "UnitGrid"]

#: Pixels of a unit: some seconds to a minute of fitting, which is what a kill costs; a few files.
UNIT = 2**16
#: Pixels of a chunk, the least that is read at a time.
_CHUNK = 2**12


@dataclass(frozen=True)
class UnitGrid:
    """How the dimensions of a map are cut into units.

    Attributes
    ----------
    dims
        Names of the dimensions.
    sizes
        Pixels along each.
    shard, chunk
        Pixels of a unit and of a chunk along each; a unit holds whole chunks, the last one may reach beyond the map.
    """

    dims: tuple[str, ...]
    sizes: tuple[int, ...]
    shard: tuple[int, ...]
    chunk: tuple[int, ...]

    @classmethod
    def of(
        cls,
        sizes: Mapping[str, int],
        shard: Mapping[str, int] | None = None,
        chunk: Mapping[str, int] | None = None,
        *,
        pixels: int = UNIT,
    ) -> UnitGrid:
        """Cut a map.

        Parameters
        ----------
        sizes
            Pixels along each dimension.
        shard, chunk
            Pixels of a unit and of a chunk; what is not given is chosen: units as square as can be in the last
            dimensions, of 16 chunks.
        pixels
            Of a unit whose lengths are chosen, at most.

        Raises
        ------
        PbrdfError
            If a unit is not made of whole chunks, or a dimension is not known.
        """
        for given in (shard or {}, chunk or {}):
            for dim, length in given.items():
                if dim not in sizes:
                    raise PbrdfError(f"units: the map has no dimension {dim!r}, but {', '.join(sizes)}")
                if length < 1:
                    raise PbrdfError(f"units: {length} pixels along {dim}")
        units = _lengths(sizes, pixels, shard or {})
        chunks = tuple(
            length if dim in (chunk or {}) else _divisor(unit, length)
            for dim, unit, length in zip(
                sizes, units, _lengths(dict(zip(sizes, units, strict=True)), _CHUNK, chunk or {}), strict=True
            )
        )
        for dim, outer, inner in zip(sizes, units, chunks, strict=True):
            if outer % inner:
                raise PbrdfError(f"units: {outer} pixels along {dim} are not whole chunks of {inner}")
        return cls(tuple(sizes), tuple(sizes.values()), units, chunks)

    @property
    def grid(self) -> tuple[int, ...]:
        """Number of units along each dimension."""
        return tuple(-(-size // shard) for size, shard in zip(self.sizes, self.shard, strict=True))

    @property
    def count(self) -> int:
        """Number of units."""
        return math.prod(self.grid)

    def index(self, number: int) -> tuple[int, ...]:
        """Place of a unit in the grid; the last dimension counts fastest."""
        found = []
        for length in reversed(self.grid):
            number, i = divmod(number, length)
            found.append(i)
        return tuple(reversed(found))

    def slices(self, number: int) -> dict[str, slice]:
        """Pixels of a unit."""
        return {
            dim: slice(i * shard, min((i + 1) * shard, size))
            for dim, i, shard, size in zip(self.dims, self.index(number), self.shard, self.sizes, strict=True)
        }

    def share(self, worker: tuple[int, int] | None) -> Sequence[int]:
        """Numbers of the units that worker i of N does: every N-th.

        Raises
        ------
        PbrdfError
            If there is no worker of that number; they are counted from 1.
        """
        if worker is None:
            return range(self.count)
        number, workers = worker
        if not 1 <= number <= workers:
            raise PbrdfError(f"worker {number}/{workers}: workers are counted from 1 to {workers}")
        return range(number - 1, self.count, workers)


def _divisor(length: int, wanted: int) -> int:
    """The divisor of a length that is the nearest to another one, as ratios go."""
    divisors = (d for d in range(1, length + 1) if length % d == 0)
    return min(divisors, key=lambda d: max(d / wanted, wanted / d))


def _lengths(sizes: Mapping[str, int], pixels: int, given: Mapping[str, int]) -> tuple[int, ...]:
    """Powers of two along the dimensions that are not given, their product about `pixels`; the last ones grow first.

    A length that reaches the end of its dimension grows no more.
    """
    lengths = {dim: given.get(dim, 1) for dim in sizes}
    # an image is cut into squares; only where it is used up do the dimensions before it grow
    for group in (list(sizes)[-2:], list(sizes)[:-2]):
        while growing := [dim for dim in group if dim not in given and lengths[dim] < sizes[dim]]:
            if 2 * math.prod(lengths.values()) > pixels:
                break
            lengths[min(reversed(growing), key=lambda dim: lengths[dim])] *= 2
    return tuple(lengths.values())
