import json

import numpy as np
import pytest
import xarray as xr

import pbrdf


def test_a_grid_reads_back_as_the_model(run, tmp_path):
    result = run(
        "simulate", "cd-back", "--theta-i", "20,60", "--theta-r", "0:80:20", "--phi", "0:180:90", "-o", "g.nc"
    )
    assert result.stdout == "g.nc: 30 geometries, simulated\n"
    ds = pbrdf.read(tmp_path / "g.nc")
    paint = pbrdf.load_paint("cd-back")
    np.testing.assert_array_equal(np.unique(np.rad2deg(ds["theta_r"]).round(6)), [0, 20, 40, 60, 80])
    np.testing.assert_array_equal(np.unique(ds["group"]), [20, 60])
    expected = paint.stokes(ds["theta_i"].values, ds["theta_r"].values, ds["phi"].values)
    np.testing.assert_allclose(np.stack([ds[c] for c in "IQUV"], -1), expected, rtol=1e-12, atol=1e-15)
    assert ds.attrs["simulated"] == 1
    assert ds.attrs["quantity"] == "brdf"
    assert float(ds["wavelength"][0]) == 476.0
    assert "SIMULATED" in ds.attrs["source"]


def test_an_azimuth_of_many_turns_is_that_of_the_remainder(run):
    plain, turned = (
        run("simulate", "white", "--theta-i", "30", "--theta-r", "40", "--phi", phi).stdout
        for phi in ("10", "3600010")
    )
    assert turned == plain


def test_the_plane_has_both_sides(run, tmp_path):
    run("simulate", "white", "--plane", "--theta-i", "30", "--theta-r=-60:60:30", "-o", "p.csv")
    ds = pbrdf.read(tmp_path / "p.csv")
    np.testing.assert_allclose(np.rad2deg(ds["theta_r"]), [60, 30, 0, 30, 60], atol=1e-12)
    np.testing.assert_allclose(np.rad2deg(ds["phi"]), [180, 180, 0, 0, 0])


def test_a_bistatic_run_keeps_the_angle_between_source_and_camera(run, tmp_path):
    run("simulate", "white", "--bistatic", "60,100", "-o", "b.csv")
    ds = pbrdf.read(tmp_path / "b.csv")
    s = np.where(ds["phi"] > 1.0, -ds["theta_r"], ds["theta_r"])
    between = np.rad2deg(ds["theta_i"].values + s)
    np.testing.assert_allclose(between, np.where(ds["group"] == 1, 60.0, 100.0))
    assert np.rad2deg(ds["theta_i"]).max() < 90.0


def test_mueller_matrices_and_another_light(run, tmp_path):
    small = ("--plane", "--theta-i", "40", "--theta-r", "10,50")
    run("simulate", "white", *small, "--mueller", "-o", "m.nc")
    run("simulate", "white", *small, "--incident", "1,0.5,0,0", "-o", "s.nc")
    M = pbrdf.read(tmp_path / "m.nc")["mueller"].values
    S = pbrdf.read(tmp_path / "s.nc")
    np.testing.assert_allclose(S["I"], M[:, 0, 0] + 0.5 * M[:, 0, 1])
    assert tuple(S.attrs["illumination"]) == (1.0, 0.5, 0.0, 0.0)


def test_normalised_values_are_those_over_the_intensity(run, tmp_path):
    small = ("--plane", "--theta-i", "40", "--theta-r", "10,50")
    for name, more in (
        ("s.nc", ()),
        ("q.csv", ("--normalised",)),
        ("n.csv", ("--mueller", "--normalised", "--noise", "1e-9")),
    ):
        run("simulate", "white", *small, *more, "-o", name)
    S, q, n = (pbrdf.read(tmp_path / name) for name in ("s.nc", "q.csv", "n.csv"))
    for name in "QUV":
        np.testing.assert_allclose(q[f"{name}_over_I"], S[name] / S["I"], rtol=1e-12, atol=1e-15)
    M = n["mueller_over_m00"].values
    np.testing.assert_allclose(M[:, 1, 0], S["Q"] / S["I"], atol=1e-7)
    np.testing.assert_array_equal(M[:, 0, 0], 1.0)
    np.testing.assert_allclose(n["mueller_over_m00_std"].values[:, 1, 0], 1e-9)


@pytest.mark.slow
def test_noise_has_the_stated_size_and_a_seed(run, tmp_path):
    grid = ("simulate", "cd-back", "--theta-i", "40", "--theta-r", "0:80:2", "--phi", "0:355:10")
    for name, seed in (("a.nc", 1), ("b.nc", 1), ("c.nc", 2)):
        run(*grid, "--noise", "0.01", "--seed", seed, "-o", name)
    run(*grid, "-o", "exact.nc")
    a, b, c, exact = (pbrdf.read(tmp_path / f"{name}.nc") for name in ("a", "b", "c", "exact"))
    np.testing.assert_array_equal(a["I"], b["I"])
    assert not np.array_equal(a["I"], c["I"])
    deviation = (a["I"] - exact["I"]) / a["I_std"]
    assert float(deviation.std()) == pytest.approx(1.0, abs=0.06)
    np.testing.assert_allclose(a["I_std"], 0.01 * exact["I"], rtol=1e-9)


@pytest.mark.slow
def test_a_fit_finds_a_simulated_model_again(run, tmp_path):
    truth = pbrdf.DoubleGauss(sigma=0.08, n=1.55, a=0.7, k=1.2, b=0.3, t=0.4)
    truth.to_json(tmp_path / "truth.json")
    run(
        "simulate",
        "truth.json",
        "--plane",
        "--theta-i",
        "25,50",
        "--theta-r=-80:80:5",
        "--noise",
        "0.01,0.001",
        "-o",
        "run.csv",
    )
    run("fit", "run.csv", "--starts", 4, "--quiet")
    record = json.loads((tmp_path / "run-fit" / "fit.json").read_text(encoding="utf-8"))
    for name in ("sigma", "n", "a", "k", "b", "t"):
        e = record["estimates"][name]
        assert abs(e["value"] - truth.values[name]) < 4.5 * e["standard_error"], name


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["unknown", "-o", "x.nc"], "unknown"),
        (["white", "-o", "x.txt"], "the extension must be .nc or .csv"),
        (["white", "-o", "nowhere/x.nc"], "nowhere/x.nc: there is no folder nowhere"),
        (["white", "-o", "x.nc", "--theta-i", "0:90:10"], "--theta-i: 90° is not an angle from 0° to below 90°"),
        (["white", "-o", "x.nc", "--theta-r=-10"], "--theta-r: -10° is not"),
        (["white", "-o", "x.nc", "--theta-i", "10:0:5"], "--theta-i '10:0:5': give START:STOP:STEP"),
        (["white", "-o", "x.nc", "--theta-i", "ten"], "--theta-i: 'ten' is not a number"),
        (["white", "-o", "x.nc", "--phi", "0:360:0.0001"], "more than the"),
        (["white", "-o", "x.nc", "--theta-i", "0:80:0.1", "--phi", "0:360:0.1"], "take larger steps"),
        (["white", "-o", "x.nc", "--plane", "--bistatic", "60"], "exclude each other"),
        (["white", "-o", "x.nc", "--plane", "--phi", "0"], "--phi has no place"),
        (["white", "-o", "x.nc", "--bistatic", "60", "--theta-i", "0"], "--theta-i follows from"),
        (["white", "-o", "x.nc", "--bistatic", "250"], "never between 0° and 90°"),
        (["white", "-o", "x.nc", "--incident", "1,0,0"], "--incident '1,0,0': give natural or four numbers"),
        (["white", "-o", "x.nc", "--incident", "1,2,0,0"], "not the Stokes vector of any light"),
        (["white", "-o", "x.nc", "--incident", "1,1,0,0", "--mueller"], "leave --incident out"),
        (["white", "-o", "x.nc", "--noise", "loud"], "noise"),
    ],
)  # fmt: skip
def test_mistakes_are_explained(refused, arguments, message):
    assert message in refused("simulate", *arguments)


def test_a_map_of_paints_is_refused(refused, tmp_path):
    pbrdf.load_paint("white").replace(n=np.array([1.5, 1.6])).to_json(tmp_path / "map.json")
    assert "map.json: its parameters are arrays" in refused("simulate", "map.json", "-o", "x.nc")


def test_an_instruments_noise_differs_for_circular_polarisation(run, tmp_path):
    arguments = ("--noise", "instrument:linear=1%,circular=5%", "-o", "i.nc")
    run("simulate", "white", "--plane", "--theta-i", "40", *arguments)
    ds = pbrdf.read(tmp_path / "i.nc")
    np.testing.assert_allclose(ds["V_std"], 5.0 * ds["Q_std"])


def test_without_a_file_it_prints_a_table(run, tmp_path):
    small = ("simulate", "white", "--plane", "--theta-i", "40", "--theta-r", "10,50")
    printed = run(*small).stdout
    assert not list(tmp_path.iterdir())
    (tmp_path / "printed.csv").write_text(printed)
    run(*small, "-o", "written.csv")
    assert printed == (tmp_path / "written.csv").read_text()
    assert pbrdf.read(tmp_path / "printed.csv").sizes["geometry"] == 2


def test_a_grid_has_the_angles_for_dimensions(run, refused, tmp_path):
    small = ("simulate", "white", "--theta-i", "40", "--theta-r", "10,50", "--phi", "0,90,180")
    run(*small, "-o", "list.nc")
    run(*small, "--grid", "-o", "grid.nc")
    xr.testing.assert_identical(pbrdf.read(tmp_path / "grid.nc"), pbrdf.read(tmp_path / "list.nc"))
    with xr.open_dataset(tmp_path / "grid.nc", engine="h5netcdf") as stored:
        assert dict(stored["I"].sizes) == {"theta_i": 1, "theta_r": 2, "phi": 3}
    assert "netCDF" in refused(*small, "--grid") and "netCDF" in refused(*small, "--grid", "-o", "g.csv")
    assert "no grid" in refused("simulate", "white", "--plane", "--grid", "-o", "g.nc")
