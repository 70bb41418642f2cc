"""The bundled paints' companions for rendering: the stated albedo, found again, and how far energy is conserved."""

import numpy as np
import pytest

from pbrdf.data.paints import PAINTS, SCENE_ALBEDO, SCENE_PAINTS, load_paint, open_experiment
from pbrdf.errors import DataError
from pbrdf.models.reflectance import albedo, directional_hemispherical_reflectance


def test_each_paint_has_a_companion_that_differs_in_its_amplitude_alone():
    assert list(SCENE_PAINTS) == [f"{name}-scene" for name in PAINTS]
    for name in PAINTS:
        ours, paper = load_paint(f"{name}-scene").values, load_paint(name).values
        assert {k for k in paper if ours[k] != paper[k]} == {"a"}


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENE_PAINTS)
def test_companions_reflect_the_stated_share_of_an_even_sky_and_never_more_than_they_get(name):
    paint = load_paint(name)
    assert albedo(paint) == pytest.approx(SCENE_ALBEDO, abs=1e-4)
    theta_i = np.deg2rad([0.0, 20.0, 40.0, 60.0, 70.0, 80.0, 85.0])
    assert directional_hemispherical_reflectance(paint, theta_i).max() < 0.95


def test_companions_have_no_measurement():
    with pytest.raises(DataError, match="no bundled measurement is named 'white-scene'"):
        open_experiment("white-scene")
    with pytest.raises(DataError, match="for rendering NAME-scene"):
        load_paint("whit-scene")
