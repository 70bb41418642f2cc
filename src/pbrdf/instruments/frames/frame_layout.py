"""The table ``[frames]`` of an instrument's file: how pictures are called, and which of them correct the frames."""

from __future__ import annotations

import difflib
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pbrdf.errors import DataError
from pbrdf.instruments.frames.raw_files import RawFormat

__all__ = ["FrameLayout"]


@dataclass(frozen=True)
class FrameLayout:
    """The table ``[frames]`` of an instrument's file.

    Attributes
    ----------
    pattern
        How the files of a folder are called, with ``{series}``, ``{state}`` and ``{repeat}`` for the names; with a
        slash for folders in the folder, ``{series}/{state}``; None: what
        :func:`pbrdf.instruments.frames.frame_files.open_frames` finds.
    exposures
        How many exposures each picture is the mean of; None where it is not stated: 1 for whole numbers.
    repeats
        How many pictures of each state were taken one after another and are in the same file; None: as many as there
        are.
    pages
        Which pictures of a file follow each other, the one that changes slowest first: some of series, state, repeat.
        None: series, state.
    raw
        Size and format of files that are nothing but pixels.
    dark_frame
        Picture taken with the light shut out, the same for all states.
    flat_field
        Picture of an even field of natural light.
    dead_pixels
        Picture that is not 0 where a pixel must not be used.
    dark_exposures, flat_exposures
        How many exposures the dark frame and the flat field are the mean of: their noise is that much less.
    flat_transmittance
        Of a mosaic's states for the light of the flat field, in any unit; None for what the polarimeter says of natural
        light. A calibration made with the flat field holds for that of the nominal polarimeter, and writes it here.
    """

    pattern: str | None = None
    exposures: int | None = None
    repeats: int | None = None
    pages: tuple[str, ...] | None = None
    raw: RawFormat | None = None
    dark_frame: Path | None = None
    flat_field: Path | None = None
    dead_pixels: Path | None = None
    dark_exposures: int = 1
    flat_exposures: int = 1
    flat_transmittance: tuple[float, ...] | None = None

    @classmethod
    def from_table(cls, table: dict[str, Any], folder: Path | None = None) -> FrameLayout:
        """Check the table; names of files are relative to `folder`.

        Raises
        ------
        DataError
            If a key is not known or a value is not what it should be.
        """
        known = tuple(cls.__dataclass_fields__)
        values: dict[str, Any] = {}
        for key, value in table.items():
            if key not in known:
                near = difflib.get_close_matches(key, known, n=1)
                raise DataError(
                    f"[frames] {key}: there is no such key{f' (perhaps {near[0]!r})' if near else ''}; use "
                    f"{', '.join(known)}"
                )
            if key.endswith("exposures") or key == "repeats":
                if not (isinstance(value, int) and not isinstance(value, bool) and value >= 1):
                    raise DataError(f"[frames] {key} is {value!r}: give a whole number from 1")
                values[key] = value
            elif key == "pages":
                values[key] = _order(value)
            elif key == "raw":
                values[key] = RawFormat.from_table(value)
            elif key == "flat_transmittance":
                numbers = isinstance(value, list) and all(type(v) in (int, float) and v > 0.0 for v in value)
                if not numbers:
                    raise DataError(f"[frames] {key} is {value!r}: give a list of numbers more than 0")
                values[key] = tuple(map(float, value))
            elif not isinstance(value, str) or not value:
                raise DataError(f"[frames] {key} is {value!r}: give a text in quotes")
            else:
                values[key] = value if key == "pattern" else (folder or Path()) / value
        return cls(**values)

    @property
    def files(self) -> tuple[Path, ...]:
        """Files that are not frames themselves."""
        return tuple(f for f in (self.dark_frame, self.flat_field, self.dead_pixels) if f is not None)


def _order(value: Any) -> tuple[str, ...]:
    """The words of ``pages``, such as "series, repeat, state"."""
    words = tuple(re.findall(r"[a-z]+", value.lower())) if isinstance(value, str) else ()
    words = tuple("series" if word.startswith("serie") else word.removesuffix("s") for word in words)
    if not words or set(words) - {"series", "state", "repeat"} or len(set(words)) < len(words):
        raise DataError(
            f"[frames] pages is {value!r}: name what follows each other in a file, the slowest first, each once: "
            '"series, state", "state, series", "series, repeat, state" …'
        )
    return words
