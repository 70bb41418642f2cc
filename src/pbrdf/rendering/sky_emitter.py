"""The polarised sky as a light of Mitsuba's: plugin ``pbrdf_sky``.

An emitter of Mitsuba's polarised variants returns its Stokes vector as the first column of a Mueller matrix, over the
implicit axes ``stokes_basis(k)`` of the direction of propagation k. Its circular component is 0, so the sign of V, in
which Mitsuba differs from this project, does not matter here.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pbrdf.rendering.sky import Sky, rayleigh_stokes

__all__ = ["SKY_PLUGIN", "register_sky", "sky_dict"]

SKY_PLUGIN = "pbrdf_sky"
#: Share of the light samples that go to the sun: its disc gives most of the irradiance.
_SUN_SHARE = 0.75


def sky_dict(sky: Sky, radius: float) -> dict[str, Any]:
    """The sky as an entry of a Mitsuba scene.

    Parameters
    ----------
    sky
        What to show.
    radius
        No object of the scene is farther from another than this.
    """
    return {
        "type": SKY_PLUGIN,
        "sun_zenith": sky.sun_zenith,
        "sun_azimuth": sky.sun_azimuth,
        "optical_depth": sky.optical_depth,
        "max_dolp": sky.max_dolp,
        "sun_radius": sky.sun_radius,
        "radius": float(radius),
    }


def register_sky() -> None:
    """Make the plugin known to the Mitsuba variant that is active."""
    import drjit as dr
    import mitsuba as mi

    class SkyEmitter(mi.Emitter):
        def __init__(self, props: Any) -> None:
            super().__init__(props)
            default = Sky()
            names = ("sun_zenith", "sun_azimuth", "optical_depth", "max_dolp", "sun_radius")
            sky = Sky(**{name: float(props.get(name, getattr(default, name))) for name in names})
            self.radius = mi.Float(props.get("radius", 1e4))
            self.sun = mi.Vector3f(sky.sun)
            self.frame = mi.Frame3f(self.sun)
            self.optical_depth = mi.Float(sky.optical_depth)
            self.max_dolp = mi.Float(sky.max_dolp)
            self.sun_height = mi.Float(sky.sun_height)
            self.sun_radiance = mi.Float(sky.sun_radiance)
            # opaque, so that another sun does not mean another kernel
            dr.make_opaque(
                self.radius,
                self.sun,
                self.frame,
                self.optical_depth,
                self.max_dolp,
                self.sun_height,
                self.sun_radiance,
            )
            self.m_flags = mi.EmitterFlags.Infinite | mi.EmitterFlags.SpatiallyVarying

        def _radiance(self, d: Any) -> Any:
            k = -d
            x = mi.mueller.stokes_basis(k)
            y = dr.cross(k, x)
            toward, sun, x_axis, y_axis = ((v.x, v.y, v.z) for v in (d, self.sun, x, y))
            i, q, u = rayleigh_stokes(toward, sun, x_axis, y_axis, self.optical_depth, self.max_dolp)
            i = i + dr.select(self._in_sun(d), self.sun_radiance, 0.0)
            if not mi.is_polarized:
                return mi.Spectrum(i)
            return mi.Spectrum([[i, 0, 0, 0], [q, 0, 0, 0], [u, 0, 0, 0], [0, 0, 0, 0]])

        def _in_sun(self, d: Any) -> Any:
            # by the chord: the cosine has lost the small disc in single precision
            return dr.squared_norm(d - self.sun) <= 2.0 * self.sun_height

        def _density(self, d: Any) -> Any:
            sky = dr.select(d.z > 0.0, mi.warp.square_to_uniform_hemisphere_pdf(d), 0.0)
            sun = dr.select(self._in_sun(d), 0.5 / (dr.pi * self.sun_height), 0.0)
            return (1.0 - _SUN_SHARE) * sky + _SUN_SHARE * sun

        def eval(self, si: Any, active: Any = True) -> Any:
            return self._radiance(-si.wi) & active

        def sample_direction(self, it: Any, sample: Any, active: Any = True) -> Any:
            to_sun = sample.x < _SUN_SHARE
            again = mi.Point2f(
                dr.select(to_sun, sample.x / _SUN_SHARE, (sample.x - _SUN_SHARE) / (1.0 - _SUN_SHARE)),
                sample.y,
            )
            disc = mi.warp.square_to_uniform_disk_concentric(again)
            drop = dr.squared_norm(disc) * self.sun_height
            disc *= dr.sqrt(self.sun_height * (2.0 - drop))
            in_disc = self.frame.to_world(mi.Vector3f(disc.x, disc.y, 1.0 - drop))
            d = dr.select(to_sun, in_disc, mi.warp.square_to_uniform_hemisphere(again))
            ds = dr.zeros(mi.DirectionSample3f)
            ds.d, ds.n = d, -d
            ds.dist = 2.0 * self.radius
            ds.p = it.p + d * ds.dist
            ds.uv = sample
            ds.time = it.time
            ds.pdf = self._density(d)
            ds.delta = False
            ds.emitter = mi.EmitterPtr(self)
            weight = self._radiance(d) / ds.pdf
            return ds, dr.select(active & (ds.pdf > 0.0), weight, 0.0)

        def pdf_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            return dr.select(active, self._density(ds.d), 0.0)

        def eval_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            return self._radiance(ds.d) & active

        def sample_ray(self, time: Any, sample1: Any, sample2: Any, sample3: Any, active: Any = True) -> Any:
            raise NotImplementedError(f"{SKY_PLUGIN}: light cannot be traced from the sky, only towards it")

        def bbox(self) -> Any:
            return mi.ScalarBoundingBox3f()

        def traverse(self, callback: Any) -> None:
            pass

        def to_string(self) -> str:
            sun = np.array(self.sun).ravel()
            return f"{SKY_PLUGIN}[sun towards {sun.round(3).tolist()}]"

    mi.register_emitter(SKY_PLUGIN, SkyEmitter)
