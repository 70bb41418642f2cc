"""A data set in a few sentences."""

from __future__ import annotations

import ast
import re
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pbrdf.data.covariance import correlations
from pbrdf.data.origin import origin_of
from pbrdf.data.schema import COVARIANCE, NATURAL_LIGHT, NORMALISED, only_ratios, with_group, written
from pbrdf.data.select import measured_channels
from pbrdf.errors import visible

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "cautions",
    "columns_in_words",
    "describe",
    "illumination_in_words",
    "on_the_command_line",
    "short_name",
    "wavelengths_in_words",
]

_QUANTITIES = {
    "brdf": "BRDF, 1/sr",
    "reflectance_factor": "reflectance factor, 1",
    "radiance": "radiance, arbitrary units",
    "dn": "digital numbers of a camera",
    NORMALISED: "ratios, 1",
}


def describe(ds: xr.Dataset) -> list[str]:
    """Lines that say what a data set holds: geometries, channels, ranges of the angles, light."""
    lines = [visible(" ".join(str(ds.attrs["title"]).split()))] if ds.attrs.get("title") else []
    channels = measured_channels(ds)
    uncertain = [name for name in channels if f"{name}_std" in ds.data_vars]
    groups = np.unique(with_group(ds)["group"].values)
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
    quantity = NORMALISED if only_ratios(channels) else ds.attrs["quantity"]
    lines.append(
        f"{kind} {', '.join(map(written, channels))} ({_QUANTITIES[quantity]}), {illumination_in_words(ds)}; "
        f"standard uncertainties of {', '.join(map(written, uncertain)) if uncertain else 'nothing'}"
        f"{_covariances_in_words(ds)}"
    )
    if readings := ds.attrs.get("readings"):
        lines.append(f"from readings behind an analyser: {_listed(list(readings))}")
    return lines


def short_name(name: str, dataset: xr.Dataset) -> str:
    """What to call data in a title: the file's name and the wavelengths."""
    wavelengths = wavelengths_in_words(dataset)
    return Path(name).name + (f", {wavelengths}" if wavelengths.endswith("nm") else "")


def columns_in_words(ds: xr.Dataset) -> list[str]:
    """Lines that say what each column of the file was taken for, and which were not used; none for another format."""
    origin = origin_of(ds)
    if origin is None or not origin.meanings:
        return []
    used = [f"{name} → {meaning}" for name, meaning in origin.meanings if meaning]
    unused = [name for name, meaning in origin.meanings if not meaning and name not in origin.dropped]
    lines = [", ".join(used)]
    if unused:
        lines.append(f"not used: {', '.join(unused)}")
    if origin.dropped:
        lines.append(f"left out as asked: {', '.join(origin.dropped)}")
    return lines


def on_the_command_line(sentence: str) -> str:
    """Turn the advice to use arguments of Python into advice to use the options of the command line."""

    def option(match: re.Match[str]) -> str:
        pairs = re.findall(rf"({_TEXT}): ({_TEXT}|…)", match["pairs"])
        return " ".join(_option(match["name"], f"{_plain(key)}={_plain(value)}") for key, value in pairs)

    sentence = re.sub(
        rf"\b(?P<name>column|where|unit)=\{{(?P<pairs>{_TEXT}: (?:{_TEXT}|…)(?:, {_TEXT}: (?:{_TEXT}|…))*)\}}",
        option,
        sentence,
    )
    sentence = re.sub(rf"\bignore=\[({_TEXT})\]", lambda match: _option("ignore", _plain(match[1])), sentence)
    sentence = sentence.replace("skip_invalid=True", "--skip-invalid")
    return re.sub(
        r"\b(azimuth|illumination|coverage)=(?:'([^']*)'|([\d.]+))",
        lambda match: f"--{match[1]} {match[2] or match[3]}",
        sentence,
    )


#: A text as Python writes it.
_TEXT = r"(?:'(?:[^'\\]|\\.)*'|\"(?:[^\"\\]|\\.)*\")"


def _plain(text: str) -> str:
    return text if text == "…" else str(ast.literal_eval(text))


def _option(name: str, value: str) -> str:
    return f"--{name}{'=' if value.startswith('-') else ' '}{_quoted(value)}"


def _quoted(text: str) -> str:
    """A word of a command line, in quotation marks where a shell needs them."""
    return shlex.quote(text) if re.search(r"[^\w@%+=:,./…°-]", text) else text


def cautions(ds: xr.Dataset) -> list[str]:
    """Sentences on what the reader of the file assumed or left out."""
    origin = origin_of(ds)
    sentences = [str(s) for s in ds.attrs.get("assumptions", ())]
    sentences += [on_the_command_line(s) for s in (origin.remarks if origin else ())]
    if skipped := ds.attrs.get("skipped_rows"):
        sentences.append(f"{skipped} rows without a usable measurement were left out.")
    sentences = [*map(visible, sentences)]
    return [s[:1].upper() + s[1:] + ("" if s.endswith(".") else ".") for s in sentences]


def illumination_in_words(ds: xr.Dataset) -> str:
    """``natural light``, or the Stokes vector of the source."""
    if "mueller" in ds.data_vars or ("mueller_over_m00" in ds.data_vars and "I" not in ds.data_vars):
        return "full Mueller matrices" if "mueller" in ds.data_vars else "normalised Mueller matrices"
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
