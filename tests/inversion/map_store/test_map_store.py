"""The store of a map: what is in it, what it refuses, what it does about lost files and full disks."""

from __future__ import annotations

import errno
import json
import pickle
import shutil
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr

pytest.importorskip("zarr")

import zarr.storage._local as zarr_files
from stand_in_fit import PARAMETERS, StandInFit, contents, picture, store_at

from pbrdf.errors import DataError
from pbrdf.inversion.map_store import DatasetSource, open_map, prepare_store, run_units


@pytest.fixture
def store(tmp_path):
    return store_at(tmp_path / "maps.zarr")


def files(store, name):
    return sorted(file for file in (store.path / name / "c").rglob("*") if file.is_file())


def test_the_map_is_that_of_the_whole_picture_at_once(store):
    seen = []
    work = run_units(store, progress=lambda done, total: seen.append((done, total)))
    assert (work.done, work.found, work.left) == (6, 0, 0)
    assert seen == [(number, 6) for number in range(7)]
    expected = store.fit.fit_block(picture())
    found = open_map(store.path)
    assert not any(
        variable.chunks or variable._in_memory
        for variable in found.data_vars.values()
        for variable in [variable.variable]
    )
    for name in expected.data_vars:
        assert found[name].dtype == expected[name].dtype
        np.testing.assert_array_equal(found[name], expected[name].transpose(*found[name].dims))
    assert found["estimate"].dims == ("parameter", "y", "x")
    assert found["parameter"].values.tolist() == PARAMETERS
    assert found["unit"].values.tolist() == ["1", "µm", ""]
    assert found["status"].attrs["flag_values"] == [0, 1, 2, 3, 4, 5, -1]
    many = expected["starts"] > 1
    assert found.attrs["pixels_fitted"] == int((expected["status"] < 2).sum())
    assert found.attrs["share_of_several_optima"] == float((expected["optima"] > 1).values[many].mean())
    assert found.attrs["model"] == "StandIn"
    # one file a unit and array
    assert [len(files(store, name)) for name in ("estimate", "flags", "status")] == [6, 6, 6]


def test_workers_that_know_nothing_of_each_other(store):
    alone = store_at(store.path.with_name("alone.zarr"))
    run_units(alone)
    assert run_units(store, worker=(2, 4)) == run_units(store, worker=(2, 4)).__class__(2, 0, 4)
    with pytest.raises(DataError, match=r"maps\.zarr: this map is not complete: 4 of 6 units are missing"):
        open_map(store.path)
    found = open_map(store.path, partial=True)
    assert found.attrs["units_missing"] == 4
    assert ((found["status"] == -1).sum() > 0) and ((found["status"] >= 0).sum() > 0)
    assert np.isnan(found["chi2"].values[found["status"].values == -1]).all()
    for worker in ((1, 4), (3, 4)):
        assert run_units(store, worker=worker).left > 0
    assert run_units(store, worker=(4, 4)).left == 0
    assert contents(store.path) == contents(alone.path)


@pytest.mark.parametrize("consolidated", [False, True])
def test_nothing_of_half_a_map_that_is_not_done_reads_as_data(store, consolidated):
    """By xarray alone, and by what opens maps: no count of 0, no flag of 0, no number; means are of what is done."""
    run_units(store, worker=(2, 4))
    expected = store.fit.fit_block(picture())
    done = np.zeros((40, 28), dtype=bool)
    for number in set(range(6)) - set(store.missing()):
        done[tuple(store.grid.slices(number).values())] = True
    with open_map(store.path, partial=True) as ours:
        plain = xr.open_zarr(store.path, consolidated=consolidated, chunks=None)
        for found in (plain, ours):
            assert found.attrs["map_complete"] == 0
            for name in ("estimate", "standard_error", "chi2", "starts", "optima"):
                assert np.isnan(found[name].values[..., ~done]).all()
                held = expected[name].transpose(*found[name].dims).values
                np.testing.assert_array_equal(found[name].values[..., done], held[..., done])
            assert float(found["starts"].mean()) == pytest.approx(
                float(expected["starts"].transpose("y", "x").values[done].mean())
            )
            for name, value in (("status", -1), ("flags", 128)):
                variable = found[name]
                said = variable.attrs["flag_meanings"].split()
                numbers = list(variable.attrs["flag_values" if name == "status" else "flag_masks"])
                assert said[numbers.index(value)] == "not_yet_fitted"
                assert variable.dtype.kind in "iu"
                assert (variable.values[..., ~done] == value).all()
                assert (variable.values[..., done] != value).all()
    run_units(store)
    whole = open_map(store.path)
    assert not any(variable.dtype.kind == "f" for variable in (whole["starts"], whole["optima"]))
    assert "_FillValue" not in whole["starts"].attrs
    np.testing.assert_array_equal(
        xr.open_zarr(store.path, consolidated=consolidated)["starts"], whole["starts"]
    )


def test_a_former_layout_is_read_where_it_is_complete_and_not_gone_on_with(store):
    """Counts of 0 in it may be pixels that nobody has come to."""

    def made_former(complete):
        file = store.path / "zarr.json"
        described = json.loads(file.read_text())
        described["attributes"] |= {"map_layout": 1, "map_complete": complete}
        file.write_text(json.dumps(described))

    run_units(store)
    made_former(1)
    assert (open_map(store.path)["status"] >= 0).all()
    assert run_units(store_at(store.path)).done == 0
    made_former(0)
    for use in (lambda: open_map(store.path, partial=True), lambda: store_at(store.path)):
        with pytest.raises(
            DataError, match=r"layout 1.*counts and flags of 0 .* Choose another folder, or complete"
        ):
            use()


def test_a_store_goes_on_and_does_nothing_twice(store, monkeypatch):
    run_units(store, worker=(1, 2))
    done = []
    do = type(store).do
    monkeypatch.setattr(
        type(store), "do", lambda self, number, *told: (done.append(number), do(self, number, *told))
    )
    again = store_at(store.path)
    assert run_units(again).found == 3
    assert done == [1, 3, 5]
    before = contents(store.path)
    assert run_units(store_at(store.path)).done == 0
    assert contents(store.path) == before and len(done) == 3


def test_a_store_of_other_settings_or_another_input_is_refused_by_name(store):
    other = picture()
    other["I"][0, 0, 0] = 0.5
    named = picture().assign_attrs(quantity="radiance")
    turned = picture().assign_coords(y=range(40)[::-1], wavelength=650.0)
    for make, words in (
        (lambda: store_at(store.path, seed=1), r"fit\.seed: 0 in the store, 1 here\. Choose another folder"),
        (
            lambda: store_at(store.path, other),
            r'input\.variables\.I\.digest: "[0-9a-f]{38}…" in the store, "',
        ),
        (lambda: store_at(store.path, named), r'attributes\.quantity: "brdf" in the store, "radiance" here'),
        (
            lambda: store_at(store.path, turned),
            r'input\.labels\.wavelength: \(none\) in the store, "650\.0" here',
        ),
        (lambda: store_at(store.path, picture(40, 30)), r"I\.form: .*x: 28.*in the store, .*x: 30"),
    ):
        with pytest.raises(
            DataError, match=rf"maps\.zarr: this map was begun with other settings: .*{words}"
        ):
            make()
    # a store that is replaced by another one while somebody works on the old one
    shutil.rmtree(store.path)
    store_at(store.path, seed=1)
    with pytest.raises(DataError, match=r"fit\.seed: 1 in the store, 0 here"):
        store.do(0)


def test_something_else_of_that_name_is_left_alone(tmp_path):
    (tmp_path / "folder.zarr").mkdir()
    (tmp_path / "file.zarr").write_text("dear")
    for name in ("folder.zarr", "file.zarr"):
        with pytest.raises(DataError, match="something else of that name, which is left alone"):
            store_at(tmp_path / name)
    picture().to_zarr(tmp_path / "data.zarr", zarr_format=3, consolidated=False)
    with pytest.raises(DataError, match="this Zarr folder is no map"):
        store_at(tmp_path / "data.zarr")
    with pytest.raises(DataError, match="there is no such map"):
        open_map(tmp_path / "none.zarr")
    store = store_at(tmp_path / "maps.zarr")
    described = json.loads((store.path / "zarr.json").read_text())
    described["attributes"]["map_layout"] = 99
    (store.path / "zarr.json").write_text(json.dumps(described))
    with pytest.raises(DataError, match="has the layout 99, of another version"):
        open_map(store.path)


@pytest.mark.parametrize("keep", [None, 0, 10, -1])
@pytest.mark.parametrize("name", ["estimate", "status"])
def test_a_file_that_is_lost_or_cut_off_is_named_and_made_again(store, name, keep):
    run_units(store)
    whole = contents(store.path)
    file = files(store, name)[2]
    if keep is None:
        file.unlink()
    else:
        file.write_bytes(file.read_bytes()[:keep])
    with pytest.raises(
        DataError, match=rf"the chunk {name}/c/.* The command that made this map writes what is lost"
    ):
        open_map(store.path)
    again = store_at(store.path)
    assert run_units(again).done == 1
    assert contents(store.path) == whole
    open_map(store.path).load()
    shutil.rmtree(store.path / name)
    with pytest.raises(DataError, match=f"the array '{name}' is missing, though zarr.json lists it"):
        open_map(store.path)


def test_a_store_that_lost_its_metadata_is_one_line(store):
    for name, words in (("estimate", "estimate"), ("status", "status")):
        file = store.path / name / "zarr.json"
        content = file.read_bytes()
        for kept in (None, b"{", b"{}"):
            file.unlink() if kept is None else file.write_bytes(kept)
            if name == "status" or kept:
                with pytest.raises(DataError, match=rf"maps\.zarr.*({words}|damaged)"):
                    open_map(store.path, partial=True)
            with pytest.raises(
                DataError, match=r"maps\.zarr.*(damaged|is missing, though zarr.json lists it)"
            ):
                run_units(store_at(store.path))
            file.write_bytes(content)


@pytest.mark.parametrize("full_at", [3, 9, 16])
def test_a_full_disk_is_one_line_and_the_map_goes_on_when_there_is_room(tmp_path, monkeypatch, full_at):
    run_units(store_at(tmp_path / "alone.zarr"))
    count, put = 0, zarr_files._put

    def full(path, value, exclusive=False):
        nonlocal count
        count += 1
        if count > full_at and full_at > 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        return put(path, value, exclusive)

    monkeypatch.setattr(zarr_files, "_put", full)
    with pytest.raises(
        DataError, match=r"maps\.zarr: (unit \d )?cannot be written: No space left on device"
    ) as told:
        run_units(store_at(tmp_path / "maps.zarr"))
    assert "\n" not in str(told.value)
    full_at = 0
    run_units(store_at(tmp_path / "maps.zarr"))
    assert contents(tmp_path / "maps.zarr") == contents(tmp_path / "alone.zarr")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["alone.zarr", "maps.zarr"]


@pytest.fixture
def small_disk(tmp_path):
    """A disk of 400 kB, and what makes it larger."""

    def mounted(*options):
        return (
            subprocess.run(["mount", *options, str(tmp_path)], capture_output=True, check=False).returncode
            == 0
        )

    if (
        sys.platform != "linux"
        or not shutil.which("mount")
        or not mounted("-t", "tmpfs", "-o", "size=400k", "tmpfs")
    ):
        pytest.skip("no disk can be mounted")
    yield tmp_path, lambda: mounted("-o", "remount,size=4m")
    subprocess.run(["umount", str(tmp_path)], check=True)


@pytest.mark.slow
def test_a_disk_that_is_really_full(small_disk, tmp_path_factory):
    disk, grow = small_disk
    dataset = picture(96, 96, 3)
    left = []
    for _ in range(2):
        with pytest.raises(
            DataError, match=r"unit \d+ cannot be written: No space left on device; what is done is"
        ):
            run_units(store_at(disk / "maps.zarr", dataset))
        left.append(len(store_at(disk / "maps.zarr", dataset).missing()))
    assert 0 < left[0] < 36 and left[1] == left[0]
    assert not list(disk.rglob("*.partial"))
    assert grow()
    assert run_units(store_at(disk / "maps.zarr", dataset)).done == left[0]
    alone = tmp_path_factory.mktemp("alone") / "maps.zarr"
    run_units(store_at(alone, dataset))
    assert contents(disk / "maps.zarr") == contents(alone)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="limits of Linux")
def test_files_that_may_not_grow_are_one_line(tmp_path):
    """What the system says when a file reaches the limit of its size, in a process of its own."""
    code = (
        "import resource, signal, sys; sys.path[:0] = sys.argv[2:]\n"
        "from stand_in_fit import *\n"
        "store = store_at(Path(sys.argv[1]))\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (3000, 3000))\n"
        "try:\n    run_units(store)\n"
        "except Exception as error:\n    print(type(error).__name__, error)\n"
    )
    path = tmp_path / "maps.zarr"
    told = subprocess.run(
        [sys.executable, "-c", code, str(path), *filter(None, sys.path)],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert (
        told
        == f"DataError {path}: unit 0 cannot be written: File too large; what is done is kept, and the same "
        + ("command goes on from there\n")
    )
    assert not list(path.rglob("*.partial"))
    run_units(store_at(path))
    run_units(store_at(tmp_path / "alone.zarr"))
    assert contents(path) == contents(tmp_path / "alone.zarr")


def test_blocks_of_another_form_are_no_units(store):
    good = store.fit.fit_block(picture().isel(store.grid.slices(0)))
    for bad, words in (
        (good.isel(y=slice(1)), "chi2: float64"),
        (good.astype(np.float32), "chi2: float32"),
        (good.assign(status=0 * good["status"] - np.int8(1)), "status: -1 of a pixel that is done"),
    ):
        with pytest.raises(AssertionError, match=words):
            store.write(0, bad)
    assert not store.is_done(0)


def test_a_store_can_be_sent_to_another_process(store):
    assert store.grid.count == 6
    sent = pickle.loads(pickle.dumps(store))
    assert not {"grid", "_arrays", "_files"} & {*vars(sent)}
    sent.do(3)
    assert store.is_done(3)


def test_any_dimensions_of_a_map(tmp_path):
    dataset = picture().expand_dims(time=3).transpose("geometry", "x", "time", "y")
    fit = StandInFit({"time": 3, "y": 40, "x": 28})
    store = prepare_store(
        tmp_path / "maps.zarr", fit, DatasetSource(dataset), shard={"y": 16, "x": 16, "time": 2}
    )
    run_units(store)
    found = open_map(store.path)
    assert found["estimate"].dims == ("parameter", "time", "y", "x")
    expected = fit.fit_block(dataset)
    np.testing.assert_array_equal(found["estimate"], expected["estimate"].transpose(*found["estimate"].dims))
