"""The reduction: frames are read and reduced once, and every sink takes from it what it needs.

A sink makes a file of maps, averages of regions, goniometric data sets, pictures, or whatever is wanted of the Stokes
parameters. For something that is no sink there is :func:`pbrdf.instruments.reduction.streaming.reduced_blocks`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from types import TracebackType
from typing import Any, Protocol, TypeVar

from pbrdf.errors import DataError
from pbrdf.instruments.frames.frames import Frames
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.reduction.streaming import DEFAULT_MEMORY, Block, reduced_blocks

__all__ = ["Sink", "reduce"]

Part = TypeVar("Part")


class Sink(Protocol[Part]):
    """Where reduced blocks go.

    What was found is asked of the sink itself afterwards. A sink serves one reduction.

    Attributes
    ----------
    rows
        First and last row (not included) that it needs of the pictures; it may be given more.
    """

    @property
    def rows(self) -> tuple[int, int]: ...

    def __enter__(self) -> Any:
        """Get ready for the first block."""
        ...

    def prepare(self, block: Block) -> Part:
        """What the sink needs of a block, which should take no more memory than the block: a few wait to be added.

        Several threads call this at once, in any order.
        """
        ...

    def add(self, block: Block, part: Part) -> None:
        """Take in a block and what :meth:`prepare` made of it.

        The main thread calls this in the order of series and rows.
        """
        ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None, /
    ) -> bool | None:
        """Complete what the blocks have made; if an error has ended the reduction, leave no file behind."""
        ...


def reduce(
    frames: Frames,
    instrument: Instrument,
    sinks: Sequence[Sink[Any]],
    *,
    dark_level: float = 0.0,
    weighted: bool = True,
    max_memory: int = DEFAULT_MEMORY,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Reduce frames into sinks, reading them once.

    Parameters
    ----------
    frames, instrument
        What was measured, and with what.
    sinks
        One or more, which are left in the reverse order; rows that none of them needs are not read.
    dark_level, weighted, max_memory, progress
        See :func:`pbrdf.instruments.reduction.streaming.reduced_blocks`.

    Raises
    ------
    DataError
        If there is no sink, the frames do not fit the instrument, or it does not determine the intensity; names the
        series.
    """
    if not sinks:
        raise DataError(
            "reduce: nothing would be kept; give at least one sink, for example a RegionCollector"
        )

    def prepare(block: Block) -> tuple[Block, list[Any]]:
        return block, [sink.prepare(block) for sink in sinks]

    with ExitStack() as stack:
        for sink in sinks:
            stack.enter_context(sink)
        blocks = reduced_blocks(
            frames,
            instrument,
            prepare,
            rows=(min(sink.rows[0] for sink in sinks), max(sink.rows[1] for sink in sinks)),
            dark_level=dark_level,
            weighted=weighted,
            max_memory=max_memory,
            progress=progress,
        )
        # entered last: no thread is at work any more when the sinks are left
        for block, parts in stack.enter_context(closing(blocks)):
            for sink, part in zip(sinks, parts, strict=True):
                sink.add(block, part)
