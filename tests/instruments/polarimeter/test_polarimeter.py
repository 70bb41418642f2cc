"""Polarimeters as sets of analyser vectors."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pbrdf.errors import DataError, PbrdfError
from pbrdf.instruments.polarimeter.polarimeter import (
    Polarimeter,
    division_of_focal_plane,
    from_settings,
    lcvr,
    measured,
    rotating_polarizer,
    rotating_retarder,
)
from pbrdf.instruments.polarimeter.retardance_sets import retardance_set

ANGLES = arrays(float, 6, elements=st.floats(-3, 3))
FIELDS = np.array([[1, 0], [0, 1], [1, 1], [1, -1j], [0.3 + 0.1j, -0.7j], [0.2 - 0.6j, 0.5 + 0.1j]])


def stokes_of(E):
    x, y = E.T
    product = 2 * x * np.conj(y)
    return np.array([abs(x) ** 2 + abs(y) ** 2, abs(x) ** 2 - abs(y) ** 2, product.real, product.imag])


def through(E, angle, along, across):
    """Fields after an element with an axis at `angle`."""
    c, s = np.cos(angle), np.sin(angle)
    a, b = c * E[:, 0] + s * E[:, 1], -s * E[:, 0] + c * E[:, 1]
    a, b = along * a, across * b
    return np.stack([c * a - s * b, s * a + c * b], axis=-1)


def power(E):
    return (abs(E) ** 2).sum(axis=1)


@given(ANGLES, st.floats(0, 1))
def test_lcvr_intensities_are_those_of_the_fields(x, d):
    """Three retarders and an imperfect analyser at any axes: W·S is the power of the Jones fields that come through."""
    axes, delta, analyzer = x[:3], x[3:], x[0] - x[5]
    E = FIELDS
    for axis, phase in zip(axes, delta, strict=True):
        E = through(E, axis, np.exp(1j * phase), 1.0)
    E = through(E, analyzer, np.sqrt((1 + d) / 2), np.sqrt((1 - d) / 2))
    seen = lcvr([delta], axes, analyzer, diattenuation=d).intensities(stokes_of(FIELDS))
    np.testing.assert_allclose(seen[0], power(E), atol=1e-13)


@given(ANGLES, st.floats(0, 1))
def test_rotating_elements_are_those_of_the_fields(x, d):
    light = stokes_of(FIELDS)
    a, b = np.sqrt((1 + d) / 2), np.sqrt((1 - d) / 2)
    seen = rotating_retarder(x, 1.9, 0.4, diattenuation=d).intensities(light)
    expected = [power(through(through(FIELDS, t, np.exp(1.9j), 1), 0.4, a, b)) for t in x]
    np.testing.assert_allclose(seen, expected, atol=1e-13)
    expected = [power(through(FIELDS, t, a, b)) for t in x]
    np.testing.assert_allclose(
        rotating_polarizer(x, diattenuation=d).intensities(light), expected, atol=1e-13
    )
    mosaic = division_of_focal_plane(x.reshape(2, 3), diattenuation=d)
    np.testing.assert_allclose(mosaic.intensities(light), expected, atol=1e-13)
    np.testing.assert_array_equal(mosaic.mosaic, [[0, 1, 2], [3, 4, 5]])


@pytest.mark.parametrize(
    ("polarimeter", "components"),
    [
        (lcvr(retardance_set("six_states")), "IQUV"),
        (rotating_retarder(np.deg2rad([0, 36, 72, 108, 144])), "IQUV"),
        (rotating_retarder(np.deg2rad([0, 30, 60, 90, 120, 150]), np.pi), "IQU"),
        (rotating_polarizer(np.deg2rad([0, 60, 120])), "IQU"),
        (rotating_polarizer(np.deg2rad([0, 90])), "IQ"),
        (rotating_polarizer([0.0]), ""),
        (rotating_polarizer([0.0, 0.4]), ""),
        (lcvr([[0, 0], [0, np.pi], [0, np.pi / 2]]), "IQV"),
        # three states, four unknowns: I is tied to V, Q and U are not
        (measured([[1, 1, 0, 1], [1, -1, 0, 1], [1, 0, 1, 1]]), "QU"),
    ],
)
def test_determined_components(polarimeter, components):
    assert "".join(np.array(list("IQUV"))[polarimeter.determined]) == components


def test_determined_means_everywhere_on_a_map():
    analyzer = np.tile(lcvr(retardance_set("tetrahedron")).analyzer, (2, 3, 1, 1))
    assert measured(analyzer).determined.all()
    analyzer[1, 2, :, 3] = 0.0
    np.testing.assert_array_equal(measured(analyzer).determined, [True, True, True, False])


def test_map_serves_the_share_of_the_image():
    """A map of 2 × 3 cells over an image of 4 × 7: cell (y·2//4, x·3//7); part of the rows is the part of the whole."""
    rng = np.random.default_rng(0)
    polarimeter = measured(rng.normal(size=(2, 3, 4, 4)))
    spread = polarimeter.spread(4, 7)
    for y in range(4):
        for x in range(7):
            np.testing.assert_array_equal(spread[y, x], polarimeter.analyzer[y * 2 // 4, x * 3 // 7])
    np.testing.assert_array_equal(polarimeter.spread(4, 7, 1, 3), spread[1:3])
    S = rng.normal(size=(4, 4, 7))
    np.testing.assert_allclose(polarimeter.intensities(S), np.einsum("yxnk,kyx->nyx", spread, S))


def test_a_wide_map_is_worked_through_in_parts():
    """More pixels than are spread at a time."""
    rng = np.random.default_rng(0)
    polarimeter = measured(rng.normal(size=(3, 1, 2, 4)))
    S = rng.normal(size=(4, 40, 2000))
    found = polarimeter.intensities(S)
    for y in range(40):
        np.testing.assert_allclose(found[:, y], polarimeter.analyzer[y * 3 // 40, 0] @ S[:, y])


def test_the_analyser_vectors_cannot_be_changed_from_outside():
    own = np.eye(4)
    polarimeter = measured(own)
    own[0, 0] = 7.0
    assert polarimeter.analyzer[0, 0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        polarimeter.analyzer[0, 0] = 2.0


@pytest.mark.parametrize(
    "made",
    [
        lcvr(retardance_set("tetrahedron"), diattenuation=0.97),
        lcvr([[0.1, 0.2, 0.3]] * 2, [0.0, 0.5, 1.0], 0.3),
        rotating_retarder([0.1, 0.2], 1.7, 0.2, diattenuation=0.9),
        rotating_polarizer([0.1, 0.2]),
        division_of_focal_plane([[0.1, 0.2]]),
        lcvr(retardance_set("tetrahedron")).turned(0.2).turned(0.1),
    ],
)
def test_details_describe_the_polarimeter(made):
    """A polarimeter is made again from its details, whose angles are in degrees."""
    again = from_settings(made.details)
    np.testing.assert_allclose(again.analyzer, made.analyzer, atol=1e-11)


def test_names_of_states():
    assert rotating_polarizer(np.deg2rad([0, 45, 45, 22.5])).states == ("0", "45#1", "45#2", "22.5")
    assert lcvr(retardance_set("tetrahedron")).states == ("s1", "s2", "s3", "s4")
    assert measured(np.eye(4), ["a", "b", "c", "d"]).states == ("a", "b", "c", "d")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: measured(np.eye(3)), r"shape \(3, 3\)"),
        (lambda: measured(np.zeros((0, 4))), "shape"),
        (lambda: measured(np.zeros((2, 4, 4))), "for a map"),
        (lambda: measured([[1, 0, np.nan, 0]]), "not finite"),
        (lambda: measured(np.eye(4), ["a", "b"]), "2 names for 4"),
        (lambda: measured(np.eye(4), ["a", "b", "b", "c"]), "same name"),
        (lambda: lcvr([[1.0, 2.0, 3.0]]), "2 numbers"),
        (lambda: lcvr([1.0, 2.0]), r"shape \(2,\)"),
        (lambda: measured(np.eye(4)).with_accuracy(-0.1, 0), "accuracy"),
        (lambda: measured(np.eye(4)).with_accuracy(0.1, np.nan), "accuracy"),
        (lambda: Polarimeter(np.eye(4), "abcd", mosaic=[[0, 1], [2, 2]]), "mosaic"),
        (lambda: Polarimeter(np.eye(4), "abcd", mosaic=[[0, 1, 2, 3, 3]]), "mosaic"),
        (lambda: rotating_polarizer([0.0], diattenuation=1.2), "diattenuation"),
        (lambda: rotating_polarizer([np.nan]), "not finite"),
        (lambda: from_settings({"kind": "lcd"}), "lcvr"),
        (lambda: measured(np.eye(4)).spread(3, 3), "no map"),
        (lambda: measured(np.eye(4)).intensities(np.ones(3)), "shape"),
        (lambda: measured(np.ones((2, 2, 4, 4))).intensities(np.ones(4)), "rows, columns"),
    ],
)
def test_errors(make, message):
    with pytest.raises(PbrdfError, match=message):
        make()
    assert issubclass(DataError, PbrdfError)
