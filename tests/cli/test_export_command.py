import drjit as dr
import numpy as np
import pytest

import pbrdf
from pbrdf.data.formats.pbsdf import read_table
from pbrdf.models import MODELS, Model, Parameter


@pytest.fixture
def models(tmp_path):
    """A paint at two wavelengths."""
    blue = pbrdf.DoubleGauss(sigma=0.04, n=1.5, a=0.5, k=1.0, b=0.0, t=0.3)
    blue.to_json(tmp_path / "blue.json")
    blue.replace(a=0.1).to_json(tmp_path / "red.json")
    return blue, blue.replace(a=0.1)


@pytest.mark.slow
def test_a_table_for_mitsuba_tells_its_error_and_how_to_load_it(run, tmp_path, models):
    result = run(
        "export", "red.json", "blue.json", "--wavelength", 650, "--wavelength", 450, "-o", "paint.pbsdf"
    )
    lines = result.stdout.splitlines()
    assert lines[0].startswith("paint.pbsdf: ")
    assert "450, 650 nm, simulated" in lines[0]
    assert "zenith angles up to 80°" in lines[1]
    for line, region in zip(
        lines[2:5], ("even over both hemispheres", "in the lobe", "together"), strict=True
    ):
        assert line.split()[0] == region.split()[0]
        median, high = (float(word) for word in line.replace("%", "").split() if "." in word)
        assert 0.0 < median <= 0.2
        assert median < high <= 1.0
    assert '<string name="filename" value="paint.pbsdf"/>' in result.stdout
    assert result.stderr == ""
    ds = pbrdf.read(tmp_path / "paint.pbsdf", wavelength=650)
    exact = models[1].mueller(*(ds[a].values for a in ("theta_i", "theta_r", "phi")))
    np.testing.assert_allclose(ds["mueller"].values[:, 0, 0], exact[:, 0, 0], rtol=1e-6)
    assert [path.name for path in tmp_path.glob("*.pbsdf")] == ["paint.pbsdf"]


@pytest.mark.slow
def test_the_format_names_the_file_and_a_missing_wavelength_is_told(run, tmp_path, models):
    result = run("export", "blue.json", "--format", "pbsdf")
    assert "550 nm is written; state it with --wavelength" in result.stderr
    assert read_table(tmp_path / "blue.pbsdf").wavelength == [550]


class Edge(Model):
    """1/sr on facets within 30° of the normal, and a little below 0 beyond."""

    name = "edge-for-export"
    parameters = (Parameter("dark", "d", "1", "f00 of steep facets", -1.0, 1.0, (-10.0, 10.0), 0.0),)

    def kernel(self, geometry, values, part="total"):
        f = [[0.0] * 4 for _ in range(4)]
        f[0][0] = dr.select(geometry.facet[2] > 0.87, 1.0, values["dark"])
        return f


@pytest.mark.slow
def test_a_model_below_0_by_rounding_is_told_and_further_below_refused(run, refused, tmp_path, monkeypatch):
    monkeypatch.setitem(MODELS._classes, Edge.name, Edge)
    monkeypatch.setattr("pbrdf.rendering.tabulation.LARGEST_TABLE", 5_000)
    Edge(dark=-1e-9).to_json(tmp_path / "edge.json")
    assert "cells are 0: the model is below 0 there" in run("export", "edge.json", "--wavelength", 550).stderr
    assert (read_table(tmp_path / "edge.pbsdf").matrices[..., 0, 0] >= 0.0).all()
    Edge(dark=-0.5).to_json(tmp_path / "deep.json")
    assert "is -0.5 1/sr, which is no intensity" in refused("export", "deep.json", "--wavelength", 550)
    assert not (tmp_path / "deep.pbsdf").exists()


@pytest.mark.parametrize(("format", "name"), [("netcdf", "white.nc"), ("csv", "white.csv")])
def test_a_grid_reads_back_as_the_model(run, tmp_path, format, name):
    grid = ("--theta-i", "20,60", "--theta-r", "0:80:20", "--phi", "0:180:90")
    assert (
        run("export", "white", "--format", format, *grid).stdout
        == f"{name}: 30 Mueller matrices, simulated\n"
    )
    ds = pbrdf.read(tmp_path / name)
    exact = pbrdf.load_paint("white").mueller(*(ds[a].values for a in ("theta_i", "theta_r", "phi")))
    np.testing.assert_allclose(ds["mueller"], exact, rtol=1e-12, atol=1e-15)
    assert set(ds["wavelength"].values) == {476.0}


def test_a_grid_over_the_hemisphere_is_there_without_options(run, tmp_path, models):
    run("export", "blue.json", "-o", "grid.nc")
    ds = pbrdf.read(tmp_path / "grid.nc")
    assert ds.sizes["geometry"] == 8 * 18 * 25
    assert "wavelength" not in ds.coords


@pytest.mark.slow
def test_a_merl_table_is_read_and_converted(run, tmp_path):
    assert run("export", "white", "--format", "merl").stdout.startswith(
        "white.binary: 1458000 cells of red, green and blue"
    )
    described = run("check", "white.binary", "--every", 10).stdout
    assert "3 groups (blue, green, red); wavelength not stated" in described
    run("convert", "white.binary", "green.nc", "--every", 10, "--select", "group=green")
    assert set(pbrdf.read(tmp_path / "green.nc")["group"].values) == {"green"}


def test_the_folder_of_a_fit_is_a_model(run, tmp_path, models):
    (tmp_path / "some-fit").mkdir()
    models[0].to_json(tmp_path / "some-fit" / "model.json")
    run("export", "some-fit", "--format", "csv", "--theta-i", "20", "--theta-r", "30", "--phi", "10")
    ds = pbrdf.read(tmp_path / "some-fit.csv")
    np.testing.assert_allclose(ds["mueller"][0], models[0].mueller(*np.deg2rad([20, 30, 10])), rtol=1e-12)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["unknown"], "unknown: there is no such file, and no paint of that name: white"),
        (["no.json"], "no.json: cannot be read as a model"),
        (["white", "-o", "x.exr"], "--output x.exr: the extension must be one of .pbsdf, .csv, .nc, .binary"),
        (["white", "-o", "x.nc", "--format", "pbsdf"], "--output x.nc: a pbsdf file is called .pbsdf"),
        (["white", "-o", "nowhere/x.nc"], "there is no folder nowhere"),
        (["white", "--theta-i", "20"], "--theta-i: a pbsdf file has its own directions"),
        (["white", "--format", "merl", "--wavelength", "476"], "a merl file states no wavelength"),
        (["white", "cd-back"], "2 models: state the wavelength of each"),
        (["white", "cd-back", "--format", "merl"], "2 models for a MERL table"),
        (["white", "cd-back", "--wavelength", "476"], "models are given 2, wavelengths 1"),
        (["white", "--wavelength", "632.8"], "632.8 nm, it holds whole nanometres"),
        (["white"] * 6 + [w for i in range(6) for w in ("--wavelength", 450 + i)], "has room for 5 and reads beyond"),
        (["white", "--format", "csv", "--theta-r", "95"], "--theta-r: 95° is not an angle from 0° to below 90°"),
    ],
)  # fmt: skip
def test_mistakes_are_explained(refused, arguments, message):
    assert message in refused("export", *arguments)


def test_a_folder_without_a_model_is_told(refused, tmp_path):
    (tmp_path / "empty").mkdir()
    assert "empty: this folder holds no model.json" in refused("export", "empty")


def test_tables_that_cannot_be_read_are_told(refused, tmp_path):
    (tmp_path / "a.pbsdf").write_bytes(b"tensor_file\0\1\0")
    (tmp_path / "a.binary").write_bytes(b"short")
    assert "a.pbsdf: the file ends within its header: it is truncated" in refused("check", "a.pbsdf")
    assert "a.binary: this is not a MERL file" in refused("check", "a.binary")


def test_only_tables_are_thinned(run, refused):
    run("convert", "white", "white.csv")
    assert "the format csv has no option 'every'" in refused("check", "white.csv", "--every", 2)
