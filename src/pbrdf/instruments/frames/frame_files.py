"""Frames from files: folders of pictures, stacks, netCDF files and Zarr folders.

A folder holds one picture a state, called as the pattern of the instrument's table ``[frames]`` says; without one
``{series}_{state}``, ``{state}`` alone where there is one series, or ``{series}/{state}`` where each series has a
folder. For a division of focal plane every picture is a series, and where a pattern has no ``{state}``, every file is
the stack of a series. In a single file the states follow each other, then the series: state 1, 2, …, N of the first
series, then of the next.

Exposures of a state that were repeated are files whose names have a ``{repeat}`` in the pattern, or pictures of one
file. What follows what in a file is said by ``pages``, such as "series, repeat, state", the one that changes slowest
first; ``repeats`` says how many there are where that cannot be counted.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pbrdf.errors import DataError
from pbrdf.instruments.frames.color_frames import ColorFrames, bayer_note
from pbrdf.instruments.frames.digital_numbers import ConvertedFrames
from pbrdf.instruments.frames.frame_grids import GRID_SUFFIXES, open_grid
from pbrdf.instruments.frames.frame_layout import FrameLayout
from pbrdf.instruments.frames.frames import Frames, named, require_raw
from pbrdf.instruments.frames.mosaic import MosaicFrames
from pbrdf.instruments.frames.pictures import SUFFIXES, PictureFile, open_pictures
from pbrdf.instruments.frames.raw_files import RAW_SUFFIXES, RawFile, RawFormat, open_raw
from pbrdf.instruments.polarimeter.instrument import Instrument

__all__ = ["FileFrames", "open_frames", "open_picture"]

#: A picture: its file, and its number in it.
Place = tuple[PictureFile | RawFile, int]


@dataclass(frozen=True, eq=False)
class FileFrames:
    """Frames in picture files.

    Attributes
    ----------
    names
        Of the series.
    places
        For each series, repeat and state the file and the number of the picture in it.
    """

    names: tuple[str, ...]
    places: tuple[tuple[tuple[Place, ...], ...], ...]

    @property
    def states(self) -> int:
        return len(self.places[0][0])

    @property
    def rows(self) -> int:
        return self._first.rows

    @property
    def columns(self) -> int:
        return self._first.columns

    @property
    def layers(self) -> int:
        """Repeats of each state, at most."""
        return max(map(len, self.places))

    @property
    def _first(self) -> PictureFile | RawFile:
        return self.places[0][0][0][0]

    def read(self, series: int, first_row: int, last_row: int) -> np.ndarray:
        repeats = [
            np.stack([_native(file.read(picture, first_row, last_row)) for file, picture in states])
            for states in self.places[series]
        ]
        return np.stack(repeats) if len(repeats) > 1 else repeats[0]


def _native(array: np.ndarray) -> np.ndarray:
    return array.astype(array.dtype.newbyteorder("="), copy=False)


def open_frames(path: str | Path, instrument: Instrument) -> Frames:
    """Find the frames of a measurement; of a few series some rows are read to see what the numbers are.

    Parameters
    ----------
    path
        A folder of PNG, TIFF, NPY or raw camera files or of such folders, one of them with all pictures, one mosaic
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
        frames = _open_file(path, layout, states)
    detector, polarimeter = instrument.detector, instrument.polarimeter
    try:
        converted = ConvertedFrames(frames, detector, layout.exposures, instrument.stability)
    except DataError as error:
        raise DataError(str(error) if str(error).startswith(str(path)) else f"{path}: {error}") from None
    if not mosaic:
        return converted
    if polarimeter.filters is not None:
        return ColorFrames(converted, polarimeter)
    grey = MosaicFrames(converted, polarimeter)
    converted.say(bayer_note(frames, polarimeter, detector.black * 2.0**converted.shift))
    return grey


def open_picture(path: Path, raw: RawFormat | None = None) -> FileFrames:
    """One picture as frames with one series and one state; raises DataError if there are more in the file."""
    file = _opened(path, raw)
    if file.count != 1:
        raise DataError(f"{path}: it holds {file.count} pictures, and one is wanted")
    return FileFrames((path.stem,), ((((file, 0),),),))


def _opened(path: Path, raw: RawFormat | None) -> PictureFile | RawFile:
    """What a file holds, by its extension; with a format any but those of pictures is nothing but pixels."""
    kind = path.suffix.lower()
    if kind in RAW_SUFFIXES or (raw is not None and kind not in SUFFIXES):
        return open_raw(path, raw)
    return open_pictures(path)


def _open_file(path: Path, layout: FrameLayout, states: Sequence[str]) -> FileFrames:
    file = _opened(path, layout.raw)
    require_raw(file.dtype, str(path), means=True)
    usual = ("series", "state") if layout.repeats is None else ("series", "repeat", "state")
    sizes, numbers = _in_file(file, layout, usual, states)
    places = tuple(
        tuple(
            tuple((file, int(numbers[s, k, n])) for n in range(len(states))) for k in range(sizes["repeat"])
        )
        for s in range(sizes["series"])
    )
    count = sizes["series"]
    return FileFrames((path.stem,) if count == 1 else tuple(str(i + 1) for i in range(count)), places)


def _in_file(
    file: PictureFile | RawFile, layout: FrameLayout, usual: tuple[str, ...], states: Sequence[str]
) -> tuple[dict[str, int], np.ndarray]:
    """How many series, repeats and states a file holds, and the number of the picture of each."""
    order = usual if layout.pages is None else layout.pages
    if len(states) > 1 and "state" not in order:
        raise DataError(
            f"{file.path}: [frames] pages leaves out the states, of which there are {len(states)}"
        )
    order = tuple(word for word in order if word != "state" or len(states) > 1)
    sizes = {"series": 1, "repeat": 1, "state": len(states)}
    fixed = len(states)
    if layout.repeats is not None:
        if "repeat" not in order:
            raise DataError(
                f"{file.path}: [frames] repeats is stated, but pages does not say where: add repeat"
            )
        sizes["repeat"] = layout.repeats
        fixed *= layout.repeats
    free = [word for word in order if word == "series" or (word == "repeat" and layout.repeats is None)]
    if len(free) > 1:
        raise DataError(
            f"{file.path}: pages = {', '.join(order)!r} in [frames] does not say how many repeats there are: "
            "set repeats"
        )
    held = "one picture" if file.count == 1 else f"{file.count} pictures"
    if file.count % fixed or (not free and file.count != fixed):
        each = f"{len(states)} states {named(states)}" if len(states) > 1 else "series"
        more = f", {layout.repeats} times" if layout.repeats is not None else ""
        raise DataError(
            f"{file.path}: it holds {held}, and a series needs one for each of the {each}{more}: name the folder with "
            "all of them, or a stack; pages and repeats in [frames] say what follows what"
        )
    if free:
        sizes[free[0]] = file.count // fixed
    inside = tuple(sizes[word] for word in order)
    if len(file.shape) > 3 and len(file.shape) == len(order) + 2 and file.shape[:-2] != inside:
        if order == ("series", "state"):
            raise DataError(
                f"{file.path}: an array of the shape {file.shape} has not {len(states)} states in its second place"
            )
        raise DataError(
            f"{file.path}: an array of the shape {file.shape} is not {' × '.join(map(str, inside))} "
            f"({', '.join(order)}) pictures"
        )
    numbers = np.arange(file.count).reshape(inside)
    wanted = ("series", "repeat", "state")
    for word in wanted:
        if word not in order:
            numbers, order = numbers[..., np.newaxis], (*order, word)
    return sizes, numbers.transpose([order.index(word) for word in wanted])


# Folders


def _open_folder(folder: Path, layout: FrameLayout, states: Sequence[str], mosaic: bool) -> FileFrames:
    apart = {file.resolve() for file in layout.files}
    suffixes = [*SUFFIXES, *RAW_SUFFIXES]
    if layout.pattern is not None and layout.raw is not None:
        suffixes.append(Path(layout.pattern).suffix.lower())
    files = [f for f in _pictures_in(folder, "*", suffixes) if f.resolve() not in apart]
    below = [f for f in _pictures_in(folder, "*/*", suffixes) if f.resolve() not in apart]
    pattern = layout.pattern or _usual_pattern(files, below, states, mosaic, layout)
    fields = re.findall(r"\{(.*?)\}", pattern)
    if (
        set(fields) - {"series", "state", "repeat"}
        or len(fields) != len(set(fields))
        or (mosaic and "state" in fields)
    ):
        usable = "{series} and {repeat} once each" if mosaic else "{series}, {state} and {repeat} once each"
        raise DataError(
            f"[frames] pattern {pattern!r}: the pattern may hold {usable}, and nothing else in braces"
        )
    candidates = below if "/" in pattern else files
    if not candidates:
        raise DataError(f"{folder}: there are no pictures ({', '.join(SUFFIXES)}) called {pattern}")
    found = _matched(folder, candidates, pattern, states)
    names = sorted({series for series, _, _ in found}, key=_natural)
    opened = {place: _opened(file, layout.raw) for place, file in found.items()}
    repeats = {
        name: sorted({repeat for series, _, repeat in found if series == name}, key=_natural)
        for name in names
    }
    own = states if "state" in fields else ("",)
    _require_all(folder, found, repeats, own, pattern)
    inside = states if "state" not in fields else ("",)
    numbers = _in_each(list(opened.values()), layout, inside, "repeat" in fields)
    # files of repeats first, then those in each file
    places = tuple(
        tuple(
            tuple((opened[name, state, repeat], int(number)) for state in own for number in numbers[k])
            for repeat in repeats[name]
            for k in range(len(numbers))
        )
        for name in names
    )
    return FileFrames(tuple(names), places)


def _in_each(
    files: Sequence[PictureFile | RawFile], layout: FrameLayout, states: Sequence[str], repeated: bool
) -> np.ndarray:
    """Numbers of the pictures in each of the files of a folder, shape (repeats, states)."""
    _require_alike(files)
    usual = ("state",) if layout.repeats is None else ("repeat", "state")
    order = usual if layout.pages is None else tuple(word for word in layout.pages if word != "series")
    inside = replace(layout, pages=order or ("repeat",))
    if repeated and ("repeat" in order or layout.repeats is not None):
        raise DataError(
            "[frames] the pattern has {repeat}: leave it out of pages, and leave repeats out, as names are counted"
        )
    first = files[0]
    if order in ((), ("state",)) and first.count != len(states):
        known = f"{len(states)}" if len(states) > 1 else "1"
        raise DataError(
            f"{first.path}: it holds {first.count} pictures, not {known}; if they are repeated exposures, set "
            'pages = "repeat" (with the states in the file "repeat, state" or "state, repeat") in [frames]'
        )
    values: np.ndarray = _in_file(first, inside, usual, states)[1][0]
    return values


def _pictures_in(folder: Path, glob: str, suffixes: Sequence[str]) -> list[Path]:
    return sorted(
        f
        for f in folder.glob(glob)
        if f.suffix.lower() in suffixes and f.is_file() and not f.name.startswith(".")
    )


def _usual_pattern(
    files: Sequence[Path], below: Sequence[Path], states: Sequence[str], mosaic: bool, layout: FrameLayout
) -> str:
    if mosaic:
        return "{series}"
    if not files and below:
        return "{series}/{state}"
    stems = [f.stem for f in files]
    if stems and set(stems) <= set(states):
        return "{state}"
    if stems and not any(stem.endswith(f"_{state}") for stem in stems for state in states):
        # No file ends in the name of a state: each may be a stack of its own.
        first = _opened(files[0], layout.raw)
        several = layout.repeats is not None or (layout.pages is not None and "state" in layout.pages)
        if len(states) > 1 and (first.count == len(states) or (several and first.count % len(states) == 0)):
            return "{series}"
    return "{series}_{state}"


def _matched(
    folder: Path, files: Iterable[Path], pattern: str, states: Sequence[str]
) -> dict[tuple[str, str, str], Path]:
    """The files by series, state and repeat; "" where the pattern has no such field."""
    choices = states if "{state}" in pattern else [""]
    if not Path(pattern).suffix or "{" in Path(pattern).suffix:
        pattern += ".*"
    expressions = {state: re.compile(_expression(pattern, state)) for state in choices}
    found: dict[tuple[str, str, str], Path] = {}
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
        named_parts = match.groupdict()
        place = (named_parts.get("series", folder.resolve().name), state, named_parts.get("repeat", ""))
        if place in found:
            raise DataError(
                f"{folder}: {found[place].name!r} and {name!r} are the same picture of the same series"
            )
        found[place] = file
    if strangers:
        raise DataError(
            f"{folder}: {named(strangers)} {'does' if len(strangers) == 1 else 'do'} not fit the names "
            f"{pattern.removesuffix('.*')} with the states {named(states, 10)}: remove, or set pattern in [frames], "
            "with {repeat} for exposures that were repeated"
        )
    return found


def _expression(pattern: str, state: str) -> str:
    parts = re.split(r"(\{series\}|\{state\}|\{repeat\}|\.\*$)", pattern)
    known = {
        "{series}": "(?P<series>[^/]+)",
        "{state}": re.escape(state),
        "{repeat}": "(?P<repeat>[^/_]+)",
        ".*": r"\.[^./]+",
    }
    return "".join(known.get(part, re.escape(part)) for part in parts)


def _require_all(
    folder: Path,
    found: dict[tuple[str, str, str], Path],
    repeats: dict[str, list[str]],
    states: Sequence[str],
    pattern: str,
) -> None:
    missing = [
        (name, state, repeat)
        for name, own in repeats.items()
        for repeat in own
        for state in states
        if (name, state, repeat) not in found
    ]
    if missing:
        name, state, repeat = missing[0]
        example = pattern.replace("{series}", name).replace("{state}", state).replace("{repeat}", repeat)
        more = f", and {len(missing) - 1} more" if len(missing) > 1 else ""
        raise DataError(
            f"{folder}: series {name!r} has no picture of the state {state!r} ({example}){more}; "
            f"the states are {named(states, 10)}"
        )


def _require_alike(files: Sequence[PictureFile | RawFile]) -> None:
    first = files[0]
    require_raw(first.dtype, str(first.path), means=True)
    for file in files:
        if file.count != first.count:
            raise DataError(f"{file.path}: it holds {file.count} pictures, not {first.count}")
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
