"""Goniometric data sets from series of frames: averages of regions, their angles, Stokes vectors turned to (p, s)."""

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
from pbrdf.instruments.reduction.reduce import reduce
from pbrdf.instruments.reduction.region_averages import RegionAverage, RegionCollector
from pbrdf.instruments.reduction.regions import Region
from pbrdf.instruments.reduction.streaming import DEFAULT_MEMORY
from pbrdf.instruments.reduction.surface_axes import to_surface_axes
from pbrdf.optics.stokes import STOKES

__all__ = ["DatasetCollector", "goniometric_datasets"]


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
    frames, instrument, regions, angles
        See :class:`DatasetCollector`.
    dark_level, weighted, max_memory, progress
        See :func:`pbrdf.instruments.reduction.streaming.reduced_blocks`.
    simulated, attrs
        See :func:`pbrdf.data.make_dataset`.

    Returns
    -------
    dict of str to xarray.Dataset
        See :meth:`DatasetCollector.datasets`.

    Raises
    ------
    DataError
        If frames, regions and angles do not fit each other, or a region has no good pixel in any series.
    """
    collector = DatasetCollector(regions, frames, instrument, angles)
    reduce(
        frames,
        instrument,
        [collector],
        dark_level=dark_level,
        weighted=weighted,
        max_memory=max_memory,
        progress=progress,
    )
    return collector.datasets(simulated=simulated, attrs=attrs)


class DatasetCollector(RegionCollector):
    """Goniometric data sets of regions: a sink for :func:`pbrdf.instruments.reduction.reduce.reduce`.

    Parameters
    ----------
    regions
        Parts of the picture by name.
    frames, instrument
        What was measured, and with what.
    angles
        One row for each series, in any order; of a colour camera one for each picture will do.

    Raises
    ------
    DataError
        If a region is not within the pictures, or the angles are not those of these series.
    """

    def __init__(
        self, regions: Mapping[str, Region], frames: Frames, instrument: Instrument, angles: AngleTable
    ) -> None:
        super().__init__(regions, frames, instrument)
        angles = angles.for_frames(frames)
        _require_same_series(frames.names, angles)
        self._table = angles.rows(frames.names)

    def datasets(
        self, *, simulated: bool = False, attrs: Mapping[str, Any] | None = None
    ) -> dict[str, xr.Dataset]:
        """One data set for each region.

        Parameters
        ----------
        simulated, attrs
            See :func:`pbrdf.data.make_dataset`.

        Returns
        -------
        dict of str to xarray.Dataset
            By the names of the regions: mean Stokes vectors of the good pixels in digital numbers, divided by the
            exposure, in the axes (p, s) of the surface, with their covariance (:class:`.RegionAverage`). Series in
            which a region has no good pixel are left out, as the attribute ``series_without_good_pixels`` says.

        Raises
        ------
        DataError
            If a region has no good pixel in any series.
        """
        return {
            region: self._dataset(region, means, simulated, attrs or {})
            for region, means in self.averages().items()
        }

    def _dataset(
        self, region: str, means: Sequence[RegionAverage], simulated: bool, attrs: Mapping[str, Any]
    ) -> xr.Dataset:
        table, instrument = self._table, self._instrument
        used = np.array([mean.counts["good"] > 0 for mean in means])
        left_out = f"{_reasons(means)} of {sum(mean.pixels for mean in means)}"
        if not used.any():
            raise DataError(f"region {region!r} has no good pixel in any series: {left_out} pixels")
        scale = np.asarray(table.exposure)[used]
        own = table.reference_angle
        stokes, covariance = to_surface_axes(
            np.stack([mean.stokes for mean in means])[used] / scale[:, None],
            np.stack([mean.covariance for mean in means])[used] / scale[:, None, None] ** 2,
            np.where(np.isnan(own), instrument.reference_angle, own)[used],
        )
        measured: dict[str, Any] = {
            name: stokes[:, k] for k, name in enumerate(STOKES) if not np.isnan(stokes[:, k]).all()
        }
        notes: dict[str, Any] = {
            "title": f"region {region}",
            "source": "frames reduced by pbrdf",
            "instrument": instrument.polarimeter.name,
            "region": region,
            "masked_pixels": left_out,
        }
        if not used.all():
            notes["series_without_good_pixels"] = [
                name for name, good in zip(table.names, used, strict=True) if not good
            ]
        return make_dataset(
            table.theta_i[used],
            table.theta_r[used],
            np.asarray(table.phi)[used],
            quantity="dn",
            **measured,
            covariance=covariance,
            wavelength=None if table.wavelength is None else np.asarray(table.wavelength)[used],
            group=np.asarray(table.group)[used],
            simulated=simulated,
            attrs={**notes, **attrs},
        )


def _require_same_series(names: Sequence[str], angles: AngleTable) -> None:
    """Check that frames and angle table speak of the same series; names what one has and the other has not."""
    without = [name for name in names if name not in angles.names]
    if without:
        raise DataError(
            f"the angle table has no row for the series {named(without)}; it has {named(angles.names)}"
        )
    unseen = [name for name in angles.names if name not in names]
    if unseen:
        raise DataError(f"the angle table has rows for {named(unseen)}, of which there are no frames")


def _reasons(means: Sequence[RegionAverage]) -> str:
    """How many pixels were left out, and why, over all series."""
    return ", ".join(f"{kind} {sum(m.counts[kind] for m in means)}" for kind in ("saturated", "dead", "dark"))
