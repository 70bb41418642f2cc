"""A clear sky with its polarisation: sunlight scattered once in a plane-parallel Rayleigh atmosphere, and the sun.

The phase function with depolarisation and its degree of linear polarisation are those of Hansen and Travis, Space
Science Reviews 16, 527 (1974), section 2, written with the largest degree P_max that it reaches at 90° from the
sun instead of the depolarisation factor δ, P_max = (1 − δ)/(1 + δ)::

    p(γ) = (1 + P_max cos²γ)/(1 + P_max/3),   DoLP(γ) = P_max sin²γ/(1 + P_max cos²γ),

with the field across the plane of sun, sky point and observer. A P_max below the 0.94 of dry air stands for light
scattered more than once, and for haze. The radiance seen from the ground is that of single scattering (Chandrasekhar,
*Radiative Transfer*, ch. III): for the cosines μ and μ0 of the zenith angles of the sky point and of the sun ::

    L = F0/(4π) p(γ) e^{−τ/μ0} (τ/μ) (1 − e^{−X})/X,   X = τ (1/μ − 1/μ0).

Units: F0, the sun's irradiance above the atmosphere, is 1. World axes: z up; azimuths turn from x towards y.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pbrdf.errors import PbrdfError
from pbrdf.optics.geometry import Vector, dot

__all__ = ["Sky", "direction_of", "rayleigh_stokes"]

#: The formula of a plane-parallel atmosphere means little for a sun at the horizon.
_LOWEST_SUN = math.radians(88.0)
_SMALL = 1e-3
_HORIZON = 1e-6


def direction_of(zenith: float, azimuth: float) -> tuple[float, float, float]:
    """Unit vector with these angles, radians; azimuths turn from x towards y, z is up."""
    s = math.sin(zenith)
    return (s * math.cos(azimuth), s * math.sin(azimuth), math.cos(zenith))


def rayleigh_stokes(
    direction: Vector, sun: Vector, x: Vector, y: Vector, optical_depth: Any, max_dolp: Any
) -> tuple[Any, Any, Any]:
    """Stokes components (I, Q, U) of the sky's radiance, F0 = 1; V is 0. Generic Dr.Jit floats.

    Parameters
    ----------
    direction
        Unit vector from the observer to the sky point; below the horizon there is no light.
    sun
        Unit vector to the sun.
    x, y
        Axes to which the Stokes components refer; x, y and the direction of propagation −`direction` are right-handed.
    optical_depth, max_dolp
        τ and P_max.
    """
    import drjit as dr

    c = dot(direction, sun)
    mu, mu0 = dr.maximum(direction[2], _HORIZON), sun[2]
    excess = optical_depth * (1.0 / mu - 1.0 / mu0)
    small = dr.abs(excess) < _SMALL
    safe = dr.select(small, 1.0, excess)
    series = 1.0 - excess * (0.5 - excess / 6.0)
    mean = dr.select(small, series, (1.0 - dr.exp(-safe)) / safe)
    scale = dr.exp(-optical_depth / mu0) * (optical_depth / mu) * mean
    scale = scale / (4.0 * math.pi * (1.0 + max_dolp / 3.0))
    scale = dr.select(direction[2] > 0.0, scale, 0.0)
    # The field lies along e = direction × sun with |e|² = sin²γ, so that sin²γ (cos2ψ, sin2ψ) are polynomials.
    e = (
        direction[1] * sun[2] - direction[2] * sun[1],
        direction[2] * sun[0] - direction[0] * sun[2],
        direction[0] * sun[1] - direction[1] * sun[0],
    )
    along_x, along_y = dot(e, x), dot(e, y)
    polarised = scale * max_dolp
    return (
        scale * (1.0 + max_dolp * c * c),
        polarised * (along_x * along_x - along_y * along_y),
        polarised * 2.0 * along_x * along_y,
    )


@dataclass(frozen=True)
class Sky:
    """A clear sky and its sun.

    Attributes
    ----------
    sun_zenith, sun_azimuth
        Radians.
    optical_depth
        Of the scattering atmosphere, vertical; about 0.1 at 550 nm and 0.2 at 460 nm for clean air.
    max_dolp
        Degree of linear polarisation at 90° from the sun, 0 … 1.
    sun_radius
        Angular radius of the sun's uniform disc, radians.
    """

    sun_zenith: float = math.radians(50.0)
    sun_azimuth: float = math.radians(240.0)
    optical_depth: float = 0.2
    max_dolp: float = 0.8
    sun_radius: float = math.radians(0.2665)

    def __post_init__(self) -> None:
        for name, low, high, unit in (
            ("sun_zenith", 0.0, _LOWEST_SUN, "°"),
            ("sun_azimuth", -4.0 * math.pi, 4.0 * math.pi, "°"),
            ("optical_depth", 0.0, 10.0, ""),
            ("max_dolp", 0.0, 1.0, ""),
            ("sun_radius", math.radians(0.01), math.radians(30.0), "°"),
        ):
            value = getattr(self, name)
            if not (math.isfinite(value) and low <= value <= high):
                shown = [math.degrees(v) if unit else v for v in (value, low, high)]
                raise PbrdfError(
                    f"sky: {name.replace('_', ' ')} is {shown[0]:g}{unit}, "
                    f"it must be within {shown[1]:g}{unit} … {shown[2]:g}{unit}"
                )

    @property
    def sun(self) -> tuple[float, float, float]:
        """Unit vector to the sun."""
        return direction_of(self.sun_zenith, self.sun_azimuth)

    @property
    def sun_height(self) -> float:
        """1 − cos of the sun's angular radius: its solid angle over 2π."""
        return 2.0 * math.sin(0.5 * self.sun_radius) ** 2

    @property
    def sun_radiance(self) -> float:
        """Radiance of the sun's disc: what the atmosphere lets through, e^{−τ/μ0}, over its solid angle."""
        return math.exp(-self.optical_depth / math.cos(self.sun_zenith)) / (2.0 * math.pi * self.sun_height)

    def stokes(self, direction: ArrayLike, x: ArrayLike, y: ArrayLike) -> np.ndarray:
        """Stokes vector of the sky's radiance, without the sun.

        Parameters
        ----------
        direction, x, y
            Unit vectors of shape (..., 3), see :func:`rayleigh_stokes`.

        Returns
        -------
        ndarray
            Shape (..., 4).
        """
        from pbrdf.backend import get_backend

        backend = get_backend()
        arrays = np.broadcast_arrays(*(np.asarray(a, dtype=float) for a in (direction, x, y)))
        vectors = [tuple(backend.upload(backend.Float, v[..., i].ravel()) for i in range(3)) for v in arrays]
        Float = backend.Float
        sun = tuple(Float(v) for v in self.sun)
        found = rayleigh_stokes(
            vectors[0], sun, vectors[1], vectors[2], Float(self.optical_depth), Float(self.max_dolp)
        )
        values = [v.numpy() for v in found]
        return np.stack([*values, np.zeros_like(values[0])], axis=-1).reshape(*arrays[0].shape[:-1], 4)
