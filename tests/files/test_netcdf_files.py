"""netCDF files are read under guard, and a full disk ends in a sentence."""

from __future__ import annotations

import errno
import subprocess
import sys
import textwrap

import h5py
import numpy as np
import pytest
import xarray as xr

import pbrdf
from pbrdf.errors import DataError
from pbrdf.files.netcdf_files import PatientFile, load_netcdf, open_netcdf, write_netcdf_file

ds = xr.Dataset({"a": ("x", [1.0, 2.0])}, {"x": ["p", "ö"]}, {"title": "one"})


def test_groups_come_back(tmp_path):
    write_netcdf_file(tmp_path / "a.nc", {"/": ds, "data": ds * 2.0})
    root, data = load_netcdf(tmp_path / "a.nc", ("/", "data"))
    assert root.identical(ds)
    assert data.identical(ds * 2.0)
    with open_netcdf(tmp_path / "a.nc") as lazy:
        assert lazy["a"].values.tolist() == [1.0, 2.0]


def test_what_is_wrong_names_the_file_and_what_it_should_be(tmp_path):
    write_netcdf_file(tmp_path / "a.nc", {"/": ds})
    (tmp_path / "text.nc").write_text("no", encoding="utf-8")
    with pytest.raises(DataError, match=r"a\.nc: cannot be read as a fit: there is no group 'data' in it"):
        load_netcdf(tmp_path / "a.nc", ("/", "data"), kind="a fit")
    with pytest.raises(DataError, match=r"text\.nc: cannot be read as netCDF: "):
        load_netcdf(tmp_path / "text.nc")
    with pytest.raises(DataError, match=r"no\.nc: cannot be read: No such file"):
        open_netcdf(tmp_path / "no.nc")


def test_a_file_that_declares_too_much_is_refused_by_read(tmp_path):
    with h5py.File(tmp_path / "data.nc", "w") as file:
        file.create_dataset("I", shape=(400_000_000,), dtype="f8", chunks=(1000,))
    with pytest.raises(DataError, match=r"data\.nc: the variable 'I' declares 400000000 values, 3\.2 GB"):
        pbrdf.read(tmp_path / "data.nc")


class Full:
    """A disk on which ten thousand bytes fit."""

    def __init__(self, file):
        self.file, self.left = file, 10_000

    def write(self, content):
        if len(content) > self.left:
            raise OSError(errno.ENOSPC, "No space left on device")
        self.left -= len(content)
        return self.file.write(content)

    def __getattr__(self, name):
        return getattr(self.file, name)


def test_the_library_does_not_hear_of_a_full_disk(tmp_path):
    path = tmp_path / "a.nc"
    with h5py.File(path, "w"):
        pass
    target = PatientFile(path)
    target._file = Full(target._file)
    with h5py.File(target, "r+") as file:
        file.create_dataset("a", data=np.arange(100.0))
        file.flush()
        target.require_written()
        file.create_dataset("b", data=np.arange(10_000.0))
    with pytest.raises(OSError, match="No space left on device"):
        target.require_written()
    target.close()


def test_what_is_written_through_it_is_a_whole_file(tmp_path):
    path = tmp_path / "a.nc"
    with h5py.File(path, "w"):
        pass
    target = PatientFile(path)
    with h5py.File(target, "r+") as file:
        file.create_dataset("a", data=np.arange(100.0), chunks=(10,))
        file["a"][5] = -1.0
    target.require_written()
    target.close()
    with h5py.File(path) as file:
        assert file["a"][4:7].tolist() == [4.0, -1.0, 6.0]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="file sizes are limited by POSIX means")
@pytest.mark.parametrize("what", ["data.nc", "data.csv", "analyser.nc", "data.zarr"])
def test_a_disk_that_is_full_leaves_the_old_file_and_a_line(tmp_path, what):
    """The limit of a file's size stands for the end of the disk: writing fails in the same place."""
    script = f"""
        import resource, signal, sys, numpy as np, pbrdf
        from pathlib import Path
        from pbrdf.instruments.polarimeter.analyzer_files import write_analyzer
        from pbrdf.instruments.polarimeter.polarimeter import measured
        def write(rows, path):
            if path.stem == "analyser":
                write_analyzer(measured(np.random.default_rng(0).random((rows, 4))), path)
            else:
                theta = np.linspace(0.1, 1.0, rows)
                pbrdf.write(pbrdf.make_dataset(theta, theta, 0.0, quantity="brdf", I=np.cos(theta)), path)
        path = Path({str(tmp_path / what)!r})
        write(4, path)
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
        try:
            write(50_000, path)
        except pbrdf.PbrdfError as error:
            print(error)
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(script)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert what in done.stdout
    assert "cannot be written: File too large" in done.stdout
    assert [path.name for path in tmp_path.iterdir()] == [what]
    if what.startswith("data"):
        assert pbrdf.read(tmp_path / what).sizes["geometry"] == 4


def test_a_file_holds_what_xarray_would_have_written(tmp_path):
    several = xr.Dataset(
        {
            "a": (
                ("x", "y"),
                np.arange(6.0).reshape(2, 3),
                {"units": "1/sr", "range": [0.0, 5.0], "count": 3},
            ),
            "flag": ("x", np.array([True, False])),
            "word": ("y", np.array(["p", "ö", ""])),
            "number": ((), np.int8(4)),
            "y_of": ("x", [1, 2]),
        },
        {"x": ["p", "ö"], "place": ("x", [0.5, np.nan])},
        {"title": "one", "both": [1, 2], "one": 1.5},
    )
    several["empty"] = ("nothing", np.zeros(0))
    write_netcdf_file(tmp_path / "ours.nc", {"/": several, "data": several[["a"]]})
    several.to_netcdf(tmp_path / "theirs.nc", engine="h5netcdf")
    with xr.open_dataset(tmp_path / "theirs.nc") as theirs, xr.open_dataset(tmp_path / "ours.nc") as ours:
        assert ours.load().identical(theirs.load())
        assert {name: v.dtype for name, v in ours.variables.items()} == {
            name: v.dtype for name, v in theirs.variables.items()
        }
    with h5py.File(tmp_path / "ours.nc") as file:
        scales = [x for group in (file, file["data"]) for x in group.values() if "_Netcdf4Dimid" in x.attrs]
        numbers = [int(x.attrs["_Netcdf4Dimid"]) for x in scales]
        assert len(numbers) == 5 == len(set(numbers)), "every dimension of the file has a number of its own"
        assert file["a"].dims[1][0].attrs["NAME"].startswith(b"This is a netCDF dimension but not a netCDF")
