"""``pbrdf map``: a model fitted to every pixel of a picture, into a store that is gone on with after a kill."""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pbrdf.cli.command_line import command_line
from pbrdf.cli.console import NOT_CONVERGED, output_console, stage_bar, warn
from pbrdf.cli.fit_options import (
    Bounds,
    FigureFormats,
    FitNoise,
    FittedModel,
    Fix,
    Free,
    Iterations,
    Loss,
    ModelOptions,
    Nuisances,
    Objective,
    Priors,
    Start,
    fit_arguments,
    fitted_model,
)
from pbrdf.cli.interrupt import say_when_interrupted
from pbrdf.cli.options import Backend, output_option, polarimeter_option, quiet_option, seed_option
from pbrdf.cli.values import memory_size, require_folder_of
from pbrdf.errors import DataError, PbrdfError

if TYPE_CHECKING:
    import xarray as xr

    from pbrdf.inversion.map_store.picture_source import PictureSource
    from pbrdf.inversion.map_store.unit_grid import UnitGrid
    from pbrdf.inversion.parameter_map import MapFit
    from pbrdf.models import Model
    from pbrdf.report.parameter_map.subject import MapReport

__all__ = ["map_pixels"]

_MACHINES = "Many machines"
_FITTING, _SHARING, _QUICK_LOOK = "Fitting", "Finding what pixels share", "quicklook.png"
#: Memory that a number of the data takes while its unit is fitted, bytes: a measured upper bound.
_BYTES = 32
#: Numbers of the data of a map that is fitted in memory, as for a netCDF file, at most.
_MOST_IN_MEMORY = 200_000_000


def map_pixels(
    stokes: Annotated[
        list[Path],
        typer.Argument(
            metavar="STOKES",
            help="Stokes pictures (stokes.nc or .zarr of `pbrdf reduce`), data with dimensions beside geometry, or "
            "with --polarimeter raw frames. Several: more series of the same pixels.",
        ),
    ],
    geometry: Annotated[
        list[str] | None,
        typer.Option(
            "--geometry",
            "-g",
            help="Geometry of the pixels of Stokes pictures: flat, sphere, cylinder, normals, angles or mesh, see "
            "above; repeat it for one a file.",
            metavar="KIND[:…]",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        output_option(
            "The map: a store (.zarr), resumed if it is there, or a small map in one file (.nc).",
            show_default="STOKES-map.zarr",
        ),
    ] = None,
    model: FittedModel = "double-gauss",
    option: ModelOptions = None,
    fix: Fix = None,
    free: Free = None,
    bounds: Bounds = None,
    start: Start = None,
    starts: Annotated[
        int,
        typer.Option(
            help="Starts of the pixels of a coarse grid; the others begin at their neighbours.", min=1
        ),
    ] = 64,
    iterations: Iterations = 100,
    noise: FitNoise = None,
    nuisance: Nuisances = None,
    prior: Priors = None,
    objective: Objective = "stokes",
    loss: Loss = "linear",
    share: Annotated[
        list[str] | None,
        typer.Option(
            help="A parameter that all pixels, or all of a label, have in common (repeatable).",
            metavar="NAME",
        ),
    ] = None,
    labels: Annotated[
        Path | None,
        typer.Option(
            help="Parts of the sample: a picture of whole numbers, 0 is left out, or regions (TOML, CSV).",
            metavar="FILE",
        ),
    ] = None,
    correlation: Annotated[
        bool, typer.Option("--correlation", help="Keep the correlations of each pixel's estimates.")
    ] = False,
    counts_per_brdf: Annotated[
        float | None,
        typer.Option(
            help="Digital numbers for a BRDF times cos θ_i of 1/sr, if known: the values are then BRDFs.",
            metavar="DN",
        ),
    ] = None,
    polarimeter: Annotated[
        str | None,
        polarimeter_option(
            "STOKES are raw frames of this instrument: reduce them first, as `pbrdf reduce` does."
        ),
    ] = None,
    angles: Annotated[
        Path | None,
        typer.Option(help="With --polarimeter: CSV table of the angles of each series.", metavar="FILE"),
    ] = None,
    seed: Annotated[int, seed_option("Seed of the starts.")] = 0,
    figure_format: FigureFormats = "png",
    figures: Annotated[
        bool, typer.Option("--figures/--no-figures", help="Draw maps, and a quick look while it runs.")
    ] = True,
    backend: Backend = None,
    quiet: Annotated[bool, quiet_option("Print the name of the map only.")] = False,
    worker: Annotated[
        str | None,
        typer.Option(
            help="This is worker i of N, counted from 1, that fill one store without knowing of each other.",
            metavar="i/N",
            rich_help_panel=_MACHINES,
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            help="Have the workers of a Dask scheduler fill the store, e.g. tcp://host:8786.",
            metavar="ADDRESS",
            rich_help_panel=_MACHINES,
        ),
    ] = None,
    unit: Annotated[
        int | None,
        typer.Option(
            help="Pixels along the side of a unit: what a kill costs, and what is in memory at a time.",
            min=8,
            metavar="PIXELS",
            show_default="256, or what --max-memory holds",
            rich_help_panel=_MACHINES,
        ),
    ] = None,
    max_memory: Annotated[
        str,
        typer.Option(
            help="About so much memory for a unit and its data.", metavar="SIZE", rich_help_panel=_MACHINES
        ),
    ] = "2GB",
) -> None:
    """Fit a model to every pixel: maps of its parameters with their standard errors.

    Writes the map (docs/maps.md says how to read it with xarray), and beside it the folder MAP-report: a page
    (index.html: open it in a browser), summary.txt and figures. While it runs, MAP-report/quicklook.png shows what is
    done. Interrupted or killed, it goes on where it was when the same command is run again.

    Geometries (angles in degrees, all keys in docs/pixel-geometry.md): `flat`, with `theta_i=30,theta_r=40,phi=0`
    after a colon or the angles of `pbrdf reduce --angles`, and `fov=20` for perspective; `sphere:light=POLAR@AZIMUTH`
    and `cylinder:light=…`, found in the picture; `normals:FILE,light=…`; `angles:FILE`;
    `mesh:FILE,camera=X/Y/Z,light=…`.

    Exit code 3: not one pixel has a result.

    Files to try it with (reduce them first, as it says): `pbrdf example frames`

    A panel under several lights: `pbrdf map frames-reduced/stokes.nc -g flat -o paint.zarr`

    A ball in one picture: `pbrdf map stokes.nc -g "sphere:light=40@90" --share n -o ball.zarr`
    """
    from pbrdf.report.fit.folder import parse_formats

    formats = parse_formats(figure_format, "--figure-format")
    memory = memory_size(max_memory, "--max-memory")
    target = output or Path(f"{stokes[0].resolve().stem}-map.zarr")
    place = _worker(worker)
    _check_output(target, place, scheduler)
    _require_not_read(target, [*stokes, labels, angles, *map(Path, filter(None, (polarimeter, model)))])
    if counts_per_brdf is not None and not 0.0 < counts_per_brdf < math.inf:
        raise PbrdfError(f"--counts-per-brdf {counts_per_brdf:g}: it must be more than 0")
    arguments = fit_arguments(
        option=option,
        fix=fix,
        free=free,
        bounds=bounds,
        start=start,
        starts=starts,
        iterations=iterations,
        noise=noise,
        nuisance=nuisance,
        prior=prior,
        objective=objective,
        loss=loss,
        seed=seed,
    ) | {"share": list(share or ()), "correlation": correlation}
    if angles is not None and polarimeter is None:
        raise PbrdfError("--angles belongs to --polarimeter: Stokes pictures and data hold their own angles")
    chosen = fitted_model(model)
    from pbrdf.files.atomic import require_writable_folder
    from pbrdf.instruments.pixel_geometry.text_form import parse_pixel_geometry

    try:
        places = [parse_pixel_geometry(text) for text in geometry or ()]
    except PbrdfError as error:
        raise PbrdfError(f"--geometry: {error}") from error
    report = target.with_name(f"{target.stem}-report")
    require_writable_folder(report)
    if backend is not None:
        from pbrdf.backend import set_backend

        set_backend(backend)
    if polarimeter is not None:
        stokes = _reduced(stokes, polarimeter, angles, target, quiet)
    from pbrdf.instruments.pixel_geometry.labels import read_labels
    from pbrdf.inversion.map_store import open_map
    from pbrdf.inversion.map_store.made_from import MadeFrom
    from pbrdf.inversion.map_store.map_store import MapStore
    from pbrdf.inversion.map_store.picture_source import PictureSource
    from pbrdf.inversion.parameter_map import MapFit
    from pbrdf.inversion.parameter_map.map_fit import LABEL
    from pbrdf.report.parameter_map.subject import MapReport

    named = None if labels is None else LABEL
    source = PictureSource.open(stokes, places, scale=counts_per_brdf, labels=labels)
    try:
        outline = source.outline()
        fit = MapFit.prepare(outline, chosen, labels=named, **arguments)
    except DataError as error:
        raise DataError(f"{stokes[0]}: {error}") from error
    if target.exists() and target.suffix == ".zarr":
        # before what pixels share is sought, which takes long
        MapStore(target, fit, source).require_same_settings(apart_from="fit.shared")
    told = MadeFrom.relative_to(target.parent, stokes, geometry or (), counts_per_brdf, labels).attribute
    if target.suffix == ".nc":
        found = _fit_in_memory(source, outline, chosen, target, {"labels": named, **arguments}, told, quiet)
    else:
        picture = report / _QUICK_LOOK if figures else None
        grid = _units(outline, fit.dims, unit, memory)
        if unit is not None and target.exists():
            _require_units(target, MapStore(target, fit, source).grid, grid)
        if not _fill(target, fit, source, grid, told, place, scheduler, picture, quiet):
            if quiet:
                print(target)
            return
        found = open_map(target)
    subject = MapReport(
        found,
        target,
        [str(path) for path in stokes],
        {"model": model, **arguments, "geometry": geometry, "counts per brdf": counts_per_brdf},
        command_line(),
        simulated=bool(outline.attrs.get("simulated")),
        labels=None if labels is None else read_labels(labels, outline.sizes["y"], outline.sizes["x"]),
    )
    _report(subject, report, formats, figures, quiet)


def _check_output(target: Path, place: tuple[int, int] | None, scheduler: str | None) -> None:
    """Check before any work that the map can be put there."""
    from pbrdf.data.formats.zarr_folder import require_zarr

    if target.suffix not in (".zarr", ".nc"):
        raise PbrdfError(f"--output {target}: a map is a store (.zarr), or a file (.nc) if it is small")
    require_folder_of(target)
    if place is not None and scheduler is not None:
        raise PbrdfError(
            "--worker needs no scheduler, and the workers of --scheduler no number: give one of the two"
        )
    if target.suffix == ".nc":
        if place is not None or scheduler is not None:
            raise PbrdfError(
                f"--output {target}: several workers fill a store: choose a name that ends in .zarr"
            )
    else:
        require_zarr(target)


def _require_not_read(target: Path, read: Sequence[Path | None]) -> None:
    """Check that the map is not put in the place of a file that it is made from."""
    for path in read:
        if path is not None and path.resolve() == target.resolve():
            raise PbrdfError(f"--output {target}: the map is made from this file; choose another name")


def _worker(text: str | None) -> tuple[int, int] | None:
    """Number of a worker, and how many there are."""
    if text is None:
        return None
    match = re.fullmatch(r"\s*([0-9]{1,9})\s*/\s*([0-9]{1,9})\s*", text)
    if match is None or not 1 <= int(match[1]) <= int(match[2]):
        raise PbrdfError(f"--worker {text!r}: give i/N, counted from 1, for example 1/8")
    return int(match[1]), int(match[2])


def _reduced(
    frames: Sequence[Path], polarimeter: str, angles: Path | None, target: Path, quiet: bool
) -> list[Path]:
    """Stokes pictures of raw frames, in a folder beside the map; those that are there and newer are taken."""
    from pbrdf.cli.instruments import open_instrument
    from pbrdf.instruments.frames.frame_files import open_frames
    from pbrdf.instruments.frames.frames import notes_of
    from pbrdf.instruments.goniometer.angle_table import read_angles
    from pbrdf.report.reduction.folder import Wanted, write_reduction

    instrument = open_instrument(polarimeter)
    names = [path.resolve().stem for path in frames]
    for name in names:
        if names.count(name) > 1:
            raise PbrdfError(f"two of the frames are called {name!r}: reduce them first, one after the other")
    table = None if angles is None else read_angles(angles)
    given = [Path(polarimeter), *([] if angles is None else [angles])]
    found = []
    for path, name in zip(frames, names, strict=True):
        folder = target.with_name(f"{target.stem}-reduced") / name
        pictures = folder / f"stokes{target.suffix}"
        found.append(pictures)
        if pictures.exists() and _newest(pictures) > max(map(_newest, (path, *given))):
            if not quiet:
                warn(f"{pictures}: newer than its frames, not reduced again")
            continue
        raw = open_frames(path, instrument)
        with stage_bar(quiet, f"Reducing {path}") as show:
            write_reduction(
                raw,
                instrument,
                folder,
                Wanted(target.suffix.removeprefix("."), pictures=False, angles=table),
                name=name,
                progress=lambda done, total, path=path: show(f"Reducing {path}", done, total),  # type: ignore[misc]
            )
        for note in notes_of(raw):
            warn(note)
    return found


def _newest(path: Path) -> float:
    """When a file, or the last one of a folder, was written; 0 for what is none."""
    files = path.rglob("*") if path.is_dir() else [path]
    return max((file.stat().st_mtime for file in files if file.is_file()), default=0.0)


def _fit_in_memory(
    source: PictureSource,
    outline: xr.Dataset,
    model: str | Model,
    target: Path,
    arguments: dict[str, Any],
    told: dict[str, str],
    quiet: bool,
) -> xr.Dataset:
    """Fit a small map and write it into one file."""
    from pbrdf.files.atomic import atomic_file
    from pbrdf.files.netcdf_files import write_netcdf_file
    from pbrdf.inversion.parameter_map import fit_map

    numbers = sum(variable.size for variable in outline.variables.values())
    if numbers > _MOST_IN_MEMORY:
        raise PbrdfError(
            f"--output {target}: the data have {numbers:.2g} numbers, too many for a map in memory: choose a name that "
            "ends in .zarr"
        )
    with stage_bar(quiet, _FITTING) as show:
        progress = functools.partial(show, f"{_FITTING}, pixels")
        found = fit_map(source.block({}), model, progress=progress, **arguments).assign_attrs(told)
    with atomic_file(target) as beside:
        write_netcdf_file(beside, {"/": found})
    return found


def _fill(
    target: Path,
    fit: MapFit,
    source: PictureSource,
    grid: UnitGrid,
    told: dict[str, str],
    place: tuple[int, int] | None,
    scheduler: str | None,
    picture: Path | None,
    quiet: bool,
) -> bool:
    """Fit what is missing in the store of a map, of units as ``grid`` says; returns whether it is complete."""
    from pbrdf.inversion.map_store import prepare_store, run_on_scheduler, run_units
    from pbrdf.inversion.map_store.shared_file import with_shared
    from pbrdf.report.parameter_map.quicklook import QuickLook

    if fit.settings["share"]:
        kept = target.with_name(f"{target.stem}-shared.npz")
        with stage_bar(quiet, _SHARING) as show:
            fit = with_shared(fit, source, grid, kept, progress=functools.partial(show, f"{_SHARING}, units"))
    shard = dict(zip(grid.dims, grid.shard, strict=True))
    store = prepare_store(target, fit, source, shard=shard, told=told)
    look = None if picture is None else QuickLook(store, picture)
    state = [0, store.grid.count]
    say_when_interrupted(
        lambda: (
            f"interrupted; {state[0]} of {state[1]} units are kept in {target}: the same command goes on from there"
        )
    )
    with stage_bar(quiet, _FITTING) as show:

        def progress(done: int, total: int) -> None:
            state[:] = done, total
            show(f"{_FITTING}, units", done, total)
            if look is not None:
                look()

        def within(done: int, pixels: int) -> None:
            show(f"{_FITTING}, unit {state[0] + 1} of {state[1]}, pixels", done, pixels)

        if scheduler is not None:
            work = run_on_scheduler(store, scheduler, progress=progress)
        else:
            work = run_units(store, worker=place, progress=progress, within=within)
    say_when_interrupted()
    if work.left and not quiet:
        warn(
            f"{target}: {work.left} units are left to other workers; the one that ends last draws the figures"
        )
    return not work.left


def _units(outline: xr.Dataset, dims: Sequence[str], side: int | None, memory: int) -> UnitGrid:
    """How a map is cut where there is no store yet: by the side asked for, or as the memory asked for holds."""
    from pbrdf.inversion.map_store.unit_grid import UNIT, UnitGrid

    sizes = {dim: outline.sizes[dim] for dim in dims}
    if side is not None:
        return UnitGrid.of(sizes, {dim: min(side, size) for dim, size in sizes.items()})
    numbers = sum(
        math.prod(size for dim, size in variable.sizes.items() if dim not in sizes)
        for variable in outline.variables.values()
        if set(dims) & set(map(str, variable.dims))
    )
    return UnitGrid.of(sizes, pixels=max(min(memory // (_BYTES * numbers), UNIT), 1))


def _require_units(target: Path, begun: UnitGrid, asked: UnitGrid) -> None:
    """Raise if units of another size are asked for than a map was begun with: they stay as they are."""
    if begun.shard != asked.shard:
        cut, wanted = (" × ".join(map(str, grid.shard)) for grid in (begun, asked))
        raise PbrdfError(
            f"--unit: {target} was begun in units of {cut} pixels, and goes on in these; {wanted} are asked for: leave "
            "--unit out, or choose another folder"
        )


def _report(subject: MapReport, folder: Path, formats: Sequence[str], figures: bool, quiet: bool) -> None:
    """Write the page beside a map and print what it says."""
    from pbrdf.report.parameter_map.folder import write_map_report
    from pbrdf.report.parameter_map.summary import print_map
    from pbrdf.report.style import leave_out_help_texts

    if figures:
        leave_out_help_texts()
    with stage_bar(quiet, "Drawing the map"):
        summary, files = write_map_report(subject, folder, formats=formats, figures=figures)
    (folder / _QUICK_LOOK).unlink(missing_ok=True)
    if quiet:
        print(subject.path)
    else:
        console = output_console()
        print_map(summary, console)
        names = ", ".join(file.name for file in files)
        console.print(f"\nWritten: {subject.path}, and {folder}/: {names}", markup=False)
    if not summary.fitted:
        raise typer.Exit(NOT_CONVERGED)
