"""A measurement that never was: flat painted samples on a goniometer, seen through a polarimeter, as raw frames.

At each geometry the radiance of a sample is f·cosθ_i per unit irradiance, f from its model and averaged over the disc
of the source; it is turned into the axes of the polarimeter, goes through the analyser vectors that the polarimeter
really has (not those that it is taken for), and is exposed. All else is the reduction that real frames take. Signals
are in digital numbers per unit of f·cosθ_i and exposure 1, so that a fit finds the parameters of the models again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from pbrdf.errors import DataError
from pbrdf.instruments.frames.frames import ArrayFrames
from pbrdf.instruments.goniometer.angle_errors import AngleErrors
from pbrdf.instruments.goniometer.angle_table import AngleTable
from pbrdf.instruments.goniometer.protocols import Protocol
from pbrdf.instruments.goniometer.source import Source
from pbrdf.instruments.polarimeter.expected_noise import FILL, automatic_exposure
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.polarimeter.polarimeter import Polarimeter
from pbrdf.instruments.reduction.goniometric_datasets import goniometric_datasets
from pbrdf.instruments.reduction.regions import Rectangle
from pbrdf.instruments.virtual.miscalibration import miscalibrated
from pbrdf.models.base import Model
from pbrdf.models.extended_source import stokes_under_disc
from pbrdf.optics.elements import rotate_frame
from pbrdf.version import __version__

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["CALIBRATIONS", "EXPOSURES", "Measurement", "VirtualExperiment"]

#: How the polarimeter's calibration errs: anew at each geometry, once for all, or not at all.
CALIBRATIONS = ("reading", "fixed", "none")
#: Exposures set to the light of each geometry, or of the brightest of all.
EXPOSURES = ("each", "common")


@dataclass(frozen=True)
class VirtualExperiment:
    """What is measured with.

    Attributes
    ----------
    protocol
        The geometries, as they are set.
    instrument
        As it is taken for; its stated accuracy is the size of its calibration errors.
    source
        None is a point as steady as the instrument states.
    angle_errors
        Of the goniometer.
    exposure
        ``"each"``: at each geometry the brightest pixel reaches 80 % of the range; ``"common"``: one exposure for all,
        set to the brightest; or a number, digital numbers per unit of f·cosθ_i.
    calibration
        One of :data:`CALIBRATIONS`.
    patch, margin
        Side of the square of pixels that shows a sample, and what is dark between and around them.
    wavelength
        To write down, nm.
    seed
        Of all errors and noise.

    Raises
    ------
    DataError
        If an option is unknown or out of range.
    """

    protocol: Protocol
    instrument: Instrument
    source: Source | None = None
    angle_errors: AngleErrors = field(default_factory=AngleErrors)
    exposure: float | str = "each"
    calibration: str = "reading"
    patch: int = 20
    margin: int = 4
    wavelength: float | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        if self.calibration not in CALIBRATIONS:
            raise DataError(f"calibration {self.calibration!r}: choose one of {', '.join(CALIBRATIONS)}")
        known = self.exposure in EXPOSURES if isinstance(self.exposure, str) else _positive(self.exposure)
        if not known:
            raise DataError(f"exposure {self.exposure!r}: give {' or '.join(EXPOSURES)}, or a number above 0")
        if self.patch < 1 or self.margin < 0:
            raise DataError("a sample is shown by at least one pixel, with a margin of 0 or more")

    def measure(
        self, samples: Mapping[str, Model], *, progress: Callable[[int, int], None] | None = None
    ) -> Measurement:
        """Take the frames of samples that lie side by side in the picture.

        Parameters
        ----------
        samples
            Their models by name, single numbers as parameters.
        progress
            Called with the number of finished geometries and of all.

        Returns
        -------
        Measurement
            The same for the same seed.

        Raises
        ------
        DataError, ModelError
            If there is no sample, or an error of the angles puts a ray below the horizon.
        """
        if not samples:
            raise DataError("virtual experiment: there is no sample to measure")
        for name, model in samples.items():
            if any(np.ndim(value) for value in model.values.values()):
                raise DataError(
                    f"sample {name!r}: its parameters are arrays; give a model with single numbers"
                )
        # streams of their own: more noise of one kind does not change that of another
        streams = np.random.SeedSequence(self.seed).spawn(4)
        angles, steadiness, calibration, noise = (np.random.default_rng(s) for s in streams)
        source = self.source or Source(stability=self.instrument.stability)
        true = self.angle_errors.apply(self.protocol, angles)
        steady = source.radiances(len(true), steadiness)
        radiance = {
            name: self._radiance(model, true, source) * steady[:, None] for name, model in samples.items()
        }
        regions = self._regions(list(samples))
        rows, columns = self.patch + 2 * self.margin, int(max(r.x1 for r in regions.values())) + self.margin
        turn = rotate_frame(self.instrument.reference_angle + true.reference_angle)
        polarimeters = self._polarimeters(len(true), calibration)

        def intensities(number: int) -> np.ndarray:
            """Behind the analyser at unit exposure, shape (N, rows, columns)."""
            picture = np.zeros((4, rows, columns))
            for name, region in regions.items():
                stokes = turn[number] @ radiance[name][number]
                picture[:, region.mask(0, rows, columns)] = stokes[:, None]
            return polarimeters[number].intensities(picture)

        brightest = np.array([intensities(number).max() for number in range(len(true))])
        exposures = self._exposures(brightest)
        detector = self.instrument.detector
        frames = np.empty(
            (len(true), self.instrument.polarimeter.size, rows, columns),
            dtype=np.uint8 if detector.bits <= 8 else np.uint16,
        )
        for number in range(len(true)):
            frames[number] = detector.expose(exposures[number] * intensities(number), noise)
            if progress is not None:
                progress(number + 1, len(true))
        table = self.protocol.angle_table(
            exposure=exposures,
            wavelength=self.wavelength,
            reference_angle=self.instrument.reference_angle,
        )
        return Measurement(
            self,
            dict(samples),
            ArrayFrames(frames, tuple(self.protocol.series)),
            table,
            regions,
            true,
            radiance,
        )

    def _radiance(self, model: Model, true: Protocol, source: Source) -> np.ndarray:
        """Stokes vectors in the axes (p, s) for unit irradiance across the rays, shape (G, 4)."""
        incident = rotate_frame(-true.source_reference_angle) @ source.stokes
        stokes = stokes_under_disc(
            model, true.theta_i, true.theta_r, true.phi, source.angular_radius, incident
        )
        values: np.ndarray = stokes * np.cos(true.theta_i)[:, None]
        return values

    def _polarimeters(self, count: int, rng: np.random.Generator) -> list[Polarimeter]:
        """What the polarimeter really is at each geometry."""
        stated = self.instrument.polarimeter
        if self.calibration == "none":
            return [stated] * count
        if self.calibration == "fixed":
            return [miscalibrated(stated, *stated.accuracy, rng)] * count
        return [miscalibrated(stated, *stated.accuracy, rng) for _ in range(count)]

    def _exposures(self, brightest: np.ndarray) -> np.ndarray:
        if not isinstance(self.exposure, str):
            return np.full(len(brightest), float(self.exposure))
        if self.exposure == "common":
            return np.full(len(brightest), automatic_exposure(self.instrument, brightest.max(), FILL))
        return automatic_exposure(self.instrument, brightest, FILL)

    def _regions(self, names: list[str]) -> dict[str, Rectangle]:
        pitch, top = self.patch + self.margin, self.margin
        return {
            name: Rectangle(top + i * pitch, top + i * pitch + self.patch, top, top + self.patch)
            for i, name in enumerate(names)
        }


@dataclass(frozen=True, eq=False)
class Measurement:
    """Frames of a virtual experiment, with what is known of a real one, and with the truth.

    Attributes
    ----------
    experiment
        What measured.
    samples
        The models by name.
    frames, angles, regions
        Raw frames, the angles as they were set with the exposures, and where each sample lies in the picture.
    true
        The geometries that there really were.
    radiance
        For each sample the Stokes vectors that there really were, (p, s) of the true geometry, shape (G, 4).
    """

    experiment: VirtualExperiment
    samples: dict[str, Model]
    frames: ArrayFrames
    angles: AngleTable
    regions: dict[str, Rectangle]
    true: Protocol
    radiance: dict[str, np.ndarray]

    def datasets(self, *, progress: Callable[[int, int], None] | None = None) -> dict[str, xr.Dataset]:
        """One goniometric data set for each sample, by the reduction that real frames take.

        Raises
        ------
        DataError
            As :func:`~pbrdf.instruments.reduction.goniometric_datasets.goniometric_datasets`.
        """

        found = goniometric_datasets(
            self.frames,
            self.experiment.instrument,
            self.regions,
            self.angles,
            progress=progress,
            simulated=True,
        )
        for name, dataset in found.items():
            dataset.attrs["title"] = f"Virtual measurement of {name}"
            dataset.attrs["source"] = (
                f"SIMULATED frames by pbrdf {__version__}: {self.samples[name]!r}, seed {self.experiment.seed}"
            )
        return found

    def exact(self, name: str) -> np.ndarray:
        """Stokes vectors of a sample without any error: nominal angles, point source; shape (G, 4)."""
        protocol = self.experiment.protocol
        return self.experiment._radiance(self.samples[name], protocol, Source())


def _positive(value: object) -> bool:
    return (
        isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value) and value > 0
    )
