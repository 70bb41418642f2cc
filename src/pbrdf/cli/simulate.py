"""``pbrdf simulate``: a model evaluated at many directions, as a data set that a fit can read."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pbrdf.cli.fit import Backend
from pbrdf.cli.sources import known_wavelength, open_single_model
from pbrdf.cli.values import angles, require_folder_of, stokes_vector
from pbrdf.errors import PbrdfError

if TYPE_CHECKING:
    import numpy as np

    from pbrdf.models import Model

__all__ = ["GRID", "directions_of", "simulate"]

#: Directions over the hemisphere, degrees.
GRID = {"theta_i": "10:80:10", "theta_r": "0:85:5", "phi": "0:360:15"}
_PLANE_THETA_R = "-85:85:1"
#: A relative noise alone.
_PLAIN_NUMBER = re.compile(r"\s*[\d.eE+-]+\s*%?\s*")
_BISTATIC_THETA_R = "-85:85:1"
#: About 16 GB of Mueller matrices; more is a slip of the pen.
_MOST_GEOMETRIES = 20_000_000


def simulate(
    source: Annotated[
        str,
        typer.Argument(metavar="MODEL", help="A model's JSON file, the folder of a fit, or a bundled paint."),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="The new file: .nc or .csv.")],
    theta_i: Annotated[
        str | None,
        typer.Option(help="Angles of incidence: START:STOP:STEP or a list.", show_default=GRID["theta_i"]),
    ] = None,
    theta_r: Annotated[
        str | None,
        typer.Option(
            help="Viewing angles; with --plane and --bistatic negative ones are on the source's side.",
            show_default=f"{GRID['theta_r']}; in plane {_PLANE_THETA_R}",
        ),
    ] = None,
    phi: Annotated[
        str | None, typer.Option(help="Azimuths, 0 in the forward half-plane.", show_default=GRID["phi"])
    ] = None,
    plane: Annotated[bool, typer.Option("--plane", help="Stay in the plane of incidence.")] = False,
    bistatic: Annotated[
        str | None,
        typer.Option(
            help="In plane, the sample turning between a fixed source and camera: the angles between them.",
            metavar="ANGLES",
        ),
    ] = None,
    incident: Annotated[
        str, typer.Option(help="Stokes vector of the source, I,Q,U,V.", metavar="STOKES")
    ] = "natural",
    mueller: Annotated[bool, typer.Option("--mueller", help="Write full Mueller matrices.")] = False,
    wavelength: Annotated[float | None, typer.Option(help="Wavelength to write down, nm.")] = None,
    noise: Annotated[
        str | None,
        typer.Option(
            help="Add noise relative to the intensity, and absolute in units of its median, e.g. 0.01,0.001.",
            metavar="REL[,ABS]",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the noise.", min=0)] = 0,
    backend: Backend = None,
) -> None:
    """Evaluate a model on a grid of directions, or in the plane of incidence.

    On a grid: `pbrdf simulate pearl-white -o grid.nc`

    A measurement: `pbrdf simulate model.json --bistatic 60,80,100 --noise 0.01 -o run.csv`
    """
    from pbrdf.backend import set_backend
    from pbrdf.data import make_dataset, write
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
    if output.suffix.lower() not in (".nc", ".csv"):
        raise PbrdfError(f"--output {output}: the extension must be .nc or .csv")
    require_folder_of(output)
    light = stokes_vector(incident, "--incident")
    # The absolute part that a fit assumes is for real data with stray light: none is added here unasked.
    stated = None if noise is None else parse_noise(f"{noise},0" if _PLAIN_NUMBER.fullmatch(noise) else noise)
    if backend is not None:
        set_backend(backend)
    model = open_single_model(source)

    directions = directions_of(theta_i, theta_r, phi, plane, bistatic)
    columns, std = _evaluate(model, directions, light, mueller, stated, seed)
    if wavelength is None:
        wavelength = known_wavelength(source)
    dataset = make_dataset(
        directions["theta_i"],
        directions["theta_r"],
        directions["phi"],
        quantity="brdf",
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
    write(dataset, output)
    print(f"{output}: {dataset.sizes['geometry']} geometries, simulated")


def directions_of(
    theta_i: str | None, theta_r: str | None, phi: str | None, plane: bool, bistatic: str | None
) -> dict[str, np.ndarray]:
    """Angles in radians and groups of every geometry, shape (N,)."""
    import numpy as np

    if bistatic is not None:
        between = angles(bistatic, "--bistatic")
        views = angles(theta_r or _BISTATIC_THETA_R, "--theta-r")
        total, s = (a.ravel() for a in np.meshgrid(between, views, indexing="ij"))
        group = np.repeat(np.arange(1, len(between) + 1), len(views))
        incidence = total - s
        seen = (incidence >= 0.0) & (incidence < 90.0)
        if not seen.any():
            raise PbrdfError("--bistatic: with these viewing angles the source is never between 0° and 90°")
        return _checked(incidence[seen], np.abs(s[seen]), np.where(s[seen] < 0.0, 180.0, 0.0), group[seen])
    incidences = angles(theta_i or GRID["theta_i"], "--theta-i")
    views = angles(theta_r or (_PLANE_THETA_R if plane else GRID["theta_r"]), "--theta-r")
    azimuths = [0.0] if plane else angles(phi or GRID["phi"], "--phi")
    count = len(incidences) * len(views) * len(azimuths)
    if count > _MOST_GEOMETRIES:
        raise PbrdfError(
            f"{count} geometries are more than the {_MOST_GEOMETRIES} allowed: take larger steps"
        )
    grids = [a.ravel() for a in np.meshgrid(incidences, views, azimuths, indexing="ij")]
    # As the readers of hemispherical data do, a group is called by its angle of incidence.
    whole = np.round(incidences).astype(int)
    labels = whole if len(set(whole)) == len(whole) else np.arange(1, len(incidences) + 1)
    group = np.repeat(labels, len(views) * len(azimuths))
    if plane:
        return _checked(grids[0], np.abs(grids[1]), np.where(grids[1] < 0.0, 180.0, 0.0), group)
    return _checked(grids[0], grids[1], grids[2], group)


def _checked(
    theta_i: np.ndarray, theta_r: np.ndarray, phi: np.ndarray, group: np.ndarray
) -> dict[str, np.ndarray]:
    import numpy as np

    for name, values in (("--theta-i", theta_i), ("--theta-r", theta_r)):
        bad = values[(values < 0.0) | (values >= 90.0)]
        if bad.size:
            raise PbrdfError(f"{name}: {bad[0]:g}° is not an angle from 0° to below 90°")
    radians = {"theta_i": theta_i, "theta_r": theta_r, "phi": phi}
    return {**{name: np.deg2rad(values) for name, values in radians.items()}, "group": group}


def _evaluate(
    model: Model,
    directions: dict[str, np.ndarray],
    light: tuple[float, ...],
    mueller: bool,
    noise: Any,
    seed: int,
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Values by the names of the schema, and their standard uncertainties if noise was added."""
    import numpy as np

    where = (directions["theta_i"], directions["theta_r"], directions["phi"])
    if mueller:
        columns = {"mueller": np.asarray(model.mueller(*where))}
        intensity = columns["mueller"][:, 0, 0]
    else:
        stokes = np.asarray(model.stokes(*where, incident=light))
        columns = {name: stokes[:, i] for i, name in enumerate("IQUV")}
        intensity = columns["I"]
    if noise is None:
        return columns, {}
    draw = np.random.default_rng(seed)
    exact = np.ones_like(intensity)
    std = {}
    for name, values in columns.items():
        if name == "mueller":
            widths = [
                [noise.standard_uncertainty(f"m{i}{j}", intensity, exact) for j in range(4)] for i in range(4)
            ]
            std[name] = np.moveaxis(np.array(widths), -1, 0)
        else:
            std[name] = noise.standard_uncertainty(name, intensity, exact)
        columns[name] = values + std[name] * draw.standard_normal(values.shape)
    return columns, std
