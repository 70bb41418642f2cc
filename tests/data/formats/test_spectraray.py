"""Text files of SpectraRay: values in their places, signs by physics, not by the other program's word."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

import pbrdf
from pbrdf.data.schema import VARIABLES
from pbrdf.errors import DataError

pytestmark = pytest.mark.skipif(
    "mueller_over_m00" not in VARIABLES, reason="normalised Mueller matrices are not in the schema yet"
)

# Elements m01, m22, m23, m32 as an ellipsometer read them off SiO2 on silicon at 70.2° (the public file that the module
# names, rounded); the other elements of these lines are made up.
ANGLE = 70.2
MEASURED = {
    522.8: (0.626, -0.036, 0.777, -0.776),
    550.3: (0.392, 0.063, 0.916, -0.917),
    569.4: (0.258, 0.112, 0.957, -0.958),
}
# Literature values of silicon (Aspnes) and fused silica (Malitson) there
SILICON = np.array([4.20 - 0.056j, 4.08 - 0.038j, 4.02 - 0.031j])
SILICA = np.array([1.4615, 1.4599, 1.4589])


@pytest.fixture
def mueller_file(tmp_path):
    path = tmp_path / "wafer.txt"
    lines = [
        f"{wavelength} 1.0 {a} 0.02 0.03 {a} 0.99 0.12 0.13 0.20 0.21 {b} {c} 0.30 0.31 {d} 0.33 "
        for wavelength, (a, b, c, d) in MEASURED.items()
    ]
    path.write_text("\n".join(["; WAVELENGTH" + f" {ANGLE:.5f}" * 16, *lines]) + "\n")
    return path


def film(thickness, wavelength, theta):
    """r_p and r_s of silica on silicon, fields e^{+iωt}, index n − iκ, r_p = −r_s at normal incidence."""
    layers = (np.ones(3), SILICA, SILICON)
    cosines = [np.sqrt(1.0 - (np.sin(theta) / n) ** 2 + 0j) for n in layers]
    (n0, n1, n2), (c0, c1, c2) = layers, cosines
    phase = np.exp(-4j * np.pi * thickness / wavelength * n1 * c1)

    def both(first, second):
        return (first + second * phase) / (1.0 + first * second * phase)

    p = both((n1 * c0 - n0 * c1) / (n1 * c0 + n0 * c1), (n2 * c1 - n1 * c2) / (n2 * c1 + n1 * c2))
    s = both((n0 * c0 - n1 * c1) / (n0 * c0 + n1 * c1), (n1 * c1 - n2 * c2) / (n1 * c1 + n2 * c2))
    return p, s


def test_a_film_of_known_materials_tells_the_signs(mueller_file):
    """m23 = −Im(r_p r_s*) here; of all thicknesses up to 2 µm one fits with this sign of V, none with the other."""
    ds = pbrdf.read(mueller_file)
    m = ds["mueller_over_m00"].values
    assert_allclose(np.rad2deg(ds["theta_i"]), ANGLE)
    assert_allclose(ds["theta_r"], ds["theta_i"])
    assert_allclose(ds["phi"], 0.0)
    assert_allclose(ds["wavelength"], [*MEASURED])
    worst = []
    for thickness in np.arange(0.0, 2000.0, 1.0):
        p, s = film(thickness, ds["wavelength"].values, np.deg2rad(ANGLE))
        mean = 0.5 * (np.abs(p) ** 2 + np.abs(s) ** 2)
        product = p * s.conj() / mean
        expected = [0.5 * (np.abs(p) ** 2 - np.abs(s) ** 2) / mean, product.real, -product.imag, product.imag]
        found = [m[:, 0, 1], m[:, 2, 2], m[:, 2, 3], m[:, 3, 2]]
        other = [m[:, 0, 1], m[:, 2, 2], -m[:, 2, 3], -m[:, 3, 2]]
        worst.append([np.abs(np.subtract(expected, f)).max() for f in (found, other)])
    right, wrong = np.array(worst).min(axis=0)
    assert right < 0.02
    assert wrong > 0.2


def test_elements_stand_row_by_row(mueller_file):
    m = pbrdf.read(mueller_file)["mueller_over_m00"].values[0]
    expected = [
        [1, 0.626, 0.02, -0.03],
        [0.626, 0.99, 0.12, -0.13],
        [0.2, 0.21, -0.036, -0.777],
        [-0.3, -0.31, 0.776, 0.33],
    ]
    assert_allclose(m, expected)


def test_psi_and_delta_at_several_angles(tmp_path):
    """Those of the matrix: −cos 2ψ, sin 2ψ cos Δ, −sin 2ψ sin Δ; an ideal surface of silicon has Δ within 0 … 180°."""
    path = tmp_path / "si.txt"
    angles = (50.2, 70.2)
    n = 4.08 - 0.038j
    cells = []
    for angle in angles:
        c = np.cos(np.deg2rad(angle))
        t = np.sqrt(1.0 - (np.sin(np.deg2rad(angle)) / n) ** 2)
        rho = ((n * c - t) / (n * c + t)) / ((c - n * t) / (c + n * t))
        cells += [np.rad2deg(np.arctan(np.abs(rho))), np.rad2deg(np.angle(rho))]
        assert 90.0 < cells[-1] < 180.0
    path.write_text(
        "; WAVELENGTH 50.2 50.2 70.2 70.2\n550.3 " + " ".join(map(repr, map(float, cells))) + " \n"
    )
    ds = pbrdf.read(path)
    assert_allclose(np.rad2deg(ds["theta_i"]), angles)
    m = ds["mueller_over_m00"].values
    assert np.isfinite(m).sum() == 2 * 4
    psi, delta = np.deg2rad(cells[2:])
    assert_allclose(m[1, 0, 1], -np.cos(2 * psi))
    assert_allclose(m[1, 2, 3], -np.sin(2 * psi) * np.sin(delta))


@pytest.mark.slow
def test_psi_and_delta_of_a_glass_plate_tell_its_index(tmp_path):
    """Fresnel's ρ of n = 1.52 below and above Brewster's angle."""
    n, angles, cells = 1.52, (40, 50, 55, 60, 65, 70, 75), []
    for angle in np.deg2rad(angles):
        c, t = np.cos(angle), np.sqrt(1.0 - (np.sin(angle) / n) ** 2)
        rho = ((n * c - t) / (n * c + t)) / ((c - n * t) / (c + n * t))
        cells += [f"{np.rad2deg(np.arctan(abs(rho))):.4f}", "180" if rho < 0 else "0"]
    path = tmp_path / "glass.txt"
    path.write_text(
        "; WAVELENGTH " + " ".join(f"{a} {a}" for a in angles) + "\n550 " + " ".join(cells) + "\n"
    )
    flat = {"a": 1e-6, "k": 1.0, "b": 0.0, "t": 0.0, "sigma": 0.01}
    found = pbrdf.fit(pbrdf.read(path), fix=flat, starts=8)
    assert found.estimates["n"].value == pytest.approx(n, abs=1e-4)


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.txt", "; WAVELENGTH 70 70 70\n500 1 2 3\n", "line 1: each angle of incidence has 16 columns"),
        ("a.txt", "; WAVELENGTH 70 70\n500 1\n", "line 2: 2 numbers; a line has a wavelength and 2 columns"),
        ("a.txt", "; WAVELENGTH 70 70\n500 1 x\n", "line 2: 'x' is not a number"),
        ("a.txt", "; WAVELENGTH 70 70\n", "no lines of data"),
        ("a.txt", "; WAVELENGTH 95 95\n500 1 2\n", "theta_i"),
    ],
)
def test_what_is_wrong_is_said(tmp_path, name, text, words):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(DataError, match=words):
        pbrdf.read(path)
