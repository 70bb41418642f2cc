"""Means of exposures and repeated exposures: the noise that is left, and saturation."""

from __future__ import annotations

import numpy as np
import pytest
import tifffile
from PIL import Image

from pbrdf.errors import DataError
from pbrdf.instruments.frames.exposures import combine
from pbrdf.instruments.frames.frame_files import open_frames
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.polarimeter.polarimeter import division_of_focal_plane, rotating_polarizer
from pbrdf.instruments.reduction.reduce import reduce
from pbrdf.instruments.reduction.region_averages import RegionCollector
from pbrdf.instruments.reduction.regions import Rectangle

ANGLES = (0, 45, 90, 135)
STATES = tuple(map(str, ANGLES))
#: Case L1: I 3000, Q 900, U 300.
LIGHT = np.array([3000.0, 900.0, 300.0, 0.0])
DOLP = np.hypot(900.0, 300.0) / 3000.0
DETECTOR = Detector(bits=12, gain=2.5, read_noise=4.0)
POLARIMETER = rotating_polarizer(np.deg2rad(ANGLES))
SIZE = 16


def shots(count, detector=DETECTOR, seed=0, light=LIGHT, size=SIZE):
    """Exposures of even light, shape (count, 4, rows, columns)."""
    signal = POLARIMETER.intensities(light)[:, None, None] * np.ones((4, size, size))
    return detector.expose(np.broadcast_to(signal, (count, *signal.shape)), np.random.default_rng(seed))


def instrument(**frames):
    return Instrument(POLARIMETER, DETECTOR, frames=frames)


def average(path, instrument):
    frames = open_frames(path, instrument)
    sink = RegionCollector({"all": Rectangle(0, frames.columns, 0, frames.rows)}, frames, instrument)
    reduce(frames, instrument, [sink])
    return sink.averages()["all"][0]


def dolp(mean):
    return np.hypot(*mean.stokes[1:3]) / mean.stokes[0]


@pytest.mark.parametrize("kind", ["npy", "tif"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.uint16])
def test_means_of_exposures(tmp_path, kind, dtype):
    """Case L1: the noise is that of a hundredth of the exposures' variance, and 1/12 more if means were rounded."""
    raw = shots(100)
    means = raw.mean(axis=0)
    means = np.round(means).astype(dtype) if dtype is np.uint16 else means.astype(dtype)
    if kind == "npy":
        np.save(tmp_path / "f.npy", means[None])
    else:
        tifffile.imwrite(tmp_path / "f.tif", means, photometric="minisblack")
    found = average(tmp_path / f"f.{kind}", instrument(exposures=100))
    assert found.stokes[0] == pytest.approx(3000, abs=1.0)
    assert dolp(found) == pytest.approx(DOLP, abs=5e-4)
    np.save(tmp_path / "one.npy", raw[:1])
    one = average(tmp_path / "one.npy", instrument())
    rounding = 1 / 12 if dtype is np.uint16 else 0.0
    # I from four states: half their sum
    expected = one.noise[0, 0] / 100 + rounding / SIZE**2
    assert found.noise[0, 0] == pytest.approx(expected, rel=0.01)
    # and so much do the pixels differ
    assert found.scatter[0] ** 2 == pytest.approx(found.noise[0, 0] * SIZE**2, rel=0.25)


def test_means_of_saturated_exposures():
    """Half of the exposures clipped: the mean reads less than the end of the range, and is marked; a mean three
    standard deviations below the end is not."""
    dim = Detector(bits=12, gain=0.5, read_noise=4.0)
    sigma = float(np.sqrt(dim.variance(4095.0)))
    rng = np.random.default_rng(0)
    for level, marked in ((4095.0, True), (4095.0 - 4.0 * sigma, False)):
        single = dim.expose(np.full((200, 1, 4, 4), level), rng)
        mean = combine(single.mean(axis=0), dim, 200)
        assert mean.saturated.all() == marked
        assert mean.numbers.max() < 4094.0 or not marked


def written(folder, raw, kind):
    """Repeats of four states in the ways they may be kept; the [frames] that says so."""
    repeats = len(raw)
    if kind == "names":
        for k in range(repeats):
            for n, state in enumerate(STATES):
                Image.fromarray(raw[k, n]).save(folder / f"p1_{state}_{k + 1}.png")
        return folder, {"pattern": "{series}_{state}_{repeat}.png"}
    if kind == "folders":
        for k in range(repeats):
            (folder / f"shot{k}").mkdir()
            for n, state in enumerate(STATES):
                Image.fromarray(raw[k, n]).save(folder / f"shot{k}" / f"{state}.png")
        return folder, {"pattern": "{repeat}/{state}.png"}
    if kind == "pages":
        for n, state in enumerate(STATES):
            tifffile.imwrite(folder / f"p1_{state}.tif", raw[:, n], photometric="minisblack")
        return folder, {"pages": "repeats"}
    if kind == "netcdf":
        import xarray as xr

        xr.Dataset({"frames": (("repeat", "state", "y", "x"), raw)}).to_netcdf(
            folder / "p1.nc", engine="h5netcdf"
        )
        return folder / "p1.nc", {}
    order = raw if kind == "repeat, state" else raw.swapaxes(0, 1)
    tifffile.imwrite(folder / "p1.tif", order.reshape(-1, *raw.shape[2:]), photometric="minisblack")
    return folder / "p1.tif", {"pages": kind}


@pytest.mark.parametrize("kind", ["names", "folders", "pages", "netcdf", "repeat, state", "state, repeat"])
def test_repeated_exposures(tmp_path, kind):
    """Their mean is what is reduced and their scatter is the noise, whatever the detector's numbers say: here it is
    said to be ten times as noisy as it is."""
    raw = shots(5)
    path, table = written(tmp_path, raw, kind)
    told = Instrument(POLARIMETER, Detector(bits=12, gain=0.025, read_noise=4.0), frames=table)
    frames = open_frames(path, told)
    np.testing.assert_array_equal(frames.read(0, 0, SIZE), raw)
    np.testing.assert_array_equal(frames.read(0, 3, 7), raw[:, :, 3:7])
    found = average(path, told)
    means = raw.mean(axis=0).mean(axis=(1, 2))
    assert found.stokes[0] == pytest.approx(0.5 * means.sum())
    scatter = raw.var(axis=0, ddof=1).mean(axis=(1, 2)) / 5
    # four states weighing alike on the mean: I is half their sum
    assert found.noise[0, 0] * SIZE**2 == pytest.approx(0.25 * scatter.sum(), rel=0.05)
    true = DETECTOR.variance(POLARIMETER.intensities(LIGHT)).sum() / 4 / 5
    assert found.noise[0, 0] * SIZE**2 == pytest.approx(true, rel=0.1)


def test_repeats_that_differ_as_a_whole(tmp_path):
    """Light that changes by 1 % from picture to picture is named with its size; steady light is not."""
    flicker = 1.0 + 0.01 * np.random.default_rng(5).normal(size=(40, 4))
    signal = POLARIMETER.intensities(LIGHT) * flicker
    even = np.broadcast_to(signal[:, :, None, None], (40, 4, SIZE, SIZE))
    for raw, size in ((DETECTOR.expose(even, np.random.default_rng(0)), flicker.std()), (shots(40), None)):
        np.save(tmp_path / "p.npy", raw)
        frames = open_frames(tmp_path / "p.npy", instrument(pages="repeat, state"))
        frames.read(0, 0, 9)
        frames.read(0, 9, SIZE)
        if size is None:
            assert frames.notes == []
            continue
        (note,) = frames.notes
        assert "differ by" in note
        assert float(note.split("differ by ")[1].split("%")[0]) == pytest.approx(100 * size, rel=0.15)
        stability = float(note.split("stability = ")[1].split()[0])
        assert stability == pytest.approx(size / np.sqrt(40), rel=0.15)
        steady = Instrument(POLARIMETER, DETECTOR, stability=0.01, frames={"pages": "repeat, state"})
        told = open_frames(tmp_path / "p.npy", steady)
        told.read(0, 0, SIZE)
        assert told.notes == []


def test_repeats_of_several_series_in_one_file(tmp_path):
    raw = np.stack([shots(3, seed=s) for s in range(2)])
    np.save(tmp_path / "five.npy", raw)
    frames = open_frames(tmp_path / "five.npy", instrument(pages="series, repeat, state", repeats=3))
    assert frames.names == ("1", "2")
    np.testing.assert_array_equal(frames.read(1, 0, SIZE), raw[1])
    tifffile.imwrite(tmp_path / "flat.tif", raw.reshape(-1, SIZE, SIZE), photometric="minisblack")
    # repeats alone: series, repeat, state
    frames = open_frames(tmp_path / "flat.tif", instrument(repeats=3))
    np.testing.assert_array_equal(frames.read(1, 0, SIZE), raw[1])
    swapped = raw.transpose(2, 0, 1, 3, 4).reshape(-1, SIZE, SIZE)
    tifffile.imwrite(tmp_path / "swapped.tif", swapped, photometric="minisblack")
    frames = open_frames(tmp_path / "swapped.tif", instrument(pages="state, series, repeat", repeats=3))
    np.testing.assert_array_equal(frames.read(0, 0, SIZE), raw[0])


def test_a_pixel_saturated_in_one_of_the_repeats_is_saturated():
    raw = shots(3)
    raw[1, 2, 0, 0] = 4095
    reading = combine(raw, DETECTOR)
    assert reading.saturated[2, 0, 0]
    assert reading.saturated.sum() == 1


def test_repeats_of_a_mosaic(tmp_path):
    camera = division_of_focal_plane(np.deg2rad([[90.0, 45.0], [135.0, 0.0]]))
    rng = np.random.default_rng(0)
    raw = rng.integers(100, 4000, (3, 8, 8)).astype(np.uint16)
    for k in range(3):
        Image.fromarray(raw[k]).save(tmp_path / f"a-{k}.png")
    told = Instrument(camera, DETECTOR, frames={"pattern": "{series}-{repeat}.png"})
    frames = open_frames(tmp_path, told)
    assert (frames.names, frames.states) == (("a",), 4)
    np.testing.assert_array_equal(frames.read(0, 0, 4)[:, 3], raw[:, 1::2, 1::2])


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"pages": "series"}, "pages leaves out the states"),
        ({"pages": "picture"}, "pages is 'picture': name what follows"),
        ({"pages": "state, state"}, "each once"),
        ({"pages": "series, repeat, state"}, "does not say how many repeats there are: set repeats"),
        ({"repeats": 7}, "it holds 12 pictures, .* 7 times"),
        ({"repeats": 0}, "repeats is 0: give a whole number from 1"),
        ({"pages": "series, state", "repeats": 3}, "pages does not say where: add repeat"),
        ({"exposure": 3}, r"there is no such key \(perhaps 'exposures'\)"),
    ],
)
def test_what_is_not_said_of_a_stack(tmp_path, table, message):
    np.save(tmp_path / "run.npy", shots(3).reshape(12, SIZE, SIZE))
    with pytest.raises(DataError, match=message):
        open_frames(tmp_path / "run.npy", instrument(**table))


def test_pages_that_nobody_spoke_of(tmp_path):
    """A file of several pages for each state is not read as one page."""
    for n, state in enumerate(STATES):
        tifffile.imwrite(tmp_path / f"p1_{state}.tif", shots(3)[:, n], photometric="minisblack")
    with pytest.raises(
        DataError, match='holds 3 pictures, not 1; if they are repeated exposures, set pages = "repeat"'
    ):
        open_frames(tmp_path, instrument())
    for n, state in enumerate(STATES):
        Image.fromarray(shots(1)[0, n]).save(tmp_path / f"p1_{state}_1.png")
    with pytest.raises(DataError, match=r"with {repeat} for exposures that were repeated"):
        open_frames(tmp_path, instrument())
