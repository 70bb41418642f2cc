"""Files of EPFL's material database (RGL), ``.bsdf``: tensor files of measured BRDFs over adaptive directions.

J. Dupuy, W. Jakob, "An adaptive parameterization for efficient material acquisition and rendering" (ACM Transactions
on Graphics 37(6), 274 (2018)); the meaning of the fields is that of their reader ``brdf-loader`` and of Mitsuba's
plugin ``measured``. A tensor file (:mod:`pbrdf.data.formats.tensor_file`) with the fields ``phi_i`` (P,) and
``theta_i`` (T,), the measured incidences in radians; ``vndf`` (P, T, Hv, Wv), densities of visible microfacet
normals; ``ndf`` and ``sigma``, two more tables; and ``spectra`` (P, T, wavelengths, H, W) with ``wavelengths`` in nm,
or ``rgb`` (P, T, 3, H, W).

The last two axes of every table run over the unit square, of ``ndf``, ``sigma`` and ``vndf`` over (azimuth, zenith)
with u = √(2θ/π) and v = (φ + π)/2π. A sample of ``spectra`` at (x, y) of its square belongs to the microfacet normal
m to which the density ``vndf`` maps (x, y): y by its marginal distribution, then x by its conditional one, both of a
density that is bilinear between the nodes. The light is at (θ_i, φ_i), the viewer where m mirrors it; all directions
point away from the surface, and of isotropic materials (two φ_i at most) the azimuth of m is counted from that of the
light. Where ``jacobian`` is not 0 a sample times ndf(m)/(4 σ(i)) is f_r cosθ_o, which the reader divides by the
cosine.

The rows are the samples themselves, with nothing interpolated: of isotropic materials T·H·W directions at each
wavelength.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from pbrdf.data.formats.declaration import Reader
from pbrdf.data.formats.merl import COLOURS
from pbrdf.data.formats.scalar_rows import incidence_groups, scalar_rows
from pbrdf.data.formats.tensor_file import is_tensor_file, read_tensors
from pbrdf.data.formats.thinning import thinning, thinning_in_words
from pbrdf.data.select import match_wavelengths
from pbrdf.errors import DataError
from pbrdf.files.text import first_bytes

__all__ = ["READER", "read_rgl"]

_Array = NDArray[np.float64]
#: Largest count of φ_i of an isotropic material.
_ISOTROPIC = 2
#: Samples of one slice closer than this are one direction, radians: all those at the normal are.
_SAME = 1e-6


def read_rgl(
    path: str | Path, *, wavelength: float | Sequence[float] | None = None, every: int | None = None
) -> xr.Dataset:
    """Read a scalar BRDF from a ``.bsdf`` file of EPFL's database.

    Parameters
    ----------
    path
        The file.
    wavelength
        Wavelength or wavelengths to take, in nm; all if None.
    every
        Take one sample in this many along both axes of the viewing directions; 1 takes all. None takes as many as
        leave no more than :data:`pbrdf.data.formats.thinning.MOST_CELLS` directions.

    Returns
    -------
    xarray.Dataset
        ``I`` as a BRDF in 1/sr under natural light at the directions of the samples; ``group`` is θ_i in whole degrees,
        φ_i in degrees of anisotropic materials, or the colour. Directions below the horizon are left out.

    Raises
    ------
    DataError
        If the file is no tensor file, is truncated, lacks a field, or one has another shape.
    """
    path = Path(path)
    fields = read_tensors(path)
    coloured = "rgb" in fields and "spectra" not in fields
    values, available = _checked(path, fields, coloured)
    if coloured and wavelength is not None:
        raise DataError(f"{path}: this file holds colours, not wavelengths: leave the option out")
    chosen = [0, 1, 2] if coloured else match_wavelengths(available, wavelength, str(path))
    phi_i, theta_i = (np.array(fields[name], np.float64).ravel() for name in ("phi_i", "theta_i"))
    isotropic = len(phi_i) <= _ISOTROPIC
    planes = 1 if isotropic else len(phi_i)
    height, width = values.shape[-2:]
    step = thinning((planes * len(theta_i), height, width), every, str(path))
    y, x = (
        a.ravel() for a in np.meshgrid(np.arange(height)[::step], np.arange(width)[::step], indexing="ij")
    )
    ndf, sigma = (np.array(fields[name], np.float64) for name in ("ndf", "sigma"))
    weighted = "jacobian" not in fields or bool(np.ravel(fields["jacobian"])[0])
    parts: dict[str, list[NDArray[Any]]] = {
        k: [] for k in ("theta_i", "theta_r", "phi", "wavelength", "group", "I")
    }
    for p in range(planes):
        azimuth = 0.0 if isotropic else phi_i[p]
        for t, zenith in enumerate(theta_i):
            density = np.array(fields["vndf"][p, t], np.float64)
            if not (np.isfinite(density).all() and (density >= 0).all() and density.sum() > 0):
                raise DataError(f"{path}: vndf[{p}, {t}] is not a density: the file is damaged")
            u, v = _warped(density, x / (width - 1), y / (height - 1))
            theta_o, phi_o, facing = _mirrored(zenith, azimuth, u, v, isotropic)
            new = facing & _first_of_each(theta_o, phi_o)
            samples = np.array(values[p, t, :, ::step, ::step], np.float64).reshape(values.shape[2], -1)[
                chosen
            ]
            if weighted:
                area = _bilinear(sigma, np.sqrt(2 * zenith / np.pi), (azimuth + np.pi) / (2 * np.pi) % 1.0)
                samples = samples * _bilinear(ndf, u, v) / (4.0 * area)
            count = int(new.sum())
            brdf = samples[:, new] / np.cos(theta_o[new])
            parts["theta_i"].append(np.full(count * len(chosen), zenith))
            parts["theta_r"].append(np.tile(theta_o[new], len(chosen)))
            parts["phi"].append(np.tile(phi_o[new] - azimuth - np.pi, len(chosen)))
            labels = np.array(COLOURS) if coloured else available
            parts["wavelength"].append(np.repeat(labels[chosen], count))
            parts["group"].append(
                np.full(count * len(chosen), f"{np.rad2deg(azimuth):.6g}")
                if not isotropic
                else np.repeat(incidence_groups(zenith), count * len(chosen))
            )
            parts["I"].append(brdf.ravel())
    columns = {name: np.concatenate(arrays) for name, arrays in parts.items()}
    brdf = columns.pop("I")
    if coloured:
        columns["group"] = columns.pop("wavelength")
    text = fields.get("description", np.empty(0, np.uint8))
    title = text.tobytes().decode("utf-8", errors="replace") if text.dtype == np.uint8 else ""
    return scalar_rows(
        path,
        {**columns},
        brdf,
        None,
        attrs={"title": " ".join(title.split()), "source": path.name + thinning_in_words(step)},
    )


def _checked(path: Path, fields: dict[str, NDArray[Any]], coloured: bool) -> tuple[NDArray[Any], _Array]:
    """The field of values, and the wavelengths; raises DataError if a field is missing or has another shape."""
    name = "rgb" if coloured else "spectra"
    wanted = ["phi_i", "theta_i", "ndf", "sigma", "vndf", name, *([] if coloured else ["wavelengths"])]
    missing = [field for field in wanted if field not in fields]
    if missing:
        raise DataError(
            f"{path}: this tensor file has no field {missing[0]!r}: it is not a file of EPFL's database"
        )
    values = fields[name]
    incidences = (fields["phi_i"].size, fields["theta_i"].size)
    channels = 3 if coloured else fields["wavelengths"].size
    for field, dimensions, start in (
        (name, 5, (*incidences, channels)),
        ("vndf", 4, incidences),
        ("ndf", 2, ()),
        ("sigma", 2, ()),
    ):
        shape = fields[field].shape
        if len(shape) != dimensions or shape[: len(start)] != start or min(shape[-2:]) < 2 or 0 in shape:
            raise DataError(f"{path}: the field {field!r} has the shape {shape}, which its axes do not allow")
    for field in wanted:
        if fields[field].dtype.kind != "f":
            raise DataError(
                f"{path}: the field {field!r} is {fields[field].dtype}, not of floating-point numbers"
            )
    theta_i = np.array(fields["theta_i"], np.float64)
    if not ((theta_i >= 0) & (theta_i < np.pi / 2 + 1e-6)).all():
        raise DataError(f"{path}: theta_i reaches {theta_i.max():g}, beyond π/2: is it in degrees?")
    return values, np.array([] if coloured else fields["wavelengths"], np.float64).ravel()


def _bilinear(table: _Array, u: Any, v: Any) -> Any:
    """Value of a table over the unit square, u along its last axis and v along its first."""
    height, width = table.shape
    x, y = np.clip(u, 0.0, 1.0) * (width - 1), np.clip(v, 0.0, 1.0) * (height - 1)
    i = np.minimum(x.astype(np.intp), width - 2)
    j = np.minimum(y.astype(np.intp), height - 2)
    a, b = x - i, y - j
    return (1 - b) * ((1 - a) * table[j, i] + a * table[j, i + 1]) + b * (
        (1 - a) * table[j + 1, i] + a * table[j + 1, i + 1]
    )


def _warped(density: _Array, x: _Array, y: _Array) -> tuple[_Array, _Array]:
    """Where a density over the unit square maps points of it: (u, v) along its last and its first axis.

    The marginal distribution of v maps y, the conditional one of u there maps x.
    """
    height, width = density.shape
    conditional = np.zeros_like(density)
    conditional[:, 1:] = np.cumsum(0.5 * (density[:, 1:] + density[:, :-1]), axis=1)
    rows = conditional[:, -1]
    marginal = np.concatenate([[0.0], np.cumsum(0.5 * (rows[1:] + rows[:-1]))])
    target = y * marginal[-1]
    j = np.clip(np.searchsorted(marginal, target, "right") - 1, 0, height - 2)
    b = _within(rows[j], rows[j + 1], target - marginal[j])
    mixed = (1 - b[:, np.newaxis]) * conditional[j] + b[:, np.newaxis] * conditional[j + 1]
    target = x * mixed[:, -1]
    i = np.clip((mixed <= target[:, np.newaxis]).sum(axis=1) - 1, 0, width - 2)
    left, right = ((1 - b) * density[j, i + k] + b * density[j + 1, i + k] for k in (0, 1))
    a = _within(left, right, target - mixed[np.arange(len(i)), i])
    return (i + a) / (width - 1), (j + b) / (height - 1)


def _within(start: _Array, stop: _Array, area: _Array) -> _Array:
    """The share of an interval of unit length that holds an area under a line from `start` to `stop`."""
    root = np.sqrt(np.maximum(start**2 + 2.0 * (stop - start) * area, 0.0))
    # the form without cancellation, whichever of the two is larger
    return np.clip(
        np.divide(2.0 * area, start + root, out=np.zeros_like(area), where=start + root > 0), 0.0, 1.0
    )


def _mirrored(
    zenith: float, azimuth: float, u: _Array, v: _Array, isotropic: bool
) -> tuple[_Array, _Array, NDArray[np.bool_]]:
    """Zenith angle and azimuth of the viewers that normals mirror the light to, and which see the surface."""
    theta_m, phi_m = np.pi / 2 * u**2, np.pi * (2 * v - 1) + (azimuth if isotropic else 0.0)
    light = np.array([np.sin(zenith) * np.cos(azimuth), np.sin(zenith) * np.sin(azimuth), np.cos(zenith)])
    normal = np.stack([np.sin(theta_m) * np.cos(phi_m), np.sin(theta_m) * np.sin(phi_m), np.cos(theta_m)])
    viewer = 2.0 * (light @ normal) * normal - light[:, np.newaxis]
    theta_o = np.arctan2(np.hypot(viewer[0], viewer[1]), viewer[2])
    return theta_o, np.arctan2(viewer[1], viewer[0]), viewer[2] > _SAME


def _first_of_each(theta: _Array, phi: _Array) -> NDArray[np.bool_]:
    """Which directions are the first of their kind."""
    vector = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)
    _, first = np.unique(np.round(vector / _SAME).astype(np.int64), axis=0, return_index=True)
    is_first = np.zeros(len(theta), bool)
    is_first[first] = True
    return is_first


def _is_rgl(path: Path) -> bool:
    return is_tensor_file(path) and b"vndf" in first_bytes(path, 4096)


READER = Reader("rgl", read_rgl, extensions=(".bsdf",), sniff=_is_rgl)
