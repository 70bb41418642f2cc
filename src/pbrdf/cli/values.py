"""What stands after an option: NAME=VALUE, bounds, lists and ranges of angles."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pbrdf.errors import PbrdfError
from pbrdf.files.plain_numbers import number_from_text

__all__ = [
    "angles",
    "bounds",
    "memory_size",
    "number",
    "numbers",
    "pairs",
    "refuse_odd_numbers",
    "require_folder_of",
    "share",
    "stokes_vector",
]

#: More values than this in one list are a slip of the pen.
_MOST_VALUES = 100_000
_UNITS = {"": 1, "K": 10**3, "M": 10**6, "G": 10**9, "T": 10**12}
#: Less memory than this holds no block of a large picture.
_LEAST_MEMORY = 1_000_000


def number(text: str, option: str) -> float:
    """A finite number.

    Raises
    ------
    PbrdfError
        If it is none; names the option.
    """
    try:
        value = number_from_text(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise PbrdfError(f"{option}: {text!r} is not a number")
    return value


def refuse_odd_numbers(commands: Mapping[str, Any], arguments: Sequence[str]) -> None:
    """Refuse what Python takes for a number but nobody else, as the value of an option that is one.

    Parameters
    ----------
    commands
        Commands by name, or groups of them; their options say by their annotation, or by the name of their type, that
        they are numbers.
    arguments
        Of the whole program.

    Raises
    ------
    PbrdfError
        Names the option.
    """
    name = next((argument for argument in arguments if argument in commands), None)
    if name is not None and (within := getattr(commands[name], "commands", None)):
        refuse_odd_numbers(within, arguments[arguments.index(name) + 1 :])
        return
    numeric = {
        option
        for parameter in (commands[name].params if name is not None else ())
        if _is_number(parameter)
        for option in parameter.opts
    }
    for option, following in zip(arguments, [*arguments[1:], ""], strict=True):
        option, sign, value = option.partition("=")
        if option in numeric:
            value = value if sign else following
            if _is_odd(value):
                raise PbrdfError(f"{option}: {value!r} is not a number")


def _is_odd(text: str) -> bool:
    """Whether Python alone takes a text for a number; what is none at all is told where it is taken."""
    try:
        float(text)
    except ValueError:
        return False
    try:
        number_from_text(text)
    except ValueError:
        return True
    return False


def _is_number(parameter: Any) -> bool:
    annotation = getattr(getattr(parameter, "type_descriptor", None), "annotation", None)
    kind = str(getattr(getattr(parameter, "type", None), "name", ""))
    return annotation in (int, float, list[int], list[float]) or kind.startswith(("integer", "float"))


def share(text: str, option: str) -> float:
    """A part such as 0.1 or 10%; raises PbrdfError as :func:`number` does."""
    plain = text.strip()
    return number(plain[:-1], option) / 100.0 if plain.endswith("%") else number(plain, option)


def pairs(given: Sequence[str], option: str, example: str) -> dict[str, str]:
    """Read ``NAME=VALUE`` texts into a table.

    Raises
    ------
    PbrdfError
        If one has another form or a name comes twice; shows an example.
    """
    table: dict[str, str] = {}
    for text in given:
        name, sign, value = (part.strip() for part in text.partition("="))
        if not (name and sign and value):
            raise PbrdfError(f"{option} {text!r}: give NAME=VALUE, for example {option} {example}")
        if name in table:
            raise PbrdfError(f"{option}: {name} is given twice")
        table[name] = value
    return table


def numbers(given: Sequence[str], option: str, example: str) -> dict[str, float]:
    """Read ``NAME=NUMBER`` texts; raises PbrdfError as :func:`pairs` and :func:`number` do."""
    return {name: number(value, f"{option} {name}") for name, value in pairs(given, option, example).items()}


def bounds(given: Sequence[str], option: str, example: str) -> dict[str, tuple[float, float]]:
    """Read ``NAME=LOWER:UPPER`` texts; raises PbrdfError if one has another form."""
    table = {}
    for name, text in pairs(given, option, example).items():
        parts = text.split(":")
        if len(parts) != 2:
            raise PbrdfError(f"{option} {name}={text}: give LOWER:UPPER, for example {option} {example}")
        table[name] = (number(parts[0], f"{option} {name}"), number(parts[1], f"{option} {name}"))
    return table


def angles(text: str, option: str) -> list[float]:
    """Read numbers like ``10,20,30``, ranges like ``0:85:5`` (both ends taken), or a mixture.

    Raises
    ------
    PbrdfError
        If the text has another form or gives too many values.
    """
    values: list[float] = []
    for part in text.split(","):
        ends = [number(piece.strip(), option) for piece in part.split(":")]
        if len(ends) == 1:
            values += ends
            continue
        if len(ends) != 3 or ends[2] == 0.0 or (ends[1] - ends[0]) * ends[2] < 0.0:
            raise PbrdfError(f"{option} {part.strip()!r}: give START:STOP:STEP, for example 0:85:5")
        start, stop, step = ends
        # Rounding must not lose the last value: 0:1:0.1 ends at 1.
        count = math.floor((stop - start) / step + 1e-9) + 1
        if count > _MOST_VALUES:
            raise PbrdfError(
                f"{option} {part.strip()!r}: {count} values are more than the {_MOST_VALUES} allowed"
            )
        # Twelve digits hide the rounding of the steps: 0.3, not 0.30000000000000004.
        values += [round(start + i * step, 12) for i in range(count)]
    return values


def memory_size(text: str, option: str) -> int:
    """Bytes from a text such as 200MB; raises PbrdfError if it is none or too little."""
    match = re.fullmatch(r"([\d.]+)\s*([KMGT]?)B?", text.strip().upper())
    if match is None:
        raise PbrdfError(f"{option} {text!r}: give a size such as 200MB or 2GB")
    size = int(number(match[1], option) * _UNITS[match[2]])
    if size < _LEAST_MEMORY:
        raise PbrdfError(f"{option} {text!r}: at least 1MB is needed")
    return size


def stokes_vector(text: str, option: str) -> tuple[float, float, float, float]:
    """Read four numbers ``I,Q,U,V``, or ``natural``; raises PbrdfError if the text is neither."""
    if text.strip() == "natural":
        return (1.0, 0.0, 0.0, 0.0)
    parts = text.split(",")
    if len(parts) != 4:
        raise PbrdfError(f"{option} {text!r}: give natural or four numbers I,Q,U,V, for example 1,0.5,0,0")
    i, q, u, v = (number(part, option) for part in parts)
    return (i, q, u, v)


def require_folder_of(file: Path) -> None:
    """Check, before any work, that a file can be put there: not without its folder, nor in place of one.

    Raises
    ------
    PbrdfError
        If it cannot. A folder ``.zarr`` may be in the place of a new one.
    """
    if not file.parent.is_dir():
        raise PbrdfError(f"{file}: there is no folder {file.parent}")
    if file.is_dir() and file.suffix.lower() != ".zarr":
        raise PbrdfError(f"{file}: this is a folder; choose another name")
