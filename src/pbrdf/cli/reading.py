"""A file of data, read and cut down as the command line says."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pbrdf.cli.console import output_console, warn
from pbrdf.cli.values import number, pairs
from pbrdf.errors import DataError, PbrdfError

if TYPE_CHECKING:
    import numpy as np
    import xarray as xr

__all__ = ["SELECTABLE", "Reading", "print_columns"]

#: What geometries can be selected by.
SELECTABLE = ("group", "theta_i", "theta_r", "phi", "wavelength")
_SCALES = ("arbitrary", "absolute")
#: Half the width within which a value that was asked for meets a measured one, degrees and nm.
_TOLERANCE = {"wavelength": 0.5}
_ANGLE_TOLERANCE = 0.05


@dataclass(frozen=True)
class Reading:
    """How to read a file, as given on the command line; the fields are the options.

    Attributes
    ----------
    format, quantity, azimuth, stokes, illumination, cosine_weighted, angles, coverage, scale
        As in :func:`pbrdf.read`; None where not given.
    skip_invalid, every, sheet
        As in :func:`pbrdf.read`; None and False where not given.
    column, unit, where, analyzer, select
        Texts ``NAME=VALUE``.
    ignore
        Names of columns.
    wavelength
        Wavelengths in nm.
    """

    column: list[str]
    unit: list[str]
    ignore: list[str]
    where: list[str]
    analyzer: list[str]
    select: list[str]
    wavelength: list[float]
    skip_invalid: bool
    format: str | None
    quantity: str | None
    azimuth: str | None
    stokes: str | None
    illumination: str | None
    cosine_weighted: bool | None
    angles: str | None
    coverage: float | None
    scale: str | None
    every: int | None
    sheet: str | None

    def stated(self) -> dict[str, Any]:
        """What was given, by option."""
        return {
            f.name: getattr(self, f.name)
            for f in fields(self)
            if getattr(self, f.name) not in (None, [], False)
        }

    def open(self, source: str, *, say: bool = True) -> xr.Dataset:
        """Read a file, or a bundled paint's experiment if no file has that name.

        Parameters
        ----------
        source
            Path or name.
        say
            Whether a column that should perhaps not be left out is named on standard error.

        Raises
        ------
        DataError
            If there is neither, the file cannot be understood, or nothing is left of it.
        """
        from pbrdf.data import read
        from pbrdf.data.origin import origin_of
        from pbrdf.data.paints import PAINTS, open_experiment
        from pbrdf.report.dataset.describe import on_the_command_line

        if self.scale not in (None, *_SCALES):
            raise PbrdfError(f"--scale {self.scale!r}: choose {' or '.join(_SCALES)}")
        options = {
            name: value
            for name, value in self.stated().items()
            if name not in ("select", "wavelength", "scale")
        }
        for name, example in (
            ("column", "I=f_r_per_sr"),
            ("unit", "I=%"),
            ("where", "material=white"),
            ("analyzer", "zero=s"),
        ):
            if name in options:
                options[name] = pairs(options[name], f"--{name}", example)
        if Path(source).exists():
            try:
                dataset = read(source, **options)
            except DataError as error:
                raise DataError(on_the_command_line(str(error))) from error
        elif source in PAINTS:
            if options:
                given = ", ".join("--" + name.replace("_", "-") for name in options)
                raise DataError(f"{source} is a bundled data set and needs no {given}: leave it out")
            dataset = open_experiment(source)
        else:
            names = f", and no bundled paint has that name; those are {', '.join(PAINTS)}"
            raise DataError(f"{source}: there is no such file{'' if Path(source).suffix else names}")
        if self.scale is not None:
            dataset.attrs["scale"] = self.scale
        dataset = self.selected(dataset, source)
        origin = origin_of(dataset)
        for sentence in origin.remarks if say and origin else ():
            warn(f"{source}: {on_the_command_line(sentence)}")
        return dataset

    def selected(self, dataset: xr.Dataset, source: str) -> xr.Dataset:
        """The geometries that are asked for; raises DataError where there are none."""
        selections = list(pairs(self.select, "--select", "theta_i=0:80").items())
        if self.wavelength:
            selections.append(("wavelength", ",".join(f"{w:g}" for w in self.wavelength)))
        for kind, text in selections:
            dataset = _selected(dataset, kind, text, source)
        return dataset


def print_columns(dataset: xr.Dataset, source: str) -> None:
    """Print what each column of a table was taken for, and which were not used."""
    from pbrdf.report.dataset.describe import columns_in_words

    console = output_console()
    for i, line in enumerate(columns_in_words(dataset)):
        console.print(f"Columns of {source}: {line}" if i == 0 else line, markup=False)


def _selected(dataset: xr.Dataset, kind: str, text: str, source: str) -> xr.Dataset:
    """The geometries with these values (``10,20``) or in this range (``0:80``) of a coordinate."""
    import numpy as np

    from pbrdf.data.origin import of_rows

    if kind not in SELECTABLE:
        raise PbrdfError(f"--select: select by {', '.join(SELECTABLE)}, not by {kind!r}")
    if kind not in dataset.coords:
        raise DataError(f"{source}: the data state no {kind} to select by")
    values = dataset[kind].values
    if kind == "group":
        keep = np.isin(values.astype(str), [part.strip() for part in text.split(",")])
        available = sorted(set(values.astype(str)))
    else:
        values = values if kind == "wavelength" else np.rad2deg(values)
        keep = _within(values, text, kind)
        available = [f"{v:g}" for v in np.unique(np.round(values, 2))]
    if not keep.any():
        shown = ", ".join(available[:20]) + (" …" if len(available) > 20 else "")
        raise DataError(f"{source}: nothing has {kind}={text}; there are {shown}")
    return of_rows(dataset, keep, dataset.isel(geometry=keep))


def _within(values: np.ndarray, text: str, kind: str) -> np.ndarray:
    import numpy as np

    tolerance = _TOLERANCE.get(kind, _ANGLE_TOLERANCE)
    option = f"--select {kind}"
    if ":" in text:
        ends = text.split(":")
        if len(ends) != 2:
            raise PbrdfError(f"{option}={text}: give values like 10,20 or one range like 0:80")
        low, high = (number(end, option) for end in ends)
        return (values >= low - tolerance) & (values <= high + tolerance)
    wanted = np.array([number(part, option) for part in text.split(",")])
    found: np.ndarray = (np.abs(values[:, None] - wanted) <= tolerance).any(axis=1)
    return found
