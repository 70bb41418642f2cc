"""Values of the BSDF plugin: the matrices of ``Model.mueller``, in every variant and with every option."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from bsdf_helpers import CUDA, LLVM, SCALAR, D, call, directions, light, plugin, to_surface_frames, use

import pbrdf
from pbrdf.models import MODELS
from pbrdf.optics.mueller import coherency_eigenvalues

#: Single precision: |Δ| ≤ this many f00.
TOLERANCE = 1e-4
PAINT = {"n": 1.6207, "a": 0.9, "k": 1.2504, "b": 0.1827, "t": 0.6717}
#: A paint's slopes, a rough surface, and rough metal.
SURFACES = ({"sigma": 0.0398}, {"sigma": 0.25, "k": 0.8}, {"sigma": 0.1, "kappa": 1.5, "b": -0.4})
CHOICES = [
    (name, dict(zip(options, choice, strict=True)))
    for name, cls in MODELS.items()
    for options in [[option for option in cls.options if option != "accuracy"]]
    for choice in itertools.product(*(cls.options[option] for option in options))
]


def largest_difference(mi, model, count, largest=88.0, seed=1, **changes):
    """max|Δ|/f00 between the plugin and ``mueller()`` after the change of frame, for random geometries."""
    wi, wo = directions(count, largest, seed), directions(count, largest, seed + 1)
    found = call(mi, plugin(mi, model, **changes).eval, wi, wo)
    expected = model.mueller(*light(wi, wo))
    f00 = expected[:, 0, 0]
    # facets without a body: far out in the lobe there is nothing
    scale = np.maximum(f00, 1e-6 * f00.max())
    if not mi.is_polarized:
        return np.max(np.abs(found / wo[:, 2:] - f00[:, None]) / scale[:, None])
    worst = 0.0
    for channel in np.moveaxis(found, 1, 0):
        in_model_frames = D @ to_surface_frames(channel, wi, wo) @ D / wo[:, 2, None, None]
        worst = max(worst, np.max(np.abs(in_model_frames - expected).max((1, 2)) / scale))
    return worst


def example(name, **choice):
    """A model with the paint's parameters where it has them, its own defaults elsewhere."""
    known = {"sigma": 0.0398, **PAINT}
    values = {p.name: known.get(p.name, p.default) for p in MODELS[name].parameters}
    return MODELS[name](**values, **choice).with_accuracy("fast")


@pytest.mark.parametrize("name", ["double-gauss", "reciprocal-double-gauss"])
@pytest.mark.parametrize(
    "variant", [*SCALAR, *LLVM, *(pytest.param(variant, marks=pytest.mark.cuda) for variant in CUDA)]
)
def test_every_variant(variant, name):
    mi = use(variant)
    model = example(name)
    assert largest_difference(mi, model, 60 if variant in SCALAR else 5000) < TOLERANCE


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "choice"), CHOICES, ids=lambda c: c if isinstance(c, str) else "-".join(c.values())
)
def test_every_choice(name, choice):
    """All combinations of every model's options."""
    mi = use("llvm_ad_mono_polarized")
    assert largest_difference(mi, example(name, **choice), 5000) < TOLERANCE


@pytest.mark.parametrize("name", MODELS)
def test_every_model_in_scalar_numbers(name):
    mi = use("scalar_spectral_polarized")
    assert largest_difference(mi, example(name), 20) < TOLERANCE


@pytest.mark.parametrize("accuracy", pbrdf.DoubleGauss.options["accuracy"])
@pytest.mark.parametrize("surface", SURFACES, ids=["paint", "rough", "metal"])
def test_every_accuracy_in_scalar_numbers(accuracy, surface):
    """Loops and tables work on Python numbers too, with kappa and without."""
    mi = use("scalar_spectral_polarized")
    model = pbrdf.DoubleGauss(**{**PAINT, **surface}, accuracy=accuracy)
    assert largest_difference(mi, model, 6 if accuracy == "high" else 30) < TOLERANCE


def test_visible_normalisation_in_scalar_numbers():
    mi = use("scalar_rgb")
    model = pbrdf.DoubleGauss(0.0398, **PAINT, normalization="visible", transmittance="amplitude")
    assert largest_difference(mi, model, 20) < TOLERANCE


@pytest.mark.parametrize("surface", SURFACES, ids=["paint", "rough", "metal"])
def test_default_accuracy_in_vectors(surface):
    mi = use("llvm_ad_mono_polarized")
    model = pbrdf.DoubleGauss(**{**PAINT, **surface})
    assert largest_difference(mi, model, 5000) < TOLERANCE


@pytest.mark.parametrize("sigma", [0.006, 0.0398])
def test_inside_the_lobe(sigma):
    """Directions within a few facet slopes of the mirror direction, where the half vector's last digits count."""
    mi = use("llvm_ad_mono_polarized")
    model = pbrdf.DoubleGauss(sigma, **PAINT, accuracy="fast")
    wi = directions(20_000, 80.0, 1)
    m = np.concatenate([sigma * np.random.default_rng(2).normal(size=(20_000, 2)), np.ones((20_000, 1))], -1)
    m /= np.linalg.norm(m, axis=-1, keepdims=True)
    wo = 2.0 * np.sum(wi * m, -1, keepdims=True) * m - wi
    above = wo[:, 2] > 0.02
    wi, wo = wi[above], wo[above].astype(np.float32).astype(float)
    found = to_surface_frames(call(mi, plugin(mi, model).eval, wi, wo)[:, 0], wi, wo) / wo[:, 2, None, None]
    expected = model.mueller(*light(wi, wo))
    assert np.max(np.abs(D @ found @ D - expected).max((1, 2)) / expected[:, 0, 0]) < TOLERANCE


@pytest.mark.parametrize("paint", pbrdf.PAINTS)
def test_what_a_scene_gets_if_it_asks_for_nothing_else(paint):
    """The bundled paints with the plugin's own choice of accuracy against ``mueller()`` with its own, to 80°."""
    mi = use("llvm_ad_mono_polarized")
    import pbrdf.rendering

    model = pbrdf.load_paint(paint)
    wi, wo = directions(20_000, 80.0, 3), directions(20_000, 80.0, 4)
    bsdf = mi.load_dict(pbrdf.rendering.bsdf_dict(model))
    found = to_surface_frames(call(mi, bsdf.eval, wi, wo)[:, 0], wi, wo) / wo[:, 2, None, None]
    expected = model.mueller(*light(wi, wo))
    assert np.max(np.abs(D @ found @ D - expected).max((1, 2)) / expected[:, 0, 0]) < TOLERANCE


def test_a_rough_surface_is_averaged_with_the_default_accuracy():
    mi = use("llvm_ad_mono_polarized")
    model = pbrdf.DoubleGauss(0.25, **PAINT)
    wi, wo = directions(5000, 80.0, 3), directions(5000, 80.0, 4)
    bsdf = mi.load_dict({"type": "pbrdf", "sigma": 0.25, **PAINT})
    found = to_surface_frames(call(mi, bsdf.eval, wi, wo)[:, 0], wi, wo) / wo[:, 2, None, None]
    expected = model.mueller(*light(wi, wo))
    assert np.max(np.abs(D @ found @ D - expected).max((1, 2)) / expected[:, 0, 0]) < TOLERANCE


@pytest.mark.parametrize("case", ["normal light", "normal view", "both normal", "mirror", "backscatter"])
def test_special_geometries(case):
    """Where azimuths or the plane of incidence are undefined the matrix is not."""
    mi = use("llvm_ad_mono_polarized")
    model = pbrdf.DoubleGauss(0.0398, **PAINT, kappa=0.7)
    v = directions(500, 85.0, 8)
    up = np.broadcast_to([0.0, 0.0, 1.0], v.shape)
    wi, wo = {
        "normal light": (v, up),
        "normal view": (up, v),
        "both normal": (up, up),
        "mirror": (v * [-1.0, -1.0, 1.0], v),
        "backscatter": (v, v),
    }[case]
    found = call(mi, plugin(mi, model).eval, wi, wo)[:, 0]
    assert np.isfinite(found).all()
    # a direction beside the special one has the same matrix to within the change of the BRDF
    tilted = wi + 1e-4 * np.array([0.6, 0.8, 0.0])
    tilted /= np.linalg.norm(tilted, axis=-1, keepdims=True)
    beside = wo + 1e-4 * np.array([-0.8, 0.6, 0.0])
    beside /= np.linalg.norm(beside, axis=-1, keepdims=True)
    near = call(mi, plugin(mi, model).eval, tilted, beside)[:, 0]
    smooth = tilted[:, 2] > 0.2
    assert np.max(np.abs(found - near)[smooth].max((1, 2)) / found[smooth, 0, 0]) < 0.03


def test_matrices_are_realisable():
    """Cloude's coherency matrix has no eigenvalue below 0 but for rounding, in Mitsuba's frames as in any."""
    mi = use("llvm_ad_mono_polarized")
    for surface in SURFACES:
        model = pbrdf.DoubleGauss(**{**PAINT, **surface}, accuracy="fast")
        wi, wo = directions(5000, 89.0, 5), directions(5000, 89.0, 6)
        M = call(mi, plugin(mi, model).eval, wi, wo)[:, 0]
        # the same matrix with V turned to the sign of the criterion; signs of Q and U do not matter
        lowest = coherency_eigenvalues(D @ M @ D)[:, 0]
        assert np.min(lowest / M[:, 0, 0]) > -1e-6


@pytest.mark.slow
@pytest.mark.parametrize("variant", ["scalar_spectral_polarized", "llvm_ad_mono_polarized", "llvm_ad_rgb"])
def test_nothing_below_the_horizon(variant):
    """One-sided: 0 where either direction is at or below the horizon, whatever the accuracy."""
    mi = use(variant)
    bsdf = plugin(mi, pbrdf.DoubleGauss(0.0398, **PAINT))
    down, grazing = np.array([[0.6, 0.0, -0.8]]), np.array([[1.0, 0.0, 0.0]])
    up = np.array([[0.0, 0.6, 0.8]])
    for wi, wo in ((up, down), (down, up), (down, down), (up, grazing), (grazing, up)):
        assert np.all(call(mi, bsdf.eval, wi, wo) == 0.0)
        assert np.all(call(mi, bsdf.pdf, wi, wo) == 0.0)


def test_finite_at_grazing():
    mi = use("llvm_ad_mono_polarized")
    for sigma in (0.002, 0.0398, 0.6):
        bsdf = plugin(mi, pbrdf.DoubleGauss(sigma, **PAINT, accuracy="fast"))
        wi = directions(20_000, 90.0, 1)
        wi[::2, 2] = np.geomspace(1e-12, 1e-3, 10_000)
        wi /= np.linalg.norm(wi, axis=-1, keepdims=True)
        mirror = np.arange(20_000) % 4 < 2
        wo = np.where(mirror[:, None], wi * [-1.0, -1.0, 1.0], wi)
        value, density = call(mi, bsdf.eval_pdf, wi, wo)
        assert np.isfinite(value).all() and np.isfinite(density).all() and np.all(density >= 0.0)


def test_parts_add_up():
    """Component 0 is the facets, component 1 the body; flags choose in the same way."""
    mi = use("llvm_ad_mono_polarized")
    model = pbrdf.DoubleGauss(0.1, **PAINT)
    bsdf = plugin(mi, model)
    assert bsdf.component_count() == 2
    wi, wo = directions(200, 80.0, 1), directions(200, 80.0, 2)
    total = call(mi, bsdf.eval, wi, wo)
    parts = []
    flags = (mi.BSDFFlags.GlossyReflection, mi.BSDFFlags.DiffuseReflection)
    for component, (part, flag) in enumerate(zip(("specular", "diffuse"), flags, strict=True)):
        assert mi.has_flag(bsdf.flags(component), flag) and mi.has_flag(bsdf.flags(), flag)
        ctx = mi.BSDFContext()
        ctx.component = component
        parts.append(call(mi, bsdf.eval, wi, wo, ctx=ctx))
        expected = model.mueller(*light(wi, wo), part=part)
        found = D @ to_surface_frames(parts[-1][:, 0], wi, wo) @ D / wo[:, 2, None, None]
        assert np.max(np.abs(found - expected)) < 1e-5 * np.max(expected)
        masked = mi.BSDFContext()
        masked.type_mask = int(flag)
        np.testing.assert_array_equal(call(mi, bsdf.eval, wi, wo, ctx=masked), parts[-1])
    np.testing.assert_allclose(parts[0] + parts[1], total, rtol=1e-5, atol=1e-6)
    nothing = mi.BSDFContext()
    nothing.type_mask = int(mi.BSDFFlags.DeltaReflection)
    assert np.all(call(mi, bsdf.eval, wi, wo, ctx=nothing) == 0.0)


@pytest.mark.slow
def test_importance_is_the_adjoint():
    """Transported importance: the light travels from ``wi`` to ``wo``, so the matrix is that of the path reversed."""
    mi = use("llvm_ad_mono_polarized")
    bsdf = plugin(mi, pbrdf.DoubleGauss(0.1, **PAINT, kappa=0.5))
    wi, wo = directions(500, 80.0, 1), directions(500, 80.0, 2)
    importance = mi.BSDFContext(mi.TransportMode.Importance)
    forward = call(mi, bsdf.eval, wo, wi) / wi[:, 2, None, None, None]
    adjoint = call(mi, bsdf.eval, wi, wo, ctx=importance) / wo[:, 2, None, None, None]
    np.testing.assert_allclose(adjoint, forward, rtol=1e-5, atol=1e-6)


@pytest.mark.slow
def test_reciprocal_model_is_reciprocal():
    """Helmholtz: f(reversed path) = diag(1, 1, −1, 1) fᵀ diag(1, 1, −1, 1) in frames with x = s on both rays."""
    mi = use("llvm_ad_mono_polarized")
    reverse = np.diag([1.0, 1.0, -1.0, 1.0])
    wi, wo = directions(2000, 75.0, 1), directions(2000, 75.0, 2)

    def asymmetry(model):
        bsdf = plugin(mi, model)
        there = to_surface_frames(call(mi, bsdf.eval, wi, wo)[:, 0], wi, wo) / wo[:, 2, None, None]
        back = to_surface_frames(call(mi, bsdf.eval, wo, wi)[:, 0], wo, wi) / wi[:, 2, None, None]
        difference = back - reverse @ np.swapaxes(there, 1, 2) @ reverse
        return np.max(np.abs(difference).max((1, 2)) / there[:, 0, 0])

    values = {**PAINT, "sigma": 0.0398, "kappa": 0.3}
    assert asymmetry(pbrdf.ReciprocalDoubleGauss(**values)) < 2e-5
    assert (
        asymmetry(pbrdf.DoubleGauss(**values)) > 0.1
    )  # its body light leaves through facets but does not enter
