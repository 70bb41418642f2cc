"""Sampling of the BSDF plugin: what is drawn has the density that is said, and the weights add up to the energy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from bsdf_helpers import SCALAR, call, directions, interaction, numbers, plugin, use

import pbrdf

PAINT = {"n": 1.6207, "a": 0.8, "k": 1.2504, "b": 0.1827, "t": 0.6717}


class Hemisphere:
    """The upper hemisphere as (azimuth, −cosθ), for Mitsuba's χ² test; its own domain is the whole sphere."""

    def __init__(self, mi):
        self.mi = mi

    def bounds(self):
        return self.mi.ScalarBoundingBox2f([-math.pi, -1.0], [math.pi, -1e-5])

    def aspect(self):
        return 2.0

    def map_forward(self, p):
        import drjit as dr

        sine = dr.safe_sqrt(1.0 - p.y * p.y)
        return self.mi.Vector3f(dr.cos(p.x) * sine, dr.sin(p.x) * sine, -p.y)

    def map_backward(self, v):
        import drjit as dr

        return self.mi.Vector2f(dr.atan2(v.y, v.x), -v.z)

    def area(self, p, v):
        """Solid angle per area of the domain."""
        return 1.0


class Lobe:
    """Directions about the mirror direction by the slopes of the half vector, in units of σ."""

    def __init__(self, mi, wi, sigma):
        self.mi, self.wi, self.sigma = mi, mi.Vector3f(*wi), sigma

    def bounds(self):
        return self.mi.ScalarBoundingBox2f([-5.0, -5.0], [5.0, 5.0])

    def aspect(self):
        return 1.0

    def _facet(self, p):
        import drjit as dr

        return dr.normalize(self.mi.Vector3f(self.sigma * p.x, self.sigma * p.y, 1.0))

    def map_forward(self, p):
        m = self._facet(p)
        return self.mi.reflect(self.wi, m)

    def map_backward(self, v):
        h = v + self.wi
        return self.mi.Vector2f(h.x, h.y) / (self.sigma * h.z)

    def area(self, p, v):
        import drjit as dr

        m = self._facet(p)
        return 4.0 * dr.maximum(dr.dot(m, self.wi), 0.0) * m.z**3 * self.sigma**2


def p_value(mi, bsdf, wi, domain, samples=400_000, fineness=8, resolution=51):
    """p of Mitsuba's χ² test; samples outside of the domain do not count, nor does the density there."""
    import drjit as dr
    from mitsuba.chi2 import ChiSquareTest

    box = domain.bounds()

    def sample(u):
        si = interaction(mi, np.broadcast_to(wi, (dr.width(u), 3)))
        bs, _ = bsdf.sample(mi.BSDFContext(), si, u.x, mi.Point2f(u.y, u.z))
        p = domain.map_backward(bs.wo)
        inside = dr.all((p >= box.min) & (p <= box.max)) & (bs.pdf > 0.0)
        somewhere = domain.map_forward(mi.Point2f(0.1, -0.4))
        return dr.select(inside, bs.wo, somewhere), dr.select(inside, mi.Float(1.0), 0.0)

    def density(v):
        si = interaction(mi, np.broadcast_to(wi, (dr.width(v), 3)))
        p = domain.map_backward(v)
        return bsdf.pdf(mi.BSDFContext(), si, v) * domain.area(p, v)

    test = ChiSquareTest(
        domain, sample, density, sample_dim=3, sample_count=samples, res=resolution, ires=fineness
    )
    test.run(quiet=True)
    assert not test.fail, test.messages
    return float(np.ravel(test.p_value)[0])


@pytest.mark.parametrize("degrees", [0.0, 30.0, 60.0, 80.0, 87.0])
@pytest.mark.parametrize("sigma", [0.1, 0.3, 0.6])
def test_chi_square_over_the_hemisphere(sigma, degrees):
    mi = use("llvm_ad_mono")
    bsdf = plugin(mi, pbrdf.DoubleGauss(sigma, **PAINT))
    theta = math.radians(degrees)
    wi = [0.6 * math.sin(theta), -0.8 * math.sin(theta), math.cos(theta)]
    # 15 tests at a level of 1 % altogether
    assert p_value(mi, bsdf, wi, Hemisphere(mi), fineness=24) > 0.01 / 15


@pytest.mark.parametrize("degrees", [0.0, 30.0, 60.0, 80.0, 87.0])
@pytest.mark.parametrize("sigma", [0.006, 0.0398, 0.3])
def test_chi_square_in_the_lobe(sigma, degrees):
    """Narrow lobes, seen at their own scale; at 87° most facets that are drawn face away or mirror downwards."""
    mi = use("llvm_ad_mono")
    bsdf = plugin(mi, pbrdf.DoubleGauss(sigma, **PAINT))
    theta = math.radians(degrees)
    wi = [0.6 * math.sin(theta), -0.8 * math.sin(theta), math.cos(theta)]
    assert p_value(mi, bsdf, wi, Lobe(mi, wi, sigma), fineness=24) > 0.01 / 15


@pytest.mark.parametrize("component", [0, 1])
def test_chi_square_of_one_part(component):
    mi = use("llvm_ad_mono")
    bsdf = plugin(mi, pbrdf.DoubleGauss(0.2, **PAINT))
    alone = mi.BSDFContext()
    alone.component = component

    class OnePart:
        @staticmethod
        def sample(_, *args):
            return bsdf.sample(alone, *args)

        @staticmethod
        def pdf(_, *args):
            return bsdf.pdf(alone, *args)

    wi = [0.6 * math.sin(1.0), -0.8 * math.sin(1.0), math.cos(1.0)]
    assert p_value(mi, OnePart, wi, Hemisphere(mi), fineness=16) > 0.005


def draw(mi, bsdf, wi, count, ctx=None, seed=0):
    """Samples for one known direction: the record, and the weights as ``numbers`` gives them."""
    random = np.random.default_rng(seed).random((3, count))
    if mi.variant().startswith("scalar"):
        drawn = [
            bsdf.sample(
                ctx or mi.BSDFContext(), interaction(mi, np.asarray(wi)), u, mi.Point2f(float(v), float(w))
            )
            for u, v, w in random.T.tolist()
        ]
        return [bs for bs, _ in drawn], np.concatenate([numbers(mi, weight, 1) for _, weight in drawn])
    u, v, w = (mi.Float(x.astype(np.float32)) for x in random)
    si = interaction(mi, np.broadcast_to(wi, (count, 3)))
    bs, weight = bsdf.sample(ctx or mi.BSDFContext(), si, u, mi.Point2f(v, w))
    return bs, numbers(mi, weight, count)


@pytest.mark.parametrize("variant", ["llvm_ad_mono_polarized", "llvm_ad_spectral", "llvm_ad_rgb"])
def test_weight_is_value_over_density(variant):
    mi = use(variant)
    bsdf = plugin(mi, pbrdf.DoubleGauss(0.1, **PAINT))
    wi = directions(1, 60.0, 4)[0]
    bs, weight = draw(mi, bsdf, wi, 5000)
    wo = bs.wo.numpy().T.astype(float)
    value, density = call(mi, bsdf.eval_pdf, np.broadcast_to(wi, wo.shape), wo)
    np.testing.assert_allclose(bs.pdf.numpy(), density, rtol=1e-4)
    np.testing.assert_array_equal(value, call(mi, bsdf.eval, np.broadcast_to(wi, wo.shape), wo))
    np.testing.assert_array_equal(density, call(mi, bsdf.pdf, np.broadcast_to(wi, wo.shape), wo))
    drawn = density > 0.0
    assert 0.9 < drawn.mean() <= 1.0
    density = density.reshape(-1, *[1] * (weight.ndim - 1))
    # the direction goes through single precision once more on its way here
    np.testing.assert_allclose((weight * density)[drawn], value[drawn], rtol=2e-3, atol=1e-5)
    assert np.all(weight[~drawn] == 0.0)
    component, kind = np.asarray(bs.sampled_component), np.asarray(bs.sampled_type)
    flags = (int(mi.BSDFFlags.GlossyReflection), int(mi.BSDFFlags.DiffuseReflection))
    np.testing.assert_array_equal(kind, np.where(component == 0, *flags))
    assert np.all(np.asarray(bs.eta) == 1.0)
    assert 0.1 < np.mean(component == 0) < 0.9


@pytest.mark.parametrize("variant", SCALAR)
def test_scalar_samples(variant):
    mi = use(variant)
    bsdf = plugin(mi, pbrdf.DoubleGauss(0.1, **PAINT, accuracy="fast"))
    wi = directions(1, 60.0, 4)[0]
    records, weight = draw(mi, bsdf, wi, 200)
    for bs, w in zip(records, weight, strict=True):
        value, density = bsdf.eval_pdf(mi.BSDFContext(), interaction(mi, wi), bs.wo)
        assert density == pytest.approx(bs.pdf, rel=1e-6)
        if density > 0.0:
            np.testing.assert_allclose(w * density, numbers(mi, value, 1)[0], rtol=1e-4, atol=1e-7)


def hemisphere_rule(zeniths=600, azimuths=128):
    """Directions and weights of ∫ cosθ dω: Gauss-Legendre in sin²θ, equal steps in azimuth."""
    x, w = np.polynomial.legendre.leggauss(zeniths)
    square = 0.5 * (x + 1.0)
    phi = 2.0 * math.pi * (np.arange(azimuths) + 0.5) / azimuths
    theta, phi = np.meshgrid(np.arcsin(np.sqrt(square)), phi, indexing="ij")
    return theta.ravel(), phi.ravel(), np.repeat(0.5 * w * math.pi / azimuths, azimuths)


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [0.0, 45.0, 75.0])
@pytest.mark.parametrize(
    "surface", [{"sigma": 0.1}, {"sigma": 0.15, "k": 0.9, "kappa": 1.0}], ids=["paint", "metal"]
)
def test_mean_weight_is_the_reflectance_of_the_viewed_direction(surface, degrees):
    """A white furnace: under unit radiance from everywhere the mean weight is ∫ f cosθ_i dω_i, with polarisation."""
    mi = use("llvm_ad_mono_polarized")
    model = pbrdf.DoubleGauss(**{**PAINT, **surface}, accuracy="fast")
    theta = math.radians(degrees)
    wi = np.array([math.sin(theta), 0.0, math.cos(theta)])
    _, weight = draw(mi, plugin(mi, model), wi, 400_000)
    theta_i, phi, w = hemisphere_rule()
    expected = np.sum(w[:, None] * model.mueller(theta_i, theta, phi)[..., 0], 0)
    found, error = weight[:, 0, :, 0].mean(0), weight[:, 0, :, 0].std(0) / 400_000**0.5
    # the implicit x axis of a direction in the x–z plane, as seen from above, lies in that plane: p
    found = found * [1.0, 1.0, 1.0, -1.0]
    assert np.all(np.abs(found - expected) < 4.0 * error + 2e-4 * expected[0])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["DoubleGauss", "ReciprocalDoubleGauss"])
@pytest.mark.parametrize("degrees", [20.0, 70.0])
def test_mean_weight_of_importance_is_the_directional_hemispherical_reflectance(name, degrees):
    """Importance starts at the light: ∫ f00 cosθ_r dω_r, which pbrdf integrates in its own way."""
    mi = use("llvm_ad_mono")
    model = getattr(pbrdf, name)(0.0398, **PAINT)
    theta = math.radians(degrees)
    ctx = mi.BSDFContext(mi.TransportMode.Importance)
    wi = [0.8 * math.sin(theta), 0.6 * math.sin(theta), math.cos(theta)]
    _, weight = draw(mi, plugin(mi, model), wi, 1_000_000, ctx)
    expected = float(pbrdf.directional_hemispherical_reflectance(model, theta))
    assert abs(weight.mean() - expected) < 4.0 * weight.std() / 1e3 + 2e-4 * expected


@pytest.mark.slow
def test_weights_are_bounded():
    """Visible facets: facets that are drawn weigh at most the Fresnel reflectance over their share of the samples."""
    mi = use("llvm_ad_mono")
    for sigma in (0.0398, 0.3):
        bsdf = plugin(mi, pbrdf.DoubleGauss(sigma, **{**PAINT, "a": 0.0}, accuracy="fast"))
        for degrees in (5.0, 60.0, 85.0, 89.0):
            theta = math.radians(degrees)
            _, weight = draw(mi, bsdf, [math.sin(theta), 0.0, math.cos(theta)], 100_000)
            assert weight.max() < 1.0 / 0.1


@pytest.mark.slow
def test_density_integrates_to_one_or_less():
    mi = use("llvm_ad_mono")
    theta, phi, w = hemisphere_rule()
    wo = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)
    for degrees, least in ((10.0, 0.9999), (70.0, 0.98)):
        wi = [math.sin(math.radians(degrees)), 0.0, math.cos(math.radians(degrees))]
        bsdf = plugin(mi, pbrdf.DoubleGauss(0.1, **PAINT))
        density = call(mi, bsdf.pdf, np.broadcast_to(wi, wo.shape), wo)
        assert least < np.sum(w * density / wo[:, 2]) < 1.0001


def test_two_sided():
    """Mitsuba's wrapper ``twosided`` gives the same paint on the back."""
    mi = use("llvm_ad_mono_polarized")
    import pbrdf.rendering

    model = pbrdf.DoubleGauss(0.1, **PAINT)
    both = mi.load_dict({"type": "twosided", "coat": pbrdf.rendering.bsdf_dict(model)})
    single = mi.load_dict(pbrdf.rendering.bsdf_dict(model))
    wi, wo = directions(100, 80.0, 1), directions(100, 80.0, 2)
    down = np.array([1.0, 1.0, -1.0])
    assert np.all(call(mi, single.eval, wi * down, wo * down) == 0.0)
    found, expected = call(mi, both.eval, wi * down, wo * down), call(mi, single.eval, wi, wo)
    np.testing.assert_allclose(found[:, 0, 0, 0], expected[:, 0, 0, 0], rtol=1e-5)
