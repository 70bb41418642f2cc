"""Colour polarisation cameras: each colour apart, and grey settings given a colour mosaic (case L3)."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from pbrdf.errors import DataError
from pbrdf.instruments.frames.frame_files import open_frames
from pbrdf.instruments.frames.frames import ChosenSeries
from pbrdf.instruments.goniometer.angle_table import AngleTable
from pbrdf.instruments.polarimeter.color_filters import ColorFilters
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.polarimeter.instrument_files import load_instrument, save_instrument
from pbrdf.instruments.polarimeter.polarimeter import division_of_focal_plane
from pbrdf.instruments.reduction.goniometric_datasets import goniometric_datasets
from pbrdf.instruments.reduction.regions import Rectangle
from pbrdf.instruments.reduction.streaming import reduced_blocks

CELL = np.array([[90.0, 45.0], [135.0, 0.0]])
GREY = division_of_focal_plane(np.deg2rad(CELL))
#: Intensity and degree of polarisation under each filter, all at 30°.
LIGHT = {"R": (1200, 0.4), "G": (2000, 0.2), "B": (700, 0.6)}
EXACT = Detector(bits=12, gain=2.5, read_noise=0.0)


def picture(layout=(("R", "G"), ("G", "B")), size=8, noise=2.0, light=LIGHT, scene=None):
    """A raw picture: the colours of the layout over cells of polarisers."""
    rng = np.random.default_rng(1)
    rows = []
    for row in layout:
        cells = []
        for color in row:
            level, dolp = light[color]
            cells.append(0.5 * level * (1.0 + dolp * np.cos(2.0 * np.deg2rad(CELL - 30.0))))
        rows.append(cells)
    even = np.tile(np.block(rows), (size, size))
    if scene is not None:
        even = even * scene(*np.indices(even.shape))
    return np.clip(np.round(even + rng.normal(0, noise, even.shape)), 0, 4095).astype(np.uint16)


def file_of(tmp_path, text, detector="bits = 12"):
    (tmp_path / "camera.toml").write_text(
        f"[polarimeter]\n{text}\n[detector]\n{detector}\n", encoding="utf-8"
    )
    return load_instrument(tmp_path / "camera.toml")


def opened(tmp_path, numbers, instrument):
    Image.fromarray(numbers).save(tmp_path / "f.png")
    return open_frames(tmp_path / "f.png", instrument)


def found(frames, instrument):
    """Mean Stokes vector of each series."""
    blocks = list(reduced_blocks(frames, instrument, lambda block: block))
    return {
        name: np.mean([b.image.stokes.reshape(4, -1).mean(axis=1) for b in blocks if b.series == k], axis=0)
        for k, name in enumerate(frames.names)
    }


def degrees(stokes):
    return np.hypot(stokes[1], stokes[2]) / stokes[0]


@pytest.mark.parametrize("preset", ["sony_imx250myr", "sony_imx264myr"])
def test_presets_keep_the_colours_apart(tmp_path, preset):
    """Case L3: R 0.4, G 0.2, B 0.6, all at 30°, and as many pixels as there are 4 × 4 cells."""
    instrument = file_of(tmp_path, f'kind = "preset"\npreset = "{preset}"')
    frames = opened(tmp_path, picture(), instrument)
    assert frames.names == ("f_R", "f_G", "f_B")
    assert (frames.states, frames.rows, frames.columns) == (4, 8, 8)
    for name, stokes in found(frames, instrument).items():
        level, dolp = LIGHT[name[-1]]
        assert stokes[0] == pytest.approx(level, rel=2e-3)
        assert degrees(stokes) == pytest.approx(dolp, abs=2e-3)
        assert 0.5 * np.arctan2(stokes[2], stokes[1]) == pytest.approx(np.deg2rad(30), abs=0.01)
    assert frames.notes == []


def test_greens_joined_and_apart(tmp_path):
    """Two greens of different brightness: joined it is their mean with half the variance, apart each."""
    light = {**LIGHT, "G1": (1800, 0.3), "G2": (2200, 0.1)}
    numbers = picture((("R", "G1"), ("G2", "B")), light=light)
    apart = file_of(tmp_path, 'kind = "preset"\npreset = "sony_imx250myr"\ngreens = "apart"')
    frames = opened(tmp_path, numbers, apart)
    assert frames.names == ("f_R", "f_G1", "f_G2", "f_B")
    means = found(frames, apart)
    assert degrees(means["f_G1"]) == pytest.approx(0.3, abs=2e-3)
    assert degrees(means["f_G2"]) == pytest.approx(0.1, abs=2e-3)
    joined = file_of(tmp_path, 'kind = "preset"\npreset = "sony_imx250myr"')
    both = opened(tmp_path, numbers, joined)
    np.testing.assert_allclose(
        found(both, joined)["f_G"], 0.5 * (means["f_G1"] + means["f_G2"]), rtol=1e-12, equal_nan=True
    )
    first, second = (next(b for b in reduced_blocks(f, i, lambda b: b) if b.series == 1) for f, i in
                     ((both, joined), (frames, apart)))  # fmt: skip
    ratio = first.image.covariance[0, 0].mean() / second.image.covariance[0, 0].mean()
    assert ratio == pytest.approx(0.5 * 2000 / 1800, rel=0.02)


def test_other_patterns_and_names(tmp_path):
    instrument = file_of(
        tmp_path,
        'kind = "division_of_focal_plane"\nlayout = [[90, 45], [135, 0]]\ncolors = [["G", "B"], ["R", "G"]]\n'
        "wavelengths = { R = 620, G = 530, B = 460 }",
    )
    frames = opened(tmp_path, picture((("G", "B"), ("R", "G"))), instrument)
    assert [(color, nm) for _, color, nm in frames.sources] == [("G", 530.0), ("B", 460.0), ("R", 620.0)]
    for name, stokes in found(frames, instrument).items():
        assert degrees(stokes) == pytest.approx(LIGHT[name[-1]][1], abs=2e-3)
    save_instrument(instrument, tmp_path / "again.toml")
    again = load_instrument(tmp_path / "again.toml").polarimeter
    assert again.filters == instrument.polarimeter.filters
    assert again.details["kind"] == "division_of_focal_plane"


def test_rows_and_chosen_series(tmp_path):
    """Blocks of rows are those of the whole, and a chosen series keeps its colour."""
    instrument = file_of(tmp_path, 'kind = "preset"\npreset = "sony_imx250myr"')
    numbers = picture(size=8, noise=60.0)
    frames = opened(tmp_path, numbers, instrument)
    np.testing.assert_array_equal(frames.read(1, 0, 8)[:, 4:8], frames.read(1, 2, 4))
    blue = ChosenSeries(frames, ["f_B"])
    whole = next(b for b in reduced_blocks(frames, instrument, lambda b: b) if b.series == 2)
    (alone,) = reduced_blocks(blue, instrument, lambda b: b)
    np.testing.assert_array_equal(alone.image.stokes, whole.image.stokes)
    small = list(
        reduced_blocks(blue, instrument, lambda b: b.image.stokes, max_memory=1_000_000, rows=(2, 7))
    )
    np.testing.assert_array_equal(np.concatenate(small, axis=1), whole.image.stokes[:, 2:7])


def test_dark_frame_and_flat_field_of_a_colour_camera(tmp_path):
    """Both are raw pictures of the camera: each colour is corrected by its own pixels."""
    gain = {"R": 0.5, "G": 1.0, "B": 0.7}
    flat = picture(noise=0.0, light={c: (2000 * g, 0.0) for c, g in gain.items()})
    dark = np.full(flat.shape, 40, np.uint16)
    light = {c: (3000 * g, 0.3) for c, g in gain.items()}
    numbers = picture(noise=0.0, light=light) + dark
    for name, content in (("dark", dark), ("flat", flat + dark)):
        np.save(tmp_path / f"{name}.npy", content)
    instrument = file_of(
        tmp_path,
        'kind = "preset"\npreset = "sony_imx250myr"',
        'bits = 12\n[frames]\ndark_frame = "dark.npy"\nflat_field = "flat.npy"',
    )
    means = found(opened(tmp_path, numbers, instrument), instrument)
    levels = [stokes[0] for stokes in means.values()]
    # one mean for the whole flat field: colours come out alike, as its light makes them
    np.testing.assert_allclose(levels, levels[0], rtol=2e-3)
    for stokes in means.values():
        assert degrees(stokes) == pytest.approx(0.3, abs=2e-3)


@pytest.mark.parametrize("stated", [True, False])
def test_data_sets_of_the_colours(tmp_path, stated):
    """One row of angles for each picture: the colours are wavelengths where those are stated, else groups."""
    more = "\nwavelengths = { R = 620, G = 530, B = 460 }" if stated else ""
    instrument = file_of(tmp_path, f'kind = "preset"\npreset = "sony_imx250myr"{more}')
    frames = opened(tmp_path, picture(), instrument)
    angles = AngleTable(("f",), np.deg2rad([30.0]), np.deg2rad([40.0]))
    ds = goniometric_datasets(frames, instrument, {"all": Rectangle(0, 8, 0, 8)}, angles)["all"]
    assert ds.sizes["geometry"] == 3
    if stated:
        assert sorted(ds["wavelength"].values.tolist()) == [460.0, 530.0, 620.0]
        red = ds.isel(geometry=int(np.argmax(ds["wavelength"].values)))
    else:
        assert "wavelength" not in ds
        assert sorted(ds["group"].values.tolist()) == ["B", "G", "R"]
        red = ds.isel(geometry=ds["group"].values.tolist().index("R"))
    assert float(red["I"]) == pytest.approx(1200, rel=2e-3)
    # a table that names the series of the colours, with wavelengths of its own
    own = AngleTable(frames.names, np.full(3, 0.5), np.full(3, 0.6), wavelength=[600, 500, 400])
    ds = goniometric_datasets(frames, instrument, {"all": Rectangle(0, 8, 0, 8)}, own)["all"]
    assert sorted(ds["wavelength"].values.tolist()) == [400.0, 500.0, 600.0]


@pytest.mark.parametrize("layout", [CELL, np.tile(CELL, (2, 2))])
def test_grey_settings_with_a_colour_mosaic(tmp_path, layout):
    """Case L3: a word that neighbouring cells alternate, with a 2 × 2 cell and with a 4 × 4 cell of angles."""
    instrument = Instrument(division_of_focal_plane(np.deg2rad(layout)), Detector(bits=12, offset=10.0))
    frames = opened(tmp_path, picture(scene=lambda y, x: 0.6 + 0.01 * x + 0.1 * np.sin(y / 5.0)), instrument)
    assert "alternate in brightness all over the picture" in frames.notes[0]
    assert "sony_imx250myr" in frames.notes[0]


def test_grey_pictures_are_not_taken_for_coloured_ones(tmp_path):
    """A scene with edges, a slope and noise; polarised light; darkness."""
    grey = dict.fromkeys("RGB", (2000, 0.5))
    rng = np.random.default_rng(0)
    edges = rng.uniform(0.1, 1.0, (40, 40))
    for numbers in (
        picture(light=grey, noise=30.0, scene=lambda y, x: edges[y // 3, x // 3]),
        picture(light=grey, noise=5.0, scene=lambda y, x: 0.1 + 0.02 * x),
        picture(light=dict.fromkeys("RGB", (4, 0.1)), noise=3.0),
    ):
        assert opened(tmp_path, numbers, Instrument(GREY, Detector(bits=12))).notes == []


def test_mistakes(tmp_path):
    with pytest.raises(DataError, match="say which colours there are"):
        file_of(tmp_path, 'kind = "preset"\npreset = "sony_imx250mzr"\nwavelengths = { R = 600 }')
    with pytest.raises(DataError, match="wavelengths are given of R, but the colours are B, G, R"):
        file_of(tmp_path, 'kind = "preset"\npreset = "sony_imx250myr"\nwavelengths = { R = 600 }')
    with pytest.raises(DataError, match="the wavelength of R is -1"):
        ColorFilters(wavelengths={"R": -1.0, "G": 500.0, "B": 400.0})
    with pytest.raises(DataError, match="rows of names of the same length"):
        ColorFilters((("R",), ("G", "B")))
    with pytest.raises(DataError, match="this polarimeter has none"):
        file_of(tmp_path, 'kind = "preset"\npreset = "paper"\ncolors = [["R"]]')
    instrument = file_of(tmp_path, 'kind = "preset"\npreset = "sony_imx250myr"')
    with pytest.raises(DataError, match="not made of whole periods of 2 × 2 cells of colours"):
        opened(tmp_path, picture()[:, :-2], instrument)


def test_one_colour_alone(tmp_path):
    """Series are called as the pictures, and hold what the colour's series holds."""
    every = file_of(tmp_path, 'kind = "preset"\npreset = "sony_imx250myr"\ngreens = "apart"')
    expected = found(opened(tmp_path, picture(), every), every)["f_G2"]
    one = file_of(tmp_path, 'kind = "preset"\npreset = "sony_imx250myr"\ngreens = "apart"\ncolor = "G2"')
    frames = opened(tmp_path, picture(), one)
    assert frames.names == ("f",)
    np.testing.assert_array_equal(found(frames, one)["f"], expected)
    with pytest.raises(DataError, match="color is 'G2': use one of R, G, B; with greens"):
        file_of(tmp_path, 'kind = "preset"\npreset = "sony_imx250myr"\ncolor = "G2"')


PIXELS = '[["R", "R", "G", "G"], ["R", "R", "G", "G"], ["G", "G", "B", "B"], ["G", "G", "B", "B"]]'
REPEATED = "[[90, 45, 90, 45], [135, 0, 135, 0], [90, 45, 90, 45], [135, 0, 135, 0]]"


@pytest.mark.parametrize(
    ("layout", "colors"),
    [
        (REPEATED, '[["R", "G"], ["G", "B"]]'),
        (REPEATED, PIXELS),
        ("[[90, 45], [135, 0]]", PIXELS),
    ],
)
def test_layouts_written_pixel_by_pixel_mix_no_colours(tmp_path, layout, colors):
    instrument = file_of(
        tmp_path, f'kind = "division_of_focal_plane"\nlayout = {layout}\ncolors = {colors}\ngreens = "joined"'
    )
    assert instrument.polarimeter.mosaic.shape == (2, 2)
    assert instrument.polarimeter.filters.layout == (("R", "G"), ("G", "B"))
    frames = opened(tmp_path, picture(noise=0.0), instrument)
    means = found(frames, instrument)
    assert [*means] == ["f_R", "f_G", "f_B"]
    for name, stokes in means.items():
        level, dolp = LIGHT[name[-1]]
        assert stokes[0] == pytest.approx(level, rel=1e-3)
        assert degrees(stokes) == pytest.approx(dolp, abs=2e-3)


def test_a_grey_layout_stays_as_it_was_written(tmp_path):
    instrument = file_of(tmp_path, f'kind = "division_of_focal_plane"\nlayout = {REPEATED}')
    assert instrument.polarimeter.mosaic.shape == (4, 4)
