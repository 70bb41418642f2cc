"""EPFL's files against Mitsuba's plugin ``measured``, which reads the same ones; and the mirror direction in words: the
sample at the top of the normal's square is seen at θ_r = θ_i, φ = 0."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pbrdf.data import read
from pbrdf.data.formats.tensor_file import write_tensors
from pbrdf.errors import DataError

THETA_I = np.deg2rad([0.0, 25.0, 60.0])


def fields(phi_i=(0.0,), colours=False):
    """Smooth made tables: densities that lean towards small tilts, and samples that differ everywhere."""
    rng = np.random.default_rng(11)
    shape = (len(phi_i), len(THETA_I))
    v, u = np.meshgrid(np.linspace(0, 1, 6), np.linspace(0, 1, 6), indexing="ij")
    lobe = np.exp(-4 * u**2) + 0.05
    vndf = lobe * rng.uniform(0.5, 1.0, (*shape, 6, 6))
    vndf[..., -1, :] = vndf[..., 0, :]  # φ = −π and π
    channels = 3
    values = rng.uniform(0.2, 1.0, (*shape, channels, 5, 5))
    values[..., -1, :] = values[..., 0, :]
    values[..., :, 0] = values[..., :1, 0]  # the level normal, whatever its azimuth
    single = {
        "description": np.frombuffer(b"a made material", np.uint8),
        "phi_i": np.array(phi_i),
        "theta_i": THETA_I,
        "ndf": lobe * (1 + 0.1 * u * np.cos(2 * np.pi * v)),
        "sigma": 0.3 + 0.5 * (1 - u),
        "vndf": vndf,
        "luminance": values.mean(2),
        "rgb" if colours else "spectra": values,
        "jacobian": np.ones(1, np.uint8),
        "wavelengths": np.array([450.0, 550.0, 650.0]),
    }
    return {k: a if a.dtype == np.uint8 else a.astype(np.float32) for k, a in single.items()}


@pytest.fixture
def made(tmp_path):
    def make(name="paint.bsdf", **options):
        path = tmp_path / name
        write_tensors(fields(**options), path)
        return path

    return make


@pytest.mark.slow
def test_the_directions_and_values_are_those_of_mitsuba(made):
    """Its plugin evaluates f cosθ_o at any direction; at those of the samples it must give the samples."""
    mi = pytest.importorskip("mitsuba")
    path = made()
    ds = read(path)
    before = mi.variant()
    mi.set_variant("scalar_spectral")
    try:
        bsdf = mi.load_dict({"type": "measured", "filename": str(path)})
        wanted = []
        red = ds.isel(geometry=(ds["wavelength"] == 450).values)
        for theta_i, theta_r, phi in zip(
            red["theta_i"].values, red["theta_r"].values, red["phi"].values, strict=True
        ):
            interaction = mi.SurfaceInteraction3f()
            interaction.wavelengths = [450.0, 550.0, 650.0, 550.0]
            interaction.wi = [np.sin(theta_i), 0.0, np.cos(theta_i)]
            azimuth = phi + np.pi
            viewer = [np.sin(theta_r) * np.cos(azimuth), np.sin(theta_r) * np.sin(azimuth), np.cos(theta_r)]
            wanted.append(np.array(bsdf.eval(mi.BSDFContext(), interaction, viewer))[:3] / np.cos(theta_r))
    finally:
        if before:
            mi.set_variant(before)
    got = [ds["I"].values[ds["wavelength"].values == nanometres] for nanometres in (450, 550, 650)]
    # at normal incidence the azimuth of the light, from which that of the normal is counted, is anyone's choice
    oblique = red["theta_i"].values > 0.1
    assert oblique.sum() > 20
    assert_allclose(np.array(got).T[oblique], np.array(wanted)[oblique], rtol=3e-4)


def test_a_level_normal_is_the_mirror_direction(made):
    ds = read(made(), wavelength=550)
    for theta_i in THETA_I[1:]:
        one = ds.isel(geometry=np.isclose(ds["theta_i"].values, theta_i, atol=1e-6))
        specular = np.isclose(one["theta_r"], theta_i, atol=1e-5)
        assert_allclose(np.cos(one["phi"].values[specular][0]), 1.0, atol=1e-6)


def test_no_direction_comes_twice(made):
    ds = read(made(), wavelength=450)
    vectors = [
        np.sin(ds["theta_r"]) * np.cos(ds["phi"]),
        np.sin(ds["theta_r"]) * np.sin(ds["phi"]),
        ds["theta_i"],
    ]
    rows = np.round(np.stack([np.asarray(v) for v in vectors], -1), 5)
    assert len(np.unique(rows, axis=0)) == ds.sizes["geometry"]


def test_the_values_are_a_brdf_at_wavelengths(made):
    ds = read(made())
    assert ds.attrs["quantity"] == "brdf"
    assert ds.attrs["title"] == "a made material"
    assert_array_equal(np.unique(ds["wavelength"]), [450, 550, 650])
    assert_array_equal(np.unique(ds["group"]), [0, 25, 60])
    assert (ds["theta_r"] < np.pi / 2).all()


def test_an_anisotropic_material_has_its_azimuths_as_groups(made):
    ds = read(made(phi_i=(-1.0, 0.0, 1.0)), wavelength=550)
    assert len(np.unique(ds["group"])) == 3
    assert "0" in ds["group"].values.astype(str)


def test_every_takes_some_samples(made):
    path = made()
    assert read(path, every=2).sizes["geometry"] < read(path).sizes["geometry"]


def test_the_content_tells_the_format_from_other_tensor_files(made):
    assert read(made("paint.unknown")).attrs["title"] == "a made material"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"sigma": None}, "no field 'sigma'"),
        ({"vndf": np.ones((1, 2, 6, 5), np.float32)}, r"'vndf' has the shape \(1, 2, 6, 5\)"),
        ({"ndf": np.ones((1, 5), np.float32)}, r"'ndf' has the shape \(1, 5\)"),
        ({"spectra": np.ones((1, 3, 2, 4, 7), np.float32)}, "'spectra' has the shape"),
        ({"vndf": np.zeros((1, 3, 6, 5), np.float32)}, "is not a density"),
        ({"theta_i": np.array([0, 25, 60], np.float32)}, "theta_i reaches 60"),
    ],
)
def test_other_contents_are_refused(tmp_path, change, words):
    path = tmp_path / "paint.bsdf"
    write_tensors({k: v for k, v in (fields() | change).items() if v is not None}, path)
    with pytest.raises(DataError, match=words):
        read(path, format="rgl")


def test_colours_have_no_wavelength(made):
    with pytest.raises(DataError, match="holds colours"):
        read(made(colours=True), wavelength=550)
