"""The physics checked in a second, against formulas and numbers that are not computed by the same code."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pbrdf.models import DoubleGauss
from pbrdf.optics.mueller import coherency_eigenvalues
from pbrdf.optics.stokes import dolp

__all__ = ["Check", "run_checks"]


@dataclass(frozen=True)
class Check:
    """One check and its outcome.

    Attributes
    ----------
    name
        What must hold.
    passed
        Whether it does.
    detail
        How far it is off, and how far it may be.
    """

    name: str
    passed: bool
    detail: str


def run_checks() -> list[Check]:
    """Run every check on the active backend."""
    return [_fresnel(), _lambert(), _diffuse_polarisation(), _realisable(), _reference_value()]


def _compared(name: str, found: float, expected: float, tolerance: float) -> Check:
    deviation = abs(found - expected) / abs(expected)
    return Check(
        name, deviation <= tolerance, f"{found:.9g}, off by {deviation:.1e} (allowed {tolerance:.0e})"
    )


def _fresnel() -> Check:
    """At normal incidence f = R/(8πσ²) with Fresnel's R = ((n − 1)/(n + 1))²."""
    sigma, n = 0.05, 1.5
    paint = DoubleGauss(sigma=sigma, n=n, a=1.0, k=1.0, b=0.0, t=0.0)
    reflectance = float(paint.mueller(0.0, 0.0, part="specular")[0, 0]) * 8.0 * math.pi * sigma**2
    return _compared(
        "Fresnel reflectance at normal incidence", reflectance, ((n - 1.0) / (n + 1.0)) ** 2, 1e-12
    )


def _lambert() -> Check:
    """k = 1, b = 0, t = 0: the diffuse part is Lambert's a/π everywhere."""
    paint = DoubleGauss(sigma=0.05, n=1.5, a=0.8, k=1.0, b=0.0, t=0.0)
    return _compared(
        "Lambertian limit a/π",
        float(paint.mueller(0.4, 1.1, 2.0, part="diffuse")[0, 0]),
        0.8 / math.pi,
        1e-12,
    )


def _diffuse_polarisation() -> Check:
    """σ → 0, t = 1: the DoLP of light transmitted out of a smooth dielectric, in closed form."""
    n, theta = 1.7, math.radians(60.0)
    paint = DoubleGauss(sigma=0.001, n=n, a=1.0, k=1.0, b=0.0, t=1.0)
    sin2 = math.sin(theta) ** 2
    expected = (n - 1.0 / n) ** 2 * sin2
    expected /= 2.0 + 2.0 * n**2 - (n + 1.0 / n) ** 2 * sin2 + 4.0 * math.cos(theta) * math.sqrt(n**2 - sin2)
    found = float(dolp(paint.stokes(0.3, theta, 1.0, part="diffuse")))
    return _compared("Polarisation of diffuse light, closed form", found, expected, 1e-4)


def _realisable() -> Check:
    """No Mueller matrix asks for more polarisation than physics allows."""
    draw = np.random.default_rng(0)
    size = 2000
    paint = DoubleGauss(
        sigma=draw.uniform(0.01, 0.4, size),
        n=draw.uniform(1.2, 2.5, size),
        a=draw.uniform(0.1, 2.0, size),
        k=draw.uniform(0.4, 2.5, size),
        b=draw.uniform(-1.0, 2.0, size),
        t=draw.uniform(0.0, 1.0, size),
    )
    zenith = draw.uniform(0.0, np.pi / 2.0, (2, size))
    f = np.asarray(paint.mueller(zenith[0], zenith[1], draw.uniform(-np.pi, np.pi, size)))
    worst = float((coherency_eigenvalues(f)[:, 0] / f[:, 0, 0]).min())
    passed = bool(np.isfinite(f).all()) and worst >= -1e-12
    return Check(
        f"{size} random Mueller matrices realisable", passed, f"least eigenvalue {worst:.1e} (allowed −1e-12)"
    )


def _reference_value() -> Check:
    """First column of a matrix from the independent table ``tests/data_oracle/double_gauss.csv``."""
    paint = DoubleGauss(
        sigma=0.05789375933198998,
        n=1.3533264781109533,
        a=1.1935138132766498,
        k=1.3460726925164133,
        b=-0.4743009482534184,
        t=0.8163381038190757,
    )
    expected = np.array([0.797167960497883, -0.17588812687268834, -0.006845206082873648, 0.0])
    f = np.asarray(paint.stokes(0.550196948747953, 0.6287804781712918, -0.03322176616148782))
    deviation = float(np.abs(f - expected).max() / expected[0])
    return Check(
        "Whole model against an independent value",
        deviation <= 1e-5,
        f"off by {deviation:.1e} (allowed 1e-05)",
    )
