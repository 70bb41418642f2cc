"""The pages of documentation as programs: their Python blocks, notebook cells and commands, in the order they stand in.

Blocks of ``python`` and cells of a page share one namespace and one folder, as a reader's session would; a command is
a line that begins with ``pbrdf`` in an indented or fenced block, or in a cell ``%%sh``; with ``|| true`` it is one that
is refused.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

DOCS = Path(__file__).parents[1] / "docs"
#: Every page with its name, the README included.
PAGES = {
    **{path.relative_to(DOCS).with_suffix("").as_posix(): path for path in sorted(DOCS.glob("*.md"))},
    **{
        path.relative_to(DOCS).with_suffix("").as_posix(): path
        for path in sorted(DOCS.glob("tutorials/*.md"))
    },
    "README": DOCS.parent / "README.md",
}


class Piece(NamedTuple):
    """What a page shows to be run: Python, a file, or a command with its exit code; and the line it stands in."""

    kind: str
    text: str
    line: int
    code: int = 0


def pieces(page: Path) -> Iterator[Piece]:
    """What `page` shows to be run, in order."""
    lines = page.read_text(encoding="utf-8").splitlines()
    i = 0
    while i < len(lines):
        fence = re.match(r"(```+)\s*(.*)", lines[i])
        if fence:
            start = i + 1
            end = next(j for j in range(start, len(lines)) if lines[j].startswith(fence[1]))
            yield from _block(fence[2], lines[start:end], start)
            i = end + 1
        elif lines[i].startswith("    ") and (
            i == 0 or not lines[i - 1].strip() or lines[i - 1].startswith("    ")
        ):
            end = i
            while end < len(lines) and (lines[end].startswith("    ") or not lines[end].strip()):
                end += 1
            yield from _commands([line[4:] for line in lines[i:end]], i)
            i = end
        else:
            i += 1


def _block(language: str, lines: list[str], start: int) -> Iterator[Piece]:
    if language == "python":
        yield Piece("python", "\n".join(lines), start + 1)
    elif language.startswith("{code-cell}"):
        yield from _cell(lines, start)
    elif language in ("", "sh", "text"):
        yield from _commands(lines, start)


def _cell(lines: list[str], start: int) -> Iterator[Piece]:
    while not lines[0] or lines[0].startswith(":"):  # how the cell is shown
        lines, start = lines[1:], start + 1
    if lines[0].startswith("%%writefile "):
        yield Piece("file", "\n".join([lines[0].split()[1], *lines[1:], ""]), start + 1)
    elif lines[0] == "%%sh":
        yield from _commands(lines[1:], start + 1)
    else:
        yield Piece("python", "\n".join(lines), start + 1)


def _commands(lines: list[str], start: int) -> Iterator[Piece]:
    i = 0
    while i < len(lines):
        line, first = lines[i].removeprefix("$ "), start + i + 1
        while line.endswith("\\") and i + 1 < len(lines):
            i += 1
            line = line[:-1] + lines[i].strip()
        i += 1
        if line.startswith("pbrdf "):
            command, _, refused = line.partition(" #")[0].strip().partition(" || ")
            for part in command.split(" && "):
                yield Piece("command", part, first, 2 if refused else 0)


def words(command: str) -> list[str]:
    """The arguments of a command as a shell splits them, without ``pbrdf``."""
    return shlex.split(command)[1:]
