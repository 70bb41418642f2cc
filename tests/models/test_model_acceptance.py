"""MODEL section 6: the two computed tables, and independent integrals, to the acceptance numbers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import independent as ref
from pbrdf.models import DoubleGauss, ReciprocalDoubleGauss

ANGLES = ("theta_i", "theta_r", "phi")
READINGS = {"weighted": "flux", "visible": "amplitude"}


def relative(found, expected):
    """max|Δ|/f00 of every matrix."""
    return abs(found - expected).max((1, 2)) / expected[:, 0, 0]


def evaluate(table, accuracy, part="total"):
    reading = str(table["normalization"][0])
    model = DoubleGauss(
        **{name: table[name] for name in ref.PARAMETERS},
        normalization=reading,
        transmittance=READINGS[reading],
        accuracy=accuracy,
    )
    return model.mueller(*(table[name] for name in ANGLES), part=part)


@pytest.fixture(scope="module")
def readings(double_gauss_table):
    """The table's rows by normalization."""
    word = double_gauss_table["normalization"]
    tables = {w: {k: v[word == w] for k, v in double_gauss_table.items()} for w in READINGS}
    for w, table in tables.items():
        assert len(table["M"]) == 120 and set(table["transmittance"]) == {READINGS[w]}
    return tables


def easy(table):
    return (table["sigma"] <= 0.1) & (np.maximum(table["theta_i"], table["theta_r"]) <= np.radians(75))


def test_specular_part_equals_scatmech(scatmech_table):
    """300 matrices of NIST SCATMECH: max|Δ|/f00 ≤ 1e-9 in float64."""
    t = scatmech_table
    assert t["M"].shape == (300, 4, 4)
    model = DoubleGauss(t["sigma"], t["n"], 1.0, 1.0, 0.0, 0.0, kappa=t["kappa"])
    found = model.mueller(*(t[name] for name in ANGLES), part="specular")
    assert relative(found, t["M"]).max() <= 1e-9


def test_scatmech_rows_without_absorption(scatmech_table):
    """The kernel for dielectrics (κ = 0 throughout) is another one: the same 1e-9."""
    rows = scatmech_table["kappa"] == 0
    assert rows.sum() > 50
    t = {k: v[rows] for k, v in scatmech_table.items()}
    found = DoubleGauss(t["sigma"], t["n"], 1, 1, 0, 0).mueller(*(t[a] for a in ANGLES), part="specular")
    assert relative(found, t["M"]).max() <= 1e-9


@pytest.mark.parametrize("reading", READINGS)
def test_default_accuracy_against_the_table(readings, reading):
    """Default: ≤ 1e-5 where σ ≤ 0.1 and both zenith angles ≤ 75°, ≤ 1e-3 everywhere.

    Without the rows of ``visible`` with k < 1 in the first statement: there the table is not converged (see
    ``test_visible_rows_with_k_below_one``); the second statement holds for them too.
    """
    table = readings[reading]
    error = relative(evaluate(table, "default"), table["M"])
    counted = easy(table) & ((reading == "weighted") | (table["k"] >= 1))
    assert counted.sum() > 70
    assert error[counted].max() <= 1e-5
    assert error.max() <= 1e-3


@pytest.mark.parametrize("reading", READINGS)
def test_high_accuracy_against_the_table(readings, reading):
    """Highest accuracy setting: ≤ 1e-6 everywhere (the same rows left out)."""
    table = readings[reading]
    error = relative(evaluate(table, "high"), table["M"])
    assert error[(reading == "weighted") | (table["k"] >= 1)].max() <= 1e-6


def test_visible_rows_with_k_below_one(readings):
    """Those rows against an integral of their own: ours is right to 1e-9, the table is off by up to 7.3e-5.

    For k < 1 the integrand W of ∫W dω is singular along the edges of the lit and seen region. The reference
    integrates raw vectors with tanh-sinh nodes that know their distance to the edge. Two facts tell that
    it is the table's normaliser that is not converged: (1) its deviation grows as k falls, (2) the table's
    diffuse column is the reference's times one number for I, Q and U alike.
    """
    table = readings["visible"]
    rows = np.flatnonzero(table["k"] < 1)
    assert len(rows) == 14
    ours = {a: evaluate(table, a) for a in ("default", "high")}
    off = []
    for i in rows:
        p = {name: float(table[name][i]) for name in ref.PARAMETERS}
        angles = [float(table[name][i]) for name in ANGLES]
        expected = ref.specular(*angles, p["sigma"], p["n"] - 1j * p["kappa"])
        specular = expected[:3, 0].copy()
        expected[:3, 0] += ref.diffuse_column(*angles, p, "visible", "amplitude")
        f00 = expected[0, 0]
        assert abs(ours["high"][i] - expected).max() <= 1e-9 * f00
        limit = 1e-5 if easy(table)[i] else 1e-3
        assert abs(ours["default"][i] - expected).max() <= limit * f00
        off.append(abs(table["M"][i] - expected).max() / f00)
        # the deviation of the table is a common factor of its polarised diffuse part
        cos_w = -np.cos(angles[0]) * np.cos(angles[1]) + np.sin(angles[0]) * np.sin(angles[1]) * np.cos(
            angles[2]
        )
        flat = ref.shape(np.cos(angles[0]), np.cos(angles[1]), p["k"])
        unpolarised = (1 - p["t"]) * p["a"] / np.pi * flat * np.exp(p["b"] * cos_w) * np.array([1.0, 0, 0])
        ratio = (table["M"][i, :3, 0] - specular - unpolarised) / (expected[:3, 0] - specular - unpolarised)
        assert ratio[1] == pytest.approx(ratio[0], abs=3e-8 / abs(expected[1, 0] / f00))
    worst = int(np.argmax(off))
    assert 5e-5 < off[worst] < 1e-4
    assert table["k"][rows[worst]] == table["k"].min()


HARD = [
    # θ_i, θ_r, φ in degrees, σ, n, κ, k, t
    (85, 80, 10, 0.2, 1.5, 0.0, 1.25, 0.9),
    (85, 80, 100, 0.2, 1.5, 0.0, 0.8, 0.9),
    (60, 82, -30, 0.3, 2.0, 1.5, 2.6, 0.5),
    (89, 20, 140, 0.1, 1.3, 0.0, 1.1, 1.0),
    (20, 88, 0, 0.1, 1.8, 0.0, 2.0, 1.0),
    (0, 70, 50, 0.3, 1.6, 0.0, 1.5, 0.7),
]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["weighted-amplitude", "visible-flux", "reciprocal"])
def test_high_accuracy_in_hard_geometries(kind):
    """What the tables do not hold, against the reference integrals of the tests: ≤ 1e-6 of f00."""
    cases = np.array(HARD, dtype=float)
    angles, (sigma, n, kappa, k, t) = np.radians(cases[:, :3]).T, cases[:, 3:].T
    values = {"sigma": sigma, "n": n, "kappa": kappa, "a": 1.3, "k": k, "b": 0.4, "t": t}
    if kind == "reciprocal":
        model = ReciprocalDoubleGauss(**values, accuracy="high")
    else:
        normalization, transmittance = kind.split("-")
        model = DoubleGauss(
            **values, normalization=normalization, transmittance=transmittance, accuracy="high"
        )
    found = model.mueller(*angles)
    for i in range(len(HARD)):
        p = {name: float(np.broadcast_to(v, len(HARD))[i]) for name, v in values.items()}
        expected = np.zeros((4, 4))
        if cases[i, 0] > 0:  # the explicit angles of the reference need θ > 0
            expected = ref.specular(*angles[:, i], p["sigma"], p["n"] - 1j * p["kappa"])
        else:
            expected = model.mueller(*angles, part="specular")[i]
        if kind == "reciprocal":
            expected[:3, :3] += ref.reciprocal_block(*angles[:, i], p)
        else:
            expected[:3, 0] += ref.diffuse_column(*angles[:, i], p, normalization, transmittance)
        assert abs(found[i] - expected).max() <= 1e-6 * expected[0, 0], HARD[i]


@pytest.mark.parametrize(
    ("theta_max", "sigma_max", "tolerance"), [(75, 0.1, 1e-5), (83, 0.3, 1e-3)], ids=["paints", "rough"]
)
def test_default_accuracy_agrees_with_high(theta_max, sigma_max, tolerance):
    """Random parameters, k ≥ 0.7: max|Δ|/f00 ≤ 1e-5 for σ ≤ 0.1, θ ≤ 75°; ≤ 1e-3 for σ ≤ 0.3, θ ≤ 83°."""
    rng = np.random.default_rng(3)
    p, g = ref.random_case(rng, 4000, sigma=(0.002, sigma_max), theta_max=theta_max, k=(0.7, 4.0))
    default, high = (DoubleGauss(**p, accuracy=a).mueller(*g.values()) for a in ("default", "high"))
    assert relative(default, high).max() <= tolerance


def random_visible(k):
    p, g = ref.random_case(
        np.random.default_rng(4), 4000, sigma=(0.002, 0.1), theta_max=75, k=k, kappa="none"
    )
    options = {"normalization": "visible", "transmittance": "amplitude"}
    default, high = (
        DoubleGauss(**p, **options, accuracy=a).mueller(*g.values()) for a in ("default", "high")
    )
    return relative(default, high)


def test_default_accuracy_of_visible_for_moderate_k():
    """``visible``, 1 ≤ k ≤ 2 (four of the five paints, Figure 3): ≤ 1e-5 for σ ≤ 0.1, θ ≤ 75°."""
    assert random_visible((1.0, 2.0)).max() <= 1e-5


def test_default_accuracy_of_visible_for_all_k():
    """``visible``, 0.7 ≤ k ≤ 4: ≤ 1e-5 for σ ≤ 0.1, θ ≤ 75° in 999 of 1000 cases.

    The rest lies at grazing backscatter with k < 0.8, where the averages near their divergence (docs/model.md).
    """
    error = random_visible((0.7, 4.0))
    assert (error <= 1e-5).mean() >= 0.999
    assert error.max() <= 1e-4


@given(arrays(float, (7, 64), elements=st.floats(0.0, 1.0)))
@pytest.mark.parametrize("shadowing", ["v-cavity", "smith", "none"])
def test_specular_part_against_the_printed_equations(shadowing, unit):
    """Eqs (2)-(8) by explicit angles in NumPy, all shadowings, absorbers with n from 0.2."""
    theta_i, theta_r = 0.02 + 1.53 * unit[0], 0.02 + 1.53 * unit[1]
    phi = (0.02 + 0.96 * unit[2]) * np.where(unit[6] < 0.5, -np.pi, np.pi)
    sigma, n, kappa = 0.03 + 0.57 * unit[3], 0.2 + 2.4 * unit[4], 0.01 + 4 * unit[5]
    model = DoubleGauss(sigma, n, 1.0, 1.0, 0.0, 0.0, kappa=kappa, shadowing=shadowing)
    expected = ref.specular(theta_i, theta_r, phi, sigma, n - 1j * kappa, shadowing)
    found = model.mueller(theta_i, theta_r, phi, part="specular")
    scale = np.maximum(expected[:, 0, 0], 1e-250)
    assert (abs(found - expected).max((1, 2)) / scale).max() <= 1e-9


def test_draft_accuracy_is_good_for_searching():
    """``draft``, weighted, for σ ≤ 0.1 and θ ≤ 75°: 1e-3."""
    p, g = ref.random_case(np.random.default_rng(6), 4000, k=(0.7, 4.0), sigma=(0.002, 0.1), theta_max=75)
    draft, high = (DoubleGauss(**p, accuracy=a).mueller(*g.values()) for a in ("draft", "high"))
    assert relative(draft, high).max() <= 1e-3
