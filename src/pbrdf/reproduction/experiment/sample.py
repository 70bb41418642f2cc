"""One sample of the experiment: its simulated measurement and what the inversion made of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pbrdf.inversion.fit import fit
from pbrdf.inversion.result import FitResult
from pbrdf.models import DoubleGauss
from pbrdf.optics.stokes import dolp
from pbrdf.reproduction.paper import SAMPLES
from pbrdf.reproduction.plane import in_plane

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["SCALE", "Sample", "invert", "sample_angles"]

#: Attribute of a measured data set: digital numbers per unit of its intensities, which are f cosθ_i in 1/sr.
SCALE = "digital_numbers_per_inverse_steradian"


@dataclass(frozen=True)
class Sample:
    """A sample, measured (in a simulation) and inverted.

    Attributes
    ----------
    name
        Name of the bundled paint whose parameters are the truth.
    dataset
        The measurement, f cosθ_i; groups are camera positions 1, 2, 3.
    truth
        The model that made it.
    result
        Fit to positions 1 and 2, position 3 predicted.
    """

    name: str
    dataset: xr.Dataset
    truth: DoubleGauss
    result: FitResult

    @property
    def number(self) -> int:
        """1 … 5, as in the paper."""
        return list(SAMPLES).index(self.name) + 1

    @property
    def label(self) -> str:
        """Number and what the paper calls it."""
        return f"Sample {self.number} ({SAMPLES[self.name]})"

    @property
    def scale(self) -> float:
        """Digital numbers of the frames per 1/sr of f cosθ_i."""
        return float(self.dataset.attrs[SCALE])

    @property
    def position(self) -> np.ndarray:
        """Camera position of each geometry, shape (G,)."""
        return np.asarray(self.dataset["group"].values)

    @property
    def held_out(self) -> np.ndarray:
        """Which geometries were predicted, shape (G,)."""
        return np.asarray(self.result.comparison["held_out"].values)

    @property
    def near_specular(self) -> np.ndarray:
        """Which geometries are within the lobe, shape (G,)."""
        return np.asarray(self.result.comparison["near_specular"].values)

    @property
    def angle(self) -> np.ndarray:
        """Angle_S_I in radians, shape (G,)."""
        return sample_angles(self.dataset)

    @property
    def intensity(self) -> np.ndarray:
        """Measured intensity, digital numbers, shape (G,)."""
        return np.asarray(self.dataset["I"].values) * self.scale

    @property
    def modelled_intensity(self) -> np.ndarray:
        """The fitted model's intensity, digital numbers, shape (G,)."""
        cosine = np.cos(self.dataset["theta_i"].values)
        values: np.ndarray = np.asarray(self.result.comparison["I_modelled"].values) * cosine * self.scale
        return values

    @property
    def dolp(self) -> np.ndarray:
        """Measured degree of polarisation, shape (G,)."""
        return np.asarray(self.result.comparison["dolp_measured"].values)

    @property
    def modelled_dolp(self) -> np.ndarray:
        """The fitted model's degree of polarisation, shape (G,)."""
        return np.asarray(self.result.comparison["dolp_modelled"].values)

    def curve(self, bistatic: float, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Intensity (digital numbers) and DoP of the fitted model at sample angles, all in radians."""
        theta_i = 0.5 * np.pi - angle
        stokes = in_plane(self.result.model, theta_i, bistatic - theta_i)
        return stokes[:, 0] * np.cos(theta_i) * self.scale, dolp(stokes)


def sample_angles(dataset: xr.Dataset) -> np.ndarray:
    """The paper's Angle_S_I = 90° − θ_i (radians, shape (G,)), θ_i < 0 where the source has crossed the normal.

    For geometries in the plane of incidence. Source and camera on the same side (φ = 180°): the one nearer to the
    normal is the one that has crossed it.
    """
    theta_i, theta_r = dataset["theta_i"].values, dataset["theta_r"].values
    crossed = (np.cos(dataset["phi"].values) < 0.0) & (theta_r > theta_i)
    return np.asarray(0.5 * np.pi - np.where(crossed, -theta_i, theta_i))


def invert(name: str, dataset: xr.Dataset, truth: DoubleGauss, *, starts: int, seed: int) -> Sample:
    """Fit the paper's way: stepwise from many starts to positions 1 and 2; the last position is left to predict.

    Parameters
    ----------
    name
        Name of the paint.
    dataset
        Measurement with the attribute :data:`SCALE`.
    truth
        The model that made it; the fit knows its options, not its parameters.
    starts, seed
        Of the search.

    Raises
    ------
    FitError
        If the data do not allow a fit.
    """
    last = np.asarray(dataset["group"].values).max()
    # few bits leave intensities of 0, relative to which an error is infinite
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        result = fit(
            dataset,
            DoubleGauss,
            options=truth.chosen,
            strategy="stepwise",
            starts=starts,
            hold_out=f"group={last}",
            seed=seed,
        )
    return Sample(name, dataset, truth, result)
