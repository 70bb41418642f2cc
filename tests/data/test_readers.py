"""Formats are found by extension, by content and by name; others join them, and do no harm where they are broken."""

from __future__ import annotations

import re
import struct
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from typer.testing import CliRunner

import pbrdf
from pbrdf.cli.main import app
from pbrdf.data import Reader, make_dataset, read, readers, register_reader, write
from pbrdf.errors import DataError, PluginWarning

OWN = list(readers._OWN)
DOCUMENT = Path(__file__).parents[2] / "docs" / "data-format.md"

TABLE = "theta_i,theta_r,brdf\n30,30,0.5\n"


@pytest.fixture
def ds():
    return make_dataset(0.5, 0.25, 0.0, quantity="brdf", I=1.0)


@pytest.mark.parametrize("name", ["data.csv", "data.nc"])
def test_the_extension_chooses_the_format(tmp_path, ds, name):
    write(ds, tmp_path / name)
    assert read(tmp_path / name).identical(ds)
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_an_existing_file_is_replaced(tmp_path, ds):
    (tmp_path / "data.csv").write_text("old")
    write(ds, str(tmp_path / "data.csv"))
    assert read(str(tmp_path / "data.csv")).identical(ds)


def test_the_format_can_be_stated(text_file):
    assert_array_equal(read(text_file(TABLE, "data.asc"), format="csv")["I"], [0.5])


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        (
            "data.csv",
            {"format": "xml"},
            "'xml' is not known; use one of csv, netcdf, zarr, scatmech, cornell",
        ),
        ("data.csv", {"were": {}}, "no option 'were'; its options are column, where, skip_invalid"),
        ("data.brdf", {"column": {}}, "no option 'column'; its options are wavelength"),
        ("data.nc", {"wavelength": 5}, "it has no options"),
    ],
)
def test_what_is_not_known_is_answered_with_the_choices(text_file, name, options, words):
    with pytest.raises(DataError, match=words):
        read(text_file(TABLE, name), **options)


def test_a_table_with_angles_is_known_by_its_names_whatever_its_extension(text_file):
    assert_array_equal(read(text_file(TABLE, "data.asc"))["I"], [0.5])
    for content in ("time_s,current\n1,2\n", "words\n", ""):
        with pytest.raises(DataError, match=r"extension '\.xyz' is not known"):
            read(text_file(content, "data.xyz"))


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(DataError, match=r"no\.csv: there is no such file"):
        read(tmp_path / "no.csv")


def test_only_formats_that_keep_everything_are_written(tmp_path, ds):
    with pytest.raises(DataError, match=r"'\.brdf' cannot be written; use \.csv or \.nc or \.zarr"):
        write(ds, tmp_path / "data.brdf")


# --- content --------------------------------------------------------------------------------------


def test_a_file_of_another_name_is_known_by_its_content(tmp_path, ds):
    write(ds, tmp_path / "data.nc")
    (tmp_path / "data.nc").rename(tmp_path / "data.h5")
    assert read(tmp_path / "data.h5").identical(ds)
    # found, and then refused by the reader of the format
    for name, content, words in (
        ("a.bin", b"tensor_file\0", "ends within its header"),
        ("b.bin", struct.pack("<3i", 90, 90, 180), "a MERL file has"),
        ("c.asc", b"lambda,thetai,f_r11\n", "no column 'phi' or 'phii'"),
        ("wrong.nc", b"theta_i,theta_r\n", "cannot be read as netCDF"),
    ):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(DataError, match=words):
            read(tmp_path / name)


def test_a_zarr_folder_of_another_name_is_known_by_its_content(tmp_path, ds):
    write(ds, tmp_path / "data.zarr")
    (tmp_path / "data.zarr").rename(tmp_path / "data")
    assert read(tmp_path / "data").identical(ds)


# --- readers of others ----------------------------------------------------------------------------


@pytest.fixture(autouse=True)
def _no_readers_left_behind(monkeypatch):
    monkeypatch.setattr(readers, "_registered", {})
    yield
    readers._installed.cache_clear()


def read_pairs(path, *, every=None, level=1.0):
    """Lines of theta_r and value."""
    theta_r, values = np.loadtxt(path, skiprows=1, ndmin=2).T
    return make_dataset(0.5, theta_r, 0.0, quantity="brdf", I=level * values)


def write_pairs(ds, path):
    pairs = zip(ds["theta_r"].values, ds["I"].values, strict=True)
    path.write_text("PAIRS\n" + "".join(f"{a!r} {b!r}\n" for a, b in np.array(list(pairs)).tolist()))


PAIRS = Reader(
    "pairs", read_pairs, extensions=(".prs",), sniff=lambda path: path.read_bytes()[:5] == b"PAIRS"
)
CONTENT = "PAIRS\n0.25 2\n0.5 4\n"


def test_a_registered_reader_is_found_by_extension_content_and_name(text_file):
    with pytest.raises(
        DataError, match=rf"'\.prs' is not known; state the format, one of csv, .*, {OWN[-1]}$"
    ):
        read(text_file(CONTENT, "data.prs"))
    register_reader(PAIRS)
    for name, options in (
        ("data.prs", {}),
        ("DATA.PRS", {}),
        ("data.other", {}),
        ("data.csv", {"format": "pairs"}),
    ):
        assert_array_equal(read(text_file(CONTENT, name), level=3.0, **options)["I"], [6.0, 12.0])
    assert readers.format_names() == [*OWN, "pairs"]
    with pytest.raises(DataError, match=r"use one of csv, .*, pairs"):
        read(text_file(CONTENT), format="none")
    with pytest.raises(
        DataError, match="the format pairs has no option 'column'; its options are every, level"
    ):
        read(text_file(CONTENT, "data.prs"), column={})


def test_a_reader_may_share_an_extension_and_know_its_files_by_their_content(text_file):
    register_reader(Reader("pairs", read_pairs, extensions=(".csv",), sniff=PAIRS.sniff))
    assert_array_equal(read(text_file(CONTENT))["I"], [2.0, 4.0])
    assert_array_equal(read(text_file(TABLE))["I"], [0.5])


def test_a_format_that_can_be_written_is(tmp_path, text_file):
    register_reader(
        Reader("pairs", read_pairs, extensions=(".prs", ".pr2"), write=write_pairs, written=(".PRS",))
    )
    ds = read(text_file(CONTENT, "data.prs"))
    write(ds, tmp_path / "again.prs")
    assert read(tmp_path / "again.prs").identical(ds)
    with pytest.raises(DataError, match=r"use \.prs or \.csv or \.nc or \.zarr"):
        write(ds, tmp_path / "again.pr2")


@pytest.mark.slow
def test_the_command_line_knows_registered_readers(text_file, tmp_path, monkeypatch):
    register_reader(Reader("pairs", read_pairs, extensions=(".prs",), sniff=PAIRS.sniff, write=write_pairs))
    monkeypatch.setenv("COLUMNS", "110")

    def run(*arguments, code=0):
        result = CliRunner().invoke(app, [str(a) for a in arguments])
        assert result.exit_code == code, result.output
        return " ".join(result.output.replace("│", " ").split())

    source = text_file(CONTENT, "data.prs")
    assert "2 geometries" in run("check", source)
    assert "2 geometries" in run(
        "check", text_file(CONTENT, "data.unknown"), "--format", "pairs", "--every", "2"
    )
    assert "2 geometries" in run("convert", source, tmp_path / "data.nc")
    assert "2 geometries" in run("convert", tmp_path / "data.nc", tmp_path / "again.prs")
    assert f"use one of {', '.join(OWN)}, pairs" in run("check", source, "--format", "xml", code=2)
    assert f"{', '.join(OWN)} or pairs; found out by" in run("check", "--help")
    for command in ("fit", "plot", "convert"):
        assert "see `pbrdf check --help`" in run(command, "--help")
    assert "New file: .prs, .csv, .nc or .zarr." in run("convert", "--help")


def test_a_reader_replaces_its_namesake_but_not_one_of_ours():
    register_reader(PAIRS)
    other = Reader("pairs", read_pairs, extensions=(".oth",))
    register_reader(other)
    assert readers._registered == {"pairs": other}
    with pytest.raises(DataError, match="'csv': a format of pbrdf itself has this name"):
        register_reader(Reader("csv", read_pairs, extensions=(".csv",)))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"name": "a b"}, "reader 'a b': a name has only letters"),
        ({"extensions": "prs"}, r"extensions is 'prs'; give a tuple like \('\.xyz',\)"),
        ({"extensions": ("prs",)}, r"extensions is \('prs',\)"),
        ({"written": (".prs", ""), "write": write_pairs}, "written is"),
        ({"written": (".prs",)}, "written is given, but no function write"),
        ({"extensions": ()}, "give extensions, or a function sniff"),
    ],
)
def test_declarations_that_are_none(arguments, words):
    with pytest.raises(DataError, match=words):
        Reader(**{"name": "pairs", "read": read_pairs, "extensions": (".prs",), **arguments})


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (lambda path: [1, 2], r"data\.prs: the reader 'bad' gives list, not a data set"),
        (lambda path: 1 / 0, r"data\.prs: the reader 'bad' fails at it: ZeroDivisionError: division by zero"),
        (
            lambda path: make_dataset(0.5, 0.5, 0.0, quantity="brdf", I=1.0).assign_coords(
                theta_i=("geometry", [2.0])
            ),
            r"data\.prs does not follow the schema(.|\n)*theta_i",
        ),
    ],
)
def test_what_a_reader_of_others_gives_is_checked(text_file, function, words):
    register_reader(Reader("bad", function, extensions=(".prs",)))
    with pytest.raises(DataError, match=words):
        read(text_file(CONTENT, "data.prs"))


def test_a_writer_of_others_gets_what_is_valid_and_its_mistakes_are_named(tmp_path, ds):
    register_reader(Reader("bad", read_pairs, extensions=(".prs",), write=lambda ds, path: 1 / 0))
    with pytest.raises(DataError, match=r"data\.prs: the writer 'bad' fails at it: ZeroDivisionError"):
        write(ds, tmp_path / "data.prs")
    with pytest.raises(DataError, match="theta_i"):
        write(ds.assign_coords(theta_i=("geometry", [2.0])), tmp_path / "data.prs")


def test_a_reader_that_fails_to_recognise_a_file_does_not_stop_the_others(text_file):
    register_reader(Reader("bad", read_pairs, extensions=(".csv",), sniff=lambda path: 1 / 0))
    with pytest.warns(PluginWarning, match="the reader 'bad' fails to recognise it: ZeroDivisionError"):
        assert_array_equal(read(text_file(TABLE))["I"], [0.5])


def test_the_example_of_the_documentation_runs(tmp_path, monkeypatch):
    blocks = re.findall(r"```python\n(.*?)```", DOCUMENT.read_text(encoding="utf-8"), re.DOTALL)
    (example,) = (block for block in blocks if "register_reader" in block)
    monkeypatch.chdir(tmp_path)
    found = {}
    exec(example, found)
    np.testing.assert_allclose(found["dataset"]["I"], [1.22, 0.84])
    assert pbrdf.read("paint.gon").sizes["geometry"] == 2


# --- entry points ---------------------------------------------------------------------------------


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Install a package with a module and entry points, for this test."""

    def install(module, entry_points):
        folder = tmp_path / "site"
        (folder / "guest-1.0.dist-info").mkdir(parents=True)
        (folder / "guest-1.0.dist-info" / "METADATA").write_text(
            "Metadata-Version: 2.1\nName: guest\nVersion: 1.0\n"
        )
        (folder / "guest-1.0.dist-info" / "entry_points.txt").write_text(f"[pbrdf.readers]\n{entry_points}")
        (folder / "guest_formats.py").write_text(module)
        monkeypatch.syspath_prepend(folder)
        monkeypatch.delitem(sys.modules, "guest_formats", raising=False)
        readers._installed.cache_clear()
        return folder

    return install


GUEST = """
import numpy as np
from pbrdf.data import Reader, make_dataset

def read_numbers(path):
    theta_r, values = np.loadtxt(path, skiprows=1, ndmin=2).T
    return make_dataset(0.5, theta_r, 0.0, quantity="brdf", I=values)

NUMBERS = Reader("numbers", read_numbers, extensions=(".num",), sniff=lambda path: path.read_bytes()[:5] == b"PAIRS")
TWIN = Reader("csv", read_numbers, extensions=(".csv",))
SOMETHING = 5
"""


def test_the_reader_of_an_installed_package_is_found(package, text_file):
    package(GUEST, "numbers = guest_formats:NUMBERS\n")
    assert readers.format_names() == [*OWN, "numbers"]
    assert "guest_formats" not in sys.modules, "names alone load nothing"
    for name, options in (("data.num", {}), ("data.other", {}), ("data.csv", {"format": "numbers"})):
        assert_array_equal(read(text_file(CONTENT, name), **options)["I"], [2.0, 4.0])
    result = CliRunner().invoke(app, ["check", str(text_file(CONTENT, "data.num"))])
    assert "2 geometries" in result.output
    register_reader(Reader("numbers", read_pairs, extensions=(".num",)))
    assert_array_equal(read(text_file(CONTENT, "data.num"), level=2.0)["I"], [4.0, 8.0])


@pytest.mark.parametrize(
    ("entry", "reason"),
    [
        ("bad = no_such_module:READER", "ModuleNotFoundError: No module named 'no_such_module'"),
        ("bad = guest_formats:NOTHING", "AttributeError: .*NOTHING'"),
        ("bad = guest_formats:SOMETHING", "TypeError: guest_formats:SOMETHING is a int, not a Reader"),
        ("bad = guest_formats:NUMBERS", "ValueError: guest_formats:NUMBERS is the reader 'numbers'"),
        ("csv = guest_formats:TWIN", "ValueError: a format of pbrdf or of another package has this name"),
    ],
)
def test_a_broken_reader_is_named_and_does_not_stop_the_others(package, text_file, entry, reason):
    package(GUEST, f"{entry}\nnumbers = guest_formats:NUMBERS\n")
    name = entry.partition(" ")[0]
    words = rf"the reader '{name}' of the package guest cannot be loaded \({reason}\)"
    with pytest.warns(PluginWarning, match=words) as caught:
        assert_array_equal(read(text_file(TABLE))["I"], [0.5])
    assert len(caught) == 1
    # once is enough
    assert_array_equal(read(text_file(CONTENT, "data.num"))["I"], [2.0, 4.0])
    with pytest.raises(DataError, match=rf"'\.xyz' is not known; .*; {words}"):
        read(text_file("", "data.xyz"))
    if name == "bad":
        with pytest.raises(DataError, match=rf"data\.csv: {words}"):
            read(text_file(TABLE), format="bad")


@pytest.mark.parametrize(("name", "format"), [("t.csv", "csv"), ("t.pbsdf", "pbsdf"), ("t.xyz", None)])
def test_the_format_of_a_file_is_told_without_reading_it(text_file, name, format):
    assert readers.format_of(text_file("anything", name)) == format


def test_a_format_of_ours_is_known_under_the_extension_of_another(text_file):
    """A FRED table saved as .tsv, which is a table's extension, is still one."""
    path = text_file("type bsdf_data\nformat angles=deg bsdf=value scale=1\n10 0\n10 0 0.5\n", "paint.tsv")
    assert read(path).sizes["geometry"] == 1


@pytest.mark.parametrize("name", ["paint.merl", "paint.bin", "paint.binary", "paint.data"])
def test_a_merl_table_is_known_by_its_first_bytes(tmp_path, name):
    path = tmp_path / name
    path.write_bytes(struct.pack("<3i", 90, 90, 180))
    assert readers.format_of(path) == "merl"
    with pytest.raises(DataError, match="it is truncated"):
        read(path)
