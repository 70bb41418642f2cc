"""Band averages: limits, closed forms, filters."""

from __future__ import annotations

import numpy as np
import pytest

from pbrdf.errors import DataError
from pbrdf.instruments.polarimeter.band import (
    Band,
    cauchy,
    gaussian_band,
    in_band,
    read_band,
    tabulated_band,
    top_hat_band,
)
from pbrdf.instruments.polarimeter.merit import merit
from pbrdf.instruments.polarimeter.polarimeter import (
    division_of_focal_plane,
    lcvr,
    measured,
    rotating_retarder,
)
from pbrdf.instruments.polarimeter.retardance_sets import retardance_set

PLAIN = lcvr(retardance_set("tetrahedron"))


@pytest.mark.parametrize("make", [top_hat_band, gaussian_band])
def test_no_width_is_one_wavelength(make):
    np.testing.assert_allclose(in_band(PLAIN, make(476, 0)).analyzer, PLAIN.analyzer, atol=1e-11)
    wide, narrow = (abs(in_band(PLAIN, make(476, w)).analyzer - PLAIN.analyzer).max() for w in (2.0, 1.0))
    # phase and contrast change with the second moment of the band
    assert wide / narrow == pytest.approx(4, rel=0.01)


@pytest.mark.parametrize("order", [0.25, 1.0, 7.5])
def test_contrast_of_a_top_hat_is_a_sinc(order):
    """Where the phase is linear in the wavelength (birefringence ∝ λ²), the average of cos δ and sin δ over a top hat
    is that at the centre times sinc(δ w/2λ₀), the classical loss of contrast."""
    width, delta = 20.0, 2 * np.pi * order + 0.4
    retarders = lcvr([[delta]], axes=[np.pi / 4])  # W = ½ (1, cos δ, 0, sin δ)
    seen = in_band(retarders, top_hat_band(476, width), birefringence=lambda nm: nm**2).analyzer
    contrast = np.sinc(delta * width / (2 * 476) / np.pi)
    np.testing.assert_allclose(
        seen[0], [0.5, 0.5 * contrast * np.cos(delta), 0, 0.5 * contrast * np.sin(delta)], atol=1e-10
    )


def test_contrast_of_a_gaussian_is_a_gaussian():
    """⟨e^{iδ}⟩ = e^{iδ₀} exp(−(δ₀ σ/λ₀)²/2) with σ = FWHM/2.3548."""
    delta, sigma = 40.0, 15.0 / (2 * np.sqrt(2 * np.log(2)))
    retarders = lcvr([[delta]], axes=[np.pi / 4])
    seen = in_band(retarders, gaussian_band(476, 15.0), birefringence=lambda nm: nm**2).analyzer[0]
    expected = np.exp(1j * delta - 0.5 * (delta * sigma / 476) ** 2)
    np.testing.assert_allclose(2 * (seen[1] + 1j * seen[3]), expected, atol=1e-10)


def test_retardance_falls_with_the_wavelength():
    """δ ∝ 1/λ without dispersion of the birefringence: at twice the wavelength a half-wave plate is a quarter-wave
    plate."""
    half = rotating_retarder([0.3], np.pi)
    seen = in_band(half, top_hat_band(952, 0), reference=476)
    np.testing.assert_allclose(seen.analyzer, rotating_retarder([0.3], np.pi / 2).analyzer, atol=1e-12)


def test_cauchy_birefringence():
    """B = A + B/λ² (λ in µm): between 400 and 800 nm the retardance falls by more than the factor of 2 of 1/λ."""
    plate = lcvr([[1.0]], axes=[np.pi / 4])
    seen = in_band(plate, top_hat_band(800, 0), reference=400, birefringence=cauchy(0.2, 0.01))
    ratio = (0.2 + 0.01 / 0.64) / (0.2 + 0.01 / 0.16)
    np.testing.assert_allclose(seen.analyzer, lcvr([[0.5 * ratio]], axes=[np.pi / 4]).analyzer, atol=1e-12)
    with pytest.raises(DataError, match="changes sign"):
        in_band(plate, top_hat_band(476, 200), birefringence=lambda nm: nm - 470)


def test_the_papers_filter_costs_little():
    """476 nm, 10 nm wide, low orders: retardances up to 315° blur by 315°·10/476/√12 ≈ 1.9°, and the noise grows by
    less than 0.2 %."""
    seen = merit(in_band(PLAIN, top_hat_band(476, 10)))
    assert 10 < seen.equally_weighted_variance < 10.02


def test_a_table_is_straight_lines_between_its_points():
    """Tabulated top hat and triangle give the moments of a top hat and a triangle; the scale does not matter."""
    flat = tabulated_band([471, 476, 481], [0.7, 0.7, 0.7])
    np.testing.assert_allclose(
        in_band(PLAIN, flat).analyzer, in_band(PLAIN, top_hat_band(476, 10)).analyzer, atol=1e-9
    )
    triangle = tabulated_band([466, 476, 486], [0, 3, 0])
    assert triangle.center == pytest.approx(476)
    assert triangle.weights @ (triangle.wavelengths - 476) ** 2 == pytest.approx(10**2 / 6)


def test_tables_from_files(tmp_path):
    path = tmp_path / "filter.csv"
    path.write_text("# made up\ntransmission,wavelength_nm\n0.0,466\n3.0,476\n0.0,486\n", encoding="utf-8")
    np.testing.assert_array_equal(read_band(path).weights, tabulated_band([466, 476, 486], [0, 3, 0]).weights)
    for text, message in (
        ("wavelength,transmission\n1,2\n", "filter.csv: there is no column 'wavelength_nm'"),
        (
            "wavelength_nm,transmission\n1,x\n",
            "filter.csv: line 2, column 'transmission': 'x' is not a number",
        ),
        (
            "wavelength_nm,transmission\n2,1\n1,1\n",
            "filter.csv: band: the table needs two or more wavelengths, asc",
        ),
        ("", "no line of column names"),
    ):
        path.write_text(text, encoding="utf-8")
        with pytest.raises(DataError, match=message):
            read_band(path)


def test_polarisers_without_retarders_do_not_change():
    camera = division_of_focal_plane(np.deg2rad([[90, 45], [135, 0]]))
    assert in_band(camera, top_hat_band(476, 10)) is camera


def test_turned_instruments_keep_their_turn():
    band = gaussian_band(476, 30)
    np.testing.assert_allclose(
        in_band(PLAIN.turned(0.2), band).analyzer, in_band(PLAIN, band).turned(0.2).analyzer, atol=1e-10
    )


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: in_band(measured(np.eye(4)), top_hat_band(476, 10)), "needs its retardances"),
        (
            lambda: in_band(in_band(PLAIN, top_hat_band(476, 50)), top_hat_band(476, 10)),
            "needs its retardances",
        ),
        (lambda: in_band(PLAIN, top_hat_band(476, 10), reference=-1), "reference"),
        (lambda: top_hat_band(476, -1), "width"),
        (lambda: gaussian_band(476, 400), "too wide"),
        (lambda: Band([400, 500], [1]), "as many weights"),
        (lambda: Band([400, 500], [0, 0]), "not 0 everywhere"),
        (lambda: tabulated_band([400, 500], [1, -1]), "negative"),
        (lambda: tabulated_band([400], [1]), "two or more"),
    ],
)
def test_errors(make, message):
    with pytest.raises(DataError, match=message):
        make()
