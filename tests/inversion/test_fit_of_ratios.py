"""Fits of normalised polarisation: what is recovered, with which weights, and what a common factor changes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import pbrdf
from pbrdf.data.conventions import dolp_aolp_from_stokes
from pbrdf.errors import FitError
from pbrdf.inversion.noise import EqualNoise, InstrumentNoise, NoiseModel
from pbrdf.inversion.observations import Observations, noise_in_words
from pbrdf.inversion.problem import derivatives, predict
from pbrdf.inversion.unknowns import space_of, with_terms

SHARED = Path(__file__).parents[3] / "shared" / "data"
FREE = ("sigma", "n", "a", "k", "b", "t")
FORMS = ("stokes", "degree and angle", "matrices", "beside an intensity", "matrices beside an intensity")
STD = 0.003


@pytest.fixture(scope="module")
def paint():
    return pbrdf.load_paint("cd-back")


@pytest.fixture(scope="module")
def directions():
    """In and out of the plane of incidence, dense in the lobe."""
    ti, tr, phi = np.meshgrid(
        np.deg2rad([20.0, 40.0, 60.0]), np.deg2rad(np.arange(2.0, 76.0, 3.0)), [0.0, 0.2, 0.7, 3.0]
    )
    return ti.ravel(), tr.ravel(), phi.ravel()


def simulated(model, angles, form, seed, std=STD, factor=1.0, quantity="radiance"):
    """Noisy ratios of a model, with their uncertainties; an intensity beside them is known to 1 %."""
    rng = np.random.default_rng(seed)
    M = np.asarray(model.mueller(*angles))
    stokes = M[:, :, 0]
    intensity = None
    stated = {}
    if "intensity" in form:
        quantity = "brdf"
        intensity = stokes[:, 0] * (1.0 + 0.01 * rng.standard_normal(len(M)))
        stated["I"] = 0.01 * stokes[:, 0]
    if form.startswith("matrices"):
        ratios = M / M[:, :1, :1] + std * rng.standard_normal(M.shape)
        ratios[:, 0, 0] = 1.0
        return pbrdf.make_dataset(
            *angles,
            quantity=quantity if intensity is not None else None,
            I=intensity,
            mueller_over_m00=ratios,
            std={**stated, "mueller_over_m00": std},
        )
    q, u = (stokes[:, i] / stokes[:, 0] + std * rng.standard_normal(len(M)) for i in (1, 2))
    if form == "degree and angle":
        degree, angle = dolp_aolp_from_stokes(np.column_stack([np.ones(len(M)), q, u]))
        across = std / (2.0 * np.maximum(degree, std))
        return pbrdf.make_dataset(*angles, dolp=degree, aolp=angle, std={"dolp": std, "aolp": across})
    return pbrdf.make_dataset(
        *angles,
        quantity=quantity if intensity is not None else None,
        I=intensity,
        Q_over_I=q,
        U_over_I=u,
        std={**stated, "Q_over_I": std, "U_over_I": std},
    )


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS)
def test_a_paint_is_recovered_from_its_ratios(paint, directions, form):
    """n, t and σ within three standard errors, and pulls of what noise gives."""
    result = pbrdf.fit(simulated(paint, directions, form, seed=3), starts=8)
    for name in ("n", "t", "sigma"):
        estimate = result.estimates[name]
        assert abs(estimate.value - paint.values[name]) < 3.0 * estimate.std, name
        assert estimate.std < 0.15 * paint.values[name], name
    assert result.std_known
    assert result.goodness.reduced_chi2 == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0 / result.goodness.data))


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS[:4])
def test_pulls_of_repeated_measurements(paint, directions, form):
    pulls = []
    for seed in range(40):
        result = pbrdf.fit(simulated(paint, directions, form, seed), paint, starts=1)
        pulls.append([(result.estimates[n].value - paint.values[n]) / result.estimates[n].std for n in FREE])
    # the mean of 40 pulls is known to 0.16, their scatter to 11 %
    assert np.abs(np.mean(pulls, axis=0)).max() < 0.65
    assert_allclose(np.std(pulls, axis=0), 1.0, atol=0.45)


@pytest.mark.slow
def test_dolp_alone_recovers_the_index(paint, directions):
    stokes = paint.stokes(*directions)
    degree = pbrdf.dolp(stokes) + STD * np.random.default_rng(1).standard_normal(len(stokes))
    keep = pbrdf.dolp(stokes) > 5.0 * STD  # a degree near 0 has no normal error
    dataset = pbrdf.make_dataset(*(a[keep] for a in directions), dolp=degree[keep], std={"dolp": STD})
    result = pbrdf.fit(dataset, starts=16)
    assert abs(result.estimates["n"].value - paint.values["n"]) < 3.0 * result.estimates["n"].std


@pytest.mark.slow
def test_a_common_factor_changes_nothing(paint, directions):
    """Readings in unknown units, divided by each other, are the same data; so is the fit, to the last bit."""
    rng = np.random.default_rng(5)
    stokes = paint.stokes(*directions)
    readings = stokes[:, :3] * (1.0 + STD * rng.standard_normal((len(stokes), 3)))
    found = []
    for factor in (1.0, 4096.0):  # a power of two, which division by it does not round
        raw = factor * readings
        dataset = pbrdf.make_dataset(
            *directions,
            Q_over_I=raw[:, 1] / raw[:, 0],
            U_over_I=raw[:, 2] / raw[:, 0],
            std={"Q_over_I": STD, "U_over_I": STD},
        )
        found.append([e.value for e in pbrdf.fit(dataset, paint, starts=2).estimates.values()])
    assert found[0] == found[1]


def test_a_gain_moves_no_ratio_and_a_dark_offset_does(paint):
    angles = (np.array([0.5]), np.array([0.9]), np.array([0.3]))
    channels = ("I", "Q_over_I", "m10_over_m00", "m01_over_m00")
    dataset = pbrdf.make_dataset(*angles, quantity="brdf", I=[1.0], Q_over_I=[0.1])
    data = Observations.from_dataset(dataset)
    space, _ = space_of(paint, {}, {n: paint.values[n] for n in FREE if n != "a"}, (), {}, {}, data)
    space = with_terms(space, data, {}, {}, ["gain", "dark"], {}, "linear")
    a = paint.values["a"]

    def seen(gain, dark):
        values = predict(space, space.to_unknowns(np.array([a, gain, dark])), data, channels)
        return np.array([values[c][0] for c in channels])

    once, thrice, offset = seen(1.0, 0.0), seen(3.0, 0.0), seen(1.0, 0.05)
    assert_allclose(thrice / once, [3.0, 1.0, 1.0, 1.0], rtol=1e-12)
    M = np.asarray(paint.mueller(*angles))[0]
    assert_allclose(once[1:], [M[1, 0] / M[0, 0], M[1, 0] / M[0, 0], M[0, 1] / M[0, 0]], rtol=1e-9)
    assert_allclose(offset[1], M[1, 0] / (M[0, 0] + 0.05), rtol=1e-9)


def test_each_ratio_has_its_own_weight_beside_an_intensity():
    angles = (np.deg2rad([30.0, 40.0]), np.deg2rad([30.0, 40.0]), np.zeros(2))
    dataset = pbrdf.make_dataset(
        *angles, quantity="reflectance_factor", I=[2.0, np.nan], Q_over_I=[-0.1, -0.2],
        std={"I": [0.2, np.nan], "Q_over_I": [0.01, 0.02]},
    )  # fmt: skip
    data = Observations.from_dataset(dataset)
    assert data.channels == ("I", "Q_over_I")
    assert_allclose(data.values, [[2.0 / np.pi, 0.0], [-0.1, -0.2]])
    assert_allclose(data.std, [[0.2 / np.pi, np.inf], [0.01, 0.02]])  # no cosine, no π, no share of that of I
    assert data.std_known


def test_degree_and_angle_carry_their_own_ellipse():
    """Along the direction of polarisation σ_p, across it 2pσ_ψ; unstated angles are as uncertain as the degree."""
    angles = (np.full(2, 0.5), np.full(2, 0.5), np.zeros(2))
    p, psi, s_p = 0.4, np.deg2rad(20.0), 0.01
    dataset = pbrdf.make_dataset(*angles, dolp=p, aolp=psi, std={"dolp": s_p, "aolp": [0.05, np.nan]})
    data = Observations.from_dataset(dataset)
    turn = np.array([[np.cos(2 * psi), -np.sin(2 * psi)], [np.sin(2 * psi), np.cos(2 * psi)]])
    expected = turn @ np.diag([s_p**2, (2 * p * 0.05) ** 2]) @ turn.T
    covariance = (
        data.factor @ data.factor.transpose(0, 2, 1) * data.std.T[:, :, None] * data.std.T[:, None, :]
    )
    assert_allclose(covariance[0], expected, rtol=1e-10)
    assert_allclose(covariance[1], s_p**2 * np.eye(2), atol=1e-18)


@pytest.mark.parametrize(
    ("noise", "expected"),
    [
        (NoiseModel(0.03, 0.04), 0.05),
        (InstrumentNoise(0.01, 0.05, read=2.0), 0.01),
        (EqualNoise(), 1.0),
    ],
)
def test_noise_of_ratios_without_an_intensity(noise, expected):
    nothing, one = np.full(3, np.nan), np.ones(3)
    assert_allclose(noise.standard_uncertainty("Q_over_I", nothing, one), expected)


def test_read_noise_alone_says_nothing_of_a_ratio_without_intensity():
    noise = InstrumentNoise(0.0, 0.0, read=2.0)
    with pytest.raises(FitError, match="Q_over_I without an intensity"):
        noise.standard_uncertainty("Q_over_I", np.full(3, np.nan), np.ones(3))
    assert_allclose(noise.standard_uncertainty("Q_over_I", np.full(3, 8.0), np.ones(3)), 0.25)


def glass(tmp_path, n):
    """Elements over M11 of a dielectric in its mirror direction, Q > 0 along s, as ellipsometers give them."""
    degrees = np.concatenate([-np.arange(10.0, 85.0, 5.0)[::-1], np.arange(10.0, 85.0, 5.0)])
    lines = ["theta_i_deg,M12_over_M11,M33_over_M11,M34_over_M11,blocked"]
    for angle in degrees:
        # Fresnel's amplitudes, written out
        inside = np.arcsin(np.sin(np.deg2rad(abs(angle))) / n)
        c, d = np.cos(np.deg2rad(abs(angle))), np.cos(inside)
        s, p = (c - n * d) / (c + n * d), (n * c - d) / (n * c + d)
        total = s * s + p * p
        lines.append(f"{angle},{(s * s - p * p) / total:.6f},{2 * s * p / total:.6f},0,0")
    lines.append("0,0.5,0.5,0.5,1")
    path = tmp_path / "glass.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


GLASS = {"where": {"blocked": "0"}, "stokes": "s-p", "column": {"theta_r": "theta_i_deg"}}
SMOOTH = {"a": 0.0, "k": 1.0, "b": 0.0, "t": 0.0, "sigma": 0.01}


def test_glass_in_its_mirror_direction(tmp_path):
    result = pbrdf.fit(pbrdf.read(glass(tmp_path, 1.62), **GLASS), fix=SMOOTH, starts=8)
    assert result.estimates["n"].value == pytest.approx(1.62, abs=1e-4)


def test_measured_glass():
    """Schott NG1: 1.537 by a direct fit of Fresnel's equations to M12."""
    path = SHARED / "glass-ng1" / "schott_ng1_inplane_specular_mueller.csv"
    if not path.exists():
        pytest.skip("measured data absent: ../shared/data/glass-ng1")
    dataset = pbrdf.read(path, **GLASS)
    assert dataset.sizes["geometry"] == 163
    result = pbrdf.fit(dataset, fix=SMOOTH, starts=8)
    assert result.estimates["n"].value == pytest.approx(1.537, abs=0.01)


def test_a_degree_without_its_angle_still_counts():
    angles = (np.full(3, 0.5), np.full(3, 0.5), np.zeros(3))
    dataset = pbrdf.make_dataset(
        *angles, dolp=[0.4, 0.1, np.nan], aolp=[0.0, np.nan, 0.2], std={"dolp": 0.01}
    )
    data = Observations.from_dataset(dataset)
    assert data.channels == ("Q_over_I", "U_over_I", "dolp")
    assert_allclose(data.values, [[0.4, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.1, 0.0]])
    assert_allclose(1.0 / data.std, np.array([[100.0, 0, 0], [100.0, 0, 0], [0, 100.0, 0]]))
    assert data.count == 3


def test_derivatives_of_ratios_are_those_of_differences(paint):
    """With a dark offset, which a ratio feels, in and out of the plane of incidence."""
    angles = (np.array([0.5, 0.9]), np.array([0.9, 0.6]), np.array([0.3, 2.0]))
    channels = ("Q_over_I", "U_over_I", "m10_over_m00", "m22_over_m00")
    data = Observations.from_dataset(pbrdf.make_dataset(*angles, quantity="brdf", I=[1.0, 1.0]))
    space, _ = space_of(paint, {}, {}, (), {}, {}, data)
    space = with_terms(space, data, {}, {}, ["dark"], {}, "linear")
    u = space.to_unknowns(np.array([paint.values[n] for n in FREE] + [0.03]))
    _, jacobian = derivatives(space, u[None], data, channels)
    step = 1e-5
    for i in range(len(u)):
        ends = [predict(space, u + sign * step * np.eye(len(u))[i], data, channels) for sign in (1.0, -1.0)]
        slope = np.stack([(ends[0][c] - ends[1][c]) / (2.0 * step) for c in channels], axis=-1)
        assert_allclose(jacobian[0, :, :, i], slope, rtol=1e-5, atol=1e-7)


def test_a_dark_model_has_ratios_of_zero_with_finite_derivatives():
    """Far outside a narrow lobe without a body there is no light at all in double precision."""
    angles = (np.array([0.2]), np.array([1.2]), np.array([0.0]))
    data = Observations.from_dataset(pbrdf.make_dataset(*angles, Q_over_I=[0.1]))
    fixed = {"a": 0.0, "k": 1.0, "b": 0.0, "t": 0.0, "sigma": 0.005}
    space, _ = space_of(pbrdf.DoubleGauss, {}, fixed, (), {}, {}, data)
    values, jacobian = derivatives(space, np.array([[1.5]]), data, ("Q_over_I",))
    assert values[0, 0, 0] == 0.0 and jacobian[0, 0, 0, 0] == 0.0


def test_a_gain_of_ratios_alone_is_refused(paint, directions):
    with pytest.raises(FitError, match="only ratios were measured"):
        pbrdf.fit(simulated(paint, directions, "stokes", 0), paint, nuisances=["gain"])


@pytest.mark.parametrize(
    ("noise", "words"),
    [
        (NoiseModel(0.03, 0.04), "stated: 0.05 for every ratio"),
        (
            InstrumentNoise(0.01, 0.05, read=2.0),
            "stated: instrument: 0.01 for linear and 0.05 for circular ratios",
        ),
        (EqualNoise(), "stated: equal weights"),
        (None, "uncertainty: 0.071 for every ratio"),
    ],
)
def test_the_noise_of_ratios_alone_is_not_told_of_an_intensity(noise, words):
    ds = pbrdf.make_dataset(0.5, [0.4, 0.5], 0.0, dolp=[0.1, 0.2])
    said = noise_in_words(noise, Observations.from_dataset(ds, noise))
    assert said.endswith(words) and "intensity" not in said
    bright = pbrdf.make_dataset(0.5, [0.4, 0.5], 0.0, quantity="brdf", dolp=[0.1, 0.2], I=1.0)
    if isinstance(noise, NoiseModel | InstrumentNoise):
        assert "of the intensity" in noise_in_words(noise, Observations.from_dataset(bright, noise))
