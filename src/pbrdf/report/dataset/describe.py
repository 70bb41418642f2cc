"""A data set in a few sentences."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pbrdf.data.covariance import correlations
from pbrdf.data.schema import COVARIANCE, NATURAL_LIGHT
from pbrdf.data.select import measured_channels
from pbrdf.errors import visible

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["cautions", "describe", "illumination_in_words", "short_name", "wavelengths_in_words"]

_QUANTITIES = {
    "brdf": "BRDF, 1/sr",
    "reflectance_factor": "reflectance factor, 1",
    "radiance": "radiance, arbitrary units",
    "dn": "digital numbers of a camera",
}


def describe(ds: xr.Dataset) -> list[str]:
    """Lines that say what a data set holds: geometries, channels, ranges of the angles, light."""
    lines = [visible(" ".join(str(ds.attrs["title"]).split()))] if ds.attrs.get("title") else []
    channels = measured_channels(ds)
    uncertain = [name for name in channels if f"{name}_std" in ds.data_vars]
    groups = np.unique(ds["group"].values)
    lines.append(
        f"{ds.sizes['geometry']} geometries in {len(groups)} group{'s' if len(groups) > 1 else ''} "
        f"({_listed([str(g) for g in groups])}); {wavelengths_in_words(ds)}"
    )
    for name, words in (("theta_i", "incidence"), ("theta_r", "viewing"), ("phi", "azimuth")):
        degrees = np.rad2deg(ds[name].values)
        low, high = degrees.min(), degrees.max()
        span = f"{low:.4g}°" if high - low < 1e-6 else f"{low:.4g}° … {high:.4g}°"
        lines.append(f"{words} {name}: {span}")
    kind = "simulated" if ds.attrs.get("simulated") else "measured"
    lines.append(
        f"{kind} {', '.join(channels)} ({_QUANTITIES[ds.attrs['quantity']]}), {illumination_in_words(ds)}; "
        f"standard uncertainties of {', '.join(uncertain) if uncertain else 'nothing'}"
        f"{_covariances_in_words(ds)}"
    )
    return lines


def short_name(name: str, dataset: xr.Dataset) -> str:
    """What to call data in a title: the file's name and the wavelengths."""
    wavelengths = wavelengths_in_words(dataset)
    return Path(name).name + (f", {wavelengths}" if wavelengths.endswith("nm") else "")


def cautions(ds: xr.Dataset) -> list[str]:
    """Sentences on what the reader of the file assumed or left out."""
    sentences = [str(s) for s in ds.attrs.get("assumptions", ())]
    if skipped := ds.attrs.get("skipped_rows"):
        sentences.append(f"{skipped} rows without a usable measurement were left out.")
    sentences = [*map(visible, sentences)]
    return [s[:1].upper() + s[1:] + ("" if s.endswith(".") else ".") for s in sentences]


def illumination_in_words(ds: xr.Dataset) -> str:
    """``natural light``, or the Stokes vector of the source."""
    if "mueller" in ds.data_vars:
        return "full Mueller matrices"
    vector = tuple(float(x) for x in ds.attrs["illumination"])
    if vector == NATURAL_LIGHT:
        return "natural light"
    return f"illumination ({', '.join(f'{x:g}' for x in vector)})"


def wavelengths_in_words(ds: xr.Dataset) -> str:
    """The wavelengths in nm, or that none is stated."""
    if "wavelength" not in ds.coords:
        return "wavelength not stated"
    known = np.unique(ds["wavelength"].values)
    known = known[np.isfinite(known)]
    if not known.size:
        return "wavelength not stated"
    return f"{_listed([f'{w:g}' for w in known])} nm"


def _covariances_in_words(ds: xr.Dataset) -> str:
    """At how many geometries covariances are known, and the largest correlation; empty without any."""
    if COVARIANCE not in ds.data_vars:
        return ""
    i, j = np.triu_indices(4, 1)
    values = ds[COVARIANCE].values
    rows = np.isfinite(values[:, i, j]).any(axis=1)
    if not rows.any():
        return ""
    largest = np.abs(correlations(values)[:, i, j]).max()
    where = "" if rows.all() else f" at {rows.sum()} geometries"
    return f" and their covariances{where} (correlations up to {largest:.2g})"


def _listed(names: list[str]) -> str:
    if len(names) > 6:
        return f"{names[0]}, {names[1]} … {names[-1]}"
    return ", ".join(names)
