"""Data left out of a fit, and how well the fit predicts them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pbrdf.errors import FitError
from pbrdf.files.plain_numbers import number_from_text
from pbrdf.inversion.statistics import relative_errors

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["HoldOut", "Prediction", "prediction_errors"]

_KINDS = ("group", "theta_i", "theta_r", "wavelength", "fraction")


@dataclass(frozen=True)
class HoldOut:
    """Which geometries to leave out of a fit.

    Attributes
    ----------
    kind
        ``"group"``, ``"theta_i"``, ``"theta_r"`` (degrees), ``"wavelength"`` (nm) or ``"fraction"``.
    values
        The values held out; for ``"fraction"`` one number between 0 and 1, or one of per cent, ``"20%"``.
    """

    kind: str
    values: tuple[str, ...]

    @classmethod
    def parse(cls, text: str) -> HoldOut:
        """Read ``KIND=VALUE[,VALUE…]``, for example ``group=3``, ``theta_i=50`` or ``fraction=0.2``.

        Raises
        ------
        FitError
            If the text has another form.
        """
        kind, sign, rest = text.partition("=")
        values = tuple(v.strip() for v in rest.split(",") if v.strip())
        if kind.strip() not in _KINDS or not sign or not values:
            raise FitError(
                f"hold-out {text!r}: give KIND=VALUE with KIND one of {', '.join(_KINDS)}, for example group=3"
            )
        return cls(kind.strip(), values)

    def mask(self, ds: xr.Dataset, seed: int = 0) -> np.ndarray:
        """Which geometries of a data set are held out, shape (G,).

        Parameters
        ----------
        ds
            The data set.
        seed
            Seed of the choice for ``"fraction"``.

        Raises
        ------
        FitError
            If nothing or everything would be held out.
        """
        size = ds.sizes["geometry"]
        if self.kind == "fraction":
            mask = self._fraction(size, seed)
        elif self.kind == "group":
            labels = ds["group"].values
            mask = np.isin([str(v) for v in labels], self.values)
            self._require(mask, "groups", sorted({str(v) for v in labels}))
        else:
            if self.kind not in ds.coords:
                raise FitError(f"hold-out {self}: the data set has no {self.kind}")
            wavelengths = self.kind == "wavelength"
            column = ds[self.kind].values if wavelengths else np.rad2deg(ds[self.kind].values)
            wanted = np.array([self._number(v) for v in self.values])
            tolerance = 0.5 if wavelengths else 0.05
            mask = (np.abs(column[:, None] - wanted) <= tolerance).any(axis=1)
            self._require(mask, f"values of {self.kind}", [f"{v:g}" for v in np.unique(np.round(column, 2))])
        if mask.all():
            raise FitError(f"hold-out {self}: nothing is left to fit")
        return mask

    def _fraction(self, size: int, seed: int) -> np.ndarray:
        stated = self.values[0].strip()
        share = 0.01 * self._number(stated[:-1]) if stated.endswith("%") else self._number(stated)
        if len(self.values) > 1 or not 0.0 < share < 1.0:
            raise FitError(
                f"hold-out {self}: give one fraction between 0 and 1, or per cent: fraction=0.2, fraction=20%"
            )
        count = min(max(1, round(share * size)), size)
        mask = np.zeros(size, dtype=bool)
        mask[np.random.default_rng(seed).choice(size, count, replace=False)] = True
        return mask

    def _number(self, text: str) -> float:
        try:
            return number_from_text(text)
        except ValueError:
            raise FitError(f"hold-out {self}: {text!r} is not a number") from None

    def _require(self, mask: np.ndarray, what: str, available: list[str]) -> None:
        if not mask.any():
            shown = ", ".join(available[:20]) + (" …" if len(available) > 20 else "")
            raise FitError(f"hold-out {self}: no such data; the {what} are {shown}")

    def __str__(self) -> str:
        return f"{self.kind}={','.join(self.values)}"


@dataclass(frozen=True)
class Prediction:
    """Errors of predicted values, model − measured, over some geometries.

    Attributes
    ----------
    count
        Number of geometries.
    intensity_rms, intensity_median, intensity_max
        Root mean square, median of the size, and largest size of the relative error of the intensity, 1. It is
        relative to the measured value, but to no less than 5 % of the data's median: what is darker is noise.
    dolp_rms, dolp_max
        Root mean square and largest size of the error of the degree of linear polarisation, 1; NaN where no
        polarisation was measured.
    ratio_rms, ratio_max
        The same of all channels that were measured as ratios, Q/I … or m01/m00 …; NaN where none was.
    """

    count: int
    intensity_rms: float
    intensity_median: float
    intensity_max: float
    dolp_rms: float
    dolp_max: float
    ratio_rms: float = math.nan
    ratio_max: float = math.nan


def prediction_errors(comparison: xr.Dataset, where: np.ndarray) -> Prediction:
    """Errors over the geometries of a mask, from the comparison that a fit returns."""
    nan = float("nan")

    def errors(channel: str, relative: bool) -> np.ndarray:
        if f"{channel}_measured" not in comparison:
            return np.empty(0)
        modelled, measured = (comparison[f"{channel}_{kind}"].values for kind in ("modelled", "measured"))
        error = (relative_errors(modelled, measured) if relative else modelled - measured)[where]
        values: np.ndarray = error[np.isfinite(error)]
        return values

    intensity, dolp = errors("I", relative=True), errors("dolp", relative=False)
    measured = [str(name).removesuffix("_measured") for name in comparison if "_over_" in str(name)]
    ratios = np.concatenate(
        [np.empty(0), *(errors(name, relative=False) for name in dict.fromkeys(measured))]
    )

    def rms(x: np.ndarray) -> float:
        return float(np.sqrt((x**2).mean())) if x.size else nan

    return Prediction(
        count=int(where.sum()),
        intensity_rms=rms(intensity),
        intensity_median=float(np.median(np.abs(intensity))) if intensity.size else nan,
        intensity_max=float(np.abs(intensity).max()) if intensity.size else nan,
        dolp_rms=rms(dolp),
        dolp_max=float(np.abs(dolp).max()) if dolp.size else nan,
        ratio_rms=rms(ratios),
        ratio_max=float(np.abs(ratios).max()) if ratios.size else nan,
    )
