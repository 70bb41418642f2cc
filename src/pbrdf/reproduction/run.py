"""The reproduction as a whole: simulate, invert, test, and write the report's folder."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path

from pbrdf.data.paints import load_paint
from pbrdf.data.readers import write
from pbrdf.files.atomic import atomic_folder
from pbrdf.reproduction.experiment.measurement import Options, measured_samples
from pbrdf.reproduction.experiment.sample import Sample, invert
from pbrdf.reproduction.paper import SIMULATED
from pbrdf.reproduction.result import Reproduction
from pbrdf.reproduction.statements.catalogue import evaluate
from pbrdf.reproduction.statements.expected import expected_numbers

__all__ = ["reproduce", "write_reproduction"]

#: Called with the name of the stage, the pieces of it that are done, and all of them.
Progress = Callable[[str, int, int], None]


def reproduce(options: Options, progress: Progress | None = None) -> Reproduction:
    """Simulate the paper's experiment, invert it and test the paper's statements.

    Raises
    ------
    DataError, FitError
        If the options do not make an experiment, or its data do not allow a fit.
    """

    def stage(name: str) -> Callable[[int, int], None]:
        return lambda done, of: progress(name, done, of) if progress is not None else None

    datasets = measured_samples(options, stage("Frames and Stokes vectors"))
    tell = stage("Inversions")
    samples: list[Sample] = []
    tell(0, len(datasets))
    for done, (name, dataset) in enumerate(datasets.items(), start=1):
        samples.append(invert(name, dataset, load_paint(name), starts=options.starts, seed=options.seed))
        tell(done, len(datasets))
    statements = evaluate(options.positions, samples, stage("Statements"))
    return Reproduction(options, samples, statements, expected_numbers())


def write_reproduction(
    reproduction: Reproduction, directory: Path, progress: Progress | None = None
) -> list[Path]:
    """Write the page, the figures, the tables, the data sets and the models, all or nothing.

    Parameters
    ----------
    reproduction
        What to write.
    directory
        The folder; files of the same names in it are replaced.

    Returns
    -------
    list of Path
        The page, then all other files.

    Raises
    ------
    DataError
        If the folder cannot be written.
    """
    from pbrdf.report.style import save_figure
    from pbrdf.reproduction.figures.all import pictures
    from pbrdf.reproduction.page.page import page_text
    from pbrdf.reproduction.page.tables import csv_text, tables

    settings = reproduction.options.in_words()
    rows = tables(reproduction.samples, reproduction.statements, reproduction.numbers)
    with atomic_folder(directory, fill=True) as folder:
        for name in ("figures", "tables", "data", "models"):
            (folder / name).mkdir()
        makers = pictures(reproduction.samples, reproduction.options.positions)
        if progress is not None:
            progress("Figures", 0, len(makers))
        for done, (name, make) in enumerate(makers.items(), start=1):
            figure = make()
            for kind in ("png", "svg"):
                save_figure(figure, folder / "figures" / f"{name}.{kind}")
            if progress is not None:
                progress("Figures", done, len(makers))
        for name, table in rows.items():
            (folder / "tables" / f"{name}.csv").write_text(csv_text(table, settings), encoding="utf-8")
        for sample in reproduction.samples:
            write(sample.dataset, folder / "data" / f"{sample.name}.csv")
            (folder / "models" / f"{sample.name}.json").write_text(
                _model_text(sample, settings), encoding="utf-8"
            )
        (folder / "index.html").write_text(page_text(reproduction, folder), encoding="utf-8")
        names = sorted(p.relative_to(folder) for p in folder.rglob("*") if p.is_file())
    return [directory / "index.html", *(directory / n for n in names if n.name != "index.html")]


def _model_text(sample: Sample, settings: str) -> str:
    """A model file that says what it was fitted to."""
    content: Mapping[str, object] = {
        "note": f"fitted to {SIMULATED} ({settings})",
        **sample.result.model.to_dict(),
    }
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
