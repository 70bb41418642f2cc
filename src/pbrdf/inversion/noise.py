"""How uncertain the measured values are, where the data set does not say."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pbrdf.errors import FitError

__all__ = ["NoiseModel"]


@dataclass(frozen=True)
class NoiseModel:
    """Standard uncertainty stated as a part relative to the intensity plus an absolute part.

    For a Stokes component (or a Mueller element) the variance is (relative·I)² + (absolute·I_median)², with
    I the intensity of the same geometry (of unpolarised light for a Mueller matrix) and I_median the median
    intensity of the data set; for the degree of linear polarisation it is relative² + (absolute·I_median/I)².
    The relative part lets a specular peak a thousand times brighter than the diffuse floor weigh no more than
    the floor, and the absolute part keeps readings in the dark, where real data are noise and stray light, from
    weighing too much. The default, 5 % each, predicted the held-out incidence of a measured enamel best among
    five choices (``docs/real-data.md``). Only the ratio of the two parts matters to the parameters and, as the
    scale is then estimated from the residuals, to their standard errors.

    Attributes
    ----------
    relative
        Relative part, 1.
    absolute
        Absolute part in units of the median intensity, 1.
    """

    relative: float = 0.05
    absolute: float = 0.05

    def __post_init__(self) -> None:
        for name in ("relative", "absolute"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise FitError(f"noise: the {name} part is {value!r}, it must be a number of 0 or more")
        if self.relative == 0.0 and self.absolute == 0.0:
            raise FitError("noise: the relative and the absolute part cannot both be 0")

    @classmethod
    def parse(cls, text: str) -> NoiseModel:
        """Read ``"RELATIVE"`` or ``"RELATIVE,ABSOLUTE"``; each a number or a percentage like ``2%``.

        Raises
        ------
        FitError
            If the text has another form.
        """
        parts = [part.strip() for part in text.split(",")]
        try:
            if not 1 <= len(parts) <= 2:
                raise ValueError
            numbers = [float(p[:-1]) / 100.0 if p.endswith("%") else float(p) for p in parts]
        except ValueError:
            raise FitError(
                f"noise {text!r}: give RELATIVE or RELATIVE,ABSOLUTE, for example 0.02,0.001 or 2%,0.1%"
            ) from None
        return cls(*numbers)

    def standard_uncertainty(self, channel: str, intensity: np.ndarray) -> np.ndarray:
        """Standard uncertainty of a channel, given the intensity at the same geometries; same shape."""
        size = np.abs(intensity)
        median = float(np.nanmedian(size)) if np.isfinite(size).any() else 1.0
        floor = max(self.absolute * median, np.finfo(float).tiny)
        if channel == "dolp":
            return np.hypot(self.relative, floor / np.maximum(size, np.finfo(float).tiny))
        return np.hypot(self.relative * size, floor)

    def __str__(self) -> str:
        return f"{self.relative:.3g} of the intensity plus {self.absolute:.3g} of its median"
