"""The double-Gauss pBRDF of painted surfaces, and its reciprocal variant.

Source: Zhang, Song, Zhao, "Double-Gauss polarimetric BRDF model of painted surfaces", Infrared and Laser
Engineering 46(11), 1117002 (2017), eqs (2)-(14). One Gaussian is the slope statistics of the facets that
reflect, the other the average of the Fresnel transmission of body light over the same facets.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Self

import numpy as np

from pbrdf.errors import ModelError
from pbrdf.models import evaluation
from pbrdf.models.base import Matrix, Model
from pbrdf.models.parameters import Parameter
from pbrdf.optics.diffuse import mrpv
from pbrdf.optics.facets import projected_area_density
from pbrdf.optics.fresnel import mueller_reflection
from pbrdf.optics.geometry import Geometry
from pbrdf.optics.quadrature import ACCURACIES
from pbrdf.optics.reference_planes import facet_rotations
from pbrdf.optics.shadowing import SHADOWING
from pbrdf.optics.transmission import (
    NORMALIZATIONS,
    TRANSMITTANCES,
    exit_and_entry_polarisation,
    exit_polarisation,
)

__all__ = ["DoubleGauss", "ReciprocalDoubleGauss", "specular_reflection", "split_index"]

_INFINITY = float("inf")

_PARAMETERS = (
    Parameter(
        "sigma", "σ", "1", "standard deviation of one slope component of the facets",
        0.002, 0.6, (0.001, 1.0), 0.04, logarithmic=True,
    ),
    Parameter("n", "n", "1", "real refractive index of the coating", 1.2, 2.6, (0.01, 100.0), 1.6),
    Parameter(
        "kappa", "κ", "1", "extinction of the coating's index n − iκ, 0 for a dielectric",
        0.0, 5.0, (0.0, 100.0), 0.0, fitted=False,
    ),
    Parameter(
        "a", "a", "1", "diffuse amplitude, on the data's own scale",
        1e-4, 100.0, (0.0, _INFINITY), 1.0, logarithmic=True,
    ),
    Parameter("k", "k", "1", "Minnaert-type exponent, 1 for a Lambertian body", 0.3, 4.0, (0.0, 20.0), 1.2),
    Parameter("b", "b", "1", "forward (> 0) or backward (< 0) asymmetry", -3.0, 4.0, (-20.0, 20.0), 0.0),
    Parameter("t", "t", "1", "polarised share of the diffuse part", 0.0, 1.0, (0.0, 1.0), 0.5),
)  # fmt: skip


def specular_reflection(geometry: Geometry, sigma: Any, n: Any, kappa: Any | None, shadowing: str) -> Matrix:
    """f_mf = P G M(−α2) M_r M(α1)/(4 cosθ cosθ_i cosθ_r) in 1/sr, paper eq. (2)."""
    m = geometry.facet
    tan2 = (m[0] * m[0] + m[1] * m[1]) / (m[2] * m[2])
    scale = projected_area_density(m[2], tan2, sigma) * SHADOWING[shadowing](geometry, sigma)
    scale = scale / (4.0 * m[2] * geometry.cos_i * geometry.cos_r)
    r = mueller_reflection(geometry.cos_beta, n, kappa)
    A, B, C = r.mean * scale, r.difference * scale, r.real * scale
    c1, s1, c2, s2 = facet_rotations(geometry)
    f = [
        [A, B * c1, B * s1, 0.0],
        [B * c2, A * c1 * c2 + C * s1 * s2, A * s1 * c2 - C * c1 * s2, 0.0],
        [B * s2, A * c1 * s2 - C * s1 * c2, A * s1 * s2 + C * c1 * c2, 0.0],
        [0.0, 0.0, 0.0, C],
    ]
    if r.imaginary is not None:
        D = r.imaginary * scale
        f[1][3], f[2][3] = D * s2, -D * c2
        f[3][1], f[3][2] = -D * s1, D * c1
    return f


class DoubleGauss(Model):
    """Double-Gauss pBRDF (module docstring): facets that reflect plus polarised diffuse body light.

    Parameters
    ----------
    sigma
        Standard deviation of one slope component of the facets, 1.
    n
        Refractive index n − iκ of the coating; complex allowed, with an imaginary part ≤ 0.
    a
        Diffuse amplitude, 1, on the data's own scale.
    k
        Minnaert-type exponent, 1; k = 1, b = 0 is Lambertian.
    b
        Forward (> 0) or backward (< 0) asymmetry, 1.
    t
        Polarised share of the diffuse part, 0 … 1.
    kappa
        Extinction κ ≥ 0, if ``n`` is not given as a complex number.
    normalization
        Reading of eq. (13): ``"weighted"`` or ``"visible"`` (k > 1/3), see :mod:`pbrdf.optics.transmission`.
    transmittance
        Transmittance in M_t: ``"flux"`` or ``"amplitude"``.
    shadowing
        ``"v-cavity"`` (paper eq. 4), ``"smith"`` (height-correlated) or ``"none"``.
    accuracy
        Accuracy of the average over the facets: ``"default"``, ``"high"`` (slow, for reference values),
        ``"draft"`` (for searching) or ``"fast"`` (for rendering), see docs/model.md, section 4.

    Every parameter may be an array (a map of paints) that broadcasts against the angles.

    Raises
    ------
    ModelError
        If a parameter is not finite or outside its domain, or an option is unknown.
    """

    name: ClassVar[str] = "double-gauss"
    parameters: ClassVar[tuple[Parameter, ...]] = _PARAMETERS
    options: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "normalization": NORMALIZATIONS,
        "transmittance": TRANSMITTANCES,
        "shadowing": tuple(SHADOWING),
        "accuracy": tuple(ACCURACIES),
    }

    def __init__(
        self,
        sigma: Any,
        n: Any,
        a: Any,
        k: Any,
        b: Any,
        t: Any,
        *,
        kappa: Any = 0.0,
        normalization: str = "weighted",
        transmittance: str = "flux",
        shadowing: str = "v-cavity",
        accuracy: str = "default",
    ) -> None:
        n, kappa = split_index(n, kappa)
        super().__init__(
            {"sigma": sigma, "n": n, "kappa": kappa, "a": a, "k": k, "b": b, "t": t},
            {
                "normalization": normalization,
                "transmittance": transmittance,
                "shadowing": shadowing,
                "accuracy": accuracy,
            },
        )

    @classmethod
    def from_values(cls, values: Mapping[str, Any], **chosen: str) -> Self:
        """Build a model from parameter values by name (``n`` and ``kappa`` apart) and options."""
        return cls(**values, **chosen)

    def _check_together(self) -> None:
        check_index(self.values["n"], self.values["kappa"])
        if self.chosen["normalization"] == "visible":
            k = evaluation.to_numpy(self.values["k"])
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
        )
        t = values["t"]
        polarised = f_rpv * t
        f[0][0] = f[0][0] + (f_rpv - polarised) + polarised * intensity
        f[1][0] = f[1][0] + polarised * q
        f[2][0] = f[2][0] + polarised * u


class ReciprocalDoubleGauss(Model):
    """Double-Gauss pBRDF in which body light also enters through the facets; beyond the paper.

    f = f_mf + f_rpv [(1 − t) D_s + t D_b], D_b = E[W T_out D_s T_in]/E[W] with the transmittances of flux
    (docs/model.md, section 3): Helmholtz reciprocity holds for the whole Mueller matrix. Parameters are those
    of :class:`DoubleGauss`.
    """

    name: ClassVar[str] = "reciprocal-double-gauss"
    parameters: ClassVar[tuple[Parameter, ...]] = _PARAMETERS
    options: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "shadowing": tuple(SHADOWING),
        "accuracy": tuple(ACCURACIES),
    }

    def __init__(
        self,
        sigma: Any,
        n: Any,
        a: Any,
        k: Any,
        b: Any,
        t: Any,
        *,
        kappa: Any = 0.0,
        shadowing: str = "v-cavity",
        accuracy: str = "default",
    ) -> None:
        n, kappa = split_index(n, kappa)
        super().__init__(
            {"sigma": sigma, "n": n, "kappa": kappa, "a": a, "k": k, "b": b, "t": t},
            {"shadowing": shadowing, "accuracy": accuracy},
        )

    @classmethod
    def from_values(cls, values: Mapping[str, Any], **chosen: str) -> Self:
        """Build a model from parameter values by name (``n`` and ``kappa`` apart) and options."""
        return cls(**values, **chosen)

    def _check_together(self) -> None:
        check_index(self.values["n"], self.values["kappa"])

    def kernel(self, geometry: Geometry, values: Mapping[str, Any], part: str = "total") -> Matrix:
        """4 x 4 Mueller matrix over generic Dr.Jit floats."""
        sigma, n, kappa, k, t = (values[name] for name in ("sigma", "n", "kappa", "k", "t"))
        f: Matrix = [[0.0] * 4 for _ in range(4)]
        if part != "diffuse":
            f = specular_reflection(geometry, sigma, n, kappa, self.chosen["shadowing"])
        if part != "specular":
            f_rpv = mrpv(geometry.cos_i, geometry.cos_r, geometry.cos_scattering, values["a"], k, values["b"])
            block = exit_and_entry_polarisation(geometry, sigma, n, kappa, k, self.chosen["accuracy"])
            polarised = f_rpv * t
            f[0][0] = f[0][0] + (f_rpv - polarised)
            for i in range(3):
                for j in range(3):
                    f[i][j] = f[i][j] + polarised * block[i][j]
        return f


def split_index(n: Any, kappa: Any) -> tuple[Any, Any]:
    """Split a complex index n − iκ into (n, κ); a real one keeps the κ given apart.

    Raises
    ------
    ModelError
        If the imaginary part is positive, or κ is given twice.
    """
    if evaluation.is_drjit(n) or not np.iscomplexobj(n):
        return n, kappa
    if np.any(np.imag(n) != 0.0) and np.any(np.asarray(kappa) != 0.0):
        raise ModelError("the extinction is given twice: as the imaginary part of n and as kappa")
    if np.any(np.imag(n) > 0.0):
        raise ModelError(
            f"n={n}: the imaginary part must be ≤ 0, the convention is n − iκ with κ ≥ 0; give the conjugate"
        )
    return n.real, (-n.imag if np.any(np.imag(n) != 0.0) else kappa)


def check_index(n: Any, kappa: Any) -> None:
    """Check that a non-absorbing coating is denser than air.

    Raises
    ------
    ModelError
        If n < 1 where κ = 0.
    """
    n, kappa = evaluation.to_numpy(n), evaluation.to_numpy(kappa)
    if n is not None and kappa is not None and ((n < 1.0) & (kappa == 0.0)).any():
        raise ModelError("n must be at least 1 where kappa is 0: the coating is denser than air")
