"""The simulated measurement: from the parameters of table 1 through frames of the imager to Stokes vectors."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pbrdf.data.paints import WAVELENGTH, load_paint
from pbrdf.errors import DataError
from pbrdf.instruments.goniometer.protocols import BISTATIC, Protocol
from pbrdf.instruments.goniometer.source import Source
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.polarimeter.presets import preset
from pbrdf.instruments.reduction.goniometric_datasets import goniometric_datasets
from pbrdf.instruments.virtual.experiment import CALIBRATIONS, EXPOSURES, VirtualExperiment
from pbrdf.reproduction.experiment.sample import SCALE
from pbrdf.reproduction.paper import PAPER, SAMPLES, SIMULATED

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Options", "measured_samples"]

#: Camera positions of the paper.
_POSITIONS = 3
#: The detector's full range, electrons, and its black level in units of the range: they stay when the bits change.
_RANGE, _BLACK = 80.0 * 256.0, 1.0 / 256.0


@dataclass(frozen=True)
class Options:
    """How the experiment is simulated and inverted.

    Attributes
    ----------
    positions
        Bistatic angles Ψ of the three camera positions, radians, ascending; the last one is predicted.
    bits
        Of the detector's converter. The paper does not name its detector.
    linear, circular
        Accuracy of the imager's calibration, relative to the intensity.
    read_noise
        Of the detector, electrons.
    stability
        Relative, of the source from one reading to the next.
    calibration_error
        ``"reading"``: the calibration errs anew at each geometry; ``"fixed"``: once for all geometries of a sample;
        ``"none"``: not at all (the stated accuracy still counts in the weights).
    exposure
        ``"common"``: one exposure for all geometries of a sample, as intensities in digital numbers on one scale
        suggest; ``"each"``: set anew at each geometry.
    source_radius
        Angular radius of the source, radians. The inversion believes in a point, as the paper's does.
    starts
        Of each inversion.
    seed
        Of noise and starts.
    patch
        Side of the square of pixels over which a sample is averaged.

    Raises
    ------
    DataError
        If a number is out of range; what the instrument does not allow is found when it is made.
    """

    positions: tuple[float, ...] = BISTATIC
    bits: int = 12
    linear: float = 0.01
    circular: float = 0.05
    read_noise: float = 20.0
    stability: float = 0.001
    calibration_error: str = "reading"
    exposure: str = "common"
    source_radius: float = 0.0
    starts: int = 64
    seed: int = 0
    patch: int = 20

    def __post_init__(self) -> None:
        degrees = np.rad2deg(self.positions)
        if len(degrees) != _POSITIONS or not (np.diff(degrees) > 0.0).all():
            raise DataError(
                f"positions: give three bistatic angles that ascend, not {', '.join(f'{d:g}°' for d in degrees)}"
            )
        if not (np.isfinite(degrees).all() and degrees[0] >= 20.0 and degrees[-1] <= 140.0):
            raise DataError("positions: bistatic angles are from 20° to 140°")
        if self.starts < 1:
            raise DataError(f"starts: {self.starts}; at least one start is needed")
        if self.calibration_error not in CALIBRATIONS:
            raise DataError(
                f"calibration error {self.calibration_error!r}: choose one of {', '.join(CALIBRATIONS)}"
            )
        if self.exposure not in EXPOSURES:
            raise DataError(f"exposure {self.exposure!r}: choose one of {', '.join(EXPOSURES)}")

    @property
    def instrument(self) -> Instrument:
        """The paper's imager with these numbers."""
        base = preset("paper")
        steps = 2.0**self.bits
        detector = replace(
            base.detector,
            bits=self.bits,
            gain=_RANGE / steps,
            read_noise=self.read_noise,
            offset=float(round(_BLACK * steps)),
        )
        polarimeter = base.polarimeter.with_accuracy(self.linear, self.circular)
        return replace(base, polarimeter=polarimeter, detector=detector, stability=self.stability)

    def in_words(self) -> str:
        """One line, for the page and the files."""
        positions = ", ".join(f"{d:g}°" for d in np.rad2deg(self.positions))
        radius = math.degrees(self.source_radius)
        source = f"source of {radius:g}° radius" if radius else "point source"
        calibration = {
            "reading": "anew at each geometry",
            "fixed": "once for all geometries of a sample",
            "none": "not at all",
        }[self.calibration_error]
        exposure = "one exposure a sample" if self.exposure == "common" else "an exposure for each geometry"
        return (
            f"positions Ψ = {positions}; {self.bits} bits; imager accurate to {100 * self.linear:g} % (linear) and "
            f"{100 * self.circular:g} % (circular), erring {calibration}; read noise {self.read_noise:g} electrons of "
            f"{_RANGE:.0f}; {source} stable to {self.stability:g}; {exposure}; {self.patch} × {self.patch} pixels "
            f"averaged; {self.starts} starts; seed {self.seed}"
        )


def measured_samples(
    options: Options, progress: Callable[[int, int], None] | None = None
) -> dict[str, xr.Dataset]:
    """Take frames of the five samples and reduce them, by the chain that real frames take.

    Parameters
    ----------
    options
        How.
    progress
        Called with the number of finished samples and of all.

    Returns
    -------
    dict of str to xarray.Dataset
        By the name of the bundled paint. Intensities are digital numbers divided by the exposure, that is f cosθ_i; the
        attribute :data:`~pbrdf.reproduction.experiment.sample.SCALE` is the exposure at which the brightest pixel of
        the sample reached 80 % of the detector's range.

    Raises
    ------
    DataError
        If the numbers do not make an instrument.
    """
    instrument, protocol = options.instrument, Protocol.in_plane(options.positions)
    source = Source(angular_radius=options.source_radius, stability=options.stability)
    found: dict[str, xr.Dataset] = {}
    if progress is not None:
        progress(0, len(SAMPLES))
    for number, name in enumerate(SAMPLES):
        experiment = VirtualExperiment(
            protocol,
            instrument,
            source=source,
            exposure=options.exposure,
            calibration=options.calibration_error,
            patch=options.patch,
            wavelength=WAVELENGTH,
            seed=_seed(options.seed, number),
        )
        measurement = experiment.measure({name: load_paint(name)})
        attrs = {
            "title": f"Virtual measurement of sample {number + 1}, the paint {name}. {SIMULATED}",
            "source": f"SIMULATED frames: {options.in_words()}",
            "reference": f"parameters: {PAPER}",
            SCALE: float(np.min(measurement.angles.exposure)),
        }
        found |= goniometric_datasets(
            measurement.frames,
            instrument,
            measurement.regions,
            measurement.angles,
            simulated=True,
            attrs=attrs,
        )
        if progress is not None:
            progress(number + 1, len(SAMPLES))
    return found


def _seed(seed: int, number: int) -> int:
    """Another seed for each sample."""
    return int(np.random.SeedSequence([seed, number]).generate_state(1)[0])
