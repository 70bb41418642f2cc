"""The arguments and options that several commands share, each declared once.

What is the same in every command is a type, ``backend: Backend = None``. Where the help is the command's own, a
function makes the rest of the declaration: ``quiet: Annotated[bool, quiet_option("No progress bar.")] = False``.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from pbrdf.cli.help_page import READING_PANEL, command_page, group_page
from pbrdf.cli.reading import SELECTABLE, Reading

__all__ = [
    "CAMERA_POSITIONS",
    "WRITTEN",
    "AsJson",
    "Backend",
    "CalibrationError",
    "CommandGroup",
    "DarkLevel",
    "NoProgressBar",
    "Patch",
    "ReadingCommand",
    "WrittenWavelength",
    "angles_option",
    "data_argument",
    "instrument_option",
    "library_option",
    "model_argument",
    "noise_option",
    "output_option",
    "polarimeter_option",
    "quiet_option",
    "regions_option",
    "roi_option",
    "seed_option",
    "source_radius_option",
    "with_reading_options",
]

_INSTRUMENTS = "paper, conservative, sony_imx250mzr, or an instrument's TOML file."
_NAME_OR_FILE = "NAME|FILE"
#: In help texts, what :class:`ReadingCommand` puts the names of the formats in place of, and the extensions of those
#: that can be written.
_FORMATS, WRITTEN = "FORMATS", "WRITTEN"

#: Bistatic angles of the paper's camera positions as we take them, degrees.
CAMERA_POSITIONS = "60,80,100"

Backend = Annotated[
    str | None, typer.Option(help="auto, llvm (processor) or cuda (GPU).", show_default="auto")
]

AsJson = Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")]

NoProgressBar = Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar.")]

WrittenWavelength = Annotated[
    float | None,
    typer.Option(
        help="Wavelength to write down, and whose model a fit with one of each stands for.",
        metavar="NM",
        show_default="476 of bundled paints, else none",
    ),
]

DarkLevel = Annotated[
    float, typer.Option(help="Pixels whose mean signal is not above this count as dark, digital numbers.")
]

Patch = Annotated[int, typer.Option(help="Side of the square of pixels that shows a sample.", min=1)]

CalibrationError = Annotated[
    str,
    typer.Option(
        help="Errors of the instrument's stated accuracy: anew for each reading, fixed for all, or none.",
        metavar="reading|fixed|none",
    ),
]


def data_argument(metavar: str) -> Any:
    """A file of data or the name of a bundled experiment."""
    return typer.Argument(metavar=metavar, help="File of measured data, or a bundled paint.")


def model_argument(help: str) -> Any:
    """One model or several: what :func:`pbrdf.cli.sources.open_model` opens."""
    return typer.Argument(metavar="MODEL", help=help, show_default=False)


def output_option(help: str, show_default: bool | str = True) -> Any:
    """``--output``: the file or folder to write; `show_default` says in words what is taken without it."""
    return typer.Option("--output", "-o", help=help, show_default=show_default)


def quiet_option(help: str) -> Any:
    """``--quiet``: what is printed then."""
    return typer.Option("--quiet", "-q", help=help)


def seed_option(help: str) -> Any:
    """``--seed``: of what."""
    return typer.Option(help=help, min=0)


def noise_option(help: str, show_default: bool | str = True) -> Any:
    """``--noise``: relative to the intensity and absolute; `show_default` as of :func:`output_option`."""
    return typer.Option(help=help, metavar="REL[,ABS]", show_default=show_default)


def angles_option(help: str, show_default: bool | str = True) -> Any:
    """Angles in degrees, read by :func:`pbrdf.cli.values.angles`."""
    return typer.Option(help=help, metavar="ANGLES", show_default=show_default)


def polarimeter_option(help: str = _INSTRUMENTS) -> Any:
    """``--polarimeter`` of a command that works on frames; read by :func:`pbrdf.cli.instruments.open_instrument`."""
    return typer.Option("--polarimeter", "-p", help=help, metavar=_NAME_OR_FILE)


def instrument_option(show_default: bool | str = True) -> Any:
    """``--instrument`` of a command that simulates one; read as of :func:`polarimeter_option`."""
    return typer.Option(
        "--instrument", "--polarimeter", help=_INSTRUMENTS, metavar=_NAME_OR_FILE, show_default=show_default
    )


def regions_option(what: str) -> Any:
    """``--regions``: a file of them."""
    return typer.Option(help=f"{what}: TOML, CSV, or a picture of labels.", metavar="FILE")


def roi_option(help: str) -> Any:
    """``--roi``: a region in one text."""
    return typer.Option(help=help, metavar="NAME=X0:X1,Y0:Y1")


def library_option(*, changed: bool = False) -> Any:
    """``--library``: a file of materials that is read, or changed, which the bundled paints cannot be."""
    shown = "library.json in this folder" + ("" if changed else ", else the bundled paints")
    return typer.Option(
        "--library",
        "-l",
        help="File of the library, see `pbrdf library`.",
        metavar="FILE",
        show_default=shown,
    )


def source_radius_option(more: str = "") -> Any:
    """``--source-radius``, with more to say on it."""
    return typer.Option(help=f"Angular radius of the source, degrees{more}.", min=0.0)


def _reading_option(kind: Any, help: str, *names: str, metavar: str | None = None) -> Any:
    return Annotated[kind, typer.Option(*names, help=help, metavar=metavar, rich_help_panel=READING_PANEL)]


_READING: dict[str, tuple[Any, Any]] = {
    "column": (
        _reading_option(
            list[str] | None,
            "The file's name for a column, e.g. I=f_r_per_sr, or a constant, e.g. phi==0 (repeatable).",
            metavar="NAME=COLUMN",
        ),
        None,
    ),
    "unit": (
        _reading_option(
            list[str] | None,
            "Unit of a column, e.g. I=%, theta_i=mrad or dolp=% (repeatable).",
            metavar="NAME=UNIT",
        ),
        None,
    ),
    "ignore": (
        _reading_option(list[str] | None, "Leave out a column of the file (repeatable).", metavar="COLUMN"),
        None,
    ),
    "where": (
        _reading_option(
            list[str] | None, "Take only rows with this text in a column (repeatable).", metavar="COLUMN=TEXT"
        ),
        None,
    ),
    "analyzer": (
        _reading_option(
            list[str] | None,
            "How readings behind an analyser (I0, I45, …) were taken, e.g. zero=s, dark=0.4 or retardance=127 "
            "(repeatable).",
            metavar="KEY=VALUE",
        ),
        None,
    ),
    "select": (
        _reading_option(
            list[str] | None,
            f"Take only some geometries, e.g. theta_i=0:80 or group=1,2; by {', '.join(SELECTABLE)}; "
            "degrees and nm (repeatable).",
            metavar="KIND=VALUES",
        ),
        None,
    ),
    "wavelength": (
        _reading_option(list[float] | None, "Take only this wavelength in nm (repeatable).", metavar="NM"),
        None,
    ),
    "skip_invalid": (
        _reading_option(bool, "Leave out rows that hold no usable measurement.", "--skip-invalid"),
        False,
    ),
    "format": (
        _reading_option(
            str | None,
            f"{_FORMATS}; found out by itself if not given.",
        ),
        None,
    ),
    "quantity": (
        _reading_option(
            str | None,
            "What the values are, if the file does not say: brdf, reflectance_factor, radiance, dn, normalised.",
        ),
        None,
    ),
    "azimuth": (_reading_option(str | None, "Where the azimuth is 0: forward=0 or forward=180."), None),
    "stokes": (_reading_option(str | None, "What Q > 0 means: p-s or s-p."), None),
    "illumination": (_reading_option(str | None, "Stokes vector of the source: natural or I,Q,U,V."), None),
    "cosine_weighted": (
        _reading_option(
            bool | None,
            "Whether the values are multiplied by cos θ_r.",
            "--cosine-weighted/--not-cosine-weighted",
        ),
        None,
    ),
    "angles": (_reading_option(str | None, "Unit of the file's angles: degrees or radians."), None),
    "coverage": (
        _reading_option(
            float | None, "Coverage factor of expanded uncertainties that do not state it.", metavar="K"
        ),
        None,
    ),
    "scale": (
        _reading_option(
            str | None,
            "Whether an unknown constant factor is left in the values: arbitrary or absolute.",
        ),
        None,
    ),
    "every": (
        Annotated[
            int | None,
            typer.Option(
                help="Of a table over a grid of angles (.pbsdf, MERL, Zemax …), take one node in this many along each "
                "angle; 1 is all of them.",
                show_default="so many that at most 20 000 cells are left",
                min=1,
                metavar="N",
                rich_help_panel=READING_PANEL,
            ),
        ],
        None,
    ),
    "sheet": (_reading_option(str | None, "Sheet of a workbook (.xlsx, .xls, .ods) to read."), None),
}


class ReadingCommand(TyperCommand):
    """A command with a page of help; it names the formats that are known when it is shown, should it speak of them."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        from pbrdf.data.readers import format_names, written_extensions

        for parameter in self.params:
            help = getattr(parameter, "help", None) or ""
            for placeholder, names in ((_FORMATS, format_names), (WRITTEN, written_extensions)):
                if placeholder in help:
                    *first, last = names()
                    parameter.help = help.replace(placeholder, f"{', '.join(first)} or {last}")  # type: ignore[attr-defined]
        formatter.write(command_page(self, ctx))


class CommandGroup(TyperGroup):
    """A group of commands with a page of help."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        formatter.write(group_page(self, ctx))


def with_reading_options(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of :class:`Reading` in place of its parameter ``reading``."""
    signature = inspect.signature(command, eval_str=True)
    own = [p for p in signature.parameters.values() if p.name != "reading"]
    added = [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)
        for name, (annotation, default) in _READING.items()
    ]

    @functools.wraps(command)
    def run(**given: Any) -> None:
        options = {name: given.pop(name) for name in _READING}
        for name in ("column", "unit", "ignore", "where", "analyzer", "select", "wavelength"):
            options[name] = list(options[name] or ())
        command(reading=Reading(**options), **given)

    # typer reads the command line from the signature, which must not be looked up in the wrapped function
    del run.__wrapped__
    run.__signature__ = inspect.Signature([*own, *added])  # type: ignore[attr-defined]
    run.__annotations__ = {p.name: p.annotation for p in (*own, *added)}
    return run
