"""Protocols: the paper's angles, out-of-plane geometries, how the camera is held, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from independent import frames, rays
from pbrdf.data.paints import PAINTS, open_experiment
from pbrdf.errors import DataError
from pbrdf.instruments.goniometer.angle_table import read_angles, write_angles
from pbrdf.instruments.goniometer.protocols import LABORATORIES, Protocol, crowded_sample_angles


def degrees(values):
    return np.rad2deg(values)


def signed_view(protocol):
    return degrees(protocol.theta_r) * np.where(np.cos(protocol.phi) < 0.0, -1.0, 1.0)


def angle_between(a, b):
    return np.arccos(np.clip((a * b).sum(-1), -1.0, 1.0))


# The paper's protocol


def test_incidence_is_ninety_degrees_minus_the_sample_angle():
    protocol = Protocol.in_plane(np.deg2rad([60.0, 100.0]), np.deg2rad([20.0, 50.0, 70.0]))
    np.testing.assert_allclose(degrees(protocol.theta_i), [70.0, 40.0, 20.0] * 2, atol=1e-9)
    assert protocol.group.tolist() == [1, 1, 1, 2, 2, 2]


def test_view_is_what_is_left_of_the_bistatic_angle():
    """θ_r = Ψ − 90° + A: right of the peak the viewing angle grows while the angle of incidence falls."""
    protocol = Protocol.in_plane(np.deg2rad(80.0), np.deg2rad([30.0, 50.0, 70.0]))
    np.testing.assert_allclose(signed_view(protocol), [20.0, 40.0, 60.0], atol=1e-9)


def test_a_camera_that_crosses_the_normal_is_at_180_degrees():
    protocol = Protocol.in_plane(np.deg2rad(60.0), np.deg2rad([10.0]))
    assert degrees(protocol.theta_i) == pytest.approx(80.0)
    assert degrees(protocol.theta_r) == pytest.approx(20.0)
    assert degrees(protocol.phi) == pytest.approx(180.0)


def test_a_source_beyond_the_normal_is_the_mirror_image():
    """A = 100°: the source is 10° beyond the normal, on the side of the camera, which looks from 70°."""
    protocol = Protocol.in_plane(np.deg2rad(60.0), np.deg2rad([100.0]))
    assert degrees(protocol.theta_i) == pytest.approx(10.0)
    assert degrees(protocol.theta_r) == pytest.approx(70.0)
    assert degrees(protocol.phi) == pytest.approx(180.0)


@given(st.floats(5.0, 170.0), st.lists(st.floats(1.0, 140.0), min_size=1, max_size=6))
def test_source_and_camera_stand_still_while_the_sample_turns(bistatic, sample):
    try:
        protocol = Protocol.in_plane(np.deg2rad(bistatic), np.deg2rad(sample))
    except DataError:  # nothing above the horizon
        return
    np.testing.assert_allclose(protocol.bistatic, np.deg2rad(bistatic), atol=1e-7)
    to_source, to_camera = rays(protocol.theta_i, protocol.theta_r, protocol.phi)
    np.testing.assert_allclose(angle_between(to_source, to_camera), np.deg2rad(bistatic), atol=1e-6)


@pytest.mark.parametrize("name", PAINTS)
def test_the_default_is_the_bundled_experiment(name):
    ds, protocol = open_experiment(name), Protocol.in_plane()
    for angle in ("theta_i", "theta_r", "phi"):
        assert np.array_equal(ds[angle].values, getattr(protocol, angle))
    assert np.array_equal(ds["group"].values, protocol.group)


def test_crowded_angles_are_close_at_the_mirror_direction_and_reach_far():
    sample = degrees(crowded_sample_angles(np.deg2rad(80.0)))
    assert len(sample) == 21
    assert sample[10] == pytest.approx(50.0)  # θ_i = 40° = Ψ/2
    assert sample[0] == pytest.approx(5.0)  # θ_i = 85°
    assert sample[-1] == pytest.approx(90.0)  # θ_i = 0°
    steps = np.diff(sample)
    assert steps.min() > 0.0
    assert np.argmin(steps) in (9, 10)
    np.testing.assert_allclose(sample, np.round(sample, 2), atol=1e-9)


def test_what_is_below_the_horizon_is_left_out_and_said():
    protocol = Protocol.in_plane(np.deg2rad([60.0, 120.0]), np.deg2rad([30.0, 80.0]))
    assert len(protocol) == 3
    assert protocol.notes == (
        "Left out, as source or camera would be hidden or below the horizon: 1 of 2 at position 2 (120°).",
    )


# Out of plane


def test_no_tilt_is_the_plane_of_incidence():
    sample = np.deg2rad([30.0, 60.0, 80.0])
    flat, tilted = (
        Protocol.in_plane(np.deg2rad(80.0), sample),
        Protocol.two_axes(np.deg2rad(80.0), sample, 0.0),
    )
    for angle in ("theta_i", "theta_r", "phi"):
        np.testing.assert_allclose(getattr(tilted, angle), getattr(flat, angle), atol=1e-12)


@given(st.floats(20.0, 150.0), st.floats(20.0, 80.0), st.floats(-60.0, 60.0))
def test_tilting_the_sample_moves_neither_source_nor_camera(bistatic, sample, tilt):
    try:
        protocol = Protocol.two_axes(*np.deg2rad([bistatic, sample, tilt]))
    except DataError:
        return
    to_source, to_camera = rays(protocol.theta_i, protocol.theta_r, protocol.phi)
    np.testing.assert_allclose(angle_between(to_source, to_camera), np.deg2rad(bistatic), atol=1e-6)
    # cosθ_i = cos(turn) cos(tilt): two rotations about axes square to each other
    np.testing.assert_allclose(
        np.cos(protocol.theta_i), np.cos(np.deg2rad(90.0 - sample)) * np.cos(np.deg2rad(tilt)), atol=1e-12
    )


def test_the_other_tilt_is_the_mirror_image():
    up, down = (Protocol.two_axes(*np.deg2rad([70.0, 40.0, tilt])) for tilt in (15.0, -15.0))
    assert up.theta_r == pytest.approx(down.theta_r)
    assert np.sin(up.phi) == pytest.approx(-np.sin(down.phi))
    assert up.reference_angle == pytest.approx(-down.reference_angle)


def test_a_hemisphere_looks_at_the_zenith_once_and_not_through_the_source():
    protocol = Protocol.hemisphere(
        np.deg2rad([20.0, 50.0]),
        np.deg2rad([0.0, 20.0, 50.0]),
        np.deg2rad([0.0, 90.0, 180.0]),
        obscured=np.deg2rad(5.0),
    )
    # 2 × (1 + 2 × 3), less the two that look back at the source
    assert len(protocol) == 12
    assert (protocol.bistatic > np.deg2rad(5.0)).all()
    assert "2 with the camera before the source" in protocol.notes[0]


def test_azimuths_carry_the_camera_about_the_normal():
    flat = Protocol.in_plane(np.deg2rad(80.0), np.deg2rad([20.0, 50.0]))
    turned = flat.at_azimuths(np.deg2rad([0.0, 30.0]))
    np.testing.assert_allclose(
        degrees(turned.phi) - np.tile(degrees(flat.phi), 2), [0.0, 0.0, 30.0, 30.0], atol=1e-9
    )
    assert turned.laboratory == "level"
    # what rounding leaves below 0 is no whole turn
    assert (flat.at_azimuths(-1e-17).phi == flat.phi).all()


# How the camera is held


@pytest.mark.parametrize("laboratory", LABORATORIES)
def test_in_the_plane_of_incidence_the_cameras_x_axis_lies_along_p(laboratory):
    protocol = Protocol.in_plane().at_azimuths(0.0, laboratory)
    np.testing.assert_allclose(np.sin(protocol.reference_angle), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.sin(protocol.source_reference_angle), 0.0, atol=1e-12)


def test_a_level_camera_at_the_side_has_its_x_axis_along_s():
    """Square to the plane of incidence the surface's normal and the raised arm are in one vertical plane: x is s."""
    for phi in (90.0, -90.0):
        protocol = Protocol.hemisphere(*np.deg2rad([40.0, 55.0, phi]), laboratory="level")
        assert degrees(protocol.reference_angle) == pytest.approx(90.0)
        assert (protocol.reference_angle <= np.pi / 2).all()


@given(st.floats(5.0, 80.0), st.floats(5.0, 80.0), st.floats(-80.0, 80.0))
def test_a_level_camera_is_turned_against_the_azimuth(theta_i, theta_r, phi):
    """tanχ = −tanφ cosθ_r: the camera goes to +y, and p leaves its x axis towards +s, so x is towards −s."""
    protocol = Protocol.hemisphere(*np.deg2rad([theta_i, theta_r, phi]), laboratory="level")
    expected = -np.tan(np.deg2rad(phi)) * np.cos(np.deg2rad(theta_r))
    assert np.tan(protocol.reference_angle) == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_a_sample_tilted_over_the_camera_turns_p_upright():
    """The normal straight above the camera: the plane of normal and view is upright, the camera's x axis level."""
    protocol = Protocol.two_axes(
        *np.deg2rad([60.0, 30.0, 20.0])
    )  # turned by 60°: the normal is above the camera
    assert degrees(protocol.theta_r) == pytest.approx(20.0)
    assert degrees(protocol.reference_angle) == pytest.approx(90.0)


@given(st.floats(20.0, 150.0), st.floats(20.0, 80.0), st.floats(-50.0, 50.0))
def test_a_camera_in_the_plane_of_source_and_sample_has_its_x_axis_there(bistatic, sample, tilt):
    try:
        protocol = Protocol.two_axes(*np.deg2rad([bistatic, sample, tilt]))
    except DataError:
        return
    if np.sin(protocol.theta_r) < 1e-3 or np.sin(protocol.theta_i) < 1e-3:
        return
    angles = protocol.theta_i, protocol.theta_r, protocol.phi
    p_i, s_i, p_r, s_r = frames(*angles)
    normal = np.cross(*rays(*angles))
    for p, s, chi in ((p_r, s_r, protocol.reference_angle), (p_i, s_i, protocol.source_reference_angle)):
        x = np.cos(chi)[:, None] * p + np.sin(chi)[:, None] * s
        np.testing.assert_allclose((x * normal).sum(-1), 0.0, atol=1e-9)


# Errors of the mechanics


@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_in_the_plane_errors_of_the_angles_add_to_them(turn, camera):
    """A sample turned on by ε: θ_i less, θ_r more by ε; a camera farther from the source: θ_r more."""
    protocol = Protocol.in_plane(np.deg2rad([50.0, 90.0]), np.deg2rad([15.0, 38.0, 52.0, 80.0]))
    moved = protocol.displaced(*np.deg2rad([turn, camera]))
    np.testing.assert_allclose(degrees(moved.theta_i), degrees(protocol.theta_i) - turn, atol=1e-9)
    np.testing.assert_allclose(signed_view(moved), signed_view(protocol) + turn + camera, atol=1e-9)


def test_turning_on_a_sample_beyond_the_normal_increases_the_incidence():
    beyond = Protocol.in_plane(np.deg2rad(60.0), np.deg2rad([100.0]))
    moved = beyond.displaced(np.deg2rad(1.0), 0.0)
    assert degrees(moved.theta_i) == pytest.approx(11.0)
    assert degrees(moved.theta_r) == pytest.approx(71.0)


def test_out_of_plane_errors_change_the_bistatic_angle_by_the_cameras_alone():
    protocol = Protocol.two_axes(
        np.deg2rad([60.0, 100.0]), np.deg2rad([30.0, 60.0]), np.deg2rad([-20.0, 10.0])
    )
    np.testing.assert_allclose(protocol.displaced(0.01, 0.0).bistatic, protocol.bistatic, atol=1e-12)
    np.testing.assert_allclose(protocol.displaced(0.0, 0.01).bistatic, protocol.bistatic + 0.01, atol=1e-12)
    assert np.abs(protocol.displaced(0.01, 0.0).theta_i - protocol.theta_i).max() > 5e-3


def test_a_tilt_is_that_of_the_second_axis():
    angles = np.deg2rad(80.0), np.deg2rad([20.0, 50.0, 70.0])
    moved = Protocol.in_plane(*angles).displaced(0.0, 0.0, 0.02)
    tilted = Protocol.two_axes(*angles, 0.02)
    for angle in ("theta_i", "theta_r", "phi"):
        np.testing.assert_allclose(getattr(moved, angle), getattr(tilted, angle), atol=1e-9)


# Tables


@pytest.mark.parametrize(
    "protocol",
    [
        Protocol.in_plane(),
        Protocol.two_axes(np.deg2rad([60.0, 100.0]), np.deg2rad([30.0, 60.0]), np.deg2rad([0.0, 25.0])),
        Protocol.hemisphere(
            np.deg2rad([30.0]), np.deg2rad([10.0, 60.0]), np.deg2rad([0.0, 45.0]), laboratory="level"
        ),
        Protocol.hemisphere(np.deg2rad([30.0]), np.deg2rad([10.0, 60.0]), np.deg2rad([0.0, 45.0])),
    ],
    ids=["in plane", "two axes", "level", "meridian"],
)
def test_an_angle_table_holds_the_protocol(protocol, tmp_path):
    mounted = np.deg2rad(20.0)
    write_angles(protocol.angle_table(wavelength=476.0, reference_angle=mounted), tmp_path / "angles.csv")
    read = Protocol.from_angle_table(read_angles(tmp_path / "angles.csv"), reference_angle=mounted)
    for column in ("theta_i", "theta_r", "phi", "group"):
        assert np.array_equal(getattr(read, column), getattr(protocol, column))
    np.testing.assert_array_equal(read.sample_angle, protocol.sample_angle)
    np.testing.assert_allclose(np.sin(read.reference_angle - protocol.reference_angle), 0.0, atol=1e-9)


def test_a_table_of_an_unknown_laboratory_is_refused():
    table = Protocol.hemisphere(*np.deg2rad([40.0, 55.0, 60.0]), laboratory="level").angle_table()
    with pytest.raises(DataError, match="no laboratory known here"):
        Protocol.from_angle_table(table, reference_angle=0.3)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Protocol.in_plane(0.0), "bistatic angles must be above 0°"),
        (lambda: Protocol.in_plane(np.deg2rad(20.0), np.deg2rad([170.0])), "below the horizon"),
        (lambda: Protocol.in_plane(np.deg2rad([60.0, 80.0]), [[0.5]]), "1 lists of sample angles"),
        (lambda: crowded_sample_angles(np.deg2rad(171.0)), "leaves no sample angle"),
        (lambda: Protocol.hemisphere(np.deg2rad(95.0), 0.1, 0.0), "theta_i = 95°"),
        (lambda: Protocol.hemisphere(0.5, 0.5, np.pi, obscured=0.1), "before the source"),
        (lambda: Protocol.hemisphere(0.5, 0.5, 0.0, laboratory="moon"), "choose one of meridian"),
        (lambda: Protocol.two_axes(np.deg2rad(170.0), 3.0, 0.0), "two axes"),
        (lambda: Protocol.in_plane(np.deg2rad(60.0), np.deg2rad([6.0])).displaced(-0.2, 0.0), "geometry 1"),
    ],
)
def test_what_cannot_be_set_is_refused(make, message):
    with pytest.raises(DataError, match=message):
        make()
