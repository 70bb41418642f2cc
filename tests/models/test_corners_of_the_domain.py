"""Every corner of the documented domain gives numbers, none negative, and matrices of passive surfaces."""

import math

import drjit as dr
import numpy as np
import pytest

from every_model import EVERY, example
from pbrdf.backend import get_backend
from pbrdf.models import DoubleGauss, ReciprocalDoubleGauss
from pbrdf.models.extended_source import stokes_under_disc
from pbrdf.optics.geometry import geometry_from_sines
from pbrdf.optics.mueller import coherency_eigenvalues

PAINT = {"sigma": 0.05, "n": 1.5, "a": 0.5, "k": 1.2, "b": 0.1, "t": 0.7}


def corner_directions(seed, size):
    """Angles of which many are at or near the normal, the horizon, the mirror direction and backscatter."""
    rng = np.random.default_rng(seed)
    near = 10.0 ** rng.uniform(-12, 0, (3, size))
    choices = np.stack(
        [
            near[0],
            0.5 * np.pi - near[1],
            np.zeros(size),
            np.full(size, 0.5 * np.pi),
            np.arccos(rng.random(size)),
        ]
    )
    theta_i, theta_r = (choices[rng.integers(0, 5, size), np.arange(size)] for _ in range(2))
    theta_r = np.where(rng.random(size) < 0.2, theta_i, theta_r)
    phi = rng.choice([0.0, np.pi, 1.0], size) + rng.integers(0, 2, size) * near[2]
    return theta_i, theta_r, phi


@EVERY
@pytest.mark.parametrize("seed", [1, 3])
def test_corners_are_finite_not_negative_and_realisable(cls, seed):
    theta_i, theta_r, phi = corner_directions(seed, 600)
    f = example(cls, seed, 600).mueller(theta_i, theta_r, phi)
    assert np.isfinite(f).all()
    assert (f[:, 0, 0] >= 0.0).all()
    # beyond 1e-290 floating-point numbers lose their digits
    assert coherency_eigenvalues(f / np.maximum(f[:, 0, 0], 1e-290)[:, None, None]).min() > -1e-12


def test_index_one_in_a_map_of_extinctions():
    model = DoubleGauss(**PAINT | {"n": np.array([1.0, 1.0, 1.5])}, kappa=np.array([0.0, 1.0, 0.5]))
    f = model.mueller(math.radians(89.9999), math.radians(89.9999), 0.0)
    assert np.isfinite(f).all()
    # n = 1 without extinction is no surface: the map's element equals the body alone
    assert f[0] == pytest.approx(
        DoubleGauss(**PAINT | {"n": 1.0}).mueller(*np.deg2rad([89.9999, 89.9999, 0.0]))
    )


@pytest.mark.parametrize("turns", [1e4, 1e9, 1e15])
def test_an_azimuth_of_many_turns_is_that_of_the_remainder(turns):
    phi = 2.0 * math.pi * turns + 0.4
    model = DoubleGauss(**PAINT)
    within = math.atan2(math.sin(phi), math.cos(phi))  # what is left of 0.4 in double precision
    assert model.mueller(0.5, 0.9, phi) == pytest.approx(model.mueller(0.5, 0.9, within), rel=1e-12)


def test_an_azimuth_of_many_turns_in_a_float32_kernel():
    """The number that the array holds is reduced in double precision; in float32 1e4 turns are off by 4e-3 rad."""
    Float = get_backend().Float32
    phi = (2.0 * math.pi * np.repeat([200.0, 1e4, 1e6], 50) + np.tile(np.linspace(-3.0, 3.0, 50), 3)).astype(
        np.float32
    )
    model = DoubleGauss(**PAINT)
    expected = model.mueller(0.5, 0.6, phi.astype(float))
    found = np.moveaxis(np.array(model.mueller(Float(0.5), Float(0.6), Float(phi))), -1, 0)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-4 * expected[:, 0, 0].max())


@pytest.mark.parametrize("cls", [DoubleGauss, ReciprocalDoubleGauss])
@pytest.mark.parametrize("k", [4.0, 12.0, 20.0])
def test_a_steep_body_at_the_horizon_vanishes_instead_of_being_undefined(cls, k):
    grazing = 0.5 * math.pi - np.logspace(-12, -3, 30)
    f = cls(**PAINT | {"k": k}).mueller(grazing, grazing, [[0.0], [1.0], [math.pi]], part="diffuse")
    assert np.isfinite(f).all()
    assert f[..., 0, 0].max() < 1e-20


def test_the_weights_of_a_smooth_surface_are_those_of_the_flat_one():
    """Facets of slope 0.002 hardly weigh differently, so their average does not depend on k, however steep."""
    theta = np.deg2rad([0.0, 40.0, 70.0, 85.0])
    smooth = PAINT | {"sigma": 0.002, "t": 1.0}
    steep, gentle = (
        DoubleGauss(**smooth | {"k": k}).mueller(theta, 0.7, 0.3, part="diffuse") for k in (12.0, 1.0)
    )
    assert steep[:, 1, 0] / steep[:, 0, 0] == pytest.approx(gentle[:, 1, 0] / gentle[:, 0, 0], rel=0.01)


@pytest.mark.parametrize("elevation", [1e-4, 1e-5, 2e-6])
def test_rays_that_graze_from_opposite_sides_in_single_precision(elevation):
    """A plane seen along itself: cosβ stays positive and right, although ω_i·m cancels in float32."""
    Float = dr.float32_array_t(get_backend().Float)
    i, r = np.float32(elevation), np.float32(1.7 * elevation)
    sine = [Float(float(np.sqrt(1.0 - float(c) ** 2))) for c in (i, r)]
    g = geometry_from_sines(sine[0], Float(float(i)), sine[1], Float(float(r)), Float(0.0), Float(1.0))
    exact = 0.5 * (float(i) + float(r))  # both grazing angles' mean
    assert float(g.cos_beta[0]) == pytest.approx(exact, rel=1e-3)


def test_a_source_that_reaches_below_the_horizon_is_cut_there():
    model = DoubleGauss(**PAINT)
    radius = math.radians(0.5)
    theta_i = np.deg2rad([89.0, 89.7, 89.9, 89.99, 89.9999])
    S = stokes_under_disc(model, theta_i, np.full(5, 1.4), np.zeros(5), radius)
    assert (S[:, 0] > 0.0).all()
    assert (np.hypot(S[:, 1], S[:, 2]) <= S[:, 0]).all()

    # by hand: rays over the disc, those below the horizon left out, for unit irradiance on the surface
    rng = np.random.default_rng(0)
    r, turn = radius * np.sqrt(rng.random(200_000)), 2.0 * np.pi * rng.random(200_000)
    centre = np.array([-math.sin(theta_i[2]), 0.0, math.cos(theta_i[2])])
    p = np.array([math.cos(theta_i[2]), 0.0, math.sin(theta_i[2])])
    rays = centre + (r * np.cos(turn))[:, None] * p + (r * np.sin(turn))[:, None] * np.array([0.0, -1.0, 0.0])
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    rays = rays[rays[:, 2] > 0.0]
    zenith, azimuth = np.arccos(rays[:, 2]), np.arctan2(-rays[:, 1], -rays[:, 0])
    f = model.stokes(zenith, np.full(len(rays), 1.4), -azimuth, part="specular")[:, 0]
    expected = np.average(f, weights=rays[:, 2])
    body = model.stokes(theta_i[2], 1.4, 0.0, part="diffuse")[0]
    assert S[2, 0] - body == pytest.approx(expected, rel=0.02)


def test_fast_is_reciprocal_only_as_far_as_stated():
    """docs/model.md, section 4: 1e-3 for σ ≤ 0.06 to 80°, a few percent elsewhere; ``default`` 1e-5 everywhere."""
    rng = np.random.default_rng(1)
    theta_i, theta_r = np.arccos(rng.random((2, 20_000)))
    phi = rng.uniform(-np.pi, np.pi, 20_000)
    low = np.maximum(theta_i, theta_r) < np.deg2rad(80.0)
    for accuracy, sigma, limit, everywhere in (("fast", 0.06, 1e-3, 0.05), ("default", 0.3, 1e-5, 1e-5)):
        model = ReciprocalDoubleGauss(**PAINT | {"sigma": sigma}, accuracy=accuracy)
        there, back = model.mueller(theta_i, theta_r, phi), model.mueller(theta_r, theta_i, -phi)
        difference = np.abs(there[:, 0, 0] / back[:, 0, 0] - 1.0)
        assert difference[low].max() < limit
        assert difference.max() < everywhere
