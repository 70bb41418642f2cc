"""Colour filters over the cells of a division of focal plane.

Sony's colour polarisation sensors (IMX250MYR, IMX253MYR, IMX264MYR) put one colour of a Bayer pattern over each 2 × 2
cell of polarisers, so that 4 × 4 pixels repeat::

    R90  R45  G90  G45
    R135 R0   G135 G0
    G90  G45  B90  B45
    G135 G0   B135 B0

A colour is a measurement of its own: what is computed from a cell is never mixed with that of another colour.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from pbrdf.errors import DataError

__all__ = ["BAYER", "ColorFilters", "of_cells", "smallest_cell"]

#: Colours of the cells of Sony's sensors.
BAYER = (("R", "G"), ("G", "B"))


@dataclass(frozen=True)
class ColorFilters:
    """Which colour stands over which cell of polarisers.

    Attributes
    ----------
    layout
        Names of the colours, rows of cells from the top; the table repeats over the picture.
    wavelengths
        Nominal wavelength of each colour, nanometres; empty where they are not stated.
    apart
        Keep cells of the same colour apart (G1, G2) rather than average them.
    only
        The one series of :attr:`places` that is used; None: all.

    Raises
    ------
    DataError
        If the table is not rectangular, or wavelengths are not those of its colours.
    """

    layout: tuple[tuple[str, ...], ...] = BAYER
    wavelengths: Mapping[str, float] = field(default_factory=dict)
    apart: bool = False
    only: str | None = None

    def __post_init__(self) -> None:
        widths = {len(row) for row in self.layout}
        if len(widths) != 1 or 0 in widths or not all(name for row in self.layout for name in row):
            raise DataError('colors: give rows of names of the same length, such as [["R", "G"], ["G", "B"]]')
        colors = {name for row in self.layout for name in row}
        if self.wavelengths and set(self.wavelengths) != colors:
            raise DataError(
                f"wavelengths are given of {', '.join(self.wavelengths)}, but the colours are "
                f"{', '.join(sorted(colors))}: give one of each"
            )
        if self.only is not None and self.only not in self.places:
            known = ", ".join(replace(self, only=None).places)
            raise DataError(
                f"color is {self.only!r}: use one of {known}"
                + ("" if self.apart else '; with greens = "apart" their cells are colours of their own')
            )
        for name, value in self.wavelengths.items():
            if not (np.isfinite(value) and value > 0.0):
                raise DataError(f"the wavelength of {name} is {value!r}: give nanometres")

    @property
    def size(self) -> tuple[int, int]:
        """Rows and columns of cells over which the colours repeat."""
        return len(self.layout), len(self.layout[0])

    @property
    def places(self) -> dict[str, tuple[tuple[int, int], ...]]:
        """Rows and columns of the cells of each series of data: a colour, or one of its cells."""
        found: dict[str, list[tuple[int, int]]] = {}
        for y, row in enumerate(self.layout):
            for x, name in enumerate(row):
                found.setdefault(name, []).append((y, x))
        named: dict[str, tuple[tuple[int, int], ...]] = {}
        for name, cells in found.items():
            if not self.apart or len(cells) == 1:
                named[name] = tuple(cells)
            else:
                named |= {f"{name}{k + 1}": (cell,) for k, cell in enumerate(cells)}
        return {name: cells for name, cells in named.items() if self.only in (None, name)}

    def wavelength(self, label: str) -> float | None:
        """Nominal wavelength of one of :attr:`places`, nanometres."""
        y, x = self.places[label][0]
        return self.wavelengths.get(self.layout[y][x])


def smallest_cell(layout: np.ndarray) -> np.ndarray:
    """The least part, from the corner, of which a table of polarisers is a repetition."""
    tall, wide = layout.shape
    for high in (n for n in range(1, tall + 1) if tall % n == 0):
        for broad in (n for n in range(1, wide + 1) if wide % n == 0):
            cell = layout[:high, :broad]
            if np.array_equal(np.tile(cell, (tall // high, wide // broad)), layout):
                return cell
    return layout


def of_cells(colors: tuple[tuple[str, ...], ...], cell: tuple[int, int]) -> tuple[tuple[str, ...], ...]:
    """Colours of cells of polarisers, from a table that may name them pixel by pixel.

    Parameters
    ----------
    colors
        A table of cells, or one of pixels: the same name all over each cell.
    cell
        Rows and columns of pixels of a cell.
    """
    table = np.array(colors)
    high, broad = cell
    if cell == (1, 1) or table.shape[0] % high or table.shape[1] % broad:
        return colors
    cells = table[::high, ::broad]
    if not np.array_equal(np.repeat(np.repeat(cells, high, axis=0), broad, axis=1), table):
        return colors
    return tuple(tuple(str(name) for name in row) for row in cells)
