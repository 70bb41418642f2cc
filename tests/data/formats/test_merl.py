"""MERL files against an independent statement of the published lookup (``BRDFRead.cpp``, Matusik et al. 2003)."""

from __future__ import annotations

import math
import struct

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pbrdf.data import read
from pbrdf.data.formats.merl import cell_centres, look_up, read_planes, write_planes
from pbrdf.errors import DataError
from pbrdf.optics.half_difference import directions

SCALES = {"red": 1.0 / 1500.0, "green": 1.15 / 1500.0, "blue": 1.66 / 1500.0}
PLANE = 90 * 90 * 180


@pytest.fixture(scope="module")
def planes():
    """A different number in every cell, about the size of a BRDF, with some invalid."""
    numbers = np.arange(3.0 * PLANE).reshape(3, 90, 90, 180) / PLANE + 0.01
    numbers[:, 40, 10, 20] = np.nan
    numbers[1, 40, 11, 20] = np.nan
    return numbers


@pytest.fixture(scope="module")
def file(planes, tmp_path_factory):
    path = tmp_path_factory.mktemp("merl") / "paint.binary"
    write_planes(planes, path)
    return path


def published_index(theta_h, theta_d, phi_d):
    """Which number of a colour's plane the published code looks up; degrees."""
    half = min(int(math.sqrt(theta_h / 90.0 * 90 * 90)), 89)
    difference = min(int(theta_d / 90.0 * 90), 89)
    azimuth = min(int((phi_d + 180.0 if phi_d < 0 else phi_d) / 180.0 * 180), 179)
    return azimuth + 180 * (difference + 90 * half)


# θ_h, θ_d, φ_d in degrees and the cell by hand: √(θ_h · 90), θ_d and φ_d (+ 180°), rounded down
BY_HAND = [
    ((0.001, 0.5, 0.5), (0, 0, 0)),
    ((0.0112, 0.5, 90.5), (1, 0, 90)),
    ((10.1, 25.5, 150.2), (30, 25, 150)),
    ((10.1, 25.5, -29.8), (30, 25, 150)),
    ((39.9, 44.9, 179.9), (59, 44, 179)),
    ((40.1, 1.5, -179.9), (60, 1, 0)),
    ((60.0, 27.3, 95.0), (73, 27, 95)),
    ((80.0, 8.5, -90.5), (84, 8, 89)),
]


@pytest.mark.parametrize(("angles", "cell"), BY_HAND)
def test_the_cell_of_a_geometry(planes, angles, cell):
    assert published_index(*angles) == cell[2] + 180 * (cell[1] + 90 * cell[0])
    found = look_up(planes, *directions(*np.deg2rad(angles)))
    assert_array_equal(found, planes[:, *cell])


@pytest.mark.parametrize(("angles", "cell"), BY_HAND)
@pytest.mark.parametrize("colour", SCALES)
def test_the_bytes_of_a_cell(file, planes, angles, cell, colour):
    """Three int32, then the planes of red, green and blue as float64; a number times the colour's scale is in 1/sr."""
    which = list(SCALES).index(colour)
    with file.open("rb") as stream:
        assert struct.unpack("<3i", stream.read(12)) == (90, 90, 180)
        stream.seek(12 + 8 * (which * PLANE + published_index(*angles)))
        (number,) = struct.unpack("<d", stream.read(8))
    assert number * SCALES[colour] == pytest.approx(planes[which, *cell], rel=1e-14)
    assert file.stat().st_size == 12 + 24 * PLANE


def test_random_geometries_find_the_published_cell(planes):
    """From the two directions, by the published rotations: about ẑ by −φ_h and about ŷ by −θ_h."""
    rng = np.random.default_rng(5)
    theta_i, theta_r = np.arccos(rng.uniform(0.02, 1.0, (2, 500)))
    phi = rng.uniform(-np.pi, np.pi, 500)
    found = look_up(planes, theta_i, theta_r, phi)[:, 0]
    for row in range(500):
        i = np.array([-math.sin(theta_i[row]), 0.0, math.cos(theta_i[row])])
        sine = math.sin(theta_r[row])
        o = np.array([sine * math.cos(phi[row]), sine * math.sin(phi[row]), math.cos(theta_r[row])])
        h = (i + o) / np.linalg.norm(i + o)
        theta_h, phi_h = math.acos(h[2]), math.atan2(h[1], h[0])
        x = math.cos(phi_h) * i[0] + math.sin(phi_h) * i[1]
        y = math.cos(phi_h) * i[1] - math.sin(phi_h) * i[0]
        x, z = (
            math.cos(theta_h) * x - math.sin(theta_h) * i[2],
            math.sin(theta_h) * x + math.cos(theta_h) * i[2],
        )
        index = published_index(*np.rad2deg([theta_h, math.acos(z), math.atan2(y, x)]))
        np.testing.assert_equal(found[row], planes[0].ravel()[index])


def test_exchanging_source_and_viewer_finds_the_same_cell(planes):
    """Reciprocity: φ_d and φ_d + π are one cell."""
    rng = np.random.default_rng(6)
    theta_i, theta_r = np.arccos(rng.uniform(0.1, 1.0, (2, 200)))
    phi = rng.uniform(-np.pi, np.pi, 200)
    assert_array_equal(look_up(planes, theta_i, theta_r, phi), look_up(planes, theta_r, theta_i, -phi))


@pytest.mark.slow
def test_what_was_written_comes_back(file, planes):
    assert_allclose(read_planes(file), planes, rtol=1e-15)


@pytest.mark.slow
def test_a_data_set_holds_the_valid_cells_at_their_middle(file, planes):
    ds = read(file, every=2)
    planes = planes[:, ::2, ::2, ::2]
    theta_h, theta_d, phi_d = np.meshgrid(*(a[::2] for a in cell_centres()), indexing="ij")
    i, r, phi = directions(theta_h, theta_d, phi_d)
    above = (i < np.pi / 2) & (r < np.pi / 2)
    assert ds.sizes["geometry"] == 3 * above.sum() - 3
    assert sorted(np.unique(ds["group"])) == ["blue", "green", "red"]
    green = ds.isel(geometry=ds["group"].values == "green")
    valid = above & np.isfinite(planes[1])
    assert_allclose(green["I"], planes[1][valid], rtol=1e-14)
    for name, expected in (("theta_i", i), ("theta_r", r), ("phi", phi)):
        assert_array_equal(green[name], expected[valid])
    assert ds.attrs["quantity"] == "brdf"
    assert np.isnan(ds["wavelength"]).all()


def test_a_table_of_a_million_cells_is_thinned_to_what_can_be_fitted(file, planes):
    """One cell in 5 along each axis, unless another number is asked for."""
    ds = read(file)
    assert "one node in 5 of each angle" in ds.attrs["source"]
    assert 5_000 < ds.sizes["geometry"] / 3 <= 20_000
    tenth = read(file, every=10)
    red = tenth.isel(geometry=tenth["group"].values == "red")
    assert_array_equal(
        look_up(planes, *(red[n].values for n in ("theta_i", "theta_r", "phi")))[:, 0].round(9),
        red["I"].round(9),
    )
    with pytest.raises(DataError, match=r"every=1\.5: give a whole number from 1"):
        read(file, every=1.5)


@pytest.mark.parametrize("length", [0, 5, 12, 12 + 8 * PLANE, 12 + 24 * PLANE - 1])
def test_a_truncated_file_is_told(file, tmp_path, length):
    path = tmp_path / "short.binary"
    path.write_bytes(file.read_bytes()[:length])
    with pytest.raises(DataError, match=r"short\.binary: .*(truncated|too short for the cell numbers)"):
        read(path)


def test_another_file_is_told(tmp_path):
    path = tmp_path / "other.binary"
    path.write_bytes(struct.pack("<3i", 64, 64, 128) + bytes(1000))
    with pytest.raises(
        DataError, match=r"other\.binary: this is not a MERL file: it begins with \(64, 64, 128\)"
    ):
        read(path)
    path.write_bytes(struct.pack("<3i", 90, 90, 180) + bytes(24 * PLANE + 8))
    with pytest.raises(DataError, match="34992020 bytes, a MERL file has 34992012: it is not a MERL file"):
        read(path)


def test_a_table_without_a_valid_cell_is_told(tmp_path):
    write_planes(np.full((3, 90, 90, 180), np.nan), tmp_path / "empty.binary")
    with pytest.raises(DataError, match="no cell of the table is valid"):
        read(tmp_path / "empty.binary")


def test_only_whole_tables_are_written(tmp_path):
    with pytest.raises(DataError, match=r"planes of the shape \(90, 90, 180\); \(3, 90, 90, 180\) is needed"):
        write_planes(np.zeros((90, 90, 180)), tmp_path / "paint.binary")
    with pytest.raises(DataError, match="cannot be written"):
        write_planes(np.zeros((3, 90, 90, 180)), tmp_path / "nowhere" / "paint.binary")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("value", "said"), [(-1e-9, "-1e-09"), (np.inf, "inf")])
def test_what_readers_would_take_for_no_value_is_not_written(tmp_path, value, said):
    planes = np.ones((3, 90, 90, 180))
    planes[1, 40, 10, 20] = value
    with pytest.raises(
        DataError, match=rf"green is {said} in the cell \(40, 10, 20\): the format holds finite values"
    ):
        write_planes(planes, tmp_path / "paint.binary")
    assert list(tmp_path.iterdir()) == []
