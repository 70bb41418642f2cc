"""What a material's specimens would show: modelled values of many drawn specimens at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pbrdf.backend import get_backend
from pbrdf.identification.material import Material
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.problem import signals_of

__all__ = ["specimens_shown", "typical_gains"]


def specimens_shown(
    material: Material, parameters: np.ndarray, data: Observations, channels: Sequence[str]
) -> dict[str, np.ndarray]:
    """Modelled values of specimens at the geometries of a data set.

    Parameters
    ----------
    material
        Says the model, its options and what is fixed.
    parameters
        Of S specimens, shape (S, P), as :meth:`Material.draw` gives them.
    data
        Geometries and illumination.
    channels
        ``I``, ``Q``, ``U``, ``V``, ``dolp``, ``m00`` …, or ratios.

    Returns
    -------
    dict
        Arrays of shape (S, G) by channel.
    """
    import drjit as dr

    backend = get_backend()
    count, size = len(parameters), len(data.theta_i)
    if not size or not channels:
        return {name: np.empty((count, size)) for name in channels}
    unknowns = material.space.to_unknowns(parameters)
    lane = dr.arange(backend.UInt32, count * size)
    specimen = lane // dr.opaque(backend.UInt32, size)
    point = lane - specimen * dr.opaque(backend.UInt32, size)
    u = [dr.gather(backend.Float, backend.upload(backend.Float, column), specimen) for column in unknowns.T]
    values, _ = signals_of(material.space, [data])(u, dr.zeros(backend.UInt32, count * size), point, channels)
    arrays = [backend.Float(v) + dr.zeros(backend.Float, count * size) for v in values]
    dr.eval(arrays)
    return {name: array.numpy().reshape(count, size) for name, array in zip(channels, arrays, strict=True)}


def typical_gains(material: Material, parameters: np.ndarray, data: Observations) -> np.ndarray:
    """Factor that brings each of S specimens to the scale of a measurement, shape (S,); 1 for ratios.

    It is the median of the ratios of measured and modelled intensity: a peak that differs does not pull the rest along.
    """
    name = next((n for n in ("I", "m00") if n in data.channels), None)
    if name is None:
        return np.ones(len(parameters))
    c = data.channels.index(name)
    there = np.isfinite(data.std[c]) & (data.values[c] > 0.0)
    if not there.any():
        return np.ones(len(parameters))
    modelled = specimens_shown(material, parameters, data, [name])[name][:, there]
    return np.asarray(np.median(data.values[c][there] / np.maximum(modelled, 1e-300), axis=1))
