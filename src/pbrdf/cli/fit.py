"""``pbrdf fit``: a model fitted to measurements, and a folder with what came out."""

from __future__ import annotations

import functools
import math
from pathlib import Path
from typing import Annotated

import typer

from pbrdf.cli.command_line import command_line
from pbrdf.cli.console import NOT_CONVERGED, output_console, stage_bar
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
from pbrdf.cli.folders import ready_folder, say_written
from pbrdf.cli.options import (
    Backend,
    output_option,
    quiet_option,
    seed_option,
    with_reading_options,
)
from pbrdf.cli.reading import Reading
from pbrdf.cli.values import pairs
from pbrdf.cli.wavelengths import require_choice
from pbrdf.errors import FitError, PbrdfError

__all__ = ["fit"]


@with_reading_options
def fit(
    files: Annotated[
        list[str],
        typer.Argument(metavar="FILE", help="Files of measured data, or bundled paints; each is fitted."),
    ],
    *,
    reading: Reading,
    model: FittedModel = "double-gauss",
    option: ModelOptions = None,
    fix: Fix = None,
    free: Free = None,
    bounds: Bounds = None,
    start: Start = None,
    starts: Annotated[int, typer.Option(help="Number of starts, spread over the bounds.")] = 64,
    iterations: Iterations = 100,
    noise: FitNoise = None,
    hold_out: Annotated[
        str | None,
        typer.Option(
            help="Leave data out and predict them: group=3, theta_i=50, wavelength=550 or fraction=0.2.",
            metavar="KIND=VALUES",
        ),
    ] = None,
    strategy: Annotated[
        str, typer.Option(help="joint, or stepwise: diffuse parameters first, then specular, then all.")
    ] = "joint",
    polish: Annotated[
        bool, typer.Option("--polish/--no-polish", help="End the stepwise strategy with a joint fit.")
    ] = True,
    diffuse_tilt: Annotated[
        float | None,
        typer.Option(
            help="Stepwise: facet tilt in degrees beyond which data count as diffuse.",
            show_default="4.5 sigma, revised as sigma is found",
        ),
    ] = None,
    nuisance: Nuisances = None,
    prior: Priors = None,
    split: Annotated[
        list[str] | None,
        typer.Option(
            help="A parameter of its own for each group or wavelength, e.g. a=wavelength (repeatable).",
            metavar="NAME=group|wavelength",
        ),
    ] = None,
    objective: Objective = "stokes",
    loss: Loss = "linear",
    profile: Annotated[
        bool, typer.Option("--profile", help="Profile-likelihood intervals too: asymmetric, right at bounds.")
    ] = False,
    contour: Annotated[
        list[str] | None,
        typer.Option(
            help="Draw the joint confidence regions of two parameters, e.g. t,n (repeatable).",
            metavar="NAME,NAME",
        ),
    ] = None,
    bootstrap: Annotated[
        int, typer.Option(help="Simulated data sets for bootstrap intervals; 0 for none.", min=0)
    ] = 0,
    cross_validate: Annotated[
        str | None,
        typer.Option(help="Predict each fold from the others; folds by group, theta_i, angle or fraction."),
    ] = None,
    suggest: Annotated[
        bool,
        typer.Option(
            "--suggestions/--no-suggestions",
            help="Where the model does not describe the data, try for some seconds what would.",
        ),
    ] = True,
    seed: Annotated[int, seed_option("Seed of the starts and of a held-out fraction.")] = 0,
    output: Annotated[
        Path | None,
        output_option(
            "Folder for the results; with several files, one folder each within it.",
            show_default="<file>-fit",
        ),
    ] = None,
    figure_format: FigureFormats = "png",
    figures: Annotated[
        bool,
        typer.Option("--figures/--no-figures", help="Draw no figures: a page of numbers, sooner done."),
    ] = True,
    backend: Backend = None,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Show the full correlation matrix.")
    ] = False,
    quiet: Annotated[bool, quiet_option("Print the names of the folders only.")] = False,
) -> None:
    """Fit a model to measured data, and say what the fit is worth and how well each parameter is known.

    Writes a folder with a page (index.html: open it in a browser), summary.txt, model.json, fit.json (all numbers),
    comparison.nc (measured, modelled, residual), fit.nc (for pbrdf.load_fit) and the figures: figure.png, starts.png,
    polarisation.png and hemisphere.png where there is such data, contours.png with --contour.

    Exit code 3: a fit has not converged, its numbers are no result.

    With bundled data: `pbrdf fit matte-white-thick --hold-out group=3`

    With your own: `pbrdf fit paint.csv --column I=f_r_per_sr --noise 3%,1% --fix n=1.5`
    """
    from pbrdf.files.digest import sha256_of
    from pbrdf.report.fit.checks import run_checks
    from pbrdf.report.fit.folder import parse_formats, write_report
    from pbrdf.report.fit.subject import Report
    from pbrdf.report.style import leave_out_help_texts

    parse_formats(figure_format, "--figure-format")
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
    ) | {
        "hold_out": hold_out,
        "strategy": strategy,
        "polish": polish,
        "diffuse_tilt": None if diffuse_tilt is None else math.radians(diffuse_tilt),
        "split": pairs(split or (), "--split", "a=wavelength"),
    }
    pairs_drawn = [_pair(text) for text in contour or ()]
    folders = _folders(files, output)
    stood = [ready_folder(folder) for folder in folders]
    if backend is not None:
        from pbrdf.backend import set_backend

        set_backend(backend)
    chosen = fitted_model(model)

    from pbrdf.inversion import fit as fit_dataset

    unsettled = False
    for file, folder, earlier in zip(files, folders, stood, strict=True):
        dataset = reading.open(file)
        require_choice(dataset, reading, file, by_wavelength="wavelength" in arguments["split"].values())
        try:
            with stage_bar(quiet, f"Fitting {file}") as show:
                progress = functools.partial(show, f"Fitting {file}")
                result = fit_dataset(dataset, chosen, progress=progress, **arguments)
                show(f"Looking at the fit of {file}", 0, 0)
                checks = run_checks(
                    result,
                    dataset,
                    profile=profile,
                    bootstrap=bootstrap,
                    cross_validate=cross_validate,
                    contours=pairs_drawn,
                    suggest=suggest,
                    fit_arguments={
                        "model": chosen,
                        **{k: v for k, v in arguments.items() if k != "hold_out"},
                    },
                )
        except FitError as error:
            raise FitError(f"{file}: {error}") from error
        settings = {"model": model, **arguments, "reading": reading.stated()}
        report = Report(
            result, dataset, file, settings, checks, command=command_line(), sha256=sha256_of(Path(file))
        )
        if figures:
            leave_out_help_texts()
        written = write_report(report, folder, figure_format=figure_format, figures=figures)
        unsettled |= not result.settled
        if quiet:
            print(folder)
            continue
        from pbrdf.report.fit.summary import print_summary

        console = output_console()
        print_summary(report, console, verbose=verbose)
        say_written(folder, written, earlier)
    if unsettled:
        raise typer.Exit(NOT_CONVERGED)


def _pair(text: str) -> tuple[str, str]:
    """Names of two parameters."""
    names = [name.strip() for name in text.split(",")]
    if len(names) != 2 or not all(names) or names[0] == names[1]:
        raise PbrdfError(f"--contour {text!r}: give two different parameters, for example --contour t,n")
    return names[0], names[1]


def _folders(files: list[str], output: Path | None) -> list[Path]:
    """Where the results of each file go."""
    stems = [Path(file).stem for file in files]
    for stem in stems:
        if stems.count(stem) > 1:
            raise PbrdfError(f"two files are called {stem!r}: fit them one after the other, with --output")
    if output is None:
        return [Path(f"{stem}-fit") for stem in stems]
    return [output] if len(files) == 1 else [output / stem for stem in stems]
