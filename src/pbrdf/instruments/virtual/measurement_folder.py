"""A virtual measurement as a folder of files, as a real one would leave them."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from pbrdf.data.readers import write
from pbrdf.errors import DataError
from pbrdf.files.atomic import atomic_folder, require_new_folder
from pbrdf.instruments.frames.mosaic import weave_mosaic
from pbrdf.instruments.goniometer.angle_table import write_angles
from pbrdf.instruments.polarimeter.instrument_files import save_instrument
from pbrdf.instruments.virtual.experiment import Measurement

__all__ = ["write_measurement"]


def write_measurement(
    measurement: Measurement, folder: str | Path, *, progress: Callable[[int, int], None] | None = None
) -> list[Path]:
    """Write frames, instrument, angles and regions, the reduced data sets, and the models behind them.

    ``frames/SERIES_STATE.png`` (a mosaic: ``frames/SERIES.png``), ``polarimeter.toml``, ``angles.csv`` and
    ``regions.toml`` are what ``pbrdf reduce`` takes; ``SAMPLE.nc`` is what it gives, and ``truth/SAMPLE.json`` the
    models.

    Parameters
    ----------
    measurement
        What was measured.
    folder
        New or empty; it appears when it is complete.
    progress
        Of the reduction.

    Returns
    -------
    list of Path
        The folder of the frames and the files beside it.

    Raises
    ------
    DataError
        If the folder is not new or cannot be written, or a name cannot be that of a file.
    """
    folder = Path(folder)
    require_new_folder(folder)
    for name in (*measurement.samples, *measurement.experiment.instrument.polarimeter.states):
        if not name or "/" in name or "\\" in name or name.startswith("."):
            raise DataError(f"{name!r} cannot be the name of a file: call the sample or the state otherwise")
    with atomic_folder(folder) as target:
        for part in ("frames", "truth"):
            (target / part).mkdir()
        _write_frames(measurement, target / "frames")
        mosaic = measurement.experiment.instrument.polarimeter.mosaic is not None
        pattern = "{series}.png" if mosaic else "{series}_{state}.png"
        save_instrument(
            replace(measurement.experiment.instrument, frames={"pattern": pattern}),
            target / "polarimeter.toml",
        )
        write_angles(measurement.angles, target / "angles.csv")
        lines = [
            f"[{json.dumps(name)}]\nrectangle = {[int(edge) for edge in region.box]}\n"
            for name, region in measurement.regions.items()
        ]
        (target / "regions.toml").write_text("\n".join(lines), encoding="utf-8")
        for name, dataset in measurement.datasets(progress=progress).items():
            write(dataset, target / f"{name}.nc")
        for name, model in measurement.samples.items():
            model.to_json(target / "truth" / f"{name}.json")
        written = sorted(path.relative_to(target) for path in target.iterdir())
    return [folder / path for path in written]


def _write_frames(measurement: Measurement, folder: Path) -> None:
    from PIL import Image

    polarimeter = measurement.experiment.instrument.polarimeter
    for series, frames in zip(measurement.frames.names, measurement.frames.array, strict=True):
        if polarimeter.mosaic is not None:
            pictures = {series: weave_mosaic(frames, polarimeter)}
        else:
            pictures = {f"{series}_{s}": f for s, f in zip(polarimeter.states, frames, strict=True)}
        for name, picture in pictures.items():
            Image.fromarray(picture).save(folder / f"{name}.png")
