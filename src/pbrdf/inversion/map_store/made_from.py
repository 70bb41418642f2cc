"""What a map was made from, as an attribute of it: how the data of its pixels are opened again.

Names of files are relative to the folder that the map lies in, so that map and data can be moved together. What decides
the numbers is told by the settings of a store; this tells where they were.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pbrdf.errors import DataError
from pbrdf.files.plain_numbers import json_from_text
from pbrdf.instruments.pixel_geometry.text_form import parse_pixel_geometry
from pbrdf.inversion.map_store.picture_source import PictureSource

__all__ = ["ATTRIBUTE", "MadeFrom"]

#: Name of the attribute.
ATTRIBUTE = "made_from"


@dataclass(frozen=True)
class MadeFrom:
    """Arguments of :meth:`~pbrdf.inversion.map_store.picture_source.PictureSource.open`, as text.

    Attributes
    ----------
    files
        Stokes pictures or data, relative to the map's folder.
    geometry
        Of the pixels, as ``pbrdf map --geometry`` takes it; files that it names are relative to where that was called.
    scale
        Digital numbers for a BRDF times cosθ_i of 1/sr; None if it is not known.
    labels
        The file of the parts of the sample, relative to the map's folder, or None.
    """

    files: tuple[str, ...]
    geometry: tuple[str, ...] = ()
    scale: float | None = None
    labels: str | None = None

    @classmethod
    def relative_to(
        cls,
        folder: Path,
        files: Sequence[Path],
        geometry: Sequence[str] = (),
        scale: float | None = None,
        labels: Path | None = None,
    ) -> MadeFrom:
        """With names relative to the folder of the map."""
        named = tuple(_relative(path, folder) for path in files)
        return cls(named, tuple(geometry), scale, None if labels is None else _relative(labels, folder))

    @classmethod
    def of(cls, attrs: Mapping[Any, Any]) -> MadeFrom | None:
        """What the attributes of a map say; None where they do not."""
        try:
            told = json_from_text(str(attrs[ATTRIBUTE]))
            files, geometry = ([str(text) for text in told[key]] for key in ("files", "geometry"))
            scale, labels = told["scale"], told["labels"]
        except (KeyError, TypeError, ValueError):
            return None
        return cls(
            tuple(files),
            tuple(geometry),
            None if scale is None else float(scale),
            None if labels is None else str(labels),
        )

    @property
    def attribute(self) -> dict[str, str]:
        """The attribute."""
        return {ATTRIBUTE: json.dumps(asdict(self), ensure_ascii=False)}

    def open(self, folder: Path) -> PictureSource:
        """The data of the pixels.

        Parameters
        ----------
        folder
            That the map lies in.

        Raises
        ------
        DataError
            If a file is not there any more, or cannot be read.
        """
        if not self.files:
            raise DataError("the map names no file that it was made from")
        return PictureSource.open(
            [folder / name for name in self.files],
            [parse_pixel_geometry(text) for text in self.geometry],
            scale=self.scale,
            labels=None if self.labels is None else folder / self.labels,
        )


def _relative(path: Path, folder: Path) -> str:
    try:
        return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()
    except ValueError:  # another drive
        return path.resolve().as_posix()
