"""Small files to try the commands with, one set for each kind of input; all of them simulated, and said to be."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr
from PIL import Image

from pbrdf.data.conventions import dolp_aolp_from_stokes
from pbrdf.data.paints import WAVELENGTH, load_paint, open_experiment
from pbrdf.data.readers import write
from pbrdf.errors import DataError
from pbrdf.files.atomic import atomic_file, atomic_new_folder
from pbrdf.instruments.calibration.analyzer_calibration import standard_inputs
from pbrdf.instruments.frames.mosaic import weave_mosaic
from pbrdf.instruments.goniometer.protocols import Protocol
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.polarimeter.instrument_files import save_instrument
from pbrdf.instruments.polarimeter.polarimeter import lcvr
from pbrdf.instruments.polarimeter.presets import preset
from pbrdf.instruments.polarimeter.retardance_sets import retardance_set
from pbrdf.instruments.virtual.experiment import VirtualExperiment
from pbrdf.instruments.virtual.measurement_folder import write_measurement
from pbrdf.instruments.virtual.miscalibration import miscalibrated
from pbrdf.models import Model

__all__ = ["EXAMPLES", "Example", "write_example"]

_PAINTS = ("matte-white-thick", "pearl-white")
_DETECTOR = Detector(bits=12, gain=2.5, read_noise=6.0, offset=50.0)
_LEVEL = 3000.0
_MODEL = '''\
"""A model of one's own: facets with long tails (GGX, Walter et al., EGSR 2007) over a Lambertian body."""

import math

import pbrdf
from pbrdf.optics.facet_reflection import facet_reflection, tan2_tilt
from pbrdf.optics.shadowing import v_cavity


class LambertGGX(pbrdf.Model):
    """Facets of the distribution GGX over a Lambertian body."""

    name = "lambert-ggx"
    # name, symbol, unit, meaning, bounds of a fit, domain, default
    parameters = (
        pbrdf.Parameter("alpha", "α", "1", "width of the distribution", 0.005, 0.8, (0.001, 2.0), 0.1,
                        logarithmic=True, part="specular"),
        pbrdf.Parameter("index", "n", "1", "refractive index", 1.2, 2.6, (1.0, 100.0), 1.5, part="specular"),
        pbrdf.Parameter("rho", "ρ", "1", "albedo of the body", 1e-3, 2.0, (0.0, math.inf), 0.5,
                        logarithmic=True, part="diffuse", amplitude=True),
    )

    def kernel(self, geometry, values, part="total"):
        f = [[0.0] * 4 for _ in range(4)]
        if part != "diffuse":
            cosine, width2 = geometry.facet[2], values["alpha"] * values["alpha"]
            spread = width2 + tan2_tilt(geometry)
            density = width2 / (math.pi * cosine * cosine * cosine * spread * spread)
            f = facet_reflection(geometry, density, v_cavity(geometry, None), values["index"])
        if part != "specular":
            f[0][0] = f[0][0] + values["rho"] * (1.0 / math.pi)
        return f
'''
_SCENE = """\
<!-- A painted ball on a grey ground. pbrdf render puts its models in place of BSDFs with the ids paint, paint1, ... -->
<scene version="3.0.0">
    <integrator type="path"/>
    <sensor type="perspective">
        <float name="fov" value="30"/>
        <transform name="to_world">
            <lookat origin="0, -6, 2.2" target="0, 0, 0.9" up="0, 0, 1"/>
        </transform>
        <film type="hdrfilm">
            <integer name="width" value="128"/>
            <integer name="height" value="96"/>
        </film>
    </sensor>
    <shape type="sphere">
        <point name="center" x="0" y="0" z="1"/>
        <bsdf type="diffuse" id="paint"/>
    </shape>
    <shape type="rectangle">
        <transform name="to_world">
            <scale value="10"/>
        </transform>
        <bsdf type="diffuse">
            <rgb name="reflectance" value="0.3"/>
        </bsdf>
    </shape>
    <emitter type="constant">
        <rgb name="radiance" value="0.3"/>
    </emitter>
    <emitter type="point">
        <point name="position" x="4" y="-4" z="5"/>
        <rgb name="intensity" value="60"/>
    </emitter>
</scene>
"""


@dataclass(frozen=True)
class Example:
    """One set of files.

    Attributes
    ----------
    target
        Name of the file or folder.
    says
        What it is, in a line.
    write
        Makes it at a path where nothing is.
    commands
        What to do with it, in order, from the folder that holds ``target``.
    """

    target: str
    says: str
    write: Callable[[Path], None]
    commands: tuple[str, ...]


def write_example(name: str, folder: Path) -> Path:
    """Write the files of an example into a folder.

    Parameters
    ----------
    name
        One of :data:`EXAMPLES`.
    folder
        Where; it exists.

    Returns
    -------
    Path
        Of the file or folder.

    Raises
    ------
    DataError
        If there is no such example, or something stands in its place.
    """
    if name not in EXAMPLES:
        raise DataError(f"there is no example {name!r}: choose one of {', '.join(EXAMPLES)}")
    example = EXAMPLES[name]
    path = folder / example.target
    if path.exists():
        raise DataError(f"{path}: there is something of that name already; it is left as it is")
    example.write(path)
    return path


def _text(content: str) -> Callable[[Path], None]:
    def write_text(path: Path) -> None:
        with atomic_file(path) as target:
            target.write_text(content, encoding="utf-8")

    return write_text


def _write_table(path: Path) -> None:
    """The bundled experiment as a laboratory would write it: few digits, no columns that nobody needs."""
    dataset = open_experiment("matte-white-thick")
    lines = [
        "# quantity: brdf",
        "# azimuth: forward=0",
        "# stokes: p-s",
        "# illumination: natural",
        "# scale: arbitrary",
        "# simulated: 1",
        "# title: Matte white paint, three camera positions (simulated)",
        "theta_i,theta_r,phi,wavelength,group,I,Q,U,I_std,Q_std,U_std",
    ]
    columns = ("I", "Q", "U", "I_std", "Q_std", "U_std")
    for angles, row in _rows(dataset):
        numbers = (*angles, float(row["wavelength"]), int(row["group"]), *(float(row[c]) for c in columns))
        lines.append(",".join(f"{number:.5g}" for number in numbers))
    _text("\n".join(lines) + "\n")(path)


def _write_ratios(path: Path) -> None:
    """The same experiment with names, units and an azimuth of a laboratory's own: polarisation alone."""
    dataset = open_experiment("matte-white-thick")
    lines = [
        "# A polarisation camera's table: no intensity, degree and angle of linear polarisation (simulated)",
        "# azimuth: forward=180",
        "# stokes: p-s",
        "# simulated: 1",
        "theta_i [deg],theta_r [deg],phi [deg],position,DoLP (%),AoLP [deg],DoLP_std (%)",
    ]
    for (theta_i, theta_r, phi), row in _rows(dataset):
        i, spread = (float(row[c]) for c in ("I", "Q_std"))
        degree, angle = dolp_aolp_from_stokes([i, float(row["Q"]), float(row["U"])])
        numbers = (
            theta_i,
            theta_r,
            (phi + 180.0) % 360.0,
            int(row["group"]),
            100.0 * float(degree),
            np.rad2deg(angle),
            100.0 * spread / i,
        )
        lines.append(",".join(f"{number:.4g}" for number in numbers))
    _text("\n".join(lines) + "\n")(path)


def _rows(dataset: xr.Dataset) -> list[tuple[tuple[float, float, float], xr.Dataset]]:
    """Angles in degrees and everything else of each geometry."""
    found = []
    for k in range(dataset.sizes["geometry"]):
        row = dataset.isel(geometry=k)
        theta_i, theta_r, phi = (float(np.rad2deg(row[name])) for name in ("theta_i", "theta_r", "phi"))
        found.append(((theta_i, theta_r, phi), row))
    return found


def _write_frames(path: Path) -> None:
    """Two paints side by side before the paper's imager, at few angles, and labels of their pixels."""
    protocol = Protocol.in_plane(np.deg2rad([60.0, 80.0, 100.0]), np.deg2rad(np.arange(25.0, 90.0, 8.0)))
    # an imager as its file says: errors common to all pixels would be more than the noise of one in a map
    experiment = VirtualExperiment(
        protocol, preset("paper"), calibration="none", patch=4, wavelength=WAVELENGTH, seed=1
    )
    measurement = experiment.measure({name: load_paint(name) for name in _PAINTS})
    write_measurement(measurement, path)
    _, _, rows, columns = measurement.frames.array.shape
    labels = np.zeros((rows, columns), np.uint8)
    for number, region in enumerate(measurement.regions.values(), 1):
        labels[region.mask(0, rows, columns)] = number
    Image.fromarray(labels).save(path / "labels.png")


def _write_known_light(path: Path) -> None:
    """Frames of a polariser at twelve angles and both circular lights, by an imager that is not as its file says."""
    degrees = range(0, 180, 15)
    names = [*(f"p{angle:03d}" for angle in degrees), "left", "right"]
    nominal = lcvr(retardance_set("tetrahedron"))
    rng = np.random.default_rng(1)
    real = miscalibrated(nominal, 0.02, 0.06, rng)
    with atomic_new_folder(path) as folder:
        (folder / "known").mkdir()
        save_instrument(Instrument(nominal.with_accuracy(0.01, 0.05), _DETECTOR), folder / "nominal.toml")
        with (folder / "inputs.csv").open("w", encoding="utf-8", newline="") as file:
            table = csv.writer(file, lineterminator="\n")
            table.writerow(["series", "angle_deg", "handedness"])
            table.writerows([name, angle, ""] for name, angle in zip(names, degrees, strict=False))
            table.writerows([name, "", name] for name in names[-2:])
        for name, stokes in zip(names, standard_inputs(len(degrees)).T, strict=True):
            even = _LEVEL * stokes[:, None, None] * np.ones((4, 16, 24))
            frames = _DETECTOR.expose(real.intensities(even), rng)
            for state, frame in zip(nominal.states, frames, strict=True):
                Image.fromarray(frame).save(folder / "known" / f"{name}_{state}.png")


def _write_mosaic(path: Path) -> None:
    """A glossy disc on a matte ground before a camera with a mosaic of polarisers."""
    instrument = preset("sony_imx250mzr")
    y, x = np.mgrid[-1.0:1.0:24j, -1.0:1.0:32j]
    inside = x**2 + y**2 < 0.6**2
    degree, angle = np.where(inside, 0.5, 0.05), np.arctan2(y, x)
    level = np.where(inside, 120.0, 200.0)
    stokes = level * np.stack(
        [np.ones_like(x), degree * np.cos(2.0 * angle), degree * np.sin(2.0 * angle), np.zeros_like(x)]
    )
    frames = instrument.detector.expose(instrument.polarimeter.intensities(stokes), np.random.default_rng(1))
    with atomic_file(path) as target:
        Image.fromarray(weave_mosaic(frames, instrument.polarimeter)).save(target, format="png")


def _write_panels(path: Path) -> None:
    """Three panels of each of two paints, which differ as panels do, and the table of what they are."""
    rng = np.random.default_rng(1)
    protocol = Protocol.in_plane(np.deg2rad([60.0, 90.0]), np.deg2rad(np.arange(20.0, 81.0, 4.0)))
    names = {paint: [f"{paint}-{panel}" for panel in (1, 2, 3)] for paint in _PAINTS}
    with atomic_new_folder(path) as folder:
        for paint, panels in names.items():
            samples = {panel: _specimen(load_paint(paint), rng) for panel in panels}
            experiment = VirtualExperiment(
                protocol, preset("paper"), patch=8, wavelength=WAVELENGTH, seed=int(rng.integers(1 << 31))
            )
            for panel, dataset in experiment.measure(samples).datasets().items():
                write(dataset, folder / f"{panel}.csv")
        rows = [f"{panel}.csv,{paint}" for paint, panels in names.items() for panel in panels]
        (folder / "labels.csv").write_text("\n".join(["file,material", *rows]) + "\n", encoding="utf-8")


def _specimen(paint: Model, rng: np.random.Generator) -> Model:
    """The paint with its scales a few per cent off."""
    scales = [p.name for p in paint.parameters if p.fitted and p.logarithmic]
    return paint.replace(
        **{name: paint.values[name] * float(np.exp(rng.normal(0.0, 0.03))) for name in scales}
    )


def _write_model(path: Path) -> None:
    load_paint("matte-white-thick-scene").to_json(path)


#: The examples by name, in the order of the list.
EXAMPLES: dict[str, Example] = {
    "table": Example(
        "paint.csv",
        "measured Stokes parameters with their uncertainties and conventions, a CSV table",
        _write_table,
        ("pbrdf check paint.csv", "pbrdf fit paint.csv --hold-out group=3"),
    ),
    "ratios": Example(
        "camera.csv",
        "the same as DoLP and AoLP alone, with names, units and an azimuth of one's own",
        _write_ratios,
        (
            "pbrdf check camera.csv --column group=position",
            "pbrdf fit camera.csv --column group=position --hold-out group=3",
        ),
    ),
    "model": Example(
        "paint.json",
        "a model's parameters",
        _write_model,
        ("pbrdf simulate paint.json -o grid.nc", "pbrdf plot paint.json", "pbrdf render paint.json"),
    ),
    "own-model": Example(
        "lambert_ggx.py",
        "a model of one's own, 25 lines of Python",
        _text(_MODEL),
        ("pbrdf compare matte-white-thick --models lambert_ggx.py:LambertGGX,double-gauss",),
    ),
    "frames": Example(
        "run",
        "raw frames of two paints with instrument, angles, regions and labels of their pixels",
        _write_frames,
        (
            "pbrdf reduce run/frames -p run/polarimeter.toml --angles run/angles.csv --regions run/regions.toml",
            "pbrdf fit frames-reduced/pearl-white.csv --hold-out group=3",
            "pbrdf map frames-reduced/stokes.nc -g flat --labels run/labels.png -o paints.zarr",
        ),
    ),
    "mosaic": Example(
        "picture.png",
        "a raw picture of a camera with a mosaic of polarisers",
        _write_mosaic,
        ("pbrdf reduce picture.png -p sony_imx250mzr",),
    ),
    "known-light": Example(
        "light",
        "frames of known light, to calibrate a polarimeter that is not as its file says",
        _write_known_light,
        ("pbrdf calibrate light/known -p light/nominal.toml -i light/inputs.csv -o imager.toml",),
    ),
    "panels": Example(
        "panels",
        "measured panels of two paints and the table of their labels, for a library",
        _write_panels,
        (
            "pbrdf library add pearl-white panels/pearl-white-1.csv panels/pearl-white-2.csv -l paints.json",
            "pbrdf library add matte panels/matte-white-thick-1.csv panels/matte-white-thick-2.csv -l paints.json",
            "pbrdf identify panels/pearl-white-3.csv --library paints.json",
        ),
    ),
    "scene": Example(
        "scene.xml",
        "a Mitsuba scene whose BSDF called paint is replaced",
        _text(_SCENE),
        ("pbrdf render white-scene --scene scene.xml",),
    ),
}
