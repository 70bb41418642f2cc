"""``pbrdf fit``: a model fitted to measurements, and a folder with what came out."""

from __future__ import annotations

import functools
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pbrdf.cli.command_line import command_line
from pbrdf.cli.console import NOT_CONVERGED, output_console, stage_bar
from pbrdf.cli.options import (
    Backend,
    noise_option,
    output_option,
    quiet_option,
    seed_option,
    with_reading_options,
)
from pbrdf.cli.reading import Reading
from pbrdf.cli.values import bounds as read_bounds
from pbrdf.cli.values import numbers, pairs
from pbrdf.cli.wavelengths import require_choice
from pbrdf.errors import FitError, PbrdfError

if TYPE_CHECKING:
    from pbrdf.models import Model

__all__ = ["fit"]


@with_reading_options
def fit(
    files: Annotated[
        list[str],
        typer.Argument(metavar="FILE", help="Files of measured data, or bundled paints; each is fitted."),
    ],
    *,
    reading: Reading,
    model: Annotated[
        str,
        typer.Option(
            help="Model (see `pbrdf models`), FILE.py:Class, or a model's JSON file to start from as well."
        ),
    ] = "double-gauss",
    option: Annotated[
        list[str] | None,
        typer.Option(help="Option of the model, e.g. shadowing=smith (repeatable).", metavar="NAME=VALUE"),
    ] = None,
    fix: Annotated[
        list[str] | None,
        typer.Option(help="Hold a parameter, e.g. n=1.5 (repeatable).", metavar="NAME=VALUE"),
    ] = None,
    free: Annotated[
        list[str] | None,
        typer.Option(help="Fit a parameter that is held otherwise, e.g. kappa (repeatable).", metavar="NAME"),
    ] = None,
    bounds: Annotated[
        list[str] | None,
        typer.Option(
            help="Bounds of a parameter, e.g. sigma=0.01:0.2 (repeatable).", metavar="NAME=LOW:HIGH"
        ),
    ] = None,
    start: Annotated[
        list[str] | None,
        typer.Option(help="Value where every start begins, e.g. n=1.6 (repeatable).", metavar="NAME=VALUE"),
    ] = None,
    starts: Annotated[int, typer.Option(help="Number of starts, spread over the bounds.")] = 64,
    iterations: Annotated[int, typer.Option(help="Steps of each start at most.", min=1)] = 100,
    noise: Annotated[
        str | None,
        noise_option(
            "Noise relative to the intensity, and absolute in units of its median, e.g. 0.02,0.01; or equal; or "
            "instrument:linear=1%,circular=5%,read=0.5,quantum=1.",
            show_default="the uncertainties in the data, else an assumption that is printed",
        ),
    ] = None,
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
    nuisance: Annotated[
        list[str] | None,
        typer.Option(
            help="What the instrument adds: gain, dark, angle or source (degrees), e.g. gain:group or "
            "angle:group~0,0.1 (repeatable).",
            metavar="KIND[:group][~MEAN,STD]",
        ),
    ] = None,
    prior: Annotated[
        list[str] | None,
        typer.Option(help="Gaussian prior, e.g. n=1.55,0.05 (repeatable).", metavar="NAME=MEAN,STD"),
    ] = None,
    split: Annotated[
        list[str] | None,
        typer.Option(
            help="A parameter of its own for each group or wavelength, e.g. a=wavelength (repeatable).",
            metavar="NAME=group|wavelength",
        ),
    ] = None,
    objective: Annotated[
        str, typer.Option(help="stokes (signed components), or paper: intensity and DoLP, equal weights.")
    ] = "stokes",
    loss: Annotated[
        str, typer.Option(help="linear, or against outliers soft_l1, huber or cauchy.")
    ] = "linear",
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
    figure_format: Annotated[
        str, typer.Option(help="Format of the figures: png, pdf or svg, or several: png,pdf.")
    ] = "png",
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
    from pbrdf.files.atomic import require_writable_folder
    from pbrdf.files.digest import sha256_of
    from pbrdf.report.fit.checks import run_checks
    from pbrdf.report.fit.folder import parse_formats, write_report
    from pbrdf.report.fit.subject import Report
    from pbrdf.report.style import leave_out_help_texts

    parse_formats(figure_format, "--figure-format")
    arguments: dict[str, Any] = {
        "options": pairs(option or (), "--option", "shadowing=smith"),
        "fix": numbers(fix or (), "--fix", "n=1.5"),
        "free": list(free or ()),
        "bounds": read_bounds(bounds or (), "--bounds", "sigma=0.01:0.2"),
        "start": numbers(start or (), "--start", "n=1.6"),
        "starts": starts,
        "max_iterations": iterations,
        "noise": noise,
        "hold_out": hold_out,
        "strategy": strategy,
        "polish": polish,
        "diffuse_tilt": None if diffuse_tilt is None else math.radians(diffuse_tilt),
        "nuisances": list(nuisance or ()),
        "priors": {
            name: _prior(name, text) for name, text in pairs(prior or (), "--prior", "n=1.55,0.05").items()
        },
        "split": pairs(split or (), "--split", "a=wavelength"),
        "objective": objective,
        "loss": loss,
        "seed": seed,
    }
    pairs_drawn = [_pair(text) for text in contour or ()]
    folders = _folders(files, output)
    for folder in folders:
        require_writable_folder(folder)
    if backend is not None:
        from pbrdf.backend import set_backend

        set_backend(backend)
    chosen = _model(model)

    from pbrdf.inversion import fit as fit_dataset

    unsettled = False
    for file, folder in zip(files, folders, strict=True):
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
        console.print(f"\nWritten to {folder}/: {', '.join(path.name for path in written)}", markup=False)
    if unsettled:
        raise typer.Exit(NOT_CONVERGED)


def _prior(name: str, text: str) -> tuple[float, float]:
    """Mean and standard deviation of a prior."""
    from pbrdf.inversion.nuisance import parse_prior

    return parse_prior(f"--prior {name}", text)


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


def _model(name: str) -> str | Model:
    """A model to start from where a file is named, else the name of a model."""
    from pbrdf.models import load_model

    return load_model(name) if name.endswith(".json") else name
