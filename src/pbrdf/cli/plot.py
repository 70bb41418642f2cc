"""``pbrdf plot``: a figure of a model or of a file of data."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pbrdf.cli.options import output_option, with_reading_options
from pbrdf.cli.reading import Reading
from pbrdf.cli.sources import is_paint
from pbrdf.cli.values import require_folder_of
from pbrdf.errors import PbrdfError

__all__ = ["plot"]


@with_reading_options
def plot(
    source: Annotated[
        str,
        typer.Argument(
            metavar="MODEL|DATA",
            help="A model's JSON file, a bundled paint's name (its model), or a file of data.",
        ),
    ],
    *,
    reading: Reading,
    theta_i: Annotated[
        float | None, typer.Option(help="Angle of incidence in degrees, for a model; 35.")
    ] = None,
    output: Annotated[
        Path | None,
        output_option("The figure: .png, .pdf or .svg.", show_default="<name>.png"),
    ] = None,
) -> None:
    """Draw a model at one angle of incidence, or the points of a file of data."""
    from pbrdf.data.paints import load_paint
    from pbrdf.models import load_model
    from pbrdf.report.dataset.figure import data_figure
    from pbrdf.report.model.figure import model_figure
    from pbrdf.report.style import save_figure

    target = output or Path(f"{Path(source).stem}.png")
    if target.exists() and target.resolve() == Path(source).resolve():
        raise PbrdfError(f"{target}: this is the file to draw; name another with --output")
    require_folder_of(target)
    is_model = source.endswith(".json") or is_paint(source)
    if is_model:
        if given := reading.stated():
            raise PbrdfError(
                f"{source} is a model: --{next(iter(given)).replace('_', '-')} is for files of data"
            )
        model = load_model(source) if source.endswith(".json") else load_paint(source)
        figure = model_figure(model, 35.0 if theta_i is None else theta_i, Path(source).name)
    else:
        if theta_i is not None:
            raise PbrdfError("--theta-i is for models; choose points of a file with --select theta_i=…")
        figure = data_figure(reading.open(source), Path(source).name)
    save_figure(figure, target)
    print(target)
