"""``pbrdf calibrate``: frames of known light made into an instrument that reduces with them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Literal, cast

import typer

from pbrdf.cli.console import output_console, progress_bar, warn
from pbrdf.cli.instruments import open_instrument
from pbrdf.cli.options import (
    DarkLevel,
    output_option,
    polarimeter_option,
    quiet_option,
    regions_option,
    roi_option,
)
from pbrdf.cli.regions import open_regions
from pbrdf.cli.values import require_folder_of
from pbrdf.errors import PbrdfError

__all__ = ["calibrate"]


def calibrate(
    frames: Annotated[
        Path,
        typer.Argument(
            metavar="FRAMES",
            help="Raw frames as `pbrdf reduce` reads them, one series for each known light.",
        ),
    ],
    polarimeter: Annotated[
        str,
        polarimeter_option("The nominal instrument: its TOML file, or a built-in one."),
    ],
    inputs: Annotated[
        Path,
        typer.Option(
            "--inputs",
            "-i",
            help="CSV table of the light of each series: series, angle_deg, ellipticity_deg, handedness, dop, "
            "intensity; or series, I, Q, U, V.",
            metavar="FILE",
        ),
    ],
    output: Annotated[
        Path | None,
        output_option("File of the calibrated instrument.", show_default="<frames>-calibrated.toml"),
    ] = None,
    grid: Annotated[
        str | None,
        typer.Option(help="Calibrate so many cells of the field apart.", metavar="ROWSxCOLUMNS"),
    ] = None,
    per_pixel: Annotated[bool, typer.Option("--per-pixel", help="Calibrate each pixel.")] = False,
    hold_out: Annotated[
        str | None,
        typer.Option(
            help="Series that only verify, e.g. linear30,left.", metavar="NAMES", show_default="each in turn"
        ),
    ] = None,
    components: Annotated[
        str | None,
        typer.Option(
            help="IQUV, or IQU for linear polarisers.", metavar="IQUV|IQU", show_default="as nominal"
        ),
    ] = None,
    parametric: Annotated[
        bool,
        typer.Option(
            "--parametric", help="Fit axes, retardances, diattenuation and black level, not the vectors."
        ),
    ] = False,
    gain: Annotated[
        str, typer.Option(help="With --parametric: common to all states, or each.", metavar="common|each")
    ] = "common",
    fix: Annotated[
        list[str] | None,
        typer.Option(
            help="With --parametric: setting to keep, e.g. 'axis 1' (repeatable).",
            metavar="NAME",
            show_default="analyzer",
        ),
    ] = None,
    regions: Annotated[
        Path | None,
        regions_option("Regions that were lit evenly"),
    ] = None,
    roi: Annotated[
        list[str] | None,
        roi_option("Such a region, as of `pbrdf reduce` (repeatable)."),
    ] = None,
    dark_level: DarkLevel = 0.0,
    picture: Annotated[bool, typer.Option("--picture/--no-picture", help="Draw the errors.")] = True,
    quiet: Annotated[bool, quiet_option("Print the name of the file only.")] = False,
) -> None:
    """Calibrate a polarimeter with frames of known light.

    Writes an instrument for `pbrdf reduce --polarimeter`, with the accuracy that inputs held out have shown, a table
    of the inputs and a picture beside it.

    Files to try it with: `pbrdf example known-light`

    `pbrdf calibrate light/known -p light/nominal.toml -i light/inputs.csv -o imager.toml`

    Then reduce with what came out: `pbrdf reduce run/ -p imager.toml`
    """
    if parametric and (grid is not None or per_pixel):
        raise PbrdfError("--parametric fits one set of settings: leave --grid and --per-pixel out")
    if grid is not None and per_pixel:
        raise PbrdfError("--grid and --per-pixel exclude each other: choose one")
    if gain not in ("common", "each"):
        raise PbrdfError(f"--gain {gain!r}: choose common or each")
    if not parametric and (gain != "common" or fix):
        raise PbrdfError("--gain and --fix belong to --parametric: add it, or leave them out")
    if components not in (None, "IQUV", "IQU"):
        raise PbrdfError(f"--components {components!r}: choose IQUV or IQU")
    cells = None if per_pixel else _cells(grid)
    plain = frames.resolve()
    target = output or Path(
        f"{plain.name if plain.is_dir() and plain.suffix != '.zarr' else plain.stem}-calibrated.toml"
    )
    if target.suffix.lower() != ".toml":
        raise PbrdfError(f"--output {target}: the extension must be .toml")
    if target.resolve() == Path(polarimeter).resolve():
        raise PbrdfError(f"--output {target}: that is the nominal instrument; choose another name")
    require_folder_of(target)
    from pbrdf.instruments.calibration.input_table import read_input_table
    from pbrdf.instruments.calibration.instrument_calibration import calibrate_instrument
    from pbrdf.instruments.frames.frame_files import open_frames
    from pbrdf.instruments.frames.frames import notes_of
    from pbrdf.instruments.polarimeter.instrument_files import save_instrument
    from pbrdf.report.instrument.calibration_figure import calibration_figure
    from pbrdf.report.instrument.calibration_summary import print_calibration, write_inputs
    from pbrdf.report.style import save_figure

    instrument = open_instrument(polarimeter, colors=True)
    table = read_input_table(inputs)
    found = open_frames(frames, instrument)
    chosen = open_regions(regions, roi or [])
    with progress_bar(f"Reading {frames}", quiet) as progress:
        made = calibrate_instrument(
            found,
            instrument,
            table,
            held_out="each" if hold_out is None else [n.strip() for n in hold_out.split(",") if n.strip()],
            cells=cells,
            components=components,
            parametric=parametric,
            gain=cast(Literal["common", "each"], gain),
            fixed=fix or ("analyzer",),
            regions=list(chosen.values()),
            dark_level=dark_level,
            progress=progress,
        )
    written = [target.with_name(f"{target.stem}_inputs.csv")]
    write_inputs(made, written[0])
    if picture:
        written.append(target.with_suffix(".png"))
        save_figure(calibration_figure(made, target.stem), written[-1])
    save_instrument(made.instrument, target)
    for warning in [*made.warnings, *notes_of(found)]:
        warn(warning)
    if quiet:
        print(target)
        return
    print_calibration(made, output_console())
    print(f"\nWritten: {target}, {', '.join(map(str, written))}")


def _cells(text: str | None) -> tuple[int, int]:
    if text is None:
        return (1, 1)
    match = re.fullmatch(r"\s*([0-9]{1,6})\s*[x×,]\s*([0-9]{1,6})\s*", text)
    if match is None or 0 in (int(match[1]), int(match[2])):
        raise PbrdfError(f"--grid {text!r}: give rows and columns of cells, for example 8x8")
    return int(match[1]), int(match[2])
