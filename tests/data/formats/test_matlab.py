"""KAIST's MATLAB tables are those of the .pbsdf files: the same arrays give the same data set."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
import scipy.io
from numpy.testing import assert_allclose

from pbrdf.data import read
from pbrdf.data.formats.tensor_file import write_tensors
from pbrdf.errors import DataError


def arrays(degrees=False):
    rng = np.random.default_rng(3)
    axes = {
        "theta_h": np.linspace(0.1, 1.0, 4),
        "theta_d": np.linspace(0.1, 0.9, 3),
        "phi_d": np.linspace(-3.1, 3.1, 5),
    }
    matrices = rng.uniform(0.1, 1.0, (5, 3, 4, 2, 4, 4))
    matrices[0, 0, 0, 0] = np.nan
    wavelengths = {"wvls": np.array([[450, 550]])}
    scale = 180.0 / np.pi if degrees else 1.0
    return {k: v[np.newaxis] * scale for k, v in axes.items()} | wavelengths | {"pbrdf_T_f": matrices}


@pytest.fixture
def reference(tmp_path):
    fields = {k: v.astype(np.float32) for k, v in arrays().items()}
    path = tmp_path / "a.pbsdf"
    write_tensors(
        {k: fields[k] for k in ("theta_h", "theta_d", "phi_d")}
        | {"wvls": np.array([450, 550], np.uint16), "M": fields["pbrdf_T_f"]},
        path,
    )
    return read(path)


def alike(a, b):
    assert a.sizes == b.sizes
    for name in ("theta_i", "theta_r", "wavelength", "mueller"):
        assert_allclose(a[name], b[name], rtol=2e-5, atol=2e-5)
    assert_allclose(np.cos(a["phi"]), np.cos(b["phi"]), atol=2e-5)


@pytest.mark.parametrize("degrees", [False, True])
def test_the_same_arrays_give_the_same_data_set(tmp_path, reference, degrees):
    path = tmp_path / "paint.mat"
    scipy.io.savemat(path, arrays(degrees), do_compression=True)
    ds = read(path)
    alike(ds, reference)
    assert ds.attrs["source"] == "paint.mat"
    assert read(path, wavelength=550).sizes["geometry"] < ds.sizes["geometry"]


def test_version_7_3_has_its_axes_in_reverse(tmp_path, reference):
    path = tmp_path / "paint.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in arrays().items():
            file[name] = values.T
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: test")
    alike(read(path), reference)


def test_the_content_tells_the_format(tmp_path, reference):
    path = tmp_path / "paint.unknown"
    with path.open("wb") as file:
        scipy.io.savemat(file, arrays())
    alike(read(path), reference)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"pbrdf_T_f": None, "x": [1.0]}, "there is no variable pbrdf_T_f or pbrdf_T; .* holds theta_h, .*x"),
        ({"wvls": None}, "there is no variable wvls"),
        (
            {"wvls": np.array([[450, 550, 650]])},
            r"shape \(5, 3, 4, 2, 4, 4\), but its axes .* ask for \(5, 3, 4, 3",
        ),
        ({"theta_h": np.array([[0.1, 0.3, 0.2, 0.4]])}, "the values of theta_h do not ascend"),
        ({"phi_d": np.array([[-9.0, 0, 1, 2, 3]])}, "phi_d reaches from -9 to 3"),
        ({"theta_d": np.array([["a", "b", "c"]])}, "theta_d"),
    ],
)
def test_other_contents_are_refused(tmp_path, change, words):
    path = tmp_path / "paint.mat"
    scipy.io.savemat(path, {k: v for k, v in (arrays() | change).items() if v is not None})
    with pytest.raises(DataError, match=words):
        read(path, format="matlab")


def test_vectors_are_the_columns_of_a_table(tmp_path):
    """Other MATLAB files: a column for each vector, a constant for each number, with the options of tables."""
    path = tmp_path / "scan.mat"
    scipy.io.savemat(
        path, {"theta_i": 30.0, "theta_r": [[10.0], [-20.0]], "brdf": [0.25, 0.5], "phi": [0, 0]}
    )
    ds = read(path)
    assert_allclose(np.rad2deg(ds["theta_i"]), [30, 30])
    assert_allclose(ds["I"], [0.25, 0.5])
    assert ds.attrs["quantity"] == "brdf"
    assert_allclose(
        read(path, angles="radians", column={"theta_i": "=0.5", "theta_r": "=0.2"})["theta_i"], 0.5
    )


@pytest.mark.parametrize("keep", [20, 130, 400, 0.5])
def test_truncated_files_are_refused(tmp_path, keep):
    path = tmp_path / "paint.mat"
    scipy.io.savemat(path, arrays())
    data = path.read_bytes()
    path.write_bytes(data[: int(keep if keep > 1 else keep * len(data))])
    with pytest.raises(DataError, match=r"paint\.mat"):
        read(path)
