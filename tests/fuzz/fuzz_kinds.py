"""What is fuzzed: kinds of input, each with whole files to damage and the function that reads them.

Every reader of data is a kind by itself, one that comes with a package or a later version too: its seeds are written
by its own writer, or by a line in ``READER_SEEDS`` of :mod:`fuzz_seeds`. A reader with neither is given the seeds of
all the others. What else the package reads is named in :func:`kinds`.
"""

from __future__ import annotations

import warnings
import zipfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from fuzz_seeds import READER_SEEDS, write_tables, write_workbook, write_workbook_parts

import pbrdf
from pbrdf.data import readers
from pbrdf.data.formats.zarr_folder import create_zarr
from pbrdf.errors import PbrdfError, PluginWarning

__all__ = ["Kind", "kinds", "write_seeds"]


@dataclass(frozen=True)
class Kind:
    """Attributes: its name, whole inputs, how one is read, its share of the inputs relative to others, whether an
    infinite number in it is a fault (what was not measured has an infinite uncertainty in a stored fit), and whether
    its seeds are its own, which it reads."""

    name: str
    seeds: tuple[Path, ...]
    read: Callable[[Path], Any]
    share: float = 1.0
    finite: bool = True
    whole: bool = True


def _dataset(rows: int = 6, **more: Any) -> Any:
    theta = np.deg2rad(np.linspace(5.0, 60.0, rows))
    stokes = pbrdf.load_paint("white").stokes(theta, theta, 0.1)
    channels = {name: stokes[:, i] for i, name in enumerate("IQUV")}
    return pbrdf.make_dataset(
        theta, theta, 0.1, quantity="brdf", attrs={"title": "a paint"}, **channels, **more
    )


def _mueller() -> Any:
    theta = np.deg2rad([10.0, 40.0])
    return pbrdf.make_dataset(
        theta,
        theta,
        0.0,
        quantity="brdf",
        wavelength=550.0,
        mueller=pbrdf.load_paint("white").mueller(theta, theta),
    )


#: Their files are large, and little of them is structure.
_SHARES = {"merl": 0.02}
_INSTRUMENTS = ("paper", "sony_imx250mzr", "sony_imx250myr")
#: Dual rotating retarders, their settings stated in every way.
_DUAL = {
    "dual": ("steps = 16", "generator_retardance = 88", "diattenuation = 0.99"),
    "dual_pairs": (f"angles = {[[6 * k, 30 * k] for k in range(16)]}", "generator_reference_angle = 2"),
    "dual_lists": (f"generator_angles = {[6.5 * k for k in range(16)]}", "retardance = 91", "polarizer = 45"),
}


def _reader_seeds(name: str, folder: Path) -> tuple[Path, ...]:
    """Where the seeds of a reader are."""
    reader = readers._of_name(folder, name)
    if name in READER_SEEDS:
        return tuple(folder / f"{name}{rest}" for rest in READER_SEEDS[name])
    if reader.write is not None and reader.written:
        return (folder / f"{name}{reader.written[0]}", folder / f"{name}_mueller{reader.written[0]}")
    return ()


def _text(path: Path, *lines: str) -> None:
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_seeds(folder: Path, *, fit: bool = True) -> None:
    """Write all seeds into a folder; `fit` makes that of a stored fit as well, which takes some seconds."""
    import xarray as xr
    from PIL import Image

    from pbrdf.instruments.polarimeter.analyzer_files import write_analyzer
    from pbrdf.instruments.polarimeter.instrument_files import save_instrument
    from pbrdf.instruments.polarimeter.polarimeter import measured
    from pbrdf.instruments.polarimeter.presets import preset
    from pbrdf.inversion.stored_result import write_result

    for name in readers.format_names():
        places = _reader_seeds(name, folder)
        for place, write in zip(places, READER_SEEDS.get(name, {}).values(), strict=False):
            write(place)
        for place, dataset in zip(places, (_dataset(std={"I": 0.01}), _mueller()), strict=False):
            with suppress(PbrdfError):  # not every format holds both
                if name not in READER_SEEDS:
                    readers.write(dataset, place)
    vectors = np.array([[0.5, 0.5, 0, 0], [0.5, -0.5, 0, 0], [0.5, 0, 0.5, 0], [0.5, 0, 0, 0.5]])
    for suffix in (".csv", ".nc"):
        write_analyzer(measured(vectors), folder / f"analyser{suffix}")
    for name in _INSTRUMENTS:
        save_instrument(preset(name), folder / f"{name}.toml")
    _text(
        folder / "band.toml",
        "[polarimeter]\nkind = 'rotating_retarder'\nangles = [0, 30, 60, 90.5]\nretardance = 132",
        "accuracy = { linear = 0.01, circular = 0.02 }\nname = 'mine'\nreference_angle = 3",
        "[polarimeter.band]\nshape = 'gaussian'\ncenter = 550\nwidth = 20\nbirefringence = [0.9, 0.01]",
        "[detector]\nbits = 12\ngain = 0.5\nread_noise = 3.0\noffset = 10\n[frames]\npattern = 'x.png'",
    )
    for name, lines in _DUAL.items():
        _text(folder / f"{name}.toml", "[polarimeter]", "kind = 'dual_rotating_retarder'", *lines)
    _text(
        folder / "regions.toml",
        "[paint]\nrectangle = [1, 20, 3, 40]\n[disc]\nellipse = [32, 24, 4.5, 3]",
        "[edge]\npolygon = [[10, 10], [90, 20], [50, 80]]",
    )
    _text(folder / "regions.csv", "name,x0,x1,y0,y1", "paint,1,20,3,40", "other,5,8,1,9.5")
    _text(folder / "light.csv", "series,angle_deg,dop,handedness", "a,0,1,", "b,45,0.9,", "c,,1,left")
    _text(folder / "stokes.csv", "series,I,Q,U,V,exposure", "a,1,1,0,0,1", "b,1,0,1,0,2", "c,1,0,0,1,1")
    _text(
        folder / "angles.csv",
        "# azimuth: forward=180",
        "series,theta_i_deg,theta_r_deg,phi_deg,group,wavelength_nm,exposure,sample_angle_deg",
        "p1,10,50,0,1,476,1,3.5",
        "p2,12,48,170,1,476,0.5,",
    )
    _text(folder / "filter.csv", "wavelength_nm,transmission", "540,0", "550,0.9", "560,0.1")
    pbrdf.load_paint("white").to_json(folder / "model.json")
    picture = np.arange(48, dtype=np.uint16).reshape(6, 8)
    for name in ("picture.png", "picture.tif"):
        Image.fromarray(picture).save(folder / name)
    np.save(folder / "picture.npy", picture)
    frames = xr.Dataset({"frames": (("state", "y", "x"), np.stack([picture] * 2))}, {"state": ["a", "b"]})
    frames.to_netcdf(folder / "frames.nc", engine="h5netcdf")
    frames.to_zarr(folder / "frames.zarr", zarr_format=2, consolidated=True, write_empty_chunks=True)
    sharded = {"frames": {"shards": frames["frames"].shape, "chunks": (1, *frames["frames"].shape[1:])}}
    create_zarr(frames, folder / "frames_3.zarr", encoding=sharded)
    _write_measurements(folder)
    for suffix in (".xlsx", ".ods"):
        write_workbook(folder / f"book{suffix}")
        write_workbook_parts(folder / f"parts{suffix}")
    write_tables(folder)
    if find_spec("mitsuba") is not None:
        _write_pictures(folder)
    if fit:
        write_result(pbrdf.fit(_dataset(12, std={"I": 0.01}), starts=2), folder / "fit.nc")


def _write_measurements(folder: Path) -> None:
    """Folders of frames with the instrument that took them: a camera's bare pixels, and a mosaic under colours."""
    from PIL import Image

    from pbrdf.instruments.polarimeter.instrument_files import save_instrument
    from pbrdf.instruments.polarimeter.presets import preset

    raw, color = folder / "raw_frames", folder / "color_frames"
    for place in (raw, color):
        place.mkdir()
    _text(
        raw / "camera.toml",
        "[polarimeter]\nkind = 'rotating_polarizer'\nangles = [0, 60, 120]\n[detector]\nbits = 12",
        "[frames]\nraw = { width = 8, height = 6, format = 'Mono12p', header = 4 }",
        "pages = 'repeat, state'\nrepeats = 2\npattern = '{series}.raw'\ndark_frame = 'dark.raw'",
    )
    for name, pictures in (("a.raw", 6), ("b.raw", 6), ("dark.raw", 1)):
        (raw / name).write_bytes(bytes(4) + bytes(range(72)) * pictures)
    save_instrument(preset("sony_imx250myr"), color / "camera.toml")
    Image.fromarray(np.arange(128, dtype=np.uint8).reshape(8, 16)).save(color / "a.png")
    np.save(color / "b.npy", np.arange(128, dtype=np.uint8).reshape(8, 16))


def _write_pictures(folder: Path) -> None:
    from pbrdf.rendering.picture import StokesPicture, write_exr
    from pbrdf.rendering.variant import start_mitsuba

    mi = start_mitsuba()
    stokes = np.ones((4, 4, 6)) * np.array([1.0, 0.2, 0.1, 0.0])[:, None, None]
    write_exr(StokesPicture(stokes, 0.01 * stokes, {"title": "a paint"}), folder / "stokes.exr", [0.5])
    names = [f"S{i}.{color}" for i in range(4) for color in "RGB"]
    values = np.repeat(np.moveaxis(stokes, 0, -1), 3, axis=-1) * np.tile([1.0, 0.5, 0.2], 4)
    bitmap = mi.Bitmap(
        np.ascontiguousarray(values, dtype=np.float32),
        pixel_format=mi.Bitmap.PixelFormat.MultiChannel,
        channel_names=names,
    )
    bitmap.write(str(folder / "colors.exr"), mi.Bitmap.FileFormat.OpenEXR)


def kinds(folder: Path) -> list[Kind]:
    """All kinds whose seeds :func:`write_seeds` has written into a folder."""
    from pbrdf.instruments.calibration.input_table import read_input_table
    from pbrdf.instruments.frames.frame_files import open_frames
    from pbrdf.instruments.frames.frame_grids import open_grid
    from pbrdf.instruments.frames.pictures import open_pictures
    from pbrdf.instruments.goniometer.angle_table import read_angles
    from pbrdf.instruments.polarimeter.analyzer_files import read_analyzer
    from pbrdf.instruments.polarimeter.band import read_band
    from pbrdf.instruments.polarimeter.instrument_files import load_instrument
    from pbrdf.instruments.reduction.region_files import read_regions
    from pbrdf.instruments.reduction.regions import Rectangle

    def picture(path: Path) -> Any:
        opened = open_pictures(path)
        return opened.read(0, 0, min(opened.rows, 1000))

    def frames(path: Path) -> Any:
        opened = open_grid(path, ("a", "b"))
        return opened.read(0, 0, min(opened.rows, 1000))

    def measurement(path: Path) -> Any:
        opened = open_frames(path, load_instrument(path / "camera.toml"))
        return [opened.read(k, 0, min(opened.rows, 1000)) for k in range(min(len(opened.names), 10))]

    def rendered(path: Path) -> Any:
        """Pixels that are not finite are dead; what is left must be finite."""
        from pbrdf.rendering.picture_regions import open_series, picture_averages
        from pbrdf.rendering.variant import start_mitsuba

        start_mitsuba()
        series = open_series([path])
        rows, columns = series.shape
        return picture_averages(series, {"all": Rectangle(0, columns, 0, rows)})

    def by_content(path: Path) -> Any:
        with warnings.catch_warnings():
            warnings.simplefilter("error", PluginWarning)
            return pbrdf.read(path)

    def workbook(path: Path) -> Any:
        packed = path.parent / f"packed{path.suffix}"
        with zipfile.ZipFile(packed, "w") as archive:
            for part in sorted(path.rglob("*")):
                archive.write(part, part.relative_to(path))
        return pbrdf.read(packed)

    seeds = {
        name: tuple(path for path in _reader_seeds(name, folder) if path.exists())
        for name in readers.format_names()
    }
    every = tuple(p for name, paths in seeds.items() for p in paths if p.is_file() and name not in _SHARES)
    found = [
        Kind(
            name,
            paths or every,
            readers._of_name(folder, name).read,
            _SHARES.get(name, 1.0),
            whole=bool(paths),
        )
        for name, paths in seeds.items()
    ]
    # as a user reads them, without the name of a format: none of those that look at a file may fail at it
    found.append(Kind("by content", every, by_content, 3.0))
    table: tuple[tuple[str, tuple[str, ...], Callable[[Path], Any]], ...] = (
        ("analyser table", ("analyser.csv",), read_analyzer),
        ("analyser map", ("analyser.nc",), read_analyzer),
        ("instrument", (*(f"{name}.toml" for name in (*_INSTRUMENTS, *_DUAL)), "band.toml"), load_instrument),
        ("regions", ("regions.toml", "regions.csv"), read_regions),
        ("calibration table", ("light.csv", "stokes.csv"), read_input_table),
        ("angle table", ("angles.csv",), read_angles),
        ("band", ("filter.csv",), read_band),
        ("model", ("model.json",), pbrdf.load_model),
        ("fit", ("fit.nc",), pbrdf.load_fit),
        ("picture", ("picture.png", "picture.tif", "picture.npy"), picture),
        ("frames", ("frames.nc", "frames.zarr", "frames_3.zarr"), frames),
        ("raw frames", ("raw_frames",), measurement),
        ("colour mosaic", ("color_frames",), measurement),
        ("rendered picture", ("stokes.exr", "colors.exr"), rendered),
        ("workbook", ("book.xlsx", "book.ods"), pbrdf.read),
        ("workbook parts", ("parts.xlsx", "parts.ods"), workbook),
        ("MATLAB table", ("table.mat", "table_73.mat", "grid.mat"), pbrdf.read),
    )
    for name, files, read in table:
        paths = tuple(folder / file for file in files)
        if all(path.exists() for path in paths):
            found.append(Kind(name, paths, read, finite=name != "fit"))
    return found
