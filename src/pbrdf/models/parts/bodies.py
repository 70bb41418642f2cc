"""Bodies, the diffuse parts of models: what light does that enters the material and comes back out.

Each class names its source; the tags in brackets are those of the project's literature brief: [V] read in a public
implementation of the model, [D] derived. All matrices stand in the surface's frames, Q = I_p − I_s.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar, Literal

import drjit as dr

from pbrdf.models.arrays import Matrix
from pbrdf.models.double_gauss import MEAN_COSINE, DoubleGauss, check_index
from pbrdf.models.parameters import Option, Parameter
from pbrdf.models.parts.part import Part, depolarising
from pbrdf.models.parts.simple_bodies import ALBEDO
from pbrdf.optics.diffuse import mrpv, rpv
from pbrdf.optics.fresnel import internal_diffuse_reflectance, transmittances
from pbrdf.optics.geometry import Geometry, geometry_from_sines
from pbrdf.optics.transmission import exit_polarisation

__all__ = ["COATING_INDEX", "CoatedLambert", "HotSpotRPV", "PolarisedMRPV", "Subsurface"]

_INFINITY = float("inf")

#: Index of a dielectric coating whose facets reflect and through whose flat surface body light passes.
COATING_INDEX = Parameter(
    "n", "n", "1", "real refractive index of the coating",
    1.2, 2.6, (1.0, 100.0), 1.5, part="both", refractive_index=True,
)  # fmt: skip


class _BelowFlatSurface(Part):
    """Light refracted in through a flat surface, depolarised, and refracted out: C_o T_o Dep T_i C_i."""

    kind: ClassVar[Literal["specular", "diffuse"]] = "diffuse"

    def brightness(self, values: Mapping[str, Any]) -> Any:
        """Factor of the transmittances of flux, 1/sr."""
        raise NotImplementedError

    def matrix(self, geometry: Geometry, values: Mapping[str, Any], chosen: Mapping[str, str]) -> Matrix:
        n, factor = values["n"], self.brightness(values)
        mean_i, half_i = transmittances(geometry.cos_i, n)
        mean_r, half_r = transmittances(geometry.cos_r, n)
        # p and s of the surface's own plane are the frames themselves: no turn between them
        q_i, q_r = half_i * geometry.sin_i * geometry.sin_i, half_r * geometry.sin_r * geometry.sin_r
        leaving = factor * mean_r, factor * q_r
        f: Matrix = [[0.0] * 4 for _ in range(4)]
        for row, out in enumerate(leaving):
            f[row][0], f[row][1] = out * mean_i, out * q_i
        return f

    def albedo(self, cos_theta: Any, values: Mapping[str, Any]) -> Any:
        entering, leaving = (
            transmittances(c, values["n"])[0] for c in (cos_theta, 0.0 * cos_theta + MEAN_COSINE)
        )
        return math.pi * self.brightness(values) * entering * leaving


class Subsurface(_BelowFlatSurface):
    """Germer's diffuse subsurface scattering: f = (R/π) T_o Dep T_i/(n² (1 − ρ_int R)).

    Source: SCATMECH, ``Diffuse_Subsurface_BRDF_Model`` (T. A. Germer) [V]; light that the surface sends back inside is
    scattered again, hence the denominator. ρ_int is :func:`~pbrdf.optics.fresnel.internal_diffuse_reflectance`.

    Reciprocal. The body reflects T_i(θ_i) R (1 − ρ_int)/(1 − ρ_int R) of the light, because
    ∫T_o cosθ_r dω_r/π = n² (1 − ρ_int) [D]: for R = 1 all that enters comes back.
    """

    parameters = (
        COATING_INDEX,
        Parameter(
            "pigment", "R", "1", "diffuse reflectance of the pigment below the surface",
            1e-4, 1.0, (0.0, 1.0), 0.5, logarithmic=True, part="diffuse",
        ),
    )  # fmt: skip

    def brightness(self, values: Mapping[str, Any]) -> Any:
        n, R = values["n"], values["pigment"]
        return R * (1.0 / math.pi) / (n * n * (1.0 - internal_diffuse_reflectance(n) * R))


class CoatedLambert(_BelowFlatSurface):
    """Body of Baek et al.: f = (ρ_d/π) T_o Dep T_i, Lambertian under a flat surface with the macroscopic normal.

    Source: Baek et al., "Simultaneous acquisition of polarimetric SVBRDF and normals", ACM TOG 37, 268 (2018), as in
    Mitsuba 3 ``pplastic`` [V]: transmittances of flux in and out, no 1/n², no light sent back inside.

    Reciprocal; reflects at most ρ_d T_i(θ_i) (1 − ρ_ext), ρ_ext the surface's reflectance of diffuse light.
    """

    parameters = (
        COATING_INDEX,
        ALBEDO,
    )

    def brightness(self, values: Mapping[str, Any]) -> Any:
        return values["albedo"] * (1.0 / math.pi)


class HotSpotRPV(Part):
    """Rahman-Pinty-Verstraete body with its hot spot, depolarising.

    Source: Rahman, Pinty, Verstraete, J. Geophys. Res. 98, 20791 (1993), as in VLIDORT (RAHMAN), GRASP and the i3rc
    code [V], azimuth turned to 0 in the forward direction; see :func:`~pbrdf.optics.diffuse.rpv`. With ρ_c = ρ_0 it is
    the three-parameter RPV.

    Reciprocal. Not bounded by energy: its reflectance depends on all four numbers; k = 1, Θ = 0, ρ_c = 1 is Lambert's.
    """

    kind: ClassVar[Literal["specular", "diffuse"]] = "diffuse"
    parameters = (
        Parameter(
            "rho_0", "ρ_0", "1", "amplitude of the body, on the data's own scale",
            1e-4, 100.0, (0.0, _INFINITY), 0.2, logarithmic=True, part="diffuse", amplitude=True,
        ),
        Parameter(
            "k", "k", "1", "Minnaert-type exponent, 1 for a Lambertian body",
            0.3, 4.0, (0.0, 20.0), 0.8, part="diffuse",
        ),
        Parameter(
            "asymmetry", "Θ", "1", "asymmetry of Henyey and Greenstein, forward (> 0) or backward (< 0)",
            -0.9, 0.9, (-0.99, 0.99), -0.1, part="diffuse",
        ),
        Parameter(
            "rho_c", "ρ_c", "1", "hot-spot parameter, 1 for no hot spot, less for light in backscatter",
            0.0, 1.0, (-5.0, 2.0), 1.0, part="diffuse",
        ),
    )  # fmt: skip

    def matrix(self, geometry: Geometry, values: Mapping[str, Any], chosen: Mapping[str, str]) -> Matrix:
        return depolarising(rpv(geometry, *(values[name] for name in ("rho_0", "k", "asymmetry", "rho_c"))))

    def albedo(self, cos_theta: Any, values: Mapping[str, Any]) -> Any:
        across = _across(cos_theta)
        return math.pi * rpv(across, *(values[name] for name in ("rho_0", "k", "asymmetry", "rho_c")))


class PolarisedMRPV(Part):
    """Body of the double-Gauss model: f_rpv [(1 − t) D_s + t D_v], a share t of it polarised by leaving through facets.

    Source: Zhang, Song, Zhao, Infrared and Laser Engineering 46(11), 1117002 (2017), eqs (9)-(13). With t = 0, its
    ablation, it is the depolarising MRPV body.

    Not reciprocal for t > 0, and not bounded by energy.

    Parameters
    ----------
    normalization
        Reading of eq. (13), see :mod:`pbrdf.optics.transmission`; "visible" needs k > 1/3.
    """

    kind: ClassVar[Literal["specular", "diffuse"]] = "diffuse"
    options: Mapping[str, Option] = {
        name: DoubleGauss.options[name] for name in ("transmittance", "accuracy")
    }

    def __init__(self, normalization: Literal["weighted", "visible"] = "weighted") -> None:
        self._normalization = normalization
        self.parameters = DoubleGauss.parameters
        if normalization == "visible":
            self.parameters = tuple(
                replace(p, lower=0.35, domain=(0.34, p.domain[1])) if p.name == "k" else p
                for p in DoubleGauss.parameters
            )

    def check(self, values: Mapping[str, Any]) -> None:
        check_index(values["n"], values["kappa"])

    def matrix(self, geometry: Geometry, values: Mapping[str, Any], chosen: Mapping[str, str]) -> Matrix:
        a, k, b, t = (values[name] for name in ("a", "k", "b", "t"))
        shape = mrpv(geometry.cos_i, geometry.cos_r, geometry.cos_scattering, a, k, b)
        intensity, q, u = exit_polarisation(
            geometry,
            values["sigma"],
            values["n"],
            values["kappa"],
            k,
            self._normalization,
            chosen["transmittance"],
            chosen["accuracy"],
        )
        polarised = shape * t
        f = depolarising((shape - polarised) + polarised * intensity)
        f[1][0], f[2][0] = polarised * q, polarised * u
        return f

    def albedo(self, cos_theta: Any, values: Mapping[str, Any]) -> Any:
        return math.pi * mrpv(
            cos_theta, MEAN_COSINE, -MEAN_COSINE * cos_theta, values["a"], values["k"], values["b"]
        )


def _across(cos_theta: Any) -> Geometry:
    """Light from one direction seen from a mean direction, across the plane of incidence."""
    sin_theta = dr.sqrt(dr.maximum(dr.fma(-cos_theta, cos_theta, 1.0), 0.0))
    zero, one = 0.0 * cos_theta, 0.0 * cos_theta + 1.0
    return geometry_from_sines(
        sin_theta, cos_theta, math.sqrt(1.0 - MEAN_COSINE**2) * one, MEAN_COSINE * one, one, zero
    )
