"""The lights of the scenes. All but an environment map are scaled to the sun: irradiance 1 across its direction.

Point and area lights give the irradiance 1 to a surface in the scene's centre that faces them; the constant light gives
it to every surface, and the sky is lit by a sun of irradiance 1 above the atmosphere. A polariser before a lamp takes
half of its light.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pbrdf.errors import PbrdfError
from pbrdf.rendering.polarized_lamp import LampPolarization, polarized_dict
from pbrdf.rendering.sky import Sky, direction_of

__all__ = ["LAMPS", "LIGHTS", "light_dict"]

#: Lights that shine from one place.
LAMPS = ("point", "area")
LIGHTS = (*LAMPS, "envmap:FILE", "sky", "constant")

#: Distance of a lamp, in extents of the scene, and the side of a square one, in distances.
_DISTANCE, _SIDE = 5.0, 0.25
_IMAGES = (".exr", ".hdr", ".pfm", ".png", ".jpg", ".jpeg")


def light_dict(
    name: str,
    *,
    zenith: float,
    azimuth: float,
    centre: Sequence[float] = (0.0, 0.0, 0.0),
    extent: float = 1.0,
    sky: Sky | None = None,
    polarization: LampPolarization | None = None,
) -> dict[str, Any]:
    """Entry of a Mitsuba scene for a light.

    Parameters
    ----------
    name
        ``point``, ``area``, ``sky``, ``constant``, or ``envmap:FILE`` with a picture in latitude and longitude.
    zenith, azimuth
        Direction of a lamp, radians; the sky brings its own.
    centre, extent
        Middle and radius of what is to be lit.
    sky
        For ``sky``.
    polarization
        What stands before a lamp, ``point`` or ``area``.

    Raises
    ------
    PbrdfError
        If there is no such light or file, or the light is no lamp and `polarization` is given.
    """
    import mitsuba as mi

    if polarization is not None and name not in LAMPS:
        raise PbrdfError(f"light {name}: only a lamp, {' or '.join(LAMPS)}, has a polariser before it")
    if name == "constant":
        return {"type": "constant", "radiance": _uniform(1.0 / math.pi)}
    if name == "sky":
        from pbrdf.rendering.sky_emitter import sky_dict

        return sky_dict(sky or Sky(zenith, azimuth), 1e4 * extent)
    if name.startswith("envmap:"):
        path = Path(name.removeprefix("envmap:"))
        if not path.is_file():
            raise PbrdfError(f"light {name}: there is no file {path}")
        if path.suffix.lower() not in _IMAGES:
            raise PbrdfError(f"light {name}: an environment map is one of {', '.join(_IMAGES)}")
        # Mitsuba's maps have their pole along y
        upright = mi.ScalarTransform4f().rotate([1, 0, 0], 90)
        return {"type": "envmap", "filename": str(path), "to_world": upright}
    if name not in LAMPS:
        raise PbrdfError(f"light {name!r}: choose one of {', '.join(LIGHTS)}")
    distance = _DISTANCE * extent
    position = [c + distance * d for c, d in zip(centre, direction_of(zenith, azimuth), strict=True)]
    up = [0.0, 0.0, 1.0] if math.sin(zenith) > 1e-3 else [0.0, 1.0, 0.0]
    place = mi.ScalarTransform4f().look_at(position, list(centre), up)

    def polarized(lamp: dict[str, Any]) -> dict[str, Any]:
        return lamp if polarization is None else polarized_dict(lamp, polarization, place)

    if name == "point":
        return polarized({"type": "point", "position": position, "intensity": _uniform(distance**2)})
    half = 0.5 * _SIDE * distance
    return {
        "type": "rectangle",
        "to_world": place @ mi.ScalarTransform4f().scale([half, half, 1.0]),
        "bsdf": {"type": "diffuse", "reflectance": _uniform(0.0)},
        "emitter": polarized({"type": "area", "radiance": _uniform(distance**2 / (2.0 * half) ** 2)}),
    }


def _uniform(value: float) -> dict[str, Any]:
    return {"type": "uniform", "value": value}
