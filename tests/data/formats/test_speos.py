"""The side in words: φ = 0 is the specular half-plane, φ = 180° that of the source; θ is counted from the normal."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pbrdf.data import read
from pbrdf.errors import DataError

THETA = np.arange(0.0, 91.0, 1.0)
PHI = np.arange(0.0, 361.0, 30.0)


def table(level, phi=PHI, slope=0.0):
    """A table of level·(1 + slope·cosφ)."""
    lines = [f"{len(THETA)} {len(phi)}", "\t" + "\t".join(f"{p:g}" for p in phi)]
    for theta in THETA:
        values = level * (1 + slope * np.cos(np.deg2rad(phi)))
        lines.append("\t".join([f"{theta:g}", *(f"{v:.17g}" for v in values)]))
    return "\n".join(lines) + "\n"


def anisotropic(levels=(7.0, 14.0), spectrum="350 40\n850 40", sides="1\t0", kind="1", **options):
    return (
        "OPTIS - Anisotropic BSDF surface file v8.0\n0\nA paint\n23\nMeasurement description\n0\t1\t0\n"
        f"{sides}\n{kind}\n1\n0.0\t\n2\n15.0\t30.0\t\n15.0\t0\n\n{len(spectrum.splitlines())}\n{spectrum}\n"
        + "".join(table(level, **options) for level in levels)
    )


def test_the_percentage_sets_the_scale_of_what_is_only_proportional(text_file):
    """Constant values that reflect 40 % are 0.4/π; twice the values at the other angle are twice the BRDF."""
    ds = read(text_file(anisotropic(), "paint.anisotropicbsdf"))
    first = ds["group"].values == 15
    assert_allclose(ds["I"].values[first], 0.4 / np.pi, rtol=2e-4)
    assert_allclose(ds["I"].values[~first], 0.8 / np.pi, rtol=2e-4)
    assert ds.attrs["title"] == "A paint"
    assert "wavelength" not in ds.coords


def test_forward_is_zero(text_file):
    ds = read(text_file(anisotropic(slope=0.5), "paint.anisotropicbsdf"))
    forward = np.abs(ds["phi"].values) < 1e-9
    back = np.abs(np.abs(ds["phi"].values) - np.pi) < 1e-9
    assert_allclose(ds["I"].values[forward].min() / ds["I"].values[back].min(), 3.0)
    assert_allclose(np.rad2deg(np.unique(ds["theta_i"])), [15, 30])
    assert ds["theta_r"].max() < np.pi / 2


def test_a_half_of_the_azimuths_is_half_of_the_integral(text_file):
    ds = read(text_file(anisotropic(phi=np.arange(0.0, 181.0, 30.0)), "a.anisotropicbsdf"))
    assert_allclose(ds["I"].values[ds["group"].values == 15], 0.4 / np.pi, rtol=2e-4)


def test_a_spectrum_between_two_incidences(text_file):
    """Its factor is interpolated between those of the tables beside it."""
    text = anisotropic().replace("15.0\t0\n\n", "22.5\t0\n\n")
    ds = read(text_file(text, "a.anisotropicbsdf"))
    expected = 7.0 * (0.4 / 7.0 + 0.4 / 14.0) / 2 / np.pi
    assert_allclose(ds["I"].values[ds["group"].values == 15], expected, rtol=2e-4)


def test_a_spectrum_that_varies_gives_wavelengths(text_file):
    path = text_file(anisotropic(spectrum="450 20\n650 60"), "a.anisotropicbsdf")
    ds = read(path)
    assert_array_equal(np.unique(ds["wavelength"]), [450, 650])
    red = read(path, wavelength=650)
    assert_allclose(red["I"].values[red["group"].values == 15], 0.6 / np.pi, rtol=2e-4)


def test_angles_of_anisotropy_are_groups(text_file):
    """The scale is that of the table at the angles of the spectrum, for all of them."""
    text = anisotropic(levels=(7.0, 14.0, 3.0)).replace(
        "\n1\n0.0\t\n2\n15.0\t30.0\t\n15.0\t0\n", "\n2\n0 90\n2\n15.0 30.0\n1\n20\n20\t90\n"
    )
    ds = read(text_file(text, "a.anisotropicbsdf"))
    assert_array_equal(np.unique(ds["group"]), [0, 90])
    assert_allclose(ds["I"].values[ds["group"].values == 90], 0.4 / np.pi, rtol=2e-4)
    keep = (ds["group"].values == 0) & np.isclose(ds["theta_i"], np.deg2rad(30))
    assert_allclose(ds["I"].values[keep], 14 / 3 * 0.4 / np.pi, rtol=2e-4)


def test_transmission_beside_reflection_is_passed_over(text_file):
    text = anisotropic(levels=(7.0, 14.0, 5.0), sides="1\t1").replace(
        "\n15.0\t0\n\n2\n350 40\n850 40\n", "\n1\n0\n1\n20\n15 0\n\n1\n550 40\n15 0\n\n1\n550 90\n"
    )
    ds = read(text_file(text, "a.anisotropicbsdf"))
    assert_array_equal(np.unique(ds["group"]), [15, 30])
    assert_allclose(ds["I"].values[ds["group"].values == 15], 0.4 / np.pi, rtol=2e-4)


def test_intensities_lose_their_cosine(text_file):
    ds = read(text_file(anisotropic(kind="0"), "a.anisotropicbsdf"))
    first = ds.isel(geometry=(ds["group"] == 15).values)
    assert_allclose(first["I"] * np.cos(first["theta_r"]), first["I"][0], rtol=1e-9)


def test_a_brdf_file_has_a_percentage_for_each_table(text_file):
    text = (
        "OPTIS - brdf surface file v9.0\n0\nScattering surface\n0\n\n1\t0\n1\n2\t2\n10 40\n500 600\n"
        + "".join(f"{percent}\n{table(3.0)}" for percent in (10, 20, 30, 40))
    )
    ds = read(text_file(text, "paint.brdf"))
    for theta_i, nanometres, percent in ((10, 500, 10), (10, 600, 20), (40, 500, 30), (40, 600, 40)):
        keep = (ds["group"].values == theta_i) & (ds["wavelength"].values == nanometres)
        assert_allclose(ds["I"].values[keep], percent / 100 / np.pi, rtol=2e-4)


@pytest.mark.parametrize("counts", ["1 x", "1 nan", "x 1", "1 0", "1 1.5", "1"])
def test_counts_of_a_brdf_file_are_whole_numbers(text_file, counts):
    text = f"OPTIS - brdf surface file v9.0\n0\nA paint\n0\n\n1\t0\n1\n{counts}\n10\n500\n10\n{table(3.0)}"
    with pytest.raises(DataError, match=r"paint\.brdf: line 8: .*count"):
        read(text_file(text, "paint.brdf"))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("v8.0", "v1.0", "line 1: version 1 is"),
        ("v8.0\n0", "v8.0\n1", "line 2: the file is in binary mode"),
        ("\n1\t0\n", "\n0\t1\n", "line 7: there is no reflection"),
        ("15.0\t30.0", "15.0\t95.0", "line 12: an angle of incidence is outside"),
        ("91 13", "91 99", "line 19: phi: 99 numbers are needed|phi .99 numbers"),
        ("91 13", "91 x", "line 18: how many theta and phi"),
        ("\n2\n15.0", "\n1000000000\n15.0", "angles of incidence"),
        ("\t7\t", "\tx\t", "'x' is not a number"),
    ],
)
def test_errors_name_file_and_line(text_file, old, new, words):
    text = anisotropic()
    assert old in text
    with pytest.raises(DataError, match=words):
        read(text_file(text.replace(old, new, 1), "paint.anisotropicbsdf"), format="speos")


def test_a_truncated_file_is_noticed(text_file):
    with pytest.raises(DataError, match="is it truncated"):
        read(text_file(anisotropic()[:-400], "a.anisotropicbsdf"))


def test_a_goniometer_s_raw_export_says_what_to_do(measured):
    with pytest.raises(DataError, match=r"test_speos\.rtd: line 1: version 1 .*save it with Speos"):
        read(measured("strangers/test_speos.rtd"))


def test_one_scatter_function_in_two_programs_formats(measured):
    """Zemax's table about the specular ray and Speos's about the normal: the same function of the directions.

    Between them lies a factor for each incidence, which the converter that made the one from the other used to bring
    the integral to Zemax's TIS; on the wrong side of the normal nothing would fit.
    """
    from scipy.interpolate import LinearNDInterpolator

    zemax = read(measured("strangers/test_13_planesymmetric_brdf_zemax.bsdf"))
    speos = read(measured("strangers/test_13_planesymmetric_brdf_speos_reference.anisotropicbsdf"))
    for theta_i in (15, 30, 45):
        a, b = (ds.isel(geometry=(ds["group"] == theta_i).values) for ds in (zemax, speos))
        points = [
            np.stack(
                [np.sin(d["theta_r"]) * np.cos(d["phi"]), np.sin(d["theta_r"]) * np.sin(np.abs(d["phi"]))], -1
            )
            for d in (a, b)
        ]
        low = a["theta_r"].values < np.deg2rad(65)
        ratio = LinearNDInterpolator(points[1], b["I"].values)(points[0][low]) / a["I"].values[low]
        mirrored = (
            LinearNDInterpolator(points[1] * [-1, 1], b["I"].values)(points[0][low]) / a["I"].values[low]
        )
        ratio, mirrored = ratio[np.isfinite(ratio)], mirrored[np.isfinite(mirrored)]
        assert 1.0 < np.median(ratio) < 1.2
        assert ratio.std() / ratio.mean() < 0.03
        assert mirrored.std() / mirrored.mean() > 0.2
