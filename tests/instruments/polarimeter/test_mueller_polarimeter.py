"""Dual rotating retarders against formulas written here anew, with samples whose matrices are known."""

from __future__ import annotations

import numpy as np
import pytest

from pbrdf.errors import DataError
from pbrdf.instruments.polarimeter.instrument_files import load_instrument, save_instrument
from pbrdf.instruments.polarimeter.mueller_polarimeter import (
    dual_rotating_retarder,
    mueller_to_surface_axes,
    solve_mueller,
)

ANGLES = np.deg2rad(np.arange(0.0, 180.0, 6.0))


def turned_jones(diagonal, angle):
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s], [s, c]])
    return turn @ np.diag(diagonal) @ turn.T


def chain(theta_g, theta_a, sample, *, delta_g=np.pi / 2, delta_a=np.pi / 2, polarizer=0.0, analyzer=0.0):
    """Intensity of natural light of the intensity 2 through polariser, retarder, sample (a Jones matrix), retarder and
    analyser: fields e^{+iωt}, so that the fast component, which leads by δ, carries e^{+iδ/2}."""
    total = 0.0
    for field in np.eye(2):
        field = turned_jones([1, 0], polarizer) @ field
        field = turned_jones([np.exp(0.5j * delta_g), np.exp(-0.5j * delta_g)], theta_g) @ field
        field = sample @ field
        field = turned_jones([np.exp(0.5j * delta_a), np.exp(-0.5j * delta_a)], theta_a) @ field
        field = turned_jones([1, 0], analyzer) @ field
        total += np.vdot(field, field).real
    return total


def retarder_matrix(angle, delta):
    """Mueller matrix of a retarder from its Jones matrix, V = 2 Im(E_x E_y*), by its action on six states."""
    return mueller_of(turned_jones([np.exp(0.5j * delta), np.exp(-0.5j * delta)], angle))


def mueller_of(jones):
    """M_ij = ½ tr(σ_i J σ_j J†) with the matrices of I, Q, U and V = 2 Im(E_x E_y*)."""
    pauli = [np.eye(2), np.diag([1, -1]), np.array([[0, 1], [1, 0]]), np.array([[0, 1j], [-1j, 0]])]
    return np.array([[0.5 * np.trace(a @ jones @ b @ jones.conj().T).real for b in pauli] for a in pauli])


SAMPLES = {
    "air": np.eye(2),
    "polariser": turned_jones([1, 0], np.deg2rad(25)),
    "retarder": turned_jones([np.exp(0.35j), np.exp(-0.35j)], np.deg2rad(-40)),
    # in the axes (p, s) of the incident and of the reflected ray: r_p = −r_s
    "mirror": np.diag([1.0, -1.0]),
    "metal": np.diag([0.8 * np.exp(0.3j), -0.9]),
}


@pytest.mark.parametrize("name", SAMPLES)
@pytest.mark.parametrize(
    "settings",
    [{}, {"delta_g": 1.3, "delta_a": 1.8, "polarizer": 0.2, "analyzer": -0.4}],
)
def test_matrices_of_known_samples(name, settings):
    sample = SAMPLES[name]
    readings = np.array([chain(t, 5 * t, sample, **settings) for t in ANGLES])
    polarimeter, generator = dual_rotating_retarder(
        ANGLES,
        5 * ANGLES,
        generator_retardance=settings.get("delta_g", np.pi / 2),
        analyzer_retardance=settings.get("delta_a", np.pi / 2),
        polarizer=settings.get("polarizer", 0.0),
        analyzer=settings.get("analyzer", 0.0),
    )
    found, _, residual = solve_mueller(readings, None, generator.stokes, polarimeter.analyzer)
    # polarised light of the intensity 1 through half of ideal elements
    np.testing.assert_allclose(found, 2.0 * mueller_of(sample) * 0.5, atol=1e-12)
    assert residual < 1e-12
    if name == "mirror":
        np.testing.assert_allclose(found, np.diag([1, 1, -1, -1]), atol=1e-12)
    if name == "air":
        np.testing.assert_allclose(found, np.eye(4), atol=1e-12)


def test_signs_in_words():
    """Fast axis along x, light at +45° (towards y, counterclockwise against the light): left circular, V > 0. The
    generator makes that with its polariser at 45° and the retarder at 0."""
    _, generator = dual_rotating_retarder([0.0], [0.0], polarizer=np.deg2rad(45))
    np.testing.assert_allclose(generator.stokes[0], [1, 0, 0, 1], atol=1e-12)
    # the analyser behind a retarder at 0 with its axis at −45° passes that light whole: it was left again
    polarimeter, _ = dual_rotating_retarder([0.0], [0.0], analyzer=np.deg2rad(-45))
    np.testing.assert_allclose(polarimeter.analyzer[0] @ generator.stokes[0], 1.0, atol=1e-12)


def test_uncertainties_are_those_of_the_noise():
    polarimeter, generator = dual_rotating_retarder(ANGLES, 5 * ANGLES)
    M = np.array([[1, 0.1, 0, 0.02], [0.1, 0.5, 0.1, 0], [0, -0.1, 0.4, 0.2], [0.01, 0, -0.2, 0.3]])
    exact = np.einsum("ni,ij,nj->n", polarimeter.analyzer, M, generator.stokes)
    sigma = 0.001 * (1.0 + exact)
    noisy = exact + sigma * np.random.default_rng(0).normal(size=(4000, len(exact)))
    variance = np.broadcast_to(sigma**2, noisy.shape)
    found, covariance, _ = solve_mueller(noisy, variance, generator.stokes, polarimeter.analyzer)
    scatter = np.cov(found.reshape(-1, 16).T)
    np.testing.assert_allclose(np.diag(scatter), np.diag(covariance[0]), rtol=0.15)
    correlation = covariance[0] / np.sqrt(np.outer(np.diag(covariance[0]), np.diag(covariance[0])))
    np.testing.assert_allclose(
        scatter / np.sqrt(np.outer(np.diag(scatter), np.diag(scatter))), correlation, atol=0.08
    )
    # without stated noise the residuals tell its size
    even = exact + 0.002 * np.random.default_rng(1).normal(size=(4000, len(exact)))
    _, own, _ = solve_mueller(even, None, generator.stokes, polarimeter.analyzer)
    _, known, _ = solve_mueller(
        even[:1], np.full((1, len(exact)), 4e-6), generator.stokes, polarimeter.analyzer
    )
    np.testing.assert_allclose(own[:, 0, 0].mean(), known[0, 0, 0], rtol=0.05)


def test_axes_of_the_surface():
    """An instrument whose x axes are turned measures the same surface."""
    polarimeter, generator = dual_rotating_retarder(ANGLES, 5 * ANGLES)
    sample = SAMPLES["metal"]
    turn_g, turn_a = 0.3, -0.7

    def rotation(angle):
        return np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])

    seen = rotation(turn_a) @ sample @ rotation(turn_g).T
    readings = np.array([chain(t, 5 * t, seen) for t in ANGLES])
    found, covariance, _ = solve_mueller(
        readings, np.ones_like(readings), generator.stokes, polarimeter.analyzer
    )
    back, spread = mueller_to_surface_axes(found, covariance, turn_g, turn_a)
    np.testing.assert_allclose(back, mueller_of(sample), atol=1e-12)
    # m00 does not turn
    assert spread[0, 0] == pytest.approx(covariance[0, 0])


def test_angles_that_do_not_determine_a_matrix():
    polarimeter, generator = dual_rotating_retarder(ANGLES, ANGLES)
    with pytest.raises(DataError, match=r"30 pairs .* determine \d+ of the 16"):
        solve_mueller(np.ones(30), None, generator.stokes, polarimeter.analyzer)
    with pytest.raises(DataError, match="2 angles of the generator and 3 of the analyser"):
        dual_rotating_retarder([0, 1], [0, 1, 2])


@pytest.mark.parametrize(
    ("text", "first", "second"),
    [
        ("", np.arange(36) * 5.0, np.arange(36) * 25.0),
        ("steps = 30", np.arange(30) * 6.0, np.arange(30) * 30.0),
        ("steps = 40\nstep = 9\nratio = 3", np.arange(40) * 9.0, np.arange(40) * 27.0),
        ("angles = [[0, 0], [10, 50], [20, 30]]", [0, 10, 20], [0, 50, 30]),
        ("generator_angles = [0, 10]", [0, 10], [0, 50]),
        ("generator_angles = [0, 10]\nanalyzer_angles = [3, 4]", [0, 10], [3, 4]),
    ],
)
def test_files(tmp_path, text, first, second):
    path = tmp_path / "drr.toml"
    path.write_text(
        f'[polarimeter]\nkind = "dual-rotating-retarder"\n{text}\nretardance = 91\nanalyzer_retardance = 88\n'
        "generator_reference_angle = 90\nreference_angle = 45\n"
    )
    found = load_instrument(path)
    expected = dual_rotating_retarder(
        np.deg2rad(first),
        np.deg2rad(second),
        generator_retardance=np.deg2rad(91),
        analyzer_retardance=np.deg2rad(88),
    )
    np.testing.assert_allclose(found.generator.stokes, expected[1].stokes, atol=1e-9)
    np.testing.assert_allclose(found.polarimeter.analyzer, expected[0].analyzer, atol=1e-9)
    assert found.generator.reference_angle == pytest.approx(np.pi / 2)
    save_instrument(found, tmp_path / "again.toml")
    again = load_instrument(tmp_path / "again.toml")
    np.testing.assert_allclose(again.generator.stokes, found.generator.stokes, atol=1e-9)
    np.testing.assert_allclose(again.polarimeter.analyzer, found.polarimeter.analyzer, atol=1e-9)
    assert (again.reference_angle, again.generator.reference_angle) == pytest.approx((np.pi / 4, np.pi / 2))
    with pytest.raises(DataError, match="measures Mueller matrices"):
        found.require_stokes()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("angles = [[0, 0]]\nsteps = 20", "give angles as pairs"),
        ("angles = [[0, 0, 1]]", "give pairs"),
        ("steps = 12", "give a whole number from 16"),
        ("retardence = 90", "did you mean 'retardance'"),
    ],
)
def test_mistakes_in_files(tmp_path, text, message):
    path = tmp_path / "drr.toml"
    path.write_text(f'[polarimeter]\nkind = "dual_rotating_retarder"\n{text}\n')
    with pytest.raises(DataError, match=message):
        load_instrument(path)
