"""``pbrdf reduce``: raw frames of a polarimeter made into Stokes parameters, pictures and data sets."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pbrdf.cli.console import output_console, progress_bar, warn
from pbrdf.cli.folders import ready_folder, say_written
from pbrdf.cli.instruments import open_instrument
from pbrdf.cli.options import (
    DarkLevel,
    output_option,
    polarimeter_option,
    quiet_option,
    regions_option,
    roi_option,
)
from pbrdf.cli.regions import open_regions
from pbrdf.cli.values import memory_size
from pbrdf.errors import PbrdfError

if TYPE_CHECKING:
    from pbrdf.instruments.polarimeter.instrument import Instrument
    from pbrdf.instruments.reduction.regions import Region

__all__ = ["reduce"]

#: Extensions of tables of readings.
_TABLES = (".csv", ".tsv", ".txt", ".dat")


def reduce(
    frames: Annotated[
        Path,
        typer.Argument(
            metavar="FRAMES",
            help="Raw frames: a folder of PNG, TIFF or NPY files (one a state, called SERIES_STATE, or a folder a "
            "series), a TIFF or NPY stack, raw camera files, netCDF, Zarr, or mosaic pictures; or a CSV table of "
            "readings of a dual rotating retarder; or a rendered Stokes picture (OpenEXR, without --polarimeter).",
        ),
    ],
    polarimeter: Annotated[str | None, polarimeter_option()] = None,
    output: Annotated[
        Path | None,
        output_option("Folder for the results.", show_default="<frames>-reduced"),
    ] = None,
    regions: Annotated[
        Path | None,
        regions_option("Regions to average over"),
    ] = None,
    roi: Annotated[
        list[str] | None,
        roi_option(
            "A region in pixels of the Stokes picture, columns and rows from the top left: paint=100:200,150:260, "
            "disc=ellipse:X,Y,RX,RY or edge=polygon:X,Y,X,Y,X,Y (repeatable)."
        ),
    ] = None,
    angles: Annotated[
        Path | None,
        typer.Option(
            help="CSV table of the angles of each series (series, theta_i, theta_r, phi; degrees): each region then "
            "gives a data set that `pbrdf fit` reads.",
            metavar="FILE",
        ),
    ] = None,
    series: Annotated[
        str | None, typer.Option(help="Take only these series, e.g. p1_01,p1_02.", metavar="NAMES")
    ] = None,
    maps: Annotated[
        str, typer.Option(help="Format of the Stokes parameters of every pixel.", metavar="nc|zarr|none")
    ] = "nc",
    datasets: Annotated[str, typer.Option(help="Format of the data sets.", metavar="csv|nc")] = "csv",
    pictures: Annotated[
        bool,
        typer.Option(
            "--pictures/--no-pictures", help="Draw S0, DoLP and AoLP, or what Mueller matrices say."
        ),
    ] = True,
    weighted: Annotated[
        bool,
        typer.Option("--weighted/--unweighted", help="Weigh the states of a pixel by their noise, or alike."),
    ] = True,
    dark_level: DarkLevel = 0.0,
    max_memory: Annotated[
        str,
        typer.Option(help="Memory for frames and what is computed from them, e.g. 200MB.", metavar="SIZE"),
    ] = "500MB",
    quiet: Annotated[bool, quiet_option("Print the name of the folder only.")] = False,
) -> None:
    """Turn raw frames of a polarimeter into Stokes parameters with their uncertainty.

    Writes a folder with summary.csv (means of regions), stokes.nc (every pixel), quick-look pictures, and with
    --angles one data set for each region.

    Files to try it with: `pbrdf example mosaic frames`

    A mosaic camera: `pbrdf reduce picture.png -p sony_imx250mzr`

    A measurement: `pbrdf reduce run/frames -p run/polarimeter.toml --angles run/angles.csv --roi paint=4:8,4:8`

    Then fit what came out: `pbrdf fit frames-reduced/paint.csv`
    """
    memory = memory_size(max_memory, "--max-memory")
    if not math.isfinite(dark_level):
        raise PbrdfError(f"--dark-level {dark_level}: give a number")
    if maps not in ("nc", "zarr", "none"):
        raise PbrdfError(f"--maps {maps!r}: choose nc, zarr or none")
    if datasets not in ("csv", "nc"):
        raise PbrdfError(f"--datasets {datasets!r}: choose csv or nc")
    from pbrdf.instruments.frames.frame_files import open_frames
    from pbrdf.instruments.frames.frames import ChosenSeries, Frames, notes_of
    from pbrdf.instruments.goniometer.angle_table import read_angles
    from pbrdf.report.reduction.folder import Wanted, write_reduction

    if maps == "zarr":
        from pbrdf.data.formats.zarr_folder import require_zarr

        require_zarr(Path("stokes.zarr"))
    if frames.suffix.lower() == ".exr":
        _reduce_pictures(
            frames,
            output=output,
            regions=open_regions(regions, roi or []),
            angles=angles,
            datasets=datasets,
            quiet=quiet,
        )
        return
    if polarimeter is None:
        from pbrdf.instruments.polarimeter.presets import PRESETS

        raise PbrdfError(
            "--polarimeter: say what took the frames: the TOML file of the instrument (docs/instruments.md), or a "
            f"built-in one: {', '.join(PRESETS)}"
        )
    instrument = open_instrument(polarimeter, mueller=True, colors=True)
    if instrument.generator is not None:
        _reduce_mueller(
            frames,
            instrument,
            output=output,
            regions=open_regions(regions, roi or []),
            angles=angles,
            series=series,
            datasets=datasets,
            memory=memory,
            pictures=pictures,
            quiet=quiet,
        )
        return
    found: Frames = open_frames(frames, instrument)
    table = None if angles is None else read_angles(angles)
    if series is not None:
        names = [name.strip() for name in series.split(",") if name.strip()]
        found = ChosenSeries(found, names)
        table = None if table is None else table.for_frames(found).rows(names)
    chosen = open_regions(regions, roi or [])
    if table is not None and not chosen:
        raise PbrdfError(
            f"--angles: say which part of the picture is the sample, for example "
            f"--roi sample=0:{found.columns},0:{found.rows} for all of it"
        )
    plain = frames.resolve()
    folder, stood = _folder(frames, output)
    wanted = Wanted(None if maps == "none" else maps, pictures, chosen, table, f".{datasets}")
    with progress_bar(f"Reducing {frames}", quiet) as progress:
        result = write_reduction(
            found,
            instrument,
            folder,
            wanted,
            name=plain.name,
            dark_level=dark_level,
            weighted=weighted,
            max_memory=memory,
            progress=progress,
        )
    for note in notes_of(found):
        warn(note)
    if quiet:
        print(folder)
        return
    from pbrdf.report.reduction.summary import print_averages

    console = output_console()
    console.print(
        f"{len(found.names)} series of {found.states} states, {found.columns} × {found.rows} pixels; "
        f"{instrument.polarimeter.name}",
        markup=False,
    )
    shown = {name: means for name, means in result.averages.items() if name in chosen} or result.averages
    print_averages(shown, found.names, console)
    say_written(folder, result.files, stood)


def _folder(frames: Path, output: Path | None) -> tuple[Path, frozenset[str]]:
    """Where the results go, checked to be writable and not to be where the frames are; and what stands there."""
    plain = frames.resolve()
    folder = output or Path(
        f"{plain.name if plain.is_dir() and plain.suffix != '.zarr' else plain.stem}-reduced"
    )
    if folder.resolve() == plain:
        raise PbrdfError(
            f"--output {folder}: the frames are in this folder; choose another one for the results"
        )
    return folder, ready_folder(folder)


def _reduce_mueller(
    frames: Path,
    instrument: Instrument,
    *,
    output: Path | None,
    regions: dict[str, Region],
    angles: Path | None,
    series: str | None,
    datasets: str,
    memory: int,
    pictures: bool,
    quiet: bool,
) -> None:
    """Mueller matrices from frames or from a table of readings."""
    from pbrdf.instruments.frames.frame_files import open_frames
    from pbrdf.instruments.frames.frames import ChosenSeries, Frames, notes_of
    from pbrdf.instruments.goniometer.angle_table import read_angles
    from pbrdf.instruments.reduction.mueller_reduction import mueller_of_frames, mueller_of_table
    from pbrdf.instruments.reduction.regions import Rectangle
    from pbrdf.report.reduction.folder import WHOLE_PICTURE
    from pbrdf.report.reduction.mueller_folder import mueller_warnings, print_mueller, write_mueller

    table = None if angles is None else read_angles(angles)
    notes: list[str] = []
    if frames.suffix.lower() in _TABLES:
        if regions or series is not None:
            raise PbrdfError(
                f"{frames}: a table of readings has no regions, and all of its series are reduced"
            )
        means = mueller_of_table(frames, instrument)
        table = means.angles if table is None else table
        found = {frames.stem: means}
    else:
        opened: Frames = open_frames(frames, instrument)
        if series is not None:
            names = [name.strip() for name in series.split(",") if name.strip()]
            opened = ChosenSeries(opened, names)
            table = None if table is None else table.rows(names)
        if table is not None and not regions:
            raise PbrdfError(
                f"--angles: say which part of the picture is the sample, for example "
                f"--roi sample=0:{opened.columns},0:{opened.rows} for all of it"
            )
        chosen = regions or {WHOLE_PICTURE: Rectangle(0, opened.columns, 0, opened.rows)}
        with progress_bar(f"Reducing {frames}", quiet) as progress:
            found = mueller_of_frames(opened, instrument, chosen, max_memory=memory, progress=progress)
        notes = notes_of(opened)
    folder, stood = _folder(frames, output)
    files = write_mueller(
        found,
        instrument,
        folder,
        angles=table,
        suffix=f".{datasets}",
        name=frames.resolve().name,
        pictures=pictures,
    )
    for note in [*mueller_warnings(found), *notes]:
        warn(note)
    if quiet:
        print(folder)
        return
    console = output_console()
    print_mueller(found, console)
    say_written(folder, files, stood)


def _reduce_pictures(
    path: Path,
    *,
    output: Path | None,
    regions: dict[str, Region],
    angles: Path | None,
    datasets: str,
    quiet: bool,
) -> None:
    """Means of regions of a rendered picture."""
    from pbrdf.instruments.goniometer.angle_table import read_angles
    from pbrdf.instruments.reduction.regions import Rectangle
    from pbrdf.rendering.picture_regions import open_series
    from pbrdf.rendering.variant import start_mitsuba
    from pbrdf.report.reduction.folder import WHOLE_PICTURE, write_picture_reduction
    from pbrdf.report.reduction.summary import print_averages

    if not path.is_file():
        raise PbrdfError(f"{path}: there is no such file")
    start_mitsuba()
    series = open_series([path])
    rows, columns = series.shape
    table = None if angles is None else read_angles(angles)
    if table is not None and not regions:
        raise PbrdfError(
            f"--angles: say which part of the picture is the sample, for example --roi sample=0:{columns},0:{rows} for "
            "all of it"
        )
    chosen = regions or {WHOLE_PICTURE: Rectangle(0, columns, 0, rows)}
    folder, stood = _folder(path, output)
    result = write_picture_reduction(
        series, chosen, folder, angles=table, suffix=f".{datasets}", name=path.name
    )
    if quiet:
        print(folder)
        return
    console = output_console()
    print_averages(result.averages, series.names, console)
    say_written(folder, result.files, stood)
