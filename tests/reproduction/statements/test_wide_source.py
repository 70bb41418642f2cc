"""Statement 13: an extended source, taken for a point, makes the errors that the paper reports at its peaks."""

import numpy as np
import pytest

import independent as ref
import pbrdf
from pbrdf.instruments.goniometer.protocols import Protocol
from pbrdf.models.extended_source import stokes_under_disc
from pbrdf.reproduction.interpretations import DEFAULT
from pbrdf.reproduction.plane import in_plane
from pbrdf.reproduction.statements.wide_source import RADIUS, errors_at_peaks, wide_source_explains_the_peaks

pytestmark = pytest.mark.slow


def test_a_point_source_leaves_no_error(positions):
    np.testing.assert_allclose(errors_at_peaks(DEFAULT, positions, 0.0), 0.0, atol=1e-6)


@pytest.mark.parametrize("degrees", [(60.0, 80.0, 100.0), (30.0, 50.0, 70.0)])
def test_the_errors_have_the_papers_signs_for_samples_2_to_5(degrees):
    errors = errors_at_peaks(DEFAULT, np.deg2rad(degrees))
    assert errors.shape == (5, 3)
    assert (np.sign(errors[1:]) == [-1, 1, 1]).all()
    assert (errors[1:, 2] > errors[1:, 1]).all()


def test_the_outcome_judges_samples_2_to_5_and_shows_sample_1(positions):
    errors = errors_at_peaks(DEFAULT, positions)
    outcome = wide_source_explains_the_peaks(DEFAULT, positions)
    assert outcome.passed
    assert outcome.value == pytest.approx([*errors[2], *errors[0]])


def test_the_paper_had_no_such_source():
    """A paint without roughness under a source of 1.2° seems to have σ = 0.006; such a source errs by 1 % at most."""
    positions = np.deg2rad([60.0, 80.0, 100.0])
    radius = np.deg2rad(1.2)
    protocol = Protocol.in_plane(positions)
    angles = (protocol.theta_i, protocol.theta_r, protocol.phi)
    smooth = DEFAULT.sample(1).replace(sigma=0.001)
    stokes = stokes_under_disc(smooth, *angles, radius)
    data = pbrdf.make_dataset(
        *angles,
        quantity="brdf",
        I=stokes[:, 0],
        Q=stokes[:, 1],
        std={"I": 0.01 * stokes[:, 0], "Q": 0.01 * stokes[:, 0]},
        group=protocol.group,
    )
    result = pbrdf.fit(data, DEFAULT.sample(1), starts=1, hold_out="group=3")
    assert result.model.values["sigma"] == pytest.approx(0.006, abs=0.0005)
    assert np.abs(errors_at_peaks(DEFAULT, positions, radius)[1:]).max() < 0.0105


def test_the_flat_top_of_a_smooth_sample_is_fresnels_reflectance():
    """The cause: wider than the lobe, the source's image has Fresnel's radiance, without 1/cosβ."""
    model = DEFAULT.sample(1)
    half = np.deg2rad([30.0, 40.0, 50.0])
    stokes = stokes_under_disc(model, half, half, np.zeros(3), RADIUS)
    diffuse = in_plane(model, half, half, "diffuse")[:, 0]
    fresnel = np.array([ref.mirror_mueller(b, model.values["n"])[0, 0] for b in half])
    radiance = fresnel / (2.0 * np.pi * (1.0 - np.cos(RADIUS)))
    np.testing.assert_allclose((stokes[:, 0] - diffuse) * np.cos(half), radiance, rtol=0.01)


def test_the_errors_grow_with_the_source(positions):
    narrow = np.abs(errors_at_peaks(DEFAULT, positions, np.deg2rad(1.0)))
    wide = np.abs(errors_at_peaks(DEFAULT, positions, np.deg2rad(4.0)))
    assert (wide[1:] > narrow[1:]).all()
