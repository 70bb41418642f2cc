"""Frames in every kind of file are the frames that were written, and what is wrong with files is named."""

import re

import numpy as np
import pytest
import tifffile
import xarray as xr
from PIL import Image

from pbrdf.data.formats.zarr_folder import create_zarr
from pbrdf.errors import DataError
from pbrdf.instruments.frames.frame_files import open_frames
from pbrdf.instruments.frames.frame_grids import open_grid
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.polarimeter.polarimeter import division_of_focal_plane, rotating_polarizer

STATES = ("0", "45", "90", "135")
SERIES = ("p2", "p10")
ROWS, COLUMNS = 12, 10


def polarizer(frames=None):
    """A rotating polariser whose states are called 0, 45, 90, 135."""
    return Instrument(
        rotating_polarizer(np.deg2rad([0, 45, 90, 135])), Detector(bits=12), frames=frames or {}
    )


@pytest.fixture
def numbers():
    """Frames of two series, 16 bits, shape (2, 4, rows, columns); all numbers differ."""
    count = 2 * 4 * ROWS * COLUMNS
    return (np.arange(count, dtype=np.uint16) * 4).reshape(2, 4, ROWS, COLUMNS)


def png(path, picture):
    Image.fromarray(picture).save(path)


def lzw(path, pictures):
    first, *rest = [Image.fromarray(p) for p in pictures]
    first.save(path, save_all=True, append_images=rest, compression="tiff_lzw")


def folder_of(kind):
    def make(folder, numbers):
        for s, series in enumerate(SERIES):
            for n, state in enumerate(STATES):
                path = folder / f"{series}_{state}.{kind}"
                if kind == "png":
                    png(path, numbers[s, n])
                elif kind == "tif":
                    tifffile.imwrite(path, numbers[s, n])
                else:
                    np.save(path, numbers[s, n])
        return folder

    return make


def folders(folder, numbers):
    for s, series in enumerate(SERIES):
        (folder / series).mkdir()
        for n, state in enumerate(STATES):
            png(folder / series / f"{state}.png", numbers[s, n])
    return folder


def stacks(folder, numbers):
    for s, series in enumerate(SERIES):
        tifffile.imwrite(folder / f"{series}.tiff", numbers[s], photometric="minisblack")
    return folder


def arrays(folder, numbers):
    for s, series in enumerate(SERIES):
        np.save(folder / f"{series}.npy", numbers[s])
    return folder


@pytest.mark.parametrize(
    "make", [folder_of("png"), folder_of("tif"), folder_of("npy"), folders, stacks, arrays]
)
def test_a_folder(tmp_path, numbers, make):
    frames = open_frames(make(tmp_path, numbers), polarizer())
    # 2 stands before 10, as people count
    assert frames.names == SERIES
    assert (frames.states, frames.rows, frames.columns) == (4, ROWS, COLUMNS)
    for s in range(2):
        np.testing.assert_array_equal(frames.read(s, 0, ROWS), numbers[s])
        part = frames.read(s, 3, 7)
        np.testing.assert_array_equal(part, numbers[s, :, 3:7])
        assert part.dtype == np.uint16


def tiff(path, numbers, **options):
    tifffile.imwrite(path, numbers.reshape(-1, ROWS, COLUMNS), photometric="minisblack", **options)


def separate_pages(path, numbers):
    with tifffile.TiffWriter(path) as writer:
        for page in numbers.reshape(-1, ROWS, COLUMNS):
            writer.write(page, contiguous=False, metadata=None)


def big_endian(path, numbers):
    tifffile.imwrite(path, numbers.reshape(-1, ROWS, COLUMNS), photometric="minisblack", byteorder=">")


def imagej(path, numbers):
    tifffile.imwrite(path, numbers.reshape(-1, ROWS, COLUMNS), imagej=True)


def packed(path, numbers):
    tiff(path, numbers, compression="zlib")


def strips(path, numbers):
    tiff(path, numbers, rowsperstrip=5)


def lzw_stack(path, numbers):
    lzw(path, numbers.reshape(-1, ROWS, COLUMNS))


def array(path, numbers):
    np.save(path, numbers)


def flat_array(path, numbers):
    np.save(path, numbers.reshape(-1, ROWS, COLUMNS))


def fortran_array(path, numbers):
    np.save(path, np.asfortranarray(numbers))


@pytest.mark.parametrize(
    "write",
    [tiff, separate_pages, big_endian, imagej, packed, strips, lzw_stack, array, flat_array, fortran_array],
)
def test_one_stack_of_all_series(tmp_path, numbers, write):
    path = tmp_path / ("run.npy" if "array" in write.__name__ else "run.tif")
    write(path, numbers)
    frames = open_frames(path, polarizer())
    assert frames.names == ("1", "2")
    for s in range(2):
        np.testing.assert_array_equal(frames.read(s, 2, 9), numbers[s, :, 2:9])


def test_a_stack_of_one_series_is_called_as_the_file(tmp_path, numbers):
    np.save(tmp_path / "run.npy", numbers[0])
    assert open_frames(tmp_path / "run.npy", polarizer()).names == ("run",)


def gridded(numbers):
    return xr.Dataset(
        {
            "frames": (("series", "state", "y", "x"), numbers),
            "temperature": ("series", [20.0, 21.0]),
        },
        {"series": list(SERIES), "state": list(STATES)},
    )


@pytest.mark.parametrize("kind", ["nc", "zarr"])
def test_netcdf_and_zarr(tmp_path, numbers, kind):
    path = tmp_path / f"run.{kind}"
    # states in another order than the polarimeter's are found by their names, dimensions by theirs
    file = gridded(numbers).isel(state=[2, 0, 3, 1]).transpose("y", "state", "x", "series")
    if kind == "nc":
        file.to_netcdf(path, engine="h5netcdf")
    else:
        pytest.importorskip("zarr")
        file.to_zarr(path, zarr_format=2, consolidated=False)
    frames = open_frames(path, polarizer())
    assert frames.names == SERIES
    for s in range(2):
        np.testing.assert_array_equal(frames.read(s, 3, 7), numbers[s, :, 3:7])
    with pytest.raises(DataError, match=re.escape("its states are")):
        renamed = gridded(numbers).assign_coords(state=["a", "b", "c", "d"])
        renamed.to_netcdf(tmp_path / "other.nc", engine="h5netcdf")
        open_frames(tmp_path / "other.nc", polarizer())


@pytest.mark.parametrize(
    ("labels", "units"),
    [
        ([0.0, 45.0, 90.0, 135.0], "degree"),
        ([0, 45, 90, 135], None),
        (np.deg2rad([0.0, 45.0, 90.0, 135.0]), "rad"),
        ([0, 1, 2, 3], None),
        ([1, 2, 3, 4], None),
        (["0.0", "45.0", "90.0", "135.0"], None),
    ],
)
@pytest.mark.parametrize("order", [[0, 1, 2, 3], [0, 2, 1, 3], [3, 2, 1, 0]])
def test_states_that_are_numbers_are_found_by_them_and_never_by_their_place(
    tmp_path, numbers, labels, units, order
):
    file = gridded(numbers).assign_coords(state=("state", labels, {"units": units} if units else {}))
    file.isel(state=order).to_netcdf(tmp_path / "run.nc", engine="h5netcdf")
    np.testing.assert_array_equal(open_frames(tmp_path / "run.nc", polarizer()).read(1, 0, ROWS), numbers[1])


def test_states_of_other_angles_are_refused_with_both(tmp_path, numbers):
    file = gridded(numbers).assign_coords(state=[0.0, 60.0, 120.0, 150.0])
    file.to_netcdf(tmp_path / "run.nc", engine="h5netcdf")
    with pytest.raises(
        DataError,
        match=r"'0.0', '60.0', '120.0', '150.0', but those of the polarimeter '0', '45', '90', '135'",
    ):
        open_frames(tmp_path / "run.nc", polarizer())


@pytest.mark.parametrize("kind", ["nc", "zarr"])
def test_frames_that_are_not_finished_are_no_dark_pictures(tmp_path, numbers, kind):
    """What was never written reads as the fill value: 0, unless the file says that this is none."""
    path = tmp_path / f"run.{kind}"
    if kind == "nc":
        import h5netcdf

        with h5netcdf.File(path, "w") as file:
            file.dimensions = {"series": 2, "state": 4, "y": ROWS, "x": COLUMNS}
            frames = file.create_variable(
                "frames", ("series", "state", "y", "x"), "u2", chunks=(1, 1, ROWS, COLUMNS)
            )
            frames[0] = numbers[0]
        with pytest.raises(DataError, match=r"run\.nc: the variable 'frames' holds 4 of its 8 chunks"):
            open_frames(path, polarizer())
    else:
        zarr = pytest.importorskip("zarr")
        create_zarr(gridded(numbers), path)
        group = zarr.open_group(path, mode="r+", zarr_format=3, use_consolidated=False)
        group["frames"].resize((3, 4, ROWS, COLUMNS))
        with pytest.raises(DataError, match=r"the chunk frames/c/.* is missing"):
            open_frames(path, polarizer())
    # said to be none
    marked = tmp_path / f"marked.{kind}"
    file = gridded(numbers)
    file["frames"][1, 2, 3, 4] = 65535
    encoding = {"frames": {"_FillValue": 65535}}
    if kind == "nc":
        file.to_netcdf(marked, engine="h5netcdf", encoding=encoding)
    else:
        create_zarr(file, marked, encoding=encoding)
    grid = open_grid(marked, STATES)
    np.testing.assert_array_equal(grid.read(0, 0, ROWS), numbers[0])
    with pytest.raises(
        DataError, match=r"1 pixels of the series '.*' are 65535, the _FillValue of frames, which"
    ):
        grid.read(1, 0, ROWS)


def test_netcdf_with_geometry_for_series_and_without_names(tmp_path, numbers):
    file = xr.Dataset({"dn": (("geometry", "state", "row", "column"), numbers)})
    file.to_netcdf(tmp_path / "run.nc", engine="h5netcdf")
    frames = open_frames(tmp_path / "run.nc", polarizer())
    assert frames.names == ("1", "2")
    np.testing.assert_array_equal(frames.read(1, 0, ROWS), numbers[1])


def test_zarr_without_the_package_says_how_to_install_it(tmp_path, monkeypatch):
    import importlib.util

    (tmp_path / "run.zarr").mkdir()
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(DataError, match="pip install zarr"):
        open_frames(tmp_path / "run.zarr", polarizer())


@pytest.fixture
def mosaic():
    """A camera with the cell [[90, 45], [135, 0]]."""
    layout = np.deg2rad([[90.0, 45.0], [135.0, 0.0]])
    return Instrument(division_of_focal_plane(layout), Detector(bits=12))


@pytest.mark.parametrize("kind", ["png", "tif", "npy", "nc"])
def test_mosaic_pictures(tmp_path, numbers, mosaic, kind):
    picture = numbers[0, 0]
    path = tmp_path / f"shot.{kind}"
    if kind == "png":
        png(path, picture)
    elif kind == "tif":
        tifffile.imwrite(path, picture)
    elif kind == "npy":
        np.save(path, picture)
    else:
        xr.Dataset({"frames": (("y", "x"), picture)}).to_netcdf(path, engine="h5netcdf")
    frames = open_frames(path, mosaic)
    assert frames.names == ("shot",)
    assert (frames.states, frames.rows, frames.columns) == (4, ROWS // 2, COLUMNS // 2)
    # the states are called by their angles, in the order of the cell read line by line
    assert mosaic.polarimeter.states == ("90", "45", "135", "0")
    cells = [picture[0::2, 0::2], picture[0::2, 1::2], picture[1::2, 0::2], picture[1::2, 1::2]]
    np.testing.assert_array_equal(frames.read(0, 0, ROWS // 2), cells)
    np.testing.assert_array_equal(frames.read(0, 2, 5), [cell[2:5] for cell in cells])


def test_a_folder_of_mosaics(tmp_path, numbers, mosaic):
    for s, series in enumerate(SERIES):
        png(tmp_path / f"{series}.png", numbers[s, 0])
    frames = open_frames(tmp_path, mosaic)
    assert frames.names == SERIES
    np.testing.assert_array_equal(frames.read(1, 0, 6)[3], numbers[1, 0, 1::2, 1::2])


def test_a_mosaic_of_broken_cells(tmp_path, numbers, mosaic):
    png(tmp_path / "shot.png", numbers[0, 0, :-1])
    with pytest.raises(DataError, match="not made of whole 2 × 2 cells"):
        open_frames(tmp_path / "shot.png", mosaic)


def test_a_pattern_of_ones_own(tmp_path, numbers):
    for s, series in enumerate(SERIES):
        for n, state in enumerate(STATES):
            png(tmp_path / f"pol{state} {series}.png", numbers[s, n])
    frames = open_frames(tmp_path, polarizer({"pattern": "pol{state} {series}.png"}))
    assert frames.names == SERIES
    np.testing.assert_array_equal(frames.read(0, 0, ROWS), numbers[0])


def test_one_series_named_by_its_folder(tmp_path, numbers):
    folder = tmp_path / "white paint"
    folder.mkdir()
    for n, state in enumerate(STATES):
        png(folder / f"{state}.png", numbers[0, n])
    assert open_frames(folder, polarizer()).names == ("white paint",)


def test_dark_frame_and_flat_field_in_the_folder_are_no_frames(tmp_path, numbers):
    folder = folder_of("png")(tmp_path, numbers)
    png(folder / "dark.png", numbers[0, 0])
    (folder / "notes.txt").write_text("sunny")
    with pytest.raises(DataError, match=r"'dark\.png' does not fit the names \{series\}_\{state\}"):
        open_frames(folder, polarizer())
    instrument = polarizer({"dark_frame": "dark.png"})
    object.__setattr__(instrument, "folder", folder)
    assert open_frames(folder, instrument).names == SERIES


# What is wrong is named


def refuse(path, instrument=None):
    with pytest.raises(DataError) as caught:
        open_frames(path, instrument or polarizer())
    return str(caught.value)


def test_a_missing_picture(tmp_path, numbers):
    folder = folder_of("png")(tmp_path, numbers)
    (folder / "p10_45.png").unlink()
    (folder / "p10_90.png").unlink()
    message = refuse(folder)
    assert "series 'p10' has no picture of the state '45' (p10_45), and 1 more" in message


def test_a_picture_too_many(tmp_path, numbers):
    folder = folder_of("png")(tmp_path, numbers)
    png(folder / "p10_60.png", numbers[0, 0])
    message = refuse(folder)
    assert "'p10_60.png' does not fit" in message
    assert "'0', '45', '90', '135'" in message


def test_the_same_picture_twice(tmp_path, numbers):
    folder = folder_of("png")(tmp_path, numbers)
    np.save(folder / "p10_45.npy", numbers[0, 0])
    assert "'p10_45.npy' and 'p10_45.png' are the same picture" in refuse(folder)


def test_pictures_of_another_size_or_depth(tmp_path, numbers):
    folder = folder_of("png")(tmp_path, numbers)
    png(folder / "p10_45.png", numbers[0, 0, :-2])
    assert "p10_45.png: 10 × 10 pixels (rows × columns), but p10_0.png has 12 × 10" in refuse(folder)
    png(folder / "p10_45.png", np.zeros((ROWS, COLUMNS), np.uint8))
    assert "p10_45.png: 8 bits, but p10_0.png has 16" in refuse(folder)


@pytest.mark.parametrize("kind", ["png", "tif"])
def test_colour_pictures_are_refused(tmp_path, numbers, kind):
    folder = folder_of("png")(tmp_path, numbers)
    (folder / "p10_45.png").unlink()
    Image.fromarray(np.zeros((ROWS, COLUMNS, 3), np.uint8)).save(folder / f"p10_45.{kind}")
    message = refuse(folder)
    assert f"p10_45.{kind}: a colour picture" in message
    assert "one grey channel" in message


def test_a_file_cut_short(tmp_path):
    # noise, so that the file is long, with the header whole
    noise = np.random.default_rng(0).integers(0, 4096, (64, 64)).astype(np.uint16)
    for state in STATES:
        png(tmp_path / f"{state}.png", noise)
    whole = (tmp_path / "45.png").read_bytes()
    (tmp_path / "45.png").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(DataError, match=r"45\.png: cannot be read as a picture"):
        open_frames(tmp_path, polarizer()).read(0, 0, 64)


def test_damaged_headers(tmp_path, capfd):
    """Decoders raise what they like: struct.error, IndexError, ZeroDivisionError, TokenError."""
    tifffile.imwrite(tmp_path / "good.tif", np.ones((4, 20, 30), np.uint16), photometric="minisblack")
    tiff = (tmp_path / "good.tif").read_bytes()
    np.save(tmp_path / "good.npy", np.ones((4, 20, 30), np.uint16))
    npy = (tmp_path / "good.npy").read_bytes()
    width = tiff.index(b"\x00\x01\x04\x00\x01\x00\x00\x00\x1e") + 8
    for name, content in (
        ("short.tif", tiff[:4]),
        ("shorter.tif", tiff[:8]),
        ("flat.tif", tiff[:width] + b"\0" + tiff[width + 1 :]),
        ("bracket.npy", npy.replace(b"}  ", b"} )")),
    ):
        (tmp_path / name).write_bytes(content)
        assert f"{name}: cannot be read as a picture" in refuse(tmp_path / name)
    assert capfd.readouterr().err == ""


def test_text_called_a_picture(tmp_path):
    for kind in ("png", "tif", "npy"):
        (tmp_path / f"run.{kind}").write_text("hello")
        assert f"run.{kind}: cannot be read as a picture" in refuse(tmp_path / f"run.{kind}")


def test_numbers_that_are_not_raw(tmp_path, numbers):
    np.save(tmp_path / "run.npy", numbers / 3.0)
    assert "numbers are of the type float64, as means of several exposures are: say of how many" in refuse(
        tmp_path / "run.npy"
    )


def test_one_picture_for_many_states(tmp_path, numbers):
    png(tmp_path / "shot.png", numbers[0, 0])
    assert "it holds one picture, and a series needs one for each of the 4 states" in refuse(
        tmp_path / "shot.png"
    )


def test_a_stack_with_a_page_missing(tmp_path, numbers):
    tiff(tmp_path / "run.tif", numbers)
    tifffile.imwrite(tmp_path / "run.tif", numbers.reshape(-1, ROWS, COLUMNS)[:7], photometric="minisblack")
    assert "it holds 7 pictures" in refuse(tmp_path / "run.tif")


def test_a_netcdf_file_without_pictures(tmp_path):
    xr.Dataset({"a": ("time", [1.0, 2.0])}).to_netcdf(tmp_path / "a.nc", engine="h5netcdf")
    assert "no variable holds pictures" in refuse(tmp_path / "a.nc")


def test_names_that_cannot_be_told_apart(tmp_path, numbers):
    png(tmp_path / "a145.png", numbers[0, 0])
    polarimeter = rotating_polarizer(np.deg2rad([45, 5, 90]))
    instrument = Instrument(polarimeter, Detector(), frames={"pattern": "{series}{state}.png"})
    assert "'a145.png' could be the state '45' or '5'" in refuse(tmp_path, instrument)


@pytest.mark.parametrize("pattern", ["{angle}.png", "{state}{state}.png"])
def test_a_pattern_with_other_braces(tmp_path, numbers, pattern):
    png(tmp_path / "a.png", numbers[0, 0])
    assert "nothing else in braces" in refuse(tmp_path, polarizer({"pattern": pattern}))


def test_an_empty_folder_and_no_folder(tmp_path):
    assert "there are no pictures" in refuse(tmp_path)
    assert "there is no such file or folder" in refuse(tmp_path / "nothing")


def test_a_frames_table_with_an_unknown_key(tmp_path, numbers):
    folder = folder_of("png")(tmp_path, numbers)
    assert "[frames] dark: there is no such key; use pattern, exposures" in refuse(
        folder, polarizer({"dark": "d"})
    )
