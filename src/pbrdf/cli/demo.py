"""``pbrdf demo``: a user's job from a table to a picture, each step with the command that does it."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from pbrdf.cli.console import fail, reading_width
from pbrdf.cli.options import output_option

__all__ = ["STEPS", "Step", "demo"]

_TABLE = "paint.csv"
#: Lines of it that are shown: the conventions, the names of the columns and a row.
_HEAD = 9
_INDENT = "   "
#: What runs a command as the shell would, whatever is on its path.
_PROGRAM = (sys.executable, "-c", "from pbrdf.cli.main import main; main()")


@dataclass(frozen=True)
class Step:
    """One command of the demonstration.

    Attributes
    ----------
    says
        What is done.
    command
        The command line, in words.
    lines
        So many lines of its output are shown; the rest is told by its number.
    shows
        Files to open, in the folder of the demonstration, with what they are.
    """

    says: str
    command: tuple[str, ...]
    lines: int
    shows: tuple[tuple[str, str], ...] = ()


#: What needs Mitsuba, last.
STEPS = (
    Step(
        "A table of measured Stokes parameters; its first lines state the conventions",
        ("pbrdf", "example", "table"),
        0,
        ((_TABLE, "the measurement"),),
    ),
    Step("Is it understood as it was meant?", ("pbrdf", "check", _TABLE), 20),
    Step(
        "A model fitted to two camera positions; the third is held out and predicted",
        ("pbrdf", "fit", _TABLE, "--hold-out", "group=3"),
        12,
        (("paint-fit/index.html", "the fit: page with figures, parameters and what they are worth"),),
    ),
    Step(
        "Which of several models predicts best what it has not seen?",
        (
            *("pbrdf", "compare", _TABLE, "--hold-out", "group=3", "--vary", "0"),
            *("--models", "double-gauss,cook-torrance-lambert,ggx-lambert"),
        ),
        12,
        (("paint-compare/index.html", "the comparison of models"),),
    ),
    Step(
        "The paint as a polarisation camera sees a sphere of it under a clear sky",
        ("pbrdf", "render", "paint-fit", "--albedo", "0.6", "--size", "256x256", "--spp", "64", "-q"),
        1,
        (("sphere-render/stokes.png", "the sphere: intensity, degree and angle of polarisation"),),
    ),
)


def demo(
    output: Annotated[Path, output_option("Folder for everything that is made.")] = Path("demo"),
) -> None:
    """Show the way from a measured table to a picture in a minute, with the command of each step.

    A simulated measurement is checked and fitted, one camera position is predicted, models are compared, and a
    sphere is rendered where Mitsuba is installed.

    `pbrdf demo`
    """
    began = time.monotonic()
    output.mkdir(parents=True, exist_ok=True)
    print(f"From a measurement to a picture, in the folder {output}; the measurement is simulated.")
    made: list[tuple[str, str]] = []
    for number, step in enumerate(STEPS, 1):
        print(f"\n{number}. {step.says}\n   $ {' '.join(step.command)}", flush=True)
        if step.command[1] == "example":
            if not (output / _TABLE).exists():
                _run(step, output)
            _show((output / _TABLE).read_text(encoding="utf-8"), _HEAD)
        elif step.command[1] == "render" and importlib.util.find_spec("mitsuba") is None:
            print("   left out: Mitsuba is not installed; pip install 'pbrdf[render]' brings it")
            continue
        else:
            _run(step, output)
        made += step.shows
    print(f"\nDone in {time.monotonic() - began:.0f} s. Open:")
    width = max(len(str(output / name)) for name, _ in made)
    for name, what in made:
        print(f"  {output / name!s:{width}}  {what}")
    print(f"Your own data: the same commands with your file in place of {_TABLE}.")
    print("The paper behind the model, reproduced statement by statement: pbrdf reproduce")


def _run(step: Step, folder: Path) -> None:
    """Run a command in a folder and show the first lines of what it prints; ends where it fails."""
    width = (reading_width() or 80) - len(_INDENT)
    done = subprocess.run(
        [*_PROGRAM, *step.command[1:]],
        cwd=folder,
        env={**os.environ, "COLUMNS": str(width), "PYTHONIOENCODING": "utf-8"},
        stdout=subprocess.PIPE,
        encoding="utf-8",
    )
    if step.lines:
        _show(done.stdout, step.lines)
    if done.returncode:
        fail(f"{' '.join(step.command)} ended with exit code {done.returncode}")
        raise typer.Exit(done.returncode)


def _show(text: str, most: int) -> None:
    """Print the first lines of a text, and how many there are more."""
    lines = text.rstrip().splitlines()
    shown = "\n".join(lines[:most]).rstrip().splitlines()
    for line in shown:
        print(f"{_INDENT}{line}".rstrip())
    if len(lines) > len(shown):
        print(f"{_INDENT}… {len(lines) - len(shown)} more lines")
