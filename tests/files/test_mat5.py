"""Our own reader of MATLAB's files against SciPy's, and against damage that SciPy's does not survive."""

from __future__ import annotations

import struct

import numpy as np
import pytest
import scipy.io
from numpy.testing import assert_array_equal

from pbrdf.errors import DataError
from pbrdf.files.mat5 import mat5_arrays

CONTENT = {
    "a": np.arange(24.0).reshape(2, 3, 4),
    "small": np.array([[3]], np.uint8),
    "whole": np.arange(6, dtype=np.int32).reshape(2, 3),
    "complex": np.array([1 + 2j]),
    "words": "some text",
    "parts": {"x": np.array([1.0])},
    "single": np.linspace(0, 1, 5, dtype=np.float32),
}


@pytest.fixture(params=[False, True], ids=["plain", "compressed"])
def path(request, tmp_path):
    file = tmp_path / "a.mat"
    scipy.io.savemat(file, CONTENT, do_compression=request.param)
    return file


def test_arrays_are_those_that_scipy_reads(path):
    found = {array.name: array for array in mat5_arrays(path)}
    known = scipy.io.loadmat(path)
    assert set(found) == set(CONTENT)
    for name in ("a", "small", "whole", "single"):
        assert found[name].shape == known[name].shape
        assert_array_equal(found[name].load(), known[name])


@pytest.mark.parametrize("name", ["complex", "words", "parts"])
def test_what_is_no_array_of_real_numbers_is_not_loaded(path, name):
    (array,) = (array for array in mat5_arrays(path) if array.name == name)
    with pytest.raises(DataError, match=f"the variable {name} does not hold real numbers"):
        array.load()


def matrix(order, name, values, shape=None):
    """An array's element; names of up to four letters are small elements."""
    flags = struct.pack(f"{order}IIII", 6, 8, 6, 0)
    shape = values.shape if shape is None else shape
    dims = struct.pack(f"{order}II{len(shape)}i", 5, 4 * len(shape), *shape) + b"\0" * (4 * (len(shape) % 2))
    title = struct.pack(f"{order}I", len(name) << 16 | 1) + name.encode().ljust(4, b"\0")
    data = values.astype(f"{order}f8").tobytes(order="F")
    body = flags + dims + title + struct.pack(f"{order}II", 9, len(data)) + data
    return struct.pack(f"{order}II", 14, len(body)) + body


def whole(order, *elements):
    version = struct.pack(f"{order}H", 0x0100) + (b"IM" if order == "<" else b"MI")
    return b"MATLAB 5.0 MAT-file".ljust(124) + version + b"".join(elements)


@pytest.mark.parametrize("order", ["<", ">"])
def test_both_orders_of_bytes(tmp_path, order):
    path = tmp_path / "a.mat"
    path.write_bytes(whole(order, matrix(order, "x", CONTENT["a"]), matrix(order, "y", np.ones((1, 3)))))
    x, y = mat5_arrays(path)
    assert (x.name, x.shape, y.name) == ("x", (2, 3, 4), "y")
    assert_array_equal(x.load(), CONTENT["a"])
    assert_array_equal(y.load(), [[1, 1, 1]])


@pytest.mark.parametrize("shape", [(2**31 - 1, 2**31 - 1), (2, 4), (-1, 3)])
def test_a_declared_shape_is_compared_with_what_is_there(tmp_path, shape):
    path = tmp_path / "a.mat"
    path.write_bytes(whole("<", matrix("<", "x", np.ones((2, 3)), shape)))
    with pytest.raises(DataError, match="cannot be read as a MATLAB file"):
        [array.load() for array in mat5_arrays(path)]


def test_other_levels_are_refused(tmp_path):
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"x": np.ones(3)}, format="4")
    with pytest.raises(DataError, match="not a MATLAB file of version 5 to 7"):
        mat5_arrays(path)


def test_no_truncation_passes_unseen(path):
    data = path.read_bytes()
    for stop in range(100, len(data) - 1, 7):
        path.write_bytes(data[:stop])
        try:
            names = {array.name for array in mat5_arrays(path) if array.is_real and array.load() is not None}
        except DataError:
            continue
        # only a file that ends between two arrays reads as whole
        assert names < {"a", "small", "whole", "single"}
