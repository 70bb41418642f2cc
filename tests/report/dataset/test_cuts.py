import numpy as np
import pytest

import pbrdf
from pbrdf.report.dataset.cuts import in_plane, in_plane_cuts
from pbrdf.report.dataset.points import Points


def points(theta_i, s, group=0, phi=None):
    """Points in the plane of incidence (or at an azimuth), degrees; s negative on the source's side."""
    theta_i, s = np.broadcast_arrays(np.asarray(theta_i, float), np.asarray(s, float))
    azimuth = np.where(s < 0.0, 180.0, 0.0) if phi is None else np.asarray(phi, float)
    ds = pbrdf.make_dataset(
        np.deg2rad(theta_i), np.deg2rad(np.abs(s)), np.deg2rad(azimuth), quantity="brdf", I=1.0, group=group
    )
    return Points.from_dataset(ds)


def test_a_fixed_source_gives_cuts_of_constant_incidence():
    theta_i = np.repeat([60.0, 20.0], 5)
    s = np.tile([-40.0, -10.0, 0.0, 20.0, 50.0], 2)
    cuts = in_plane_cuts(points(theta_i, s))
    assert [(cut.kind, cut.constant) for cut in cuts] == [
        ("theta_i", pytest.approx(20.0)),
        ("theta_i", pytest.approx(60.0)),
    ]
    np.testing.assert_allclose(cuts[0].x, [-40.0, -10.0, 0.0, 20.0, 50.0], atol=1e-12)


def test_a_turning_sample_gives_cuts_of_constant_bistatic_angle():
    points_ = Points.from_dataset(pbrdf.open_experiment("white"))
    cuts = in_plane_cuts(points_)
    assert [(cut.kind, cut.group, round(cut.constant)) for cut in cuts] == [
        ("bistatic", "1", 60),
        ("bistatic", "2", 80),
        ("bistatic", "3", 100),
    ]
    assert sorted(np.concatenate([cut.rows for cut in cuts])) == list(range(63))
    theta_i, theta_r, phi = cuts[0].path_angles()
    forward = np.where(phi == 0.0, theta_r, -theta_r)
    np.testing.assert_allclose(np.rad2deg(theta_i + forward), 60.0)


def test_a_viewer_that_follows_the_source_gives_one_cut_over_the_angle_of_incidence():
    theta_i = np.arange(5.0, 85.0, 5.0)
    (cut,) = in_plane_cuts(points(theta_i, theta_i))
    assert (cut.kind, cut.constant, cut.over_incidence) == ("mirror", 0.0, True)
    np.testing.assert_allclose(cut.x, theta_i)
    drawn_i, drawn_r, phi = cut.path_angles()
    np.testing.assert_array_equal(drawn_i, drawn_r)
    assert not phi.any()


def test_a_fixed_viewer_gives_cuts_of_constant_viewing_angle():
    theta_i = np.tile(np.arange(5.0, 60.0, 5.0), 2)
    cuts = in_plane_cuts(points(theta_i, np.repeat([15.0, -30.0], 11)))
    assert [cut.kind for cut in cuts] == ["theta_r", "theta_r"]
    np.testing.assert_allclose(cuts[0].x, np.arange(5.0, 60.0, 5.0))
    assert cuts[0].constant == pytest.approx(-30.0)
    np.testing.assert_array_equal(cuts[0].path_angles()[2], np.pi)


def test_a_curve_passes_through_its_points_and_not_over_wide_gaps():
    cut = in_plane_cuts(points(30.0, [-80.0, -75.0, -70.0, 0.0, 1.03]))[0]
    assert np.isin(np.round(cut.x, 9), np.round(cut.path_x, 9)).all()
    assert np.isnan(cut.path_x).sum() == 1
    inside = cut.path_x[np.isfinite(cut.path_x)]
    assert not ((inside > -69.9) & (inside < -0.1)).any()
    assert np.nanmax(np.where(np.diff(cut.path_x) < 1.0, np.diff(cut.path_x), 0.0)) <= 0.1 + 1e-9


def test_points_out_of_plane_are_on_no_cut():
    everywhere = points(np.full(6, 30.0), np.full(6, 40.0), phi=[0.0, 0.5, 2.0, 90.0, 179.5, -179.5])
    assert in_plane(everywhere).tolist() == [True, True, False, False, True, True]
    assert in_plane_cuts(points(np.full(4, 30.0), np.full(4, 40.0), phi=[10.0, 50.0, 90.0, 140.0])) == []


def test_scattered_geometries_give_no_cuts():
    draw = np.random.default_rng(1)
    assert in_plane_cuts(points(draw.uniform(5, 80, 20), draw.uniform(-80, 80, 20))) == []
