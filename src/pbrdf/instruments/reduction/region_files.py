"""Regions of interest from files and from words.

TOML, one table a region, with one of four keys::

    [paint]
    rectangle = [100, 200, 150, 260]                 # x0, x1, y0, y1
    [reference]
    ellipse = [320, 240, 40, 30]                     # x, y, half axes along x and y
    [edge]
    polygon = [[10, 10], [90, 20], [50, 80]]
    [coin]
    labels = "labels.png"                            # picture of whole numbers
    value = 3

CSV, rectangles only, with the columns ``name,x0,x1,y0,y1`` (:mod:`pbrdf.files.delimited` says how they may be
separated). A picture (PNG, TIFF, NPY) of whole numbers: each number but 0 is a region of that name. On the command
line: ``paint=100:200,150:260`` (x0:x1,y0:y1), ``disc=ellipse:320,240,40,30``, ``edge=polygon:10,10,90,20,50,80``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pbrdf.errors import DataError
from pbrdf.files.delimited import TABLE_EXTENSIONS, read_table
from pbrdf.files.plain_numbers import number_from_text
from pbrdf.files.text import read_toml
from pbrdf.instruments.frames.pictures import SUFFIXES, open_pictures
from pbrdf.instruments.reduction.regions import Ellipse, LabelRegion, Polygon, Rectangle, Region

__all__ = ["read_regions", "region_from_text"]

#: More values than this in a picture of labels are a photograph.
_MOST_LABELS = 1000


def region_from_text(text: str) -> Region:
    """A region in words: ``x0:x1,y0:y1``, ``ellipse:x,y,rx,ry`` or ``polygon:x,y,x,y,x,y``.

    Raises
    ------
    DataError
        If the text has another form.
    """
    kind, sign, rest = text.partition(":")
    try:
        if sign and kind.strip() in ("ellipse", "polygon"):
            numbers = [_finite(part) for part in rest.split(",")]
            if kind.strip() == "ellipse":
                return Ellipse(*numbers) if len(numbers) == 4 else _refuse(text)
            return _polygon(list(zip(numbers[::2], numbers[1::2], strict=True)))
        across, down = text.split(",")
        return Rectangle(*(_finite(part) for span in (across, down) for part in _span(span)))
    except DataError:
        raise
    except ValueError:
        return _refuse(text)


def _refuse(text: str) -> Region:
    raise DataError(f"{text!r} is no region: give x0:x1,y0:y1, or ellipse:x,y,rx,ry, or polygon:x,y,x,y,x,y")


def _finite(number: str | float) -> float:
    if isinstance(number, bool):
        raise ValueError
    try:
        value = number_from_text(number) if isinstance(number, str) else float(number)
    except OverflowError:
        raise ValueError from None
    if not math.isfinite(value):
        raise ValueError
    return value


def _span(text: str) -> tuple[str, str]:
    first, last = text.split(":")
    return first, last


def _polygon(points: Sequence[Sequence[float]]) -> Polygon:
    return Polygon(tuple((_finite(x), _finite(y)) for x, y in points))


def read_regions(path: str | Path) -> dict[str, Region]:
    """Regions by name from a TOML file, a table or a picture of labels; the module's text describes them.

    Raises
    ------
    DataError
        Names the file and the region or the line.
    """
    path = Path(path)
    kind = path.suffix.lower()
    if kind == ".toml":
        regions = _from_toml(path)
    elif kind in TABLE_EXTENSIONS:
        regions = _from_csv(path)
    elif kind in SUFFIXES:
        labels = _labels(path)
        values = np.unique(labels)
        if len(values) > _MOST_LABELS:
            raise DataError(f"{path}: {len(values)} different values are more than regions can have")
        regions = {str(value): LabelRegion(labels, int(value)) for value in values if value != 0}
    else:
        raise DataError(
            f"{path}: regions are read from .toml, .csv and other tables, pictures of labels ({', '.join(SUFFIXES)})"
        )
    if not regions:
        raise DataError(f"{path}: there is no region in it")
    return regions


def _from_toml(path: Path) -> dict[str, Region]:
    regions: dict[str, Region] = {}
    for name, table in read_toml(path).items():
        try:
            regions[name] = _from_table(table, path.parent)
        except DataError as error:
            raise DataError(f"{path}: region {name!r}: {error}") from error
        except (TypeError, ValueError):
            raise DataError(
                f"{path}: region {name!r}: give rectangle = [x0, x1, y0, y1], ellipse = [x, y, rx, ry], "
                'polygon = [[x, y], …] or labels = "file.png" with value = 1'
            ) from None
    return regions


def _from_table(table: Any, folder: Path) -> Region:
    keys = set(table)
    if keys == {"rectangle"}:
        x0, x1, y0, y1 = map(_finite, table["rectangle"])
        return Rectangle(x0, x1, y0, y1)
    if keys == {"ellipse"}:
        x, y, rx, ry = map(_finite, table["ellipse"])
        return Ellipse(x, y, rx, ry)
    if keys == {"polygon"}:
        return _polygon(table["polygon"])
    if keys == {"labels", "value"} and type(table["value"]) is int:
        return LabelRegion(_labels(folder / table["labels"]), table["value"])
    raise ValueError


def _from_csv(path: Path) -> dict[str, Region]:
    table = read_table(path)
    wanted = ("name", "x0", "x1", "y0", "y1")
    if sorted(table.names) != sorted(wanted):
        raise DataError(f"{path}: its columns are {', '.join(table.names)}; give {', '.join(wanted)}")
    regions: dict[str, Region] = {}
    for row in table:
        name = row.text("name")
        if name in regions:
            raise DataError(f"{row.line}: {name!r} stands there twice")
        edges = [row.number(key) for key in wanted[1:]]
        if not all(map(math.isfinite, edges)):
            raise DataError(f"{row.line}: give a name and four finite numbers")
        try:
            regions[name] = Rectangle(*edges)
        except DataError as error:
            raise DataError(f"{row.line}: {error}") from error
    return regions


def _labels(path: Path) -> np.ndarray:
    file = open_pictures(path)
    if file.count != 1 or file.dtype.kind not in "uib":
        raise DataError(f"{path}: a picture of labels is one picture of whole numbers")
    return file.read(0, 0, file.rows)
