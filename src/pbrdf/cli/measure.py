"""``pbrdf measure``: a virtual measurement, from models to the files that an instrument leaves."""

from __future__ import annotations

import math
import shlex
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pbrdf.cli.console import progress_bar, warn
from pbrdf.cli.instruments import open_instrument
from pbrdf.cli.options import (
    CAMERA_POSITIONS,
    Backend,
    CalibrationError,
    Patch,
    WrittenWavelength,
    angles_option,
    instrument_option,
    model_argument,
    output_option,
    seed_option,
    source_radius_option,
)
from pbrdf.cli.sources import known_wavelength, open_model
from pbrdf.cli.values import angles, number
from pbrdf.errors import PbrdfError

if TYPE_CHECKING:
    from pbrdf.instruments.goniometer.protocols import Protocol
    from pbrdf.instruments.polarimeter.detector import Detector

__all__ = ["measure"]


def measure(
    sources: Annotated[
        list[str],
        model_argument(
            "Models' JSON files, folders of fits, or bundled paints: samples side by side in the picture."
        ),
    ],
    output: Annotated[Path, output_option("The new folder.")] = Path("measurement"),
    positions: Annotated[
        str | None,
        angles_option(
            "Camera positions: bistatic angles between source and camera, degrees.",
            show_default=CAMERA_POSITIONS,
        ),
    ] = None,
    sample_angles: Annotated[
        str | None,
        angles_option(
            "Angles between the sample's surface and the source, degrees: START:STOP:STEP or a list.",
            show_default="21 at each position, crowded to the mirror direction",
        ),
    ] = None,
    angle_table: Annotated[
        Path | None,
        typer.Option(
            "--angles",
            help="Take the geometries of an angle table instead, e.g. of `pbrdf plan`.",
            metavar="FILE",
        ),
    ] = None,
    instrument: Annotated[str, instrument_option()] = "paper",
    bits: Annotated[
        int | None,
        typer.Option(
            help="Bits of the converter over the same range.", min=1, max=16, show_default="the instrument's"
        ),
    ] = None,
    exposure: Annotated[
        str,
        typer.Option(
            help="each: the brightest pixel of each geometry at 80 % of the range; common: one for all; or digital "
            "numbers per unit of f cos(theta_i).",
            metavar="each|common|NUMBER",
        ),
    ] = "each",
    calibration_error: CalibrationError = "reading",
    source_radius: Annotated[float, source_radius_option()] = 0.0,
    source_stability: Annotated[
        float | None,
        typer.Option(
            help="Relative, from one geometry to the next.", min=0.0, show_default="the instrument's"
        ),
    ] = None,
    source_polarization: Annotated[
        str | None,
        typer.Option(help="Residual polarisation of the source, Q/I,U/I,V/I.", metavar="Q,U,V"),
    ] = None,
    angle_error: Annotated[
        float, typer.Option(help="Of the sample angle at each geometry, degrees.", min=0.0)
    ] = 0.0,
    camera_error: Annotated[float, typer.Option(help="Of each camera position, degrees.", min=0.0)] = 0.0,
    zero_error: Annotated[
        float, typer.Option(help="Of the zero of the sample angle at each camera position, degrees.", min=0.0)
    ] = 0.0,
    tilt_error: Annotated[
        float,
        typer.Option(
            help="Of the sample's tilt out of the plane of incidence at each geometry, degrees.", min=0.0
        ),
    ] = 0.0,
    patch: Patch = 20,
    wavelength: WrittenWavelength = None,
    seed: Annotated[int, seed_option("Seed of all errors and noise.")] = 0,
    backend: Backend = None,
) -> None:
    """Measure painted samples on a virtual goniometer: raw frames, and everything to reduce them.

    Writes a folder with the frames, polarimeter.toml, angles.csv and regions.toml as `pbrdf reduce` takes them,
    with the data sets that it gives (SAMPLE.nc) and the models behind them.

    The paper's measurement: `pbrdf measure white matte-white-thick --source-radius 0.5 -o virtual`

    Of a plan: `pbrdf measure white --angles plan.csv -o planned && pbrdf fit planned/white.nc`
    """
    from pbrdf.backend import set_backend
    from pbrdf.files.atomic import require_new_folder
    from pbrdf.instruments.goniometer.angle_errors import AngleErrors
    from pbrdf.instruments.goniometer.source import Source
    from pbrdf.instruments.virtual.experiment import VirtualExperiment
    from pbrdf.instruments.virtual.measurement_folder import write_measurement

    if wavelength is not None and not 0.0 < wavelength < math.inf:
        raise PbrdfError(f"--wavelength {wavelength:g}: give a wavelength above 0 in nm")
    require_new_folder(output)
    if backend is not None:
        set_backend(backend)
    taken = open_instrument(instrument)
    if bits is not None:
        taken = replace(taken, detector=_with_bits(taken.detector, bits))
    samples = {}
    for source in sources:
        name = Path(source).stem
        if name in samples:
            raise PbrdfError(f"two samples are called {name!r}: give each a name of its own")
        samples[name] = open_model(source, wavelength)
    protocol = _protocol(positions, sample_angles, angle_table, taken.reference_angle)
    if wavelength is None and len(known := {known_wavelength(source) for source in sources}) == 1:
        (wavelength,) = known
    experiment = VirtualExperiment(
        protocol,
        taken,
        Source(
            math.radians(source_radius),
            taken.stability if source_stability is None else source_stability,
            _polarization(source_polarization),
        ),
        AngleErrors(*map(math.radians, (angle_error, camera_error, zero_error, tilt_error))),
        exposure=exposure if exposure in ("each", "common") else number(exposure, "--exposure"),
        calibration=calibration_error,
        patch=patch,
        wavelength=wavelength,
        seed=seed,
    )
    for note in protocol.notes:
        warn(note)
    with progress_bar("Measuring") as progress:
        measurement = experiment.measure(samples, progress=progress)
    with progress_bar("Reducing") as progress:
        write_measurement(measurement, output, progress=progress)
    states = taken.polarimeter.size
    print(f"{output}: {len(protocol)} geometries, {states} states, {len(samples)} sample(s), simulated")
    words = ["pbrdf", "reduce", str(output / "frames"), "--polarimeter", str(output / "polarimeter.toml")]
    words += ["--angles", str(output / "angles.csv"), "--regions", str(output / "regions.toml")]
    print(f"Reduce with: {shlex.join(words)}")


def _with_bits(detector: Detector, bits: int) -> Detector:
    """The same electrons over more or fewer digital numbers."""
    finer = 2.0 ** (bits - detector.bits)
    return replace(detector, bits=bits, gain=detector.gain / finer, offset=detector.offset * finer)


def _protocol(
    positions: str | None, sample_angles: str | None, table: Path | None, reference_angle: float
) -> Protocol:
    """The geometries that the options name."""
    import numpy as np

    from pbrdf.instruments.goniometer.angle_table import read_angles
    from pbrdf.instruments.goniometer.protocols import Protocol

    if table is not None:
        if positions is not None or sample_angles is not None:
            raise PbrdfError("--angles holds every geometry: leave --positions and --sample-angles out")
        return Protocol.from_angle_table(read_angles(table), reference_angle=reference_angle)
    between = np.deg2rad(angles(positions or CAMERA_POSITIONS, "--positions"))
    turned = None if sample_angles is None else np.deg2rad(angles(sample_angles, "--sample-angles"))
    return Protocol.in_plane(between, turned)


def _polarization(text: str | None) -> tuple[float, float, float]:
    if text is None:
        return (0.0, 0.0, 0.0)
    parts = text.split(",")
    if len(parts) != 3:
        raise PbrdfError(
            f"--source-polarization {text!r}: give three numbers Q/I,U/I,V/I, for example 0.01,0,0"
        )
    q, u, v = (number(part, "--source-polarization") for part in parts)
    return (q, u, v)
