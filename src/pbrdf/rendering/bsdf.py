"""The BSDF plugin ``pbrdf``: every model of the project as a material of Mitsuba 3.

The matrices come from ``Model.kernel``, the functions behind ``Model.mueller``; this package adds directions, frames,
textures and sampling. Properties, variants and conventions of the plugin: docs/rendering.md.
"""

from __future__ import annotations

from typing import Any

import drjit as dr

from pbrdf.backend import check_llvm
from pbrdf.rendering.mitsuba_import import import_mitsuba
from pbrdf.rendering.properties import PLUGIN, read_properties
from pbrdf.rendering.surface import Surface

__all__ = ["register"]

_following = False


def register() -> None:
    """Make the plugin ``pbrdf`` known to Mitsuba's active variant and to every one that is set later.

    Raises
    ------
    BackendError
        If Mitsuba is not installed, or Dr.Jit has loaded an LLVM that aborts the process.
    """
    global _following
    mi = import_mitsuba()
    if mi.variant() is not None:
        _register_in_active_variant()
    if not _following:
        mi.detail.add_variant_callback(lambda old, new: _register_in_active_variant())
        _following = True


def _register_in_active_variant() -> None:
    import mitsuba as mi

    if mi.variant().startswith("llvm"):
        check_llvm()
    plugin = _plugin_class()
    mi.register_bsdf(PLUGIN, lambda props: plugin(props))


def _plugin_class() -> Any:
    """Class of the plugin for the active variant, whose classes it derives from."""
    import mitsuba as mi

    glossy, diffuse = mi.BSDFFlags.GlossyReflection, mi.BSDFFlags.DiffuseReflection

    class PaintedSurface(mi.BSDF):
        def __init__(self, props: Any) -> None:
            super().__init__(props)
            self.paint = read_properties(props)
            self.m_components = [flag | mi.BSDFFlags.FrontSide for flag in (glossy, diffuse)]
            self.m_flags = glossy | diffuse | mi.BSDFFlags.FrontSide

        def traverse(self, cb: Any) -> None:
            for name, texture in self.paint.textures.items():
                cb.put(name, texture, mi.ParamFlags.Differentiable)

        def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            surface = Surface(self.paint, ctx, si, active)
            return surface.value(surface.towards(wo, active))

        def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            surface = Surface(self.paint, ctx, si, active)
            return surface.pdf(surface.towards(wo, active))

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            surface = Surface(self.paint, ctx, si, active)
            reflection = surface.towards(wo, active)
            return surface.value(reflection), surface.pdf(reflection)

        def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> Any:
            surface = Surface(self.paint, ctx, si, active)
            bs = dr.zeros(mi.BSDFSample3f)
            bs.eta = 1.0
            if surface.part is None:
                return bs, mi.Spectrum(0.0)
            bs.wo, facets = surface.sample(sample1, sample2)
            bs.sampled_component = dr.select(facets, mi.UInt32(0), mi.UInt32(1))
            bs.sampled_type = dr.select(facets, mi.UInt32(int(glossy)), mi.UInt32(int(diffuse)))
            reflection = surface.towards(bs.wo, active)
            bs.pdf = surface.pdf(reflection)
            return bs, surface.value(reflection, dr.select(bs.pdf > 0.0, dr.rcp(bs.pdf), 0.0))

        def to_string(self) -> str:
            return f"PaintedSurface[{self.paint.model!r}]"

    return PaintedSurface
