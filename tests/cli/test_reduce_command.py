"""``pbrdf reduce``: from files of raw frames to a folder of results, and to the parameters of the paint."""

import csv
import json

import numpy as np
import pytest
import tifffile
import xarray as xr
from PIL import Image

import pbrdf
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.polarimeter.instrument_files import save_instrument
from pbrdf.instruments.polarimeter.polarimeter import division_of_focal_plane, lcvr
from pbrdf.instruments.polarimeter.retardance_sets import retardance_set
from pbrdf.optics.elements import rotate_frame

STATES = ("s1", "s2", "s3", "s4")
PAINT = "matte-white-thick"
#: Rows and columns of the pictures; the sample lies in the columns 5 … 24, a grey reference in 30 … 34.
ROWS, COLUMNS = 16, 40
ROI = ("--roi", "paint=5:25,2:14")


def write_png(folder, raw, names, states):
    for series, frames in zip(names, raw, strict=True):
        for state, picture in zip(states, frames, strict=True):
            Image.fromarray(picture).save(folder / f"{series}_{state}.png")


def write_folders(folder, raw, names, states):
    for series, frames in zip(names, raw, strict=True):
        (folder / series).mkdir()
        for state, picture in zip(states, frames, strict=True):
            tifffile.imwrite(folder / series / f"{state}.tif", picture, compression="zlib")


def write_stacks(folder, raw, names, states):
    for series, frames in zip(names, raw, strict=True):
        tifffile.imwrite(folder / f"{series}.tif", frames, photometric="minisblack")


def write_arrays(folder, raw, names, states):
    for series, frames in zip(names, raw, strict=True):
        np.save(folder / f"{series}.npy", frames)


def gridded(raw, names, states):
    coords = {"series": list(names), "state": list(states)}
    return xr.Dataset({"frames": (("series", "state", "y", "x"), raw)}, coords)


@pytest.fixture(scope="module")
def measurement():
    """Frames (M, 4, rows, columns) of a paint in the plane of incidence, their names, and angles in degrees."""
    polarimeter = lcvr(retardance_set("tetrahedron"))
    object.__setattr__(polarimeter, "states", STATES)
    detector = Detector(bits=12, gain=3.0, read_noise=5.0, offset=80.0)
    instrument = Instrument(polarimeter, detector, reference_angle=np.deg2rad(25.0))
    theta_i, theta_r = [], []
    for bistatic in (60, 80, 100):
        for incidence in np.arange(bistatic / 2 - 20, bistatic / 2 + 21, 4):
            theta_i.append(incidence)
            theta_r.append(bistatic - incidence)
    theta_i, theta_r = np.array(theta_i), np.array(theta_r)
    stokes = pbrdf.load_paint(PAINT).stokes(np.deg2rad(theta_i), np.deg2rad(theta_r), 0.0)
    stokes = np.asarray(stokes) * np.cos(np.deg2rad(theta_i))[:, None]
    # exposures to four digits, at which the brightest state comes to about 3000 digital numbers
    seen = stokes @ rotate_frame(instrument.reference_angle).T
    light = seen @ polarimeter.analyzer.T
    exposure = np.array([float(f"{e:.4g}") for e in 3000.0 / light.max(axis=1)])
    raw = np.empty((len(light), 4, ROWS, COLUMNS), np.uint16)
    draw = np.random.default_rng(11)
    signal = np.zeros((len(light), 4, ROWS, COLUMNS))
    signal[..., 5:25] = (light * exposure[:, None])[..., None, None]
    signal[..., 30:35] = 400.0
    raw[:] = detector.expose(signal, draw)
    # dirt that must not count: saturated pixels on the sample
    raw[:, :, 5:7, 8:10] = 4095
    names = [f"p{1 + k // 11}_{k % 11:02d}" for k in range(len(light))]
    return instrument, raw, names, (theta_i, theta_r, exposure)


@pytest.fixture
def setup(tmp_path, measurement):
    """Write instrument, angles and frames; returns the names of series and the raw frames."""
    instrument, raw, names, (theta_i, theta_r, exposure) = measurement
    save_instrument(instrument, tmp_path / "imager.toml")
    rows = zip(names, theta_i, theta_r, exposure, strict=True)
    lines = [f"{n},{i},{r},0,{n[1]},{e}" for n, i, r, e in rows]
    header = "series,theta_i_deg,theta_r_deg,phi_deg,group,exposure"
    (tmp_path / "angles.csv").write_text("\n".join([header, *lines]) + "\n")
    return raw, names


def arguments(frames, *more):
    return ("reduce", frames, "-p", "imager.toml", "--angles", "angles.csv", *ROI, *more)


@pytest.mark.slow
def test_from_frames_to_the_parameters_of_the_paint(run, tmp_path, setup):
    """Frames of a known paint, written as PNG, reduced and fitted by the command line: its parameters come back."""
    raw, names = setup
    (tmp_path / "frames").mkdir()
    write_png(tmp_path / "frames", raw, names, STATES)
    result = run(*arguments("frames", "-o", "out", "--maps", "none", "--no-pictures"))
    assert {p.name for p in (tmp_path / "out").iterdir()} == {"summary.csv", "paint.csv"}
    assert "33 series of 4 states, 40 × 16 pixels" in result.stdout
    dataset = pbrdf.read(tmp_path / "out" / "paint.csv")
    assert dataset.sizes["geometry"] == 33
    assert dataset.attrs["masked_pixels"] == f"saturated {33 * 4}, dead 0, dark 0 of {33 * 240}"
    assert np.isfinite(dataset["covariance"].values).all()
    run("fit", "out/paint.csv", "--fix", "t=0.6717", "--starts", 8, "--quiet", "-o", "fit")
    record = json.loads((tmp_path / "fit" / "fit.json").read_text(encoding="utf-8"))
    truth = dict(zip(("sigma", "n", "a", "k", "b"), pbrdf.PAINTS[PAINT], strict=False))
    for name, value in truth.items():
        estimate = record["estimates"][name]
        assert estimate["verdict"] == "determined"
        assert abs(estimate["value"] - value) < 4.0 * estimate["standard_error"]
        assert estimate["standard_error"] < 0.02 * abs(value) + 0.01
    assert 0.6 < record["goodness"]["reduced_chi2"] < 1.5


@pytest.mark.slow
@pytest.mark.parametrize("form", ["folders", "stacks", "arrays", "npy", "tif", "nc", "zarr"])
def test_every_kind_of_file_gives_the_same(run, tmp_path, setup, form):
    raw, names = setup
    frames = tmp_path / "frames"
    frames.mkdir()
    write_png(frames, raw, names, STATES)
    run(*arguments("frames", "-o", "png", "--maps", "none", "--no-pictures"))
    other = tmp_path / "other"
    if form in ("folders", "stacks", "arrays"):
        other.mkdir()
        {"folders": write_folders, "stacks": write_stacks, "arrays": write_arrays}[form](
            other, raw, names, STATES
        )
    else:
        other = tmp_path / f"other.{form}"
        # a file of numbers alone has no names: the series are counted from 1
        if form == "npy":
            np.save(other, raw)
        elif form == "tif":
            tifffile.imwrite(other, raw, photometric="minisblack")
        elif form == "nc":
            gridded(raw, names, STATES).to_netcdf(other, engine="h5netcdf")
        else:
            pytest.importorskip("zarr")
            gridded(raw, names, STATES).to_zarr(other, zarr_format=2, consolidated=False)
        if form in ("npy", "tif"):
            table = (tmp_path / "angles.csv").read_text()
            for k, name in enumerate(names, 1):
                table = table.replace(f"\n{name},", f"\n{k},")
            (tmp_path / "angles.csv").write_text(table)
    run(*arguments(other.name, "-o", "out", "--maps", "none", "--no-pictures"))
    expected, found = (pbrdf.read(tmp_path / folder / "paint.csv") for folder in ("png", "out"))
    xr.testing.assert_equal(found, expected)


@pytest.mark.slow
def test_everything_that_is_written(run, tmp_path, setup):
    raw, _ = setup
    np.save(tmp_path / "run.npy", raw)
    (tmp_path / "roi.toml").write_text("[grey]\nrectangle = [30, 35, 0, 16]\n")
    result = run(
        "reduce", "run.npy", "-p", "imager.toml", "--series", "3,1,2", "--regions", "roi.toml", *ROI,
        "--max-memory", "1MB", "--dark-level", "20",
    )  # fmt: skip
    folder = tmp_path / "run-reduced"
    expected = {"summary.csv", "stokes.nc", "overview.png", "picture_1.png", "picture_2.png", "picture_3.png"}
    assert {p.name for p in folder.iterdir()} == expected
    assert "Written to run-reduced/: summary.csv, stokes.nc, overview.png" in result.stdout
    assert "Saturated pixels are left out" in result.stdout
    with xr.open_dataset(folder / "stokes.nc", engine="h5netcdf") as file:
        assert file["series"].values.tolist() == ["3", "1", "2"]
        flags = file["flags"].values
        grey = file["I"].values[:, :, 30:35]
    assert (flags[:, :, :5] == 4).all()  # no light there: dark
    assert (flags[:, 5:7, 8:10] == 1).all()
    with (folder / "summary.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["series"], row["region"]) for row in rows[:4]] == [
        ("3", "(whole picture)"), ("3", "grey"), ("3", "paint"), ("1", "(whole picture)"),
    ]  # fmt: skip
    assert float(rows[1]["I"]) == pytest.approx(grey[0].mean(), rel=1e-5)
    assert (rows[2]["pixels"], rows[2]["good"], rows[2]["saturated"]) == ("240", "236", "4")
    # the grey reference is natural light of 800 digital numbers
    assert float(rows[1]["I"]) == pytest.approx(800.0, abs=4.0 * float(rows[1]["I_std"]))
    assert float(rows[1]["dolp"]) < 5.0 * float(rows[1]["dolp_std"])


def test_a_mosaic_and_a_built_in_instrument(run, tmp_path):
    layout = np.deg2rad([[90.0, 45.0], [135.0, 0.0]])
    polarimeter = division_of_focal_plane(layout)
    light = polarimeter.intensities(np.broadcast_to([[150.0], [60.0], [-30.0], [0.0]], (4, 300))).reshape(
        4, 15, 20
    )
    picture = np.zeros((30, 40), np.uint8)
    draw = np.random.default_rng(1)
    for k, (y, x) in enumerate(((0, 0), (0, 1), (1, 0), (1, 1))):
        picture[y::2, x::2] = Detector(bits=8, gain=41.0, read_noise=2.5).expose(light[k], draw)
    Image.fromarray(picture).save(tmp_path / "shot.png")
    result = run("reduce", "shot.png", "-p", "sony_imx250mzr", "--no-pictures")
    assert "1 series of 4 states, 20 × 15 pixels" in result.stdout
    with (tmp_path / "shot-reduced" / "summary.csv").open(encoding="utf-8", newline="") as file:
        (row,) = csv.DictReader(file)
    assert float(row["aolp_deg"]) == pytest.approx(0.5 * np.rad2deg(np.arctan2(-30, 60)), abs=0.5)
    assert row["V"] == "nan"


@pytest.mark.slow
def test_quiet_and_into_a_folder_that_is_there(run, tmp_path, setup):
    raw, _ = setup
    np.save(tmp_path / "run.npy", raw[:1])
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "notes.txt").write_text("keep")
    (tmp_path / "out" / "summary.csv").write_text("old")
    for _ in range(2):
        result = run("reduce", "run.npy", "-p", "imager.toml", "-o", "out", "--maps", "nc", "-q")
        assert result.stdout == "out\n"
    assert (tmp_path / "out" / "notes.txt").read_text() == "keep"
    assert (tmp_path / "out" / "summary.csv").read_text().startswith("series,region")


@pytest.mark.slow
def test_zarr_is_replaced_as_a_whole(run, tmp_path, setup):
    pytest.importorskip("zarr")
    raw, _ = setup
    for count in (2, 1):
        np.save(tmp_path / "run.npy", raw[:count])
        run("reduce", "run.npy", "-p", "imager.toml", "-o", "out", "--maps", "zarr", "--no-pictures", "-q")
        with xr.open_dataset(tmp_path / "out" / "stokes.zarr", engine="zarr", consolidated=False) as file:
            assert file.sizes == {"series": count, "y": ROWS, "x": COLUMNS}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("-p", "none.toml"), "none.toml: cannot be read"),
        (
            ("-p", "papers"),
            "papers: there is no such file, and no built-in instrument of that name: paper",
        ),
        (("-p", "paper"), "a pixel reads"),
        (("--roi", "paint"), "--roi 'paint': give NAME=VALUE, for example --roi paint=100:200,150:260"),
        (("--roi", "paint=1:2"), "--roi paint: '1:2' is no region"),
        (("--roi", "paint=0:100,0:5"), "region 'paint'"),
        (("--roi", "(whole picture)=0:5,0:5"), "region '(whole picture)': this cannot be its name"),
        (("--roi", "two\nlines=0:5,0:5"), r"region 'two\nlines': this cannot be its name"),
        (("--dark-level", "nan"), "--dark-level nan: give a number"),
        (("--angles", "angles.csv"), "--angles: say which part of the picture is the sample"),
        (("--angles", "few.csv", *ROI), "the angle table has no row for the series '2'"),
        (("--series", "1,1"), "series '1', '1': give one or more, each once"),
        (("--series", "7"), "there is no series '7'; there are '1', '2', '3'"),
        (("--max-memory", "lots"), "--max-memory 'lots': give a size such as 200MB or 2GB"),
        (("--max-memory", "10KB"), "at least 1MB is needed"),
        (("--maps", "tif"), "--maps 'tif': choose nc, zarr or none"),
        (("--datasets", "xls"), "--datasets 'xls': choose csv or nc"),
        (("-o", "imager.toml"), "there is a file of that name"),
    ],
)
def test_mistakes_are_one_line_and_leave_nothing(refused, tmp_path, setup, options, message):
    raw, _ = setup
    np.save(tmp_path / "run.npy", raw[:3])
    (tmp_path / "few.csv").write_text("series,theta_i,theta_r\n1,10,20\n")
    polarimeter = () if "-p" in options else ("-p", "imager.toml")
    assert message in refused("reduce", "run.npy", *polarimeter, *options)


@pytest.mark.parametrize("angles", ["0", "0, 60"])
def test_states_that_do_not_determine_the_intensity_are_refused(refused, tmp_path, setup, angles):
    raw, _ = setup
    count = angles.count(",") + 1
    np.save(tmp_path / "run.npy", raw[0, :count])
    (tmp_path / "few.toml").write_text(
        f"[polarimeter]\nkind = 'rotating_polarizer'\nangles = [{angles}]\n[detector]\nbits = 16\n"
    )
    message = refused("reduce", "run.npy", "-p", "few.toml")
    assert f"its {count} state(s) {angles} do not determine the intensity: add states" in message
    for command in (("plan", "white"), ("measure", "white")):
        assert "do not determine the intensity" in refused(*command, "--instrument", "few.toml")


def test_results_do_not_go_among_the_frames(refused, tmp_path, setup):
    raw, names = setup
    (tmp_path / "frames").mkdir()
    write_png(tmp_path / "frames", raw[:1], names[:1], STATES)
    message = refused("reduce", "frames", "-p", "imager.toml", "-o", "./frames/")
    assert "--output frames: the frames are in this folder" in message


def test_a_broken_picture_in_the_middle_leaves_nothing(refused, tmp_path, setup):
    raw, names = setup
    (tmp_path / "frames").mkdir()
    write_png(tmp_path / "frames", raw[:3], names[:3], STATES)
    broken = tmp_path / "frames" / f"{names[2]}_s2.png"
    broken.write_bytes(broken.read_bytes()[:-500])
    message = refused("reduce", "frames", "-p", "imager.toml")
    assert f"{names[2]}_s2.png: cannot be read as a picture" in message
