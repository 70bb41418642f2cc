"""The width of the specular lobe, measured where a model does not state it."""

from __future__ import annotations

import pytest

import pbrdf
from pbrdf.models.base import Model
from pbrdf.models.lobe import WIDEST, measured_lobe_width

ROUGH = pbrdf.DoubleGauss(sigma=0.08, n=1.6, a=0.8, k=1.3, b=0.3, t=0.6)


@pytest.mark.parametrize("sigma", [0.002, 0.03, 0.1])
def test_the_width_of_the_lobe_is_found_without_the_parameters(sigma):
    assert measured_lobe_width(ROUGH.replace(sigma=sigma)) == pytest.approx(sigma, rel=0.03)


def test_no_lobe_and_a_broad_one_have_the_largest_width():
    assert measured_lobe_width(ROUGH.replace(n=1.0)) == WIDEST
    assert measured_lobe_width(ROUGH.replace(sigma=1.0)) == WIDEST


def test_of_a_map_the_widest_lobe_counts():
    paints = ROUGH.replace(sigma=[[0.05, 0.02], [0.1, 0.03]])
    assert Model.lobe_width(paints) == pytest.approx(0.1, rel=0.03)
