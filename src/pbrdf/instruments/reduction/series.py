"""From series of frames to goniometric data sets: regions averaged, angles joined, Stokes vectors turned to (p, s)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from pbrdf.data.build import make_dataset
from pbrdf.errors import DataError
from pbrdf.instruments.frames.frames import Frames, named
from pbrdf.instruments.goniometer.angle_table import AngleTable
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.reduction.regions import Region, RegionAverage, RegionSum, require_inside, rows_of
from pbrdf.instruments.reduction.stokes_image import StokesImage
from pbrdf.instruments.reduction.streaming import DEFAULT_MEMORY, Block, reduced_blocks
from pbrdf.optics.elements import rotate_frame
from pbrdf.optics.stokes import STOKES

__all__ = [
    "RegionCollector",
    "datasets_of_averages",
    "goniometric_datasets",
    "require_same_series",
    "to_surface_frame",
]


class RegionCollector:
    """Averages of every region in every series, from blocks in any order.

    Parameters
    ----------
    regions
        By name.
    frames
        Their number of series and size of pictures.

    Raises
    ------
    DataError
        If a region is not within the pictures.
    """

    def __init__(self, regions: Mapping[str, Region], frames: Frames) -> None:
        require_inside(regions, frames.rows, frames.columns)
        self._regions = dict(regions)
        self._columns = frames.columns
        self._sums = {name: [RegionSum() for _ in frames.names] for name in regions}

    def add(self, block: Block) -> None:
        """Add a block of rows."""
        for name, region in self._regions.items():
            top, bottom = rows_of({name: region})
            first, last = max(top, block.first_row), min(bottom, block.last_row)
            if first >= last:
                continue
            here = slice(first - block.first_row, last - block.first_row)
            image = block.image
            part = StokesImage(image.stokes[:, here], image.covariance[:, :, here], image.flags[here])
            self._sums[name][block.series].add(part, region.mask(first, last, self._columns))

    def averages(self, instrument: Instrument) -> dict[str, list[RegionAverage]]:
        """For each region the average in each series."""
        return {name: [s.average(instrument) for s in sums] for name, sums in self._sums.items()}


def goniometric_datasets(
    frames: Frames,
    instrument: Instrument,
    regions: Mapping[str, Region],
    angles: AngleTable,
    *,
    dark_level: float = 0.0,
    weighted: bool = True,
    max_memory: int = DEFAULT_MEMORY,
    progress: Callable[[int, int], None] | None = None,
    simulated: bool = False,
    attrs: Mapping[str, Any] | None = None,
) -> dict[str, xr.Dataset]:
    """Reduce frames to one data set for each region, which a fit reads.

    Parameters
    ----------
    frames, instrument
        What was measured, and with what.
    regions
        Parts of the picture by name.
    angles
        One row for each series, in any order.
    dark_level, weighted
        See :func:`pbrdf.instruments.reduction.stokes_image.reduce_frames`.
    max_memory, progress
        See :func:`pbrdf.instruments.reduction.streaming.reduced_blocks`.
    simulated, attrs
        See :func:`pbrdf.data.make_dataset`.

    Returns
    -------
    dict of str to xarray.Dataset
        By the names of the regions: mean Stokes vectors of the good pixels in digital numbers, divided by the exposure,
        in the frame (p, s) of the surface, with their covariance (:class:`.RegionAverage`).

    Raises
    ------
    DataError
        If frames, regions and angles do not fit each other, or a region has no good pixel in any series.
    """
    require_same_series(frames.names, angles)
    collector = RegionCollector(regions, frames)
    for block in reduced_blocks(
        frames,
        instrument,
        lambda block: block,
        rows=rows_of(regions),
        dark_level=dark_level,
        weighted=weighted,
        max_memory=max_memory,
        progress=progress,
    ):
        collector.add(block)
    averages = collector.averages(instrument)
    return datasets_of_averages(averages, frames.names, instrument, angles, simulated=simulated, attrs=attrs)


def require_same_series(names: Sequence[str], angles: AngleTable) -> None:
    """Check that frames and angle table speak of the same series.

    Raises
    ------
    DataError
        Names what one has and the other has not.
    """
    without = [name for name in names if name not in angles.names]
    if without:
        raise DataError(
            f"the angle table has no row for the series {named(without)}; it has {named(angles.names)}"
        )
    unseen = [name for name in angles.names if name not in names]
    if unseen:
        raise DataError(f"the angle table has rows for {named(unseen)}, of which there are no frames")


def datasets_of_averages(
    averages: Mapping[str, Sequence[RegionAverage]],
    names: Sequence[str],
    instrument: Instrument,
    angles: AngleTable,
    *,
    simulated: bool = False,
    attrs: Mapping[str, Any] | None = None,
) -> dict[str, xr.Dataset]:
    """Join the averages of regions with their angles; parameters and result as in :func:`goniometric_datasets`.

    Series in which a region has no good pixel are left out, as the attribute ``series_without_good_pixels`` says.
    """
    table = angles.rows(names)
    reference = np.where(np.isnan(table.reference_angle), instrument.reference_angle, table.reference_angle)
    datasets = {}
    for region, means in averages.items():
        used = np.array([mean.counts["good"] > 0 for mean in means])
        if not used.any():
            raise DataError(
                f"region {region!r} has no good pixel in any series: {_reasons(means)} of "
                f"{sum(mean.pixels for mean in means)} pixels"
            )
        scale = np.asarray(table.exposure)[used]
        stokes, covariance = to_surface_frame(
            np.stack([mean.stokes for mean in means])[used] / scale[:, None],
            np.stack([mean.covariance for mean in means])[used] / scale[:, None, None] ** 2,
            reference[used],
        )
        measured: dict[str, Any] = {
            name: stokes[:, k] for k, name in enumerate(STOKES) if not np.isnan(stokes[:, k]).all()
        }
        notes: dict[str, Any] = {
            "title": f"region {region}",
            "source": "frames reduced by pbrdf",
            "instrument": instrument.polarimeter.name,
            "region": region,
            "masked_pixels": f"{_reasons(means)} of {sum(mean.pixels for mean in means)}",
        }
        if not used.all():
            notes["series_without_good_pixels"] = [n for n, good in zip(names, used, strict=True) if not good]
        datasets[region] = make_dataset(
            table.theta_i[used],
            table.theta_r[used],
            np.asarray(table.phi)[used],
            quantity="dn",
            **measured,
            covariance=covariance,
            wavelength=None if table.wavelength is None else np.asarray(table.wavelength)[used],
            group=np.asarray(table.group)[used],
            simulated=simulated,
            attrs={**notes, **(attrs or {})},
        )
    return datasets


def to_surface_frame(
    stokes: np.ndarray, covariance: np.ndarray, reference_angle: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Stokes vectors from the instrument's axes into the frame (p, s) of the surface.

    Parameters
    ----------
    stokes, covariance
        Shapes (G, 4) and (G, 4, 4); NaN where a component is not determined.
    reference_angle
        Radians from p to the instrument's x axis, from p towards s, shape (G,).

    Returns
    -------
    stokes, covariance
        Same shapes; NaN where a component that is not determined comes in.
    """
    matrix = rotate_frame(-reference_angle)
    unknown = (np.abs(matrix) > 1e-12) @ np.isnan(stokes)[..., None]
    turned = np.einsum("gij,gj->gi", matrix, np.nan_to_num(stokes))
    spread = np.einsum("gij,gjk,glk->gil", matrix, np.nan_to_num(covariance), matrix)
    # rounding must not leave it unsymmetric
    spread = 0.5 * (spread + spread.transpose(0, 2, 1))
    missing = unknown[..., 0]
    return (
        np.where(missing, np.nan, turned),
        np.where(missing[:, :, None] | missing[:, None, :], np.nan, spread),
    )


def _reasons(means: Sequence[RegionAverage]) -> str:
    """How many pixels were left out, and why, over all series."""
    return ", ".join(f"{kind} {sum(m.counts[kind] for m in means)}" for kind in ("saturated", "dead", "dark"))
