"""``pbrdf compare``: several models on the same measurements, ranked by what they predict unseen."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from pbrdf.cli.command_line import command_line
from pbrdf.cli.console import NOT_CONVERGED, output_console, stage_bar
from pbrdf.cli.fit_options import Objective
from pbrdf.cli.folders import ready_folder, say_written
from pbrdf.cli.options import (
    Backend,
    data_argument,
    noise_option,
    output_option,
    quiet_option,
    seed_option,
    with_reading_options,
)
from pbrdf.cli.reading import Reading, print_columns
from pbrdf.cli.wavelengths import require_choice
from pbrdf.errors import FitError, PbrdfError

__all__ = ["compare"]


@with_reading_options
def compare(
    file: Annotated[str, data_argument("FILE")],
    *,
    reading: Reading,
    models: Annotated[
        str | None,
        typer.Option(
            help="Models to compare (see `pbrdf models`), or FILE.py:Class; in their readings and with ablations.",
            metavar="NAME[,NAME…]",
            show_default="all that the data can feed",
        ),
    ] = None,
    hold_out: Annotated[
        str | None,
        typer.Option(
            help="Leave data out of every fit and predict them: theta_i=50, group=3, theta_r=45 or fraction=0.2.",
            metavar="KIND=VALUES",
        ),
    ] = None,
    by: Annotated[
        str | None,
        typer.Option(
            help="Predict each fold from the others; folds by theta_i, group, angle or fraction.",
            metavar="KIND",
            show_default="without --hold-out: theta_i, else group, else angle",
        ),
    ] = None,
    folds: Annotated[
        int | None, typer.Option(help="Number of folds.", min=2, show_default="at most 8")
    ] = None,
    vary: Annotated[
        int,
        typer.Option(
            help="So many of the best are tried again with a finite source, four times as many with a robust loss.",
            min=0,
        ),
    ] = 2,
    starts: Annotated[int, typer.Option(help="Number of starts of each fit.", min=1)] = 16,
    noise: Annotated[
        str | None,
        noise_option(
            "Noise relative to the intensity, and absolute in units of its median, e.g. 0.02,0.01; or equal; or "
            "instrument:linear=1%,circular=5%,read=0.5,quantum=1.",
            show_default="the uncertainties in the data, else an assumption",
        ),
    ] = None,
    objective: Objective = "stokes",
    seed: Annotated[int, seed_option("Seed of starts, folds and resampling.")] = 0,
    output: Annotated[
        Path | None, output_option("Folder for the results.", show_default="<file>-compare")
    ] = None,
    figure_format: Annotated[str, typer.Option(help="Format of the figures: png, pdf or svg.")] = "png",
    figures: Annotated[bool, typer.Option("--figures/--no-figures", help="Draw the figures.")] = True,
    backend: Backend = None,
    quiet: Annotated[bool, quiet_option("Print the name of the folder only.")] = False,
) -> None:
    """Fit many models to the same data and rank them by how they predict what they have not seen.

    Same data, same weights, same held-out geometries for all. Says which models cannot be told apart, what each
    assumption costs, and where the best one fails. Writes a folder with a page (index.html: open it in a
    browser), summary.txt, comparison.csv, comparison.json (all numbers), best-model.json, curves.png and ranking.png.

    Exit code 3: the fit of the best has not converged, its numbers are no result.

    With bundled data: `pbrdf compare matte-white-thick --models double-gauss`

    With your own: `pbrdf compare paint.csv --wavelength 550 --hold-out theta_i=50`
    """
    from pbrdf.files.digest import sha256_of
    from pbrdf.report.comparison.folder import write_comparison
    from pbrdf.report.style import check_figure_format, leave_out_help_texts

    check_figure_format(figure_format, "--figure-format")
    if hold_out is not None and (by is not None or folds is not None):
        raise PbrdfError("--hold-out leaves data out once, --by and --folds all in turn: give one of the two")
    names = None if models is None else [name.strip() for name in models.split(",") if name.strip()]
    if names == []:
        raise PbrdfError("--models: name at least one, for example --models double-gauss")
    folder = output or Path(f"{Path(file).stem}-compare")
    stood = ready_folder(folder)
    if backend is not None:
        from pbrdf.backend import set_backend

        set_backend(backend)

    from pbrdf.inversion.model_comparison import compare_models
    from pbrdf.report.comparison.subject import Compared
    from pbrdf.report.comparison.summary import print_summary

    dataset = reading.open(file)
    require_choice(dataset, reading, file)
    arguments: dict[str, Any] = {
        "hold_out": hold_out,
        "by": by,
        "folds": folds,
        "vary": vary,
        "starts": starts,
        "noise": noise,
        "objective": objective,
        "seed": seed,
    }
    try:
        with stage_bar(quiet, f"Comparing models on {file}") as progress:
            comparison = compare_models(dataset, names, progress=progress, **arguments)
    except FitError as error:
        raise FitError(f"{file}: {error}") from error
    settings = {"models": names, **arguments, "reading": reading.stated()}
    report = Compared(comparison, file, settings, command_line(), sha256_of(Path(file)))
    if figures:
        leave_out_help_texts()
    written = write_comparison(report, folder, figure_format=figure_format if figures else None)
    if quiet:
        print(folder)
    else:
        console = output_console()
        print_summary(report, console)
        print_columns(dataset, file)
        say_written(folder, written, stood)
    if not comparison.best.result.settled:
        raise typer.Exit(NOT_CONVERGED)
