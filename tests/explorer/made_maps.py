"""Maps for the tests that no fit has made: every number is known, and every state and limit occurs."""

from __future__ import annotations

import json

import numpy as np
import xarray as xr

import pbrdf
from pbrdf.inversion.parameter_map.layout import PENDING, PixelStatus, empty_map, template

PAINT = "matte-white-thick"
#: Pixels with a state of their own, (row, column).
STATES = {
    PixelStatus.NOT_CONVERGED: (0, 1),
    PixelStatus.FAILED: (1, 2),
    PixelStatus.NOT_MEASURED: (2, 0),
    PixelStatus.MASKED: (2, 1),
    PENDING: (3, 3),
}
UNDETERMINED, ON_BOUND = (4, 2), (4, 3)
SHAPE = (5, 7)


def parameter_map(shape=SHAPE, dims=("y", "x"), **attrs):
    """The bundled paint with sigma, n that grow along rows and columns; of two or more dimensions of 5 by 7 or more
    with some pixels of every kind in the last two."""
    names = ["sigma", "n"]
    arrays = empty_map(2, shape, False)
    paint = pbrdf.load_paint(PAINT)
    place = np.arange(np.prod(shape), dtype=float).reshape(shape) / np.prod(shape)
    arrays["estimate"][0] = paint.values["sigma"] * (1.0 + 0.3 * place)
    arrays["estimate"][1] = 1.5 + 0.1 * place
    arrays["standard_error"][:] = 1e-3 * (1.0 + place)
    arrays["chi2"][:] = 20.0 + place
    arrays["degrees_of_freedom"][:] = 20
    arrays["optima"][:] = arrays["starts"][:] = 1
    arrays["status"][:] = PixelStatus.CONVERGED
    if len(shape) > 1:
        for status, at in STATES.items():
            arrays["status"][(..., *at)] = status
            if status != PixelStatus.NOT_CONVERGED:
                arrays["estimate"][(..., *at)] = np.nan
            arrays["standard_error"][(..., *at)] = np.nan
        for flag, at in ((4, UNDETERMINED), (2, ON_BOUND)):
            arrays["flags"][(1, ..., *at)] = flag
            arrays["standard_error"][(1, ..., *at)] = np.nan
    fixed = {name: value for name, value in paint.values.items() if name not in names}
    described = {"model": paint.name, "options": dict(paint.chosen), "fixed": fixed}
    coords = {"parameter": names, "unit": ("parameter", ["1", "1"])}
    return template(arrays, dims, coords, {"model": json.dumps(described), **attrs})


def pixel_data(shape=SHAPE, dims=("y", "x")):
    """The paint at some directions of its experiment, brighter from pixel to pixel; nothing at (2, 0)."""
    ds = pbrdf.open_experiment(PAINT)
    ds = ds.isel(geometry=np.flatnonzero(ds["group"].values.astype(str) == "1"))
    factor = 1.0 + np.arange(np.prod(shape), dtype=float).reshape(shape) / 100.0
    if len(shape) == 2:
        factor[2, 0] = np.nan
    scale = xr.DataArray(factor, dims=dims)
    with xr.set_options(keep_attrs=True):
        found = (ds * scale).assign_attrs(ds.attrs).transpose("geometry", *dims, ...)
    # as pictures have them: no data set of the schema does
    names = [f"s{k}" for k in range(found.sizes["geometry"])]
    return found.assign_coords(series=("geometry", names), height=(dims, factor)).assign(
        label=(dims, np.ones(shape, int))
    )


def material_map(shape=SHAPE):
    """Two materials, one pixel that is neither and one without data."""
    material = np.zeros(shape, np.int16)
    material[:, 3:] = 1
    material[0, 0], material[1, 1] = -1, -2
    confidence = np.where(material >= 0, 0.75 + 0.2 * (material == 1), np.nan).astype(np.float32)
    return xr.Dataset(
        {"material": (("y", "x"), material), "confidence": (("y", "x"), confidence)},
        {"material_name": ["gloss black", "matt white"]},
    )
