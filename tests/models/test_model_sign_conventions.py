"""Signs and frames. Each test is preceded by the convention in words; docs/conventions.md names it."""

from __future__ import annotations

import numpy as np
import pytest

import independent as ref
from pbrdf.models import DoubleGauss, ReciprocalDoubleGauss

PAINT = {"sigma": 0.0398, "n": 1.6207, "a": 1.5174, "k": 1.2504, "b": 0.1827, "t": 0.6717}
METAL = DoubleGauss(0.1, 2 - 1.5j, 1.0, 1.0, 0.0, 0.0)


# The azimuth φ is 0 in the forward (specular) half-plane and π in backscatter.
def test_specular_lobe_is_at_phi_zero():
    model = DoubleGauss(**PAINT)
    theta = np.radians(40)
    forward, back = model.mueller(theta, theta, [0.0, np.pi], part="specular")[:, 0, 0]
    assert forward > 1e6 * back


# φ turns counter-clockwise about the normal, seen from above: the viewer at φ stands at
# (sinθ_r cosφ, sinθ_r sinφ, cosθ_r), the source at (−sinθ_i, 0, cosθ_i).
def test_sense_of_phi_shows_in_u():
    """For φ > 0 the s direction of a tilted facet leans so that U of the specular light has a fixed sign."""
    angles = np.radians([50.0, 50.0, 20.0])
    w_i, w_r = ref.rays(*angles)
    p, s = ref.frames(*angles)[2:]
    s_facet = np.cross(w_r, w_i)
    u_of_s_light = 2 * (s_facet @ p) * (s_facet @ s)
    f = METAL.mueller(*angles, part="specular")
    assert np.sign(f[2, 0]) == np.sign(u_of_s_light) != 0


# b > 0 scatters forward (φ = 0), b < 0 backward.
def test_positive_b_leans_forward():
    for b, sign in ((0.5, 1), (-0.5, -1)):
        f = DoubleGauss(**{**PAINT, "b": b, "t": 0.0}).mueller(0.9, 0.9, [0.0, np.pi], part="diffuse")[
            :, 0, 0
        ]
        assert np.sign(f[0] - f[1]) == sign


# Q = I_p − I_s: specular reflection is s-polarised, so Q < 0.
def test_specular_q_is_negative():
    f = METAL.mueller(0.9, 0.9, 0.0, part="specular")
    assert f[1, 0] < 0
    brewster = np.arctan(1.6207)
    f = DoubleGauss(**PAINT).mueller(brewster, brewster, 0.0, part="specular")
    assert f[1, 0] / f[0, 0] == pytest.approx(-1, abs=1e-12)


# Body light transmitted out of the coating is p-polarised, so Q > 0.
def test_diffuse_q_is_positive():
    for model in (
        DoubleGauss(**PAINT),
        ReciprocalDoubleGauss(**PAINT),
        DoubleGauss(**PAINT, normalization="visible"),
    ):
        f = model.mueller(0.3, np.radians([20, 40, 60, 80]), 0.0, part="diffuse")
        assert (f[:, 1, 0] > 0).all()


# Hence the planes of polarisation of the specular and of the diffuse light are crossed (AoLP differs by 90°).
def test_specular_and_diffuse_are_crossed():
    """In plane: AoLP = ½ atan2(U, Q) is 90° for the specular and 0° for the diffuse part."""
    theta_r = np.radians([20.0, 40.0, 60.0, 80.0])
    model = DoubleGauss(**PAINT)
    aolp = {}
    for part in ("specular", "diffuse"):
        S = model.stokes(0.6, theta_r, 0.0, part=part)
        aolp[part] = 0.5 * np.arctan2(abs(S[:, 2]) * (abs(S[:, 2]) > 1e-12 * S[:, 0]), S[:, 1])
    np.testing.assert_allclose(aolp["specular"], np.pi / 2, atol=1e-9)
    np.testing.assert_allclose(aolp["diffuse"], 0.0, atol=1e-9)


# U > 0 is light along p + s, with p×s = k and s = k×ẑ/|k×ẑ|; the index order is f[out, in].
def test_specular_matrix_is_a_jones_matrix_between_the_frames():
    """M = Mueller of J = (p_r·p_m r_p p_m·p_i + …), built from vectors and complex amplitudes."""
    rng = np.random.default_rng(2)
    theta_i, theta_r = rng.uniform(0.1, 1.4, (2, 40))
    phi = rng.uniform(-3, 3, 40)
    f = METAL.mueller(theta_i, theta_r, phi, part="specular")
    w_i, w_r = ref.rays(theta_i, theta_r, phi)
    p_i, s_i, p_r, s_r = ref.frames(theta_i, theta_r, phi)
    s_m = np.cross(w_r, w_i)
    s_m = s_m / np.linalg.norm(s_m, axis=-1, keepdims=True)
    beta = ref.explicit_angles(theta_i, theta_r, phi)[0]
    r_p, r_s = ref.fresnel_r(beta, 2 - 1.5j)

    def turn(p, s, k):
        p_m = np.cross(s_m, k)
        return np.stack([np.stack([(a * b).sum(-1) for b in (p, s)], -1) for a in (p_m, s_m)], -2)

    into, out = turn(p_i, s_i, -w_i), turn(p_r, s_r, w_r)
    amplitude = np.stack([r_p, r_s], -1)[:, :, None] * into
    expected = ref.mueller_from_jones(np.swapaxes(out, -1, -2) @ amplitude)
    normalised = f / f[:, :1, :1]
    np.testing.assert_allclose(normalised, expected / expected[:, :1, :1], atol=1e-10)


# The index is n − iκ: fields vary as e^{+iωt}, and M34 = −Im(r_p r_s*), M43 = +Im(r_p r_s*) (eq. 6).
def test_v_of_a_metallic_mirror_is_eq_6():
    beta = 0.9
    f = METAL.mueller(beta, beta, 0.0, part="specular")
    r_p, r_s = ref.fresnel_r(beta, 2 - 1.5j)
    z = r_p * np.conj(r_s) / (0.5 * (abs(r_p) ** 2 + abs(r_s) ** 2))
    assert f[2, 3] / f[0, 0] == pytest.approx(-z.imag, rel=1e-12)
    assert f[3, 2] / f[0, 0] == pytest.approx(z.imag, rel=1e-12)
    assert z.imag > 0.1


# V > 0: at a fixed point the field turns from p towards s, i.e. anticlockwise for the receiver who looks
# into the beam (p×s = k points at him): left circular in the receiver's convention.
def test_v_in_the_time_domain():
    """45° light on a metallic mirror; the sense of rotation is read off the real field E(t)."""
    beta = 0.9
    f = METAL.mueller(beta, beta, 0.0, part="specular")
    V = (f @ [1.0, 0.0, 1.0, 0.0])[3]
    r_p, r_s = ref.fresnel_r(beta, 2 - 1.5j)  # for fields e^{+iωt}
    t = np.linspace(0, 0.1, 3)
    E_p, E_s = ((r * np.exp(1j * t)).real for r in (r_p, r_s))
    turning = E_p[1] * (E_s[2] - E_s[0]) - E_s[1] * (E_p[2] - E_p[0])  # > 0: from p towards s
    assert np.sign(V) == np.sign(turning) != 0


# In a medium of index n − iκ with e^{+iωt} waves decay: e^{−i(n−iκ)kz} = e^{−inkz} e^{−κkz}.
def test_positive_kappa_absorbs():
    """R < 1 for κ > 0, and a positive imaginary part is refused."""
    f = DoubleGauss(0.1, 0.2 - 3j, 1.0, 1.0, 0.0, 0.0).mueller(0.5, 0.5, 0.0, part="specular")
    white = 1 / (8 * np.pi * 0.1**2 * np.cos(0.5) ** 2)
    assert 0.8 < f[0, 0] / white < 1
    with pytest.raises(ValueError, match="n − iκ"):
        DoubleGauss(0.1, 0.2 + 3j, 1.0, 1.0, 0.0, 0.0)


# At normal incidence a mirror turns over U and V: M = R diag(1, 1, −1, −1).
def test_normal_incidence_mirror():
    f = METAL.mueller(0.0, 0.0, 0.0, part="specular")
    np.testing.assert_allclose(f / f[0, 0], np.diag([1, 1, -1, -1]), atol=1e-12)


# SCATMECH: Q = I_s − I_p, index n + ik (e^{−iωt}), V > 0 left circular as here, same φ.
# Our matrix is diag(1,−1,−1,1) M diag(1,−1,−1,1).
def test_relation_to_scatmech():
    """A Mueller matrix measured in SCATMECH's convention: {s, p, k} right-handed, e^{−iωt}, six analysers."""
    theta_i, theta_r, phi = 0.9, 0.6, 0.7
    w_i, w_r = ref.rays(theta_i, theta_r, phi)
    p_i, s_i, p_r, s_r = ref.frames(theta_i, theta_r, phi)
    s_i, s_r = -s_i, -s_r  # now s×p = k
    n_m = np.cross(w_r, w_i)
    n_m /= np.linalg.norm(n_m)
    beta = ref.explicit_angles(theta_i, theta_r, phi)[0]
    r_p, r_s = (np.conj(r) for r in ref.fresnel_r(beta, 2 - 1.5j))  # n + ik: the conjugate amplitudes
    p_in, p_out = np.cross(n_m, -w_i), np.cross(n_m, w_r)

    def reflect(E):
        return r_s * n_m * (n_m @ E) + r_p * p_out * (p_in @ E)

    h = np.sqrt(0.5)
    # over (s, p): s, p, s + p, s − p, left (anticlockwise for the receiver), right
    states = [(1, 0), (0, 1), (h, h), (h, -h), (h, 1j * h), (h, -1j * h)]
    M6 = np.array(
        [
            [abs(np.vdot(out[0] * s_r + out[1] * p_r, reflect(E[0] * s_i + E[1] * p_i))) ** 2 for E in states]
            for out in states
        ]
    )
    stokes = np.array([[1, 1, 0, 0, 0, 0], [1, -1, 0, 0, 0, 0], [0, 0, 1, -1, 0, 0], [0, 0, 0, 0, 1, -1]])
    inputs = np.array([[1, 1, 1, 1, 1, 1], [1, -1, 0, 0, 0, 0], [0, 0, 1, -1, 0, 0], [0, 0, 0, 0, 1, -1]])
    scatmech = stokes @ M6 @ np.linalg.pinv(inputs)
    f = METAL.mueller(theta_i, theta_r, phi, part="specular")
    D = np.diag([1, -1, -1, 1])
    np.testing.assert_allclose(D @ (f / f[0, 0]) @ D, scatmech / scatmech[0, 0], atol=1e-10)


def test_scatmech_table_tells_the_signs(scatmech_table):
    """The table (SCATMECH turned by diag(1,−1,−1,1)) has U and V elements large enough to see a wrong sign.

    With any other diagonal of signs in place of ours the agreement of 1e-9 is lost by more than 0.1 f00.
    """
    t = scatmech_table
    model = DoubleGauss(t["sigma"], t["n"], 1, 1, 0, 0, kappa=t["kappa"])
    f = model.mueller(t["theta_i"], t["theta_r"], t["phi"], part="specular")
    for signs in (
        (1, -1, 1, 1),
        (1, 1, -1, 1),
        (1, 1, 1, -1),
        (1, -1, -1, 1),
        (1, 1, -1, -1),
        (1, -1, -1, -1),
    ):
        turned = np.diag(signs) @ t["M"] @ np.diag(signs)
        assert (abs(f - turned).max((1, 2)) / f[:, 0, 0]).max() > 0.1


# Mitsuba: frames turned to x = k×n̂ (s), y = k×x; Q = I_s − I_p, V > 0 right circular.
# Its matrix is diag(1,−1,−1,−1) f diag(1,−1,−1,−1); its wi is the viewer (light travels wo → wi).
MITSUBA = [
    # Mitsuba 3.9.1, roughconductor, beckmann, α = 0.2 √2, η = 1.5, k = 2.0, scalar_spectral_polarized
    # θ of wi, θ of wo, azimuth of wo (wi at azimuth 180°), then M/M00 after rotate_stokes_basis to k×n̂
    ((60, 60, 20), [[1, 0.36456, 0.293646, 0], [0.36456, 0.394143, 0.752167, 0.438938],
                   [0.293646, 0.752167, 0.066189, -0.544939], [0, -0.438939, 0.544939, -0.539668]]),
    ((40, 55, -70), [[1, 0.044978, -0.201634, 0], [-0.055873, -0.93632, 0.068238, -0.28123],
                    [-0.19889, 0.036889, 0.994623, 0.079004], [0, 0.285109, 0.063599, -0.933803]]),
]  # fmt: skip


@pytest.mark.parametrize(("degrees", "matrix"), MITSUBA, ids=["60-60-20", "40-55--70"])
def test_relation_to_mitsuba(degrees, matrix):
    """Numbers that Mitsuba 3.9.1 gave (single precision), light from wo to wi."""
    view, light, azimuth = np.radians(degrees)
    f = DoubleGauss(0.2, 1.5 - 2j, 1.0, 1.0, 0.0, 0.0).mueller(light, view, -azimuth, part="specular")
    D = np.diag([1, -1, -1, -1])
    np.testing.assert_allclose(D @ (f / f[0, 0]) @ D, matrix, atol=2e-5)


# Eradiate: Q along p as here (frames in the meridian plane), V as Mitsuba: diag(1,1,1,−1); Δφ = 0 is the
# hot spot, so φ = Δφ + π, for the azimuth of the viewer counted from that of the source.
def test_hot_spot_is_at_phi_pi():
    """The facet that faces the source mirrors it to itself: θ_r = θ_i, φ = π is exact backscatter, ω = π."""
    f = DoubleGauss(0.5, 1.5, 1.0, 1.0, 0.0, 0.0).mueller(0.4, 0.4, [np.pi], part="specular")[0]
    np.testing.assert_allclose(f / f[0, 0], np.diag([1, 1, -1, -1]), atol=1e-12)
