"""``pbrdf map``: from paint to pixels to paint, gone on with after an interruption, several workers, clear refusals."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from PIL import Image
from typer.testing import CliRunner

import pbrdf
from pbrdf.cli.main import app
from pbrdf.inversion.map_store.made_from import MadeFrom
from pbrdf.inversion.map_store.map_store import MapStore
from pbrdf.inversion.parameter_map import FLAGS, PixelStatus
from pbrdf.inversion.parameter_map.map_fit import MapFit
from pixel_helpers import blank, painted

PAINTS = ("matte-white-thick", "white")
#: The samples in the picture, (rows, columns).
SAMPLES = {"matte-white-thick": (slice(4, 12), slice(4, 12)), "white": (slice(4, 12), slice(16, 24))}
FIT = ("--counts-per-brdf", 1, "--labels", "trial/regions.toml", "--no-figures")


def call(*arguments):
    done = CliRunner().invoke(app, [str(a) for a in arguments])
    assert done.exit_code == 0, done.output
    return done


@pytest.fixture(scope="module")
def trial(tmp_path_factory):
    """Two flat samples on the virtual goniometer, 8 × 8 pixels each, as raw frames and reduced."""
    folder = tmp_path_factory.mktemp("map")
    before = Path.cwd()
    os.chdir(folder)
    try:
        call("measure", *PAINTS, "--patch", 8, "--calibration-error", "none", "-o", "trial")
        common = (
            "-p",
            "trial/polarimeter.toml",
            "--angles",
            "trial/angles.csv",
            "--regions",
            "trial/regions.toml",
        )
        call(
            "reduce", "trial/frames", *common, "--no-pictures", "-o", "trial/reduced", "--maps", "zarr", "-q"
        )
    finally:
        os.chdir(before)
    return folder / "trial"


@pytest.fixture
def at_trial(trial, run, tmp_path):
    """The command line beside the trial's files."""
    (tmp_path / "trial").symlink_to(trial)
    return run


@pytest.fixture(scope="module")
def whole(trial, tmp_path_factory):
    """The map in one go, in units of 8 pixels."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "trial").symlink_to(trial)
    before = Path.cwd()
    os.chdir(folder)
    try:
        call("map", "trial/reduced/stokes.zarr", "-g", "flat", "-o", "paint.zarr", *FIT, "--unit", 8, "-q")
    finally:
        os.chdir(before)
    return folder / "paint.zarr"


def opened(path):
    if path.suffix == ".nc":
        return xr.load_dataset(path)
    with xr.open_zarr(path, consolidated=False) as found:
        return found.load()


def same(one, other):
    for name in one.data_vars:
        np.testing.assert_array_equal(one[name].values, other[name].values, name)


@pytest.mark.slow
def test_from_paint_to_pixels_to_paint(at_trial, tmp_path):
    """Every pixel of two samples gives its paint back, and scatters about it as its standard errors say."""
    done = at_trial(
        "map", "trial/reduced/stokes.zarr", "-g", "flat", "-o", "paint.zarr", "--counts-per-brdf", 1,
        "--labels", "trial/regions.toml", "--correlation", "--figure-format", "svg",
    )  # fmt: skip
    assert "128 of 128 measured pixels have a result" in done.stdout
    found = opened(tmp_path / "paint.zarr")
    assert set(found["status"].attrs["flag_meanings"].split()) > {"converged", "masked"}
    pulls = []
    for paint, (rows, columns) in SAMPLES.items():
        part = found.isel(y=rows, x=columns)
        truth = pbrdf.load_paint(paint).values
        for name in map(str, found["parameter"].values):
            one = part.sel(parameter=name)
            pulls.append(((one["estimate"] - truth[name]) / one["standard_error"]).values.ravel())
    pulls = np.concatenate(pulls)
    assert pulls.size == 2 * 64 * 6
    assert np.sqrt((pulls**2).mean()) == pytest.approx(1.0, abs=0.15)
    assert np.abs(pulls).max() < 5.0
    reduced = (found["chi2"] / found["degrees_of_freedom"]).values[found["status"].values == 0]
    assert np.median(reduced) == pytest.approx(1.0, abs=0.05)
    correlation = found["correlation"].isel(y=6, x=6).values
    np.testing.assert_allclose(np.diag(correlation), 1.0)
    report = tmp_path / "paint-report"
    files = {path.name for path in report.iterdir()}
    assert {"index.html", "summary.txt", "map.png", "map.svg", "quality.png", "parameter_n.png"} <= files
    assert "quicklook.png" not in files
    page = (report / "index.html").read_text(encoding="utf-8")
    assert "Simulated" not in page  # frames do not say what took them
    assert "--correlation" in page


@pytest.mark.slow
def test_a_small_map_in_one_file_holds_the_same_numbers(at_trial, tmp_path):
    at_trial("map", "trial/reduced/stokes.zarr", "-g", "flat", "-o", "paint.nc", *FIT)
    done = at_trial("map", "trial/reduced/stokes.zarr", "-g", "flat", "-o", "paint.zarr", *FIT, "-q")
    assert done.stdout == "paint.zarr\n"
    same(opened(tmp_path / "paint.nc"), opened(tmp_path / "paint.zarr"))


@pytest.mark.slow
def test_a_map_says_where_its_data_are(whole, at_trial, tmp_path):
    """The explorer shows what was measured at a pixel."""
    at_trial("map", "trial/reduced/stokes.zarr", "-g", "flat", "-o", "paint.nc", *FIT, "--starts", 1, "-q")
    for path in (whole, tmp_path / "paint.nc"):
        told = MadeFrom.of(opened(path).attrs)
        assert (told.geometry, told.scale) == (("flat",), 1.0)
        source = told.open(path.parent)
        assert set(source.sizes) == {"y", "x"}
        assert (source.block({})["label"].values[SAMPLES["white"]] != 0).all()
    stored = json.loads(opened(whole).attrs["map_settings"])["input"]
    assert json.loads(json.dumps(MadeFrom.of(opened(whole).attrs).open(whole.parent).identity())) == stored


@pytest.mark.slow
def test_frames_are_reduced_first_and_not_again(at_trial, tmp_path):
    frames = (
        "map",
        "trial/frames",
        "-p",
        "trial/polarimeter.toml",
        "--angles",
        "trial/angles.csv",
        "-g",
        "flat",
    )
    at_trial(*frames, "-o", "paint.nc", *FIT, "-q")
    assert (tmp_path / "paint-reduced" / "frames" / "stokes.nc").exists()
    at_trial("map", "trial/reduced/stokes.zarr", "-g", "flat", "-o", "other.nc", *FIT, "-q")
    same(opened(tmp_path / "paint.nc"), opened(tmp_path / "other.nc"))
    again = at_trial(*frames, "-o", "paint.nc", *FIT)
    assert "newer than its frames, not reduced again" in again.stderr


@pytest.mark.slow
def test_two_workers_fill_what_one_process_fills(at_trial, tmp_path, whole):
    common = ("map", "trial/reduced/stokes.zarr", "-g", "flat", "-o", "paint.zarr", *FIT, "--unit", 8)
    first = at_trial(*common, "--worker", "1/2")
    assert "units are left to other workers" in first.stderr
    assert not (tmp_path / "paint-report").exists()
    second = at_trial(*common, "--worker", "2/2", "-q")
    assert second.stdout == "paint.zarr\n"
    assert (tmp_path / "paint-report" / "index.html").exists()
    same(opened(tmp_path / "paint.zarr"), opened(whole))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")
def test_the_workers_of_a_scheduler_fill_what_one_process_fills(at_trial, tmp_path, whole, monkeypatch):
    distributed = pytest.importorskip("distributed")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, sys.path)))
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0", silence_logs=50
    ) as cluster:
        at_trial(
            "map", "trial/reduced/stokes.zarr", "-g", "flat", "-o", "paint.zarr", *FIT, "--unit", 8,
            "--scheduler", cluster.scheduler_address, "-q",
        )  # fmt: skip
    same(opened(tmp_path / "paint.zarr"), opened(whole))


@pytest.mark.slow
def test_interrupted_it_goes_on_where_it_was(at_trial, tmp_path, whole, monkeypatch):
    common = ("map", "trial/reduced/stokes.zarr", "-g", "flat", "-o", "paint.zarr", *FIT, "--unit", 8)
    do, done = MapStore.do, []

    def stopped(self, number, progress):
        if len(done) == 3:
            raise KeyboardInterrupt
        done.append(number)
        do(self, number, progress)

    monkeypatch.setattr(MapStore, "do", stopped)
    result = at_trial(*common, code=130)
    assert result.stderr.splitlines()[-1] == (
        "pbrdf: error: interrupted; 3 of 8 units are kept in paint.zarr: the same command goes on from there"
    )
    # nothing of the other five can be taken for data, by xarray or by what reads maps
    half, complete = opened(tmp_path / "paint.zarr"), opened(whole)
    pending = half["status"].values == -1
    assert half.attrs["map_complete"] == 0 and 0 < pending.sum() < pending.size
    for name in ("estimate", "standard_error", "chi2", "degrees_of_freedom", "starts", "optima"):
        assert np.isnan(half[name].values[..., pending]).all()
        np.testing.assert_array_equal(half[name].values[..., ~pending], complete[name].values[..., ~pending])
    assert (half["flags"].values[:, pending] == FLAGS["not_yet_fitted"]).all()
    told = at_trial("identify", "paint.zarr", code=2).stderr
    assert (
        "this map is not complete: 5 of 8 units are missing; the command that began it goes on with it"
        in told
    )
    monkeypatch.setattr(
        MapStore, "do", lambda self, number, progress: (done.append(number), do(self, number, progress))
    )
    at_trial(*common, "-q")
    assert sorted(done) == list(range(8))
    same(opened(tmp_path / "paint.zarr"), opened(whole))
    at_trial(*common, "-q")
    assert len(done) == 8


@pytest.mark.slow
def test_a_signal_leaves_a_store_that_is_gone_on_with(at_trial, tmp_path, whole):
    words = ("map", "trial/reduced/stokes.zarr", "-g", "flat", "-o", "paint.zarr", *FIT, "--unit", 8)
    code = "from pbrdf.cli.main import main; main()"
    process = subprocess.Popen(
        [sys.executable, "-c", code, *map(str, words)], cwd=tmp_path, stderr=subprocess.PIPE, text=True
    )
    until = time.monotonic() + 100.0
    while not list(tmp_path.glob("paint.zarr/status/c/*/*")) and time.monotonic() < until:
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    # on a quick machine it may have been done by then
    assert process.returncode in (0, 130)
    if process.returncode == 130:
        assert "units are kept in paint.zarr: the same command goes on from there" in said
        assert "Traceback" not in said
    at_trial(*words, "-q")
    same(opened(tmp_path / "paint.zarr"), opened(whole))


@pytest.mark.slow
def test_a_map_of_other_settings_is_not_gone_on_with(at_trial, tmp_path, whole):
    (tmp_path / "paint.zarr").symlink_to(whole)
    common = ("map", "trial/reduced/stokes.zarr", "-g", "flat", "-o", "paint.zarr", *FIT)
    told = at_trial(*common, "--seed", 1, code=2)
    assert told.stderr.count("\n") == 1
    assert "begun with other settings: fit.seed: 0 in the store, 1 here" in told.stderr
    told = at_trial(*common[:4], "-o", "paint.zarr", "--no-figures", code=2).stderr
    assert "input.labels" in told


@pytest.mark.slow
def test_units_of_a_map_that_is_begun_stay(at_trial, tmp_path, whole):
    shutil.copytree(whole, tmp_path / "paint.zarr")
    common = ("map", "trial/reduced/stokes.zarr", "-g", "flat", "-o", "paint.zarr", *FIT)
    words = (
        "--unit: paint.zarr was begun in units of 8 × 8 pixels, and goes on in these; 16 × 16 are asked for"
    )
    assert words in at_trial(*common, "--unit", 16, code=2).stderr
    told = at_trial(*common, "--unit", 8).stdout
    assert "medians by part of the sample" in told


@pytest.mark.slow
def test_what_pixels_share_is_one_number_a_label_and_is_kept(at_trial, tmp_path, monkeypatch):
    common = (
        "map",
        "trial/reduced/stokes.zarr",
        "-g",
        "flat",
        "-o",
        "paint.zarr",
        *FIT,
        "--share",
        "n",
        "--unit",
        8,
    )
    done = at_trial(*common)
    found = opened(tmp_path / "paint.zarr").sel(parameter="n")
    for paint, (rows, columns) in SAMPLES.items():
        part = found.isel(y=rows, x=columns)
        value = np.unique(part["estimate"])
        assert value.size == 1
        error = float(part["standard_error"][0, 0])
        assert value[0] == pytest.approx(pbrdf.load_paint(paint).values["n"], abs=4.0 * error)
        # 64 pixels know it eight times as well as one
        assert error < 0.2 * 1.2e-3
    assert "128 of 128" in done.stdout
    monkeypatch.setattr(MapFit, "solve_shared", lambda *_: pytest.fail("found again"))
    at_trial(*common, "-q")


@pytest.fixture
def ball(tmp_path):
    """A painted ball in one picture a lamp, and where it is."""
    geometry = "sphere:x=20,y=16,r=14,light=25@90;45@210;65@330"
    from pbrdf.instruments.pixel_geometry.text_form import parse_pixel_geometry

    paint = pbrdf.DoubleGauss(sigma=0.12, n=1.6, a=0.4, k=1.2, b=0.3, t=0.6)
    pictures = painted(
        paint, parse_pixel_geometry(geometry).of(blank(32, 40, 3)), noise=0.2, scale=1000.0, seed=4
    )
    pictures.to_netcdf(tmp_path / "ball.nc", engine="h5netcdf")
    return paint, geometry


@pytest.mark.slow
def test_a_curved_sample_gives_its_paint_from_one_picture_a_lamp(run, tmp_path, ball):
    """No pixel alone tells six parameters from nine numbers as well as all of them together."""
    paint, geometry = ball
    shared = [word for name in ("sigma", "n", "k", "b", "t") for word in ("--share", name)]
    run(
        "map",
        "ball.nc",
        "-g",
        geometry,
        "--counts-per-brdf",
        1000,
        *shared,
        "-o",
        "ball.nc.zarr",
        "--no-figures",
    )
    found = opened(tmp_path / "ball.nc.zarr")
    good = found["status"].values == 0
    assert good.sum() > 300
    for name in map(str, found["parameter"].values):
        one = found.sel(parameter=name)
        pulls = ((one["estimate"] - paint.values[name]) / one["standard_error"]).values[good]
        if name == "a":
            # a part of the error is that of what all pixels share
            assert 0.3 < np.sqrt((pulls**2).mean()) < 1.3
        else:
            assert abs(pulls[0]) < 4.0, name


@pytest.mark.slow
def test_a_panel_with_perspective_under_several_lights(run, tmp_path):
    """Each pixel sees its own angles: taken for those of the middle the model would not fit."""
    from pbrdf.instruments.pixel_geometry.text_form import parse_pixel_geometry

    theta_i = "10;20;30;40;50;60;25;35;45;55"
    panel = f"theta_i={theta_i},theta_r=30,phi=0;0;0;0;0;0;90;90;90;90"
    geometry = f"flat:{panel},reference=90,fov=30"
    paint = pbrdf.DoubleGauss(sigma=0.1, n=1.55, a=0.5, k=1.1, b=0.2, t=0.5)
    pictures = painted(paint, parse_pixel_geometry(geometry).of(blank(10, 12, 10)), noise=1e-4, scale=10.0)
    pictures.to_netcdf(tmp_path / "panel.nc", engine="h5netcdf")
    common = ("map", "panel.nc", "--counts-per-brdf", 10, "--no-figures", "--starts", 16)
    run(*common, "-g", geometry, "-o", "right.nc")
    found = opened(tmp_path / "right.nc")
    good = found["status"].values == 0
    assert good.mean() > 0.95
    truth = np.array([paint.values[str(name)] for name in found["parameter"].values])
    pulls = ((found["estimate"] - truth[:, None, None]) / found["standard_error"]).values[:, good]
    assert np.nanmedian(np.abs(pulls)) == pytest.approx(0.674, abs=0.12)
    run(*common, "-g", f"flat:{panel},reference=90", "-o", "wrong.nc")
    wrong = opened(tmp_path / "wrong.nc")
    worst = {"y": 0, "x": 0}
    assert wrong["chi2"].isel(worst) > 20.0 * found["chi2"].isel(worst)


@pytest.mark.slow
def test_data_with_dimensions_of_their_own(run, tmp_path):
    """Not pictures: samples along a line, in a file with angles in degrees."""
    paint = pbrdf.DoubleGauss(sigma=0.1, n=1.55, a=0.5, k=1.1, b=0.2, t=0.5)
    theta_i, theta_r = (
        np.deg2rad(v.ravel()) for v in np.meshgrid([20.0, 40.0, 60.0], np.arange(0.0, 80.0, 8.0))
    )
    amounts = np.linspace(0.5, 0.75, 5)
    stokes = np.stack([paint.replace(a=a).stokes(theta_i, theta_r, 0.0) for a in amounts], axis=-1)
    rng = np.random.default_rng(2)
    std = 0.002 * stokes[:, 0]
    data = {
        name: (("geometry", "sample"), stokes[:, k] + std * rng.standard_normal(std.shape))
        for k, name in enumerate("IQU")
    } | {f"{name}_std": (("geometry", "sample"), std) for name in "IQU"}
    degree = {"units": "degree"}
    coords = {
        "theta_i": ("geometry", np.rad2deg(theta_i), degree),
        "theta_r": ("geometry", np.rad2deg(theta_r), degree),
        "phi": ("geometry", np.zeros(theta_i.size), degree),
        "group": ("geometry", np.zeros(theta_i.size, int)),
        "sample": ("sample", [1.0, 2.0, 4.0, 5.0, 7.0], {"units": "mm"}),
    }
    attrs = {
        "quantity": "brdf",
        "stokes_convention": "p-s",
        "illumination": [1.0, 0.0, 0.0, 0.0],
        "simulated": 1,
    }
    xr.Dataset(data, coords, attrs).to_netcdf(tmp_path / "samples.nc", engine="h5netcdf")
    told = run("map", "samples.nc", "-o", "samples.zarr", "--fix", "n=1.55").stdout
    assert "5 of 5 measured pixels" in told
    found = opened(tmp_path / "samples.zarr")
    np.testing.assert_array_equal(found["sample"], [1.0, 2.0, 4.0, 5.0, 7.0])
    a = found.sel(parameter="a")
    assert (np.abs((a["estimate"] - amounts) / a["standard_error"]) < 5.0).all()
    assert "Simulated data" in (tmp_path / "samples-report" / "index.html").read_text(encoding="utf-8")
    refused = run("map", "samples.nc", "-g", "flat", code=2).stderr
    assert "a geometry is one too many" in refused


def line_of_samples():
    """Data of 3 samples without any noise, as a file holds them."""
    theta_i, theta_r, phi = np.full(12, 30.0), np.linspace(0.0, 66.0, 12), np.tile([0.0, 180.0], 6)
    stokes = pbrdf.DoubleGauss(sigma=0.1, n=1.55, a=0.5, k=1.1, b=0.2, t=0.5).stokes(
        *np.deg2rad([theta_i, theta_r, phi])
    )
    data = {
        name: (("geometry", "sample"), np.repeat(stokes[:, [k]], 3, axis=1)) for k, name in enumerate("IQU")
    } | {f"{name}_std": (("geometry", "sample"), np.full((12, 3), 1e-3)) for name in "IQU"}
    angles = {"theta_i": theta_i, "theta_r": theta_r, "phi": phi}
    coords = {name: ("geometry", values, {"units": "degree"}) for name, values in angles.items()}
    attrs = {"quantity": "brdf", "stokes_convention": "p-s", "illumination": [1.0, 0, 0, 0], "simulated": 1}
    return xr.Dataset(data, {**coords, "group": ("geometry", np.zeros(12, int))}, attrs)


def written(ds, path):
    ds.to_netcdf(path, engine="h5netcdf")
    return path.read_bytes()


@pytest.mark.slow
def test_not_one_pixel_has_a_result_is_exit_code_3(run, tmp_path):
    written(line_of_samples().map(lambda values: values * np.nan, keep_attrs=True), tmp_path / "none.nc")
    told = run("map", "none.nc", "-o", "none.zarr", "--no-figures", code=3)
    assert "No pixel was measured." in told.stdout
    assert (opened(tmp_path / "none.zarr")["status"] == 4).all()


def test_a_map_is_not_put_in_the_place_of_what_it_is_made_from(refused, tmp_path):
    before = written(line_of_samples(), tmp_path / "data.nc")
    (tmp_path / "link.nc").symlink_to("data.nc")
    for name in ("data.nc", "link.nc"):
        words = f"--output {name}: the map is made from this file; choose another name"
        assert words in refused("map", "data.nc", "-o", name)
    assert (tmp_path / "data.nc").read_bytes() == before


def test_refused_data_name_their_file(refused, tmp_path):
    whole = line_of_samples()
    written(whole.isel(sample=slice(0, 0)), tmp_path / "empty.nc")
    assert "empty.nc: has no pixels, 0 (sample)" in refused("map", "empty.nc", "-o", "x.zarr")
    written(whole.drop_attrs(deep=False), tmp_path / "bare.nc")
    assert "bare.nc: the data set does not follow the schema" in refused("map", "bare.nc", "-o", "x.zarr")
    written(whole, tmp_path / "data.nc")
    assert "data.nc: holds data, which say themselves" in refused("map", "data.nc", "--counts-per-brdf", 10)
    assert not (tmp_path / "x.zarr").exists()


@pytest.mark.slow
def test_another_command_on_a_store_is_refused_before_what_pixels_share_is_sought(run, tmp_path, monkeypatch):
    written(line_of_samples(), tmp_path / "data.nc")
    common = ("map", "data.nc", "-o", "x.zarr", "--no-figures", "--fix", "n=1.55", "--share")
    run(*common, "k", "-q")
    before = (tmp_path / "x-shared.npz").read_bytes()
    monkeypatch.setattr(MapFit, "solve_shared", lambda *_: pytest.fail("sought"))
    assert (
        'x.zarr: this map was begun with other settings: fit.share[0]: "k"'
        in run(*common, "b", code=2).stderr
    )
    assert (tmp_path / "x-shared.npz").read_bytes() == before
    run(*common, "k", "-q")


@pytest.mark.slow
def test_too_few_values_are_told_before_the_fit(run, tmp_path):
    pictures = blank(4, 4, 1)
    pictures.to_netcdf(tmp_path / "few.nc", engine="h5netcdf")
    told = run(
        "map", "few.nc", "-g", "flat:theta_i=30,theta_r=30,phi=0,reference=90", "-o", "few.nc.zarr", code=2
    )
    assert "cannot determine" in told.stderr


@pytest.mark.slow
def test_the_film_polarisers_as_far_as_one_picture_goes(run, tmp_path, measured):
    """One raw frame of a real camera: amplitude and share of unpolarised body light at some pixels of a polariser."""
    frame = measured("dofp-polarizers/polarizer_IMX250MZR.png")
    regions = tmp_path / "regions.csv"
    regions.write_text("name,x0,x1,y0,y1\nfirst,185,205,538,558\nwall,140,160,240,260\n", encoding="utf-8")
    fixed = [
        word
        for name, value in (("n", 1.5), ("sigma", 0.2), ("k", 1), ("b", 0))
        for word in ("--fix", f"{name}={value}")
    ]
    told = run(
        "map", frame, "-p", "sony_imx250mzr", "-g", "flat:theta_i=30,theta_r=30,phi=0,reference=90", *fixed,
        "--labels", "regions.csv", "-o", "film.nc", "--no-figures",
    )  # fmt: skip
    found = opened(tmp_path / "film.nc")
    assert found.sizes == {"parameter": 2, "y": 1024, "x": 1224}
    assert (found["status"] != PixelStatus.MASKED).sum() == 800
    assert "measured pixels have a result" in told.stdout
    bright = found["estimate"].sel(parameter="a").where(found["status"] == 0)
    # the film lets less than half of the light through
    assert float(bright[240:260, 140:160].median()) > 2.0 * float(bright[538:558, 185:205].median())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("ball.nc",), "Stokes pictures need the geometry of their pixels, for example flat:theta_i=30"),
        (("ball.nc", "-g", "cube"), "--geometry: geometry 'cube': begin with one of flat, sphere, cylinder"),
        (("ball.nc", "-g", "flat:theta_i=a"), "--geometry: flat: theta_i is 'a', not a number"),
        (("none.nc", "-g", "flat"), "none.nc: there is no such file"),
        (
            ("ball.nc", "-g", "flat", "-o", "x.tif"),
            "--output x.tif: a map is a store (.zarr), or a file (.nc)",
        ),
        (("ball.nc", "-g", "flat", "-o", "no/x.zarr"), "no/x.zarr: there is no folder no"),
        (("ball.nc", "--worker", "3/2"), "--worker '3/2': give i/N, counted from 1"),
        (("ball.nc", "--worker", "half"), "--worker 'half': give i/N, counted from 1"),
        (("ball.nc", "--worker", "1/2", "--scheduler", "tcp://a:1"), "give one of the two"),
        (("ball.nc", "--worker", "1/2", "-o", "x.nc"), "several workers fill a store"),
        (("ball.nc", "--counts-per-brdf", "0"), "--counts-per-brdf 0: it must be more than 0"),
        (("ball.nc", "--counts-per-brdf=-3"), "--counts-per-brdf -3: it must be more than 0"),
        (
            ("ball.nc", "-g", "{}", "--labels", "wide.npy"),
            "wide.npy: region '1099511627776': a label has at most 32",
        ),
        (("dark.nc", "-g", "sphere:light=40@90"), "the geometry of dark.nc: no round outline"),
        (("ball.nc", "--angles", "a.csv"), "--angles belongs to --polarimeter"),
        (("ball.nc", "-g", "{}", "--share", "kappa"), "share: 'kappa' is not a free parameter"),
        (("ball.nc", "-g", "{}", "--fix", "m=1"), "has no parameter"),
        (
            ("ball.nc", "-g", "{}", "--labels", "small.png"),
            "small.png",
        ),
        (("ball.nc", "-g", "{}", "--labels", "none.toml"), "none.toml"),
        (("ball.nc", "-g", "{}", "-g", "{}"), "2 geometries for 1 files"),
        (("ball.nc", "-g", "{}", "--figure-format", "gif"), "--figure-format 'gif'"),
        (("ball.nc", "-g", "{}", "--max-memory", "much"), "--max-memory 'much': give a size such as 200MB"),
        (
            ("one.csv", "-g", "flat"),
            "one.csv: is neither netCDF nor a Zarr folder, and a map is made of pictures",
        ),
    ],
)
def test_refusals_are_one_line(refused, tmp_path, ball, arguments, words):
    Image.fromarray(np.zeros((3, 3), np.uint8)).save(tmp_path / "small.png")
    np.save(tmp_path / "wide.npy", np.full((32, 40), 2**40))
    written(blank(12, 12, 1), tmp_path / "dark.nc")
    (tmp_path / "one.csv").write_text("theta_i,theta_r,phi,I\n30,10,0,1\n", encoding="utf-8")
    filled = [word.replace("{}", ball[1]) for word in arguments]
    assert words in refused("map", *filled)


def test_units_are_as_large_as_the_memory_holds():
    from pbrdf.cli.map import _units

    shape = (42, 1000, 1200)
    one = np.broadcast_to(np.zeros(()), shape)
    dims = ("geometry", "y", "x")
    outline = xr.Dataset(dict.fromkeys(("I", "Q", "U", "I_std", "Q_std", "U_std"), (dims, one)))
    assert _units(outline, ("y", "x"), None, 2 * 10**9).shard == (256, 256)
    small = _units(outline, ("y", "x"), None, 10**8)
    assert 10**8 / 4 < np.prod(small.shard) * 42 * 6 * 32 <= 10**8
    assert _units(outline, ("y", "x"), 1100, 10**6).shard == (1000, 1100)


def test_settings_of_a_map_are_json(ball, tmp_path):
    """So that a store can say which one differs."""
    from pbrdf.instruments.pixel_geometry.text_form import parse_pixel_geometry
    from pbrdf.inversion.map_store.picture_source import PictureSource

    source = PictureSource.open([tmp_path / "ball.nc"], [parse_pixel_geometry(ball[1])], scale=1000.0)
    identity = json.loads(json.dumps(source.identity()))
    assert identity["geometry"][0]["kind"] == "Sphere"
    assert identity["geometry"][0]["r"] == 14.0
    assert identity["scale"] == 1000.0
    again = PictureSource.open([tmp_path / "ball.nc"], [parse_pixel_geometry(ball[1])], scale=1000.0)
    assert again.identity() == source.identity()
