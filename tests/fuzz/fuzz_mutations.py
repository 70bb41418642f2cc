"""Damage to files: what disks, transfers, editors and programs do to them, by chance but the same every time."""

from __future__ import annotations

import random
import re
import shutil
import struct
from collections.abc import Callable
from pathlib import Path

__all__ = ["damage", "damaged_copy"]

_INTEGERS = (0, 1, 2, 255, 2**15, 2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**63 - 1, 2**64 - 1)
_WORDS = (
    "nan", "inf", "-inf", "1e999", "-1", "1e308", "0", "", "true", "null", "[]", "{}", '"', "'", "text", "1_0", "٣",
    "-0.0", "1e-320", "0x10", "1,5", "\x00", "\x1b[31m", "9" * 5000, "9" * 400,
    "2020-01-01", '{"a": 1}', "[1, [2]]", "#",
)  # fmt: skip
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")
_QUOTED = re.compile(r'"[^"\n]*"')


def damaged_copy(seed: Path, folder: Path, random_: random.Random) -> Path:
    """Copy a file, or a folder of files, into an empty folder and damage it; returns the copy."""
    copy = folder / seed.name
    if seed.is_file():
        copy.write_bytes(damage(seed.read_bytes(), random_))
        return copy
    shutil.copytree(seed, copy)
    files = sorted(path for path in copy.rglob("*") if path.is_file())
    for _ in range(random_.choice((1, 1, 1, 2))):
        file = random_.choice(files)
        if random_.random() < 0.15:
            file.unlink(missing_ok=True)
        elif file.exists():
            file.write_bytes(damage(file.read_bytes(), random_))
    return copy


def damage(content: bytes, random_: random.Random) -> bytes:
    """Damage a file's content in one to three places."""
    text = b"\0" not in content[:4096] and len(content) < 10**6
    for _ in range(random_.choice((1, 1, 1, 2, 3))):
        changes = _TEXT if text and random_.random() < 0.7 else _BINARY
        content = random_.choice(changes)(content, random_)
    return content


def _place(content: bytes, random_: random.Random) -> int:
    """Somewhere, the beginning being as likely as all the rest of a long file."""
    length = max(len(content), 1)
    return random_.randrange(min(length, 4096)) if random_.random() < 0.5 else random_.randrange(length)


def _bit(content: bytes, random_: random.Random) -> bytes:
    changed = bytearray(content or b"\0")
    changed[_place(changed, random_)] ^= 1 << random_.randrange(8)
    return bytes(changed)


def _byte(content: bytes, random_: random.Random) -> bytes:
    changed = bytearray(content or b"\0")
    changed[_place(changed, random_)] = random_.choice((0, 255, random_.randrange(256)))
    return bytes(changed)


def _cut(content: bytes, random_: random.Random) -> bytes:
    return content[: random_.randrange(len(content) + 1)]


def _cut_out(content: bytes, random_: random.Random) -> bytes:
    at = _place(content, random_)
    return content[:at] + content[at + random_.choice((1, 2, 8, 100, 512)) :]


def _insert(content: bytes, random_: random.Random) -> bytes:
    at = _place(content, random_)
    return content[:at] + random_.randbytes(random_.choice((1, 4, 64))) + content[at:]


def _blank(content: bytes, random_: random.Random) -> bytes:
    at, length = _place(content, random_), random_.choice((4, 8, 64, 512))
    return (
        content[:at]
        + bytes([random_.choice((0, 255))]) * len(content[at : at + length])
        + content[at + length :]
    )


def _move(content: bytes, random_: random.Random) -> bytes:
    a, b = _place(content, random_), _place(content, random_)
    length = random_.choice((8, 64, 512))
    part = content[a : a + length]
    return content[:b] + part + content[b + len(part) :]


def _integer(content: bytes, random_: random.Random) -> bytes:
    at, kind = _place(content, random_) // 4 * 4, random_.choice("BHIQ")
    size = struct.calcsize(kind)
    packed = struct.pack("<" + kind, random_.choice(_INTEGERS) % 2 ** (8 * size))
    return content[:at] + packed + content[at + size :]


def _words(pattern: re.Pattern[str]) -> Callable[[bytes, random.Random], bytes]:
    def change(content: bytes, random_: random.Random) -> bytes:
        text = content.decode("utf-8", errors="surrogateescape")
        found = list(pattern.finditer(text))
        if not found:
            return _insert(content, random_)
        match = random_.choice(found)
        text = text[: match.start()] + random_.choice(_WORDS) + text[match.end() :]
        return text.encode("utf-8", errors="surrogateescape")

    return change


def _lines(content: bytes, random_: random.Random) -> bytes:
    lines = content.split(b"\n")
    at, other = random_.randrange(len(lines)), random_.randrange(len(lines))
    kind = random_.randrange(5)
    if kind == 0:
        del lines[at]
    elif kind == 1:
        lines.insert(other, lines[at])
    elif kind == 2:
        lines[at], lines[other] = lines[other], lines[at]
    elif kind == 3:
        lines[at] = lines[at][: random_.randrange(len(lines[at]) + 1)]
    else:
        lines[at] = lines[at] + b"," + lines[other]
    return b"\n".join(lines)


def _deep(content: bytes, random_: random.Random) -> bytes:
    """Very deep, or one very long thing."""
    at = _place(content, random_)
    kind = random_.randrange(3)
    what = (b"[" * 100_000, b'"' + b"x" * 200_000, b'{"a":' * 50_000)[kind]
    return content[:at] + what + content[at:]


def _encoding(content: bytes, random_: random.Random) -> bytes:
    text = content.decode("utf-8", errors="replace")
    return text.encode(random_.choice(("utf-16", "utf-16-le", "utf-8-sig")))


_BINARY = (_bit, _bit, _byte, _byte, _cut, _cut_out, _insert, _blank, _move, _integer, _integer, _integer)
_TEXT = (
    _words(_NUMBER), _words(_NUMBER), _words(_NUMBER), _words(_QUOTED), _lines, _lines, _lines, _deep, _encoding, _cut,
)  # fmt: skip
