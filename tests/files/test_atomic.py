"""Files and folders appear whole or not at all."""

from __future__ import annotations

import pytest

from pbrdf.errors import DataError
from pbrdf.files.atomic import (
    atomic_file,
    atomic_folder,
    atomic_new_folder,
    require_new_folder,
    require_writable_folder,
)


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "data.csv"
    path.write_text("old")
    with pytest.raises(RuntimeError), atomic_file(path) as target:
        target.write_text("half")
        raise RuntimeError
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_missing_folder_is_named(tmp_path):
    with (
        pytest.raises(DataError, match="cannot be written"),
        atomic_file(tmp_path / "no" / "x.csv") as target,
    ):
        target.write_text("")


def test_a_file_in_place_of_the_folder_is_reported_as_such(tmp_path):
    (tmp_path / "file").write_text("not a folder")
    with (
        pytest.raises(DataError, match="cannot be written"),
        atomic_file(tmp_path / "file" / "x.csv") as target,
    ):
        target.write_text("x")


def test_a_folder_is_tried_without_a_trace(tmp_path):
    require_writable_folder(tmp_path / "a" / "b" / "fit")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "file").write_text("")
    with pytest.raises(DataError, match="there is a file of that name"):
        require_writable_folder(tmp_path / "file")
    with pytest.raises(DataError, match="cannot be written"):
        require_writable_folder(tmp_path / "file" / "fit")


def test_a_folder_that_is_there_is_filled_but_a_zarr_store_in_it_is_replaced_as_a_whole(tmp_path):
    """Pieces of an old store among those of the new one would be read as data."""
    for name, text in (
        ("figures/mine.txt", "mine"),
        ("figures/a.txt", "old"),
        ("maps.zarr/c/9", "old piece"),
    ):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    with atomic_folder(tmp_path, fill=True) as folder:
        for name in ("figures/a.txt", "maps.zarr/c/0", "summary.txt"):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text("new")
    found = {str(p.relative_to(tmp_path)): p.read_text() for p in tmp_path.rglob("*") if p.is_file()}
    assert found == {
        "figures/mine.txt": "mine",
        "figures/a.txt": "new",
        "maps.zarr/c/0": "new",
        "summary.txt": "new",
    }


def test_a_folder_is_replaced_as_a_whole(tmp_path):
    for text in ("old", "new"):
        with atomic_folder(tmp_path / "a" / "folder") as folder:
            (folder / text).write_text(text)
    assert [path.name for path in (tmp_path / "a").rglob("*")] == ["folder", "new"]


@pytest.mark.parametrize("fill", [False, True])
def test_a_failure_leaves_the_old_folder_and_nothing_of_the_new_one(tmp_path, fill):
    (tmp_path / "old").mkdir()
    (tmp_path / "old" / "a.txt").write_text("old")
    for name in ("old", "new/deep"):
        with pytest.raises(RuntimeError), atomic_folder(tmp_path / name, fill=fill) as folder:
            (folder / "a.txt").write_text("half")
            raise RuntimeError
    assert [path.name for path in tmp_path.rglob("*")] == ["old", "a.txt"]
    assert (tmp_path / "old" / "a.txt").read_text() == "old"


@pytest.mark.parametrize("fill", [False, True])
def test_a_file_is_not_replaced_by_a_folder(tmp_path, fill):
    (tmp_path / "file").write_text("mine")
    with (
        pytest.raises(DataError, match="file: cannot be written: there is a file of that name"),
        atomic_folder(tmp_path / "file", fill=fill),
    ):
        pass
    assert (tmp_path / "file").read_text() == "mine"
    assert len(list(tmp_path.iterdir())) == 1


def test_of_two_that_make_the_same_folder_the_first_is_kept(tmp_path):
    with atomic_new_folder(tmp_path / "maps.zarr") as ours:
        (ours / "whose").write_text("ours")
        with atomic_new_folder(tmp_path / "maps.zarr") as theirs:
            (theirs / "whose").write_text("theirs")
        assert (tmp_path / "maps.zarr" / "whose").read_text() == "theirs"
    assert (tmp_path / "maps.zarr" / "whose").read_text() == "theirs"
    assert [path.name for path in tmp_path.iterdir()] == ["maps.zarr"]
    with (
        pytest.raises(DataError, match=r"nowhere/maps\.zarr: cannot be written: No such file"),
        atomic_new_folder(tmp_path / "nowhere" / "maps.zarr"),
    ):
        pass
    with pytest.raises(RuntimeError), atomic_new_folder(tmp_path / "other.zarr"):
        raise RuntimeError
    assert [path.name for path in tmp_path.iterdir()] == ["maps.zarr"]


def test_a_new_folder_is_one_that_is_not_there_or_empty(tmp_path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "file").write_text("")
    require_new_folder(tmp_path / "new")
    require_new_folder(tmp_path / "empty")
    for name, words in (("file", "something of that name already"), ("no/new", "there is no folder")):
        with pytest.raises(DataError, match=words):
            require_new_folder(tmp_path / name)
    with pytest.raises(DataError, match="something of that name already"):
        require_new_folder(tmp_path)


def test_a_file_in_a_folder_that_is_being_written_is_told_by_the_name_that_it_would_have_got(tmp_path):
    with (
        pytest.raises(DataError) as told,
        atomic_folder(tmp_path / "run") as folder,
        atomic_file(folder / "a.txt"),
    ):
        raise OSError(28, "No space left on device")
    assert str(told.value) == f"{tmp_path / 'run' / 'a.txt'}: cannot be written: No space left on device"
