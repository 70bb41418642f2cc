"""``pbrdf library``: materials with their scatter between specimens, for ``pbrdf identify``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pbrdf.cli.console import output_console, stage_bar
from pbrdf.cli.options import Backend, ReadingCommand, quiet_option, with_reading_options
from pbrdf.cli.reading import Reading
from pbrdf.cli.specimens import BUNDLED, Measurement, open_library, open_measurement
from pbrdf.cli.values import numbers, require_folder_of
from pbrdf.cli.wavelengths import require_choice
from pbrdf.errors import DataError, FitError

if TYPE_CHECKING:
    from pbrdf.inversion.result import FitResult

__all__ = ["library"]

#: The file that materials go to where none is named.
_FILE = Path("library.json")
#: Wavelengths that differ by less are one, nm.
_SAME_WAVELENGTH = 0.5

library = typer.Typer(
    no_args_is_help=True,
    help="Libraries of materials, each a mean and a scatter over specimens: what `pbrdf identify` compares with.",
)

_Shown = Annotated[
    Path | None, typer.Option("--library", "-o", help="The library's file.", show_default=BUNDLED)
]
_Changed = Annotated[Path, typer.Option("--library", "-o", help="The library's file.")]


@library.command(cls=ReadingCommand)
@with_reading_options
def add(
    name: Annotated[str, typer.Argument(metavar="NAME", help="What the material is called.")],
    sources: Annotated[
        list[str],
        typer.Argument(
            metavar="FIT|DATA",
            help="Specimens: folders of `pbrdf fit`, or data, which are fitted as `pbrdf fit` does by default.",
        ),
    ],
    *,
    reading: Reading,
    library: _Changed = _FILE,
    scatter: Annotated[
        str | None,
        typer.Option(
            help="Scatter between specimens where only one is known: relative for parameters that are scales, else in "
            "the parameter's unit, e.g. sigma=0.15,n=0.02.",
            metavar="NAME=STD[,…]",
            show_default="10 % of scales, 2 % of the range of the others",
        ),
    ] = None,
    replace: Annotated[
        bool, typer.Option("--replace", help="In place of the material of that name that is there.")
    ] = False,
    backend: Backend = None,
    quiet: Annotated[bool, quiet_option("Print the name of the file only.")] = False,
) -> None:
    """Add a material: the mean and the scatter of its specimens' parameters, one fit or file a specimen.

    Two specimens or more show how they scatter; of one alone the scatter is assumed, which `list` and `show` say.

    Two panels: `pbrdf library add white panel-1-fit panel-2-fit --library paints.json`

    One file: `pbrdf library add enamel enamel.csv --scatter sigma=0.15,n=0.02`
    """
    from pbrdf.identification.library import Library, read_library
    from pbrdf.identification.material import material_from_fits

    stated = numbers(scatter.split(","), "--scatter", "sigma=0.15,n=0.02") if scatter is not None else {}
    require_folder_of(library)
    known = read_library(library) if library.exists() else Library(())
    if name in known.names and not replace:
        raise FitError(
            f"{library}: there is a material {name!r} already: choose another name, or --replace it"
        )
    if backend is not None:
        from pbrdf.backend import set_backend

        set_backend(backend)
    specimens = [open_measurement(source, reading) for source in sources]
    wavelength = _wavelength(name, specimens)
    fits = [_fitted(specimen, reading, quiet) for specimen in specimens]
    try:
        material = material_from_fits(
            name,
            fits,
            scatter=stated,
            simulated=all(bool(s.dataset.attrs.get("simulated")) for s in specimens),
            wavelength=wavelength,
            provenance=[f"fitted to {s.origin}" if s.fit is None else f"fit {s.origin}" for s in specimens],
        )
    except FitError as error:
        text = str(error)
        if text.startswith("scatter:"):
            text = f"--{text}"
        for number, source in reversed([*enumerate(sources, start=1)]):
            text = text.replace(f"fit {number} ", f"the fit of {source} ")
        raise FitError(text) from error
    had = known.calibration is not None
    changed = known.with_material(material, overwrite=replace)
    changed.write(library)
    if quiet:
        print(library)
        return
    from pbrdf.report.identification.library_summary import print_material

    print_material(material, output_console())
    _say_written(library, len(changed.materials), had)


@library.command("list")
def list_materials(library: _Shown = None) -> None:
    """List the materials of a library: model, specimens, where the scatter between them comes from."""
    from pbrdf.report.identification.library_summary import print_library

    print_library(open_library(library), str(library or BUNDLED), output_console())


@library.command()
def show(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="[NAME]", help="Materials.", show_default="all")
    ] = None,
    library: _Shown = None,
) -> None:
    """Show materials: parameters of the mean specimen, scatter between specimens, where they come from."""
    from pbrdf.report.identification.library_summary import print_material

    opened = open_library(library)
    try:
        wanted = [opened[name] for name in names] if names else list(opened.materials)
    except FitError as error:
        raise FitError(f"{library or BUNDLED}: {error}") from error
    console = output_console()
    for number, material in enumerate(wanted):
        if number:
            console.print()
        print_material(material, console)


@library.command()
def remove(
    names: Annotated[list[str], typer.Argument(metavar="NAME", help="Materials to remove.")],
    library: _Changed = _FILE,
) -> None:
    """Remove materials from a library."""
    from pbrdf.identification.library import read_library

    known = read_library(library)
    changed = known
    try:
        gone = [known[name].name for name in dict.fromkeys(names)]
    except FitError as error:
        raise FitError(f"{library}: {error}") from error
    for name in gone:
        changed = changed.without(name)
    changed.write(library)
    _say_written(library, len(changed.materials), known.calibration is not None)


def _say_written(library: Path, count: int, calibrated: bool) -> None:
    console = output_console()
    console.print(
        f"\nWritten: {library}, {count} material{'' if count == 1 else 's'}; "
        f"`pbrdf identify DATA --library {library}` compares with them.",
        markup=False,
    )
    if calibrated:
        console.print("The calibration was of other materials and is gone: calibrate again.", markup=False)


def _wavelength(name: str, specimens: Sequence[Measurement]) -> float:
    """The wavelength of all specimens, NaN if none states one."""
    import numpy as np

    found = [s.dataset["wavelength"].values for s in specimens if "wavelength" in s.dataset.coords]
    known = np.unique(np.concatenate([np.asarray(w, dtype=float) for w in found])) if found else np.empty(0)
    known = known[np.isfinite(known)]
    if not known.size:
        return float("nan")
    if known[-1] - known[0] > _SAME_WAVELENGTH:
        raise DataError(
            f"material {name}: its specimens were measured at {known[0]:g} … {known[-1]:g} nm, and a material is of "
            "one wavelength: take one of each with --wavelength, and fit folders of one"
        )
    return float(np.median(known))


def _fitted(specimen: Measurement, reading: Reading, quiet: bool) -> FitResult:
    """The specimen's own fit, or one as ``pbrdf fit`` makes it by default."""
    import functools

    if specimen.fit is not None:
        return specimen.fit
    from pbrdf.inversion import fit

    require_choice(specimen.dataset, reading, specimen.source)
    what = f"Fitting {specimen.source}"
    try:
        with stage_bar(quiet, what) as progress:
            return fit(specimen.dataset, progress=functools.partial(progress, what))
    except FitError as error:
        raise FitError(f"{specimen.source}: {error}") from error
