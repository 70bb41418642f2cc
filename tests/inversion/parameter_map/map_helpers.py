"""Maps for the tests: a paint whose parameters vary over an image, measured with noise."""

from __future__ import annotations

import numpy as np
import xarray as xr

import pbrdf

PAINT = "matte-white-thick"
NAMES = ("sigma", "n", "a", "k", "b", "t")


def directions(every=2):
    """θ_i, θ_r, φ of the bundled experiment's first two camera positions, every second one."""
    experiment = pbrdf.open_experiment(PAINT)
    first = experiment.isel(geometry=np.flatnonzero(experiment["group"].values < 3)[::every])
    return tuple(first[name].values for name in ("theta_i", "theta_r", "phi"))


def varied(shape):
    """The paint's parameters, smoothly varied over an image."""
    paint = pbrdf.load_paint(PAINT)
    places = np.meshgrid(*(np.linspace(0.0, 1.0, n) for n in shape), indexing="ij")
    wave = sum((k + 1.0) * place for k, place in enumerate(places))
    values = {name: np.full(shape, value) for name, value in paint.values.items()}
    values["a"] = values["a"] * (1.0 + 0.2 * np.sin(3.0 * wave))
    values["sigma"] = values["sigma"] * (1.0 + 0.2 * np.cos(2.0 * wave))
    return values


def measured(values, angles, *, noise=0.01, seed=1, dims=("y", "x"), channels="IQU", dtype=float):
    """What a camera measures of a map of parameters; angles of shape (G,), or of each pixel, (G, *shape)."""
    shape = next(iter(values.values())).shape
    paint = pbrdf.load_paint(PAINT).replace(**values)
    wide = [
        np.broadcast_to(a.reshape(*a.shape, *[1] * (1 + len(shape) - a.ndim)), (len(a), *shape))
        for a in angles
    ]
    stokes = np.stack([paint.stokes(*(a[g] for a in wide)) for g in range(len(wide[0]))])
    stokes = np.moveaxis(stokes, -1, 0)[["IQUV".index(c) for c in channels]]
    std = np.broadcast_to(noise * stokes[0], stokes.shape)
    stokes = (stokes + std * np.random.default_rng(seed).standard_normal(stokes.shape)).astype(dtype)
    over = ("geometry", *dims)
    variables = {name: (over, column) for name, column in zip(channels, stokes, strict=True)}
    variables |= {
        f"{name}_std": (over, column.astype(dtype)) for name, column in zip(channels, std, strict=True)
    }
    coords = {
        name: (over if angle.ndim > 1 else "geometry", angle)
        for name, angle in zip(("theta_i", "theta_r", "phi"), angles, strict=True)
    }
    coords["group"] = ("geometry", np.arange(len(angles[0])) % 2)
    coords |= {d: (d, np.arange(n) * 0.5) for d, n in zip(dims, shape, strict=True)}
    attrs = {
        "quantity": "brdf",
        "stokes_convention": "p-s",
        "simulated": 1,
        "illumination": [1.0, 0.0, 0.0, 0.0],
    }
    return xr.Dataset(variables, coords, attrs)


def pixel(dataset, **where):
    """One pixel of a map's data, as a data set of the schema."""
    one = dataset.isel(where)
    one = one.drop_vars([name for name in one.coords if one[name].dims == ()])
    return one.transpose("geometry", ...)


def assert_same(found, result, tolerance=1e-4):
    """One pixel of a map against a single fit: estimates to a part of a standard error, the rest of itself."""
    for name in found["parameter"].values.tolist():
        one, own = result.estimates[name], found.sel(parameter=name)
        flags = int(own["flags"])
        verdict = {0: "determined", 1: "at lower bound", 2: "at upper bound", 4: "undetermined"}[flags]
        assert verdict == one.verdict
        if verdict == "determined":
            np.testing.assert_allclose(own["estimate"], one.value, atol=tolerance * one.std, rtol=0.0)
            np.testing.assert_allclose(own["standard_error"], one.std, rtol=tolerance)
        else:
            assert np.isnan(own["standard_error"])
    np.testing.assert_allclose(found["chi2"], result.goodness.chi2, rtol=1e-6)
    assert int(found["degrees_of_freedom"]) == result.goodness.data - result.goodness.free
