"""Instruments in TOML files.

Angles are in degrees. Every key of the tables ``[polarimeter]`` and ``[detector]`` is known here, and an unknown one is
refused; ``[frames]`` is kept as it stands. The format is described in docs/instruments.md.
"""

from __future__ import annotations

import datetime
import difflib
import json
import math
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pbrdf.errors import DataError, PbrdfError
from pbrdf.files.atomic import atomic_file
from pbrdf.files.text import read_toml
from pbrdf.instruments.polarimeter.analyzer_files import read_analyzer, write_analyzer
from pbrdf.instruments.polarimeter.band import Band, cauchy, gaussian_band, in_band, read_band, top_hat_band
from pbrdf.instruments.polarimeter.color_filters import BAYER, ColorFilters, of_cells, smallest_cell
from pbrdf.instruments.polarimeter.detector import Detector
from pbrdf.instruments.polarimeter.instrument import FRAME_FILES, Instrument
from pbrdf.instruments.polarimeter.mueller_polarimeter import dual_rotating_retarder
from pbrdf.instruments.polarimeter.polarimeter import Polarimeter, from_settings, measured
from pbrdf.instruments.polarimeter.presets import preset
from pbrdf.instruments.polarimeter.retardance_sets import retardance_set

__all__ = ["load_instrument", "save_instrument"]

_COMMON = ("kind", "name", "states", "accuracy", "reference_angle", "stability")
_COLORS = ("colors", "wavelengths", "greens", "color")
_KINDS: dict[str, tuple[str, ...]] = {
    "lcvr": ("axes", "retardances", "set", "analyzer", "diattenuation", "band"),
    "rotating_retarder": ("angles", "retardance", "analyzer", "diattenuation", "band"),
    "rotating_polarizer": ("angles", "diattenuation"),
    "dual_rotating_retarder": (
        "angles",
        "generator_angles",
        "analyzer_angles",
        "steps",
        "step",
        "ratio",
        "retardance",
        "generator_retardance",
        "analyzer_retardance",
        "polarizer",
        "analyzer",
        "diattenuation",
        "generator_reference_angle",
    ),
    "division_of_focal_plane": ("layout", "diattenuation", *_COLORS),
    "measured": ("analyzer_file", "analyzer_vectors", "mosaic", *_COLORS),
    "preset": ("preset", *_COLORS),
}
_BAND = ("shape", "center", "width", "file", "reference", "birefringence")
_DETECTOR = ("bits", "gain", "read_noise", "offset", "dark", "full_well", "full_scale", "alignment")
#: No number of an instrument is as large; in radians or squared, a larger one could become infinite.
_LARGEST = 1e100
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


def load_instrument(path: str | Path) -> Instrument:
    """Read an instrument from a TOML file.

    Parameters
    ----------
    path
        The file; names of files in it are relative to its folder.

    Raises
    ------
    DataError
        If the file cannot be read, is not TOML, or says something that is not understood: names file, table and key.
    """
    path = Path(path)
    content = read_toml(path)
    top = _Table(path, "", content, ("polarimeter", "detector", "frames"))
    if "polarimeter" not in content:
        raise DataError(f"{path}: there is no table [polarimeter]; it says what the instrument is, kind = …")
    table = top.table("polarimeter")
    if isinstance(table.content.get("kind"), str):
        table.content["kind"] = table.content["kind"].replace("-", "_")
    kind = table.choice("kind", _KINDS)
    table = _Table(path, "polarimeter", table.content, (*_COMMON, *_KINDS[kind]), f"the kind {kind!r}")
    try:
        if kind == "preset":
            name = table.text("preset")
            instrument = preset(name)
        elif kind == "dual_rotating_retarder":
            instrument = _dual_rotating_retarder(table)
        else:
            instrument = Instrument(_polarimeter(table, kind))
        instrument = replace(
            instrument,
            polarimeter=_described(table, instrument.polarimeter),
            detector=_detector(
                path, content.get("detector", {}), instrument.detector, scaled=kind == "preset"
            ),
            reference_angle=math.radians(table.number("reference_angle", 0.0)),
            stability=table.number("stability", instrument.stability),
        )
    except PbrdfError as error:
        # those of files that the table names, and of its keys, say where they are
        located = str(error).startswith((f"{path}: ", *(f"{path.parent / name}: " for name in _files(table))))
        raise error if located else DataError(f"{path}: [polarimeter] {error}") from error
    frames = dict(top.table("frames").content) if "frames" in content else {}
    return replace(instrument, frames=frames, folder=path.parent)


def save_instrument(instrument: Instrument, path: str | Path) -> None:
    """Write an instrument as a TOML file that :func:`load_instrument` reads back.

    A polarimeter that its kind and settings do not describe (a calibrated one, one turned) is stored by its analyser
    vectors, in a file beside: ``NAME_analyzer.csv``, or ``NAME_analyzer.nc`` for a map.

    Parameters
    ----------
    instrument
        The instrument.
    path
        The file; replaced, when the new one is complete, if it exists.

    Raises
    ------
    DataError
        If a file cannot be written.
    """
    path = Path(path)
    polarimeter = instrument.polarimeter
    table = {"kind": "measured", **_settings(polarimeter), "name": polarimeter.name}
    table["states"] = list(polarimeter.states)
    if any(polarimeter.accuracy):
        table["accuracy"] = dict(zip(("linear", "circular"), map(float, polarimeter.accuracy), strict=True))
    table["reference_angle"] = _degrees(instrument.reference_angle)
    table["stability"] = float(instrument.stability)
    if instrument.generator is not None:
        table |= instrument.generator.settings
        table["generator_reference_angle"] = _degrees(instrument.generator.reference_angle)
    elif table["kind"] == "measured":
        beside = path.with_name(f"{path.stem}_analyzer{'.nc' if polarimeter.is_map else '.csv'}")
        write_analyzer(polarimeter, beside)
        table["analyzer_file"] = beside.name
        if polarimeter.mosaic is not None:
            table["mosaic"] = polarimeter.mosaic.tolist()
    if polarimeter.filters is not None:
        table["colors"] = polarimeter.filters.layout
        if polarimeter.filters.wavelengths:
            table["wavelengths"] = dict(polarimeter.filters.wavelengths)
        if polarimeter.filters.apart:
            table["greens"] = "apart"
        if polarimeter.filters.only is not None:
            table["color"] = polarimeter.filters.only
    detector = {key: getattr(instrument.detector, key) for key in _DETECTOR}
    detector = {key: value for key, value in detector.items() if value is not None}
    frames = dict(instrument.frames)
    for key in FRAME_FILES:
        if isinstance(frames.get(key), str) and instrument.folder is not None:
            frames[key] = Path(os.path.relpath(instrument.folder / frames[key], path.parent)).as_posix()
    lines = []
    for name, content in (("polarimeter", table), ("detector", detector), ("frames", frames)):
        if content:
            lines += [f"[{name}]", *(f"{_key(k)} = {_value(v)}" for k, v in content.items()), ""]
    with atomic_file(path) as target:
        target.write_text("\n".join(lines), encoding="utf-8")


# Reading


class _Table:
    """A table of the file whose keys are known, and whose values are checked as they are taken."""

    def __init__(
        self, path: Path, name: str, content: Any, keys: Iterable[str] | None, owner: str = ""
    ) -> None:
        self.path, self.name = path, name
        if not isinstance(content, dict):
            raise DataError(f"{path}: {name!r} is not a table: begin it with a line [{name}]")
        self.content: dict[str, Any] = content
        if keys is None:
            return
        keys = list(keys)
        for key in content:
            if key not in keys:
                near = difflib.get_close_matches(key, keys, n=1)
                hint = f"did you mean {near[0]!r}? " if near else ""
                where = f"[{name}] {key}" if name else f"[{key}]"
                raise DataError(
                    f"{path}: {where}: {owner or 'this file'} has no {'key' if name else 'table'} {key!r}; "
                    f"{hint}it may hold {', '.join(keys)}"
                )

    def wrong(self, key: str, need: str) -> DataError:
        value = repr(self.content[key]) if key in self.content else "missing"
        shown = value if len(value) <= 60 else f"{value[:57]}…"
        return DataError(f"{self.path}: [{self.name}] {key} is {shown}: give {need}")

    def table(self, key: str) -> _Table:
        return _Table(self.path, key, self.content[key], None)

    def text(self, key: str, default: str | None = None) -> str:
        value = self.content.get(key, default)
        if not isinstance(value, str):
            raise self.wrong(key, "a text in quotes")
        return value

    def choice(self, key: str, known: Iterable[str]) -> str:
        known = list(known)
        value = self.content.get(key)
        if value not in known:
            near = difflib.get_close_matches(str(value), known, n=1)
            raise self.wrong(key, f"one of {', '.join(known)}" + (f" (perhaps {near[0]!r})" if near else ""))
        return str(value)

    def number(self, key: str, default: float | None = None) -> float:
        value = self.content.get(key, default)
        if not isinstance(value, int | float) or not _is_number(value):
            raise self.wrong(key, "a number")
        return float(value)

    def numbers(self, key: str, ndim: int, default: Any = None) -> np.ndarray:
        need = "a list of numbers [a, b, …]" if ndim == 1 else "a list of rows [[a, b, …], [c, d, …]]"
        value = self.content.get(key, default)
        if not isinstance(value, list) or not value or not all(_is_number(v) for v in _leaves(value)):
            raise self.wrong(key, need)
        try:
            array = np.array(value, dtype=float)
        except ValueError:
            raise self.wrong(key, f"{need}, all rows of the same length") from None
        if array.ndim != ndim:
            raise self.wrong(key, need)
        return array


def _leaves(value: Any) -> Iterable[Any]:
    if isinstance(value, list):
        for item in value:
            yield from _leaves(item)
    else:
        yield value


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < _LARGEST


def _polarimeter(table: _Table, kind: str) -> Polarimeter:
    if kind == "measured":
        return _measured(table)
    settings: dict[str, Any] = {"kind": kind, "diattenuation": table.number("diattenuation", 1.0)}
    if kind == "lcvr":
        if ("set" in table.content) == ("retardances" in table.content):
            raise DataError(
                f"{table.path}: [polarimeter] give either retardances, or set, the name of a set of them"
            )
        if "set" in table.content:
            settings["retardances"] = np.rad2deg(retardance_set(table.text("set")))
        else:
            settings["retardances"] = table.numbers("retardances", 2)
        settings["axes"] = table.numbers("axes", 1, [0, 45])
    elif kind == "division_of_focal_plane":
        settings["layout"] = table.numbers("layout", 2)
        if set(_COLORS) & set(table.content):
            # else each colour would stand over several of its cells, and different ones in the picture
            settings["layout"] = smallest_cell(settings["layout"])
    else:
        settings["angles"] = table.numbers("angles", 1)
    if kind == "rotating_retarder":
        settings["retardance"] = table.number("retardance", 90.0)
    if kind in ("lcvr", "rotating_retarder"):
        settings["analyzer"] = table.number("analyzer", 0.0)
    polarimeter = from_settings(settings)
    return _in_band(table, polarimeter) if "band" in table.content else polarimeter


def _dual_rotating_retarder(table: _Table) -> Instrument:
    content = table.content
    lists = {"generator_angles", "analyzer_angles"} & set(content)
    ways = [bool("angles" in content), bool(lists), bool({"steps", "step", "ratio"} & set(content))]
    if sum(ways) > 1:
        raise DataError(
            f"{table.path}: [polarimeter] give angles as pairs [[generator, analyser], …], or generator_angles and "
            "analyzer_angles, or steps, step and ratio"
        )
    if "angles" in content:
        pairs = table.numbers("angles", 2)
        if pairs.shape[1] != 2:
            raise table.wrong("angles", "pairs [[generator, analyser], …]")
        first, second = pairs.T
    elif lists:
        first = table.numbers("generator_angles", 1)
        second = table.numbers("analyzer_angles", 1) if "analyzer_angles" in content else 5.0 * first
    else:
        steps = table.number("steps", 36)
        if steps != int(steps) or not 16 <= steps <= 100_000:
            raise table.wrong("steps", "a whole number from 16")
        first = table.number("step", 180.0 / steps) * np.arange(int(steps))
        second = table.number("ratio", 5.0) * first
    both = table.number("retardance", 90.0)
    polarimeter, generator = dual_rotating_retarder(
        np.deg2rad(first),
        np.deg2rad(second),
        generator_retardance=math.radians(table.number("generator_retardance", both)),
        analyzer_retardance=math.radians(table.number("analyzer_retardance", both)),
        polarizer=math.radians(table.number("polarizer", 0.0)),
        analyzer=math.radians(table.number("analyzer", 0.0)),
        diattenuation=table.number("diattenuation", 1.0),
    )
    turned = math.radians(table.number("generator_reference_angle", 0.0))
    return Instrument(polarimeter, generator=replace(generator, reference_angle=turned))


def _in_band(table: _Table, polarimeter: Polarimeter) -> Polarimeter:
    content = table.content["band"]
    if not isinstance(content, dict):
        raise table.wrong("band", "{ shape = …, center = …, width = … } or { file = … }")
    stated = _Table(table.path, "polarimeter.band", content, _BAND, "the band")
    if "file" in content:
        if {"shape", "center", "width"} & {*content}:
            raise DataError(f"{table.path}: [polarimeter.band] give either file, or shape, center and width")
        band: Band = read_band(table.path.parent / stated.text("file"))
    else:
        shapes = {"gaussian": gaussian_band, "top_hat": top_hat_band}
        band = shapes[stated.choice("shape", shapes)](stated.number("center"), stated.number("width"))
    birefringence = None
    if "birefringence" in content:
        birefringence = cauchy(*stated.numbers("birefringence", 1))
    reference = stated.number("reference") if "reference" in content else None
    return in_band(polarimeter, band, reference=reference, birefringence=birefringence)


def _measured(table: _Table) -> Polarimeter:
    if ("analyzer_file" in table.content) == ("analyzer_vectors" in table.content):
        raise DataError(
            f"{table.path}: [polarimeter] give either analyzer_file, a CSV or netCDF file, or analyzer_vectors"
        )
    if "analyzer_file" in table.content:
        polarimeter = read_analyzer(table.path.parent / table.text("analyzer_file"))
    else:
        polarimeter = measured(table.numbers("analyzer_vectors", 2))
    if "mosaic" in table.content:
        mosaic = table.numbers("mosaic", 2)
        if (mosaic != np.rint(mosaic)).any():
            raise table.wrong(
                "mosaic", "rows of whole numbers, the index of the state at each pixel of the cell"
            )
        polarimeter = replace(polarimeter, mosaic=mosaic.astype(int))
    return polarimeter


def _files(table: _Table) -> list[str]:
    """Names of files in the table."""
    band = table.content.get("band")
    names = [table.content.get("analyzer_file"), band.get("file") if isinstance(band, dict) else None]
    return [name for name in names if isinstance(name, str)]


def _described(table: _Table, polarimeter: Polarimeter) -> Polarimeter:
    """The polarimeter with the names and the accuracy that the table states."""
    if "name" in table.content:
        polarimeter = replace(polarimeter, name=table.text("name"))
    if "states" in table.content:
        states = table.content["states"]
        if not (isinstance(states, list) and all(isinstance(s, str) for s in states)):
            raise table.wrong("states", "a list of names in quotes, one for each state")
        polarimeter = replace(polarimeter, states=tuple(states))
    if set(_COLORS) & set(table.content):
        filters = _filters(table, polarimeter.filters)
        if polarimeter.mosaic is not None:
            filters = replace(filters, layout=of_cells(filters.layout, polarimeter.mosaic.shape))
        polarimeter = replace(polarimeter, filters=filters)
    if "accuracy" in table.content:
        content = table.content["accuracy"]
        if not isinstance(content, dict):
            raise table.wrong("accuracy", "{ linear = …, circular = … }")
        stated = _Table(table.path, "polarimeter.accuracy", content, ("linear", "circular"), "the accuracy")
        polarimeter = polarimeter.with_accuracy(stated.number("linear", 0.0), stated.number("circular", 0.0))
    return polarimeter


def _filters(table: _Table, default: ColorFilters | None) -> ColorFilters:
    """The colours over the cells of a mosaic."""
    if default is None and "colors" not in table.content:
        raise DataError(f"{table.path}: [polarimeter] say which colours there are: colors = {_value(BAYER)}")
    made = default or ColorFilters()
    if "colors" in table.content:
        rows = table.content["colors"]
        if not (isinstance(rows, list) and rows and all(isinstance(r, list) for r in rows)) or not all(
            isinstance(name, str) for row in rows for name in row
        ):
            raise table.wrong("colors", f"rows of names, such as {_value(BAYER)}")
        made = replace(made, layout=tuple(map(tuple, rows)))
    if "wavelengths" in table.content:
        content = table.content["wavelengths"]
        if not isinstance(content, dict) or not all(_is_number(v) for v in content.values()):
            raise table.wrong("wavelengths", "nanometres of each colour, { R = 610, G = 540, B = 460 }")
        made = replace(made, wavelengths={name: float(v) for name, v in content.items()})
    if "greens" in table.content:
        made = replace(made, apart=table.choice("greens", ("joined", "apart")) == "apart")
    if "color" in table.content:
        made = replace(made, only=table.text("color"))
    return made


def _detector(path: Path, content: Any, default: Detector, *, scaled: bool) -> Detector:
    table = _Table(path, "detector", content, _DETECTOR, "the detector")
    bits = content.get("bits")
    if scaled and "gain" not in content and isinstance(bits, int) and 1 <= bits <= 16:
        # the same electrons over more or fewer numbers
        default = replace(default, gain=default.gain * 2.0 ** (default.bits - bits))
    for key, value in table.content.items():
        if key == "alignment":
            table.choice(key, ("left", "right"))
        elif not _is_number(value):
            raise table.wrong(key, "a number")
    try:
        return replace(default, **table.content)
    except DataError as error:
        raise DataError(f"{path}: [detector] {str(error).removeprefix('detector: ')}") from error


# Writing


def _settings(polarimeter: Polarimeter) -> dict[str, Any]:
    """Kind and settings of the polarimeter, if the file's keys can describe it; nothing otherwise."""
    details = polarimeter.details
    if "turned" in details or not polarimeter.is_described:
        return {}
    return {
        key: details[key] for key in ("kind", *_KINDS[details["kind"]]) if key in details and key != "band"
    }


def _degrees(radians: float) -> float:
    return round(math.degrees(radians), 10)


def _key(name: str) -> str:
    return name if _BARE_KEY.fullmatch(name) else _value(name)


def _value(value: Any) -> str:
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, datetime.date | datetime.time):
        return value.isoformat()
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_value, value)) + "]"
    raise DataError(f"a value of the type {type(value).__name__} cannot be written to a TOML file")
