"""Plans: their promise against fits, Monte-Carlo and other plans."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import pbrdf
from pbrdf.data.paints import load_paint
from pbrdf.errors import FitError
from pbrdf.instruments.goniometer.protocols import Protocol
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.expected_noise import expected_covariance
from pbrdf.instruments.polarimeter.presets import preset
from pbrdf.inversion.noise import InstrumentNoise
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.problem import Space, derivatives, residuals
from pbrdf.inversion.solver import solve
from pbrdf.optics.elements import rotate_frame
from pbrdf.planning.candidates import in_plane_candidates, out_of_plane_candidates
from pbrdf.planning.plan import _angle_covariance, information, plan

THICK = load_paint("matte-white-thick")
PAPER = replace(preset("paper"), detector=Detector(bits=12, gain=5.0, read_noise=20.0))
NOISE = InstrumentNoise(linear=0.01, circular=0.05)


def space_of(model, names=("sigma", "n", "a", "k", "b", "t")):
    free = tuple(p for p in model.parameters if p.name in names)
    fixed = {p.name: float(model.values[p.name]) for p in model.parameters if p.name not in names}
    low, high = (np.array([getattr(p, side) for p in free]) for side in ("lower", "upper"))
    return Space(type(model), model.chosen, free, fixed, low, high)


def unknowns_of(space, model):
    return space.to_unknowns(np.array([[float(model.values[name]) for name in space.names]]))


def total_information(model, protocol, noise, names=("sigma", "n", "a", "k", "b", "t"), **options):
    space = space_of(model, names)
    return information(space, unknowns_of(space, model), [protocol], noise, **options)[0].sum(axis=0)


def relative_errors(model, protocol, noise=NOISE):
    space = space_of(model)
    matrix = total_information(model, protocol, noise)
    std = np.sqrt(np.diag(np.linalg.inv(matrix))) * space.derivative(
        space.to_parameters(unknowns_of(space, model))
    )
    return std[0] / np.array([float(model.values[name]) for name in space.names])


# What the information is


@pytest.mark.slow
@pytest.mark.parametrize("model", [THICK, load_paint("pearl-white")], ids=["thick", "pearl"])
def test_information_is_that_of_a_fit_at_the_truth(model):
    protocol = Protocol.in_plane()
    angles = protocol.theta_i, protocol.theta_r, protocol.phi
    stokes = model.stokes(*angles)
    std = {c: share * stokes[:, 0] for c, share in zip("IQUV", (0.01, 0.01, 0.01, 0.05), strict=True)}
    dataset = pbrdf.make_dataset(
        *angles, quantity="brdf", **dict(zip("IQUV", stokes.T, strict=True)), std=std, group=protocol.group
    )
    result = pbrdf.fit(dataset, model, starts=1)
    expected = total_information(model, protocol, NOISE)
    np.testing.assert_allclose(result.information, expected, rtol=1e-5, atol=1e-6 * np.abs(expected).max())
    made = plan(model, NOISE, 63, reference=protocol, repeats=63, starts=1)
    for name, std in zip(made.names, made.reference_std, strict=True):
        assert std == pytest.approx(result.estimates[name].std, rel=1e-5), name


def test_information_of_ratios_is_what_an_unknown_scale_of_every_reading_leaves():
    """Schur's complement: a free factor of I, Q, U, V at each geometry, marginalised."""
    protocol, space = Protocol.in_plane(), space_of(THICK)
    unknowns = unknowns_of(space, THICK)
    found = information(space, unknowns, [protocol], PAPER, pixels=100, normalised=True)[0]
    blank = np.zeros((4, len(protocol)))
    data = Observations(
        protocol.theta_i,
        protocol.theta_r,
        protocol.phi,
        tuple("IQUV"),
        blank,
        blank + 1.0,
        (1.0, 0.0, 0.0, 0.0),
        True,
    )
    values, jacobian = (a[0] for a in derivatives(space, unknowns, data, "IQUV"))
    cosine = np.cos(protocol.theta_i)
    turned = PAPER.reference_angle + protocol.reference_angle
    spread = expected_covariance(PAPER, values * cosine[:, None], reference_angle=turned, pixels=100)
    seen = np.flatnonzero(PAPER.polarimeter.determined)
    for g in range(0, len(protocol), 7):
        C = spread[g][np.ix_(seen, seen)] / cosine[g] ** 2
        J = np.column_stack([jacobian[g, seen], values[g, seen]])
        full = J.T @ np.linalg.solve(C, J)
        left = full[:-1, :-1] - np.outer(full[:-1, -1], full[-1, :-1]) / full[-1, -1]
        np.testing.assert_allclose(found[g], left, atol=1e-8 * np.abs(full[:-1, :-1]).max())


@pytest.mark.slow
def test_information_takes_the_whole_covariance_of_the_instrument():
    protocol = Protocol.two_axes(
        np.deg2rad([40.0, 80.0, 110.0]), np.deg2rad([25.0, 40.0, 55.0, 70.0]), np.deg2rad([0.0, 15.0])
    )
    angles = protocol.theta_i, protocol.theta_r, protocol.phi
    stokes = THICK.stokes(*angles)
    covariance = expected_covariance(
        PAPER, stokes * np.cos(angles[0])[:, None], reference_angle=protocol.reference_angle, pixels=100
    )
    covariance /= np.square(np.cos(angles[0]))[:, None, None]
    off = covariance[:, 0, 1] / np.sqrt(covariance[:, 0, 0] * covariance[:, 1, 1])
    assert np.abs(off).max() > 0.01, "the test is about correlated errors"
    dataset = pbrdf.make_dataset(
        *angles, quantity="brdf", **dict(zip("IQUV", stokes.T, strict=True)), covariance=covariance
    )
    result = pbrdf.fit(dataset, THICK, starts=1)
    expected = total_information(THICK, protocol, PAPER, pixels=100)
    np.testing.assert_allclose(result.information, expected, rtol=1e-5, atol=1e-6 * np.abs(expected).max())


def test_without_v_nothing_is_lost_on_a_dielectric_in_natural_light():
    protocol = Protocol.in_plane()
    known, unknown = (
        total_information(THICK, protocol, InstrumentNoise(linear=0.01, circular=c)) for c in (0.05, 1e3)
    )
    np.testing.assert_allclose(known, unknown, rtol=1e-9)
    # a camera without V has three channels only, and determines all parameters
    sony = total_information(THICK, protocol, preset("sony_imx250mzr"))
    assert np.linalg.eigvalsh(sony).min() > 0.0


@pytest.mark.parametrize(
    ("protocol", "tilts"),
    [
        # peak, flank and foot of the lobe
        (Protocol.in_plane(np.deg2rad(80.0), np.deg2rad([50.0, 50.35, 60.0])), 0.0),
        (Protocol.two_axes(np.deg2rad(80.0), np.deg2rad([50.0, 50.3]), np.deg2rad([0.0, 0.4])), 1.0),
    ],
    ids=["in plane", "two axes"],
)
def test_errors_of_the_sample_angles_count_as_their_mean_square(protocol, tilts):
    model, sigma, count = load_paint("white"), np.deg2rad(0.08), 4000
    space = space_of(model)
    stated = _angle_covariance(space, unknowns_of(space, model), protocol, sigma)[0]
    many = protocol.subset(np.tile(np.arange(len(protocol)), count))
    rng = np.random.default_rng(0)
    turn, tilt = sigma * rng.standard_normal((2, len(many)))
    moved = many.displaced(turn, 0.0, tilts * tilt)
    radiance = [model.stokes(p.theta_i, p.theta_r, p.phi) * np.cos(p.theta_i)[:, None] for p in (many, moved)]
    error = ((radiance[1] - radiance[0]) / np.cos(many.theta_i)[:, None]).reshape(count, -1, 4)
    np.testing.assert_allclose(stated[:, 0, 0], np.square(error[..., 0]).mean(axis=0), rtol=0.2)


def test_a_tilt_of_the_sample_turns_p_before_the_camera():
    """Near normal view p turns by much more than the sample is tilted; the camera sees nothing of that."""
    model, sigma, count = load_paint("white"), np.deg2rad(0.1), 2000
    protocol = Protocol.two_axes(np.deg2rad(60.0), np.deg2rad([30.2, 33.0]), np.deg2rad([0.5]))
    assert protocol.theta_r.min() < np.deg2rad(0.6)
    space = space_of(model)
    stated = _angle_covariance(space, unknowns_of(space, model), protocol, sigma)[0]
    many = protocol.subset(np.tile(np.arange(len(protocol)), count))
    turn, tilt = sigma * np.random.default_rng(0).standard_normal((2, len(many)))
    moved = many.displaced(turn, 0.0, tilt)

    def camera(p):
        stokes = model.stokes(p.theta_i, p.theta_r, p.phi) * np.cos(p.theta_i)[:, None]
        return np.einsum("gij,gj->gi", rotate_frame(p.reference_angle), stokes)

    error = camera(moved) - camera(many)
    error = np.einsum("gij,gj->gi", rotate_frame(-many.reference_angle), error)
    error = (error / np.cos(many.theta_i)[:, None]).reshape(count, -1, 4)
    expected = np.einsum("ngi,ngj->gij", error, error) / count
    for k in (0, 1, 2):
        np.testing.assert_allclose(stated[:, k, k], expected[:, k, k], rtol=0.2)


# Against simulated measurements


@pytest.mark.slow
def test_expected_errors_are_the_scatter_of_refits():
    made = plan(THICK, NOISE, 30, starts=2)
    protocol = made.protocol
    space = space_of(THICK)
    truth = unknowns_of(space, THICK)
    exact = THICK.stokes(protocol.theta_i, protocol.theta_r, protocol.phi)
    std = exact[:, :1] * np.array([0.01, 0.01, 0.01, 0.05])
    rng = np.random.default_rng(8)
    count = 400
    data = [
        Observations(
            protocol.theta_i,
            protocol.theta_r,
            protocol.phi,
            tuple("IQUV"),
            (exact + std * rng.standard_normal(exact.shape)).T,
            std.T,
            (1.0, 0.0, 0.0, 0.0),
            True,
        )
        for _ in range(count)
    ]
    solution = solve(residuals(space, data), np.repeat(truth, count, axis=0), *space.box)
    assert solution.converged.all()
    scatter = space.to_parameters(solution.u).std(axis=0, ddof=1)
    # the standard error of a standard deviation from 400 samples is 3.5 %
    np.testing.assert_allclose(scatter, made.std, rtol=0.14)


# Against other plans


@pytest.mark.slow
@pytest.mark.parametrize("criterion", ["D", "A"])
def test_a_plan_beats_the_papers_and_random_ones(criterion):
    made = plan(THICK, NOISE, 63, criterion=criterion, starts=2)
    assert len(made.protocol) == 63
    assert made.gain > 1.0

    def worth(std):
        return -np.log(np.square(std / made.sizes).mean()) if criterion == "A" else None

    space = space_of(THICK)
    unknowns = unknowns_of(space, THICK)
    each = information(space, unknowns, [made.candidates], NOISE)[0]

    def value(matrix):
        if criterion == "D":
            return np.linalg.slogdet(matrix)[1] / 6.0
        std = np.sqrt(np.diag(np.linalg.inv(matrix))) * space.derivative(space.to_parameters(unknowns))[0]
        return worth(std)

    chosen = value(np.einsum("g,gpq->pq", made.counts.astype(float), each))
    paper = value(total_information(THICK, made.reference, NOISE))
    assert chosen - paper == pytest.approx(np.log(made.gain), abs=1e-9)
    rng = np.random.default_rng(1)
    for _ in range(30):
        rows = rng.choice(len(made.candidates), 63, replace=False)
        assert value(each[rows].sum(axis=0)) < chosen
    # the bound of the equivalence theorem is kept by the best shares themselves
    shares = value(63.0 * np.einsum("g,gpq->pq", made.shares.weights, each))
    assert chosen <= shares + 1e-3
    assert made.efficiency <= np.exp(chosen - shares) + 1e-9


def test_the_promised_errors_are_those_of_the_chosen_geometries():
    made = plan(THICK, NOISE, 24, starts=1)
    np.testing.assert_allclose(relative_errors(THICK, made.protocol), made.std / made.values, rtol=1e-6)


@pytest.mark.slow
def test_more_readings_and_more_freedom_never_make_a_plan_worse():
    values = [plan(THICK, NOISE, budget, starts=2, **options) for budget, options in (
        (20, {"camera_positions": 2, "repeats": 4}),
        (20, {"repeats": 4}),
        (40, {"repeats": 4}),
    )]  # fmt: skip
    volume = [np.log(made.std).sum() for made in values]
    gains = [made.gain for made in values]
    assert gains[0] < gains[1] + 1e-9
    # of as many readings one is still worth as much, and twice as many determine more
    assert gains[2] == pytest.approx(gains[1], rel=0.15)
    assert volume[2] < volume[1]


def test_body_light_alone_is_read_at_the_extremes():
    """n = 1 reflects nothing: I = a/π x^(k−1), x = (μ_r + μ_i) μ_r μ_i. ln I is a straight line in ln x: half of the
    readings at the largest x and half at the smallest."""
    model = pbrdf.DoubleGauss(0.05, 1.0, 1.0, 1.4, 0.0, 0.0)
    made = plan(model, NOISE, 20, fix=("sigma", "n", "b", "t"), repeats=20)
    assert made.names == ("a", "k")
    mu_i, mu_r = np.cos(made.candidates.theta_i), np.cos(made.candidates.theta_r)
    x = (mu_i + mu_r) * mu_i * mu_r
    chosen = np.repeat(x, made.counts)
    assert sorted(np.isclose(chosen, x.max()).tolist()) == [False] * 10 + [True] * 10
    assert np.isclose(chosen, x.min()).sum() == 10
    # the variance of a straight line's slope: 0.01²/(n/4 · (ln x_max/x_min)²)
    slope = 0.01 / np.sqrt(20.0 / 4.0) / np.log(x.max() / x.min())
    assert made.std[1] == pytest.approx(slope, rel=1e-3)


# Options


@pytest.mark.slow
def test_camera_positions_are_as_many_as_asked():
    made = plan(THICK, NOISE, 30, camera_positions=3, starts=1)
    assert len(np.unique(made.protocol.group)) == 3
    assert len(np.unique(made.protocol.bistatic.round(6))) == 3
    assert made.protocol.group.min() == 1


@pytest.mark.slow
def test_only_parameters_of_interest_count():
    narrow = plan(THICK, NOISE, 20, parameters=("n",), repeats=20, starts=2)
    wide = plan(THICK, NOISE, 20, repeats=20, starts=2)
    at = narrow.names.index("n")
    assert narrow.std[at] < 0.9 * wide.std[at]
    assert narrow.std.size == 6, "the others are still fitted"


@pytest.mark.slow
def test_a_weight_lowers_the_error_it_weighs():
    plain, heavy = (
        plan(THICK, NOISE, 30, criterion="A", weights=w, repeats=30, starts=2) for w in ({}, {"sigma": 30.0})
    )
    at = plain.names.index("sigma")
    assert heavy.std[at] < 0.9 * plain.std[at]


@pytest.mark.slow
def test_a_plan_for_an_uncertain_guess_serves_other_models_better():
    guess = load_paint("white")
    few = in_plane_candidates(guess, position_step=np.deg2rad(20.0), angle_step=np.deg2rad(10.0))
    sure, unsure = (
        plan(guess, NOISE, 30, candidates=few, repeats=30, uncertainty=u, starts=1) for u in (0.0, 0.3)
    )
    others = [
        guess.replace(sigma=guess.values["sigma"] * f, n=n) for f, n in ((0.65, 1.6), (1.5, 2.0), (1.4, 1.6))
    ]

    def volume(made):
        return np.mean([np.linalg.slogdet(total_information(m, made.protocol, NOISE))[1] for m in others])

    assert volume(unsure) > volume(sure) + 0.1


@pytest.mark.slow
def test_an_error_of_the_angles_is_part_of_the_promise():
    exact, rough = (
        plan(load_paint("white"), PAPER, 40, angle_error=e, starts=1) for e in (0.0, np.deg2rad(0.05))
    )
    assert rough.std[0] > 3.0 * exact.std[0]
    assert rough.std[2] > exact.std[2]


@pytest.mark.parametrize("make", [in_plane_candidates, out_of_plane_candidates])
def test_candidates_keep_their_limits_and_resolve_the_lobe(make):
    limits = {"smallest_bistatic": np.deg2rad(20.0), "largest_zenith": np.deg2rad(70.0)}
    candidates = make(load_paint("white"), **limits)
    assert candidates.bistatic.min() > np.deg2rad(20.0) - 1e-9
    assert max(candidates.theta_i.max(), candidates.theta_r.max()) < np.deg2rad(70.0) + 1e-9
    offset = np.abs(candidates.theta_r - candidates.theta_i) / 2.0
    near = (offset > 0.0) & (offset < 0.012) & (np.abs(np.sin(candidates.phi)) < 1e-9)
    assert near.sum() > 20
    flat = np.abs(np.sin(candidates.phi)) < 1e-9
    assert flat.all() == (make is in_plane_candidates)


@pytest.mark.slow
def test_a_plan_out_of_plane_is_better_still():
    inside = plan(THICK, NOISE, 30, repeats=30, starts=1)
    outside = plan(THICK, NOISE, 30, repeats=30, starts=1, candidates=out_of_plane_candidates(THICK))
    assert outside.gain > inside.gain
    assert (np.abs(np.sin(outside.protocol.phi)) > 1e-3).any()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"criterion": "E"}, "choose one of D, A"),
        ({"uncertainty": 1.5}, "a part from 0 to below 1"),
        ({"repeats": 0}, "at least once"),
        ({"fix": ("rho",)}, "no parameter 'rho'"),
        ({"fix": ("sigma", "n", "a", "k", "b", "t")}, "every parameter is fixed"),
        ({"parameters": ("kappa",)}, "'kappa' is not free"),
        ({"weights": {"n": -1.0}}, "must be above 0"),
        ({"weights": {"m": 1.0}}, "not of interest"),
        ({"camera_positions": 500}, "500 camera positions"),
        ({"budget": 1}, "1 readings do not determine"),
        ({"budget": 100_000}, "cannot make 100000 readings"),
        ({"model": THICK.replace(n=np.array([1.5, 1.6]))}, "single numbers"),
    ],
)
def test_impossible_plans_are_refused(options, message):
    arguments = {"model": THICK, "noise": NOISE, "budget": 20, "starts": 1, **options}
    with pytest.raises(FitError, match=message):
        plan(**arguments)
