"""Measured values beside those of a model, and which of them lie in the specular lobe."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pbrdf.data.schema import is_ratio
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.problem import Space, predict
from pbrdf.models.base import Model
from pbrdf.optics.half_difference import facet_tilt

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["NEAR_SPECULAR", "compare", "compared_channels", "near_specular_tilt"]

#: A facet tilted by less than this many widths of the lobe, but at most by this angle, counts as near-specular.
NEAR_SPECULAR, NEAR_SPECULAR_LIMIT = 4.0, math.radians(15.0)


def near_specular_tilt(model: Model) -> float:
    """Facet tilt in radians below which a geometry counts as near-specular."""
    return min(math.atan(NEAR_SPECULAR * float(model.lobe_width())), NEAR_SPECULAR_LIMIT)


def compared_channels(channels: Sequence[str]) -> tuple[str, ...]:
    """Channels that are predicted beside measured ones: the same, and those of which intensity and DoLP are made."""
    return tuple(dict.fromkeys((*channels, *(("m00", "m10", "m20") if "m00" in channels else "IQU"))))


def compare(
    space: Space, unknowns: np.ndarray, observations: Observations, dataset: xr.Dataset
) -> xr.Dataset:
    """Measured, modelled and residual values (model − measured) of every channel on the scale of a BRDF.

    Parameters
    ----------
    space, unknowns
        The model with its nuisance terms and split parameters; ``unknowns`` has the shape (P,).
    observations, dataset
        The same data in both forms.

    Returns
    -------
    Dataset
        ``<channel>_measured``, ``_modelled``, ``_residual`` and ``_std`` over ``geometry``; intensity and DoLP are
        always among the modelled ones, and DoLP among the measured ones where it can be computed. ``facet_tilt`` is
        the tilt in radians of the facet that mirrors source into viewer.
    """
    import xarray as xr

    everything = predict(space, unknowns, observations, compared_channels(observations.channels))
    if "m00" in observations.channels:
        everything |= {"I": everything["m00"], "Q": everything["m10"], "U": everything["m20"]}
    with np.errstate(divide="ignore", invalid="ignore"):
        everything["dolp"] = np.hypot(everything["Q"], everything["U"]) / everything["I"]
    present = np.isfinite(observations.std)
    measured = {
        name: np.where(present[c], observations.values[c], np.nan)
        for c, name in enumerate(observations.channels)
    }
    std = dict(zip(observations.channels, observations.std, strict=True))
    if "m00" in measured:
        measured["I"], std["I"] = measured["m00"], std["m00"]
    if "dolp" not in measured:
        intensity, q, u = (
            measured.get(a, measured.get(b)) for a, b in (("I", "m00"), ("Q", "m10"), ("U", "m20"))
        )
        q_ratio, u_ratio = (
            measured.get(f"{a}_over_I", measured.get(f"{b}_over_m00"))
            for a, b in (("Q", "m10"), ("U", "m20"))
        )
        if q_ratio is not None:
            measured["dolp"] = np.hypot(q_ratio, 0.0 if u_ratio is None else u_ratio)
        elif intensity is not None and q is not None:
            with np.errstate(divide="ignore", invalid="ignore"):
                measured["dolp"] = np.hypot(q, 0.0 if u is None else u) / intensity
    result = xr.Dataset(
        coords={name: dataset[name] for name in dataset.coords if name not in ("stokes_out", "stokes_in")}
    )
    for name in dict.fromkeys((*observations.channels, "I", "dolp")):
        unit = "1" if is_ratio(name) else "1/sr"
        columns = {"modelled": everything[name]}
        if name in measured:
            columns |= {"measured": measured[name], "residual": everything[name] - measured[name]}
        if name in std:
            columns["std"] = np.where(np.isfinite(std[name]), std[name], np.nan)
        for kind, column in columns.items():
            result[f"{name}_{kind}"] = ("geometry", column, {"units": unit})
    tilt = facet_tilt(observations.theta_i, observations.theta_r, observations.phi)
    result["facet_tilt"] = ("geometry", tilt, {"units": "rad"})
    # what the data were before they were brought to the scale of a BRDF
    result.attrs.update(
        {name: dataset.attrs[name] for name in ("quantity", "scale") if name in dataset.attrs}
    )
    return result
