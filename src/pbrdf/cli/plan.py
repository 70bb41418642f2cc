"""``pbrdf plan``: the geometries that determine a model's parameters best."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from pbrdf.cli.console import output_console, progress_bar
from pbrdf.cli.folders import ready_folder
from pbrdf.cli.instruments import open_instrument
from pbrdf.cli.options import (
    Backend,
    instrument_option,
    model_argument,
    noise_option,
    output_option,
    seed_option,
)
from pbrdf.cli.sources import open_model
from pbrdf.cli.values import numbers, require_folder_of, share
from pbrdf.errors import PbrdfError

__all__ = ["plan"]


def plan(
    source: Annotated[
        str,
        model_argument("The guess: a model's JSON file, the folder of a fit, or a bundled paint."),
    ],
    output: Annotated[
        Path,
        output_option(
            "The angle table to write, with a picture beside it; or a folder for plan.csv and plan.png."
        ),
    ] = Path("plan.csv"),
    budget: Annotated[int, typer.Option(help="Number of readings.", min=1)] = 63,
    criterion: Annotated[
        str,
        typer.Option(
            help="D: joint confidence region; A: mean square of the relative standard errors.", metavar="D|A"
        ),
    ] = "D",
    out_of_plane: Annotated[
        bool,
        typer.Option("--out-of-plane", help="Tilt the sample out of the plane of source and camera too."),
    ] = False,
    instrument: Annotated[str | None, instrument_option(show_default="paper")] = None,
    noise: Annotated[
        str | None,
        noise_option(
            "Uncertainties as for `pbrdf fit` instead of an instrument, e.g. 0.02,0.001 or instrument:linear=1%."
        ),
    ] = None,
    uncertainty: Annotated[
        str, typer.Option(help="How rough the guess is, relative: the plan then serves models about it.")
    ] = "0%",
    angle_error: Annotated[
        float,
        typer.Option(
            help="Standard error of the sample angle (out of plane of its tilt too), degrees.", min=0.0
        ),
    ] = 0.0,
    wavelength: Annotated[
        float | None,
        typer.Option(help="Of a fit with a model of each wavelength the one to plan for.", metavar="NM"),
    ] = None,
    normalised: Annotated[
        bool,
        typer.Option(
            "--normalised", help="Count Q/I, U/I and V/I alone: the scale of the readings is unknown."
        ),
    ] = False,
    camera_positions: Annotated[
        int | None, typer.Option(help="Use so many camera positions only.", show_default="any number", min=1)
    ] = None,
    repeats: Annotated[int, typer.Option(help="How often one geometry may be read.", min=1)] = 1,
    fix: Annotated[
        list[str] | None, typer.Option(help="Parameter that the fit will hold (repeatable).", metavar="NAME")
    ] = None,
    free: Annotated[
        list[str] | None,
        typer.Option(
            help="Parameter that it will fit although held by default (repeatable).", metavar="NAME"
        ),
    ] = None,
    parameter: Annotated[
        list[str] | None,
        typer.Option(
            help="Count the error of this parameter only (repeatable).", metavar="NAME", show_default="all"
        ),
    ] = None,
    weight: Annotated[
        list[str] | None,
        typer.Option(help="Criterion A: weight of a relative error (repeatable).", metavar="NAME=NUMBER"),
    ] = None,
    pixels: Annotated[int, typer.Option(help="Pixels that a reading averages.", min=1)] = 400,
    smallest_bistatic: Annotated[
        float, typer.Option(help="Smallest angle between source and camera, degrees.", min=0.1, max=170.0)
    ] = 10.0,
    largest_zenith: Annotated[
        float,
        typer.Option(help="Largest angle of source and camera to the normal, degrees.", min=1.0, max=89.0),
    ] = 80.0,
    seed: Annotated[int, seed_option("Seed of the search.")] = 0,
    backend: Backend = None,
) -> None:
    """Choose where to measure: the angles that determine the parameters best.

    Prints the expected standard errors beside those of the paper's plan of 3 camera positions × 21 sample angles,
    and writes an angle table for `pbrdf measure` and `pbrdf reduce` with a picture.

    `pbrdf plan white --budget 40 --angle-error 0.05`

    `pbrdf plan paint-fit --uncertainty 10% --camera-positions 3 -o next.csv`
    """
    import numpy as np

    from pbrdf.backend import set_backend
    from pbrdf.instruments.goniometer.angle_table import write_angles
    from pbrdf.planning import candidates
    from pbrdf.planning.plan import plan as make_plan
    from pbrdf.report.planning.figure import plan_figure
    from pbrdf.report.planning.summary import print_plan
    from pbrdf.report.style import save_figure

    if noise is not None and instrument is not None:
        raise PbrdfError("--noise and --instrument exclude each other: choose one")
    into = not output.suffix or (output.is_dir() and output.suffix.lower() != ".csv")
    if into:
        ready_folder(output)
        output /= "plan.csv"
    elif output.suffix.lower() != ".csv":
        raise PbrdfError(f"--output {output}: the extension must be .csv; or give a folder")
    picture = output.with_suffix(".png")
    for file in (output, picture) if not into else ():
        require_folder_of(file)
    if backend is not None:
        set_backend(backend)
    model = open_model(source, wavelength)
    taken = open_instrument(instrument or "paper") if noise is None else noise
    choose = candidates.out_of_plane_candidates if out_of_plane else candidates.in_plane_candidates
    with progress_bar("Planning") as progress:
        made = make_plan(
            model,
            taken,
            budget,
            criterion=criterion,
            candidates=choose(
                model,
                smallest_bistatic=math.radians(smallest_bistatic),
                largest_zenith=math.radians(largest_zenith),
            ),
            parameters=parameter or None,
            fix=fix or (),
            free=free or (),
            weights=numbers(weight or (), "--weight", "n=2"),
            uncertainty=share(uncertainty, "--uncertainty"),
            camera_positions=camera_positions,
            repeats=repeats,
            pixels=pixels,
            angle_error=math.radians(angle_error),
            normalised=normalised,
            seed=seed,
            progress=progress,
        )
    if into:
        output.parent.mkdir(parents=True, exist_ok=True)
    save_figure(plan_figure(made, Path(source).name), picture)
    mounted = 0.0 if isinstance(taken, str) else taken.reference_angle
    write_angles(made.protocol.angle_table(reference_angle=mounted), output)
    print_plan(made, output_console())
    print(f"\nWritten: {output}, {picture}")
    if np.isinf(made.gain):
        print("The plan 3 × 21 does not determine these parameters at all.")
