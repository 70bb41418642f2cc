"""What a material's specimens would show: modelled values of many drawn specimens at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pbrdf.backend import get_backend
from pbrdf.data.schema import is_ratio
from pbrdf.identification.material import Material
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.problem import signals_of

__all__ = ["best_gains", "specimens_shown"]


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


def best_gains(material: Material, parameters: np.ndarray, data: Observations) -> np.ndarray:
    """Factor of the intensities by which each of S specimens fits a measurement best, shape (S,); 1 for ratios."""
    rows = [c for c, name in enumerate(data.channels) if not is_ratio(name)]
    if not rows:
        return np.ones(len(parameters))
    names = [data.channels[c] for c in rows]
    modelled = specimens_shown(material, parameters, data, names)
    along, square = np.zeros(len(parameters)), np.zeros(len(parameters))
    for c, name in zip(rows, names, strict=True):
        weights = 1.0 / data.std[c] ** 2
        along += (weights * data.values[c] * modelled[name]).sum(axis=1)
        square += (weights * modelled[name] ** 2).sum(axis=1)
    return np.maximum(along / square, 1e-12)
