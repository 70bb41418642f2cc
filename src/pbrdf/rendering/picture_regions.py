"""Regions of rendered Stokes pictures: means, and goniometric data sets as reductions of frames give them.

The pictures are those of ``pbrdf render`` or of Mitsuba's own ``stokes`` integrator; their radiances take the place of
digital numbers. The noise of a mean is that of the pixels' standard errors, where the file has them, else what the
pixels differ by.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from pbrdf.data.build import make_dataset
from pbrdf.errors import DataError
from pbrdf.instruments.goniometer.angle_table import AngleTable
from pbrdf.instruments.reduction.region_averages import RegionAverage
from pbrdf.instruments.reduction.regions import Region, require_inside
from pbrdf.instruments.reduction.surface_axes import to_surface_axes
from pbrdf.optics.stokes import STOKES
from pbrdf.rendering.picture import StokesPicture, read_exr_colors

__all__ = ["PictureSeries", "open_series", "picture_averages", "picture_dataset"]


@dataclass(frozen=True, eq=False)
class PictureSeries:
    """Pictures of one size, one a series.

    Attributes
    ----------
    pictures
        By the name of the series: that of the file, with the colour where there are several.
    sources
        For each series the file and the colour, without a wavelength; empty where there are no colours.
    """

    pictures: Mapping[str, StokesPicture]
    sources: tuple[tuple[str, str, float | None], ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.pictures)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return next(iter(self.pictures.values())).shape


def open_series(paths: Sequence[Path]) -> PictureSeries:
    """Read OpenEXR pictures.

    Raises
    ------
    DataError
        If one cannot be read, or they differ in size.
    """
    pictures: dict[str, StokesPicture] = {}
    sources: list[tuple[str, str, float | None]] = []
    for path in paths:
        colors = read_exr_colors(path)
        for color, picture in colors.items():
            pictures[f"{path.stem}_{color}" if color else path.stem] = picture
            if color:
                sources.append((path.stem, color, None))
            first = next(iter(pictures.values()))
            if picture.shape != first.shape:
                raise DataError(f"{path}: {picture.shape} pixels, but the first picture has {first.shape}")
    if sources and len(sources) != len(pictures):
        raise DataError("some of the pictures have colours and others have none: reduce them apart")
    return PictureSeries(pictures, tuple(sources))


def picture_averages(series: PictureSeries, regions: Mapping[str, Region]) -> dict[str, list[RegionAverage]]:
    """For each region the mean in each series; pixels that are not finite are left out as dead.

    Raises
    ------
    DataError
        If a region is not within the pictures.
    """
    rows, columns = series.shape
    require_inside(regions, rows, columns)
    return {
        name: [_average(p, region.mask(0, rows, columns)) for p in series.pictures.values()]
        for name, region in regions.items()
    }


def _average(picture: StokesPicture, mask: np.ndarray) -> RegionAverage:
    values = picture.stokes[:, mask]
    good = np.isfinite(values).all(axis=0)
    values, std = values[:, good], picture.std[:, mask][:, good]
    count, pixels = int(good.sum()), int(mask.sum())
    counts = {"good": count, "saturated": 0, "dead": pixels - count, "dark": 0}
    nothing = np.full((4, 4), np.nan)
    if not count:
        return RegionAverage(nothing[0], nothing, nothing.copy(), nothing[0].copy(), pixels, counts)
    scatter = values.std(axis=1, ddof=1) if count > 1 else nothing[0]
    if np.isfinite(std).all():
        noise = np.diag((std**2).sum(axis=1)) / count**2
    else:
        noise = np.cov(values) / count if count > 1 else nothing
    return RegionAverage(values.mean(axis=1), noise, noise.copy(), scatter, pixels, counts)


def picture_dataset(
    series: PictureSeries,
    means: Sequence[RegionAverage],
    angles: AngleTable,
    *,
    attrs: Mapping[str, Any] | None = None,
) -> xr.Dataset:
    """A data set of the means of one region, as radiance, in the axes (p, s) of the surface.

    Parameters
    ----------
    series, means
        The pictures, and the mean of the region in each.
    angles
        One row for each series or, of coloured pictures, for each file; `reference_angle` is 0 where it is not stated.
    attrs
        Further attributes.

    Raises
    ------
    DataError
        If the angles are not those of these series, or a region has no finite pixel.
    """
    table = angles.for_colors(series.sources).rows(series.names)
    if not all(mean.counts["good"] for mean in means):
        raise DataError("a region has no finite pixel in a series")
    scale = np.asarray(table.exposure)
    stokes, covariance = to_surface_axes(
        np.stack([mean.stokes for mean in means]) / scale[:, None],
        np.stack([mean.covariance for mean in means]) / scale[:, None, None] ** 2,
        np.nan_to_num(np.asarray(table.reference_angle)),
    )
    known = np.isfinite(covariance).all()
    return make_dataset(
        table.theta_i,
        table.theta_r,
        np.asarray(table.phi),
        quantity="radiance",
        **dict(zip(STOKES, stokes.T, strict=True)),
        covariance=covariance if known else None,
        wavelength=table.wavelength,
        group=table.group,
        simulated=True,
        attrs={"source": "a rendered picture", **(attrs or {})},
    )
