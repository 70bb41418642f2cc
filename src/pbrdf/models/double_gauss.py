"""The double-Gauss pBRDF of painted surfaces, and its reciprocal variant.

Source: Zhang, Song, Zhao, "Double-Gauss polarimetric BRDF model of painted surfaces", Infrared and Laser
Engineering 46(11), 1117002 (2017), eqs (2)-(14). One Gaussian is the slope statistics of the facets that
reflect, the other the average of the Fresnel transmission of body light over the same facets.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from copy import copy
from typing import Any, ClassVar, Self

import drjit as dr
import numpy as np

from pbrdf.backend import get_backend
from pbrdf.errors import ModelError
from pbrdf.models.arrays import Matrix, to_numpy
from pbrdf.models.base import Model
from pbrdf.models.evaluation import horizon_guard
from pbrdf.models.parameters import Option, Parameter
from pbrdf.optics.diffuse import mrpv
from pbrdf.optics.facet_reflection import facet_reflection, tan2_tilt
from pbrdf.optics.facets import projected_area_density
from pbrdf.optics.fresnel import mueller_reflection
from pbrdf.optics.geometry import Geometry, geometry_from_angles
from pbrdf.optics.quadrature import ACCURACIES, PACKET_RULE, RULES, choose_rule, wedge_distance
from pbrdf.optics.shadowing import SHADOWING
from pbrdf.optics.transmission import (
    NORMALIZATIONS,
    TRANSMITTANCES,
    average_steepness,
    exit_and_entry_polarisation,
    exit_and_entry_sums,
    exit_polarisation,
    exit_sums,
)

__all__ = [
    "AMPLITUDE",
    "ASYMMETRY",
    "EXTINCTION",
    "INDEX",
    "MEAN_COSINE",
    "MINNAERT",
    "POLARISED_SHARE",
    "SLOPE",
    "DoubleGauss",
    "ReciprocalDoubleGauss",
    "check_index",
    "specular_reflection",
]

_INFINITY = float("inf")

# The parameters, which other models of Gaussian facets or of the same body share
SLOPE = Parameter(
    "sigma", "σ", "1", "standard deviation of one slope component of the facets",
    0.002, 0.6, (0.001, 1.0), 0.04, logarithmic=True, part="specular",
)  # fmt: skip
INDEX = Parameter(
    "n", "n", "1", "real refractive index of the coating",
    1.2, 2.6, (0.01, 100.0), 1.6, part="specular", refractive_index=True,
)  # fmt: skip
EXTINCTION = Parameter(
    "kappa", "κ", "1", "extinction of the coating's index n − iκ, 0 for a dielectric",
    0.0, 5.0, (0.0, 100.0), 0.0, fitted=False, part="specular", vanishing=True, extinction_of="n",
)  # fmt: skip
AMPLITUDE = Parameter(
    "a", "a", "1", "diffuse amplitude, on the data's own scale",
    1e-4, 100.0, (0.0, _INFINITY), 1.0, logarithmic=True, part="diffuse", amplitude=True,
)  # fmt: skip
MINNAERT = Parameter(
    "k", "k", "1", "Minnaert-type exponent, 1 for a Lambertian body",
    0.3, 4.0, (0.0, 20.0), 1.2, part="diffuse",
)  # fmt: skip
ASYMMETRY = Parameter(
    "b", "b", "1", "forward (> 0) or backward (< 0) asymmetry",
    -3.0, 4.0, (-20.0, 20.0), 0.0, part="diffuse",
)  # fmt: skip
POLARISED_SHARE = Parameter(
    "t", "t", "1", "polarised share of the diffuse part",
    0.0, 1.0, (0.0, 1.0), 0.5, part="diffuse",
)  # fmt: skip

_SHADOWING = Option(
    *SHADOWING,
    description="shadowing and masking of the facets, v-cavity (paper eq. 4), height-correlated smith or none",
)
_ACCURACY = Option(
    *ACCURACIES,
    description="accuracy of the average over the facets, high (slow) for reference values, draft for searching, "
    "fast for rendering, see docs/model.md, section 4",
)

#: Fewer directions than this are not worth a kernel for each rule of the average over the facets.
_FEW = 1 << 16
#: Up to this slope standard deviation a renderer averages over the facets with accuracy ``fast``.
FAST_SIGMA = 0.06
#: Up to this one by the rule for packets of rays.
PACKET_SIGMA = 0.12
#: Bounds of a fit for normalization="visible", whose average diverges for k ≤ 1/3.
_VISIBLE_K = 0.35
#: cosθ of the direction of view at which the diffuse albedo is estimated: the mean of cosθ over cosθ dω.
MEAN_COSINE = 2.0 / 3.0


def specular_reflection(geometry: Geometry, sigma: Any, n: Any, kappa: Any | None, shadowing: str) -> Matrix:
    """f_mf of Gaussian facets in 1/sr, paper eqs (2)-(4)."""
    density = projected_area_density(geometry.facet[2], tan2_tilt(geometry), sigma)
    return facet_reflection(geometry, density, SHADOWING[shadowing](geometry, sigma), n, kappa)


def check_index(n: Any, kappa: Any, names: tuple[str, str] = ("n", "kappa")) -> None:
    """Check that a dielectric is denser than air; raises ModelError."""
    n, kappa = to_numpy(n), to_numpy(kappa)
    if n is not None and kappa is not None and ((n < 1.0) & (kappa == 0.0)).any():
        raise ModelError(
            f"{names[0]} must be at least 1 where {names[1]} is 0: the coating is denser than air"
        )


class _GaussianFacets(Model):
    """What both models share: Gaussian facets on a coating of index n − iκ over a body of the MRPV shape."""

    parameters: ClassVar[tuple[Parameter, ...]] = (
        SLOPE,
        INDEX,
        EXTINCTION,
        AMPLITUDE,
        MINNAERT,
        ASYMMETRY,
        POLARISED_SHARE,
    )
    gaussian_slopes: ClassVar[bool] = True
    ablations: ClassVar[Mapping[str, Mapping[str, float]]] = {"unpolarised body": {"t": 0.0}}
    #: The rule by which all directions average over the facets, None where each takes its own.
    facet_rule: str | None = None
    #: Averages found before, and which directions do not take them (None: all do).
    facet_sums: tuple[list[Any], Any] | None = None

    def for_rendering(self) -> Self:
        """``fast`` where that is exact enough; else ``default``, by the rule for packets of rays where that is."""
        widest = np.max(self.lobe_width())
        if widest <= FAST_SIGMA:
            return self.with_accuracy("fast")
        model = self.with_accuracy("default")
        return model._with_rule(PACKET_RULE) if widest <= PACKET_SIGMA else model

    def lane_groups(
        self, scalars: Mapping[str, Any], floats: Mapping[str, Any], size: int, part: str
    ) -> Sequence[tuple[Self, Any]]:
        """All directions together, once the averages over the facets are found: the directions by their rule."""
        accuracy = self.chosen["accuracy"]
        if part == "specular" or accuracy == "fast" or self.facet_rule is not None:
            return [(self, None)]
        normalization = self.chosen.get("normalization", "weighted")

        def rule(theta_i: Any, theta_r: Any, sigma: Any, k: Any) -> Any:
            (sin_i, cos_i), (sin_r, cos_r) = dr.sincos(theta_i), dr.sincos(theta_r)
            c_i, c_r = wedge_distance(cos_i, sin_i, sigma), wedge_distance(cos_r, sin_r, sigma)
            return choose_rule(c_i, c_r, sigma, average_steepness(k, normalization), accuracy)

        # the rule goes up with each of these
        names = "theta_i", "theta_r", "sigma"
        low, high = ([float(f(scalars[name])) for name in names] for f in (np.min, np.max))
        k = [float(f(scalars["k"])) for f in (np.min, np.max)]
        first = rule(low[0], low[1], low[2], min(max(1.0, k[0]), k[1]))
        last = rule(high[0], high[1], high[2], max(k, key=lambda x: abs(x - 1.0)))
        if first == last:
            return [(self._with_rule(RULES[first]), None)]
        if size < _FEW:
            return [(self, None)]
        found = rule(floats["theta_i"], floats["theta_r"], floats["sigma"], floats["k"])
        dr.eval(found)
        # the rule of fewest points is taken with the rest of the kernel: who takes it need not be listed
        groups = {RULES[j]: dr.compress(found == j) for j in range(max(first, 1), last + 1)}
        groups = {name: lanes for name, lanes in groups.items() if dr.width(lanes)}
        return [(self._with_sums(groups, scalars, floats, size), None)]

    def _with_sums(
        self, groups: Mapping[str, Any], scalars: Mapping[str, Any], floats: Mapping[str, Any], size: int
    ) -> Self:
        """The same model with the averages of directions found, by groups of indices that take one rule.

        Each group reads its directions where they are and writes the sums one after another: the matrices, which are
        four times as long, are then all written in their order.
        """
        backend = get_backend()
        Float, UInt32, Packet = backend.Float, backend.UInt32, backend.module.ArrayXf64
        total, start, width = sum(dr.width(lanes) for lanes in groups.values()), 0, 0
        place, found = dr.zeros(UInt32, size), None
        for rule, lanes in groups.items():
            taken = {
                name: dr.opaque(Float, x) if isinstance(x, float) else dr.gather(Float, x, lanes)
                for name, x in floats.items()
            }
            values = {p.name: taken[p.name] for p in self.parameters}
            absent = [p.name for p in self.parameters if p.vanishing and not np.any(scalars[p.name])]
            values |= dict.fromkeys(absent)
            theta_i, theta_r, _ = horizon_guard(taken["theta_i"], taken["theta_r"])
            sums = self._averages(geometry_from_angles(theta_i, theta_r, taken["phi"]), values, rule)
            if found is None:
                width = len(sums)
                found = dr.empty(Float, total * width)
            position = dr.arange(UInt32, dr.width(lanes)) + dr.opaque(UInt32, start)
            dr.scatter(found, Packet(sums), position)
            dr.scatter(place, position + 1, lanes)
            dr.eval(found, place)
            start += dr.width(lanes)
        if found is None:
            return self._with_rule(RULES[0])
        own = place == 0
        packet: Any = dr.gather(Packet, found, dr.select(own, 0, place - 1), shape=(width, size))
        other = self._with_rule(RULES[0])
        object.__setattr__(other, "facet_sums", (list(packet), own if total < size else None))
        return other

    def _averages(self, geometry: Geometry, values: Mapping[str, Any], rule: str | None) -> list[Any]:
        """Averages over the facets that the polarised body is made of."""
        raise NotImplementedError

    def _sums(self, geometry: Geometry, values: Mapping[str, Any]) -> list[Any]:
        """The same, where they were found before from there."""
        if self.facet_sums is None:
            return self._averages(geometry, values, self.facet_rule)
        sums, own = self.facet_sums
        if own is None:
            return sums
        here = self._averages(geometry, values, self.facet_rule)
        return [dr.select(own, a, b) for a, b in zip(here, sums, strict=True)]

    def _with_rule(self, rule: str) -> Self:
        """The same model for directions that all take one rule."""
        other = copy(self)
        object.__setattr__(other, "facet_rule", rule)
        return other

    def lobe_width(self, values: Mapping[str, Any] | None = None) -> Any:
        """σ."""
        return (self.values if values is None else values)["sigma"]

    def albedos(self, cos_theta: Any, values: Mapping[str, Any]) -> tuple[Any, Any]:
        """Fresnel reflectance of the flat surface, and the diffuse albedo of a mean direction."""
        facets = mueller_reflection(cos_theta, values["n"], values["kappa"]).mean
        body = mrpv(cos_theta, MEAN_COSINE, -MEAN_COSINE * cos_theta, values["a"], values["k"], values["b"])
        return facets, math.pi * body

    def _check_together(self) -> None:
        check_index(self.values["n"], self.values["kappa"])


class DoubleGauss(_GaussianFacets):
    """Double-Gauss pBRDF: facets that reflect plus polarised diffuse body light."""

    name: ClassVar[str] = "double-gauss"
    options: ClassVar[Mapping[str, Option]] = {
        "normalization": Option(
            *NORMALIZATIONS,
            description="reading of paper eq. (13), visible needs k > 1/3, see :mod:`pbrdf.optics.transmission`",
        ),
        "transmittance": Option(*TRANSMITTANCES, description="transmittance in M_t"),
        "shadowing": _SHADOWING,
        "accuracy": _ACCURACY,
    }
    readings: ClassVar[Mapping[str, Mapping[str, str]]] = {"visible": {"normalization": "visible"}}

    @classmethod
    def fit_bounds(cls, parameter: Parameter, options: Mapping[str, str]) -> tuple[float, float]:
        """Those of the parameter, away from where the average ``visible`` diverges."""
        lower, upper = super().fit_bounds(parameter, options)
        if parameter.name == "k" and options.get("normalization") == "visible":
            lower = max(lower, _VISIBLE_K)
        return lower, upper

    def _check_together(self) -> None:
        super()._check_together()
        if self.chosen["normalization"] == "visible":
            k = to_numpy(self.values["k"])
            if k is not None and (k <= 1.0 / 3.0).any():
                raise ModelError(
                    f"k={k.min():g}: normalization='visible' needs k > 1/3, its integral diverges"
                )

    def kernel(self, geometry: Geometry, values: Mapping[str, Any], part: str = "total") -> Matrix:
        """4 x 4 Mueller matrix over generic Dr.Jit floats, paper eq. (14)."""
        sigma, n, kappa = values["sigma"], values["n"], values["kappa"]
        f: Matrix = [[0.0] * 4 for _ in range(4)]
        if part != "diffuse":
            f = specular_reflection(geometry, sigma, n, kappa, self.chosen["shadowing"])
        if part != "specular":
            f_rpv = mrpv(
                geometry.cos_i, geometry.cos_r, geometry.cos_scattering, values["a"], values["k"], values["b"]
            )
            self._add_diffuse(f, geometry, values, f_rpv)
        return f

    def _averages(self, geometry: Geometry, values: Mapping[str, Any], rule: str | None) -> list[Any]:
        return exit_sums(
            geometry,
            values["sigma"],
            values["n"],
            values["kappa"],
            values["k"],
            self.chosen["normalization"],
            self.chosen["transmittance"],
            self.chosen["accuracy"],
            rule,
        )

    def _add_diffuse(self, f: Matrix, geometry: Geometry, values: Mapping[str, Any], f_rpv: Any) -> None:
        """Add f_rpv [(1 − t) D_s + t D_v], paper eq. (11)."""
        intensity, q, u = exit_polarisation(
            geometry,
            values["sigma"],
            values["n"],
            values["kappa"],
            values["k"],
            self.chosen["normalization"],
            self.chosen["transmittance"],
            self.chosen["accuracy"],
            self._sums(geometry, values),
        )
        t = values["t"]
        polarised = f_rpv * t
        f[0][0] = f[0][0] + (f_rpv - polarised) + polarised * intensity
        f[1][0] = f[1][0] + polarised * q
        f[2][0] = f[2][0] + polarised * u


class ReciprocalDoubleGauss(_GaussianFacets):
    """Double-Gauss pBRDF in which body light also enters through the facets; beyond the paper.

    f = f_mf + f_rpv [(1 − t) D_s + t D_b], D_b = E[W T_out D_s T_in]/E[W] with the transmittances of flux
    (docs/model.md, section 3): Helmholtz reciprocity holds for the whole Mueller matrix.
    """

    name: ClassVar[str] = "reciprocal-double-gauss"
    options: ClassVar[Mapping[str, Option]] = {"shadowing": _SHADOWING, "accuracy": _ACCURACY}

    def kernel(self, geometry: Geometry, values: Mapping[str, Any], part: str = "total") -> Matrix:
        """4 x 4 Mueller matrix over generic Dr.Jit floats."""
        sigma, n, kappa, k, t = (values[name] for name in ("sigma", "n", "kappa", "k", "t"))
        f: Matrix = [[0.0] * 4 for _ in range(4)]
        if part != "diffuse":
            f = specular_reflection(geometry, sigma, n, kappa, self.chosen["shadowing"])
        if part != "specular":
            f_rpv = mrpv(geometry.cos_i, geometry.cos_r, geometry.cos_scattering, values["a"], k, values["b"])
            block = exit_and_entry_polarisation(
                geometry, sigma, n, kappa, k, self.chosen["accuracy"], self._sums(geometry, values)
            )
            polarised = f_rpv * t
            f[0][0] = f[0][0] + (f_rpv - polarised)
            for i in range(3):
                for j in range(3):
                    f[i][j] = f[i][j] + polarised * block[i][j]
        return f

    def _averages(self, geometry: Geometry, values: Mapping[str, Any], rule: str | None) -> list[Any]:
        sigma, n, kappa, k = (values[name] for name in ("sigma", "n", "kappa", "k"))
        return exit_and_entry_sums(geometry, sigma, n, kappa, k, self.chosen["accuracy"], rule)
