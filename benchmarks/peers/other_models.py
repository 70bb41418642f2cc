"""What a user would take in place of pbrdf: polarised materials of Mitsuba 3 and NIST SCATMECH.

These are other models, without the average over facets of the light from the body: ``roughconductor`` (Beckmann facets
of a metal) and ``pplastic`` (Beckmann facets over a Lambertian body) of Mitsuba, in single
precision, and the shadowed Gaussian facets of SCATMECH (``Shadowed_Facet_BRDF_Model``: pbrdf's own specular part), one
direction a call, in double precision. They tell what a direction costs elsewhere, nothing else. Each is left out where
its package is not installed.
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Callable
from typing import Any

import numpy as np

#: Index of refraction of a metal (about that of aluminium in green light).
METAL = {"eta": 0.9, "k": 6.5}
VARIANT = "llvm_ad_mono_polarized"
#: SCATMECH's convention has the other sign of s − p and of circular light.
SIGNS = np.diag([1.0, -1.0, -1.0, 1.0])

Angles = tuple[np.ndarray, np.ndarray, np.ndarray]


def mitsuba_peers(model: Any, angles: Angles) -> dict[str, Callable[[], Any]]:
    """Functions that evaluate the Mueller matrices of all directions in Mitsuba, by the name of the material.

    Directions lie in Dr.Jit's memory before, and the matrices stay there: what a renderer does. ``pbrdf`` is this
    project's plugin with the accuracy that it takes by itself.

    Parameters
    ----------
    model
        Paint of the double-Gauss model, whose roughness and index the others get (α = √2 σ).
    angles
        θ_i, θ_r, φ in radians, shape (N,) each; φ = 0 forward.
    """
    if importlib.util.find_spec("mitsuba") is None:
        return {}
    import drjit as dr
    import mitsuba as mi

    import pbrdf

    mi.set_variant(VARIANT)
    mi.set_log_level(mi.LogLevel.Error)
    pbrdf.register_bsdf()
    rough = {"alpha": math.sqrt(2.0) * model.values["sigma"]}
    plastic = {"int_ior": model.values["n"], "ext_ior": 1.0, "diffuse_reflectance": 0.5}
    materials: dict[str, dict[str, Any]] = {
        "pbrdf (plugin)": pbrdf.bsdf_dict(model),
        "pplastic": {"type": "pplastic", **rough, **plastic},
        "roughconductor": {"type": "roughconductor", **METAL, **rough},
    }
    theta_i, theta_r, phi = angles

    def vector(theta: np.ndarray, azimuth: np.ndarray) -> Any:
        parts = (np.sin(theta) * np.cos(azimuth), np.sin(theta) * np.sin(azimuth), np.cos(theta))
        return mi.Vector3f(*(mi.Float(part.astype(np.float32)) for part in parts))

    seen = vector(theta_r, np.zeros_like(phi))
    light = vector(theta_i, math.pi - phi)
    dr.eval(seen, light)

    def evaluated(bsdf: Any) -> Any:
        interaction = dr.zeros(mi.SurfaceInteraction3f, theta_i.size)
        interaction.wi = seen
        matrices = bsdf.eval(mi.BSDFContext(), interaction, light)
        dr.eval(matrices)
        dr.sync_thread()
        return matrices

    loaded = {name: mi.load_dict(material) for name, material in materials.items()}
    return {name: lambda bsdf=bsdf: evaluated(bsdf) for name, bsdf in loaded.items()}


def scatmech_peer(model: Any) -> Callable[..., np.ndarray] | None:
    """SCATMECH's shadowed facets as a function of θ_i, θ_r, φ to matrices (N, 4, 4) in pbrdf's convention, or None."""
    if importlib.util.find_spec("pySCATMECH") is None:
        return None
    from pySCATMECH.brdf import BRDF_Model

    facets = BRDF_Model(
        "Shadowed_Facet_BRDF_Model",
        {
            "lambda": "0.55",
            "type": "0",
            "substrate": f"({model.values['n']},0)",
            "sdf": "Gaussian_Slope_Distribution_Function",
            "sdf.s": str(math.sqrt(2.0) * model.values["sigma"]),
            "shadow": "Torrance_Sparrow_Shadow_Function",
        },
    )

    def function(theta_i: np.ndarray, theta_r: np.ndarray, phi: np.ndarray) -> np.ndarray:
        rows = zip(theta_i.tolist(), theta_r.tolist(), phi.tolist(), strict=True)
        return SIGNS @ np.array([facets.MuellerBRDF(*row) for row in rows]) @ SIGNS

    return function
