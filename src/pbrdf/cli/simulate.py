"""``pbrdf simulate``: a model evaluated at many directions, as a data set that a fit can read."""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pbrdf.cli.directions import GRID, PLANE_THETA_R, directions_of
from pbrdf.cli.options import (
    Backend,
    WrittenWavelength,
    angles_option,
    model_argument,
    noise_option,
    output_option,
    seed_option,
)
from pbrdf.cli.sources import known_wavelength, open_single_model
from pbrdf.cli.values import require_folder_of, stokes_vector
from pbrdf.errors import PbrdfError

if TYPE_CHECKING:
    import numpy as np
    import xarray as xr

    from pbrdf.models import Model

__all__ = ["simulate"]

#: A relative noise alone.
_PLAIN_NUMBER = re.compile(r"\s*[\d.eE+-]+\s*%?\s*")


def simulate(
    source: Annotated[
        str,
        model_argument("A model's JSON file, the folder of a fit, or a bundled paint."),
    ],
    output: Annotated[
        Path | None, output_option("The new file: .nc or .csv.", show_default="CSV to standard output")
    ] = None,
    theta_i: Annotated[
        str | None,
        angles_option("Angles of incidence: START:STOP:STEP or a list.", show_default=GRID["theta_i"]),
    ] = None,
    theta_r: Annotated[
        str | None,
        angles_option(
            "Viewing angles; with --plane and --bistatic negative ones are on the source's side.",
            show_default=f"{GRID['theta_r']}; in plane {PLANE_THETA_R}",
        ),
    ] = None,
    phi: Annotated[
        str | None, angles_option("Azimuths, 0 in the forward half-plane.", show_default=GRID["phi"])
    ] = None,
    plane: Annotated[bool, typer.Option("--plane", help="Stay in the plane of incidence.")] = False,
    bistatic: Annotated[
        str | None,
        angles_option(
            "In plane, the sample turning between a fixed source and camera: the angles between them."
        ),
    ] = None,
    incident: Annotated[
        str, typer.Option(help="Stokes vector of the source, I,Q,U,V.", metavar="STOKES")
    ] = "natural",
    mueller: Annotated[bool, typer.Option("--mueller", help="Write full Mueller matrices.")] = False,
    normalised: Annotated[
        bool, typer.Option("--normalised", help="Write Q/I, U/I and V/I, or matrices over m00, without I.")
    ] = False,
    grid: Annotated[
        bool,
        typer.Option(
            "--grid",
            help="Write arrays over theta_i, theta_r and phi, for xarray, not a list (.nc; `pbrdf` reads both).",
        ),
    ] = False,
    wavelength: WrittenWavelength = None,
    noise: Annotated[
        str | None,
        noise_option(
            "Add noise relative to the intensity, and absolute in units of its median, e.g. 0.01,0.001."
        ),
    ] = None,
    seed: Annotated[int, seed_option("Seed of the noise.")] = 0,
    backend: Backend = None,
) -> None:
    """Evaluate a model on a grid of directions, or in the plane of incidence.

    On a grid: `pbrdf simulate pearl-white --grid -o grid.nc`

    To look at: `pbrdf simulate pearl-white --plane --theta-i 45 --theta-r 0:80:20`

    A measurement: `pbrdf simulate model.json --bistatic 60,80,100 --noise 0.01 -o run.csv`
    """
    from pbrdf.backend import set_backend
    from pbrdf.data import make_dataset, write
    from pbrdf.data.formats.grid import write_grid
    from pbrdf.inversion.noise import parse_noise
    from pbrdf.version import __version__

    if plane and bistatic is not None:
        raise PbrdfError("--plane and --bistatic exclude each other: choose one")
    if (plane or bistatic is not None) and phi is not None:
        raise PbrdfError(
            "--phi has no place in the plane of incidence: give --theta-r negative values instead"
        )
    if bistatic is not None and theta_i is not None:
        raise PbrdfError("--theta-i follows from --bistatic and --theta-r: leave it out")
    if mueller and incident != "natural":
        raise PbrdfError("--mueller holds every illumination: leave --incident out")
    if grid and (plane or bistatic is not None):
        raise PbrdfError(
            "--grid: directions in the plane of incidence are no grid of theta_i, theta_r and phi"
        )
    if grid and (output is None or output.suffix.lower() != ".nc"):
        raise PbrdfError("--grid: arrays are written to netCDF; give --output FILE.nc")
    if output is not None:
        if output.suffix.lower() not in (".nc", ".csv"):
            raise PbrdfError(f"--output {output}: the extension must be .nc or .csv")
        require_folder_of(output)
    light = stokes_vector(incident, "--incident")
    # The absolute part that a fit assumes is for real data with stray light: none is added here unasked.
    stated = None if noise is None else parse_noise(f"{noise},0" if _PLAIN_NUMBER.fullmatch(noise) else noise)
    if backend is not None:
        set_backend(backend)
    model = open_single_model(source, wavelength)

    directions = directions_of(theta_i, theta_r, phi, plane, bistatic)
    columns, std = _evaluate(model, directions, light, (mueller, normalised), stated, seed)
    if wavelength is None:
        wavelength = known_wavelength(source)
    dataset = make_dataset(
        directions["theta_i"],
        directions["theta_r"],
        directions["phi"],
        quantity=None if normalised else "brdf",
        **columns,
        std=std,
        wavelength=wavelength,
        group=directions["group"],
        illumination=light,
        simulated=True,
        attrs={
            "title": f"Simulation with {source} (model {model.name})",
            "source": f"SIMULATED by pbrdf {__version__}: {model!r}"
            + (f", noise {stated}, seed {seed}" if stated else ", without noise"),
        },
    )
    if output is None:
        _print(dataset)
        return
    (write_grid if grid else write)(dataset, output)
    print(f"{output}: {dataset.sizes['geometry']} geometries, simulated")


def _print(dataset: xr.Dataset) -> None:
    """Write CSV to standard output."""
    from tempfile import TemporaryDirectory

    from pbrdf.data import write

    with TemporaryDirectory() as folder:
        file = Path(folder) / "simulated.csv"
        write(dataset, file)
        with file.open(encoding="utf-8", newline="") as text:
            shutil.copyfileobj(text, sys.stdout)


def _evaluate(
    model: Model,
    directions: dict[str, np.ndarray],
    light: tuple[float, ...],
    form: tuple[bool, bool],
    noise: Any,
    seed: int,
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Values by the names of the schema, and their standard uncertainties if noise was added.

    ``form``: whether matrices are asked for, and whether divided by the intensity.
    """
    import numpy as np

    where = (directions["theta_i"], directions["theta_r"], directions["phi"])
    mueller, normalised = form
    if mueller:
        columns = {"mueller": np.asarray(model.mueller(*where))}
        intensity = columns["mueller"][:, 0, 0]
    else:
        stokes = np.asarray(model.stokes(*where, incident=light))
        columns = {name: stokes[:, i] for i, name in enumerate("IQUV")}
        intensity = columns["I"]
    over = ""
    if normalised:
        over = "_over_m00" if mueller else "_over_I"
        columns = {
            f"{name}{over}": values / intensity.reshape((-1,) + (1,) * (values.ndim - 1))
            for name, values in columns.items()
            if name != "I"
        }
    if noise is None:
        return columns, {}
    draw = np.random.default_rng(seed)
    exact = np.ones_like(intensity)
    std = {}
    for name, values in columns.items():
        if mueller:
            widths = [
                [noise.standard_uncertainty(f"m{i}{j}{over}", intensity, exact) for j in range(4)]
                for i in range(4)
            ]
            std[name] = np.moveaxis(np.array(widths), -1, 0)
        else:
            std[name] = noise.standard_uncertainty(name, intensity, exact)
        columns[name] = values + std[name] * draw.standard_normal(values.shape)
        if mueller and normalised:
            columns[name][:, 0, 0] = 1.0
    return columns, std
