"""Maps as a fit of pixels leaves them, without the fits."""

from __future__ import annotations

import json

import numpy as np
import xarray as xr

import pbrdf

STATES = ("converged", "not_converged", "too_few_values", "failed", "not_measured", "masked")


def example_map(shape=(40, 60), parameters=6, dims=("y", "x"), seed=0, freedom=120, cause=True):
    """A map with a gradient, a masked corner, failed pixels, two optima and parameters at bounds."""
    rng = np.random.default_rng(seed)
    model = pbrdf.load_paint("matte-white-thick")
    declared = [*type(model).parameters]
    names = [p.name for p in declared][:parameters]
    names += [f"gain_{k}" for k in range(parameters - len(names))]
    units = [p.unit for p in declared][:parameters] + ["1"] * (parameters - len(declared))
    along = np.meshgrid(*(np.linspace(0.0, 1.0, n) for n in shape), indexing="ij")
    estimate = np.empty((parameters, *shape))
    error = np.empty((parameters, *shape))
    for k, name in enumerate(names):
        middle = float(model.values.get(name, 1.0))
        ramp = 0.3 * (along[k % len(shape)] - 0.5) + 0.1 * np.sin(9.0 * along[-1] + k)
        error[k] = 0.02 * (abs(middle) + 0.01) * (1.0 + along[0] ** 4 * 40.0 * (k == 1))
        estimate[k] = middle * (1.0 + ramp) + error[k] * rng.standard_normal(shape)
    status = np.zeros(shape, dtype=np.int8)
    flags = np.zeros((parameters, *shape), dtype=np.uint8)
    optima = 1 + rng.poisson(0.2, shape).astype(np.int16)
    if cause:
        draw = rng.random(shape)
        status[draw < 0.01] = 1
        status[(draw > 0.01) & (draw < 0.015)] = 3
        status[along[0] + along[-1] > 1.7] = 4
        status[along[0] + along[-1] > 1.9] = 5
        flags[0][along[-1] < 0.1] = 1
        flags[-1][rng.random(shape) < 0.05] = 4
    nothing = status >= 2
    estimate[:, nothing] = np.nan
    error[:, nothing] = np.nan
    chi2 = np.where(nothing, np.nan, rng.chisquare(freedom, shape))
    coords = {"parameter": names, "unit": ("parameter", units)}
    return xr.Dataset(
        {
            "estimate": (("parameter", *dims), estimate),
            "standard_error": (("parameter", *dims), error),
            "chi2": (dims, chi2),
            "degrees_of_freedom": (dims, np.full(shape, freedom, dtype=np.int32)),
            "optima": (dims, optima),
            "starts": (dims, np.where(np.arange(chi2.size).reshape(shape) % 3 == 0, 64, 1).astype(np.int16)),
            "status": (dims, status, {"flag_values": list(range(6)), "flag_meanings": " ".join(STATES)}),
            "flags": (
                ("parameter", *dims),
                flags,
                {"flag_masks": [1, 2, 4], "flag_meanings": "at_lower_bound at_upper_bound undetermined"},
            ),
        },
        coords,
        {"model": json.dumps(model.to_dict()), "noise": "the uncertainties in the data"},
    )
