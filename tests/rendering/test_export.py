"""Tables of models: in plain Mitsuba, read back, fitted again."""

from __future__ import annotations

import numpy as np
import pytest
from export_helpers import evaluated, plain_mitsuba, share_of_f00
from numpy.testing import assert_allclose, assert_array_equal

import pbrdf
from pbrdf.data.formats.merl import cell_centres, look_up, read_planes
from pbrdf.data.formats.pbsdf import read_table
from pbrdf.errors import DataError, ModelError
from pbrdf.optics.half_difference import directions
from pbrdf.rendering.export import AIMS, UNSTATED_WAVELENGTH, grid_dataset, write_merl, write_pbsdf
from pbrdf.rendering.tabulation import random_directions, refined_table

pytestmark = pytest.mark.slow

ROUGH = pbrdf.DoubleGauss(sigma=0.08, n=1.6, a=0.8, k=1.3, b=0.3, t=0.6)
GLOSSY = ROUGH.replace(sigma=0.05)
METAL = pbrdf.DoubleGauss(sigma=0.08, n=1.5 - 2.0j, a=0.4, k=1.2, b=-0.2, t=0.7)
COARSE = {"median": 0.01, "percentile_99": 0.05}


@pytest.fixture(scope="module")
def coarse(tmp_path_factory):
    """A metal at two wavelengths in a small, coarse table."""
    path = tmp_path_factory.mktemp("coarse") / "metal.pbsdf"
    return write_pbsdf([METAL, METAL.replace(a=0.1)], path, wavelengths=[650, 450], **COARSE)


@pytest.fixture(scope="module")
def rough(tmp_path_factory):
    """A dielectric whose wavelength is not stated."""
    return write_pbsdf(ROUGH, tmp_path_factory.mktemp("rough") / 'a "b" & c.pbsdf', **COARSE)


@pytest.mark.parametrize("name", pbrdf.PAINTS)
def test_the_bundled_paints_are_met_to_a_fifth_of_a_percent(name):
    """Median ≤ 0.2 %, 99th percentile ≤ 1 % of f00, at other geometries than those the writer looked at."""
    paint = pbrdf.load_paint(name)
    table, errors, _ = refined_table([paint], [476], median=AIMS[0], percentile_99=AIMS[1])
    assert table.matrices.nbytes < 90e6
    for geometry in random_directions(paint.values["sigma"], 20_000, seed=99).values():
        off = share_of_f00(table.mueller(*geometry), paint.mueller(*geometry))
        assert np.median(off) <= 0.002
        assert np.quantile(off, 0.99) <= 0.01
    assert all(e.median <= 0.002 and e.percentile_99 <= 0.01 for e in errors)


def test_the_random_geometries_are_what_they_are_said_to_be():
    """Even over the hemispheres up to 80°: cosθ is uniform. In the lobe: facets with slopes of that width."""
    sample = random_directions(0.1, 20_000)
    for cosine in np.cos(sample["hemisphere"][:2]):
        assert_allclose(
            np.quantile(cosine, [0.1, 0.5, 0.9]),
            np.cos(np.deg2rad(80)) + (1 - np.cos(np.deg2rad(80))) * np.array([0.1, 0.5, 0.9]),
            atol=0.01,
        )
    i, r, phi = (a[sample["lobe"][0] < 0.5] for a in sample["lobe"])
    x = np.sin(r) * np.cos(phi) - np.sin(i)
    y, z = np.sin(r) * np.sin(phi), np.cos(r) + np.cos(i)
    assert np.std(x / z) == pytest.approx(0.1, rel=0.03)
    assert np.std(y / z) == pytest.approx(0.1, rel=0.03)
    assert max(a.max() for region in sample.values() for a in region[:2]) <= np.deg2rad(80)


def test_nodes_crowd_where_the_lobe_is(coarse):
    """Even in a coarse table a step of θ_h within the lobe is less than σ, and φ_d spans the whole turn."""
    table = read_table(coarse.path)
    within = np.diff(table.theta_h[table.theta_h < 3 * 0.08])
    assert within.max() < 0.08
    assert table.theta_h[0] > 0.0  # the plugin's frame is not a number there
    assert_array_equal(table.phi_d, -table.phi_d[::-1])
    assert table.phi_d[-1] == np.float32(np.pi)


def test_the_nodes_are_the_model(coarse):
    """To the rounding of single precision, at both wavelengths, in ascending order."""
    ds = pbrdf.read(coarse.path, every=1)
    for wavelength, model in ((650, METAL), (450, METAL.replace(a=0.1))):
        rows = ds.isel(geometry=ds["wavelength"].values == wavelength)
        exact = model.mueller(*(rows[a].values for a in ("theta_i", "theta_r", "phi")))
        assert share_of_f00(rows["mueller"].values, exact).max() < 8 * np.finfo(np.float32).eps
    assert_array_equal(coarse.table.wavelength, [450, 650])
    assert ds.attrs["simulated"] == 1
    assert "SIMULATED" in ds.attrs["source"]


def test_interpolation_is_as_good_as_reported(coarse):
    assert coarse.accurate
    assert [e.region for e in coarse.errors] == ["hemisphere", "lobe", "both"]
    reported = {e.region: e for e in coarse.errors}
    for region, geometry in random_directions(METAL.lobe_width(), 5_000, seed=8).items():
        off = [
            share_of_f00(coarse.table.mueller(*geometry, which), model.mueller(*geometry))
            for which, model in enumerate((METAL.replace(a=0.1), METAL))
        ]
        assert max(np.median(o) for o in off) == pytest.approx(reported[region].median, rel=0.15)
        assert max(np.quantile(o, 0.99) for o in off) == pytest.approx(
            reported[region].percentile_99, rel=0.3
        )


def test_a_table_too_large_is_given_up_and_said(tmp_path, monkeypatch):
    monkeypatch.setattr("pbrdf.rendering.tabulation.LARGEST_TABLE", 5_000)
    written = write_pbsdf(ROUGH, tmp_path / "small.pbsdf")
    assert not written.accurate
    assert np.prod(written.table.matrices.shape[:3]) <= 5_000


def test_the_table_is_filled_below_the_horizon(coarse):
    """No cell is NaN: the plugin would turn its whole neighbourhood black."""
    assert np.isfinite(coarse.table.matrices).all()
    assert (coarse.table.matrices[..., 0, 0] > 0).all()


def test_plain_mitsuba_evaluates_the_table_as_we_do(coarse):
    """Out of the plane, with light that comes out circular: its measured_polarized and our interpolation are one."""
    mi = plain_mitsuba()
    for which, wavelength in enumerate((450, 650)):
        bsdf = mi.load_dict({**coarse.bsdf, "wavelength": float(wavelength)})
        for geometry in random_directions(0.08, 2_000, seed=3).values():
            found = evaluated(mi, bsdf, *geometry)
            ours = coarse.table.mueller(*geometry, which)
            assert share_of_f00(found, ours).max() < 2e-3
            assert np.median(share_of_f00(found, ours)) < 2e-5


def test_plain_mitsuba_reproduces_the_model(tmp_path):
    """A gloss paint, σ = 0.006, within 0.2 % (median) and 1 % (99th percentile), single precision included."""
    mi = plain_mitsuba()
    paint = pbrdf.load_paint("white")
    written = write_pbsdf(paint, tmp_path / "white.pbsdf", wavelengths=476)
    assert (tmp_path / "white.pbsdf").stat().st_size < 50e6
    bsdf = mi.load_dict(written.bsdf)
    assert written.bsdf["alpha_sample"] == pytest.approx(np.sqrt(2) * 0.006, rel=0.01)
    for geometry in random_directions(0.006, 5_000, seed=4).values():
        off = share_of_f00(evaluated(mi, bsdf, *geometry), paint.mueller(*geometry))
        assert np.median(off) < 0.002
        assert np.quantile(off, 0.99) < 0.01


def test_the_snippet_for_scene_files_loads(coarse, rough):
    mi = plain_mitsuba()
    with pytest.raises(Exception, match="specific wavelength"):
        mi.load_string(f'<scene version="3.0.0">{coarse.xml}</scene>')
    assert 'name="wavelength" value="550.0"' in rough.xml
    mi.load_string(f'<scene version="3.0.0">{rough.xml}</scene>')


def test_a_metals_v_has_the_files_sign(coarse):
    """Light polarised at +45° between x = s and y comes off a metal partly circular; the file counts right as V > 0.

    Ours is m32 = Im(r_p r_s*) > 0 for U along p + s; changing U and V leaves m32 as it is, changing one would not.
    """
    m = coarse.table.matrices[len(coarse.table.phi_d) // 2, len(coarse.table.theta_d) // 2, 0, 1]
    assert m[3, 2] > 0.01 * m[0, 0]
    assert m[2, 3] == pytest.approx(-m[3, 2], rel=1e-3)


def test_a_fit_finds_the_model_in_its_table_again(rough):
    ds = pbrdf.read(rough.path, every=5)
    ds = ds.isel(geometry=np.maximum(ds["theta_i"], ds["theta_r"]).values < np.deg2rad(80))
    found = pbrdf.fit(ds, starts=2).model
    for name in ("sigma", "n", "a", "k", "b", "t"):
        assert found.values[name] == pytest.approx(ROUGH.values[name], rel=1e-4), name


@pytest.mark.parametrize(
    ("models", "wavelengths", "words"),
    [
        (
            [ROUGH] * 6,
            list(range(450, 456)),
            "6 wavelengths are too many for one .pbsdf file: .* has room for 5",
        ),
        ([ROUGH, METAL], None, "state one wavelength for each model: models are given 2, wavelengths 0"),
        ([ROUGH, METAL], [500], "models are given 2, wavelengths 1"),
        ([ROUGH, METAL], [500, 500], "two models have the same wavelength"),
        ([ROUGH], [632.8], "632.8 nm, it holds whole nanometres"),
        ([ROUGH], [100_000], "no place for the wavelength"),
        ([], [], "there is no model"),
        ([ROUGH.replace(a=np.array([1.0, 2.0]))], [500], "a of .* is an array"),
    ],
)
def test_what_a_pbsdf_cannot_hold_is_told(tmp_path, models, wavelengths, words):
    with pytest.raises(ModelError, match=words):
        write_pbsdf(models, tmp_path / "x.pbsdf", wavelengths=wavelengths)
    assert list(tmp_path.iterdir()) == []


def test_a_wavelength_that_is_not_stated_is_the_named_constant(rough):
    assert rough.table.wavelength == [UNSTATED_WAVELENGTH] == [550]


def test_a_missing_folder_is_told_before_the_work(tmp_path):
    for write, name in ((write_pbsdf, "x.pbsdf"), (write_merl, "x.binary")):
        with pytest.raises(DataError, match=f"{name}: there is no folder"):
            write(ROUGH, tmp_path / "nowhere" / name)
    assert list(tmp_path.iterdir()) == []


@pytest.fixture(scope="module")
def merl(tmp_path_factory):
    path = tmp_path_factory.mktemp("merl") / "glossy.binary"
    return path, write_merl(GLOSSY, path)


def both_ways(model, theta_i, theta_r, phi):
    """Intensity under natural light, the mean of the two directions of the light."""
    return 0.5 * (model.stokes(theta_i, theta_r, phi)[..., 0] + model.stokes(theta_r, theta_i, -phi)[..., 0])


def test_merl_cells_are_the_model_at_their_middle(merl):
    path, planes = merl
    assert_allclose(read_planes(path), planes, rtol=1e-15)
    theta_h, theta_d, phi_d = cell_centres()
    for cell in ((0, 0, 0), (10, 40, 90), (30, 20, 150), (60, 50, 80)):
        geometry = directions(*(axis[j] for axis, j in zip((theta_h, theta_d, phi_d), cell, strict=True)))
        assert planes[(0, *cell)] == pytest.approx(both_ways(GLOSSY, *geometry), rel=1e-12)
    assert np.isnan(planes[0, 80, 80, 0])
    assert_array_equal(planes[0], planes[1])


def test_merl_tables_give_the_model_within_their_resolution(merl):
    """A cell is 0.36° wide at θ_h = σ = 2.9°: up to θ Δθ/σ² = 6 % to both sides, without interpolation; and no bias."""
    for geometry in random_directions(0.05, 20_000, seed=2).values():
        geometry = [a[np.maximum(geometry[0], geometry[1]) < np.deg2rad(60)] for a in geometry]
        off = look_up(merl[1], *geometry)[:, 0] / both_ways(GLOSSY, *geometry) - 1
        assert np.quantile(np.abs(off), 0.5) < 0.03
        assert np.quantile(np.abs(off), 0.99) < 0.15
        assert abs(np.median(off)) < 0.002


def test_three_models_are_red_green_and_blue(tmp_path):
    models = [GLOSSY.replace(sigma=0.006, a=a) for a in (0.9, 0.5, 0.1)]
    planes = write_merl(models, tmp_path / "rgb.binary")
    geometry = np.full(3, 0.3)
    for which, model in enumerate(models):
        assert_allclose(look_up(planes, *geometry)[which], both_ways(model, *geometry), rtol=0.02)
    with pytest.raises(
        ModelError, match="2 models for a MERL table: give one, or three for red, green, blue"
    ):
        write_merl(models[:2], tmp_path / "rg.binary")


def test_a_grid_is_a_data_set_of_mueller_matrices():
    geometry = np.deg2rad([10.0, 10.0, 40.0]), np.deg2rad([0.0, 50.0, 40.0]), np.deg2rad([0.0, 120.0, 0.0])
    ds = grid_dataset([ROUGH, METAL], *geometry, wavelengths=[450.5, 650])
    assert_array_equal(ds["wavelength"], [450.5] * 3 + [650] * 3)
    assert_array_equal(ds["group"], [10, 10, 40] * 2)
    assert_allclose(ds["mueller"][3:], METAL.mueller(*geometry), rtol=1e-14)
    assert "wavelength" not in grid_dataset(ROUGH, *geometry).coords
    assert ds.attrs["simulated"] == 1
