"""Block by block gives what the whole gives, and a measurement larger than the memory allowed is reduced within it."""

import subprocess
import sys

import numpy as np
import pytest

from pbrdf.errors import DataError
from pbrdf.instruments.frames.frames import ArrayFrames, ChosenSeries
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.polarimeter.polarimeter import lcvr, measured, rotating_polarizer
from pbrdf.instruments.polarimeter.retardance_sets import retardance_set
from pbrdf.instruments.reduction.stokes_image import reduce_frames
from pbrdf.instruments.reduction.streaming import reduced_blocks

DETECTOR = Detector(bits=12, gain=3.0, read_noise=5.0, offset=60.0)


def frames_of(states, rows=37, columns=23, series=3):
    draw = np.random.default_rng(5)
    return ArrayFrames(draw.integers(70, 4096, (series, states, rows, columns)).astype(np.uint16))


def together(frames, instrument, **options):
    stokes = np.full((len(frames.names), 4, frames.rows, frames.columns), np.inf)
    flags = np.full((len(frames.names), frames.rows, frames.columns), 255)
    for block in reduced_blocks(frames, instrument, lambda block: block, **options):
        assert np.isinf(stokes[block.series, :, block.first_row : block.last_row]).all()
        stokes[block.series, :, block.first_row : block.last_row] = block.image.stokes
        flags[block.series, block.first_row : block.last_row] = block.image.flags
    return stokes, flags


POLARIMETERS = {
    "linear": rotating_polarizer(np.deg2rad([0.0, 45.0, 90.0, 135.0])),
    "full": lcvr(retardance_set("tetrahedron")),
    "map": measured(
        lcvr(retardance_set("tetrahedron")).analyzer
        * np.linspace(0.8, 1.2, 15).reshape(5, 3, 1, 1)  # three columns of five cells, each with its own gain
    ),
}


@pytest.mark.parametrize("name", POLARIMETERS)
@pytest.mark.parametrize("max_memory", [500_000_000, 1_000_000])
def test_blocks_are_the_whole(name, max_memory):
    instrument = Instrument(POLARIMETERS[name], DETECTOR)
    frames = frames_of(4)
    stokes, flags = together(frames, instrument, max_memory=max_memory, dark_level=5.0)
    for s in range(3):
        whole = reduce_frames(frames.array[s], instrument.polarimeter, DETECTOR, dark_level=5.0)
        np.testing.assert_allclose(stokes[s], whole.stokes, rtol=1e-12, atol=1e-9)
        np.testing.assert_array_equal(flags[s], whole.flags)


def test_little_memory_means_many_blocks():
    frames = frames_of(4, rows=400, columns=50, series=1)
    instrument = Instrument(POLARIMETERS["full"], DETECTOR)
    sizes = [
        len(list(reduced_blocks(frames, instrument, lambda block: 0, max_memory=memory)))
        for memory in (1_000_000, 500_000_000)
    ]
    assert sizes[0] > 10 > sizes[1]


def test_progress_ends_at_all_rows_and_rows_can_be_chosen():
    frames = ChosenSeries(frames_of(4), ["3", "1"])
    seen = []
    blocks = reduced_blocks(
        frames,
        Instrument(POLARIMETERS["full"], DETECTOR),
        lambda block: (block.series, block.first_row, block.last_row),
        rows=(5, 12),
        progress=lambda *done: seen.append(done),
    )
    assert list(blocks) == [(0, 5, 12), (1, 5, 12)]
    assert seen == [(7, 14), (14, 14)]


def test_an_error_names_the_series():
    frames = frames_of(4)
    frames.array[1, 2, 30, 4] = 5000
    blocks = reduced_blocks(frames, Instrument(POLARIMETERS["full"], DETECTOR), lambda block: block)
    with pytest.raises(DataError, match="series '2': a pixel reads 5000"):
        list(blocks)


def test_a_wrong_number_of_states():
    blocks = reduced_blocks(frames_of(3), Instrument(POLARIMETERS["full"], DETECTOR), lambda block: block)
    with pytest.raises(DataError, match="3 frames a series for the 4 states"):
        list(blocks)


MEASURE = """
import resource, sys
from pathlib import Path
import numpy as np
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.frames.frame_files import open_frames
from pbrdf.instruments.frames.frames import ArrayFrames
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.polarimeter.polarimeter import rotating_retarder
from pbrdf.report.reduction.folder import Wanted, write_reduction

instrument = Instrument(rotating_retarder(np.deg2rad(np.arange(24) * 7.5)), Detector(bits=12))
folder = Path(sys.argv[1])
def go(frames, name):
    wanted = Wanted(pictures=False)
    write_reduction(
        frames, instrument, folder / name, wanted, name=name, weighted=False, max_memory=20_000_000
    )
# first a small one, so that every library is loaded
go(ArrayFrames(np.full((1, 24, 4, 512), 900, np.uint16)), "small")
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
go(open_frames(folder / sys.argv[2], instrument), "large")
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="peak memory is counted in other units elsewhere")
@pytest.mark.parametrize("kind", ["npy", "nc"])
def test_a_stack_larger_than_the_memory_allowed(tmp_path, kind):
    """63 MB of frames, from which 110 MB of results are made, with 20 MB allowed."""
    shape = (2, 24, 640, 1024)
    if kind == "npy":
        stack = np.lib.format.open_memmap(tmp_path / "run.npy", "w+", np.uint16, shape)
        stack[:] = 900
        stack.flush()
        del stack
    else:
        import h5netcdf

        with h5netcdf.File(tmp_path / "run.nc", "w") as file:
            file.dimensions = dict(zip(("series", "state", "y", "x"), shape, strict=True))
            file.create_variable("frames", ("series", "state", "y", "x"), np.uint16, chunks=(1, 1, 128, 1024))
            for series in range(shape[0]):
                file["frames"][series] = np.full(shape[1:], 900, np.uint16)
    done = subprocess.run(
        [sys.executable, "-c", MEASURE, tmp_path, f"run.{kind}"], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    # and what the allocators keep beside what is used
    assert int(done.stdout) < 40_000_000
