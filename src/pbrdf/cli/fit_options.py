"""What a fit can be told on the command line: the options that ``pbrdf fit`` and ``pbrdf map`` share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pbrdf.cli.options import noise_option
from pbrdf.cli.values import bounds as read_bounds
from pbrdf.cli.values import number, numbers, pairs

if TYPE_CHECKING:
    from pbrdf.models import Model

__all__ = [
    "Bounds",
    "FigureFormats",
    "FitNoise",
    "FittedModel",
    "Fix",
    "Free",
    "Iterations",
    "Loss",
    "ModelOptions",
    "Nuisances",
    "Objective",
    "Priors",
    "Start",
    "fit_arguments",
    "fitted_model",
]

FittedModel = Annotated[
    str,
    typer.Option(
        help="Model (see `pbrdf models`), FILE.py:Class, or a model's JSON file to start from as well."
    ),
]

ModelOptions = Annotated[
    list[str] | None,
    typer.Option(help="Option of the model, e.g. shadowing=smith (repeatable).", metavar="NAME=VALUE"),
]

Fix = Annotated[
    list[str] | None,
    typer.Option(
        help="Hold a parameter, e.g. n=1.5; an index also at that of a material, n=main/SiO2/Malitson: "
        "SHELF/BOOK/PAGE of refractiveindex.info (repeatable).",
        metavar="NAME=VALUE|MATERIAL",
    ),
]

Free = Annotated[
    list[str] | None,
    typer.Option(help="Fit a parameter that is held otherwise, e.g. kappa (repeatable).", metavar="NAME"),
]

Bounds = Annotated[
    list[str] | None,
    typer.Option(help="Bounds of a parameter, e.g. sigma=0.01:0.2 (repeatable).", metavar="NAME=LOW:HIGH"),
]

Start = Annotated[
    list[str] | None,
    typer.Option(help="Value where every start begins, e.g. n=1.6 (repeatable).", metavar="NAME=VALUE"),
]

Iterations = Annotated[int, typer.Option(help="Steps of each start at most.", min=1)]

FitNoise = Annotated[
    str | None,
    noise_option(
        "Noise relative to the intensity, and absolute in units of its median, e.g. 0.02,0.01; or equal; or "
        "instrument:linear=1%,circular=5%,read=0.5,quantum=1.",
        show_default="the uncertainties in the data, else an assumption that is printed",
    ),
]

Nuisances = Annotated[
    list[str] | None,
    typer.Option(
        help="What the instrument adds: gain, dark, angle or source (degrees), e.g. gain:group or "
        "angle:group~0,0.1 (repeatable).",
        metavar="KIND[:group][~MEAN,STD]",
    ),
]

Priors = Annotated[
    list[str] | None,
    typer.Option(help="Gaussian prior, e.g. n=1.55,0.05 (repeatable).", metavar="NAME=MEAN,STD"),
]

Objective = Annotated[
    str, typer.Option(help="stokes (signed components), or paper: intensity and DoLP, equal weights.")
]

Loss = Annotated[str, typer.Option(help="linear, or against outliers soft_l1, huber or cauchy.")]

FigureFormats = Annotated[
    str, typer.Option(help="Format of the figures: png, pdf or svg, or several: png,pdf.")
]


def fit_arguments(
    *,
    option: Sequence[str] | None,
    fix: Sequence[str] | None,
    free: Sequence[str] | None,
    bounds: Sequence[str] | None,
    start: Sequence[str] | None,
    starts: int,
    iterations: int,
    noise: str | None,
    nuisance: Sequence[str] | None,
    prior: Sequence[str] | None,
    objective: str,
    loss: str,
    seed: int,
) -> dict[str, Any]:
    """What the options say, as the arguments of :func:`pbrdf.fit` and :func:`pbrdf.fit_map`.

    Raises
    ------
    PbrdfError
        Names the option that is not understood.
    """
    return {
        "options": pairs(option or (), "--option", "shadowing=smith"),
        "fix": {
            name: text if "/" in text else number(text, f"--fix {name}")
            for name, text in pairs(fix or (), "--fix", "n=1.5").items()
        },
        "free": list(free or ()),
        "bounds": read_bounds(bounds or (), "--bounds", "sigma=0.01:0.2"),
        "start": numbers(start or (), "--start", "n=1.6"),
        "starts": starts,
        "max_iterations": iterations,
        "noise": noise,
        "nuisances": list(nuisance or ()),
        "priors": {
            name: _prior(name, text) for name, text in pairs(prior or (), "--prior", "n=1.55,0.05").items()
        },
        "objective": objective,
        "loss": loss,
        "seed": seed,
    }


def fitted_model(name: str) -> str | Model:
    """A model to start from where a file is named, else the name of a model."""
    from pbrdf.models import load_model

    return load_model(name) if name.endswith(".json") else name


def _prior(name: str, text: str) -> tuple[float, float]:
    """Mean and standard deviation of a prior."""
    from pbrdf.inversion.nuisance import parse_prior

    return parse_prior(f"--prior {name}", text)
