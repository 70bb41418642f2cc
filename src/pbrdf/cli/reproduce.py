"""``pbrdf reproduce``: the paper's experiment on simulated frames, and a report of what its statements are worth."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from pbrdf.cli.console import output_console, stage_bar
from pbrdf.cli.options import (
    CAMERA_POSITIONS,
    CalibrationError,
    Patch,
    angles_option,
    output_option,
    quiet_option,
    seed_option,
    source_radius_option,
)
from pbrdf.cli.values import angles, share
from pbrdf.errors import PbrdfError

__all__ = ["reproduce"]

#: What --noise may name, and the option of the experiment behind it.
_NOISE = {"linear": "linear", "circular": "circular", "read": "read_noise", "stability": "stability"}


def reproduce(
    output: Annotated[Path, output_option("Folder for the report.")] = Path("reproduction"),
    bits: Annotated[
        int,
        typer.Option(help="Of the camera's converter; the paper does not name its camera.", min=4, max=16),
    ] = 12,
    noise: Annotated[
        str | None,
        typer.Option(
            help="Accuracy of the imager (linear, circular), read noise in electrons of 20480, stability of the "
            "source.",
            metavar="NAME=VALUE,…",
            show_default="linear=1%,circular=5%,read=20,stability=0.1%",
        ),
    ] = None,
    positions: Annotated[
        str,
        angles_option("Bistatic angles of the three camera positions, degrees; the last one is predicted."),
    ] = CAMERA_POSITIONS,
    starts: Annotated[int, typer.Option(help="Starts of each inversion.", min=1)] = 64,
    source_radius: Annotated[float, source_radius_option("; the inversion believes in a point")] = 0.0,
    calibration_error: CalibrationError = "reading",
    exposure: Annotated[
        str,
        typer.Option(
            help="One exposure for all angles of a sample (common), or for each angle (each).",
            metavar="common|each",
        ),
    ] = "common",
    seed: Annotated[int, seed_option("Seed of noise and starts.")] = 0,
    patch: Patch = 20,
    quiet: Annotated[bool, quiet_option("Print the name of the page only.")] = False,
) -> None:
    """Reproduce the paper on simulated data: its figures, its table 1 and a test of each of its statements.

    Five paints → frames of the imager → Stokes vectors → stepwise inversion of camera positions 1 and 2 → prediction of
    position 3. Writes a folder with a page (index.html), figures, tables, data sets and fitted models. The paper
    published no raw data: everything is simulated, and says so.

    `pbrdf reproduce -o paper`
    """
    from pbrdf.files.atomic import require_writable_folder
    from pbrdf.reproduction.experiment.measurement import Options
    from pbrdf.reproduction.run import reproduce as run
    from pbrdf.reproduction.run import write_reproduction

    psi = angles(positions, "--positions")
    options = Options(
        positions=tuple(math.radians(p) for p in psi),
        bits=bits,
        calibration_error=calibration_error,
        exposure=exposure,
        source_radius=math.radians(source_radius),
        starts=starts,
        seed=seed,
        patch=patch,
        **_noise(noise),
    )
    require_writable_folder(output)
    with stage_bar(quiet, "Reproducing the paper") as progress:
        reproduction = run(options, progress)
        written = write_reproduction(reproduction, output, progress)
    if quiet:
        print(written[0])
        return
    from pbrdf.reproduction.page.summary import print_summary

    print_summary(reproduction, output_console())
    print(f"\nWritten to {output}: open {written[0]}")


def _noise(text: str | None) -> dict[str, float]:
    """The options that --noise changes; a value may be a percentage."""
    changed: dict[str, float] = {}
    for item in filter(None, (part.strip() for part in (text or "").split(","))):
        name, sign, value = (part.strip() for part in item.partition("="))
        if not sign or name not in _NOISE:
            raise PbrdfError(
                f"--noise {item!r}: give {', '.join(_NOISE)}, for example --noise linear=1%,read=20"
            )
        changed[_NOISE[name]] = share(value, f"--noise {name}")
    return changed
