"""``pbrdf library``: materials with their scatter between specimens, for ``pbrdf identify``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pbrdf.cli.console import output_console, stage_bar, warn
from pbrdf.cli.fit_options import fitted_model
from pbrdf.cli.options import (
    Backend,
    CommandGroup,
    ReadingCommand,
    library_option,
    quiet_option,
    with_reading_options,
)
from pbrdf.cli.reading import Reading
from pbrdf.cli.specimens import (
    BUNDLED,
    LIBRARY,
    Measurement,
    library_file,
    open_library,
    open_measurement,
)
from pbrdf.cli.values import numbers, require_folder_of
from pbrdf.cli.wavelengths import require_choice
from pbrdf.errors import DataError, FitError, PbrdfError

if TYPE_CHECKING:
    from pbrdf.inversion.result import FitResult

__all__ = ["library"]

#: The model that data are fitted with.
_MODEL = "double-gauss"
#: Wavelengths that differ by less are one, nm.
_SAME_WAVELENGTH = 0.5

library = typer.Typer(
    cls=CommandGroup,
    no_args_is_help=True,
    add_completion=False,
    help="Libraries of materials, each a mean and a scatter over specimens: what `pbrdf identify` compares with. "
    "Everywhere the library is the file that --library names, else library.json in this folder; without either the "
    "bundled paints are shown and compared with. A name that ends in .json, before all others, is the library too: "
    "`pbrdf library show paints.json white`.",
)

_Shown = Annotated[Path | None, library_option()]
_Changed = Annotated[Path | None, library_option(changed=True)]


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
    library: _Changed = None,
    model: Annotated[
        str | None,
        typer.Option(
            help="Model that is fitted to data (see `pbrdf models`, `pbrdf compare`); for more than that, fit first: "
            "`pbrdf fit`.",
            show_default="double-gauss",
        ),
    ] = None,
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

    Fits that describe nothing are refused; those that describe their data in part, or whose parameters stand on bounds,
    are taken with a caution that the library keeps.

    Files to try it with: `pbrdf example panels`

    Two panels: `pbrdf library add pearl panels/pearl-white-1.csv panels/pearl-white-2.csv --library paints.json`

    Two fits: `pbrdf library add white panel-1-fit panel-2-fit --library paints.json`

    One file: `pbrdf library add enamel enamel.csv --scatter sigma=0.15,n=0.02`
    """
    from pbrdf.identification.library import Library, read_library
    from pbrdf.identification.material import material_from_fits

    stated = numbers(scatter.split(","), "--scatter", "sigma=0.15,n=0.02") if scatter is not None else {}
    named, (name, *sources) = _library_first([name, *sources], library)
    if not sources:
        raise PbrdfError(f"{name}: name its specimens as well, fits or data")
    file = named or LIBRARY
    require_folder_of(file)
    known = read_library(file) if file.exists() else Library(())
    if name in known.names and not replace:
        raise FitError(f"{file}: there is a material {name!r} already: choose another name, or --replace it")
    if backend is not None:
        from pbrdf.backend import set_backend

        set_backend(backend)
    specimens = [open_measurement(source, reading) for source in sources]
    for specimen in specimens:
        if specimen.fit is not None and model is not None:
            raise PbrdfError(f"{specimen.source} is a fit, of a model already: leave --model out")
    wavelength = _wavelength(name, specimens)
    fits = [_fitted(specimen, reading, model or _MODEL, quiet) for specimen in specimens]
    for specimen, made in zip(specimens, fits, strict=True):
        _require_description(specimen, made)
    try:
        material = material_from_fits(
            name,
            fits,
            scatter=stated,
            simulated=all(bool(s.dataset.attrs.get("simulated")) for s in specimens),
            wavelength=wavelength,
            provenance=[_provenance(s, reading, model) for s in specimens],
            labels=[f"the fit of {source}" for source in sources],
        )
    except FitError as error:
        text = str(error)
        raise FitError(f"--{text}" if text.startswith("scatter:") else text) from error
    had = known.calibration is not None
    changed = known.with_material(material, overwrite=replace)
    changed.write(file)
    if doubts := len(material.fits.cautions):
        warn(
            f"{name}: {doubts} of {len(fits)} fits {'is' if doubts == 1 else 'are'} not sound in every respect, and "
            f"identification is no better: `pbrdf library show {name} --library {file}` says why, and what to do"
        )
    if quiet:
        print(file)
        return
    from pbrdf.report.identification.library_summary import print_material

    print_material(material, output_console())
    _say_written(file, len(changed.materials), had)


@library.command("list", cls=ReadingCommand)
def list_materials(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="[FILE]", help="The library.", show_default=False)
    ] = None,
    library: _Shown = None,
) -> None:
    """List the materials of a library: model, specimens, where the scatter between them comes from."""
    from pbrdf.report.identification.library_summary import print_library

    named, others = _library_first(names or [], library)
    if others:
        raise PbrdfError(f"{others[0]}: a library's file ends in .json; `pbrdf library show` shows materials")
    file = library_file(named)
    print_library(open_library(file), str(file or BUNDLED), output_console())


@library.command(cls=ReadingCommand)
def show(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="[NAME]", help="Materials.", show_default="all")
    ] = None,
    library: _Shown = None,
) -> None:
    """Show materials: parameters of the mean specimen, scatter between specimens, where they come from."""
    from pbrdf.report.identification.library_summary import print_material

    named, wanted_names = _library_first(names or [], library)
    file = library_file(named)
    opened = open_library(file)
    try:
        wanted = [opened[name] for name in wanted_names] or list(opened.materials)
    except FitError as error:
        raise FitError(f"{file or BUNDLED}: {error}") from error
    console = output_console()
    for number, material in enumerate(wanted):
        if number:
            console.print()
        print_material(material, console)


@library.command(cls=ReadingCommand)
def remove(
    names: Annotated[list[str], typer.Argument(metavar="NAME", help="Materials to remove.")],
    library: _Changed = None,
) -> None:
    """Remove materials from a library."""
    from pbrdf.identification.library import read_library

    named, unwanted = _library_first(names, library)
    file = library_file(named)
    if file is None:
        raise PbrdfError(
            f"there is no {LIBRARY} in this folder, and {BUNDLED} stay: name a file with --library"
        )
    if not unwanted:
        raise PbrdfError(f"name the materials to remove from {file}")
    known = read_library(file)
    changed = known
    try:
        gone = [known[name].name for name in dict.fromkeys(unwanted)]
    except FitError as error:
        raise FitError(f"{file}: {error}") from error
    for name in gone:
        changed = changed.without(name)
    changed.write(file)
    _say_written(file, len(changed.materials), known.calibration is not None)


def _library_first(names: list[str], library: Path | None) -> tuple[Path | None, list[str]]:
    """The file that is named as library, before the other names or with the option, and the others."""
    if not names or Path(names[0]).suffix.lower() != ".json":
        return library, names
    if library is not None:
        raise PbrdfError(f"two libraries are named, {names[0]} and --library {library}: leave one out")
    return Path(names[0]), names[1:]


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


def _fitted(specimen: Measurement, reading: Reading, model: str, quiet: bool) -> FitResult:
    """The specimen's own fit, or one of a model as ``pbrdf fit`` makes it by default."""
    import functools

    if specimen.fit is not None:
        return specimen.fit
    from pbrdf.inversion import fit

    require_choice(specimen.dataset, reading, specimen.source)
    what = f"Fitting {specimen.source}"
    try:
        with stage_bar(quiet, what) as progress:
            return fit(specimen.dataset, fitted_model(model), progress=functools.partial(progress, what))
    except FitError as error:
        raise FitError(f"{specimen.source}: {error}") from error


def _require_description(specimen: Measurement, fit: FitResult) -> None:
    """Raise if the model does not describe the specimen: its parameters are none of a material."""
    from pbrdf.inversion.verdict import Level

    judged = fit.verdict()
    if judged.level is Level.DOES_NOT:
        raise FitError(
            f"{specimen.source}: {judged.sentence} No material can be made of them: `pbrdf compare DATA` finds a model "
            "that describes the data, --model takes it"
        )


def _provenance(specimen: Measurement, reading: Reading, model: str | None) -> str:
    """Which fit it is, or which data and how they were read and fitted."""
    if specimen.fit is not None:
        return f"fit {specimen.origin}"
    options = {**reading.stated(), **({} if model is None else {"model": model})}
    given = []
    for name, value in options.items():
        option = f"--{name.replace('_', '-')}"
        values = value if isinstance(value, list) else [value]
        given += [option if one is True else f"{option} {_plain(one)}" for one in values]
    how = f" ({' '.join(given)})" if given else ""
    return f"fitted to {specimen.origin}{how}"


def _plain(value: object) -> str:
    """A value of an option as one would type it."""
    return f"{value:g}" if isinstance(value, float) else str(value)
