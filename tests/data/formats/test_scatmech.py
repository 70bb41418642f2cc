"""The PTFE file is judged by physics: at normal incidence, under mirroring, and near grazing."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pbrdf.data import check, read
from pbrdf.data.conventions import mueller_sp_to_xyxy, mueller_swap_sp
from pbrdf.errors import DataError

INDICES = [(i, j) for i in range(1, 5) for j in range(1, 5)]
HEADER = "lambda,thetai,phi,thetar,phir,f_r11," + ",".join(f"f_r{i}{j}/f_r11" for i, j in INDICES[1:])


def row(wavelength, theta_i, phi_i, theta_r, phi_r, level, normalized) -> str:
    values = [wavelength, theta_i, phi_i, theta_r, phi_r, level, *normalized.ravel()[1:]]
    return ",".join(repr(float(value)) for value in values)


@pytest.fixture
def normalized():
    matrix = np.random.default_rng(2).uniform(-0.2, 0.2, (4, 4))
    matrix[0, 0] = 1.0
    return matrix


def test_elements_are_scaled_and_turned_to_our_convention(text_file, normalized):
    """A matrix of ours, expressed in their frame, sign and normalisation, comes back."""
    phi = np.deg2rad(-40.0)
    theirs = mueller_sp_to_xyxy(mueller_swap_sp(normalized), phi)
    ds = read(text_file(f"{HEADER}\n{row(0.351, -30, 0, 50, -40, 0.25, theirs)}\n"))
    assert_allclose(ds["mueller"][0], 0.25 * normalized)
    assert_array_equal(ds["wavelength"], [351.0])
    assert_allclose(np.rad2deg([ds["theta_i"][0], ds["theta_r"][0], ds["phi"][0]]), [30, 50, -40])
    assert_array_equal(ds["group"], [30])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("0.5,-30,0,50", "line 2: 4 cells under 21"),
        (row(0.5, 30, 0, 50, 0, 1, np.eye(4)), r"line 2: thetai = 30.*thetai <= 0"),
        (row(0.5, -30, 10, 50, 0, 1, np.eye(4)), "line 2: thetai = -30, phi = 10"),
        (row(0.5, -30, 0, 95, 0, 1, np.eye(4)), r"theta_r, line 2: .*\(95°\)"),
        (row(0.5, -30, 0, 50, 0, 1, np.eye(4)).replace("50.0", "x"), "line 2, column 'thetar': 'x'"),
    ],
)
def test_errors_name_line_and_column(text_file, text, words):
    with pytest.raises(DataError, match=rf"data\.csv.*\n?.*{words}"):
        read(text_file(f"{HEADER}\n{text}\n"))


def test_a_missing_element_is_named(text_file):
    with pytest.raises(DataError, match="no column 'f_r23/f_r11' or 'm23'"):
        read(text_file(HEADER.replace("f_r23/", "x/") + "\n"))


@pytest.fixture
def ptfe(measured):
    def load(wavelength):
        return read(measured("ptfe/PTFE.data.csv"), wavelength=wavelength)

    return load


def normalized_elements(ds):
    mueller = ds["mueller"].values
    return mueller / mueller[:, :1, :1]


def test_ptfe_is_read_whole_and_clean(ptfe):
    ds = ptfe(None)
    assert ds.sizes["geometry"] == 7296
    assert np.unique(ds["wavelength"]).tolist() == [351.0, 532.0, 633.0, 1064.0]
    assert np.unique(ds["group"]).tolist() == [0, 15, 30, 45, 60, 75]
    assert check(ds) == []


@pytest.mark.parametrize(("wavelength", "noise"), [(532, 0.008), (633, 0.008), (1064, 0.013)])
def test_at_normal_incidence_polarization_does_not_know_the_azimuth(ptfe, wavelength, noise):
    """Natural light along the normal of an isotropic sample: Q has one value at each θ_r, U and V vanish."""
    ds = ptfe(wavelength)
    tilted = ((ds["group"] == 0) & (ds["theta_r"] > np.deg2rad(60))).values
    m = normalized_elements(ds)[tilted]
    phi = ds["phi"].values[tilted]
    count = np.sqrt(tilted.sum())
    # Light scattered once by about 90° is s-polarised, light that leaves the body p: in PTFE the first wins.
    assert m[:, 1, 0].mean() < -5 * noise / count
    assert abs(m[:, 2, 0].mean()) < 5 * noise / count
    # The raw elements vary as cos 2φ and sin 2φ with the size of Q; after turning nothing of that is left.
    for harmonic in (np.cos(2 * phi), np.sin(2 * phi)):
        assert abs(np.mean(m[:, 1, 0] * harmonic)) < 5 * noise / count
        assert abs(np.mean(m[:, 2, 0] * harmonic)) < 5 * noise / count


@pytest.mark.parametrize(("wavelength", "noise"), [(532, 0.008), (633, 0.008), (1064, 0.013)])
def test_mirror_pairs_differ_in_sign_where_one_of_u_and_v_is_involved(ptfe, wavelength, noise):
    """Mirroring in the plane of incidence: φ → −φ, and U, V → −U, −V on both sides."""
    ds = ptfe(wavelength)
    m = normalized_elements(ds)
    keys = np.round(np.rad2deg(np.stack([ds["theta_i"], ds["theta_r"], ds["phi"]], axis=1)), 3)
    index = {tuple(key): i for i, key in enumerate(keys)}
    pairs = [(i, index[a, b, -p]) for (a, b, p), i in index.items() if 0 < p < 180 and (a, b, -p) in index]
    assert len(pairs) > 500
    left, right = (m[list(side)] for side in zip(*pairs, strict=True))
    parity = np.outer([1, 1, -1, -1], [1, 1, -1, -1])
    scatter = np.std(left - parity * right, axis=0) / np.sqrt(2)
    assert np.median(scatter) < 1.5 * noise
    # With the wrong parity the odd elements would differ by twice themselves.
    assert np.std(left[:, 2, 0] - right[:, 2, 0]) > 1.25 * np.std(left[:, 2, 0] + right[:, 2, 0])


def facet_mueller(theta_i, theta_r, phi, n):
    """Fresnel reflection off the facet that mirrors source to viewer, in our frames and signs."""
    z = np.array([0.0, 0.0, 1.0])
    k_in = np.array([np.sin(theta_i), 0.0, -np.cos(theta_i)])
    k_out = np.array([np.sin(theta_r) * np.cos(phi), np.sin(theta_r) * np.sin(phi), np.cos(theta_r)])
    facet = (k_out - k_in) / np.linalg.norm(k_out - k_in)

    def frame(k, normal):
        s = np.cross(k, normal)
        s /= np.linalg.norm(s)
        return np.array([np.cross(s, k), s])

    cosine = -k_in @ facet
    inside = np.sqrt(1 - (1 - cosine**2) / n**2)
    fresnel = np.diag(
        [(n * cosine - inside) / (n * cosine + inside), (cosine - n * inside) / (cosine + n * inside)]
    )
    jones = frame(k_out, z) @ frame(k_out, facet).T @ fresnel @ frame(k_in, facet) @ frame(k_in, z).T
    pauli = np.array([np.eye(2), [[1, 0], [0, -1]], [[0, 1], [1, 0]], [[0, -1j], [1j, 0]]])
    mueller = 0.5 * np.einsum("iab,bc,jcd,ad->ij", pauli, jones, pauli, jones.conj())
    return np.real(mueller / mueller[0, 0])


@pytest.mark.parametrize("wavelength", [532, 633])
def test_near_grazing_ptfe_follows_reflecting_facets(ptfe, wavelength):
    """At 75° and far out, reflection off the surface stands out of the depolarised rest, sideways too.

    Element by element the measurement goes with Fresnel reflection off a facet as directions change. This
    fixes every sign that a mirror-symmetric sample can show: axes, sense of rotation, Q and U. (At 1064 nm
    the noise is as large as the smallest of these elements.)
    """
    ds = ptfe(wavelength)
    far_out = (ds["theta_r"] > np.deg2rad(60)) & (np.abs(ds["phi"]) < np.deg2rad(75))
    rows = ((ds["group"] == 75) & far_out).values
    geometry = zip(*(ds[name].values[rows] for name in ("theta_i", "theta_r", "phi")), strict=True)
    expected = np.array([facet_mueller(*angles, n=1.35) for angles in geometry])
    found = normalized_elements(ds)[rows]
    for i, j in [(0, 1), (0, 2), (1, 0), (2, 0), (1, 1), (1, 2), (2, 1), (2, 2), (3, 3)]:
        assert np.corrcoef(expected[:, i, j], found[:, i, j])[0, 1] > 0.4, (i, j)
