from __future__ import annotations

import struct

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from pbrdf.data.formats.tensor_file import read_tensors, write_tensors
from pbrdf.errors import DataError

ARRAYS = {
    "axis": np.linspace(0, 1, 7, dtype=np.float32)[np.newaxis],
    "wvls": np.array([450, 650], dtype=np.uint16),
    "text": np.frombuffer("β".encode(), dtype=np.uint8),
    "M": np.arange(24, dtype=np.float64).reshape(2, 3, 4),
}


@pytest.fixture
def file(tmp_path):
    write_tensors(ARRAYS, tmp_path / "a.tensor")
    return tmp_path / "a.tensor"


def test_arrays_come_back(file):
    back = read_tensors(file)
    assert list(back) == list(ARRAYS)
    for name, array in ARRAYS.items():
        assert back[name].dtype == array.dtype
        assert_array_equal(back[name], array)


def test_the_bytes_are_those_of_the_format(file):
    """A field of one name, by the layout: identification, version, count; name, dimensions, type, offset, shape."""
    write_tensors({"wvls": np.array([476], dtype=np.uint16)}, file)
    expected = b"tensor_file\0" + bytes([1, 0]) + struct.pack("<I", 1)
    expected += struct.pack("<H", 4) + b"wvls" + struct.pack("<H", 1) + bytes([3]) + struct.pack("<QQ", 48, 1)
    assert file.read_bytes() == expected.ljust(48, b"\0") + struct.pack("<H", 476)


def test_mitsubas_own_reader_and_writer_agree(file, capsys):
    tensor_io = pytest.importorskip("mitsuba.python.tensor_io", reason="Mitsuba is not installed")
    for name, array in tensor_io.read(str(file)).items():
        assert_array_equal(array, ARRAYS[name])
    tensor_io.write(str(file), **ARRAYS)
    for name, array in read_tensors(file).items():
        assert_array_equal(array, ARRAYS[name])
    assert "Wrote" in capsys.readouterr().out


@pytest.mark.parametrize("length", [12, 17, 20, 30, 60, 250])
def test_a_truncated_file_is_named_as_such(file, length):
    file.write_bytes(file.read_bytes()[:length])
    with pytest.raises(DataError, match=r"a\.tensor: .*truncated"):
        read_tensors(file)


@pytest.mark.parametrize(
    ("position", "byte", "words"),
    [
        (0, b"T", "not a tensor file"),
        (12, b"\2", r"version 2\.0"),
        (26, b"\x63", "the field 'axis' has the unknown type 99: the file is damaged"),
    ],
)
def test_damage_is_told(file, position, byte, words):
    content = file.read_bytes()
    file.write_bytes(content[:position] + byte + content[position + 1 :])
    with pytest.raises(DataError, match=words):
        read_tensors(file)


def test_what_is_no_file_is_told(tmp_path):
    with pytest.raises(DataError, match=r"no\.tensor: cannot be read"):
        read_tensors(tmp_path / "no.tensor")


def test_a_failed_write_leaves_the_old_file_alone(file, monkeypatch):
    before = file.read_bytes()

    class Full:
        """An array whose values cannot be written, as on a full disk."""

        def __init__(self, array):
            self.ndim, self.shape, self.nbytes, self.dtype = (
                array.ndim,
                array.shape,
                array.nbytes,
                array.dtype,
            )

        @property
        def data(self):
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(
        "pbrdf.data.formats.tensor_file.np.ascontiguousarray", lambda array, dtype: Full(array)
    )
    with pytest.raises(DataError, match=r"a\.tensor: cannot be written: No space left on device"):
        write_tensors(ARRAYS, file)
    assert file.read_bytes() == before
    assert list(file.parent.iterdir()) == [file]


def test_a_missing_folder_is_told(tmp_path):
    with pytest.raises(DataError, match="cannot be written"):
        write_tensors(ARRAYS, tmp_path / "nowhere" / "a.tensor")


@pytest.mark.parametrize("shape", [(2**40,), (2**63, 0), (1,) * 40])
def test_a_shape_that_no_array_has_is_damage(tmp_path, shape):
    head = struct.pack("<12s2BI", b"tensor_file\0", 1, 0, 1) + struct.pack("<H", 1) + b"a"
    file = tmp_path / "a.tensor"
    file.write_bytes(head + struct.pack(f"<HBQ{len(shape)}Q", len(shape), 1, 0, *shape))
    with pytest.raises(DataError, match=r"a\.tensor: the field 'a' has the shape .*: the file is damaged"):
        read_tensors(file)
