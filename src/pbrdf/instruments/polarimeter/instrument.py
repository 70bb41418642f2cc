"""An instrument as a whole: polarimeter, detector, how it is mounted, and where its frames lie."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pbrdf.errors import DataError
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.mueller_polarimeter import Generator
from pbrdf.instruments.polarimeter.polarimeter import Polarimeter

__all__ = ["FRAME_FILES", "Instrument"]

#: Keys of the table ``[frames]`` whose values are names of files.
FRAME_FILES = ("dark_frame", "flat_field", "dead_pixels")


@dataclass(frozen=True)
class Instrument:
    """What takes the pictures of a measurement.

    Attributes
    ----------
    polarimeter, detector
        Analyser vectors and the camera behind them.
    reference_angle
        Radians from the p direction of the surface (the plane of incidence) to the polarimeter's x axis, counted from
        p towards s as from x towards y.
    stability
        Relative standard deviation of the source from one reading to the next; it scales whole Stokes vectors.
    frames
        The table ``[frames]`` of the instrument's file as it stands there: how files are named, which are dark frame,
        flat field and dead pixels.
    folder
        Folder that relative names of files start from; None for the working directory.
    generator
        What polarises the light on the sample, for an instrument that measures Mueller matrices; None for one that
        measures Stokes vectors.
    """

    polarimeter: Polarimeter
    detector: Detector = field(default_factory=Detector)
    reference_angle: float = 0.0
    stability: float = 0.0
    frames: dict[str, Any] = field(default_factory=dict)
    folder: Path | None = None
    generator: Generator | None = None

    def __post_init__(self) -> None:
        if not math.isfinite(self.reference_angle):
            raise DataError(f"the reference angle is {self.reference_angle!r}, it must be a finite number")
        if not (math.isfinite(self.stability) and self.stability >= 0.0):
            raise DataError(f"the stability is {self.stability!r}, it must be a number of 0 or more")

    def require_stokes(self) -> None:
        """Check that the instrument measures Stokes vectors; raises DataError."""
        if self.generator is not None:
            raise DataError(
                f"{self.polarimeter.name}: its light changes from state to state, so that it measures Mueller matrices "
                "and no Stokes vectors: pbrdf reduce makes data sets of its readings"
            )

    def resolve(self, name: str | Path) -> Path:
        """Path of a file named in the instrument's tables."""
        return Path(name) if self.folder is None else self.folder / name
