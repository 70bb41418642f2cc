"""A painted surface at the points that a renderer asks about: value, density and samples of its BSDF.

All functions work on the float type of Mitsuba's active variant, which is a Python number in the scalar ones.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr

from pbrdf.rendering.properties import Paint
from pbrdf.rendering.reference_planes import LightPath, light_path, to_mitsuba
from pbrdf.rendering.sampling import LEAST_SHARE, facet_share, pdf, sample_direction

__all__ = ["Reflection", "Surface"]

#: Cosines up to this count as at or below the horizon: there single precision has nothing left of the half vector.
_HORIZON = 1e-6
#: Names that the kernels have for the parts: by whether the facets and whether the body are asked for.
_PARTS = {(True, True): "total", (True, False): "specular", (False, True): "diffuse", (False, False): None}


class Reflection(NamedTuple):
    """Light between the known and one other direction.

    Attributes
    ----------
    path
        The light in the direction in which it travels; along the normal where ``above`` is false.
    cosine
        cosθ of the other direction.
    above
        Whether both directions are above the horizon and asked for.
    """

    path: LightPath
    cosine: Any
    above: Any


class Surface:
    """The surface at one shading point (or as many as there are lanes).

    Attributes
    ----------
    part
        Part of the model that the context asks for, None for nothing.
    """

    def __init__(self, paint: Paint, ctx: Any, si: Any, active: Any) -> None:
        import mitsuba as mi

        self._model = paint.model
        self._known = si.wi
        self._radiance = ctx.mode == mi.TransportMode.Radiance
        facets = ctx.is_enabled(mi.BSDFFlags.GlossyReflection, 0)
        body = ctx.is_enabled(mi.BSDFFlags.DiffuseReflection, 1)
        self.part: Any = _PARTS[facets, body]
        spectra = {name: texture.eval(si, active) for name, texture in paint.textures.items()}
        absent = {p.name: None for p in paint.model.parameters if p.vanishing}
        #: parameters by name, for every wavelength or colour channel
        self._channels = [
            absent | {name: spectrum[i] for name, spectrum in spectra.items()}
            for i in range(dr.size_v(mi.UnpolarizedSpectrum))
        ]
        # Directions are drawn with one set of numbers for all channels. It is detached: the technique of sampling
        # stays as it is while an image is differentiated, only the integrand changes.
        average = self._channels[0]
        if not all(_equal(average, values) for values in self._channels[1:]):
            average = absent | {name: dr.mean(spectrum) for name, spectrum in spectra.items()}
        average = {name: None if value is None else dr.detach(value) for name, value in average.items()}
        self._width = paint.model.lobe_width(average)
        above = si.wi[2] > _HORIZON
        if not facets:
            self._share: Any = 0.0
        elif body:
            cosine = dr.select(above, si.wi[2], 1.0)
            self._share = facet_share(*paint.model.albedos(cosine, average))
        else:
            # normal slopes alone would miss the tails of another lobe
            self._share = 1.0 if paint.model.gaussian_slopes else 1.0 - LEAST_SHARE

    def towards(self, wo: Any, active: Any) -> Reflection:
        """Describe the light between ``si.wi`` and the direction ``wo``."""
        import mitsuba as mi

        above = active & (self._known[2] > _HORIZON) & (wo[2] > _HORIZON)
        normal = mi.Vector3f(0.0, 0.0, 1.0)
        known, other = dr.select(above, self._known, normal), dr.select(above, wo, normal)
        path = light_path(other, known) if self._radiance else light_path(known, other)
        return Reflection(path, other[2], above)

    def value(self, reflection: Reflection, factor: Any = 1.0) -> Any:
        """BSDF times cosθ of the other direction times ``factor``, 0 below the horizon: a ``mitsuba.Spectrum``."""
        import mitsuba as mi

        path, cosine, above = reflection
        if self.part is None or above is False:
            return mi.Spectrum(0.0)
        scale = dr.select(above, cosine * factor, 0.0)
        channels: list[Any] = []
        for i, values in enumerate(self._channels):
            same = next((j for j in range(i) if _equal(values, self._channels[j])), None)
            channels.append(channels[same] if same is not None else self._channel(path, values, scale))
        if not mi.is_polarized:
            return mi.Spectrum([f[0][0] for f in channels])
        Unpolarized = mi.UnpolarizedSpectrum
        return mi.Spectrum([[Unpolarized([f[i][j] for f in channels]) for j in range(4)] for i in range(4)])

    def _channel(self, path: LightPath, values: dict[str, Any], scale: Any) -> list[list[Any]]:
        import mitsuba as mi

        f = self._model.kernel(path.geometry, values, self.part)
        if not mi.is_polarized:
            return [[f[0][0] * scale]]
        return to_mitsuba([[x * scale for x in row] for row in f], path)

    def pdf(self, reflection: Reflection) -> Any:
        """Density with which :meth:`sample` draws the other direction, 1/sr; 0 below the horizon."""
        import mitsuba as mi

        path, cosine, above = reflection
        if self.part is None or above is False:
            return mi.Float(0.0)
        g = path.geometry
        cos_known = g.cos_r if self._radiance else g.cos_i
        return dr.select(above, pdf(g, cos_known, cosine, self._share, self._width), 0.0)

    def sample(self, sample1: Any, sample2: Any) -> tuple[Any, Any]:
        """Draw the other direction; also tell whether it comes from the facets."""
        import mitsuba as mi

        normal = mi.Vector3f(0.0, 0.0, 1.0)
        known = dr.select(self._known[2] > _HORIZON, self._known, normal)
        return sample_direction(known, self._share, self._width, sample1, sample2)


def _equal(a: dict[str, Any], b: dict[str, Any]) -> bool:
    """Whether the parameters of two channels are the same numbers, or the very same variables."""
    return all(_identity(a[name]) == _identity(b[name]) for name in a)


def _identity(value: Any) -> Any:
    return value if value is None or isinstance(value, float) else (value.index, value.index_ad)
