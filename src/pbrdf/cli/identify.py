"""``pbrdf identify``: which material of a library a measurement shows, or each pixel of a map."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pbrdf.cli.command_line import command_line
from pbrdf.cli.console import output_console, progress_bar, warn
from pbrdf.cli.folders import say_written, standing
from pbrdf.cli.labels import read_labelled, read_pixel_labels
from pbrdf.cli.options import (
    Backend,
    library_option,
    noise_option,
    output_option,
    quiet_option,
    with_reading_options,
)
from pbrdf.cli.reading import Reading
from pbrdf.cli.specimens import (
    BUNDLED,
    library_file,
    open_compared,
    open_library,
    open_parameters,
    open_pixels,
)
from pbrdf.cli.values import numbers
from pbrdf.errors import DataError, FitError, PbrdfError

if TYPE_CHECKING:
    import xarray as xr

    from pbrdf.identification.identify import Identification
    from pbrdf.identification.library import Library
    from pbrdf.identification.telling_apart import NextMeasurement

__all__ = ["identify"]

_GAINS = {"known": False, "unknown": True}


@with_reading_options
def identify(
    data: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="DATA",
            help="Files of measured data, bundled paints, folders of `pbrdf fit`, or maps: of parameters, or of Stokes "
            "parameters with dimensions beside geometry. Each is identified.",
            show_default=False,
        ),
    ] = None,
    *,
    reading: Reading,
    library: Annotated[Path | None, library_option()] = None,
    confidence: Annotated[
        float, typer.Option(help="How often the set is to hold the true material, between 0 and 1.")
    ] = 0.95,
    gain: Annotated[
        str | None,
        typer.Option(
            help="Whether a common factor of the intensities is known: known or unknown.",
            metavar="known|unknown",
            show_default="what the data say of their scale",
        ),
    ] = None,
    angle: Annotated[
        float | None,
        typer.Option(
            help="Standard deviation of an offset of the sample's angle, degrees.",
            min=0.0,
            show_default="none",
        ),
    ] = None,
    noise: Annotated[
        str | None,
        noise_option(
            "Noise as for `pbrdf fit`, e.g. 0.02,0.01.",
            show_default="the uncertainties in the data, else an assumption",
        ),
    ] = None,
    prior: Annotated[
        list[str] | None,
        typer.Option(
            help="How common a material is beforehand, e.g. white=0.5 (repeatable); the others share the rest.",
            metavar="NAME=SHARE",
            show_default="all alike",
        ),
    ] = None,
    smoothing: Annotated[
        float,
        typer.Option(help="Maps: smooth over so many pixels first, where materials fill regions.", min=0.0),
    ] = 0.0,
    following: Annotated[
        bool,
        typer.Option(
            "--next/--no-next",
            help="Where several materials remain: say which measurement would tell them apart best.",
        ),
    ] = True,
    calibrate: Annotated[
        Path | None,
        typer.Option(
            help="Calibrate with measurements of known materials instead: a CSV table with the columns file and "
            "material. The library's file gets the calibration, or, with --output, FOLDER/library.json.",
            metavar="LABELLED.csv",
        ),
    ] = None,
    labelled: Annotated[
        Path | None,
        typer.Option(
            help="Judge the library as it is by known materials. In place of DATA: a CSV table with the columns file "
            "and material. With a map: the materials of its pixels, as names, or numbers from 1 in the library's "
            "order: netCDF, NPY, a picture or regions.",
            metavar="FILE",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        output_option(
            "Folder for a page, figures and all numbers; of several data, one folder each within it.",
            show_default="none; of a calibration <labelled>-calibration",
        ),
    ] = None,
    figure_format: Annotated[str, typer.Option(help="Format of the figures: png, pdf or svg.")] = "png",
    figures: Annotated[bool, typer.Option("--figures/--no-figures", help="Draw the figures.")] = True,
    backend: Backend = None,
    quiet: Annotated[
        bool, quiet_option("Print only the set of each, or the name of a map's folder.")
    ] = False,
) -> None:
    """Tell which material it is: a set at a stated confidence, probabilities, or none of these.

    A material is a mean and a scatter over specimens; likelihoods are integrated over the specimens, and over a gain
    and an offset of the angle where these are not known. docs/identification.md says what a set promises.

    With bundled data: `pbrdf identify matte-white-thick`

    With your own: `pbrdf identify panel.csv --library paints.json --noise 1% -o panel-material`

    So that sets hold what they say: `pbrdf identify --calibrate labelled.csv --library paints.json`

    Whether they do: `pbrdf identify --labelled others.csv --library paints.json`
    """
    from pbrdf.files.atomic import require_writable_folder
    from pbrdf.identification.identify import check_request, shares
    from pbrdf.report.style import check_figure_format, leave_out_help_texts

    sources = list(data or ())
    if not sources and calibrate is None and labelled is None:
        raise PbrdfError(
            "name the data to identify, or a table of labelled measurements with --calibrate or --labelled"
        )
    if sources and calibrate is not None:
        raise PbrdfError(
            f"--calibrate takes its data from {calibrate}: leave {sources[0]} out, and identify it afterwards"
        )
    if calibrate is not None and labelled is not None:
        raise PbrdfError(
            "--labelled: --calibrate judges its own measurements, each by the others; judge others afterwards"
        )
    if labelled is not None and len(sources) > 1:
        raise PbrdfError(
            f"--labelled {labelled} is of one map, and there are {len(sources)}: give one after the other"
        )
    if smoothing and not sources:
        raise PbrdfError("--smoothing is for maps: leave it out")
    check_figure_format(figure_format, "--figure-format")
    if gain is not None and gain not in _GAINS:
        raise PbrdfError(f"--gain {gain!r}: choose known or unknown")
    if angle == 0.0:
        raise PbrdfError("--angle 0: leave it out where the angle is exact")
    common = numbers(prior or (), "--prior", "white=0.5")
    folders = _folders(sources, output)
    file = library_file(library)
    opened, name = open_library(file), str(file or BUNDLED)
    try:
        check_request(opened, confidence)
        shares(opened, common)
    except FitError as error:
        raise FitError(_with_option(str(error), name)) from error
    for folder in folders:
        require_writable_folder(folder)
    if backend is not None:
        from pbrdf.backend import set_backend

        set_backend(backend)
    asked: dict[str, Any] = {
        "gain": None if gain is None else _GAINS[gain],
        "angle": None if angle is None else math.radians(angle),
        "noise": noise,
    }
    settings = {
        "confidence": confidence,
        "gain": gain,
        "angle_degrees": angle,
        "noise": noise,
        "prior": common,
        "smoothing": smoothing or None,
        "reading": reading.stated(),
    }
    if output is not None and figures:
        leave_out_help_texts()
    request = _Request(
        opened,
        name,
        reading,
        confidence,
        asked,
        common,
        smoothing,
        settings,
        figure_format if figures else None,
        quiet,
        following,
        labelled,
    )
    if calibrate is not None:
        _calibrate(request, calibrate, file, output)
        return
    if labelled is not None and not sources:
        _judge(request, labelled, output)
        return
    for number, source in enumerate(sources):
        into = folders[number] if folders else None
        if number and not quiet:
            print()
        pixels = open_pixels(source)
        if pixels is None:
            _one(request, source, into)
        else:
            _every_pixel(request, source, pixels, into)


@dataclass(frozen=True)
class _Request:
    """What the options ask for: the library and its name, how to read, what identification is told, what is written."""

    library: Library
    name: str
    reading: Reading
    confidence: float
    asked: dict[str, Any]
    prior: dict[str, float]
    smoothing: float
    settings: dict[str, Any]
    drawn: str | None
    quiet: bool
    following: bool
    labelled: Path | None


def _one(request: _Request, source: str, folder: Path | None) -> None:
    """Identify one measurement."""
    from pbrdf.files.digest import sha256_of
    from pbrdf.identification.identify import identify as identify_dataset
    from pbrdf.identification.identify_fit import identify_fit
    from pbrdf.report.identification.folder import write_identification
    from pbrdf.report.identification.subject import Identified
    from pbrdf.report.identification.summary import print_summary

    if request.smoothing:
        raise PbrdfError(f"--smoothing is for maps, and {source} is one measurement: leave it out")
    if request.labelled is not None:
        raise PbrdfError(
            f"--labelled {request.labelled}: {source} is one measurement; name it in a table, file,material, and leave "
            "it out here"
        )
    options = {"confidence": request.confidence, "prior": request.prior, **request.asked}
    fitted = open_parameters(source, request.reading)
    if fitted is not None and (
        given := [f"--{name}" for name, value in request.asked.items() if value is not None]
    ):
        raise PbrdfError(
            f"{', '.join(given)}: {source} holds fitted parameters without their data, which need none: leave it out"
        )
    measured = None if fitted is not None else open_compared(source, request.reading)
    one = measured.fit if measured is not None and measured.fit is not None else fitted
    if one is not None:
        found = _told(source, lambda: identify_fit(one, request.library, **options))
    else:
        assert measured is not None
        found = _told(source, lambda: identify_dataset(measured.dataset, request.library, **options))
    following = None
    remain = request.following and len(found.materials) > 1 and found.data is not None
    if remain and not (request.quiet and folder is None):
        following = _next(source, found)
    report = Identified(
        found,
        None if measured is None else measured.dataset,
        source,
        request.name,
        request.prior,
        request.settings,
        command_line(),
        sha256_of(Path(source)) if one is None else "",
        following,
        fitted,
    )
    quiet = f"{source}: {', '.join(found.materials) or 'none of these'}"
    _hand_over(request, report, folder, write_identification, print_summary, quiet)


def _next(source: str, found: Identification) -> NextMeasurement | None:
    """Which reading would tell the materials apart; an answer is not lost where that cannot be told."""
    from pbrdf.identification.telling_apart import next_measurement

    try:
        return next_measurement(found)
    except FitError as error:
        warn(f"{source}: what to measure next: {error}")
        return None


def _every_pixel(request: _Request, source: str, pixels: xr.Dataset, folder: Path | None) -> None:
    """Identify every pixel of a map."""
    from pbrdf.identification.class_map import identify_map
    from pbrdf.identification.identify import unknown_gain
    from pbrdf.identification.labelled_pixels import judge_pixels
    from pbrdf.report.identification.classified import Classified
    from pbrdf.report.identification.folder import write_classes
    from pbrdf.report.identification.summary import print_classes

    gain, noise = request.asked["gain"], request.asked["noise"]
    if given := request.reading.stated():
        options = ", ".join("--" + option.replace("_", "-") for option in given)
        raise DataError(f"{source} is a map, which needs no {options}: leave it out")
    if request.asked["angle"] is not None:
        raise PbrdfError(f"--angle: {source} is a map, whose angles count as exact: leave it out")
    fitted = "estimate" in pixels
    if fitted and not (gain is None and noise is None):
        raise PbrdfError(
            f"--gain and --noise: {source} holds fitted parameters, which need neither: leave them out"
        )
    given_labels = request.labelled
    labels = None if given_labels is None else read_pixel_labels("--labelled", given_labels, pixels)
    with progress_bar(f"Identifying the pixels of {source}", request.quiet) as progress:
        found = _told(
            source,
            lambda: identify_map(
                pixels,
                request.library,
                confidence=request.confidence,
                gain=gain,
                noise=noise,
                prior=request.prior,
                smoothing=request.smoothing,
                progress=progress,
            ),
        )
    judged = (
        None if labels is None else _told(f"--labelled {given_labels}", lambda: judge_pixels(found, labels))
    )
    free = None if fitted else unknown_gain(pixels) if gain is None else gain
    report = Classified(
        found,
        source,
        request.library,
        request.name,
        free,
        bool(pixels.attrs.get("simulated")),
        request.prior,
        request.settings,
        command_line(),
        judged,
        "" if given_labels is None else str(given_labels),
    )
    _hand_over(
        request, report, folder, write_classes, print_classes, folder or f"{source}: {_largest(report)}"
    )
    if folder is None and not request.quiet:
        warn(f"{source}: the map of materials is not kept; --output FOLDER writes it")


def _largest(report: Any) -> str:
    """The materials that pixels show, most pixels first."""
    seen = sorted((c for c in report.counts if c.pixels and c.value >= 0), key=lambda count: -count.pixels)
    return ", ".join(count.name for count in seen) or "none of these"


def _calibrate(request: _Request, table: Path, file: Path | None, output: Path | None) -> None:
    """Calibrate a library, and report how honest it is."""
    import numpy as np

    from pbrdf.files.atomic import require_writable_folder
    from pbrdf.identification.conformal import calibrate
    from pbrdf.identification.confusion import table_of
    from pbrdf.identification.cross_check import cross_checked
    from pbrdf.identification.labelled import labelled_evidence
    from pbrdf.identification.library import Library
    from pbrdf.report.identification.calibrated import Calibrated
    from pbrdf.report.identification.folder import LIBRARY, write_calibration
    from pbrdf.report.identification.summary import print_calibration

    library = request.library
    folder = output or Path(f"{table.stem}-calibration")
    require_writable_folder(folder)
    within = file is None or output is not None
    target = folder / LIBRARY if file is None or within else file
    labelled = read_labelled("--calibrate", table, library, request.reading, strangers=False)
    truth = np.array([library.names.index(name) for name, _ in labelled])
    with progress_bar(f"Calibrating with {table}", request.quiet) as progress:
        rows, scores = _told(
            str(table), lambda: labelled_evidence(library, labelled, progress=progress, **request.asked)
        )
    words = f"{len(labelled)} of {table.name}"
    made = Library(library.materials, calibrate(library.names, rows, scores, truth, words))
    probability, p_value = cross_checked(library.names, rows, scores, truth)
    at = request.confidence
    judged = table_of(library.names, truth, probability, p_value > 1.0 - at, at)
    report = Calibrated(made, judged, str(table), str(target), request.settings, command_line())
    stood = standing(folder)
    written = write_calibration(report, folder, figure_format=request.drawn, with_library=within)
    if not within:
        made.write(target)
    if request.quiet:
        print(target)
        return
    print_calibration(report, output_console())
    say_written(folder, written, stood)
    output_console().print(
        f"The calibration is in {target}: `pbrdf identify DATA --library {target}` uses it.", markup=False
    )


def _judge(request: _Request, table: Path, folder: Path | None) -> None:
    """Report how a library, as it is, judges measurements of known materials."""
    from pbrdf.files.atomic import require_writable_folder
    from pbrdf.identification.labelled import judge_labelled
    from pbrdf.report.identification.confusion_table import confusion_sentence
    from pbrdf.report.identification.folder import write_labelled
    from pbrdf.report.identification.labelled import LabelledReport
    from pbrdf.report.identification.summary import print_labelled

    if folder is not None:
        require_writable_folder(folder)
    labelled = read_labelled("--labelled", table, request.library, request.reading, strangers=True)
    with progress_bar(f"Identifying those of {table}", request.quiet) as progress:
        found = _told(
            str(table),
            lambda: judge_labelled(
                request.library,
                labelled,
                confidence=request.confidence,
                prior=request.prior,
                progress=progress,
                **request.asked,
            ),
        )
    report = LabelledReport(
        found, str(table), request.library, request.name, request.prior, request.settings, command_line()
    )
    quiet = folder or f"{table}: {confusion_sentence(found, 'measurements')}"
    _hand_over(request, report, folder, write_labelled, print_labelled, quiet)


def _hand_over(
    request: _Request,
    report: Any,
    folder: Path | None,
    write: Callable[..., list[Path]],
    show: Callable[..., None],
    quiet: Path | str,
) -> None:
    """Write a report where a folder is given, and show it; `quiet` is all that --quiet prints."""
    stood = frozenset() if folder is None else standing(folder)
    written = [] if folder is None else write(report, folder, figure_format=request.drawn)
    if request.quiet:
        print(quiet)
        return
    show(report, output_console())
    if folder is not None:
        say_written(folder, written, stood)


def _told(source: str, work: Callable[[], Any]) -> Any:
    """Do the work; an error of identification names what it was about."""
    try:
        return work()
    except FitError as error:
        raise FitError(f"{source}: {error}") from error


def _with_option(text: str, library: str) -> str:
    """A sentence on an option named as on the command line."""
    if text.startswith("confidence="):
        return f"--confidence {text.removeprefix('confidence=')}"
    if text.startswith("prior:"):
        return f"--{text}"
    return (
        f"{library}: {text}"
        if text.startswith("the library has no material:")
        else f"--prior: {text} ({library})"
    )


def _folders(sources: list[str], output: Path | None) -> list[Path]:
    """Where the results of each go; none without a folder for them."""
    if output is None:
        return []
    stems = [Path(source).stem for source in sources]
    for stem in stems:
        if stems.count(stem) > 1:
            raise PbrdfError(
                f"two data sets are called {stem!r}: identify them one after the other, with --output"
            )
    return [output] if len(sources) <= 1 else [output / stem for stem in stems]
