"""Frames from files: folders of pictures, stacks, netCDF files and Zarr folders.

A folder holds one picture a state, called as the pattern of the instrument's table ``[frames]`` says; without one
``{series}_{state}``, ``{state}`` alone where there is one series, or ``{series}/{state}`` where each series has a
folder. For a division of focal plane every picture is a series, and where a pattern has no ``{state}``, every file is
the stack of a series. In a single file the states follow each other, then the series: state 1, 2, …, N of the first
series, then of the next.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pbrdf.errors import DataError
from pbrdf.instruments.frames.frame_grids import GRID_SUFFIXES, open_grid
from pbrdf.instruments.frames.frame_layout import FrameLayout
from pbrdf.instruments.frames.frames import Frames, named, require_raw
from pbrdf.instruments.frames.mosaic import MosaicFrames
from pbrdf.instruments.frames.pictures import SUFFIXES, PictureFile, open_pictures
from pbrdf.instruments.polarimeter.instrument import Instrument

__all__ = ["FileFrames", "open_frames", "open_picture"]


@dataclass(frozen=True, eq=False)
class FileFrames:
    """Frames in picture files.

    Attributes
    ----------
    names
        Of the series.
    places
        For each series the file and the number of the picture in it for each state.
    """

    names: tuple[str, ...]
    places: tuple[tuple[tuple[PictureFile, int], ...], ...]

    @property
    def states(self) -> int:
        return len(self.places[0])

    @property
    def rows(self) -> int:
        return self.places[0][0][0].rows

    @property
    def columns(self) -> int:
        return self.places[0][0][0].columns

    def read(self, series: int, first_row: int, last_row: int) -> np.ndarray:
        parts = (file.read(picture, first_row, last_row) for file, picture in self.places[series])
        return np.stack([part.astype(part.dtype.newbyteorder("="), copy=False) for part in parts])


def open_frames(path: str | Path, instrument: Instrument) -> Frames:
    """Find the frames of a measurement; no picture is read yet.

    Parameters
    ----------
    path
        A folder of PNG, TIFF or NPY files or of such folders, a TIFF or NPY file with all pictures, one mosaic
        picture, a netCDF file, or a Zarr folder.
    instrument
        What took them: names of the states, mosaic, table ``[frames]``.

    Raises
    ------
    DataError
        If something is missing, left over, or differs in size or type; names the files.
    """
    path = Path(path)
    if not path.exists():
        raise DataError(f"{path}: there is no such file or folder")
    layout = FrameLayout.from_table(instrument.frames, instrument.folder)
    mosaic = instrument.polarimeter.mosaic is not None
    states = ("mosaic",) if mosaic else instrument.polarimeter.states
    if path.suffix.lower() in GRID_SUFFIXES:
        frames: Frames = open_grid(path, states)
    elif path.is_dir():
        frames = _open_folder(path, layout, states, mosaic)
    else:
        frames = _open_file(path, states)
    return MosaicFrames(frames, instrument.polarimeter) if mosaic else frames


def open_picture(path: Path) -> FileFrames:
    """One picture as frames with one series and one state; raises DataError if there are more in the file."""
    file = open_pictures(path)
    if file.count != 1:
        raise DataError(f"{path}: it holds {file.count} pictures, and one is wanted")
    return FileFrames((path.stem,), (((file, 0),),))


def _open_file(path: Path, states: Sequence[str]) -> FileFrames:
    file = open_pictures(path)
    require_raw(file.dtype, str(path))
    if file.count % len(states):
        held = "one picture" if file.count == 1 else f"{file.count} pictures"
        raise DataError(
            f"{path}: it holds {held}, and a series needs one for each of the {len(states)} states {named(states)}: "
            "name the folder with all of them, or a stack"
        )
    count = file.count // len(states)
    if len(file.shape) == 4 and file.shape[1] != len(states):
        raise DataError(
            f"{path}: an array of the shape {file.shape} has not {len(states)} states in its second place"
        )
    pictures = iter(range(file.count))
    places = tuple(tuple((file, next(pictures)) for _ in states) for _ in range(count))
    return FileFrames((path.stem,) if count == 1 else tuple(str(i + 1) for i in range(count)), places)


# Folders


def _open_folder(folder: Path, layout: FrameLayout, states: Sequence[str], mosaic: bool) -> FileFrames:
    apart = {file.resolve() for file in layout.files}
    files = [f for f in _pictures_in(folder, "*") if f.resolve() not in apart]
    below = [f for f in _pictures_in(folder, "*/*") if f.resolve() not in apart]
    pattern = layout.pattern or _usual_pattern(files, below, states, mosaic)
    fields = re.findall(r"\{(.*?)\}", pattern)
    if set(fields) - {"series", "state"} or len(fields) != len(set(fields)) or (mosaic and "state" in fields):
        usable = "{series} once" if mosaic else "{series} and {state} once each"
        raise DataError(
            f"[frames] pattern {pattern!r}: the pattern may hold {usable}, and nothing else in braces"
        )
    candidates = below if "/" in pattern else files
    if not candidates:
        raise DataError(f"{folder}: there are no pictures ({', '.join(SUFFIXES)}) called {pattern}")
    found = _matched(folder, candidates, pattern, states)
    names = sorted({series for series, _ in found}, key=_natural)
    if "state" in fields:
        _require_all(folder, found, names, states, pattern)
        opened = {place: open_pictures(file) for place, file in found.items()}
        places = tuple(tuple((opened[name, state], 0) for state in states) for name in names)
    else:
        opened = {place: open_pictures(file) for place, file in found.items()}
        places = tuple(tuple((opened[name, ""], i) for i in range(len(states))) for name in names)
    pictures = 1 if "state" in fields else len(states)
    _require_alike(list(opened.values()), pictures)
    return FileFrames(tuple(names), places)


def _pictures_in(folder: Path, glob: str) -> list[Path]:
    return sorted(
        f
        for f in folder.glob(glob)
        if f.suffix.lower() in SUFFIXES and f.is_file() and not f.name.startswith(".")
    )


def _usual_pattern(files: Sequence[Path], below: Sequence[Path], states: Sequence[str], mosaic: bool) -> str:
    if mosaic:
        return "{series}"
    if not files and below:
        return "{series}/{state}"
    stems = [f.stem for f in files]
    if stems and set(stems) <= set(states):
        return "{state}"
    if stems and not any(stem.endswith(f"_{state}") for stem in stems for state in states):
        # No file ends in the name of a state: each may be a stack of its own.
        first = open_pictures(files[0])
        if first.count == len(states) > 1:
            return "{series}"
    return "{series}_{state}"


def _matched(
    folder: Path, files: Iterable[Path], pattern: str, states: Sequence[str]
) -> dict[tuple[str, str], Path]:
    """The files by series and state; "" where the pattern has no state."""
    choices = states if "{state}" in pattern else [""]
    if Path(pattern).suffix.lower() not in SUFFIXES:
        pattern += ".*"
    expressions = {state: re.compile(_expression(pattern, state)) for state in choices}
    found: dict[tuple[str, str], Path] = {}
    strangers = []
    for file in files:
        name = file.relative_to(folder).as_posix()
        matches = [(state, match) for state, e in expressions.items() if (match := e.fullmatch(name))]
        if not matches:
            strangers.append(name)
            continue
        if len(matches) > 1:
            raise DataError(
                f"{folder}: {name!r} could be the state {matches[0][0]!r} or {matches[1][0]!r}: put a mark between "
                "{series} and {state} in the names, such as _"
            )
        state, match = matches[0]
        place = (match.groupdict().get("series", folder.resolve().name), state)
        if place in found:
            raise DataError(
                f"{folder}: {found[place].name!r} and {name!r} are the same picture of the same series"
            )
        found[place] = file
    if strangers:
        raise DataError(
            f"{folder}: {named(strangers)} {'does' if len(strangers) == 1 else 'do'} not fit the names "
            f"{pattern.removesuffix('.*')} with the states {named(states, 10)}: remove, or set pattern in [frames]"
        )
    return found


def _expression(pattern: str, state: str) -> str:
    parts = re.split(r"(\{series\}|\{state\}|\.\*$)", pattern)
    known = {"{series}": "(?P<series>[^/]+)", "{state}": re.escape(state), ".*": r"\.[^./]+"}
    return "".join(known.get(part, re.escape(part)) for part in parts)


def _require_all(
    folder: Path,
    found: dict[tuple[str, str], Path],
    names: Sequence[str],
    states: Sequence[str],
    pattern: str,
) -> None:
    missing = [(name, state) for name in names for state in states if (name, state) not in found]
    if missing:
        name, state = missing[0]
        example = pattern.replace("{series}", name).replace("{state}", state)
        more = f", and {len(missing) - 1} more" if len(missing) > 1 else ""
        raise DataError(
            f"{folder}: series {name!r} has no picture of the state {state!r} ({example}){more}; "
            f"the states are {named(states, 10)}"
        )


def _require_alike(files: Sequence[PictureFile], pictures: int) -> None:
    first = files[0]
    require_raw(first.dtype, str(first.path))
    for file in files:
        if file.count != pictures:
            raise DataError(f"{file.path}: it holds {file.count} pictures, not {pictures}")
        if file.shape[-2:] != first.shape[-2:]:
            raise DataError(
                f"{file.path}: {file.rows} × {file.columns} pixels (rows × columns), but {first.path.name} has "
                f"{first.rows} × {first.columns}"
            )
        if file.dtype.newbyteorder("=") != first.dtype.newbyteorder("="):
            raise DataError(
                f"{file.path}: {8 * file.dtype.itemsize} bits, but {first.path.name} has {8 * first.dtype.itemsize}"
            )


def _natural(name: str) -> list[tuple[int, str]]:
    """Order in which 2 stands before 10."""
    return [(int(part), "") if part.isdigit() else (0, part) for part in re.split(r"([0-9]+)", name)]
