"""A lamp behind a polariser and a retarder: plugin ``pbrdf_polarized`` around any lamp of Mitsuba's.

The light is polarised as it leaves the lamp, by the matrices of :mod:`pbrdf.optics.elements`, whatever its direction:
there is no sheet that a ray towards the lamp would have to pass (Mitsuba's ``path`` takes such a sheet for opaque).

The axes are those of a picture (docs/conventions.md) for an observer who looks into the lamp: with y upwards in the
lamp's own frame and k the direction in which the light travels, x = y × k/|y × k| points to his right, and angles turn
from x towards k × x, counterclockwise for him. A camera in the lamp's place has the same y, and its x reversed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from pbrdf.errors import PbrdfError
from pbrdf.optics.elements import diattenuator, retarder

__all__ = ["POLARIZED_PLUGIN", "LampPolarization", "polarized_dict", "register_polarized_lamp"]

POLARIZED_PLUGIN = "pbrdf_polarized"
#: Beside the lamp; Mitsuba itself knows the last two.
_PROPERTIES = {"polarizer", "retarder", "retardance", "to_world", "sampling_weight"}


@dataclass(frozen=True)
class LampPolarization:
    """What stands before a lamp.

    Attributes
    ----------
    polarizer
        Axis of a perfect polariser, radians.
    retarder, retardance
        Fast axis of a retarder behind it, and the phase by which its component leads, radians.
    """

    polarizer: float
    retarder: float = 0.0
    retardance: float = 0.0

    def __post_init__(self) -> None:
        for name in ("polarizer", "retarder", "retardance"):
            if not math.isfinite(getattr(self, name)):
                raise PbrdfError(f"lamp: {name} is {getattr(self, name)}, it must be an angle")

    def __str__(self) -> str:
        polarizer, axis, delay = (math.degrees(v) for v in (self.polarizer, self.retarder, self.retardance))
        behind = f", behind it a retarder of {delay:g} deg at {axis:g} deg" if delay else ""
        return f"a polariser at {polarizer:g} deg{behind}"

    @property
    def stokes(self) -> np.ndarray:
        """(I, Q, U, V) of the light, shape (4,), of a lamp of intensity 1: half of it passes."""
        light: np.ndarray = retarder(self.retarder, self.retardance) @ diattenuator(self.polarizer)[:, 0]
        return light


def polarized_dict(lamp: dict[str, Any], polarization: LampPolarization, to_world: Any) -> dict[str, Any]:
    """A polarised lamp as an entry of a Mitsuba scene.

    Parameters
    ----------
    lamp
        Entry of the lamp.
    polarization
        What stands before it.
    to_world
        Mitsuba's transform of the elements: z is where the light goes, y is up.
    """
    return {
        "type": POLARIZED_PLUGIN,
        "polarizer": polarization.polarizer,
        "retarder": polarization.retarder,
        "retardance": polarization.retardance,
        "to_world": to_world,
        "lamp": lamp,
    }


def register_polarized_lamp() -> None:
    """Make the plugin known to the Mitsuba variant that is active."""
    import drjit as dr
    import mitsuba as mi

    class PolarizedEmitter(mi.Emitter):
        def __init__(self, props: Any) -> None:
            super().__init__(props)
            lamps = {name: props[name] for name in props if isinstance(props[name], mi.Emitter)}
            unknown = sorted(set(props) - set(lamps) - _PROPERTIES)
            if unknown:
                raise PbrdfError(f"{POLARIZED_PLUGIN}: there is no property {unknown[0]}")
            if len(lamps) != 1:
                raise PbrdfError(f"{POLARIZED_PLUGIN}: it takes one emitter, not {len(lamps)}")
            (self.lamp,) = lamps.values()
            if self.lamp.is_environment():
                raise PbrdfError(f"{POLARIZED_PLUGIN}: light from all around has no polariser before it")
            if "polarizer" not in props:
                raise PbrdfError(f"{POLARIZED_PLUGIN}: give the angle of its polarizer, radians")
            self.polarization = LampPolarization(
                float(props["polarizer"]),
                float(props.get("retarder", 0.0)),
                float(props.get("retardance", 0.0)),
            )
            self.up = self.world_transform() @ mi.Vector3f(0.0, 1.0, 0.0)
            # V > 0 is right circular in Mitsuba
            self.stokes = [mi.Float(float(s)) for s in self.polarization.stokes * [1.0, 1.0, 1.0, -1.0]]
            # opaque, so that another angle does not mean another kernel
            dr.make_opaque(self.up, self.stokes)
            self.m_flags = self.lamp.flags()

        def _source(self) -> Any:
            """The lamp itself, on the shape that this one has been put on."""
            if self.get_shape() is not None and self.lamp.get_shape() is None:
                self.lamp.set_shape(self.get_shape())
            return self.lamp

        def _polarized(self, light: Any, k: Any) -> Any:
            """The lamp's light along `k` behind the elements, over ``stokes_basis(k)``."""
            intensity = mi.unpolarized_spectrum(light)
            i, q, u, v = self.stokes
            if not mi.is_polarized:
                return i * intensity
            x = dr.normalize(dr.cross(self.up, k))
            basis = mi.mueller.stokes_basis(k)
            c, s = dr.dot(basis, x), dr.dot(basis, dr.cross(k, x))
            cos, sin = c * c - s * s, 2.0 * c * s
            column = (i, q * cos + u * sin, u * cos - q * sin, v)
            return mi.Spectrum([[part * intensity, 0, 0, 0] for part in column])

        def eval(self, si: Any, active: Any = True) -> Any:
            return self._polarized(self._source().eval(si, active), si.to_world(si.wi))

        def sample_direction(self, it: Any, sample: Any, active: Any = True) -> Any:
            ds, weight = self._source().sample_direction(it, sample, active)
            ds.emitter = mi.EmitterPtr(self)
            return ds, self._polarized(weight, -ds.d)

        def pdf_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            return self._source().pdf_direction(it, ds, active)

        def eval_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            return self._polarized(self._source().eval_direction(it, ds, active), -ds.d)

        def sample_ray(self, time: Any, sample1: Any, sample2: Any, sample3: Any, active: Any = True) -> Any:
            raise NotImplementedError(f"{POLARIZED_PLUGIN}: light cannot be traced from it, only towards it")

        def bbox(self) -> Any:
            return self._source().bbox()

        def traverse(self, callback: Any) -> None:
            callback.put("lamp", self.lamp, mi.ParamFlags.Differentiable)

        def to_string(self) -> str:
            return f"{POLARIZED_PLUGIN}[{self.polarization}]"

    mi.register_emitter(POLARIZED_PLUGIN, PolarizedEmitter)
