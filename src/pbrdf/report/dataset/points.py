"""Measured points as the figures draw them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from pbrdf.data.conventions import qu_from_dolp_aolp
from pbrdf.data.covariance import correlations
from pbrdf.data.schema import COVARIANCE, with_group
from pbrdf.data.select import to_brdf_scale
from pbrdf.optics.angles import within_half_turn
from pbrdf.report.dataset.quantities import Channel, polarised_quantities

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Points", "dolp_uncertainty", "error_correlation", "ratio_dolp", "ratios_of"]


@dataclass(frozen=True)
class Points:
    """What was measured, and where.

    Attributes
    ----------
    theta_i, theta_r, phi
        Degrees, shape (G,); φ within −180 … 180.
    group
        Labels as text, shape (G,).
    intensity, dolp
        Intensity on the scale of a BRDF, NaN where only ratios were measured, and degree of linear polarisation;
        ``dolp`` is None if it was not measured.
    arbitrary_scale
        Whether the intensity has an unknown constant factor.
    polarised
        What else was measured of polarised light, see :func:`pbrdf.report.dataset.quantities.polarised_quantities`.
    """

    theta_i: np.ndarray
    theta_r: np.ndarray
    phi: np.ndarray
    group: np.ndarray
    intensity: Channel
    dolp: Channel | None
    arbitrary_scale: bool
    polarised: Mapping[str, Channel] = field(default_factory=dict)

    @property
    def channels(self) -> dict[str, Channel]:
        """What was measured, by name: ``"intensity"`` and ``"dolp"``; where neither was, all of :attr:`polarised`."""
        found = {} if self.dolp is None else {"dolp": self.dolp}
        if np.isfinite(self.intensity.measured).any() or not (found or self.polarised):
            found = {"intensity": self.intensity} | found
        return found or dict(self.polarised)

    def channel(self, name: str) -> Channel:
        """One of :attr:`channels` or :attr:`polarised`."""
        return self.channels[name] if name in self.channels else self.polarised[name]

    @classmethod
    def from_dataset(cls, dataset: xr.Dataset) -> Points:
        """The points of a data set."""
        ds = to_brdf_scale(dataset)
        nothing = np.full(ds.sizes["geometry"], np.nan)

        def column(name: str) -> np.ndarray:
            return ds[name].values if name in ds else nothing

        if "mueller" in ds:
            M = ds["mueller"].values
            S = np.array(column("mueller_std") if "mueller_std" in ds else np.full(M.shape, np.nan))
            stokes, std = [M[:, i, 0] for i in range(3)], [S[:, i, 0] for i in range(3)]
            entries = {f"m{i}{j}": (M[:, i, j], S[:, i, j]) for i in range(4) for j in range(4)}
        else:
            stokes = [column(name) for name in "IQU"]
            std = [column(f"{name}_std") for name in "IQU"]
            entries = {name: (column(name), column(f"{name}_std")) for name in "IQUV"}
        entries |= ratios_of(ds)
        dolp = None
        if "dolp" in ds:
            dolp = Channel(column("dolp"), column("dolp_std"))
        elif (ratio := ratio_dolp(entries)) is not None:
            dolp = ratio
        elif np.isfinite(stokes[1]).any():
            with np.errstate(divide="ignore", invalid="ignore"):
                value = np.hypot(stokes[1], np.nan_to_num(stokes[2])) / stokes[0]
            dolp = Channel(value, dolp_uncertainty(*stokes, *std, correlation=error_correlation(ds)))
        return cls(
            theta_i=np.rad2deg(ds["theta_i"].values),
            theta_r=np.rad2deg(ds["theta_r"].values),
            phi=within_half_turn(np.rad2deg(ds["phi"].values), 180.0),
            group=with_group(ds)["group"].values.astype(str),
            intensity=Channel(stokes[0], std[0]),
            dolp=dolp,
            arbitrary_scale=ds.attrs.get("scale") == "arbitrary",
            polarised=polarised_quantities(
                {name: value for name, (value, _) in entries.items()},
                {name: spread for name, (_, spread) in entries.items()},
            ),
        )


def ratios_of(ds: xr.Dataset) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Ratios of a data set and their uncertainties by channel, ``Q_over_I`` … or ``m01_over_m00`` …

    Of DoLP and AoLP the uncertainties of Q/I and U/I are not known here.
    """
    found = {}
    for name in ("Q_over_I", "U_over_I", "V_over_I"):
        if name in ds:
            nothing = np.full(ds[name].shape, np.nan)
            found[name] = (ds[name].values, ds[f"{name}_std"].values if f"{name}_std" in ds else nothing)
    if "mueller_over_m00" in ds:
        M = ds["mueller_over_m00"].values
        known = "mueller_over_m00_std" in ds
        S = ds["mueller_over_m00_std"].values if known else np.full(M.shape, np.nan)
        for i, j in np.ndindex(4, 4):
            if i or j:
                found[f"m{i}{j}_over_m00"] = (M[:, i, j], S[:, i, j])
    if "dolp" in ds and "aolp" in ds:
        nothing = np.full(ds["dolp"].shape, np.nan)
        q, u = qu_from_dolp_aolp(1.0, ds["dolp"].values, ds["aolp"].values)
        found |= {"Q_over_I": (q, nothing), "U_over_I": (u, nothing)}
    return found


def ratio_dolp(entries: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> Channel | None:
    """Degree of linear polarisation of ratios under natural light by channel; None where Q/I is not among them."""
    for q, u in (("Q_over_I", "U_over_I"), ("m10_over_m00", "m20_over_m00")):
        if q in entries and np.isfinite(entries[q][0]).any():
            one, nothing = np.ones(entries[q][0].shape), np.full(entries[q][0].shape, np.nan)
            (Q, s_Q), (U, s_U) = entries[q], entries.get(u, (nothing, nothing))
            std = dolp_uncertainty(one, Q, U, 0.0 * one, s_Q, s_U)
            return Channel(np.hypot(Q, np.nan_to_num(U)), std)
    return None


def error_correlation(ds: xr.Dataset) -> np.ndarray | None:
    """Correlation of the errors of I, Q, U and V, shape (G, 4, 4); None where the data state no covariances."""
    return correlations(ds[COVARIANCE].values) if COVARIANCE in ds.data_vars else None


def dolp_uncertainty(
    I: np.ndarray,  # noqa: E741
    Q: np.ndarray,
    U: np.ndarray,
    s_I: np.ndarray,
    s_Q: np.ndarray,
    s_U: np.ndarray,
    *,
    correlation: np.ndarray | None = None,
) -> np.ndarray:
    """Standard uncertainty of √(Q² + U²)/I, to first order.

    U may be NaN throughout (not measured). Where Q = U = 0, where the first order fails, it is that of Q/I.
    ``correlation`` is that of the errors of I, Q, U and V, shape (G, 4, 4); None for independent ones.
    """
    U, s_U = np.nan_to_num(U), np.nan_to_num(s_U)
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.hypot(Q, U)
        cosine, sine = np.where(size > 0.0, Q / size, 1.0), np.where(size > 0.0, U / size, 0.0)
        parts = np.stack([-size / I * s_I, cosine * s_Q, sine * s_U], axis=-1)
        if correlation is None:
            variance = (parts**2).sum(axis=-1)
        else:
            # rounding may leave a fully correlated difference below 0
            variance = np.maximum(
                np.einsum("...i,...ij,...j->...", parts, correlation[..., :3, :3], parts), 0.0
            )
        values: np.ndarray = np.sqrt(variance) / np.abs(I)
        return values
