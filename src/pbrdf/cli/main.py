"""The command ``pbrdf``: its subcommands, and what a user sees of an error.

Nothing here imports more than typer; a command is loaded when it is called, and imports what it needs when it runs, so
that the help appears at once.
"""

from __future__ import annotations

import atexit
import errno
import gc
import os
import sys
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from typing import Annotated, Any

import typer
import typer.main

from pbrdf.cli.command_line import given_arguments, remember_arguments
from pbrdf.cli.console import fail, warn
from pbrdf.cli.help_page import arrange
from pbrdf.cli.interrupt import INTERRUPTED, end, heard_at_once, say_when_interrupted, what_is_said
from pbrdf.cli.options import CommandGroup, ReadingCommand
from pbrdf.cli.values import refuse_odd_numbers
from pbrdf.errors import PbrdfError, PluginWarning
from pbrdf.version import __version__

__all__ = ["app", "main"]

#: Exit code where the input, and not the program, is at fault; the same as for a wrong option.
USER_ERROR = 2
#: The commands in the order of the help, with the module of ``pbrdf.cli``, and where it is not that of the command, the
#: name of the function in it.
COMMANDS = {
    "fit": "fit",
    "compare": "compare",
    "map": "map:map_pixels",
    "simulate": "simulate",
    "calibrate": "calibrate",
    "polarimeter": "polarimeter",
    "reduce": "reduce",
    "plot": "plot",
    "explore": "explore",
    "plan": "plan",
    "identify": "identify",
    "library": "library",
    "measure": "measure",
    "render": "render",
    "reproduce": "reproduce",
    "export": "export",
    "check": "check",
    "convert": "convert",
    "demo": "demo",
    "example": "example",
    "compare-with": "compare_with:compare_with",
    "paints": "lists",
    "models": "lists",
    "doctor": "doctor",
}


class _WhenCalled(Mapping[str, Any]):
    """The commands by name, each loaded when it is asked for: to read all their options takes as long as a fit."""

    def __init__(self) -> None:
        self._loaded: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name not in self._loaded:
            module, _, function_name = COMMANDS[name].partition(":")
            function = getattr(import_module(f"pbrdf.cli.{module}"), function_name or name)
            alone = function
            if not isinstance(function, typer.Typer):
                alone = typer.Typer(
                    add_completion=False, rich_markup_mode="markdown", pretty_exceptions_enable=False
                )
                alone.command(name, cls=ReadingCommand)(function)
            self._loaded[name] = typer.main.get_command(alone)
            self._loaded[name].name = name
            arrange(self._loaded[name])
        return self._loaded[name]

    def __contains__(self, name: object) -> bool:
        return name in COMMANDS

    def __iter__(self) -> Iterator[str]:
        return iter(COMMANDS)

    def __len__(self) -> int:
        return len(COMMANDS)


class _Commands(CommandGroup):
    """The group of all commands; turns errors that a user can mend into one line and exit code 2."""

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        self.commands = _WhenCalled()  # type: ignore[assignment]

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        remember_arguments(args)
        return super().parse_args(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        try:
            with _plugin_warnings_in_lines():
                say_when_interrupted()
                refuse_odd_numbers(self.commands, given_arguments())
                return super().invoke(ctx)
        except KeyboardInterrupt:
            fail(what_is_said())
            raise typer.Exit(INTERRUPTED) from None
        except PbrdfError as error:
            fail(str(error))
        except OSError as error:
            # The reader of a pipe went away (`pbrdf paints | head -1`): typer ends silently then.
            if error.errno == errno.EPIPE:
                raise
            named = f"{error.filename}: " if error.filename is not None else ""
            fail(f"{named}{error.strerror or error}")
        raise typer.Exit(USER_ERROR)


@contextmanager
def _plugin_warnings_in_lines() -> Iterator[None]:
    """Show what is wrong with a model or reader of an installed package as one line."""
    with warnings.catch_warnings():
        show = warnings.showwarning

        def show_one_line(message: Warning | str, category: type[Warning], *rest: Any, **more: Any) -> None:
            if issubclass(category, PluginWarning):
                warn(str(message))
            else:
                show(message, category, *rest, **more)

        warnings.showwarning = show_one_line
        yield


app = typer.Typer(
    cls=_Commands,
    no_args_is_help=True,
    rich_markup_mode="markdown",
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
    pretty_exceptions_enable=False,
)


def _show_version(wanted: bool) -> None:
    if wanted:
        print(f"pbrdf {__version__}")
        raise typer.Exit


def _register(models: list[str] | None) -> None:
    if models:
        from pbrdf.models import find_model

        for text in models:
            find_model(text)


@app.callback()
def options(
    model: Annotated[
        list[str] | None,
        typer.Option(
            help="Make a model of your own known to the command that follows (repeatable).",
            metavar="FILE.py:Class",
        ),
    ] = None,
    version: Annotated[
        bool,
        typer.Option("--version", help="Show the version and leave.", callback=_show_version, is_eager=True),
    ] = False,
) -> None:
    """Polarimetric reflectance of coatings: fit, predict and draw pBRDF models.

    Angles are in degrees. `pbrdf COMMAND --help` explains a command.
    """
    _register(model)


def _start_lightly() -> None:
    """Leave out work at the start and at the end of a process that takes as long as a command's own."""
    # threads of OpenBLAS that wait for work spin for a tenth of a second each, unless told (2⁴ cycles) to sleep
    os.environ.setdefault("OPENBLAS_THREAD_TIMEOUT", "4")
    # what imports make by the hundred thousand stays: no use in looking through all of it again and again
    gc.set_threshold(500_000, 20, 50)
    # and none at the end in looking for what is garbage in all that goes anyway
    atexit.register(gc.freeze)


def main() -> None:
    """Run the command line; the entry point of ``pbrdf``."""
    _start_lightly()
    for stream in (sys.stdout, sys.stderr):
        # An old Windows code page has no σ or χ: better a question mark than a crash.
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")
    with heard_at_once() as heard:
        try:
            app()
        except SystemExit as leaving:
            if leaving.code == INTERRUPTED:
                end()
            raise
        except Exception:
            if not heard.is_set():
                raise
            fail(what_is_said())
            end()
