"""MATLAB files as tables of text."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
import scipy.io

from pbrdf.errors import DataError
from pbrdf.files.delimited import read_table
from pbrdf.files.matlab import is_matlab, matlab_lines


@pytest.fixture
def saved(tmp_path):
    def save(version=5, **content):
        path = tmp_path / "a.mat"
        if version == 5:
            scipy.io.savemat(path, content)
            return path
        with h5py.File(path, "w", userblock_size=512) as file:
            for name, values in content.items():
                file[name] = np.atleast_2d(values).T
                file[name].attrs["MATLAB_class"] = np.bytes_("char" if name == "words" else "double")
        with path.open("r+b") as file:
            file.write(b"MATLAB 7.3 MAT-file")
        return path

    return save


@pytest.mark.parametrize("version", [5, 7.3])
def test_vectors_and_single_numbers_are_columns(saved, version):
    path = saved(version, theta_i=[0.1, 1 / 3], brdf=np.array([2.0, np.nan]), wavelength=550.0)
    assert is_matlab(path)
    columns = dict(zip(*[line.split("\t") for line in matlab_lines(path)[:2]], strict=True))
    assert {k: float(v) for k, v in columns.items()} == {"theta_i": 0.1, "brdf": 2.0, "wavelength": 550.0}
    table = read_table(path)
    assert table.numbers(table.column("theta_i"))[1] == 1 / 3
    assert np.isnan(table.numbers(table.column("brdf"))[1])


def test_texts_are_no_columns(saved):
    assert matlab_lines(saved(7.3, x=[1.0, 2.0], words=np.array([65, 66])))[0] == "x"
    assert matlab_lines(saved(x=[1.0, 2.0], words="AB"))[0] == "x"


def test_a_matrix_over_wavelengths_has_a_column_for_each(saved):
    path = saved(theta_r=[1.0, 2.0, 3.0], wavelength=[450.0, 650.5], f=np.arange(6.0).reshape(3, 2))
    names, *rows = (line.split("\t") for line in matlab_lines(path))
    assert names == ["theta_r", "f_450nm", "f_650.5nm"]
    assert [float(cell) for cell in rows[1]] == [2.0, 2.0, 3.0]


@pytest.mark.parametrize("version", [5, 7.3])
def test_an_array_over_axes_has_a_row_for_each_element(saved, version):
    """Axes are told by their lengths, in whatever order the array has them."""
    grid = np.arange(24.0).reshape(4, 2, 3)
    path = saved(
        version,
        theta_i=[10.0, 20.0],
        theta_r=[1.0, 2.0, 3.0],
        phi=[0.0, 60.0, 120.0, 180.0],
        brdf=grid,
        n=1.5,
    )
    names, *rows = (line.split("\t") for line in matlab_lines(path))
    assert len(rows) == 24
    for row in rows:
        at = dict(zip(names, map(float, row), strict=True))
        i, r, p = int(at["theta_i"] / 10) - 1, int(at["theta_r"]) - 1, int(at["phi"] / 60)
        assert at["brdf"] == grid[p, i, r]
        assert at["n"] == 1.5


@pytest.mark.parametrize(
    "content",
    [
        {},
        {"x": 1.0},
        {"x": [1.0, 2.0], "y": [1.0, 2.0, 3.0]},
        {"x": [1.0, 2.0], "grid": np.ones((4, 5))},
        {"x": [1.0, 2.0], "wavelength": [1.0, 2.0], "grid": np.ones((2, 2))},
        {"x": [1.0, 2.0], "y": [1.0, 2.0, 3.0], "grid": np.ones((2, 3)), "other": np.ones((3, 4))},
    ],
)
def test_other_arrays_are_listed(saved, content):
    with pytest.raises(DataError, match=r"a\.mat: vectors of one length, .* needed; this file holds"):
        matlab_lines(saved(**content))


@pytest.mark.parametrize(
    ("count", "words"),
    [
        (
            10**7,
            r"^[^:]*a\.mat: the variable 'x' declares 1 × 10000000 values, 80 MB, which a file of this size",
        ),
        # so little is always allowed to a file of HDF5, where what was not written is filled in
        (10**6, r"^[^:]*a\.mat: x cannot have the shape \(1000000, 1\) in a file of this size"),
    ],
)
def test_a_size_that_the_file_cannot_hold_is_seen_before_it_is_allocated(tmp_path, count, words):
    path = tmp_path / "a.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        x = file.create_dataset("x", (1, count), "f8", chunks=(1, 10**5))  # nothing of it is written
        x.attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file")
    with pytest.raises(DataError, match=words):
        matlab_lines(path)
