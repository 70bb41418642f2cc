"""Signs in words: Q = I_p − I_s; mm34 is +sin 2Ψ sin Δ, positive for metals, where M[2, 3] here is negative."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pbrdf.data import read
from pbrdf.errors import DataError
from pbrdf.optics.fresnel import mueller_reflection


def psi_delta(theta, n, kappa):
    """Ψ and Δ in degrees of a bare surface of index n − iκ, for e^{+iωt}."""
    epsilon, c = (n - 1j * kappa) ** 2, np.cos(theta)
    q = np.sqrt(epsilon - np.sin(theta) ** 2)
    rho = (epsilon * c - q) / (epsilon * c + q) / ((c - q) / (c + q))
    return np.rad2deg(np.arctan(np.abs(rho))), np.rad2deg(np.angle(rho))


def content(n=0.2, kappa=3.4, twice=True, unit="nm", flip=1.0, method="EllipsometerType=14, Isotropic"):
    lines = ["Gold on glass", f"VASEmethod[{method}]", "Original[gold.dat]", unit]
    for nanometres in (500.0, 633.0):
        for degrees in (50.0, 70.0):
            psi, delta = psi_delta(np.deg2rad(degrees), n, kappa)
            c2, s2 = np.cos(2 * np.deg2rad(psi)), np.sin(2 * np.deg2rad(psi))
            real, imaginary = s2 * np.cos(np.deg2rad(delta)), s2 * np.sin(np.deg2rad(delta)) * flip
            matrix = np.array(
                [[1, -c2, 0, 0], [-c2, 1, 0, 0], [0, 0, real, imaginary], [0, 0, -imaginary, real]]
            )
            at = f"{nanometres:g}\t{degrees:g}"
            lines += [
                f"E\t{at}\t{psi:.12g}\t{delta:.12g}\t0.1\t0.1",
                f"dPolE\t{at}\t0.5\t0.1",
                f"mm11\t{at}\t0.8\t0.01",
            ]
            for i, j in list(np.ndindex(4, 4))[1:]:
                value = f"{matrix[i, j]:.12g}"
                numbers = f"{value}\t{value}\t0.002\t0.002" if twice else f"{value}\t0.002"
                lines.append(f"mm{i + 1}{j + 1}\t{at}\t{numbers}")
    return "\r\n".join(lines) + "\r\n"


@pytest.mark.parametrize("twice", [True, False])
def test_signs_are_those_of_fresnel_reflection(text_file, jit, plain, twice):
    ds = read(text_file("﻿" + content(twice=twice), "gold.dat"))
    assert ds.sizes["geometry"] == 4
    assert_allclose(np.rad2deg(ds["theta_i"]), [50, 70, 50, 70])
    assert_array_equal(ds["theta_i"], ds["theta_r"])
    assert_array_equal(ds["phi"], 0)
    assert_array_equal(np.unique(ds["wavelength"]), [500, 633])
    fresnel = mueller_reflection(jit(np.cos(ds["theta_i"].values)), jit([0.2] * 4), jit([3.4] * 4))
    mean, difference, real, imaginary = plain(tuple(fresnel), 4)
    got = ds["mueller_over_m00"].values
    assert_allclose(got[:, 0, 1], difference / mean, atol=1e-9)
    assert_allclose(got[:, 2, 2], real / mean, atol=1e-9)
    assert_allclose(got[:, 2, 3], -imaginary / mean, atol=1e-9)
    assert_allclose(got[:, 3, 2], imaginary / mean, atol=1e-9)
    assert (got[:, 2, 3] < 0).all()
    assert_allclose(ds["mueller_over_m00_std"].values[:, 1, 2], 0.002)


def test_energies_are_wavelengths(text_file):
    text = content(unit="eV").replace("\t500\t", "\t2.479683968\t").replace("\t633\t", "\t1.239841984\t")
    ds = read(text_file(text, "gold.dat"), wavelength=1000)
    assert_allclose(ds["wavelength"], 1000)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (content(method="TransmissionMeas=1"), "line 2: this is transmission"),
        (content(flip=-1.0), "its handedness is another"),
        (content(unit="furlongs"), "the unit of wavelengths"),
        (content().replace("mm12\t500\t50\t", "mm12\t500\t50\tx"), "line 8: mm12: 'x.* is not a number"),
        (content().replace("mm12\t", "", 1), "line 8: a row without a tag: this file holds Ψ and Δ only"),
        (content().replace("mm12", "mn12", 1), "line 8: 'mn12' is not a tag"),
        (
            "\n".join(line for line in content().splitlines() if not line.startswith("mm")),
            "no Mueller elements",
        ),
        (content()[:60], "the file ends where a line with the unit"),
        (content().replace("\t50\t", "\t95\t"), "theta_i, line"),
    ],
)
def test_errors_name_file_and_line(text_file, text, words):
    with pytest.raises(DataError, match=words):
        read(text_file(text, "gold.dat"), format="woollam")
