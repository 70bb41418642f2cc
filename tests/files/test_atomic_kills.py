"""A process that is killed while it writes, at any step, leaves what was there or what is new."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
import time

import pytest

from pbrdf.errors import DataError
from pbrdf.files import atomic
from pbrdf.files.atomic import MARK, atomic_file, atomic_folder, require_whole

posix = pytest.mark.skipif(sys.platform == "win32", reason="forks")

#: Writes a folder or a file, again and again in processes that end at their first, second … step that Python tells of
#: (opening, renaming, linking, removing), until one comes to its end. What each left is written out, a line each.
SCRIPT = """
import os, shutil, sys
from pathlib import Path
from pbrdf.files import atomic

root, kind, exchange = Path(sys.argv[1]), sys.argv[2], sys.argv[3] == "exchange"
if not exchange:
    atomic._exchanged = lambda one, other: False
place = root / "fit"

def write(text):
    if kind == "file":
        with atomic.atomic_file(place) as target:
            target.write_text(text)
        return
    with atomic.atomic_folder(place, fill=kind == "fill") as folder:
        (folder / "figures").mkdir()
        for name in ("a", "b", "figures/c"):
            (folder / name).write_text(text)

def content():
    if place.is_file():
        return [place.read_text()]
    return sorted(f"{p.relative_to(place)}={p.read_text()}" for p in place.rglob("*") if p.is_file())

step = 0
while True:
    shutil.rmtree(root)
    root.mkdir()
    write("old")
    if kind == "fill":
        (place / "figures" / "mine").write_text("mine")
    child = os.fork()
    if child == 0:
        seen = 0
        def told(event, arguments):
            global seen
            if event.partition(".")[0] in ("os", "open", "shutil", "ctypes"):
                seen += 1
                if seen > step:
                    os._exit(9)
        sys.addaudithook(told)
        write("new")
        os._exit(0)
    ended = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    left = content()
    write("newest")
    print(ended, left, sorted(p.name for p in root.iterdir()), content(), sep="|")
    if ended == 0:
        break
    step += 1
"""


def kills(tmp_path, kind, exchange="exchange"):
    """For each step: how the process ended, what was left, names beside, and content after the next run."""
    root = tmp_path / "root"
    root.mkdir()
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(root), kind, exchange], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return [line.split("|") for line in done.stdout.splitlines()]


def expected(kind, text):
    return str([f"a={text}", f"b={text}", f"figures/c={text}", *["figures/mine=mine"] * (kind == "fill")])


@posix
@pytest.mark.slow
@pytest.mark.parametrize("kind", ["fill", "whole", "file"])
def test_a_killed_process_leaves_the_old_or_the_new_and_the_next_one_tidies_up(tmp_path, kind):
    if kind != "file" and not sys.platform.startswith(("linux", "darwin")):
        pytest.skip("folders cannot change places in one step")
    steps = kills(tmp_path, kind)
    assert len(steps) > (15 if kind == "fill" else 5)
    old, new, newest = (
        str([text]) if kind == "file" else expected(kind, text) for text in ("old", "new", "newest")
    )
    for ended, left, names, after in steps[:-1]:
        assert ended == "9"
        assert left in (old, new)
        assert (names, after) == ("['fit']", newest)
    assert steps[0][1] == old
    assert steps[-1][:2] == ["0", new]


@posix
@pytest.mark.slow
def test_where_folders_cannot_change_places_a_mixture_is_marked(tmp_path):
    steps = kills(tmp_path, "fill", "moves")
    whole = [expected("fill", text) for text in ("old", "new")]
    marked = [left for _, left, _, _ in steps if MARK in left]
    assert marked
    assert all(left in whole for _, left, _, _ in steps if left not in marked)
    for _, _, names, after in steps:
        assert (names, after) == ("['fit']", expected("fill", "newest"))


@posix
@pytest.mark.slow
def test_where_folders_cannot_change_places_one_replaced_as_a_whole_is_put_back(tmp_path):
    for _, left, names, after in kills(tmp_path, "whole", "moves"):
        assert left in (*(expected("whole", text) for text in ("old", "new")), "[]")
        assert (names, after) == ("['fit']", expected("whole", "newest"))
    place = tmp_path / "fit"
    aside = tmp_path / ".fit.0123abcd.tmp" / "old"
    aside.mkdir(parents=True)
    (aside / "a").write_text("old")
    with pytest.raises(RuntimeError), atomic_folder(place):
        raise RuntimeError
    assert (place / "a").read_text() == "old"
    assert list(tmp_path.glob(".*")) == []


def test_a_marked_folder_is_refused_and_the_next_run_makes_it_whole(tmp_path):
    import pbrdf

    (tmp_path / MARK).write_text("")
    (tmp_path / "fit.nc").write_text("")
    with pytest.raises(DataError, match=r"files of two runs are mixed in it"):
        pbrdf.load_fit(tmp_path)
    with atomic_folder(tmp_path, fill=True) as folder:
        (folder / "a").write_text("new")
    require_whole(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "fit.nc"]


@posix
def test_the_folder_one_stands_in_stays_the_same_folder(tmp_path, monkeypatch):
    place = tmp_path / "out"
    (place / "sub").mkdir(parents=True)
    (place / "a").write_text("old")
    before = place.stat().st_ino
    monkeypatch.chdir(place / "sub")
    with atomic_folder(place, fill=True) as folder:
        (folder / "a").write_text("new")
    assert place.stat().st_ino == before
    assert sorted(path.name for path in place.iterdir()) == ["a", "sub"]
    assert (place / "a").read_text() == "new"


@posix
def test_a_folder_that_is_exchanged_keeps_rights_links_and_what_others_put_there(tmp_path):
    place = tmp_path / "out"
    (place / "notes").mkdir(parents=True)
    (place / "notes" / "mine").write_text("mine")
    (place / "link").symlink_to("nowhere")
    place.chmod(0o750)
    inode = (place / "notes" / "mine").stat().st_ino
    with atomic_folder(place, fill=True) as folder:
        (folder / "a").write_text("new")
    assert sorted(path.name for path in place.iterdir()) == ["a", "link", "notes"]
    assert place.stat().st_mode & 0o777 == 0o750
    assert (place / "link").readlink().name == "nowhere"
    assert (place / "notes" / "mine").stat().st_ino == inode


def test_very_many_files_of_others_are_not_linked_but_stay(tmp_path, monkeypatch):
    monkeypatch.setattr(atomic, "_MOST_LINKS", 3)
    place = tmp_path / "out"
    place.mkdir()
    for number in range(5):
        (place / str(number)).write_text("mine")
    with atomic_folder(place, fill=True) as folder:
        (folder / "a").write_text("new")
    assert sorted(path.name for path in place.iterdir()) == [*map(str, range(5)), "a"]


def test_a_folder_does_not_take_the_place_of_a_file_in_it_or_the_other_way_round(tmp_path):
    (tmp_path / "x").write_text("mine")
    (tmp_path / "y").mkdir()
    for name in "xy":
        with (
            pytest.raises(DataError, match="cannot be written"),
            atomic_folder(tmp_path, fill=True) as folder,
        ):
            (folder / "x").mkdir() if name == "x" else (folder / "y").write_text("")
    assert (tmp_path / "x").read_text() == "mine"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["x", "y"]


@posix
def test_what_a_living_process_writes_is_not_tidied_up(tmp_path):
    path = tmp_path / "a.txt"
    with atomic_file(path) as outer:
        outer.write_text("outer")
        with atomic_file(path) as inner:
            inner.write_text("inner")
        assert path.read_text() == "inner"
    assert path.read_text() == "outer"
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_that_an_older_version_left_goes_after_a_day_and_others_never(tmp_path):
    path = tmp_path / "a.txt"
    left, recent, other = (
        tmp_path / name for name in (".a.txt.0123abcd.tmp", ".a.txt.1123abcd.tmp", ".a.txt.tmp")
    )
    for file in (left, recent, other):
        file.write_text("")
    for file in (left, other):
        os.utime(file, (time.time() - 100_000,) * 2)
    with atomic_file(path) as target:
        target.write_text("")
    assert sorted(tmp_path.iterdir()) == sorted([recent, other, path])


WRITERS = """
import sys
from pathlib import Path
import pbrdf
from pbrdf.files.atomic import atomic_folder
root, mine = Path(sys.argv[1]), sys.argv[2]
paint = pbrdf.load_paint(mine)
for _ in range(150):
    paint.to_json(root / "model.json")
    pbrdf.load_model(root / "model.json")
for _ in range(60):
    with atomic_folder(root / "fit", fill=True) as folder:
        for name in ("a", "b", "c"):
            (folder / name).write_text(mine)
"""


@pytest.mark.slow
def test_two_processes_with_one_output_leave_that_of_one(tmp_path):
    names = ("white", "matte-white-thick")
    running = [
        subprocess.Popen(
            [sys.executable, "-c", textwrap.dedent(WRITERS), str(tmp_path), name],
            stderr=subprocess.PIPE,
            text=True,
        )
        for name in names
    ]
    seen = set()
    while any(process.poll() is None for process in running):
        try:
            handle = os.open(tmp_path / "fit", os.O_RDONLY)
        except OSError:
            time.sleep(0.01)
            continue
        try:  # one and the same folder, whichever has the name by now
            found = {name: os.open(name, os.O_RDONLY, dir_fd=handle) for name in "abc"}
            seen.add(tuple(os.read(file, 100).decode() for file in found.values()))
            for file in found.values():
                os.close(file)
        except FileNotFoundError:
            pass  # it was the old one, and is being removed
        finally:
            os.close(handle)
    errors = [process.communicate()[1] for process in running]
    assert [process.returncode for process in running] == [0, 0], errors
    assert all(len(set(texts)) == 1 for texts in seen), seen
    assert seen
    assert sorted(path.name for path in tmp_path.iterdir()) == ["fit", "model.json"]


@pytest.mark.slow
def test_threads_write_one_model(tmp_path):
    from concurrent.futures import ThreadPoolExecutor

    import pbrdf

    paint = pbrdf.load_paint("white")
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda _: paint.to_json(tmp_path / "model.json"), range(400)))
    assert pbrdf.load_model(tmp_path / "model.json") == paint
    assert [path.name for path in tmp_path.iterdir()] == ["model.json"]
