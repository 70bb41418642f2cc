"""What a file format says of itself, so that files of it are found, read and written."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pbrdf.errors import DataError

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Reader"]


@dataclass(frozen=True)
class Reader:
    """A format of measured data.

    Parameters
    ----------
    name
        By which it is asked for: letters, digits, ``_`` and ``-``.
    read
        Called with the path and the options; returns a data set as :mod:`pbrdf.data.schema` says. Raises DataError,
        which names the file and the line, for what it does not understand. Its keyword-only parameters are the options
        of the format; those that have the name of an option of the command line can be given there, too.
    extensions
        Of its files, each with its point. Upper case does not matter.
    sniff
        Whether the content of a path is of this format; must be quick, and must not fail on others.
    write
        Called with a valid data set and a path; must write a file that `read` turns back into the same.
    written
        Extensions of the files that `write` writes; all of `extensions` if there are none.
    folder
        Whether data of this format are a folder.

    Raises
    ------
    DataError
        If the name or an extension has another form, there is neither an extension nor a `sniff`, or `written` is
        given without `write`.
    """

    name: str
    read: Callable[..., xr.Dataset]
    extensions: tuple[str, ...] = ()
    sniff: Callable[[Path], bool] | None = None
    write: Callable[[xr.Dataset, Path], None] | None = None
    written: tuple[str, ...] = ()
    folder: bool = False

    def __post_init__(self) -> None:
        if not re.fullmatch(r"[\w-]+", self.name):
            raise DataError(f"reader {self.name!r}: a name has only letters, digits, _ and -")
        for field in ("extensions", "written"):
            values = getattr(self, field)
            if isinstance(values, str) or not all(re.fullmatch(r"\.\S+", value) for value in values):
                raise DataError(f"reader {self.name!r}: {field} is {values!r}; give a tuple like ('.xyz',)")
            object.__setattr__(self, field, tuple(value.lower() for value in values))
        if not self.extensions and self.sniff is None:
            raise DataError(
                f"reader {self.name!r}: give extensions, or a function sniff that knows its files"
            )
        if self.written and self.write is None:
            raise DataError(f"reader {self.name!r}: written is given, but no function write")
        if self.write is not None and not self.written:
            object.__setattr__(self, "written", self.extensions)

    @property
    def options(self) -> tuple[str, ...]:
        """Names of the options of `read`."""
        parameters = inspect.signature(self.read).parameters.values()
        return tuple(p.name for p in parameters if p.kind is p.KEYWORD_ONLY)
