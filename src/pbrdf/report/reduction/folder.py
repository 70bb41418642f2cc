"""The folder that a reduction leaves behind."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pbrdf.data.readers import write
from pbrdf.errors import DataError
from pbrdf.files.atomic import atomic_folder
from pbrdf.instruments.frames.frames import Frames
from pbrdf.instruments.goniometer.angle_table import AngleTable
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.reduction.goniometric_datasets import DatasetCollector
from pbrdf.instruments.reduction.map_files import MapWriter
from pbrdf.instruments.reduction.reduce import Sink, reduce
from pbrdf.instruments.reduction.region_averages import RegionAverage, RegionCollector
from pbrdf.instruments.reduction.regions import Rectangle, Region
from pbrdf.instruments.reduction.streaming import DEFAULT_MEMORY
from pbrdf.rendering.picture_regions import PictureSeries, picture_averages, picture_dataset
from pbrdf.report.reduction.gallery import Gallery, safe_name
from pbrdf.report.reduction.summary import write_averages
from pbrdf.version import __version__

__all__ = ["WHOLE_PICTURE", "Reduction", "Wanted", "write_picture_reduction", "write_reduction"]

#: What tables call the average over all pixels.
WHOLE_PICTURE = "(whole picture)"


@dataclass(frozen=True)
class Wanted:
    """What is to be made of the frames.

    Attributes
    ----------
    maps
        Stokes parameters pixel by pixel: ``"nc"``, ``"zarr"``, or None.
    pictures
        Quick-look pictures.
    regions
        To be averaged over, besides the whole picture.
    angles
        Of the series; with them each region gives a goniometric data set.
    datasets
        Extension of those, ``".csv"`` or ``".nc"``.
    """

    maps: str | None = "nc"
    pictures: bool = True
    regions: Mapping[str, Region] = field(default_factory=dict)
    angles: AngleTable | None = None
    datasets: str = ".csv"


@dataclass(frozen=True)
class Reduction:
    """What was found, and the files it is in.

    Attributes
    ----------
    averages
        For each region, and the whole picture, the average in each series.
    files
        In the order of their importance to a reader.
    """

    averages: dict[str, list[RegionAverage]]
    files: list[Path]


def write_reduction(
    frames: Frames,
    instrument: Instrument,
    directory: Path,
    wanted: Wanted,
    *,
    name: str,
    dark_level: float = 0.0,
    weighted: bool = True,
    max_memory: int = DEFAULT_MEMORY,
    progress: Callable[[int, int], None] | None = None,
) -> Reduction:
    """Reduce frames and write what is wanted.

    Everything is written beside the folder first. A new folder appears complete; in one that is there, the files of the
    same names are replaced and others are left alone.

    Parameters
    ----------
    frames, instrument
        What was measured, and with what.
    directory
        The folder.
    wanted
        What to write.
    name
        What to call the frames.
    dark_level, weighted, max_memory, progress
        See :func:`pbrdf.instruments.reduction.streaming.reduced_blocks`.

    Raises
    ------
    DataError
        If the input does not fit together or the folder cannot be written.
    """
    whole = RegionCollector({WHOLE_PICTURE: Rectangle(0, frames.columns, 0, frames.rows)}, frames, instrument)
    parts = (
        RegionCollector(wanted.regions, frames, instrument)
        if wanted.angles is None
        else DatasetCollector(wanted.regions, frames, instrument, wanted.angles)
    )
    file_names = _file_names(wanted.regions)
    sinks: list[Sink[Any]] = [whole, parts]
    names = ["summary.csv"]
    with atomic_folder(directory, fill=True) as temporary:
        if wanted.maps is not None:
            names.append(f"stokes.{wanted.maps}")
            described = {"title": f"Stokes parameters of {name}", "source": f"pbrdf {__version__}"}
            sinks.append(
                MapWriter(temporary / names[-1], frames, instrument, angles=wanted.angles, attrs=described)
            )
        gallery = Gallery(frames, temporary, name, wanted.regions)
        if wanted.pictures:
            sinks.append(gallery)
        reduce(
            frames,
            instrument,
            sinks,
            dark_level=dark_level,
            weighted=weighted,
            max_memory=max_memory,
            progress=progress,
        )
        averages = {**whole.averages(), **parts.averages()}
        write_averages(averages, frames.names, temporary / names[0])
        if isinstance(parts, DatasetCollector):
            attrs = {"source": f"{name}, reduced by pbrdf {__version__}"}
            for region, dataset in parts.datasets(attrs=attrs).items():
                names.append(f"{file_names[region]}{wanted.datasets}")
                write(dataset, temporary / names[-1])
        names += gallery.files
    return Reduction(averages, [directory / n for n in names])


def write_picture_reduction(
    series: PictureSeries,
    regions: Mapping[str, Region],
    directory: Path,
    *,
    angles: AngleTable | None,
    suffix: str,
    name: str,
) -> Reduction:
    """Average regions of rendered pictures and write ``summary.csv``, and with angles a data set for each region.

    Parameters
    ----------
    series
        The pictures.
    regions
        Parts of them by name.
    directory
        The folder.
    angles
        Of the series, or None.
    suffix
        Extension of the data sets.
    name
        What to call the pictures.

    Raises
    ------
    DataError
        If the input does not fit together or the folder cannot be written.
    """
    averages = picture_averages(series, regions)
    names = ["summary.csv"]
    with atomic_folder(directory, fill=True) as temporary:
        write_averages(averages, series.names, temporary / names[0])
        if angles is not None:
            file_names = _file_names(regions)
            for region, means in averages.items():
                names.append(f"{file_names[region]}{suffix}")
                attrs = {"title": f"region {region}", "source": f"{name}, averaged by pbrdf {__version__}"}
                write(picture_dataset(series, means, angles, attrs=attrs), temporary / names[-1])
    return Reduction(averages, [directory / n for n in names])


def _file_names(regions: Mapping[str, Region]) -> dict[str, str]:
    """What the files of regions are called, without extension."""
    found: dict[str, str] = {}
    for region in regions:
        if region == WHOLE_PICTURE or not region.isprintable():
            raise DataError(f"region {region!r}: this cannot be its name: choose another")
        safe = safe_name(region)
        if safe in found.values() or safe in ("summary", "stokes"):
            raise DataError(f"region {region!r}: its file {safe!r} would be another's: choose another name")
        found[region] = safe
    return found
