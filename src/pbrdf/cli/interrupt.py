"""Ctrl-C, heard at once though the processor is deep in a kernel.

Python hears a signal when the call that it is in returns, and a kernel of Dr.Jit or Mitsuba may take minutes.
Other threads of Python run meanwhile, so one of them is told of the signal by a socket, gives Python a moment to stop
in good order, and ends the process if that moment passes. While Dr.Jit records a kernel it turns KeyboardInterrupt into
an error of its own, or loses it: that ends the process, too.
"""

from __future__ import annotations

import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import NoReturn

from pbrdf.cli.console import fail

__all__ = ["INTERRUPTED", "end", "heard_at_once", "say_when_interrupted", "what_is_said"]

#: Exit code after Ctrl-C, that of a shell for a command that SIGINT ended.
INTERRUPTED = 130
#: What Python has to come out of a kernel, and then to leave in good order, seconds.
_PATIENCE, _TO_LEAVE = 1.0, 0.8
_INTERRUPTED = "interrupted"
_said: list[Callable[[], str]] = [lambda: _INTERRUPTED]


def say_when_interrupted(sentence: Callable[[], str] = lambda: _INTERRUPTED) -> None:
    """Choose the line on Ctrl-C from now on: a command that leaves something says what, and how to go on."""
    _said[0] = sentence


def what_is_said() -> str:
    """The line on Ctrl-C."""
    return _said[0]()


@contextmanager
def heard_at_once() -> Iterator[threading.Event]:
    """Raise KeyboardInterrupt on Ctrl-C, or end the process with one line if nothing comes of it within two seconds.

    Yields
    ------
    Event
        Set when Python has heard of it.
    """
    heard = threading.Event()

    def handler(number: int, frame: FrameType | None) -> None:
        heard.set()
        raise KeyboardInterrupt

    receiver, sender = socket.socketpair()
    sender.setblocking(False)
    before = signal.signal(signal.SIGINT, handler)
    wakeup = signal.set_wakeup_fd(sender.fileno(), warn_on_full_buffer=False)
    threading.Thread(target=_watch, args=(receiver, heard), name="interrupt", daemon=True).start()
    try:
        yield heard
    finally:
        signal.set_wakeup_fd(wakeup)
        signal.signal(signal.SIGINT, before)
        sender.close()


def end(code: int = INTERRUPTED) -> NoReturn:
    """Leave at once with an exit code: the end of Python would wait for kernels that are still at work."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError):
            stream.flush()
    os._exit(code)


def _watch(receiver: socket.socket, heard: threading.Event) -> None:
    """Wait for signals; the socket closes when there is nothing more to watch."""
    with receiver:
        while signals := receiver.recv(1):
            if signals[0] == signal.SIGINT:
                if heard.wait(_PATIENCE):
                    time.sleep(_TO_LEAVE)
                fail(what_is_said())
                end()
