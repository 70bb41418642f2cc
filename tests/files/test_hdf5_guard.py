"""What HDF5 files declare is checked before anything is allocated, in a process that may fail at it."""

from __future__ import annotations

import sys

import h5py
import numpy as np
import pytest

from pbrdf.errors import DataError
from pbrdf.files import hdf5_guard
from pbrdf.files.hdf5_guard import Look
from pbrdf.files.hdf5_probe import amount, declared_bytes


@pytest.fixture
def stub(tmp_path, monkeypatch):
    """In place of the process beside, a script."""

    def use(script: str) -> None:
        path = tmp_path / "stub.py"
        path.write_text(script, encoding="utf-8")
        process = hdf5_guard._Process()
        process.command = lambda: [sys.executable, str(path)]
        monkeypatch.setattr(hdf5_guard, "_process", process)
        started.append(process)

    started: list[hdf5_guard._Process] = []
    yield use
    for process in started:
        process.forget()


@pytest.fixture
def written(tmp_path):
    """A file into which a function writes."""

    def write(fill):
        path = tmp_path / "data.nc"
        with h5py.File(path, "w") as file:
            fill(file)
        return path

    return write


def look(path, **options):
    Look(path, **options).require_sound()


def test_a_sound_file_passes_and_the_next_one_by_the_same_process(written):
    path = written(lambda file: file.create_dataset("a", data=np.arange(6.0).reshape(2, 3)))
    look(path)
    child = hdf5_guard._process.child
    look(path, loaded=False)
    assert hdf5_guard._process.child is child
    assert child.poll() is None
    assert declared_bytes(str(path), ("/",)) == 48


def test_more_rows_than_the_file_can_hold_are_refused_with_variable_and_size(written):
    path = written(lambda file: file.create_dataset("I", shape=(400_000_000,), dtype="f8", chunks=(1000,)))
    assert path.stat().st_size < 10_000
    with pytest.raises(
        DataError, match=r"data\.nc: the variable 'I' declares 400000000 values, 3\.2 GB, which a"
    ):
        look(path)


def test_many_arrays_that_are_too_much_together_are_refused(written):
    def fill(file):
        for name in "abcd":
            file.create_dataset(name, shape=(1_500_000,), dtype="f8", chunks=(1000,))

    with pytest.raises(DataError, match="its variables declare 48 MB together, but the file has"):
        look(written(fill))


@pytest.mark.parametrize(("kind", "fill"), [("u2", None), ("f8", None), ("i1", 3)])
def test_chunks_that_were_never_written_are_no_numbers(written, kind, fill):
    def half(file):
        array = file.create_dataset("frames", shape=(4, 5), dtype=kind, chunks=(1, 5), fillvalue=fill)
        array[:3] = 7

    path = written(half)
    with h5py.File(path) as file:
        assert file["frames"][3, 0] == (fill or 0)
    with pytest.raises(
        DataError,
        match=rf"data\.nc: the variable 'frames' holds 3 of its 4 chunks: .* would read as {fill or 0}",
    ):
        look(path)


def test_an_array_without_chunks_that_was_never_written_is_no_zeros(written):
    path = written(lambda file: file.create_dataset("frames", shape=(4, 5), dtype="u2"))
    with pytest.raises(DataError, match="the variable 'frames' holds 0 of its 20 values"):
        look(path)


@pytest.mark.parametrize("short", ["frames", "series"])
def test_what_ends_before_others_along_a_dimension_that_grows_is_no_zeros(written, short):
    """As netCDF's own library leaves it where it was killed between two variables of a series that was appended."""

    def fill(file):
        count = {"frames": 3, "series": 3} | {short: 2}
        series = file.create_dataset("series", data=np.arange(count["series"]), maxshape=(None,), chunks=(1,))
        series.make_scale("series")
        frames = np.full((count["frames"], 4), 7, dtype="u2")
        frames = file.create_dataset("frames", data=frames, maxshape=(None, 4), chunks=(1, 4))
        frames.dims[0].attach_scale(series)

    path = written(fill)
    with pytest.raises(
        DataError,
        match=rf"data\.nc: the variable '{short}' holds 2 of its 3 places along series: .* would read as 0",
    ):
        look(path)


def test_what_says_itself_that_it_is_missing_is_read(written):
    """NaN, the fill value that the attribute names; and what has no numbers: dimensions, marks, empty arrays."""

    def fill(file):
        file.create_dataset("nan", shape=(4,), dtype="f8", chunks=(1,), fillvalue=np.nan)
        for name in ("_FillValue", "missing_value"):
            said = file.create_dataset(name, shape=(4,), dtype="i2", chunks=(1,), fillvalue=-1)
            said.attrs[name] = np.array([-1], dtype="i2")
        file.create_dataset("of_matlab", shape=(4,), dtype="f8", chunks=(1,)).attrs["MATLAB_class"] = (
            b"double"
        )
        file.create_dataset("crs", shape=(), dtype="i4").attrs["NAME"] = "WGS 84"
        file.create_dataset("named", data=np.arange(4)).attrs["NAME"] = "a name of its own"
        file.create_dataset("none", shape=(0,), dtype="i4", maxshape=(None,), chunks=(4,))
        file.create_dataset("x", shape=(4,), dtype=">f4").make_scale(
            "This is a netCDF dimension but not a netCDF variable.         4"
        )

    look(written(fill))


def test_what_packs_well_is_not_refused(written):
    path = written(lambda file: file.create_dataset("I", data=np.zeros(4_000_000), compression="gzip"))
    assert path.stat().st_size < 200_000
    look(path)


def test_numbers_in_another_file_are_refused(written, tmp_path):
    (tmp_path / "numbers.bin").write_bytes(bytes(80))
    outside = [(str(tmp_path / "numbers.bin"), 0, 80)]
    path = written(lambda file: file.create_dataset("I", shape=(10,), dtype="f8", external=outside))
    with pytest.raises(
        DataError, match=r"the variable 'I' keeps its numbers in another file \(external storage\)"
    ):
        look(path)


def test_a_virtual_array_is_refused(written, tmp_path):
    with h5py.File(tmp_path / "other.h5", "w") as other:
        other["x"] = np.arange(4.0)
    layout = h5py.VirtualLayout(shape=(4,), dtype="f8")
    layout[:] = h5py.VirtualSource(str(tmp_path / "other.h5"), "x", shape=(4,))
    path = written(lambda file: file.create_virtual_dataset("I", layout))
    with pytest.raises(DataError, match="the variable 'I' keeps its numbers in another file"):
        look(path)


def test_a_link_to_another_file_is_refused(written):
    def fill(file):
        file["I"] = h5py.ExternalLink("other.h5", "/x")

    with pytest.raises(DataError, match=r"'I' is a link to another file, 'other\.h5'"):
        look(written(fill))


def test_more_than_there_is_memory_for_is_refused(written, monkeypatch):
    path = written(lambda file: file.create_dataset("I", data=np.arange(1000.0)))
    monkeypatch.setattr(hdf5_guard, "available_memory", lambda: 5000)
    with pytest.raises(DataError, match=r"its variables take 8 kB of memory, of which 5 kB are left"):
        look(path)
    look(path, loaded=False)


def test_the_memory_that_is_left_is_that_of_the_system():
    assert 2**20 < hdf5_guard.available_memory() <= 2**62


def test_a_process_that_does_not_answer_is_ended_and_another_one_serves_the_next_file(
    stub, written, monkeypatch
):
    path = written(lambda file: file.create_dataset("a", data=1.0))
    monkeypatch.setattr(hdf5_guard, "_PATIENCE", 0.3)
    stub("import time\ntime.sleep(600)")
    with pytest.raises(
        DataError, match=r"the HDF5 library had not come to an end after 0 s; the file is damaged"
    ):
        look(path)
    assert hdf5_guard._process.child is None
    monkeypatch.undo()
    look(path)


def test_a_process_that_does_not_survive_is_told_in_one_line(stub, written):
    path = written(lambda file: file.create_dataset("a", data=1.0))
    stub("import os, sys\nsys.stdin.readline()\nos._exit(11)")
    with pytest.raises(
        DataError, match=r"data\.nc: cannot be read as netCDF: the HDF5 library crashes at it"
    ):
        look(path)


def test_a_process_that_cannot_start_leaves_the_check_of_what_is_declared(written, monkeypatch):
    process = hdf5_guard._Process()
    process.command = lambda: ["no-such-program"]
    monkeypatch.setattr(hdf5_guard, "_process", process)
    path = written(lambda file: file.create_dataset("I", shape=(400_000_000,), dtype="f8", chunks=(1000,)))
    with pytest.raises(DataError, match="the variable 'I' declares 400000000 values"):
        look(path)
    path.write_bytes(b"nothing")
    with pytest.raises(DataError, match="cannot be read as a fit: "):
        look(path, kind="a fit")


def test_bytes_in_words():
    assert [amount(n) for n in (12, 8000, 3_200_000_000, 10**16)] == [
        "12 bytes",
        "8 kB",
        "3.2 GB",
        "10000000 GB",
    ]
