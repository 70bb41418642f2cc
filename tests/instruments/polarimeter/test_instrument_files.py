"""Instruments in TOML files: read, written, and refused with file, table and key."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from datetime import date
from pathlib import Path

import numpy as np
import pytest

from pbrdf.errors import DataError
from pbrdf.instruments.polarimeter.analyzer_files import read_analyzer, write_analyzer
from pbrdf.instruments.polarimeter.band import gaussian_band, in_band, tabulated_band
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.polarimeter.instrument_files import load_instrument, save_instrument
from pbrdf.instruments.polarimeter.polarimeter import (
    Polarimeter,
    division_of_focal_plane,
    lcvr,
    measured,
    rotating_polarizer,
    rotating_retarder,
)
from pbrdf.instruments.polarimeter.presets import PRESETS, preset
from pbrdf.instruments.polarimeter.retardance_sets import retardance_set

COMPLETE = """\
[polarimeter]
kind = "lcvr"
name = "bench imager"
axes = [0, 45]
retardances = [[135, 54.7356], [315, 54.7356], [45, 125.2644], [225, 125.2644]]
analyzer = 0
diattenuation = 0.98
states = ["a", "b", "c", "d"]
accuracy = { linear = 0.01, circular = 0.05 }
reference_angle = 30
stability = 0.001

[detector]
bits = 10
gain = 3
read_noise = 7.5
offset = 20
dark = 1
full_well = 3000

[frames]
pattern = "{series}_{state}.png"
dark_frame = "dark.tif"
"""


@pytest.fixture
def file(tmp_path):
    """Write the text of an instrument's file and give its path."""

    def write(text):
        path = tmp_path / "imager.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def test_a_complete_file(file):
    path = file(COMPLETE)
    found = load_instrument(path)
    nominal = lcvr(
        np.deg2rad([[135, 54.7356], [315, 54.7356], [45, 125.2644], [225, 125.2644]]), diattenuation=0.98
    )
    np.testing.assert_allclose(found.polarimeter.analyzer, nominal.analyzer, atol=1e-12)
    assert found.polarimeter.name == "bench imager"
    assert found.polarimeter.states == ("a", "b", "c", "d")
    assert found.polarimeter.accuracy == (0.01, 0.05)
    assert found.detector == Detector(10, 3, 7.5, 20, 1, 3000)
    assert found.reference_angle == pytest.approx(np.pi / 6)
    assert found.stability == 0.001
    assert found.frames == {"pattern": "{series}_{state}.png", "dark_frame": "dark.tif"}
    assert found.folder == path.parent
    assert found.resolve("dark.tif") == path.parent / "dark.tif"
    assert Instrument(nominal).resolve("dark.tif") == Path("dark.tif")


@pytest.mark.parametrize(
    ("text", "polarimeter"),
    [
        ('kind = "lcvr"\nset = "six_states"', lcvr(retardance_set("six_states"))),
        (
            'kind = "lcvr"\naxes = [10]\nretardances = [[0], [90.0]]',
            lcvr([[0], [np.pi / 2]], [np.deg2rad(10)]),
        ),
        (
            'kind = "rotating_retarder"\nangles = [0, 36, 72, 108, 144]',
            rotating_retarder(np.deg2rad([0, 36, 72, 108, 144])),
        ),
        (
            'kind = "rotating_retarder"\nangles = [0, 10]\nretardance = 132\nanalyzer = 5\ndiattenuation = 0.9',
            rotating_retarder(np.deg2rad([0, 10]), np.deg2rad(132), np.deg2rad(5), diattenuation=0.9),
        ),
        ('kind = "rotating_polarizer"\nangles = [0, 60, 120]', rotating_polarizer(np.deg2rad([0, 60, 120]))),
        (
            'kind = "division_of_focal_plane"\nlayout = [[90, 45], [135, 0]]',
            division_of_focal_plane(np.deg2rad([[90, 45], [135, 0]])),
        ),
        (
            'kind = "measured"\nanalyzer_vectors = [[1, 0, 0, 0], [1, 1, 0.5, 0]]',
            measured([[1, 0, 0, 0], [1, 1, 0.5, 0]]),
        ),
        ('kind = "preset"\npreset = "conservative"', preset("conservative").polarimeter),
    ],
)
def test_kinds(file, text, polarimeter):
    found = load_instrument(file(f"[polarimeter]\n{text}\n"))
    np.testing.assert_allclose(found.polarimeter.analyzer, polarimeter.analyzer, atol=1e-12)
    assert found.polarimeter.states == polarimeter.states
    assert found.polarimeter.accuracy == polarimeter.accuracy
    assert (found.polarimeter.mosaic is None) == (polarimeter.mosaic is None)
    assert found.frames == {}


def test_presets_can_be_changed_in_part(file):
    """What the file does not say is the preset's."""
    path = file(
        '[polarimeter]\nkind = "preset"\npreset = "paper"\naccuracy = { linear = 0.02 }\n[detector]\nbits = 12\n'
    )
    found, paper = load_instrument(path), preset("paper")
    assert found.polarimeter.accuracy == (0.02, 0.0)
    # the same electrons over 16 times as many numbers
    assert found.detector == replace(paper.detector, bits=12, gain=paper.detector.gain / 16)
    assert found.stability == paper.stability


def test_bands(file, tmp_path):
    nominal = rotating_retarder(np.deg2rad([0, 36, 72, 108, 144]))
    head = '[polarimeter]\nkind = "rotating_retarder"\nangles = [0, 36, 72, 108, 144]\n'
    found = load_instrument(file(head + 'band = { shape = "gaussian", center = 476, width = 30 }\n'))
    np.testing.assert_allclose(found.polarimeter.analyzer, in_band(nominal, gaussian_band(476, 30)).analyzer)
    (tmp_path / "filter.csv").write_text(
        "wavelength_nm,transmission\n466,0\n476,1\n486,0\n", encoding="utf-8"
    )
    text = '[polarimeter.band]\nfile = "filter.csv"\nreference = 550\nbirefringence = [0.2, 0.01]\n'
    found = load_instrument(file(head + text))
    expected = in_band(
        nominal,
        tabulated_band([466, 476, 486], [0, 1, 0]),
        reference=550,
        birefringence=lambda nm: 0.2 + 0.01 / (nm / 1000) ** 2,
    )
    np.testing.assert_allclose(found.polarimeter.analyzer, expected.analyzer, atol=1e-12)


def same(a, b):
    np.testing.assert_allclose(a.polarimeter.analyzer, b.polarimeter.analyzer, atol=1e-10)
    assert a.polarimeter.states == b.polarimeter.states
    assert a.polarimeter.name == b.polarimeter.name
    assert a.polarimeter.accuracy == b.polarimeter.accuracy
    np.testing.assert_array_equal(a.polarimeter.mosaic, b.polarimeter.mosaic)
    assert a.detector == b.detector
    assert a.polarimeter.filters == b.polarimeter.filters
    assert a.reference_angle == pytest.approx(b.reference_angle, abs=1e-11)
    assert a.stability == b.stability


MAP = measured(np.random.default_rng(0).normal(size=(2, 3, 4, 4)), ["n", "e", "s", "w"], "map").with_accuracy(
    0.01, 0.02
)


@pytest.mark.parametrize(
    ("instrument", "kind", "beside"),
    [
        *(
            (preset(name), kind, None)
            for name, kind in zip(PRESETS, ("lcvr", "lcvr", *["division_of_focal_plane"] * 3), strict=True)
        ),
        (
            Instrument(
                lcvr([[0.1, 0.2]] * 2, [0.3, 0.4], 0.5, diattenuation=0.9), Detector(full_well=9000.0)
            ),
            "lcvr",
            None,
        ),
        (Instrument(rotating_retarder([0.1, 1.2], 1.7), reference_angle=-0.3), "rotating_retarder", None),
        (
            Instrument(rotating_polarizer([0.1, 1.2], diattenuation=0.5), stability=0.1),
            "rotating_polarizer",
            None,
        ),
        (Instrument(lcvr(retardance_set("tetrahedron")).turned(0.1)), "measured", "imager_analyzer.csv"),
        (
            Instrument(in_band(lcvr(retardance_set("tetrahedron")), gaussian_band(476, 30))),
            "measured",
            "imager_analyzer.csv",
        ),
        (
            Instrument(measured(np.eye(4), ['with "quotes"', "b\\", "ü", "tab\t"])),
            "measured",
            "imager_analyzer.csv",
        ),
        (
            Instrument(Polarimeter(np.eye(4), "abcd", "calibrated mosaic", [[3, 2], [1, 0]])),
            "measured",
            "imager_analyzer.csv",
        ),
        (
            Instrument(replace(preset("sony_imx250mzr").polarimeter, mosaic=[[3, 2], [1, 0]])),
            "measured",
            "imager_analyzer.csv",
        ),
        (Instrument(MAP), "measured", "imager_analyzer.nc"),
    ],
    ids=lambda value: value.polarimeter.name if isinstance(value, Instrument) else "",
)
def test_written_and_read_again(tmp_path, instrument, kind, beside):
    """Every instrument comes back the same; the file keeps the settings where they describe it, and points to a file of
    analyser vectors where they do not."""
    path = tmp_path / "imager.toml"
    save_instrument(instrument, path)
    same(load_instrument(path), instrument)
    assert tomllib.loads(path.read_text(encoding="utf-8"))["polarimeter"]["kind"] == kind
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted({"imager.toml", beside} - {None})


def test_frames_are_kept_and_their_files_found_from_elsewhere(file, tmp_path):
    """Names of files in [frames] are relative to the file they stand in: written to another folder, they lead back."""
    (tmp_path / "other").mkdir()
    found = load_instrument(file(COMPLETE))
    extra = {
        "text": 'a "b" \\ \x7f',
        "list": [1, 2.5, [True]],
        "table": {"a b": 1},
        "day": date(2020, 2, 3),
        "none": [],
    }
    found = replace(found, frames={**found.frames, **extra})
    save_instrument(found, tmp_path / "other" / "again.toml")
    again = load_instrument(tmp_path / "other" / "again.toml")
    assert again.frames == {**found.frames, "dark_frame": "../dark.tif"}
    assert again.resolve(again.frames["dark_frame"]).resolve() == tmp_path / "dark.tif"
    with pytest.raises(DataError, match="cannot be written to a TOML file"):
        save_instrument(replace(found, frames={"x": object()}), tmp_path / "bad.toml")
    assert not (tmp_path / "bad.toml").exists()


SIX = "[polarimeter]\nkind = 'lcvr'\nset = 'six_states'\n"
BAND = SIX + "[polarimeter.band]\n"
MEASURED = "[polarimeter]\nkind = 'measured'"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "analyzer = 0",
            "analyser = 0",
            r"\[polarimeter\] analyser: the kind 'lcvr' has no key 'analyser'; did you mean 'analyzer'",
        ),
        ("gain = 3", "gian = 3", r"\[detector\] gian: the detector has no key 'gian'; did you mean 'gain'"),
        (
            "[detector]",
            "[detectors]",
            r"\[detectors\]: this file has no table 'detectors'; did you mean 'detector'",
        ),
        (
            'kind = "lcvr"',
            'kind = "lcvrs"',
            r"\[polarimeter\] kind is 'lcvrs': give one of lcvr, .*perhaps 'lcvr'",
        ),
        ('kind = "lcvr"\n', "", r"\[polarimeter\] kind is missing"),
        ("analyzer = 0", 'analyzer = "0"', r"\[polarimeter\] analyzer is '0': give a number"),
        ("analyzer = 0", "analyzer = true", r"\[polarimeter\] analyzer is True: give a number"),
        ("analyzer = 0", "analyzer = nan", r"\[polarimeter\] analyzer is nan: give a number"),
        (
            "axes = [0, 45]",
            "axes = [[0, 45]]",
            r"\[polarimeter\] axes is \[\[0, 45\]\]: give a list of numbers",
        ),
        ("axes = [0, 45]", "axes = [0, 'x']", r"\[polarimeter\] axes .*: give a list of numbers"),
        ("axes = [0, 45]", "axes = [0, 45, 90]", r"\[polarimeter\] retardances have the shape \(4, 2\)"),
        (
            "[225, 125.2644]]",
            "[225]]",
            r"\[polarimeter\] retardances is \[\[135, 54.7356\], .*all rows of the same length",
        ),
        ("analyzer = 0", 'set = "tetrahedron"', r"\[polarimeter\] give either retardances, or set"),
        ("diattenuation = 0.98", "diattenuation = 1.5", r"\[polarimeter\] a diattenuation is 1.5"),
        ('["a", "b", "c", "d"]', '["a", "b", "c"]', r"\[polarimeter\] 3 names for 4"),
        (
            '["a", "b", "c", "d"]',
            "[1, 2, 3, 4]",
            r"\[polarimeter\] states is \[1, 2, 3, 4\]: give a list of names",
        ),
        ("{ linear = 0.01, circular = 0.05 }", "0.01", r"\[polarimeter\] accuracy is 0.01: give \{ linear"),
        ("linear = 0.01", "lin = 0.01", r"\[polarimeter.accuracy\] lin: .*did you mean 'linear'"),
        ("linear = 0.01", "linear = -0.01", r"\[polarimeter\] the accuracy"),
        ("stability = 0.001", "stability = -1", r"\[polarimeter\] the stability is -1.0"),
        ("bits = 10", "bits = 10.5", r"\[detector\] bits is 10.5"),
        ("bits = 10", 'bits = "10"', r"\[detector\] bits is '10': give a number"),
        ("offset = 20", "offset = 2000", r"\[detector\] offset 2000"),
        ('pattern = "{', "pattern = {", "not a TOML file: .*line"),
        (COMPLETE, "frames = 3\n[polarimeter]\nkind = 'preset'\npreset = 'paper'", "'frames' is not a table"),
        (
            COMPLETE,
            "[polarimeter]\nkind = 'preset'\npreset = 'papr'",
            r"\[polarimeter\] no instrument is called 'papr'",
        ),
        (COMPLETE, "[polarimeter]\nkind = 'preset'", r"\[polarimeter\] preset is missing: give a text"),
        (COMPLETE, "[detector]\nbits = 8", r"no table \[polarimeter\]"),
        (
            COMPLETE,
            "[polarimeter]\nkind = 'lcvr'\nset = 'tetra'",
            r"\[polarimeter\] no retardance set is called 'tetra'",
        ),
        (COMPLETE, MEASURED, r"\[polarimeter\] give either analyzer_file"),
        (COMPLETE, MEASURED + "\nanalyzer_file = 'W.csv'", r"W.csv: there is no such file"),
        (
            COMPLETE,
            MEASURED + "\nanalyzer_vectors = [[1, 0, 0]]",
            r"\[polarimeter\] analyser vectors have the shape",
        ),
        (
            COMPLETE,
            MEASURED + "\nanalyzer_vectors = [[1, 0, 0, 0]]\nmosaic = [[0.5]]",
            r"\[polarimeter\] mosaic is",
        ),
        (COMPLETE, SIX + "band = 10", r"\[polarimeter\] band is 10: give"),
        (
            COMPLETE,
            BAND + "shape = 'box'\ncenter = 1\nwidth = 1",
            r"\[polarimeter.band\] shape is 'box': give one of gaussian, top_hat",
        ),
        (COMPLETE, BAND + "file = 'f.csv'\nwidth = 1", r"\[polarimeter.band\] give either file"),
        (COMPLETE, BAND + "shape = 'top_hat'\ncenter = 476", r"\[polarimeter.band\] width is missing"),
        (
            COMPLETE,
            "[polarimeter]\nkind = 'rotating_polarizer'\nangles = [0]\nretardance = 90",
            r"\[polarimeter\] retardance: the kind 'rotating_polarizer' has no key",
        ),
    ],
)
def test_what_is_wrong_is_named(file, old, new, message):
    """Every message begins with the file and names table and key."""
    assert old in COMPLETE
    path = file(COMPLETE.replace(old, new))
    with pytest.raises(DataError, match=message) as caught:
        load_instrument(path)
    assert str(caught.value).startswith(str(path.parent))
    assert str(caught.value).count(str(path)) <= 1


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(DataError, match="cannot be read"):
        load_instrument(tmp_path / "none.toml")
    (tmp_path / "latin.toml").write_bytes("name = 'ü'".encode("latin-1"))
    with pytest.raises(DataError, match="UTF-8"):
        load_instrument(tmp_path / "latin.toml")
    with pytest.raises(DataError, match="cannot be written"):
        save_instrument(preset("paper"), tmp_path / "no folder" / "imager.toml")


@pytest.mark.parametrize("suffix", [".csv", ".nc"])
def test_analyser_vectors_bit_for_bit(tmp_path, suffix):
    exact = measured(np.random.default_rng(1).normal(size=(5, 4)), list("vwxyz"))
    write_analyzer(exact, tmp_path / f"W{suffix}")
    found = read_analyzer(tmp_path / f"W{suffix}")
    np.testing.assert_array_equal(found.analyzer, exact.analyzer)
    assert found.states == exact.states
    assert [p.name for p in tmp_path.iterdir()] == [f"W{suffix}"]


def test_columns_and_dimensions_are_found_by_name(tmp_path):
    import xarray as xr

    (tmp_path / "W.csv").write_text("# by hand\nw_V,state,w_U,w_Q,w_I\n4,one,3,2,1\n", encoding="utf-8")
    np.testing.assert_array_equal(read_analyzer(tmp_path / "W.csv").analyzer, [[1, 2, 3, 4]])
    dims = ("state", "row", "column", "stokes")
    stored = xr.DataArray([[[[4.0, 3.0, 2.0, 1.0]]]], dims=dims, coords={"stokes": list("VUQI")})
    stored.to_dataset(name="analyzer").to_netcdf(tmp_path / "W.nc", engine="h5netcdf")
    found = read_analyzer(tmp_path / "W.nc")
    np.testing.assert_array_equal(found.analyzer, [[[[1, 2, 3, 4]]]])
    assert found.states == ("s1",)


def test_analyser_files_that_are_wrong(tmp_path):
    import xarray as xr

    for text, message in (
        ("state,w_I,w_Q,w_U\na,1,0,0\n", "no column 'w_V'"),
        ("state,w_I,w_Q,w_U,w_V\na,1,0,0,0\nb,1,0\n", "line 3"),
        ("state,w_I,w_Q,w_U,w_V\na,1,0,0,x\n", "line 2"),
        ("state,w_I,w_Q,w_U,w_V\na,1,0,0,0\na,1,0,0,0\n", "same name"),
        ("state,w_I,w_Q,w_U,w_V\n", "shape"),
    ):
        (tmp_path / "W.csv").write_text(text, encoding="utf-8")
        with pytest.raises(DataError, match=f"W.csv: .*{message}"):
            read_analyzer(tmp_path / "W.csv")
    for name, stored, message in (
        ("a.nc", xr.Dataset({"W": (("state", "stokes"), np.eye(4))}), "no variable 'analyzer'"),
        ("b.nc", xr.Dataset({"analyzer": (("n", "stokes"), np.eye(4))}), "dimensions n, stokes"),
        (
            "c.nc",
            xr.Dataset({"analyzer": (("state", "stokes"), np.eye(4))}, {"stokes": list("IQUX")}),
            "I, Q, U, X",
        ),
    ):
        stored.to_netcdf(tmp_path / name, engine="h5netcdf")
        with pytest.raises(DataError, match=f"{name}: .*{message}"):
            read_analyzer(tmp_path / name)
    (tmp_path / "d.nc").write_text("no netCDF")
    with pytest.raises(DataError, match="cannot be read as netCDF"):
        read_analyzer(tmp_path / "d.nc")
    with pytest.raises(DataError, match="no such file"):
        read_analyzer(tmp_path / "e.nc")
    with pytest.raises(DataError, match=r"extension '\.json'"):
        read_analyzer(tmp_path / "W.json")
    with pytest.raises(DataError, match=r"use \.nc"):
        write_analyzer(MAP, tmp_path / "W.csv")


def test_instruments_out_of_range():
    with pytest.raises(DataError, match="reference angle"):
        replace(preset("paper"), reference_angle=np.inf)
    with pytest.raises(DataError, match="stability"):
        replace(preset("paper"), stability=-0.1)


@pytest.mark.parametrize("number", ["1e308", "1" + "0" * 400, "inf", "nan", "true", '"1_0"'])
@pytest.mark.parametrize("line", ["angles = [0, 45, {}]", "diattenuation = {}", "reference_angle = {}"])
def test_what_is_no_number_of_an_instrument_is_named(tmp_path, line, number):
    key = line.split()[0]
    lines = ["[polarimeter]", 'kind = "rotating_polarizer"', line.format(number)]
    if key != "angles":
        lines.append("angles = [0, 45, 90]")
    (tmp_path / "a.toml").write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(DataError, match=rf"a\.toml: \[polarimeter\] {key} is .*: give a "):
        load_instrument(tmp_path / "a.toml")


@pytest.mark.parametrize("number", ["1" + "0" * 400, "true", "1e308"])
def test_what_is_no_number_of_a_detector_is_named(tmp_path, number):
    text = f'[polarimeter]\nkind = "preset"\npreset = "paper"\n[detector]\ngain = {number}\n'
    (tmp_path / "a.toml").write_text(text, encoding="utf-8")
    with pytest.raises(DataError, match=r"a\.toml: \[detector\] gain is .*: give a number"):
        load_instrument(tmp_path / "a.toml")
