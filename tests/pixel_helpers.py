"""Pictures of samples whose geometry is known, and the way back from (p, s) to the camera's axes."""

from __future__ import annotations

import numpy as np
import xarray as xr

from pbrdf.optics.elements import rotate_frame


def blank(rows, columns, series=1, **coords):
    """Stokes pictures without numbers to speak of."""
    shape = (series, rows, columns)
    data = {name: (("series", "y", "x"), np.ones(shape, np.float32)) for name in ("I", "Q", "U")}
    axes = {"series": [f"s{i}" for i in range(series)], "y": np.arange(rows), "x": np.arange(columns)}
    return xr.Dataset(data, coords={**axes, **coords})


def painted(model, geometry, *, noise=0.0, seed=0, scale=1.0):
    """Stokes pictures, in the camera's axes, of a paint at the angles of a geometry over (geometry, y, x): proportional
    to BRDF · cosθ_i · irradiance."""
    if "geometry" not in geometry.dims:
        geometry = geometry.expand_dims("geometry")
    mask = geometry.mask.transpose("geometry", "y", "x").values
    angles = [geometry[n].transpose("geometry", "y", "x").values[mask] for n in ("theta_i", "theta_r", "phi")]
    stokes = model.stokes(*angles) * np.cos(angles[0])[:, None]
    if "irradiance" in geometry:
        stokes = stokes * geometry.irradiance.transpose("geometry", "y", "x").values[mask][:, None]
    turned = np.einsum("nij,nj->ni", rotate_frame(-geometry.rotation.values[mask]), stokes) * scale
    rng = np.random.default_rng(seed)
    data = {}
    dims = ("series", "y", "x")
    for k, name in enumerate("IQU"):
        picture = np.zeros(mask.shape)
        picture[mask] = turned[:, k]
        data[name] = (dims, picture + rng.normal(0.0, noise, mask.shape))
        for other in "IQU"[k:]:
            data[f"cov_{name}{other}"] = (dims, np.full(mask.shape, noise**2 * (name == other)))
    coords = {
        "series": [f"s{i}" for i in range(mask.shape[0])],
        "y": geometry.y.values,
        "x": geometry.x.values,
    }
    return xr.Dataset(data, coords)


def shaded(geometry, rows, columns, *, background=0.02, noise=0.003, seed=0, fine=3):
    """Pictures of a matt sample, each pixel the mean of finer ones: what the finding of outlines is tried on."""
    place = [(np.arange(n * fine) + 0.5) / fine - 0.5 for n in (columns, rows)]
    found = geometry.pixels(*place)
    theta = found.theta_i if "geometry" in found.dims else found.theta_i.expand_dims("geometry")
    bright = np.where(np.isfinite(theta), 0.3 * np.cos(theta), background).reshape(
        -1, rows, fine, columns, fine
    )
    values = bright.mean(axis=(2, 4))
    values += np.random.default_rng(seed).normal(0.0, noise, values.shape)
    pictures = blank(rows, columns, len(values))
    return pictures.assign(I=(("series", "y", "x"), values))


def seen(model, geometry, rows, columns, *, noise=0.02, seed=0, fine=3):
    """Pictures of a painted sample before a black background, each pixel the mean of finer ones; noise in parts of the
    sample's median."""
    place = [(np.arange(n * fine) + 0.5) / fine - 0.5 for n in (columns, rows)]
    values = painted(model, geometry.pixels(*place)).I.values
    values = values.reshape(-1, rows, fine, columns, fine).mean(axis=(2, 4))
    values += np.random.default_rng(seed).normal(0.0, noise * np.median(values[values > 0.0]), values.shape)
    return blank(rows, columns, len(values)).assign(I=(("series", "y", "x"), values))
