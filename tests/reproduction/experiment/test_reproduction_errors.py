"""Errors at the strongest points and over all points, on numbers made by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from pbrdf.reproduction.experiment.errors import error_numbers, position_errors


def sample(**changes):
    """Two positions of three points: the mirror direction, one beside it, one outside the lobe."""
    content = {
        "intensity": np.array([100.0, 50.0, 10.0, 200.0, 90.0, 20.0]),
        "modelled_intensity": np.array([110.0, 50.0, 9.0, 190.0, 90.0, 21.0]),
        "dolp": np.array([0.50, 0.20, 0.10, 0.80, 0.40, 0.05]),
        "modelled_dolp": np.array([0.45, 0.20, 0.11, 0.80, 0.40, 0.06]),
        "position": np.array([1, 1, 1, 2, 2, 2]),
        "near_specular": np.array([True, True, False] * 2),
        "held_out": np.array([False] * 3 + [True] * 3),
        "angle": np.deg2rad([60.0, 62.0, 80.0, 50.0, 52.0, 70.0]),
    }
    return SimpleNamespace(**{**content, **changes})


def test_errors_at_the_strongest_points_are_relative_to_the_measured_value():
    first, second = position_errors(sample())
    assert (first.position, first.held_out, second.position, second.held_out) == (1, False, 2, True)
    assert first.intensity_specular == pytest.approx(0.10)
    assert first.intensity_diffuse == pytest.approx(-0.10)
    assert first.dolp_specular == pytest.approx(-0.10)
    assert first.dolp_diffuse == pytest.approx(0.10)
    assert second.intensity_specular == pytest.approx(-0.05)
    assert second.dolp_diffuse == pytest.approx(0.20)


def test_a_point_that_noise_polarises_is_not_the_strongest():
    """A dark point with a measured degree of 0.9 where the model has none does not count as the strongest diffuse."""
    content = sample()
    changed = {
        "dolp": np.append(content.dolp, 0.9),
        "modelled_dolp": np.append(content.modelled_dolp, 0.001),
        "intensity": np.append(content.intensity, 0.1),
        "modelled_intensity": np.append(content.modelled_intensity, 0.1),
        "position": np.append(content.position, 1),
        "near_specular": np.append(content.near_specular, False),
        "held_out": np.append(content.held_out, False),
        "angle": np.append(content.angle, 0.1),
    }
    assert position_errors(sample(**changed))[0].dolp_diffuse == pytest.approx(0.10)


def test_a_position_without_diffuse_points_has_no_error_there():
    (first, _) = position_errors(sample(near_specular=np.array([True] * 5 + [False])))
    assert np.isnan(first.intensity_diffuse)
    assert np.isfinite(first.intensity_specular)


def test_numbers_over_all_points():
    intensity, degree = error_numbers(sample())
    assert intensity.std == pytest.approx(np.std([10.0, 0.0, -1.0, -10.0, 0.0, 1.0]))
    assert intensity.largest == pytest.approx(10.0)
    assert intensity.share == pytest.approx(0.10)
    assert (intensity.position, intensity.angle) == (1, pytest.approx(60.0))
    assert degree.largest == pytest.approx(-0.05)


def test_points_without_polarisation_do_not_count():
    _, degree = error_numbers(sample(dolp=np.array([np.nan, 0.2, 0.1, 0.8, 0.4, 0.05])))
    assert degree.largest == pytest.approx(0.01)


@pytest.mark.slow
def test_the_sample_of_the_run_agrees_with_its_table(samples):
    """The errors of sample 3 at the peak of position 3, the predicted one, are within the imager's accuracy."""
    errors = position_errors(samples[2])[2]
    assert errors.held_out
    assert abs(errors.intensity_specular) < 0.03
    assert abs(errors.dolp_specular) < 0.10
