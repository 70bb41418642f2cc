"""A model that a user wrote is a BSDF of Mitsuba like any other."""

from __future__ import annotations

import math

import numpy as np
import pytest
from bsdf_helpers import call, directions, light, to_surface_frames, use

from every_model import EVERY, example
from own_model import LambertGGX
from pbrdf.models import register
from pbrdf.models.reflectance import directional_hemispherical_reflectance
from pbrdf.rendering import bsdf_dict
from pbrdf.rendering.export import write_pbsdf

MODEL = LambertGGX(alpha=0.15, index=1.6, rho=0.4)


@pytest.fixture(autouse=True)
def registered():
    register(LambertGGX)


@pytest.mark.parametrize("variant", ["llvm_ad_mono_polarized", "scalar_spectral_polarized"])
@pytest.mark.parametrize("model", [MODEL, MODEL.replace(extinction=2.0)], ids=["dielectric", "metal"])
def test_matrices_are_those_of_the_model(variant, model):
    mi = use(variant)
    bsdf = mi.load_dict(bsdf_dict(model))
    wi, wo = directions(20, 80.0, 1), directions(20, 80.0, 2)
    found = to_surface_frames(call(mi, bsdf.eval, wi, wo)[:, 0], wi, wo)
    expected = model.mueller(*light(wi, wo)) * wo[:, 2, None, None]
    signs = np.diag([1.0, -1.0, -1.0, -1.0])
    np.testing.assert_allclose(
        found, signs @ expected @ signs, atol=2e-4 * expected[:, :1, :1].max(), rtol=2e-3
    )


@EVERY
def test_every_model_is_a_bsdf(cls):
    """Away from grazing, where float32 loses the half vector, within 1e-3 of f00, or of 1e-3/sr where it is darker."""
    mi = use("llvm_ad_mono_polarized")
    model = example(cls, 3)
    wi, wo = directions(30, 70.0, 1), directions(30, 70.0, 2)
    found = to_surface_frames(call(mi, mi.load_dict(bsdf_dict(model)).eval, wi, wo)[:, 0], wi, wo)
    expected = model.mueller(*light(wi, wo)) * wo[:, 2, None, None]
    signs = np.diag([1.0, -1.0, -1.0, -1.0])
    off = np.abs(found - signs @ expected @ signs).max((1, 2))
    assert (off / np.maximum(expected[:, 0, 0], 1e-3)).max() < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("albedo", [0.0, 0.4])
@pytest.mark.parametrize("degrees", [20.0, 65.0])
def test_the_mean_weight_is_the_reflectance_though_the_tails_are_long(albedo, degrees):
    """Mean of f cosθ/p over a million samples; were the tails never drawn, it would come out too low."""
    import drjit as dr

    mi = use("llvm_ad_mono")
    model = MODEL.replace(rho=albedo)
    theta = math.radians(degrees)
    si = dr.zeros(mi.SurfaceInteraction3f, 1_000_000)
    si.wi = mi.Vector3f(math.sin(theta), 0.0, math.cos(theta))
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(3, 1_000_000)
    ctx = mi.BSDFContext(mi.TransportMode.Importance)
    _, weight = mi.load_dict(bsdf_dict(model)).sample(ctx, si, sampler.next_1d(), sampler.next_2d())
    weight = np.array(weight)[0]
    expected = float(directional_hemispherical_reflectance(model, theta))
    assert abs(weight.mean() - expected) < 4.0 * weight.std() / 1e3 + 2e-4 * expected


@pytest.mark.parametrize("part", ["specular", "diffuse"])
def test_each_component_alone_can_be_sampled(part):
    import drjit as dr

    mi = use("llvm_ad_mono")
    bsdf = mi.load_dict(bsdf_dict(MODEL))
    ctx = mi.BSDFContext(mi.TransportMode.Importance)
    ctx.type_mask = mi.BSDFFlags.GlossyReflection if part == "specular" else mi.BSDFFlags.DiffuseReflection
    ctx.component = 0 if part == "specular" else 1
    si = dr.zeros(mi.SurfaceInteraction3f, 1_000_000)
    si.wi = mi.Vector3f(0.6, 0.0, 0.8)
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(5, 1_000_000)
    _, weight = bsdf.sample(ctx, si, sampler.next_1d(), sampler.next_2d())
    weight = np.array(weight)[0]
    alone = MODEL.replace(rho=0.0) if part == "specular" else MODEL.replace(index=1.0)
    expected = float(directional_hemispherical_reflectance(alone, math.acos(0.8)))
    assert abs(weight.mean() - expected) < 4.0 * weight.std() / 1e3 + 1e-3 * expected


def test_a_texture_and_a_scene():
    """A map of widths on a sphere, rendered: the narrow half shows the brighter highlight."""
    mi = use("llvm_ad_rgb")
    paint = LambertGGX(alpha=np.array([[0.05, 0.4]]), index=1.6, rho=0.2)
    scene = mi.load_dict({
        "type": "scene",
        "integrator": {"type": "direct"},
        "sensor": {
            "type": "perspective", "fov": 30.0,
            "to_world": mi.ScalarTransform4f().look_at([0, -6, 0], [0, 0, 0], [0, 0, 1]),
            "film": {"type": "hdrfilm", "width": 32, "height": 32},
        },
        "ball": {"type": "sphere", "bsdf": bsdf_dict(paint)},
        "lamp": {"type": "constant"},
    })  # fmt: skip
    picture = np.array(mi.render(scene, spp=16))
    assert np.isfinite(picture).all() and picture.max() > 0.2


@pytest.mark.slow
def test_the_plain_table_of_mitsuba(tmp_path):
    """Export to ``measured_polarized`` knows the width of the lobe without a parameter of that name."""
    from pbrdf.data.formats.pbsdf import read_table

    made = write_pbsdf(MODEL, tmp_path / "own.pbsdf", median=0.01, percentile_99=0.1)
    table = read_table(made.path)
    theta = np.deg2rad([20.0, 40.0, 60.0])
    exact = MODEL.mueller(theta, theta, 0.0)
    np.testing.assert_allclose(
        table.mueller(theta, theta, np.zeros(3)), exact, atol=0.05 * exact[..., 0, 0].max()
    )
