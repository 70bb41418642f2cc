"""The file of every pixel holds what the reduction found, as netCDF and as Zarr."""

import json
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from pbrdf.data.formats.csv_table.columns import COVARIANCES
from pbrdf.data.formats.zarr_folder import open_zarr
from pbrdf.errors import DataError
from pbrdf.instruments.frames.frames import ArrayFrames
from pbrdf.instruments.goniometer.angle_table import AngleTable
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.polarimeter.polarimeter import lcvr, rotating_polarizer
from pbrdf.instruments.polarimeter.polarization_errors import debiased_dolp, polarization
from pbrdf.instruments.polarimeter.retardance_sets import retardance_set
from pbrdf.instruments.reduction.map_files import MapWriter
from pbrdf.instruments.reduction.reduce import reduce
from pbrdf.instruments.reduction.stokes_image import reduce_frames
from pbrdf.instruments.reduction.streaming import reduced_blocks
from pbrdf.optics.angles import within_half_turn

DETECTOR = Detector(bits=12, gain=3.0, read_noise=5.0, offset=60.0)


def written(path, polarimeter, frames, **options):
    instrument = Instrument(polarimeter, DETECTOR, reference_angle=np.deg2rad(20.0))
    reduce(frames, instrument, [MapWriter(path, frames, instrument, **options)], max_memory=1_000_000)
    if path.suffix == ".zarr":
        listed = json.loads((path / "zarr.json").read_text(encoding="utf-8"))
        assert listed["zarr_format"] == 3
        with open_zarr(path) as file:
            assert {*file.variables} == {*listed["consolidated_metadata"]["metadata"]}
            return file.load()
    return xr.open_dataset(path, engine="h5netcdf").load()


@pytest.fixture
def frames():
    raw = np.random.default_rng(3).integers(80, 3000, (2, 4, 300, 40)).astype(np.uint16)
    raw[1, 2, 7, 5] = 4095
    return ArrayFrames(raw, ("first", "second"))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["nc", "zarr"])
def test_what_was_found_is_read_back(tmp_path, frames, kind):
    if kind == "zarr":
        pytest.importorskip("zarr")
    polarimeter = lcvr(retardance_set("tetrahedron"))
    file = written(tmp_path / f"stokes.{kind}", polarimeter, frames)
    assert file["series"].values.tolist() == ["first", "second"]
    for s in range(2):
        image = reduce_frames(frames.array[s], polarimeter, DETECTOR)
        found = polarization(image.stokes, image.covariance)
        expected = {
            **dict(zip("IQUV", image.stokes, strict=True)),
            **{name: image.covariance[i, j] for (i, j), name in COVARIANCES.items()},
            "dolp": found.dolp,
            "dolp_debiased": debiased_dolp(image.stokes, image.covariance),
            "dolp_std": found.dolp_std,
            "aolp": np.rad2deg(found.aolp),
            "aolp_std": np.rad2deg(found.aolp_std),
            "docp": found.docp,
            "docp_std": found.docp_std,
            "flags": image.flags,
        }
        assert set(expected) == set(file.data_vars)
        for name, values in expected.items():
            assert file[name].dims == ("series", "y", "x")
            there = file[name].values[s]
            if name == "aolp":
                # at its two ends an axis is the same: single precision may bring −89.9999999° to +90°
                there = values + within_half_turn(there - values, 90.0)
            np.testing.assert_allclose(there, values, rtol=1e-6, atol=1e-6, err_msg=name)
    assert file["flags"].values[1, 7, 5] == 1
    assert file["flags"].attrs["flag_meanings"] == "saturated dead dark not_yet_reduced"
    assert np.isnan(file["I"].values[1, 7, 5])
    assert file["aolp"].attrs["units"] == "degree"
    assert json.loads(file.attrs["polarimeter"])["kind"] == "lcvr"
    assert json.loads(file.attrs["detector"])["bits"] == 12
    assert file.attrs["reference_angle_degree"] == pytest.approx(20.0)


def test_angles_beside_minus_90_degrees_are_not_rounded_to_it(tmp_path, frames):
    """Single precision has no number between −90° and what U = −1e-10 makes of it: it is the other end."""
    instrument = Instrument(lcvr(retardance_set("tetrahedron")), DETECTOR)
    stokes = np.array([[1.0, 1.0, 1.0], [-1.0, -1.0, -1.0], [-1e-10, -0.0, -0.01], [0.0, 0.0, 0.0]])[:, None]
    nothing = {"covariance": np.zeros((4, 4, 1, 3)), "flags": np.zeros((1, 3), np.uint8)}
    block = type("Block", (), {"image": type("StokesImage", (), {"stokes": stokes, **nothing})})
    with MapWriter(tmp_path / "stokes.nc", frames, instrument) as writer:
        found = writer.prepare(block)["aolp"][0]
    assert found.tolist() == [90.0, 90.0, pytest.approx(-89.7135)]


def test_components_that_are_not_determined_have_no_variable(tmp_path, frames):
    file = written(tmp_path / "stokes.nc", rotating_polarizer(np.deg2rad([0, 45, 90, 135])), frames)
    assert {"I", "Q", "U", "cov_QU", "aolp"} <= set(file.data_vars)
    assert not {"V", "cov_IV", "cov_VV", "docp", "docp_std"} & set(file.data_vars)


@pytest.mark.slow
def test_angles_stand_beside_the_series(tmp_path, frames):
    table = AngleTable(
        ("second", "first"), np.deg2rad([20.0, 10.0]), np.deg2rad([30.0, 40.0]), reference_angle=[np.nan, 0.0]
    )
    file = written(tmp_path / "stokes.nc", lcvr(retardance_set("tetrahedron")), frames, angles=table)
    np.testing.assert_allclose(file["theta_i"].values, [10.0, 20.0])
    np.testing.assert_allclose(file["reference_angle"].values, [0.0, 20.0])
    assert file["theta_i"].attrs["units"] == "degree"


def test_another_extension(tmp_path, frames):
    with pytest.raises(DataError, match=r"written as \.nc or \.zarr"):
        MapWriter(tmp_path / "stokes.tif", frames, Instrument(lcvr(retardance_set("tetrahedron")), DETECTOR))


@pytest.mark.parametrize("kind", ["nc", "zarr"])
def test_half_a_file_has_no_name_and_what_was_not_written_is_no_good_pixel(tmp_path, frames, kind):
    if kind == "zarr":
        pytest.importorskip("zarr")
    instrument = Instrument(rotating_polarizer(np.deg2rad([0, 45, 90, 135])), DETECTOR)
    path = tmp_path / f"stokes.{kind}"
    writer = MapWriter(path, frames, instrument)

    def half():
        with writer:
            for block, part in reduced_blocks(frames, instrument, lambda b: (b, writer.prepare(b))):
                if block.series == 1:
                    break
                writer.add(block, part)
            if kind == "nc":
                writer._file.flush()
            (hidden,) = tmp_path.iterdir()
            assert hidden.name.startswith(f".stokes.{kind}.") and hidden.suffix == ".tmp"
            options = {"nc": {"engine": "h5netcdf"}, "zarr": {"engine": "zarr", "consolidated": False}}
            with xr.open_dataset(hidden / path.name, **options[kind]) as found:
                assert found["flags"].dtype == np.uint8
                assert (found["flags"].values[0] < 8).all() and np.isfinite(found["I"].values[0]).any()
                assert (found["flags"].values[1] == 128).all() and np.isnan(found["I"].values[1]).all()
                attrs = found["flags"].attrs
                meanings = dict(zip(attrs["flag_masks"], attrs["flag_meanings"].split(), strict=True))
                assert meanings[128] == "not_yet_reduced"
            raise KeyError("the reduction fails")

    with pytest.raises(KeyError):
        half()
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="signals of Unix")
def test_what_a_kill_leaves_goes_with_the_next_reduction(tmp_path, frames):
    code = (
        "import os, sys; sys.path[:0] = sys.argv[2:]\n"
        "from test_map_files import *\n"
        "frames = ArrayFrames(np.full((2, 4, 300, 40), 900, dtype=np.uint16))\n"
        "MapWriter.add = lambda *_: os.kill(os.getpid(), signal.SIGKILL)\n"
        "written(Path(sys.argv[1]), lcvr(retardance_set('tetrahedron')), frames)\n"
    )
    path = tmp_path / "stokes.nc"
    arguments = [sys.executable, "-c", code, str(path), str(Path(__file__).parent), *filter(None, sys.path)]
    assert subprocess.run(arguments, check=False).returncode == -signal.SIGKILL
    assert [file.name.startswith(".stokes.nc.") for file in tmp_path.iterdir()] == [True]
    written(path, lcvr(retardance_set("tetrahedron")), frames)
    assert [file.name for file in tmp_path.iterdir()] == ["stokes.nc"]


def test_a_full_disk_is_told_by_the_name_of_the_file(tmp_path, frames, monkeypatch):
    from pbrdf.files.netcdf_files import PatientFile

    writer = MapWriter(
        tmp_path / "stokes.nc", frames, Instrument(lcvr(retardance_set("tetrahedron")), DETECTOR)
    )
    made = PatientFile.__init__

    def full(self, path):
        made(self, path)
        self.error = OSError(28, "No space left on device")

    monkeypatch.setattr(PatientFile, "__init__", full)
    with pytest.raises(DataError) as told, writer:
        raise AssertionError("not reached")
    assert str(told.value) == f"{tmp_path / 'stokes.nc'}: cannot be written: No space left on device"
    assert not list(tmp_path.iterdir())
