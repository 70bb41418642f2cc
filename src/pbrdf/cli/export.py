"""``pbrdf export``: models as files for renderers and other programs."""

from __future__ import annotations

import math
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pbrdf.cli.console import progress_bar, warn
from pbrdf.cli.directions import GRID, directions_of
from pbrdf.cli.options import Backend, NoProgressBar, angles_option, model_argument, output_option
from pbrdf.cli.sources import known_wavelength, models_at, open_single_model
from pbrdf.cli.values import require_folder_of
from pbrdf.errors import PbrdfError

if TYPE_CHECKING:
    from pbrdf.models import Model
    from pbrdf.rendering.export import PbsdfExport

__all__ = ["export"]


class Format(StrEnum):
    """Formats that models can be written in."""

    pbsdf = "pbsdf"
    csv = "csv"
    netcdf = "netcdf"
    merl = "merl"


_EXTENSIONS = {Format.pbsdf: ".pbsdf", Format.csv: ".csv", Format.netcdf: ".nc", Format.merl: ".binary"}
_REGIONS = {"hemisphere": "even over both hemispheres", "lobe": "in the lobe", "both": "together"}


def export(
    sources: Annotated[
        list[str],
        model_argument("Models' JSON files, folders of fits, or bundled paints: one for each wavelength."),
    ],
    format: Annotated[
        Format | None,
        typer.Option(
            help="pbsdf: Mitsuba's measured_polarized. merl: scalar, three colours. csv, netcdf: a grid of Mueller "
            "matrices.",
            show_default="from the output's extension, else pbsdf",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        output_option("The new file: .pbsdf, .binary, .csv or .nc.", show_default="<model>.<format>"),
    ] = None,
    wavelength: Annotated[
        list[float] | None,
        typer.Option(
            help="Wavelength of each MODEL in nm, in their order, or those of a fit with a model of each "
            "(repeatable).",
            metavar="NM",
        ),
    ] = None,
    theta_i: Annotated[
        str | None,
        angles_option(
            "csv, netcdf: angles of incidence, START:STOP:STEP or a list.", show_default=GRID["theta_i"]
        ),
    ] = None,
    theta_r: Annotated[
        str | None, angles_option("csv, netcdf: viewing angles.", show_default=GRID["theta_r"])
    ] = None,
    phi: Annotated[
        str | None,
        angles_option("csv, netcdf: azimuths, 0 in the forward half-plane.", show_default=GRID["phi"]),
    ] = None,
    quiet: NoProgressBar = False,
    backend: Backend = None,
) -> None:
    """Write models as files that renderers and other programs read.

    For Mitsuba: `pbrdf export pearl-white-scene --format pbsdf`

    Two wavelengths: `pbrdf export blue.json red.json --wavelength 476 --wavelength 650 -o paint.pbsdf`
    """
    from pbrdf.backend import set_backend
    from pbrdf.data import write
    from pbrdf.rendering.export import grid_dataset, write_merl, write_pbsdf

    kind, target = _target(sources[0], format, output)
    on_a_grid = kind in (Format.csv, Format.netcdf)
    for name, given in (("--theta-i", theta_i), ("--theta-r", theta_r), ("--phi", phi)):
        if given is not None and not on_a_grid:
            raise PbrdfError(f"{name}: a {kind.value} file has its own directions; leave it out")
    require_folder_of(target)
    if backend is not None:
        set_backend(backend)
    models = _models(sources, wavelength or [], kind)
    if kind is Format.merl:
        with progress_bar("Tabulating", quiet) as progress:
            planes = write_merl(models, target, progress=progress)
        print(f"{target}: {planes[0].size} cells of red, green and blue, scalar, simulated")
        return
    wavelengths = _wavelengths(sources, models, wavelength or [])
    if on_a_grid:
        where = directions_of(theta_i, theta_r, phi, False, None)
        dataset = grid_dataset(
            models, where["theta_i"], where["theta_r"], where["phi"], wavelengths=wavelengths
        )
        write(dataset, target)
        print(f"{target}: {dataset.sizes['geometry']} Mueller matrices, simulated")
        return
    with progress_bar("Tabulating", quiet) as progress:
        written = write_pbsdf(models, target, wavelengths=wavelengths, progress=progress)
    _tell(written, stated=wavelengths is not None)


def _target(source: str, format: Format | None, output: Path | None) -> tuple[Format, Path]:
    """What is written and where to; the extension decides where no format is given, and must fit one that is."""
    if output is None:
        kind = format or Format.pbsdf
        stem = "model" if source.lstrip().startswith("{") else Path(source).resolve().stem
        return kind, Path(stem + _EXTENSIONS[kind])
    of_extension = {extension: kind for kind, extension in _EXTENSIONS.items()}.get(output.suffix.lower())
    if of_extension is None:
        raise PbrdfError(f"--output {output}: the extension must be one of {', '.join(_EXTENSIONS.values())}")
    if format not in (None, of_extension):
        raise PbrdfError(f"--output {output}: a {format.value} file is called {_EXTENSIONS[format]}")
    return of_extension, output


def _models(sources: list[str], wavelengths: list[float], kind: Format) -> list[Model]:
    """The model of each source, or those of the one fit at each wavelength."""
    if len(sources) == 1 and wavelengths and (fitted := models_at(sources[0], wavelengths)) is not None:
        return fitted
    if kind is Format.merl and wavelengths:
        raise PbrdfError(
            "--wavelength: a merl file states no wavelength, only red, green and blue; leave it out"
        )
    # of another number of wavelengths the writer tells
    chosen = wavelengths if len(wavelengths) == len(sources) else [None] * len(sources)
    return [open_single_model(source, nm) for source, nm in zip(sources, chosen, strict=True)]


def _wavelengths(sources: list[str], models: list[Model], stated: list[float]) -> list[float] | None:
    """A wavelength for each model; None where there is one model of which none is known."""
    if stated:
        return stated
    known = [known_wavelength(source) for source in sources]
    if len(models) == 1 and known[0] is None:
        return None
    if None in known or len(set(known)) < len(known):
        raise PbrdfError(
            f"{len(models)} models: state the wavelength of each, in their order, with --wavelength"
        )
    return [w for w in known if w is not None]


def _tell(written: PbsdfExport, stated: bool) -> None:
    from pbrdf.rendering.export import AIMS
    from pbrdf.rendering.tabulation import ZENITH_LIMIT

    table = written.table
    size = written.path.stat().st_size / 1e6
    nodes = f"{len(table.theta_h)} × {len(table.theta_d)} × {len(table.phi_d)} nodes of θ_h, θ_d and φ_d"
    print(f"{written.path}: {size:.0f} MB, {nodes}, {', '.join(map(str, table.wavelength))} nm, simulated")
    print(
        "Error of interpolation |Δ|/f00 at random geometries, zenith angles up to "
        f"{math.degrees(ZENITH_LIMIT):.0f}°:"
    )
    for error in written.errors:
        print(
            f"  {_REGIONS[error.region]:26s} median {100 * error.median:.2f} %, 99th percentile "
            f"{100 * error.percentile_99:.2f} %  ({error.geometries})"
        )
    if not written.accurate:
        warn(
            f"{written.path}: this misses the aim of {100 * AIMS[0]:.2f} % and {100 * AIMS[1]:.2f} %: the model is "
            "too steep for a table of a bearable size"
        )
    if written.below:
        warn(
            f"{written.path}: {written.below} cells are 0: the model is below 0 there, by less than a millionth of its "
            "mirror peak"
        )
    if not stated:
        warn(
            f"{written.path}: no wavelength is known: {table.wavelength[0]} nm is written; state it with --wavelength"
        )
    print("In Mitsuba 3, variant llvm_ad_mono_polarized or another polarised one:")
    print(written.xml)
