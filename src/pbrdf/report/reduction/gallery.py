"""The pictures of a reduction, drawn one series after another while the frames are read."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from pbrdf.instruments.frames.frames import Frames
from pbrdf.instruments.reduction.regions import Region
from pbrdf.instruments.reduction.streaming import Block
from pbrdf.report.reduction.picture_sums import BlockSums, Picture, PictureSum, block_size, block_sums
from pbrdf.report.reduction.quicklook import overview_figure, quicklook_figure
from pbrdf.report.style import save_figure

__all__ = ["Gallery", "safe_name"]

#: Series with a quick look of their own, and series in the overview, at most; evenly spread where there are more.
_QUICKLOOKS, _THUMBNAILS = 12, 24
#: Blocks along the longer side of a picture of the overview.
_SMALL = 210


class Gallery:
    """Quick looks of some series, and an overview: a sink for :func:`pbrdf.instruments.reduction.reduce.reduce`.

    Parameters
    ----------
    frames
        What is reduced.
    folder
        Where the pictures go.
    name
        What to call the frames.
    regions
        To be outlined.
    """

    def __init__(self, frames: Frames, folder: Path, name: str, regions: Mapping[str, Region]) -> None:
        self._frames, self._folder, self._name, self._regions = frames, folder, name, regions
        self._size = block_size(frames.rows, frames.columns)
        count = len(frames.names)
        self._small = set(_spread(count, _THUMBNAILS))
        self._large = set(_spread(count, _QUICKLOOKS))
        self._current: tuple[int, PictureSum] | None = None
        self._thumbnails: dict[int, Picture] = {}
        self.rows = (0, frames.rows)
        #: Names of the files written so far.
        self.files: list[str] = []

    def __enter__(self) -> Gallery:
        return self

    def prepare(self, block: Block) -> BlockSums | None:
        """What is needed of some rows; None if the series is not drawn."""
        if block.series not in self._small | self._large:
            return None
        return block_sums(block.image, block.first_row, self._size)

    def add(self, block: Block, part: BlockSums | None) -> None:
        """Add what :meth:`prepare` made of a block, and draw the series before it if this is the first of another."""
        if self._current is not None and self._current[0] != block.series:
            self._finish()
        if part is None:
            return
        if self._current is None:
            self._current = (block.series, PictureSum(self._frames.rows, self._frames.columns))
        self._current[1].add(part)

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self._finish()
            self._draw_overview()
            return
        for file in self.files:
            (self._folder / file).unlink(missing_ok=True)

    def _draw_overview(self) -> None:
        if len(self._frames.names) < 2:
            return
        shown = sorted(self._thumbnails)
        count = len(self._frames.names)
        some = "" if len(shown) == count else f" ({len(shown)} of {count} series)"
        names = [self._frames.names[series] for series in shown]
        figure = overview_figure([self._thumbnails[s] for s in shown], names, f"{self._name}{some}")
        save_figure(figure, self._folder / "overview.png")
        self.files.insert(0, "overview.png")

    def _finish(self) -> None:
        if self._current is None:
            return
        series, total = self._current
        self._current = None
        if series in self._small:
            longer = max(self._frames.rows, self._frames.columns)
            self._thumbnails[series] = total.picture(-(-longer // (_SMALL * total.size)))
        if series not in self._large:
            return
        own = self._frames.names[series]
        title = self._name if own == Path(self._name).stem else f"{self._name}, series {own}"
        file = f"picture_{safe_name(own)}.png"
        if file in self.files:  # two names that differ in characters no file name should have
            file = f"picture_{safe_name(own)}_{series + 1}.png"
        save_figure(quicklook_figure(total.picture(), title, self._regions), self._folder / file)
        self.files.append(file)


def safe_name(name: str) -> str:
    """A name as files can have it everywhere: letters, digits and ``_ . + -``."""
    kept = "".join(c if c.isalnum() or c in "_.+-" else "_" for c in name)
    return kept.strip("._") or "unnamed"


def _spread(count: int, most: int) -> list[int]:
    """Numbers of all series, or of so many evenly spread ones."""
    found: list[int] = np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int)).tolist()
    return found
