"""One reduction for any number of sinks: the frames are read once, and an error leaves nothing half-written."""

import threading
import time

import numpy as np
import pytest
import xarray as xr

from pbrdf.errors import DataError
from pbrdf.instruments.frames.frames import ArrayFrames
from pbrdf.instruments.goniometer.angle_table import AngleTable
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.polarimeter.polarimeter import lcvr
from pbrdf.instruments.polarimeter.retardance_sets import retardance_set
from pbrdf.instruments.reduction.goniometric_datasets import DatasetCollector, goniometric_datasets
from pbrdf.instruments.reduction.map_files import MapWriter
from pbrdf.instruments.reduction.reduce import reduce
from pbrdf.instruments.reduction.region_averages import RegionCollector
from pbrdf.instruments.reduction.regions import Ellipse, Rectangle

INSTRUMENT = Instrument(
    lcvr(retardance_set("tetrahedron")).with_accuracy(0.01, 0.05),
    Detector(bits=12, gain=3.0, read_noise=5.0, offset=60.0),
    reference_angle=0.3,
)
ROWS, COLUMNS = 400, 50
REGIONS = {"left": Rectangle(3, 20, 31, 250), "right": Ellipse(35.0, 150.0, 10.0, 80.0)}
ANGLES = AngleTable(("second", "first"), np.deg2rad([20.0, 10.0]), np.deg2rad([30.0, 40.0]))
#: So little memory that a picture is many blocks, and is read in several parts.
LITTLE = 1_000_000


class CountedFrames(ArrayFrames):
    """Frames that know how often each row of each series was read."""

    def __post_init__(self):
        super().__post_init__()
        object.__setattr__(self, "reads", np.zeros((len(self.names), self.rows), int))

    def read(self, series, first_row, last_row):
        self.reads[series, first_row:last_row] += 1
        return super().read(series, first_row, last_row)


class Recorder:
    """A sink that notes what happens to it, and fails where it is told to."""

    def __init__(self, fails=None, rows=(0, ROWS), pause=0.0):
        self.rows, self._fails, self._pause = rows, fails, pause
        self.entered = False
        self.added, self.threads, self.left = [], set(), []
        self._active, self._lock = 0, threading.Lock()

    def _fail(self, where):
        if self._fails == where:
            raise RuntimeError(f"no more in {where}")

    def __enter__(self):
        self._fail("enter")
        self.entered = True
        return self

    def prepare(self, block):
        with self._lock:
            self._active += 1
            self.threads.add(threading.current_thread())
        time.sleep(self._pause)
        # some blocks are through before it fails
        if block.series == 1:
            self._fail("prepare")
        with self._lock:
            self._active -= 1
        return block.series, block.first_row, block.last_row

    def add(self, block, part):
        assert threading.current_thread() is threading.main_thread()
        assert part == (block.series, block.first_row, block.last_row)
        self.added.append(part)
        if block.series == 1:
            self._fail("add")

    def __exit__(self, kind, *_):
        self.left.append((kind, self._active))
        self._fail("exit")


@pytest.fixture
def frames():
    raw = np.random.default_rng(3).integers(80, 3500, (2, 4, ROWS, COLUMNS)).astype(np.uint16)
    raw[1, 2, 60:80, 5:9] = 4095
    return CountedFrames(raw, ("first", "second"))


def stored(path):
    with xr.open_dataset(path, engine="h5netcdf") as file:
        return file.load()


@pytest.mark.slow
def test_several_sinks_read_the_frames_once(frames):
    sinks = [
        RegionCollector(REGIONS, frames, INSTRUMENT),
        DatasetCollector(REGIONS, frames, INSTRUMENT, ANGLES),
        Recorder(),
        Recorder(),
    ]
    reduce(frames, INSTRUMENT, sinks, max_memory=LITTLE)
    np.testing.assert_array_equal(frames.reads, 1)


@pytest.mark.slow
def test_each_sink_gets_what_it_gets_alone(frames, tmp_path):
    together = (
        MapWriter(tmp_path / "together.nc", frames, INSTRUMENT, angles=ANGLES),
        RegionCollector(REGIONS, frames, INSTRUMENT),
        DatasetCollector(REGIONS, frames, INSTRUMENT, ANGLES),
    )
    reduce(frames, INSTRUMENT, together, max_memory=LITTLE, dark_level=30.0)
    maps = MapWriter(tmp_path / "alone.nc", frames, INSTRUMENT, angles=ANGLES)
    reduce(frames, INSTRUMENT, [maps], max_memory=LITTLE, dark_level=30.0)
    xr.testing.assert_identical(stored(tmp_path / "together.nc"), stored(tmp_path / "alone.nc"))
    # sums over a region depend in their last digits on where its rows are divided into blocks
    averages = RegionCollector(REGIONS, frames, INSTRUMENT)
    reduce(frames, INSTRUMENT, [averages, Recorder()], max_memory=LITTLE, dark_level=30.0)
    datasets = goniometric_datasets(frames, INSTRUMENT, REGIONS, ANGLES, max_memory=LITTLE, dark_level=30.0)
    for region, means in averages.averages().items():
        for found, expected in zip(together[1].averages()[region], means, strict=True):
            np.testing.assert_array_equal(found.stokes, expected.stokes)
            np.testing.assert_array_equal(found.covariance, expected.covariance)
            assert found.counts == expected.counts
        xr.testing.assert_allclose(together[2].datasets()[region], datasets[region], rtol=1e-12)


def test_blocks_come_in_order_and_are_prepared_in_threads(frames):
    sink, progress = Recorder(), []
    reduce(frames, INSTRUMENT, [sink], max_memory=LITTLE, progress=lambda *done: progress.append(done))
    assert len(sink.added) > 10
    ends = [0, *(last + ROWS * series for series, _, last in sink.added)]
    assert ends[:-1] == [first + ROWS * series for series, first, _ in sink.added]
    assert progress == [(end, 2 * ROWS) for end in ends[1:]]
    assert threading.main_thread() not in sink.threads
    assert sink.left == [(None, 0)]


def test_only_rows_that_a_sink_needs_are_read(frames):
    reduce(frames, INSTRUMENT, [Recorder(rows=(30, 50)), Recorder(rows=(90, 100))])
    expected = np.zeros(ROWS, int)
    expected[30:100] = 1
    np.testing.assert_array_equal(frames.reads, [expected, expected])


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["nc", "zarr"])
@pytest.mark.parametrize("where", ["enter", "prepare", "add", "exit"])
def test_an_error_in_a_sink_closes_the_others_and_leaves_nothing(frames, tmp_path, kind, where):
    if kind == "zarr":
        pytest.importorskip("zarr")
    other, wrong = Recorder(), Recorder(where)
    maps = MapWriter(tmp_path / f"stokes.{kind}", frames, INSTRUMENT)
    with pytest.raises(RuntimeError, match=f"no more in {where}"):
        reduce(frames, INSTRUMENT, [maps, other, wrong], max_memory=LITTLE)
    assert [kind for kind, _ in other.left] == [RuntimeError]
    assert [kind for kind, _ in wrong.left] == {"enter": [], "exit": [None]}.get(where, [RuntimeError])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_broken_frames_leave_nothing(frames, tmp_path):
    frames.array[1, 2, 300, 4] = 5000
    other = Recorder()
    maps = MapWriter(tmp_path / "stokes.nc", frames, INSTRUMENT)
    with pytest.raises(DataError, match="series 'second': a pixel reads 5000"):
        reduce(frames, INSTRUMENT, [maps, other], max_memory=LITTLE)
    assert [kind for kind, _ in other.left] == [DataError]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_no_thread_is_at_work_when_a_sink_is_left(frames):
    slow = Recorder(pause=0.005)
    with pytest.raises(RuntimeError, match="no more in add"):
        reduce(frames, INSTRUMENT, [slow, Recorder("add")], max_memory=LITTLE)
    assert slow.left == [(RuntimeError, 0)]


def test_a_file_that_is_there_is_kept(frames, tmp_path):
    path = tmp_path / "stokes.nc"
    path.write_text("mine")
    with pytest.raises(DataError, match=r"stokes\.nc: there is something of that name already"):
        reduce(frames, INSTRUMENT, [MapWriter(path, frames, INSTRUMENT)])
    assert path.read_text() == "mine"


def test_without_a_sink_nothing_is_read(frames):
    with pytest.raises(DataError, match="give at least one sink"):
        reduce(frames, INSTRUMENT, [])
