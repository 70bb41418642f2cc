"""``pbrdf plot``: a figure of models, files of data and fits."""

from __future__ import annotations

import enum
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pbrdf.cli.options import output_option, with_reading_options
from pbrdf.cli.reading import Reading
from pbrdf.cli.sources import is_paint
from pbrdf.cli.values import require_folder_of, stokes_vector
from pbrdf.errors import PbrdfError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pbrdf.report.together.source import Source

__all__ = ["plot"]


class Kind(enum.StrEnum):
    """What a figure shows."""

    CURVES = "curves"
    HEMISPHERE = "hemisphere"
    SURFACE = "surface"
    MUELLER = "mueller"


@with_reading_options
def plot(
    sources: Annotated[
        list[str],
        typer.Argument(
            metavar="MODEL|DATA|FIT",
            help="Models' JSON files, bundled paints' names (their models), files of data, folders of fits: one, or "
            "several to be drawn together.",
        ),
    ],
    *,
    reading: Reading,
    kind: Annotated[
        Kind | None,
        typer.Option(
            help="In-plane curves, maps of the hemisphere, polar surfaces, or the 16 Mueller elements.",
            show_default="an overview of one source, curves of several",
        ),
    ] = None,
    theta_i: Annotated[
        float | None,
        typer.Option(
            help="Angle of incidence in degrees; of data the nearest that was measured.",
            show_default="35 for a model, else as measured",
        ),
    ] = None,
    incident: Annotated[
        str | None,
        typer.Option(
            help="Stokes vector of the light of models, I,Q,U,V; of data as measured.",
            metavar="STOKES",
            show_default="natural",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        output_option("The figure: .png, .pdf or .svg.", show_default="<name>.png"),
    ] = None,
) -> None:
    """Draw models, measured data and fits, alone or together.

    A model at one angle of incidence: `pbrdf plot white --theta-i 50`

    A paint's fit beside another model: `pbrdf plot paint-fit other.json --kind curves`
    """
    from pbrdf.report.style import leave_out_help_texts, save_figure

    target = output or Path(f"{Path(sources[0]).stem}.png")
    for source in sources:
        if target.exists() and target.resolve() == Path(source).resolve():
            raise PbrdfError(f"{target}: this is the file to draw; name another with --output")
    require_folder_of(target)
    models = [source for source in sources if _is_model(source)]
    if len(models) == len(sources) and (given := reading.stated()):
        option = next(iter(given)).replace("_", "-")
        are = f"{models[0]} is a model" if len(models) == 1 else f"{', '.join(models)} are models"
        raise PbrdfError(f"{are}: --{option} is for files of data")
    if theta_i is not None and not 0.0 <= theta_i < 90.0:
        raise PbrdfError(f"--theta-i {theta_i:g}: the angle must be at least 0° and below 90°")
    light = None if incident is None else stokes_vector(incident, "--incident")
    if light is not None and (kind is Kind.MUELLER or (kind is None and len(sources) == 1)):
        raise PbrdfError("--incident is for --kind curves, hemisphere and surface")
    leave_out_help_texts()
    if kind is None and len(sources) == 1:
        figure = _overview(sources[0], reading, theta_i)
    else:
        figure = _together(
            [_opened(source, reading) for source in sources], kind or Kind.CURVES, theta_i, light
        )
    save_figure(figure, target)
    print(target)


def _overview(source: str, reading: Reading, theta_i: float | None) -> Figure:
    """What is shown of one source where no kind of figure is asked for."""
    if _is_model(source):
        from pbrdf.cli.sources import open_model
        from pbrdf.report.model.figure import model_figure

        return model_figure(open_model(source), 35.0 if theta_i is None else theta_i, Path(source).name)
    if theta_i is not None:
        raise PbrdfError(
            "--theta-i is for models; choose points of a file with --select theta_i=…, or a figure with --kind"
        )
    if _is_fit(source):
        from pbrdf.inversion.stored_result import load_fit
        from pbrdf.report.fit.figure import fit_figure
        from pbrdf.report.fit.subject import Report

        result = load_fit(source)
        return fit_figure(Report(result, result.dataset, _name(source)))
    from pbrdf.report.dataset.figure import data_figure

    return data_figure(reading.open(source), Path(source).name)


def _together(
    sources: list[Source], kind: Kind, theta_i: float | None, light: Sequence[float] | None
) -> Figure:
    from pbrdf.report.together.curves import curves_figure, mueller_figure
    from pbrdf.report.together.hemispheres import hemispheres_figure, surfaces_figure

    if kind is Kind.MUELLER:
        return mueller_figure(sources, theta_i)
    draw = {
        Kind.CURVES: curves_figure,
        Kind.HEMISPHERE: hemispheres_figure,
        Kind.SURFACE: surfaces_figure,
    }[kind]
    return draw(sources, theta_i, light)


def _opened(source: str, reading: Reading) -> Source:
    from pbrdf.report.together.source import Source

    if _is_model(source):
        from pbrdf.cli.sources import open_single_model

        return Source(_name(source), model=open_single_model(source))
    if _is_fit(source):
        from pbrdf.cli.sources import models_at
        from pbrdf.inversion.stored_result import load_fit

        result = load_fit(source)
        models = models_at(source, reading.wavelength or [None])
        if models is None:
            return Source(_name(source), model=result.model, dataset=result.dataset)
        if len(models) > 1:
            raise PbrdfError(f"--wavelength: of {source} one is drawn, for {len(models)} were asked")
        return Source(_name(source), model=models[0], dataset=reading.selected(result.dataset, source))
    return Source(_name(source), dataset=reading.open(source))


def _is_model(source: str) -> bool:
    """A model's file, a paint, or a folder that holds a model but no whole fit."""
    folder = Path(source)
    return (
        source.endswith(".json")
        or is_paint(source)
        or ((folder / "model.json").is_file() and not _is_fit(source))
    )


def _is_fit(source: str) -> bool:
    from pbrdf.inversion.stored_result import FILE_NAME

    return (Path(source) / FILE_NAME).is_file()


def _name(source: str) -> str:
    return Path(source).resolve().name if Path(source).is_dir() else Path(source).name
