"""Tables of a model over half and difference angles: where the nodes must lie, and what interpolation makes of them.

Linear interpolation between nodes Δ apart errs by Δ² f''/8. How large that is, is probed along lines through
random geometries, for all wavelengths at once; the nodes are then laid so that every step errs by about the same
share of f00. Of the specular lobe nothing else is assumed: a dense probing grid that grows in proportion to θ_h
finds it, however narrow.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pbrdf.data.formats.pbsdf import HORIZON, PolarizedTable, mueller_to_pbsdf
from pbrdf.models import Model
from pbrdf.optics.half_difference import directions, half_difference
from pbrdf.rendering.storable import Storable, darkest, storable

__all__ = [
    "LARGEST_TABLE",
    "ZENITH_LIMIT",
    "RefinedTable",
    "TableError",
    "random_directions",
    "refined_table",
]

Array = NDArray[np.float64]
Progress = Callable[[int, int], None]

#: Largest zenith angle of the geometries at which a table is judged.
ZENITH_LIMIT = math.radians(80.0)
#: A table has at most this many cells at each wavelength (64 bytes each), whatever accuracy was asked for.
LARGEST_TABLE = 2_000_000

#: The first and the last node of θ_h and θ_d keep off 0 and π/2, where frames and cosines vanish.
_FIRST, _LAST = 1e-6, math.radians(89.5)
#: Cells with a direction below the horizon take the value of the nearest φ_d with this cosine or a larger one.
_FILL_COSINE = math.cos(math.radians(89.0))
#: Error of a step of the first attempt, in units of the median and of the 99th percentile that are asked for.
_FIRST_TOLERANCE = (1.3, 0.26)
#: Shares of θ_h, θ_d and φ_d in it: φ_d hardly matters in the lobe.
_SHARES = (1.0, 1.0, 1.25)
_ATTEMPTS = 4
#: Largest steps of θ_h, θ_d and φ_d, where the model is flat.
_LARGEST_STEPS = np.radians([8.0, 6.0, 20.0])
_LINES = 200
_MIRROR = np.float32(np.outer([1, 1, -1, -1], [1, 1, -1, -1]))
#: Share of the lines along which a step keeps within the tolerance.
_QUANTILE = 0.97


class TableError(NamedTuple):
    """Error of interpolation, |Δ|/f00 with the largest |Δ| of the sixteen elements.

    For a metal, whose f00 falls to nothing beside the lobe, f00 is at least a millionth of the specular peak.

    Attributes
    ----------
    region
        ``"hemisphere"``, ``"lobe"``, or ``"both"`` together.
    median, percentile_99
        Over the random geometries, at the worst wavelength.
    geometries
        Their number at a wavelength.
    """

    region: str
    median: float
    percentile_99: float
    geometries: int


class RefinedTable(NamedTuple):
    """What :func:`refined_table` makes.

    Attributes
    ----------
    table
        The table; the best one within :data:`LARGEST_TABLE` where the accuracy cannot be had.
    errors
        Its errors for ``"hemisphere"``, ``"lobe"`` and ``"both"``: at the worst wavelength.
    below
        Number of cells, of all wavelengths, that are 0 because the model's f00 is below 0 by rounding, see
        :func:`pbrdf.rendering.storable.storable`.
    """

    table: PolarizedTable
    errors: list[TableError]
    below: int


class _Needs(NamedTuple):
    """Along one axis: the probed steps, and the error that each would leave if it were taken whole."""

    nodes: Array
    error: Array


def random_directions(width: float, count: int, seed: int = 0) -> dict[str, tuple[Array, Array, Array]]:
    """Random geometries with both zenith angles up to :data:`ZENITH_LIMIT`, by region.

    ``"hemisphere"``: both directions are distributed evenly over the solid angle, independently. ``"lobe"``: that of
    the source is, the viewer sees it mirrored in a facet whose two slopes are normally distributed with the standard
    deviation `width`.

    Parameters
    ----------
    width
        See :meth:`pbrdf.models.base.Model.lobe_width`.
    count
        How many in each region.
    seed
        Of the random numbers.

    Returns
    -------
    dict
        θ_i, θ_r and φ by region, radians, shape (count,).
    """
    draw = np.random.default_rng(seed)
    lowest = math.cos(ZENITH_LIMIT)
    theta_i, theta_r = np.arccos(draw.uniform(lowest, 1.0, (2, count)))
    hemisphere = (theta_i, theta_r, draw.uniform(-np.pi, np.pi, count))
    pieces: list[Array] = []
    while sum(piece.shape[1] for piece in pieces) < count:
        theta_i = np.arccos(draw.uniform(lowest, 1.0, count))
        i = np.stack([-np.sin(theta_i), np.zeros(count), np.cos(theta_i)])
        m = np.stack([*draw.normal(0.0, width, (2, count)), np.ones(count)])
        m /= np.linalg.norm(m, axis=0)
        cosine = (i * m).sum(0)
        o = 2.0 * cosine * m - i
        seen = (o[2] > lowest) & (cosine > 0.0)
        pieces.append(
            np.stack([theta_i, np.arccos(np.clip(o[2], -1.0, 1.0)), np.arctan2(o[1], o[0])])[:, seen]
        )
    theta_i, theta_r, phi = np.concatenate(pieces, axis=1)[:, :count]
    return {"hemisphere": hemisphere, "lobe": (theta_i, theta_r, phi)}


def refined_table(
    models: Sequence[Model],
    wavelengths: Sequence[int],
    *,
    median: float,
    percentile_99: float,
    points: int = 20_000,
    progress: Progress | None = None,
) -> RefinedTable:
    """Tabulate models, one for each wavelength, with as many nodes as the accuracy asks for.

    Parameters
    ----------
    models
        Models with single numbers as parameters.
    wavelengths
        In nm, ascending whole numbers.
    median, percentile_99
        What the median and the 99th percentile of the error, see :class:`TableError`, shall not exceed, in each region
        and at each wavelength.
    points
        Random geometries in each region at each wavelength.
    progress
        Called with the finished and all parts of the table; it starts anew when the table is refined.

    Raises
    ------
    ModelError
        If a model is not finite somewhere, or below 0; see :func:`pbrdf.rendering.storable.storable`.
    """
    samples = [random_directions(float(model.lobe_width()), points) for model in models]
    needs = [_needs(models, axis) for axis in range(3)]
    first = min(_FIRST_TOLERANCE[0] * median, _FIRST_TOLERANCE[1] * percentile_99)
    finest = first / 100.0
    while math.prod(map(len, _axes(needs, finest))) > LARGEST_TABLE:
        finest *= 1.1
    tolerance = max(first, finest)
    for _ in range(_ATTEMPTS):
        table, below = _table(models, wavelengths, _axes(needs, tolerance), progress)
        errors = _errors(models, table, samples)
        excess = max(max(e.median / median, e.percentile_99 / percentile_99) for e in errors)
        if excess <= 1.0 or tolerance == finest:
            break
        tolerance = max(0.9 * tolerance / excess, finest)
    return RefinedTable(table, errors, below)


def _matrices(model: Model, theta_h: Array, theta_d: Array, phi_d: Array) -> Storable:
    """Mueller matrices in the convention of the file; shape (..., 4, 4)."""
    seen = _filled_from(theta_h, theta_d, phi_d)
    geometry = directions(theta_h, theta_d, seen)
    found = storable(model.mueller(*geometry), model, *geometry)
    return found._replace(values=mueller_to_pbsdf(found.values, theta_h, theta_d, seen))


def _filled_from(theta_h: Array, theta_d: Array, phi_d: Array) -> Array:
    """φ_d itself, or the nearest with both directions above the horizon, at which φ_d = ±π/2 always has them.

    The facet and the angle of incidence on it stay, and so do the lobe and Fresnel's coefficients.
    """
    theta_i, theta_r, _ = directions(theta_h, theta_d, phi_d)
    below = (np.cos(theta_i) <= HORIZON) | (np.cos(theta_r) <= HORIZON)
    bound = (np.cos(theta_h) * np.cos(theta_d) - _FILL_COSINE) / (np.sin(theta_h) * np.sin(theta_d))
    bound = np.clip(bound, 0.0, 1.0)
    nearest = np.copysign(np.arccos(np.clip(np.cos(phi_d), -bound, bound)), phi_d)
    return np.where(below, nearest, phi_d)


def _needs(models: Sequence[Model], axis: int) -> _Needs:
    """Probe an axis (0, 1, 2 for θ_h, θ_d, φ_d) along lines through random geometries."""
    grid = _probing_grid(axis)
    along = np.sort(np.concatenate([grid, (grid[1:] + grid[:-1]) / 2.0]))
    error = np.zeros(len(grid) - 1)
    for model in models:
        start = np.concatenate(
            [
                np.stack(half_difference(*g))
                for g in random_directions(float(model.lobe_width()), _LINES // 2, 1).values()
            ],
            axis=1,
        )
        angles = [np.repeat(column[:, np.newaxis], len(along), axis=1) for column in start]
        angles[axis] = np.broadcast_to(along, angles[axis].shape)
        theta_i, theta_r, _ = directions(*angles)
        lowest = np.minimum(np.cos(theta_i), np.cos(theta_r))
        f = _matrices(model, *angles).values
        middle = f[:, 1::2]
        off = np.abs(middle - (f[:, :-1:2] + f[:, 2::2]) / 2.0).max((-1, -2))
        off /= np.maximum(middle[..., 0, 0], darkest(model))
        # Near the horizon models run steeply to 0 or far up: less is asked for there.
        off *= np.minimum(lowest[:, 1::2] / math.cos(ZENITH_LIMIT), 1.0) ** 2
        valid = np.minimum(np.minimum(lowest[:, :-1:2], lowest[:, 1::2]), lowest[:, 2::2]) > _FILL_COSINE
        found = valid.any(axis=0)
        here = np.nanquantile(np.where(valid, off, np.nan)[:, found], _QUANTILE, axis=0)
        error = np.maximum(error, np.interp(np.arange(len(error)), np.flatnonzero(found), here))
    # A kink may lie in a neighbouring step for another line.
    around = np.pad(error, 1, mode="edge")
    return _Needs(grid, np.maximum(error, np.maximum(around[:-2], around[2:])))


def _probing_grid(axis: int) -> Array:
    if axis == 0:
        return np.concatenate([[_FIRST], np.geomspace(1e-4, _LAST, 300)])
    if axis == 1:
        return math.pi / 2 - np.geomspace(math.pi / 2 - _FIRST, math.pi / 2 - _LAST, 150)
    return np.linspace(0.0, math.pi, 121)


def _axes(needs: Sequence[_Needs], tolerance: float) -> list[NDArray[np.float32]]:
    """Nodes of the three axes, so that each step errs by `tolerance`, float32; φ_d is mirrored to −π … π."""
    axes = []
    for axis, (need, largest) in enumerate(zip(needs, _LARGEST_STEPS, strict=True)):
        # An error grows with the square of the step.
        steps = np.maximum(np.sqrt(need.error / (_SHARES[axis] * tolerance)), np.diff(need.nodes) / largest)
        count = np.concatenate([[0.0], np.cumsum(steps)])
        nodes = np.interp(np.linspace(0.0, count[-1], math.ceil(count[-1]) + 1), count, need.nodes)
        if axis == 2:
            nodes = np.concatenate([-nodes[:0:-1], nodes])
        axes.append(nodes.astype(np.float32))
    return axes


def _table(
    models: Sequence[Model],
    wavelengths: Sequence[int],
    axes: Sequence[NDArray[np.float32]],
    progress: Progress | None,
) -> tuple[PolarizedTable, int]:
    """The table on given nodes, and how many cells of it :class:`RefinedTable` counts as below 0."""
    # The model is evaluated where the nodes are after rounding.
    theta_h, theta_d, phi_d = (nodes.astype(np.float64) for nodes in axes)
    shape = (len(phi_d), len(theta_d), len(theta_h), len(models), 4, 4)
    matrices = np.empty(shape, dtype=np.float32)
    middle, below = len(phi_d) // 2, 0
    for index in range(middle, len(phi_d)):
        cells = np.broadcast_arrays(theta_h, theta_d[:, np.newaxis], phi_d[index])
        for which, model in enumerate(models):
            matrices[index, :, :, which], under = _matrices(model, *cells)
            below += int(under.sum()) * (1 if index == middle else 2)
        # −φ_d is the mirror image (docs/conventions.md, "Mirror symmetry").
        matrices[2 * middle - index] = matrices[index] * _MIRROR
        if progress is not None:
            progress(index - middle + 1, len(phi_d) - middle)
    return PolarizedTable(
        axes[0], axes[1], axes[2], np.asarray(wavelengths, dtype=np.uint16), matrices
    ), below


def _errors(
    models: Sequence[Model], table: PolarizedTable, samples: Sequence[dict[str, tuple[Array, Array, Array]]]
) -> list[TableError]:
    """Errors by region, those of the worst wavelength."""
    worst: dict[str, TableError] = {}
    for which, (model, sample) in enumerate(zip(models, samples, strict=True)):
        off = {}
        for region, geometry in sample.items():
            exact = model.mueller(*geometry)
            difference = np.abs(table.mueller(*geometry, which) - exact).max((-1, -2))
            off[region] = difference / np.maximum(exact[:, 0, 0], darkest(model))
        off["both"] = np.concatenate(list(off.values()))
        for region, values in off.items():
            median, high = np.quantile(values, (0.5, 0.99))
            before = worst.get(region, TableError(region, 0.0, 0.0, 0))
            worst[region] = TableError(
                region, max(before.median, float(median)), max(before.percentile_99, float(high)), values.size
            )
    return list(worst.values())
