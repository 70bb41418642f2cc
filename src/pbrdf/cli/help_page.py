"""The help of a command, in lines of at most 80 columns: what it does, examples to copy, options by subject.

Options that most users need come first; those that read a file, which many commands share, are spelled out in the help
of ``pbrdf check`` and named elsewhere.
"""

from __future__ import annotations

import inspect
import re
import shutil
import textwrap
from collections.abc import Iterator
from typing import Any

import typer

__all__ = ["GROUPS", "READING_PANEL", "arrange", "command_page", "group_page"]

#: Longer lines are hard to read, and not every terminal has more.
_WIDTH = 80
#: Where the texts of options begin.
_COLUMN = 26
#: Commands with fewer options of their own than this show them in one list.
_MANY = 10

#: Stands for a space where a line must not end; nothing that textwrap takes for one.
_NO_BREAK = "\x00"

READING_PANEL = "Reading the file"
#: The command that spells them out.
_READS = "check"

_SEARCH = "How the fit searches"
_WORTH = "What else is asked of the fit"
_WRITTEN = "What is written and shown"
_ERRORS = "Errors of the measurement"
_PLACES = "Where it may measure"
_LIGHT = "Sun, lamp and sky"
_TRACING = "Tracing of the rays"
_RUN = "How it runs"

#: The commands of the program by what they are for, in the order of its help.
GROUPS: dict[str, tuple[str, ...]] = {
    "To begin with": ("demo", "example", "doctor", "paints", "models"),
    "From data to models": (
        "check",
        "fit",
        "compare",
        "plot",
        "explore",
        "simulate",
        "map",
        "convert",
        "compare-with",
    ),
    "Which material it is": ("identify", "library"),
    "Instruments and measurements": ("reduce", "calibrate", "polarimeter", "plan", "measure"),
    "Pictures": ("render", "export"),
    "The paper behind the model": ("reproduce",),
}

#: Subject of an option in every command that has many, by the parameter's name; the others are the common ones.
_SUBJECTS: dict[str, str] = {
    **dict.fromkeys(
        (
            *(
                "option",
                "free",
                "bounds",
                "start",
                "starts",
                "iterations",
                "strategy",
                "polish",
                "diffuse_tilt",
            ),
            *("prior", "split", "objective", "loss", "nuisance", "vary", "share", "correlation", "smoothing"),
        ),
        _SEARCH,
    ),
    **dict.fromkeys(("profile", "contour", "bootstrap", "cross_validate", "suggest", "following"), _WORTH),
    **dict.fromkeys(("figure_format", "figures", "picture", "pictures", "verbose", "datasets"), _WRITTEN),
    **dict.fromkeys(
        (
            *("calibration_error", "source_radius", "source_stability", "source_polarization", "angle_error"),
            *("camera_error", "zero_error", "tilt_error"),
        ),
        _ERRORS,
    ),
    **dict.fromkeys(
        ("out_of_plane", "camera_positions", "repeats", "smallest_bistatic", "largest_zenith"), _PLACES
    ),
    **dict.fromkeys(
        ("sun_zenith", "sun_azimuth", "lamp_polarizer", "lamp_retarder", "max_dolp", "optical_depth"), _LIGHT
    ),
    **dict.fromkeys(("spp", "depth", "variant"), _TRACING),
    **dict.fromkeys(("seed", "backend", "max_memory", "quiet"), _RUN),
}


def arrange(command: Any) -> None:
    """Give the options of a command that has many the subject by which its help lists them."""
    own = [p for p in command.params if getattr(p, "rich_help_panel", None) != READING_PANEL]
    if len(own) < _MANY:
        return
    free = [p for p in own if p.param_type_name == "option" and p.rich_help_panel is None]
    subjects = [_SUBJECTS.get(p.name) for p in free]
    for parameter, subject in zip(free, subjects, strict=True):
        # one alone needs no heading
        if subjects.count(subject) > 1:
            parameter.rich_help_panel = subject


def command_page(command: Any, ctx: Any) -> str:
    """The help of one command."""
    about, examples = _parts(command.help or "")
    lines = [*_usage(command, ctx), "", *about]
    if examples:
        lines += ["", _title("Examples")]
        for words, shown in examples:
            lines += [*_wrapped(f"# {words}", "  ", "  # ")] if words else []
            lines += _copied(shown)
    return "\n".join([*lines, *_parameters(command, ctx), ""])


def group_page(group: Any, ctx: Any) -> str:
    """The help of a group: its commands, each with its first sentence."""
    lines = [*_usage(group, ctx), "", *_parts(group.help or "")[0]]
    names = group.list_commands(ctx)
    column = max(map(len, names)) + 4
    for title, members in (GROUPS if ctx.parent is None else {"Commands": names}).items():
        lines += ["", _title(title)]
        for name in members:
            help = " ".join(
                inspect.cleandoc(group.get_command(ctx, name).help or "").split("\n\n")[0].split()
            )
            first = re.split(r"(?<=\.) |: ", help)[0].rstrip(".")
            lines += _entry(name, f"{first}.", column)
    return "\n".join([*lines, *_parameters(group, ctx), ""])


def _usage(command: Any, ctx: Any) -> list[str]:
    pieces = [re.sub(r"[{}]", "", piece) for piece in command.collect_usage_pieces(ctx)]
    return _wrapped(f"Usage: {ctx.command_path} {' '.join(pieces)}", "", "       ")


def _parts(help: str) -> tuple[list[str], list[tuple[str, str]]]:
    """Lines of what a command does, and its examples: what each is, and the command."""
    about: list[str] = []
    examples = []
    for paragraph in inspect.cleandoc(help).split("\n\n"):
        text = " ".join(paragraph.split())
        shown = re.fullmatch(r"(?:([^`]*): )?`(pbrdf [^`]+)`", text)
        if shown:
            examples.append((shown[1] or "", shown[2]))
        else:
            about += ["", *_wrapped(text, "", "")] if about else _wrapped(text, "", "")
    return about, examples


def _copied(command: str) -> Iterator[str]:
    """A command line to copy, continued where it is too long."""
    # an option stays with its value
    words, line = re.findall(r"-\S+ [^-\s]\S*|\S+", command), " "
    for word in words:
        if len(line) + len(word) + 3 > _WIDTH:
            yield f"{line} \\"
            line = "     "
        line += f" {word}"
    yield line


def _parameters(command: Any, ctx: Any) -> list[str]:
    """Arguments, then options, the common ones first and those that read a file last."""
    panels: dict[str, list[Any]] = {"Arguments": [], "Options": []}
    for parameter in command.get_params(ctx):
        if getattr(parameter, "hidden", False):
            continue
        usual = "Arguments" if parameter.param_type_name == "argument" else "Options"
        panels.setdefault(getattr(parameter, "rich_help_panel", None) or usual, []).append(parameter)
    reading = panels.pop(READING_PANEL, [])
    lines: list[str] = []
    for title, parameters in panels.items():
        if parameters:
            lines += ["", _title(title)]
            for parameter in parameters:
                lines += _entry(*_described(parameter, ctx), _COLUMN)
    if reading:
        lines += ["", _title(READING_PANEL)]
        if command.name == _READS:
            for parameter in reading:
                lines += _entry(*_described(parameter, ctx), _COLUMN)
        else:
            names = ", ".join(parameter.opts[0] for parameter in reading)
            lines += _wrapped(f"{names}: see `pbrdf {_READS} --help`.", "  ", "  ")
    return lines


def _described(parameter: Any, ctx: Any) -> tuple[str, str]:
    """Names with what they take, and the text with the default."""
    names, text = parameter.get_help_record(ctx) or ("", "")
    argument = parameter.param_type_name == "argument"
    names = re.sub(r" <([^>]*)>$", lambda kind: "" if argument else f" {_taken(kind[1])}", names)
    # the range of a number in words, and a default that is told in words without brackets
    text = re.sub(r"([\d.-]+)<=x<=([\d.-]+)", lambda ends: f"{float(ends[1]):g} to {float(ends[2]):g}", text)
    text = re.sub(r"x>=([\d.-]+)", lambda end: f"at least {float(end[1]):g}", text)
    return names, re.sub(r"\[default: \(((?:[^()]|\([^()]*\))*)\)", r"[default: \1", text)


def _taken(kind: str) -> str:
    return "N" if re.search("int|float", kind) else "PATH" if "path" in kind else "TEXT"


def _entry(names: str, text: str, column: int) -> list[str]:
    """What an option is called, and beside or below that what it does."""
    lines = _wrapped(text, " " * column, " " * column)
    head = "  " + typer.style(names, bold=True)
    if len(names) + 4 <= column and lines:
        return [head + lines[0][2 + len(names) :], *lines[1:]]
    return [head, *lines]


def _wrapped(text: str, first: str, then: str) -> list[str]:
    # a command stays in one line
    text = re.sub(r"`[^`]{,40}`", lambda quoted: quoted[0].replace(" ", _NO_BREAK), " ".join(text.split()))
    lines = textwrap.wrap(
        text,
        min(_WIDTH, shutil.get_terminal_size((_WIDTH, 24)).columns),
        initial_indent=first,
        subsequent_indent=then,
        break_on_hyphens=False,
        break_long_words=False,
    )
    return [line.replace(_NO_BREAK, " ") for line in lines]


def _title(text: str) -> str:
    return typer.style(f"{text}:", bold=True)
