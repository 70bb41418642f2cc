"""The traps of Mitsuba's ``measured_polarized``: that no exported table falls into one, seen in plain Mitsuba.

Where a trap can be laid, a control lays it, so that the tests are known to see it.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import drjit as dr
import numpy as np
import pytest
from export_helpers import evaluated, plain_mitsuba, share_of_f00
from numpy.testing import assert_allclose, assert_array_equal

import pbrdf
from every_model import EVERY, example
from pbrdf.data.formats.merl import read_planes
from pbrdf.data.formats.pbsdf import read_table, write_table
from pbrdf.data.formats.tensor_file import read_tensors, write_tensors
from pbrdf.errors import DataError, ModelError
from pbrdf.models import MODELS, Model, Parameter
from pbrdf.rendering.export import grid_dataset, write_merl, write_pbsdf
from pbrdf.rendering.tabulation import random_directions

pytestmark = pytest.mark.slow

GIVEN = (650, 450, 550)
METAL = pbrdf.DoubleGauss(sigma=0.08, n=1.5 - 2.0j, a=0.4, k=1.2, b=-0.2, t=0.7)
HOT_SPOT = MODELS["rpv-hot-spot"](sigma=0.1, n=1.5, rho_0=0.2, k=0.8, asymmetry=-0.1, rho_c=0.5)
MULTIPLE = MODELS["baek-2018"](n=1.5, albedo=0.5, strength=1.0, roughness=0.2)
#: Models of three families for the wavelengths of GIVEN, apart in brightness.
FAMILIES = {
    "double-gauss": [METAL, METAL.replace(sigma=0.12, a=1.2), METAL.replace(a=0.05, t=0.2)],
    "rpv-hot-spot": [HOT_SPOT, HOT_SPOT.replace(rho_0=0.6), HOT_SPOT.replace(rho_0=0.02)],
    "baek-2018": [MULTIPLE, MULTIPLE.replace(albedo=0.9), MULTIPLE.replace(albedo=0.1)],
}
#: Errors that the tables here may have, as shares of f00.
COARSE = {"median": 0.01, "percentile_99": 0.05}


@pytest.fixture(scope="module", params=FAMILIES)
def exported(request, tmp_path_factory):
    """Models by wavelength, and their table."""
    models = FAMILIES[request.param]
    path = tmp_path_factory.mktemp("exported") / f"{request.param}.pbsdf"
    written = write_pbsdf(models, path, wavelengths=GIVEN, **COARSE)
    return dict(zip(GIVEN, models, strict=True)), written


def anywhere():
    """Geometries even over the hemispheres, up to 80°."""
    return random_directions(0.1, 2_000, seed=5)["hemisphere"]


def spectral(mi, written):
    return mi.load_dict({key: value for key, value in written.bsdf.items() if key != "wavelength"})


def test_each_wavelength_is_answered_by_its_own_model(exported):
    """Given in disorder: at each of them its model, between two their mean, beyond them the last."""
    models, written = exported
    assert_array_equal(read_table(written.path).wavelength, sorted(GIVEN))
    mi = plain_mitsuba("llvm_ad_spectral_polarized")
    bsdf, geometry = spectral(mi, written), anywhere()
    exact = {wavelength: models[wavelength].mueller(*geometry) for wavelength in sorted(models)}
    for first, second in pairwise(sorted(models)):
        # what another order would be seen by
        assert np.median(np.abs(exact[first][:, 0, 0] / exact[second][:, 0, 0] - 1.0)) > 0.2
        exact[(first + second) / 2] = (exact[first] + exact[second]) / 2.0
    exact |= {400: exact[450], 700: exact[650]}
    for wavelength, expected in exact.items():
        off = share_of_f00(evaluated(mi, bsdf, *geometry, wavelength=wavelength), expected)
        assert np.median(off) < 0.01, wavelength
        assert np.quantile(off, 0.99) < 0.07, wavelength


def test_descending_wavelengths_would_be_seen(exported, tmp_path):
    """Control: the same table turned round, past the writer that refuses it, shows the middle model at 650 nm."""
    models, written = exported
    table = read_table(written.path)
    turned = replace(table, wavelength=table.wavelength[::-1], matrices=table.matrices[:, :, :, ::-1])
    with pytest.raises(DataError, match="650, 550, 450 nm do not ascend"):
        write_table(turned, tmp_path / "turned.pbsdf")
    fields = dict(read_tensors(written.path)) | {"wvls": turned.wavelength, "M": turned.matrices}
    write_tensors(fields, tmp_path / "turned.pbsdf")
    mi = plain_mitsuba("llvm_ad_spectral_polarized")
    bsdf, geometry = mi.load_dict({**written.bsdf, "filename": str(tmp_path / "turned.pbsdf")}), anywhere()
    off = share_of_f00(evaluated(mi, bsdf, *geometry, wavelength=650), models[650].mueller(*geometry))
    assert np.median(off) > 0.2
    ours = pbrdf.read(tmp_path / "turned.pbsdf", wavelength=650)
    exact = models[650].mueller(*(ours[a].values for a in ("theta_i", "theta_r", "phi")))
    assert_allclose(ours["mueller"][:, 0, 0], exact[:, 0, 0], rtol=1e-5)


def test_every_geometry_has_a_number_and_an_intensity(exported):
    """Up to 0.1° above the horizon, where half of the cells around are filled: finite, lit, not over-polarised."""
    models, written = exported
    table = read_table(written.path)
    assert np.isfinite(table.matrices).all()
    assert (table.matrices[..., 0, 0] > 0).all()
    mi = plain_mitsuba()
    theta = np.deg2rad([0.0, 1e-3, 30.0, 60.0, 85.0, 89.0, 89.9])
    theta_i, theta_r, phi = (
        a.ravel() for a in np.meshgrid(theta, theta, np.deg2rad(np.arange(0, 360, 10.0)), indexing="ij")
    )
    apart = (theta_i != theta_r) | ((np.abs(phi - np.pi) > 0.1) & (theta_i > 0.0))
    geometry = [a[apart] for a in (theta_i, theta_r, phi)]
    for wavelength in models:
        bsdf = mi.load_dict({**written.bsdf, "wavelength": float(wavelength)})
        for azimuth in (0.0, 0.4):
            found = evaluated(mi, bsdf, *geometry, azimuth)
            assert np.isfinite(found).all()
            assert (found[:, 0, 0] > 0.0).all()
            assert (np.abs(found).max((1, 2)) <= 1.001 * found[:, 0, 0]).all()


@EVERY
def test_no_model_within_its_bounds_is_below_0_or_without_a_number(cls, tmp_path, monkeypatch):
    """None is refused, none has a cell that rounding takes below 0."""
    monkeypatch.setattr("pbrdf.rendering.tabulation.LARGEST_TABLE", 5_000)
    for seed in (3, 4):
        written = write_pbsdf(example(cls, seed), tmp_path / "any.pbsdf")
        assert written.below == 0
        assert np.isfinite(written.table.matrices).all()
        assert (written.table.matrices[..., 0, 0] >= 0.0).all()


def test_light_and_view_beside_each_other_are_the_models_retro_reflection(exported):
    """A ten-thousandth of a radian apart; the plugin itself has no number at exactly one direction."""
    models, written = exported
    mi = plain_mitsuba()
    theta = np.deg2rad(np.linspace(0.0, 80.0, 41))
    phi = np.full_like(theta, np.pi)
    for which, (wavelength, model) in enumerate(sorted(models.items())):
        exact = model.mueller(theta, theta, phi)
        assert np.isfinite(exact).all()
        # our own interpolation has the limit
        assert share_of_f00(written.table.mueller(theta, theta, phi, which), exact).max() < 0.05
        bsdf = mi.load_dict({**written.bsdf, "wavelength": float(wavelength)})
        for azimuth in (0.0, 0.4, 2.0):
            found = evaluated(mi, bsdf, theta, theta + 1e-4, phi, azimuth)
            assert share_of_f00(found, exact).max() < 0.05
            assert np.median(share_of_f00(found, exact)) < 0.01


def test_our_plugin_has_the_retro_reflection_itself():
    """Light and view along exactly one direction, which the table cannot give."""
    from pbrdf.rendering import bsdf_dict, register

    mi = plain_mitsuba()
    register()
    theta = np.deg2rad(np.linspace(1.0, 80.0, 20))
    away = [theta, theta, np.full_like(theta, -np.pi)]
    for models in FAMILIES.values():
        found = evaluated(mi, mi.load_dict(bsdf_dict(models[0])), *away, azimuth_i=0.0)
        assert share_of_f00(found, models[0].mueller(*away)).max() < 1e-3


def test_a_sphere_lit_from_beside_the_camera_is_that_of_our_plugin(tmp_path):
    """Lamp aside by a ten-thousandth of its distance of 2: no pixel is NaN, as one in six is with it at the camera."""
    from pbrdf.rendering import bsdf_dict, register

    written = write_pbsdf(METAL, tmp_path / "metal.pbsdf", wavelengths=550)
    mi = plain_mitsuba()
    register()

    def stokes(bsdf):
        film = {"type": "hdrfilm", "width": 64, "height": 64, "rfilter": {"type": "box"}}
        direct = {"type": "direct", "bsdf_samples": 0, "emitter_samples": 1}
        scene = {
            "type": "scene",
            "integrator": {"type": "stokes", "nested": direct},
            "sphere": {"type": "sphere", "bsdf": bsdf},
            "lamp": {"type": "point", "position": [2e-4, 0.3, 3.0], "intensity": 10.0},
            "camera": {
                "type": "perspective",
                "fov": 45,
                "to_world": mi.ScalarTransform4f().look_at([0, 0.3, 3], [0, 0, 0], [0, 1, 0]),
                "film": {**film, "component_format": "float32"},
                "sampler": {"type": "independent", "sample_count": 4},
            },
        }
        # S0 … S3 in three equal channels each, behind the radiance
        return np.array(mi.render(mi.load_dict(scene), seed=1))[..., 1::3]

    found, ours = stokes(written.bsdf), stokes(bsdf_dict(METAL))
    assert np.isfinite(found).all()
    hit = ours[..., 0] > 0
    assert 0.3 < hit.mean() < 0.8
    off = np.abs(found - ours)[hit].max(-1) / ours[hit][:, 0]
    assert np.median(off) < 0.002
    assert np.quantile(off, 0.95) < 0.01


class Steep(Model):
    """1/sr on facets within 30° of the normal; beyond them `dark`, with `polarised` as m01 = m10."""

    name = "steep-for-tables"
    parameters = (
        Parameter("dark", "d", "1", "f00 of steep facets", -1.0, 1.0, (-10.0, 1e50), 0.0),
        Parameter("polarised", "p", "1", "m01 of steep facets", -1.0, 1.0, (-10.0, 10.0), 0.0),
    )

    def kernel(self, geometry, values, part="total"):
        facing = geometry.facet[2] > np.cos(np.deg2rad(30.0))
        f = [[0.0] * 4 for _ in range(4)]
        f[0][0] = dr.select(facing, 1.0, values["dark"])
        f[0][1] = f[1][0] = dr.select(facing, 0.0, values["polarised"])
        return f


class Hole(Steep):
    """Without a number in m11 where facets are steep; its intensity has one."""

    name = "hole-for-tables"

    def kernel(self, geometry, values, part="total"):
        f = super().kernel(geometry, values, part)
        f[1][1] = dr.select(geometry.facet[2] > np.cos(np.deg2rad(30.0)), 0.5, dr.nan)
        return f


STEEP = tuple(np.deg2rad([[50.0, 55.0, 70.0], [50.0, 60.0, 40.0], [150.0, 180.0, 160.0]]))


def test_an_intensity_below_0_by_rounding_leaves_no_polarisation(tmp_path, monkeypatch):
    """All sixteen elements are 0 in Mitsuba, and what was done is told; polarised light alone would be left else."""
    monkeypatch.setattr("pbrdf.rendering.tabulation.LARGEST_TABLE", 20_000)  # an edge cannot be met
    written = write_pbsdf(Steep(dark=-1e-9, polarised=1e-8), tmp_path / "steep.pbsdf", **COARSE)
    m = written.table.matrices
    assert written.below > 0.1 * np.prod(m.shape[:3])
    assert written.below == (m[..., 0, 0] == 0.0).sum()
    assert (m[..., 0, 0] >= 0.0).all()
    mi = plain_mitsuba()
    assert_array_equal(evaluated(mi, mi.load_dict(written.bsdf), *STEEP), 0.0)
    # control: one element at the place where m01 stood
    fields = {name: np.array(array) for name, array in read_tensors(written.path).items()}
    dark = fields["M"][..., :1, :1] == 0.0
    fields["M"] = np.where(
        dark & (np.arange(4) == 1) & (np.arange(4) == 0)[:, None], np.float32(1e-8), fields["M"]
    )
    write_tensors(fields, written.path)
    assert np.abs(evaluated(mi, mi.load_dict(written.bsdf), *STEEP)).max() > 1e-9


@pytest.mark.parametrize("write", [write_pbsdf, write_merl])
def test_a_model_below_0_is_refused_by_name_place_and_value(tmp_path, write):
    with pytest.raises(
        ModelError,
        match=r"Steep\(dark=-0\.01, polarised=0\): f00 at θ_i = [\d.]+°, θ_r = [\d.]+°, φ = -?[\d.]+° is -0\.01 1/sr",
    ):
        write(Steep(dark=-0.01, polarised=0.0), tmp_path / "below")
    assert list(tmp_path.iterdir()) == []


def test_polarisation_without_intensity_is_refused(tmp_path):
    with pytest.raises(ModelError, match=r"f00 at .* is 0 1/sr, which is no intensity"):
        write_pbsdf(Steep(dark=0.0, polarised=0.1), tmp_path / "x.pbsdf")


def test_what_is_not_finite_is_refused_before_a_file_is_there(tmp_path):
    """NaN in one element; and a number that single precision does not hold, which MERL's double precision does."""
    steep = [a[:1] for a in STEEP]
    for write in (lambda m: write_pbsdf(m, tmp_path / "x.pbsdf"), lambda m: grid_dataset(m, *steep)):
        with pytest.raises(
            ModelError, match=r"Hole\(.*f11 at θ_i = [\d.]+°.* is nan 1/sr.*nothing is written"
        ):
            write(Hole(dark=0.1, polarised=0.0))
    with pytest.raises(
        ModelError, match=r"f00 at .* is 1e\+40 1/sr, which is not a number that a file can hold"
    ):
        write_pbsdf(Steep(dark=1e40, polarised=0.0), tmp_path / "x.pbsdf")
    assert list(tmp_path.iterdir()) == []


def test_a_merl_cell_below_0_by_rounding_is_dark_and_valid(tmp_path):
    """−1e-9 would be read as a cell without a value."""
    planes = write_merl(Steep(dark=-1e-9, polarised=0.0), tmp_path / "steep.binary")
    stored = read_planes(tmp_path / "steep.binary")
    assert_array_equal(np.isnan(stored), np.isnan(planes))
    # θ_h = 40°, θ_d = 20°, φ_d = 90°
    assert stored[0, 60, 20, 90] == 0.0
    assert stored[0, 10, 20, 90] == pytest.approx(1.0)


def test_a_model_that_reflects_nothing_is_a_black_table(tmp_path):
    black = MODELS["cook-torrance-lambert"](sigma=0.1, n=1.5, strength=0.0, albedo=0.0)
    written = write_pbsdf(black, tmp_path / "black.pbsdf")
    assert written.accurate
    assert not written.below
    assert not written.table.matrices.any()
