"""The explorer as a program: served until Ctrl-C, shown in the browser of this machine, or told how to be."""

from __future__ import annotations

import asyncio
import os
import sys
import threading
import webbrowser
from collections.abc import Callable, Mapping
from contextlib import suppress
from urllib.parse import urlsplit

from pbrdf.errors import PbrdfError
from pbrdf.explorer.workspace import Workspace

__all__ = ["from_elsewhere", "has_browser", "show"]


def show(workspace: Workspace, port: int, browser: bool, say: Callable[[str], None]) -> None:
    """Serve pages of a workspace until KeyboardInterrupt.

    Parameters
    ----------
    workspace
        What is open.
    port
        As of :func:`pbrdf.explorer.server.serve`.
    browser
        Whether a browser is to be opened, where there is one.
    say
        Told lines: the address, and how to come to it from another machine.

    Raises
    ------
    PbrdfError
        If Tornado is not installed or the port cannot be used.
    """
    try:
        from pbrdf.explorer.server import serve
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "tornado":
            raise
        raise PbrdfError("the explorer needs Tornado: pip install 'pbrdf[explore]'") from None

    def ready(address: str) -> None:
        say(f"The explorer is at {address}")
        if browser and has_browser(os.environ):
            # it may block until the browser is closed
            threading.Thread(target=webbrowser.open, args=(address,), daemon=True).start()
        elif browser:
            for line in from_elsewhere(address, os.environ):
                say(line)
        say("Ctrl-C ends it.")

    with suppress(KeyboardInterrupt):
        asyncio.run(serve(workspace.again, port, ready))


def has_browser(environment: Mapping[str, str], platform: str = sys.platform) -> bool:
    """Whether a browser would appear where the user sits: not over SSH, and not without a display."""
    if environment.get("BROWSER"):
        return True
    if environment.get("SSH_CONNECTION") or environment.get("SSH_TTY"):
        return False
    return platform in ("win32", "darwin") or bool(
        environment.get("DISPLAY") or environment.get("WAYLAND_DISPLAY")
    )


def from_elsewhere(address: str, environment: Mapping[str, str]) -> list[str]:
    """Lines that say how to come to an address of this machine from another."""
    port = urlsplit(address).port
    # its fourth word is the address of this machine that the user has reached
    reached = environment.get("SSH_CONNECTION", "").split()
    host = reached[2] if len(reached) == 4 else "this-machine"
    return [
        "There is no display here. From the machine where you sit:",
        f"  ssh -N -L {port}:127.0.0.1:{port} {environment.get('USER', 'user')}@{host}",
        "and open the address there (the port must be the same on both sides).",
    ]
