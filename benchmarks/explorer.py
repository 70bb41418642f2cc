"""From a slider's move to pixels: the explorer beside the bare prototype, in one Chromium and in turns.

    python benchmarks/explorer.py PROTOTYPE [--moves N] [--json FILE]

PROTOTYPE is the program ``app_bin.py``: the same model behind the same server (Tornado), a field over all azimuths in
float16 over one WebSocket, the same two pictures (intensity and DoLP, 450 x 450 pixels each) by WebGL2, and nothing
else. Without it only the explorer is measured.

Each of the two has a process of its own with kernel caches of its own, which begin empty, and a tab of its own in one
Chromium with software GL. In every turn one slider is moved to the same value in both, and who begins alternates. Time
is taken in the page, from before the ``input`` event until the pixels of all pictures are there: in both one pixel of
each canvas is read back, so that the drawing has ended; and until the second animation frame after that, when the page
with its pictures has been put together. A pause after that it is the other's turn. The first picture is timed from the
start of the navigation, with and without kernels on disk.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from machine import processor
from playwright.sync_api import Browser, Page, sync_playwright
from rich.console import Console
from rich.table import Table

from pbrdf import DoubleGauss

SOURCE = Path(__file__).resolve().parent.parent / "src"
#: WebGL2 without a graphics card.
FLAGS = ("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
#: Where the sliders are moved to: name, least and largest value.
SLIDERS = {"sigma": (0.02, 0.1), "n": (1.4, 1.9), "t": (0.3, 0.9)}
TARGET_RATIO, TARGET_FIRST = 0.5, 2.0
#: Seconds between the two's turns: what one has left the browser to do is done before the other is timed.
PAUSE = 0.4
#: Serves the explorer with the paint that the prototype shows, and prints the address.
SERVE = """
import asyncio
import pbrdf
from pbrdf.explorer.server import serve
from pbrdf.explorer.workspace import Workspace

class OneView(Workspace):
    def state(self):
        return {**super().state(), "settings": {"page": {"views": ["hemisphere"]}}}

paint = pbrdf.load_paint("matte-white-thick")
asyncio.run(serve(lambda: OneView([("paint", paint)]), 0, lambda address: print(address, flush=True)))
"""

#: The explorer's pictures as large as the prototype's: two columns of 450 pixels and the gap between them.
NARROW = 'document.querySelector(".board").style.width = "912px"'
# The prototype counts its pictures in window.done, after it has read a pixel.
PROTOTYPE_PROBE = """
let count = 0;
Object.defineProperty(window, "done", { get: () => count, set(value) {
  count = value;
  if (value === 1) window.first = performance.now();
  if (value > 0) window.told?.(performance.now());
} });
window.received = () => window.bytes;
"""
# The explorer tells of its pictures by an event.
EXPLORER_PROBE = """
const Plain = WebSocket;
let bytes = 0;
window.WebSocket = class extends Plain {
  constructor(...given) { super(...given); this.addEventListener("message", e => { bytes += e.data.byteLength; }); }
};
window.received = () => bytes;
addEventListener("pbrdf-drawn", () => {
  for (const canvas of document.querySelectorAll("canvas")) {
    canvas.getContext("2d")?.getImageData(0, 0, 1, 1);
  }
  window.first ??= performance.now();
  window.told?.(performance.now());
});
"""
MOVE = """
([selector, value, share]) => new Promise(answer => {
  const slider = document.querySelector(selector), before = received();
  // the explorer's sliders count steps along a scale of their own
  slider.value = share === null ? value : Number(slider.max) * share;
  const start = performance.now();
  window.told = now => {
    window.told = null;
    const drawn = now - start, bytes = received() - before;
    requestAnimationFrame(() => requestAnimationFrame(() => answer([drawn, bytes, performance.now() - start])));
  };
  slider.dispatchEvent(new Event("input", { bubbles: true }));
})
"""


def along(name: str, value: float) -> float:
    """Where a value stands on the explorer's slider, from 0 to 1."""
    p = next(p for p in DoubleGauss.parameters if p.name == name)
    if p.logarithmic:
        return math.log(value / p.lower) / math.log(p.upper / p.lower)
    return (value - p.lower) / (p.upper - p.lower)


class Subject:
    """One of the two, served and opened."""

    def __init__(self, name: str, probe: str, selector: str, narrow: str = "") -> None:
        self.name, self.probe, self.selector, self.narrow = name, probe, selector, narrow
        self.first: dict[str, float] = {}
        self.times: list[float] = []
        self.bytes: list[int] = []
        self.frames: list[float] = []
        self.page: Page

    def open(self, browser: Browser, address: str, label: str) -> None:
        """Load the page and time its first picture."""
        context = browser.new_context(viewport={"width": 1280, "height": 900})
        self.page = context.new_page()
        self.page.add_init_script(self.probe)
        self.page.goto(address)
        # by asking again and again: the explorer's page lets no text become a script
        while (first := self.page.evaluate("window.first")) is None:
            time.sleep(0.05)
        if label:
            self.first[label] = first / 1e3
        if self.narrow:
            self.page.evaluate(self.narrow)

    def move(self, slider: str, value: float, counted: bool) -> None:
        """Move a slider and wait for the pixels."""
        share = along(slider, value) if self.narrow else None
        milliseconds, size, frame = self.page.evaluate(MOVE, [self.selector.format(slider), value, share])
        if counted:
            self.times.append(milliseconds)
            self.bytes.append(size)
            self.frames.append(frame)


@contextmanager
def served(command: list[str], cache: Path, port: int | None) -> Iterator[str]:
    """A server's address, from when it answers; ``port`` where the program does not print it."""
    paths = os.pathsep.join(filter(None, [str(SOURCE), os.environ.get("PYTHONPATH")]))
    environment = {**os.environ, "DRJIT_CACHE_DIR": str(cache), "PYTHONPATH": paths}
    process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)
    try:
        if port is None:
            assert process.stdout is not None
            yield process.stdout.readline().strip()
        else:
            while process.poll() is None:
                with suppress(OSError), socket.create_connection(("127.0.0.1", port), 1.0):
                    break
                time.sleep(0.02)
            yield f"http://127.0.0.1:{port}/"
    finally:
        process.kill()
        process.wait()


def free_port() -> int:
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return int(s.getsockname()[1])


def measure(options: argparse.Namespace) -> list[Subject]:
    """Open both, with and without kernels on disk, and move their sliders in turns."""
    explorer = Subject("explorer", EXPLORER_PROBE, "input[type=range][name={}]", NARROW)
    prototype = Subject("prototype", PROTOTYPE_PROBE, "#{}")
    rng = np.random.default_rng(0)
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as scratch:
        browser = playwright.chromium.launch(executable_path=options.chromium, args=list(FLAGS))

        def start(subject: Subject, kernels: str) -> Any:
            cache = Path(scratch) / f"{subject.name} {kernels}"
            cache.mkdir(exist_ok=True)
            if subject is explorer:
                return served([sys.executable, "-c", SERVE], cache, None)
            port = free_port()
            return served([sys.executable, str(options.prototype), str(port)], cache, port)

        subjects = [explorer, prototype] if options.prototype else [explorer]
        # at first neither pays for the start of the browser, its fonts and its graphics
        for kernels, label in (("others", ""), ("kept", "no kernels on disk")):
            for subject in subjects:
                with start(subject, kernels) as address:
                    subject.open(browser, address, label)
                    subject.move("sigma", 0.05, False)  # its kernels too are on disk now
                    subject.page.context.close()
        with start(explorer, "kept") as first, start(subjects[-1], "kept") as second:
            for subject, address in zip(subjects, (first, second), strict=False):
                subject.open(browser, address, "kernels on disk")
            for turn in range(options.moves + 3):
                name = list(SLIDERS)[turn % len(SLIDERS)]
                low, high = SLIDERS[name]
                value = round(low + (high - low) * rng.random(), 3)
                for subject in subjects[:: 1 if turn % 2 else -1]:
                    subject.move(name, value, turn >= 3)
                    time.sleep(PAUSE)
        browser.close()
    return subjects


def spread(values: list[float], form: str) -> str:
    """Median and quartiles."""
    low, middle, high = (format(v, form) for v in statistics.quantiles(values, n=4))
    return f"{middle} ({low} … {high})"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("prototype", nargs="?", type=Path, help="app_bin.py of the prototype")
    parser.add_argument("--moves", type=int, default=60)
    parser.add_argument("--chromium", default="/usr/bin/chromium", help="program of the browser")
    parser.add_argument("--json", type=Path, help="write everything measured there")
    options = parser.parse_args()
    subjects = measure(options)
    firsts = [f"first picture, s, {label}" for label in subjects[0].first]
    table = Table("", "slider to pixels, ms", "to the frame after, ms", "kB a move", *firsts)
    for s in subjects:
        table.add_row(
            s.name,
            spread(s.times, ".1f"),
            spread(s.frames, ".1f"),
            f"{statistics.median(s.bytes) / 1e3:.0f}",
            *(f"{t:.2f}" for t in s.first.values()),
        )
    console = Console()
    console.print(f"{processor()}, {os.cpu_count()} threads, {options.moves} moves")
    console.print(table)
    if len(subjects) == 2:
        for what in ("times", "frames"):
            ratios = [a / b for a, b in zip(*(getattr(s, what) for s in subjects), strict=True)]
            words = {"times": "to pixels", "frames": "to the frame after"}[what]
            console.print(f"explorer ÷ prototype, {words}: {spread(ratios, '.2f')}")
        console.print(f"to pixels to be ≤ {TARGET_RATIO}")
    console.print(f"first picture to be ≤ {TARGET_FIRST:g} s after the server answers")
    if options.json:
        measured = {
            s.name: {"ms": s.times, "bytes": s.bytes, "frame_ms": s.frames, "first_s": s.first}
            for s in subjects
        }
        options.json.write_text(json.dumps({"processor": processor(), **measured}, indent=1))


if __name__ == "__main__":
    main()
