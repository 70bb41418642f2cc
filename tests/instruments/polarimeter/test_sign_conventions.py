"""What an instrument calls positive, in words. The elements themselves are in tests/optics/test_elements.py."""

from __future__ import annotations

import numpy as np
import pytest

from pbrdf.instruments.polarimeter.polarimeter import (
    division_of_focal_plane,
    lcvr,
    rotating_polarizer,
    rotating_retarder,
)
from pbrdf.instruments.polarimeter.retardance_sets import retardance_set
from pbrdf.optics.stokes import aolp

TETRAHEDRON = retardance_set("tetrahedron")


def light(psi=0.0, v=0.0):
    """Fully polarised light at the angle psi (radians), with V."""
    p = np.sqrt(1 - v**2)
    return np.array([1.0, p * np.cos(2 * psi), p * np.sin(2 * psi), v])


def test_angles_count_from_x_towards_y():
    """Of polarisers at 0°, 45°, 90°, 135° the one at 45° is brightest in light at +45°, AoLP = ½ atan2(U, Q) = +45°."""
    seen = rotating_polarizer(np.deg2rad([0, 45, 90, 135])).intensities(light(np.pi / 4))
    np.testing.assert_allclose(seen, [0.5, 1, 0.5, 0], atol=1e-15)
    assert aolp(light(np.pi / 4)) == pytest.approx(np.pi / 4)


def test_rows_of_a_mosaic_count_from_the_top():
    """In the cell [[90°, 45°], [135°, 0°]] the polariser along x is at the lower right."""
    seen = division_of_focal_plane(np.deg2rad([[90, 45], [135, 0]])).intensities(light(0.0)).reshape(2, 2)
    np.testing.assert_allclose(seen, [[0, 0.5], [0.5, 1]], atol=1e-15)


def test_lcvr_analyser_vectors_with_our_sign_of_v():
    """I = ½ [I + Q cosδ2 + U sinδ1 sinδ2 + V cosδ1 sinδ2]: the textbook's −V (right circular positive) is our +V."""
    rng = np.random.default_rng(0)
    d1, d2 = rng.uniform(0, 2 * np.pi, (2, 20))
    expected = [np.ones(20), np.cos(d2), np.sin(d1) * np.sin(d2), np.cos(d1) * np.sin(d2)]
    np.testing.assert_allclose(lcvr(np.stack([d1, d2], 1)).analyzer, 0.5 * np.transpose(expected), atol=1e-15)


def test_left_circular_light_passes_the_quarter_wave_that_undoes_it():
    """A quarter-wave retarder with fast axis x makes left circular light of light at 45°, so three quarters of a wave
    make the light at 45° again, and one quarter light at −45°: before an analyser at +45° left circular light is
    bright at 270° and dark at 90°."""
    left = light(v=1.0)
    seen = lcvr([[np.pi / 2], [3 * np.pi / 2]], axes=[0.0], analyzer=np.pi / 4).intensities(left)
    np.testing.assert_allclose(seen, [0, 1], atol=1e-15)


def test_the_first_retarder_of_the_list_is_met_first():
    """A half-wave plate at 22.5° turns x into 45°, after which a retarder at 45° has no effect; in the other order it
    has."""
    half, quarter = np.pi, np.pi / 2
    first, second = np.pi / 8, np.pi / 4
    x = light(0.0)
    forward = lcvr([[half, quarter]], axes=[first, second], analyzer=np.pi / 4).intensities(x)
    backward = lcvr([[quarter, half]], axes=[second, first], analyzer=np.pi / 4).intensities(x)
    np.testing.assert_allclose([forward[0], backward[0]], [1.0, 0.5], atol=1e-15)


def test_rotating_quarter_wave_plate():
    """Left circular light (V > 0) through a quarter-wave plate with its fast axis at +45° is light along x, with the
    fast axis at −45° light along y; right circular light the other way round."""
    plate = rotating_retarder(np.deg2rad([45, -45]))
    np.testing.assert_allclose(plate.intensities(light(v=1.0)), [1, 0], atol=1e-15)
    np.testing.assert_allclose(plate.intensities(light(v=-1.0)), [0, 1], atol=1e-15)


def test_an_instrument_turned_by_a_quarter_sees_s_as_x():
    """An instrument turned by 90°, whose x axis lies along y (s, if it was p), reads light along y as AoLP 0°."""
    turned = lcvr(TETRAHEDRON).turned(np.pi / 2)
    seen = turned.intensities(light(np.pi / 2))
    plain = lcvr(TETRAHEDRON)
    np.testing.assert_allclose(np.linalg.solve(plain.analyzer, seen), light(0.0), atol=1e-15)
    np.testing.assert_allclose(plain.turned(0.3).turned(-0.3).analyzer, plain.analyzer, atol=1e-15)
