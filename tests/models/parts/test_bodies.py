"""Bodies: limits with closed forms, and the sources' own numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import independent as ref
from pbrdf.models import DoubleGauss
from pbrdf.models.composed import ComposedModel
from pbrdf.models.parts.bodies import CoatedLambert, HotSpotRPV, PolarisedMRPV, Subsurface
from pbrdf.models.parts.simple_bodies import MRPV
from pbrdf.models.reflectance import directional_hemispherical_reflectance

ANGLES = np.array([0.0, 0.5, 1.1, 1.4]), np.array([0.4, 0.5, 0.2, 1.3]), np.array([0.0, 2.1, -0.7, 0.1])
N, RHO_INT = 1.6207, 0.66085


def body(*parts, **values):
    """A model of nothing but a body."""
    return type("Body", (ComposedModel,), {"name": "body", "parts": parts})(**values)


@pytest.mark.parametrize(("degrees", "dolp"), [(0, 0.0), (30, 0.022205), (60, 0.121125), (80, 0.296870)])
@pytest.mark.parametrize("part", [Subsurface(), CoatedLambert()])
def test_degree_of_polarisation_of_scatmech(part, degrees, dolp):
    """Table of LITERATURE 3e (SCATMECH and Mitsuba), from any direction of light; the light is polarised along p."""
    model = body(part, **{p.name: N if p.name == "n" else 0.4 for p in part.parameters})
    f = model.mueller([0.0, 0.3, 1.2], np.radians(degrees), [0.0, 1.0, 3.0])
    np.testing.assert_allclose(f[:, 1, 0] / f[:, 0, 0], dolp, atol=1e-6)
    np.testing.assert_allclose(f[:, 1, 0] / f[:, 0, 0], ref.diffuse_dolp(np.radians(degrees), N), atol=1e-9)


def test_germers_body_is_scatmechs(subsurface_table):
    """72 matrices (scripts/make_subsurface_numbers.py): the shape to the last digits, brightness where R is small.

    Elsewhere the brightness tells the ρ_int that SCATMECH integrates, good to 3e-4; ours is exact (test_fresnel).
    """
    table = subsurface_table
    n, R, expected = table["n"], table["pigment"], table["M"]
    f = body(Subsurface(), n=n, pigment=R).mueller(table["theta_i"], table["theta_r"], table["phi"])
    f00, e00 = f[:, 0, 0], expected[:, 0, 0]
    np.testing.assert_allclose(f / f00[:, None, None], expected / e00[:, None, None], atol=1e-14)
    faint = R < 1e-3
    assert faint.sum() == 24
    np.testing.assert_allclose(f00[faint], e00[faint], rtol=1e-9)
    rho_int = 1.0 - (1.0 - ref.external_diffuse_reflectance(n)) / n**2
    theirs = (1.0 - (1.0 - rho_int * R) * f00 / e00) / R
    np.testing.assert_allclose(theirs[~faint], rho_int[~faint], atol=3e-4)


@pytest.mark.parametrize("R", [0.1, 0.7, 1.0])
def test_germers_body_adds_up_what_the_surface_sends_back(R):
    """(R/π) T_o Dep T_i/n² (1 + ρR + (ρR)² + …), with SCATMECH's ρ_int."""
    model = body(Subsurface(), n=N, pigment=R)
    orders = R / (np.pi * N**2) * sum((RHO_INT * R) ** j for j in range(200))
    f = model.mueller(*ANGLES)
    for j, (theta_i, theta_r) in enumerate(zip(*ANGLES[:2], strict=True)):
        rays = []
        for theta in (theta_i, theta_r):
            T_p, T_s = ref.transmittance(theta, N, "flux")
            rays.append(np.array([0.5 * (T_p + T_s), 0.5 * (T_p - T_s), 0.0, 0.0]))
        np.testing.assert_allclose(f[j], orders * np.outer(rays[1], rays[0]), rtol=1e-4, atol=1e-12)


@pytest.mark.parametrize("n", [1.0, 1.3, 1.6207, 2.5])
def test_a_white_pigment_returns_all_that_enters(n):
    """R = 1: the reflectance is T_i(θ_i), that of the flat surface's complement; below 1 it is less."""
    theta = np.array([0.0, 0.7, 1.3])
    T_p, T_s = ref.transmittance(theta, n, "flux")
    white = directional_hemispherical_reflectance(body(Subsurface(), n=n, pigment=1.0), theta)
    np.testing.assert_allclose(white, 0.5 * (T_p + T_s), rtol=1e-5)
    grey = directional_hemispherical_reflectance(body(Subsurface(), n=n, pigment=0.9), theta)
    assert (grey < 0.95 * white).all()


@pytest.mark.parametrize(
    ("part", "values"),
    [
        (Subsurface(), {"n": 1.0, "pigment": 0.37}),
        (CoatedLambert(), {"n": 1.0, "albedo": 0.37}),
        (HotSpotRPV(), {"rho_0": 0.37, "k": 1.0, "asymmetry": 0.0, "rho_c": 1.0}),
        (PolarisedMRPV(), {"sigma": 0.1, "n": 1.6, "a": 0.37, "k": 1.0, "b": 0.0, "t": 0.0}),
    ],
    ids=lambda x: type(x).__name__ if not isinstance(x, dict) else "",
)
def test_lambert_limits(part, values):
    """No surface, no shape, no polarised share: 0.37/π and nothing but intensity."""
    f = body(part, **values).mueller(*ANGLES)
    expected = np.zeros((4, 4))
    expected[0, 0] = 0.37 / np.pi
    np.testing.assert_allclose(f, np.broadcast_to(expected, f.shape), atol=1e-15)


def test_baeks_body_loses_what_the_surface_sends_back():
    """Its reflectance is ρ_d T_i(θ_i) (1 − ρ_ext), with 1 − ρ_ext = n² (1 − ρ_int)."""
    theta = np.array([0.0, 0.7, 1.3])
    T_p, T_s = ref.transmittance(theta, N, "flux")
    found = directional_hemispherical_reflectance(body(CoatedLambert(), n=N, albedo=0.6), theta)
    np.testing.assert_allclose(found, 0.6 * 0.5 * (T_p + T_s) * N**2 * (1.0 - RHO_INT), rtol=1e-4)


def test_rpv_body_is_eradiates(rpv_table):
    """60 matrices (scripts/make_eradiate_numbers.py), a quarter of them within the hot spot."""
    angles = [rpv_table[name] for name in ("theta_i", "theta_r", "phi")]
    values = {name: rpv_table[name] for name in ("rho_0", "k", "asymmetry", "rho_c")}
    expected = rpv_table["M"]
    np.testing.assert_allclose(
        body(HotSpotRPV(), **values).mueller(*angles), expected, rtol=0, atol=1e-13 * expected.max()
    )
    without = body(HotSpotRPV(), **{**values, "rho_c": 1.0}).mueller(*angles)
    assert (expected[:, 0, 0] > 1.4 * without[:, 0, 0]).sum() >= 10


def test_hot_spot_only_in_backscatter():
    angles = np.full(3, 0.6), np.array([0.6, 0.6, 0.9]), np.array([np.pi, 0.0, np.pi])
    with_it, without = (
        body(HotSpotRPV(), rho_0=0.2, k=0.8, asymmetry=-0.1, rho_c=c).mueller(*angles)[:, 0, 0]
        for c in (0.2, 1.0)
    )
    ratio = with_it / without
    assert ratio[0] == pytest.approx(1.8) and ratio[0] > ratio[2] > ratio[1] > 1.0


@pytest.mark.parametrize("normalization", ["weighted", "visible"])
@pytest.mark.parametrize("transmittance", ["flux", "amplitude"])
@pytest.mark.parametrize("kappa", [0.0, 0.8])
def test_polarised_body_is_that_of_the_double_gauss(normalization, transmittance, kappa):
    values = {"sigma": 0.2, "n": 1.6, "kappa": kappa, "a": 0.9, "k": 1.3, "b": 0.4, "t": 0.7}
    whole = DoubleGauss(**values, normalization=normalization, transmittance=transmittance)
    expected = whole.mueller(*ANGLES, part="diffuse")
    found = body(PolarisedMRPV(normalization), **values, transmittance=transmittance).mueller(*ANGLES)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)


def test_polarised_body_without_its_share_is_the_ablation():
    """t = 0 is the depolarising MRPV body."""
    shape = {"a": 0.9, "k": 1.3, "b": 0.4}
    found = body(PolarisedMRPV(), sigma=0.2, n=1.6, t=0.0, **shape).mueller(*ANGLES)
    np.testing.assert_allclose(found, body(MRPV(), **shape).mueller(*ANGLES), rtol=1e-14)


def test_visible_means_keep_k_where_they_converge():
    """The average diverges for k ≤ 1/3; the other parameters are those of the double-Gauss."""
    weighted, visible = (
        {p.name: p for p in PolarisedMRPV(kind).parameters} for kind in ("weighted", "visible")
    )
    assert visible["k"].lower > 1.0 / 3.0 and visible["k"].domain[0] > 1.0 / 3.0
    assert {**weighted, "k": None} == {**visible, "k": None}
    assert replace(visible["k"], lower=0.3, domain=(0.0, 20.0)) == weighted["k"]


@pytest.mark.parametrize(
    "model",
    [
        body(Subsurface(), n=1.5, pigment=0.6),
        body(CoatedLambert(), n=1.5, albedo=0.6),
        body(HotSpotRPV(), rho_0=0.2, k=0.9, asymmetry=0.1, rho_c=0.5),
        body(PolarisedMRPV(), sigma=0.1, n=1.6, a=0.5, k=1.2, b=0.3, t=0.4),
    ],
    ids=lambda model: type(model.parts[0]).__name__,
)
def test_rough_albedos_are_near_the_reflectance(model):
    """What a renderer draws by: within a third of the directional-hemispherical reflectance."""
    import drjit as dr

    from pbrdf.backend import get_backend

    Float = get_backend().Float
    values = {name: Float(value) for name, value in model.values.items()}
    for theta in (0.0, 0.8):
        (share,) = dr.detach(model.albedos(Float(np.cos(theta)), values)[1]).numpy()
        assert share == pytest.approx(directional_hemispherical_reflectance(model, theta), rel=1.0 / 3.0)
