"""A data set as the fit sees it: geometries, channels, values and weights as plain arrays."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pbrdf.data.conventions import qu_from_dolp_aolp
from pbrdf.data.covariance import correlations
from pbrdf.data.schema import COVARIANCE, NORMALISED, VARIABLES, is_ratio, std_name, with_group
from pbrdf.errors import FitError
from pbrdf.inversion.noise import Noise, NoiseModel
from pbrdf.optics.angles import rounded_azimuth
from pbrdf.optics.stokes import STOKES

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["SINGULAR", "Measurements", "Observations", "measurements", "noise_in_words"]

#: Correlation matrices whose smallest eigenvalue is no more than this are singular but for rounding.
SINGULAR = 1e-12


@dataclass(frozen=True)
class Observations:
    """Measured values on the scale of a BRDF and their standard uncertainties.

    Attributes
    ----------
    theta_i, theta_r, phi
        Angles in radians, shape (G,).
    channels
        What is compared: ``I``, ``Q``, ``U``, ``V`` (radiance per unit irradiance of the stated illumination),
        ``dolp``, ``Q_over_I`` …, Mueller elements ``m00`` … ``m33``, or those over m00, ``m01_over_m00`` …
    values, std
        Shape (C, G). Not measured: ``values`` 0 and ``std`` infinite.
    illumination
        Stokes vector of the source.
    std_known
        Whether every standard uncertainty comes from the data set; if not, their scale is a guess.
    group, wavelength
        Labels and wavelengths (nm) of the geometries, shape (G,); None where there are none.
    scale
        Factor that brought the data to the scale of a BRDF, shape (G,); None for 1.
    correlation
        Correlation matrix of the errors of the channels at each geometry, shape (G, C, C); None where they are
        independent. Only entries between measured channels count.
    unstated
        How many values were left out as no uncertainty is stated of them, though of others of their channel.
    """

    theta_i: np.ndarray
    theta_r: np.ndarray
    phi: np.ndarray
    channels: tuple[str, ...]
    values: np.ndarray
    std: np.ndarray
    illumination: tuple[float, float, float, float]
    std_known: bool
    group: np.ndarray | None = None
    wavelength: np.ndarray | None = None
    scale: np.ndarray | None = None
    correlation: np.ndarray | None = None
    unstated: int = 0

    @classmethod
    def from_dataset(
        cls, ds: xr.Dataset, noise: Noise | None = None, objective: str = "stokes"
    ) -> Observations:
        """Take what was measured from a valid data set.

        DoLP with AoLP becomes Q/I and U/I, which no error of the intensity reaches (their uncertainties and their
        correlation propagated; where that of AoLP is not stated, both are as uncertain as DoLP). DoLP alone and
        other ratios are compared as they are.
        Uncertainties and covariances of the data set are used where given unless ``noise`` states others.

        Parameters
        ----------
        ds
            Data set of the project's schema, see :mod:`pbrdf.data.schema`.
        noise
            Stated noise, independent between the channels; None takes the data set's uncertainties and covariances,
            and :class:`NoiseModel` where there are none.
        objective
            ``"stokes"``: signed components as measured; ``"paper"``: intensity and DoLP with equal weights, each in
            units of its root mean square (Zhang et al. 2017 say no more than "equal weights"), uncertainties and
            covariances set aside.

        Raises
        ------
        FitError
            If nothing was measured, or a covariance is singular.
        """
        columns = {str(name): ds[name].values for name in ds.data_vars}
        found = measurements(columns, ds["theta_i"].values, ds.attrs["quantity"], noise, objective)
        result = cls(
            theta_i=ds["theta_i"].values,
            theta_r=ds["theta_r"].values,
            phi=ds["phi"].values,
            channels=found.channels,
            values=np.stack(found.values),
            std=np.stack(found.std),
            illumination=tuple(float(v) for v in ds.attrs["illumination"]),  # type: ignore[arg-type]
            std_known=bool(found.std_known),
            group=with_group(ds)["group"].values,
            wavelength=ds["wavelength"].values if "wavelength" in ds.coords else None,
            scale=found.scale,
            unstated=int(found.unstated),
        )
        if noise is not None or objective == "paper":
            return result
        if found.turned is not None:
            return result._with_turned(found.turned)
        if COVARIANCE not in ds.data_vars:
            return result
        index = [STOKES.index(name) for name in found.channels]
        correlation = correlations(ds[COVARIANCE].values)[:, index][:, :, index]
        if not np.tril(correlation, -1).any():
            return result
        return replace(result, correlation=correlation)._regular(
            "the covariance at index {} is singular, as if some combination of {} were known exactly: correct it, or "
            "state a noise, which replaces all uncertainties"
        )

    def _with_turned(self, correlation: np.ndarray) -> Observations:
        """With the correlation of Q/I and U/I, shape (G,), 0 where it is not known."""
        if not correlation.any():
            return self
        q, u = self.channels.index("Q_over_I"), self.channels.index("U_over_I")
        matrix = np.broadcast_to(
            np.eye(len(self.channels)), (len(correlation), *[len(self.channels)] * 2)
        ).copy()
        matrix[:, q, u] = matrix[:, u, q] = correlation
        return replace(self, correlation=matrix)

    @property
    def weights(self) -> np.ndarray:
        """1/std, 0 where nothing was measured; shape (C, G)."""
        return 1.0 / self.std

    @cached_property
    def factor(self) -> np.ndarray:
        """Lower triangular L with L Lᵀ the correlation of the measured channels, shape (G, C, C).

        In the rows and columns of channels that were not measured it is the identity.
        """
        return self._cholesky()

    def _cholesky(self) -> np.ndarray:
        size = len(self.channels)
        measured = np.isfinite(self.std).T
        if self.correlation is None:
            return np.broadcast_to(np.eye(size), (len(measured), size, size))
        return np.linalg.cholesky(self._measured_correlation)

    @cached_property
    def whitening(self) -> np.ndarray:
        """Lower triangular W with WᵀW the inverse covariance of the measured channels, shape (C, C, G).

        W times the residuals are independent with variance 1; 0 where nothing was measured.
        """
        # of many geometries large: only what is returned stays
        matrices = np.linalg.inv(self._cholesky())
        matrices *= self.weights.T[:, None, :]
        return np.ascontiguousarray(matrices.transpose(1, 2, 0))

    @property
    def _measured_correlation(self) -> np.ndarray:
        assert self.correlation is not None
        measured = np.isfinite(self.std).T
        both = measured[:, :, None] & measured[:, None, :]
        return np.where(both, self.correlation, np.eye(len(self.channels)))

    def _regular(self, message: str) -> Observations:
        """Itself, if every correlation matrix is positive definite; else FitError with the row and the channels."""
        bad = np.flatnonzero(~(np.linalg.eigvalsh(self._measured_correlation)[:, 0] > SINGULAR))
        if bad.size:
            measured = [
                c for c, std in zip(self.channels, self.std[:, bad[0]], strict=True) if np.isfinite(std)
            ]
            raise FitError(message.format(bad[0], ", ".join(measured)))
        return self

    @property
    def count(self) -> int:
        """Number of measured values."""
        return int(np.isfinite(self.std).sum())

    @property
    def typical_intensity(self) -> float:
        """Median of what was measured of the intensity above 0; NaN where there is nothing."""
        intensity = [self.values[c] for c, name in enumerate(self.channels) if name in ("I", "m00")]
        positive = np.concatenate(intensity or [np.empty(0)])
        positive = positive[positive > 0.0]
        return float(np.median(positive)) if positive.size else math.nan

    def distinct(self, by_group: bool = False, by_wavelength: bool = False) -> tuple[int, int]:
        """Numbers of different geometries, and of different values of a model there: one for each measured channel.

        Groups and wavelengths make a difference where parameters are free, or held, for each.
        """
        measured = np.isfinite(self.std)
        used = measured.any(axis=0)
        columns = [np.round(angle[used], 9) for angle in (self.theta_i, self.theta_r)]
        columns.append(rounded_azimuth(self.phi[used]))
        for wanted, column in ((by_group, self.group), (by_wavelength, self.wavelength)):
            if wanted and column is not None:
                columns.append(np.unique(column[used], return_inverse=True)[1].astype(float))
        places, number = np.unique(np.stack(columns, axis=1), axis=0, return_inverse=True)
        values = [len(np.unique(number.ravel()[channel])) for channel in measured[:, used]]
        return len(places), sum(values)

    @property
    def polarised(self) -> bool:
        """Whether any channel carries polarisation."""
        return any(name not in ("I", "m00") for name in self.channels)

    def subset(self, keep: np.ndarray | slice) -> Observations:
        """Only some geometries; ``keep`` is a mask of shape (G,), an index array or a slice."""
        chosen: dict[str, Any] = {
            name: None if column is None else column[keep]
            for name in ("theta_i", "theta_r", "phi", "group", "wavelength", "scale", "correlation")
            for column in [getattr(self, name)]
        }
        return replace(self, values=self.values[:, keep], std=self.std[:, keep], **chosen)

    def with_covariance(self, covariance: np.ndarray) -> Observations:
        """The same data with the full covariance of the channels at each geometry.

        Parameters
        ----------
        covariance
            Shape (G, C, C) in the order of ``channels``, on the data's own scale; what belongs to a value that was
            not measured is not looked at.

        Raises
        ------
        FitError
            If the shape is another, or a matrix is not symmetric and positive definite.
        """
        covariance = np.asarray(covariance, dtype=float)
        size = len(self.channels)
        if covariance.shape != (self.values.shape[1], size, size):
            raise FitError(
                f"covariance has shape {covariance.shape}: it must be ({self.values.shape[1]}, {size}, {size}), for "
                f"every geometry the covariance of {', '.join(self.channels)}"
            )
        measured = np.isfinite(self.std)
        both = measured.T[:, :, None] & measured.T[:, None, :]
        covariance = np.where(both, covariance, np.eye(size))
        with np.errstate(invalid="ignore"):
            uneven = np.abs(covariance - covariance.transpose(0, 2, 1)).max(axis=(1, 2))
        diagonal = np.einsum("gcc->cg", covariance)
        proper = np.isfinite(covariance).all(axis=(1, 2)) & (diagonal > 0.0).all(axis=0)
        proper &= uneven <= 1e-9 * np.abs(covariance).max(axis=(1, 2))
        message = "covariance at index {} is not symmetric and positive definite"
        if not proper.all():
            raise FitError(message.format(int(np.argmin(proper))))
        scale = np.ones(diagonal.shape)
        if self.scale is not None:
            scale[[not is_ratio(name) for name in self.channels]] = self.scale
        return replace(
            self,
            std=np.where(measured, np.sqrt(diagonal) * scale, np.inf),
            std_known=True,
            correlation=covariance / np.sqrt(diagonal.T[:, :, None] * diagonal.T[:, None, :]),
        )._regular(message)


class Measurements(NamedTuple):
    """What was measured, of one data set or of many at once: every array has the leading dimensions of the data.

    Attributes
    ----------
    channels
        See :class:`Observations`: those of which any data set holds a value.
    values, std
        For each channel, shape (…, G); not measured: 0 and infinite.
    scale
        Factor that brought the data to the scale of a BRDF, shape (…, G).
    std_known, unstated
        See :class:`Observations`, shape (…).
    turned
        Correlation of Q/I and U/I made of DoLP and AoLP, shape (…, G); None where there are none.
    """

    channels: tuple[str, ...]
    values: list[np.ndarray]
    std: list[np.ndarray]
    scale: np.ndarray
    std_known: np.ndarray
    unstated: np.ndarray
    turned: np.ndarray | None


def measurements(
    columns: Mapping[str, np.ndarray], theta_i: np.ndarray, quantity: str, noise: Noise | None, objective: str
) -> Measurements:
    """What was measured and how uncertain it is, on the scale of a BRDF.

    Parameters
    ----------
    columns
        The data variables of the schema by name, shape (…, G), Mueller matrices (…, G, 4, 4): leading dimensions count
        data sets.
    theta_i
        Zenith angle of the source, radians; its shape broadcasts to (…, G).
    quantity
        What the values are, see :mod:`pbrdf.data.schema`.
    noise, objective
        See :meth:`Observations.from_dataset`.

    Raises
    ------
    FitError
        If nothing was measured.
    """
    divisor: np.ndarray | None = None
    if quantity == "reflectance_factor":
        divisor = np.array(np.pi)
    elif quantity not in ("brdf", NORMALISED):
        divisor = np.cos(theta_i)
    scale = np.ones(theta_i.shape) if divisor is None else np.ones(theta_i.shape) / divisor

    def on_scale(name: str, values: np.ndarray) -> np.ndarray:
        if divisor is None or is_ratio(name):
            return values
        found: np.ndarray = values / (divisor[..., None, None] if name == "mueller" else divisor)
        return found

    present = [n for n in VARIABLES if n in columns and not np.isnan(columns[n]).all()]
    if not present:
        raise FitError("the data set holds no measured value")
    measured = {name: on_scale(name, columns[name]) for name in present}
    stated = {
        name: on_scale(name, columns[std_name(name)])
        if std_name(name) in columns
        else np.full(columns[name].shape, np.nan)
        for name in present
    }
    values: dict[str, np.ndarray] = {}
    std: dict[str, np.ndarray] = {}
    for name in present:
        if name.startswith("mueller"):
            for i, j in np.ndindex(4, 4):
                element = name.replace("mueller", f"m{i}{j}")
                if element != "m00_over_m00":  # 1 says nothing
                    values[element] = measured[name][..., i, j]
                    std[element] = stated[name][..., i, j]
        elif name not in ("dolp", "aolp"):
            values[name], std[name] = measured[name], stated[name]
    turned = None
    if "dolp" in present and "aolp" in present:
        values["Q_over_I"], values["U_over_I"] = qu_from_dolp_aolp(1.0, measured["dolp"], measured["aolp"])
        std["Q_over_I"], std["U_over_I"], turned = _propagated(
            measured["dolp"], measured["aolp"], stated["dolp"], stated["aolp"]
        )
    if "dolp" in present:
        # of light without a measured angle the degree still counts
        angle = np.isfinite(measured["aolp"]) if "aolp" in present else False
        values["dolp"] = np.where(angle, np.nan, measured["dolp"])
        std["dolp"] = stated["dolp"]
    any_of_them = next(iter(values.values()))
    intensity = values.get("m00", values.get("I", np.full(any_of_them.shape, np.nan)))
    model = noise or NoiseModel()
    if objective == "paper":
        values, std = _intensity_and_dolp(values)
    known = np.ones(any_of_them.shape[:-1], dtype=bool)
    unstated = np.zeros(any_of_them.shape[:-1], dtype=int)
    finite = {name: np.isfinite(v) for name, v in values.items()}
    channels = tuple(name for name in values if finite[name].any())
    for name in channels:
        given = np.isfinite(std[name]) & (noise is None or objective == "paper")
        if noise is None and objective == "stokes":
            usable = given & finite[name]
            some = usable.any(axis=-1)
            if some.all() and usable.sum() == finite[name].sum():
                continue
            # a value without an uncertainty among others that have one is left out, not the others' uncertainties
            left_out = finite[name] & ~given & some[..., None]
            unstated = unstated + left_out.sum(axis=-1)
            values[name] = np.where(left_out, np.nan, values[name])
            some = some | ~finite[name].any(axis=-1)
            if some.all():
                continue
            known &= some | model.absolute_scale
        else:
            known &= objective == "stokes" and model.absolute_scale
        std[name] = np.where(given, std[name], model.standard_uncertainty(name, intensity, scale))
    for name in channels:
        absent = ~(np.isfinite(values[name]) & np.isfinite(std[name]))
        if absent.any():
            values[name] = np.where(absent, 0.0, values[name])
            std[name] = np.where(absent, np.inf, std[name])
    chosen, uncertain = [values[name] for name in channels], [std[name] for name in channels]
    return Measurements(channels, chosen, uncertain, scale, known, unstated, turned)


def _intensity_and_dolp(
    columns: dict[str, np.ndarray],
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Intensity and DoLP with equal weights in units of their root mean squares."""
    if "m00" in columns:
        columns = {"I": columns["m00"], "Q": columns["m10"], "U": columns["m20"]}
    elif "m10_over_m00" in columns:
        ratios = {"Q_over_I": columns["m10_over_m00"], "U_over_I": columns["m20_over_m00"]}
        columns = {name: v for name, v in columns.items() if name == "I"} | ratios
    if "I" not in columns or not columns.keys() & {"Q", "Q_over_I", "dolp"}:
        raise FitError('objective "paper": intensity and linear polarisation must have been measured')
    dolp = columns.get("dolp")
    if dolp is None and "Q_over_I" in columns:
        dolp = np.hypot(columns["Q_over_I"], columns.get("U_over_I", np.zeros(1)))
    elif dolp is None:
        with np.errstate(divide="ignore", invalid="ignore"):
            dolp = np.hypot(columns["Q"], columns.get("U", np.zeros(1))) / columns["I"]
        dolp = np.where(columns["I"] > 0.0, dolp, np.nan)
    pair = {"I": columns["I"], "dolp": dolp}
    with np.errstate(invalid="ignore", divide="ignore"):
        squares = {name: np.isfinite(v) * np.nan_to_num(v) ** 2 for name, v in pair.items()}
        sizes = {
            name: np.sqrt(square.sum(axis=-1) / np.isfinite(pair[name]).sum(axis=-1))
            for name, square in squares.items()
        }
    return pair, {name: np.broadcast_to(sizes[name][..., None], v.shape) for name, v in pair.items()}


def _propagated(
    dolp: np.ndarray, aolp: np.ndarray, s_dolp: np.ndarray, s_aolp: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Standard uncertainties of Q/I = p cos2ψ and U/I = p sin2ψ from independent ones of p and ψ; their correlation.

    The degree that the angle's uncertainty is multiplied with is no smaller than its own uncertainty: near p = 0 first
    order would take Q/I and U/I for known exactly. Where the angle's is not stated the errors are as large in either
    direction.
    """
    c, s = np.cos(2.0 * aolp), np.sin(2.0 * aolp)
    along = s_dolp**2
    across = (2.0 * np.maximum(dolp, s_dolp) * s_aolp) ** 2
    across = np.where(np.isnan(s_aolp), along, across)
    s_q, s_u = np.sqrt(along * c * c + across * s * s), np.sqrt(along * s * s + across * c * c)
    with np.errstate(invalid="ignore"):
        correlation = (along - across) * c * s / (s_q * s_u)
    return s_q, s_u, np.nan_to_num(correlation)


def noise_in_words(noise: Noise | None, data: Observations) -> str:
    """Where the standard uncertainties of fitted data come from."""
    ratios_alone = not {"I", "m00"} & set(data.channels)
    if noise is not None:
        return f"stated: {noise.of_ratios() if ratios_alone else noise}"
    if data.std_known:
        kind = "standard uncertainties" if data.correlation is None else "covariances"
        left_out = "" if data.unstated == 0 else f"; values without one are left out: {data.unstated}"
        return f"{kind} of the data set{left_out}"
    assumed = NoiseModel()
    words = assumed.of_ratios() if ratios_alone else str(assumed)
    return f"assumed, as the data set states no (or not every) uncertainty: {words}"
