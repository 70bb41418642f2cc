"""Damaged inputs by the thousand: every one must be read, or refused with a sentence.

    python tests/fuzz/fuzz_run.py --count 20000        # make fuzz
    python tests/fuzz/fuzz_run.py --only 4711          # one input again, with the traceback

The inputs are the same every time: input k is made from the number k and the name of its kind. They are read in
processes beside, so that a library that crashes or does not come to an end is counted, and goes on with the next. An
input is kept nowhere: a file that harms a library is not for passing on; the number is enough to report.

Outcomes: read; refused, by a PbrdfError; foreign, any other exception; endless, no end after a minute; died, the
process went; infinite, read without a word though a number in it is infinite.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import random
import subprocess
import sys
import tempfile
import threading
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

from fuzz_kinds import Kind, kinds, write_seeds
from fuzz_mutations import damaged_copy

OUTCOMES = ("read", "refused", "foreign", "endless", "died", "infinite")
#: Outcomes that must not be.
FAULTS = OUTCOMES[2:]
#: Seconds for one input.
_DEADLINE = 60.0


def infinite(value: Any, depth: int = 0) -> bool:
    """Whether there is an infinite number in whatever was read."""
    if isinstance(value, float):
        return bool(np.isinf(value))
    if isinstance(value, np.ndarray):
        return value.dtype.kind == "f" and bool(np.isinf(value).any())
    if depth > 4:
        return False
    if hasattr(value, "variables"):
        return any(infinite(v.values) for v in value.variables.values())
    if dataclasses.is_dataclass(value):
        return any(infinite(getattr(value, f.name), depth + 1) for f in dataclasses.fields(value))
    if isinstance(value, dict):
        return any(infinite(v, depth + 1) for v in value.values())
    if isinstance(value, list | tuple):
        return any(infinite(v, depth + 1) for v in value)
    return bool(hasattr(value, "values") and isinstance(value.values, dict) and infinite(value.values))


def classify(kind: Kind, path: Path) -> tuple[str, str]:
    """Outcome of reading a file, and where a foreign exception came from."""
    from pbrdf.errors import PbrdfError

    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            found = kind.read(path)
    except PbrdfError as error:
        return "refused", str(error)
    except Exception as error:
        frames = traceback.extract_tb(error.__traceback__)
        inside = [f for f in frames if "pbrdf" in Path(f.filename).parts] or frames
        place = f"{Path(inside[-1].filename).name}:{inside[-1].lineno}"
        return "foreign", f"{type(error).__name__} at {place}: {str(error)[:100]}"
    return ("infinite", "") if kind.finite and infinite(found) else ("read", "")


def plan(every: Sequence[Kind], count: int) -> list[Kind]:
    """The kind of each input: all in turn, each by its share."""
    owed = [0.0] * len(every)
    chosen = []
    while len(chosen) < count:
        for i, kind in enumerate(every):
            owed[i] += kind.share
            if owed[i] > 1.0 - 1e-9:
                owed[i] -= 1.0
                chosen.append(kind)
    return chosen[:count]


def one(kind: Kind, number: int) -> tuple[str, str]:
    """Make one input, read it, and forget it."""
    source = random.Random(f"{kind.name} {number}")
    with tempfile.TemporaryDirectory(prefix="fuzz") as folder:
        return classify(kind, damaged_copy(source.choice(kind.seeds), Path(folder), source))


def _serve(folder: Path) -> None:
    """Be a process beside: read lines of kind and number, write outcomes."""
    from pbrdf.files import hdf5_guard

    hdf5_guard._PATIENCE = 10.0
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    known = {kind.name: kind for kind in kinds(folder)}
    for line in sys.stdin:
        name, number = json.loads(line)
        answers.write(json.dumps(one(known[name], number)) + "\n")
        answers.flush()


class _Worker(threading.Thread):
    """Reads inputs in a process beside, and starts another where one does not answer."""

    def __init__(self, folder: Path, inputs: Iterator[tuple[int, Kind]], told: Callable[..., None]) -> None:
        super().__init__(daemon=True)
        self.folder, self.inputs, self.told = folder, inputs, told
        self.child: subprocess.Popen[str] | None = None

    def run(self) -> None:
        for number, kind in self.inputs:
            self.told(number, kind, *self.outcome(kind, number))
        self.end()

    def outcome(self, kind: Kind, number: int) -> tuple[str, str]:
        if self.child is None:
            self.child = subprocess.Popen(
                [sys.executable, __file__, "--serve", str(self.folder)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
                env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            )
        child, lines = self.child, []
        assert child.stdin is not None and child.stdout is not None
        try:
            child.stdin.write(json.dumps([kind.name, number]) + "\n")
            child.stdin.flush()
        except OSError:
            self.end()
            return "died", "before it began"
        reading = threading.Thread(target=lambda: lines.append(child.stdout.readline()), daemon=True)
        reading.start()
        reading.join(_DEADLINE)
        if reading.is_alive():
            child.kill()
            reading.join()
            self.end()
            return "endless", ""
        if not lines or not lines[0].endswith("\n"):
            self.end()
            return "died", ""
        outcome, detail = json.loads(lines[0])
        return outcome, detail

    def end(self) -> None:
        if self.child is not None:
            self.child.kill()
            self.child.wait()
            for pipe in (self.child.stdin, self.child.stdout):
                if pipe is not None:
                    with suppress(OSError):
                        pipe.close()
            self.child = None


def fuzz(
    folder: Path, count: int, processes: int, first: int = 0, quiet: bool = False
) -> dict[str, Counter[str]]:
    """Read damaged inputs; the outcomes by kind, faults printed."""
    every = kinds(folder)
    inputs = iter(list(enumerate(plan(every, first + count)))[first:])
    counts = {kind.name: Counter[str]() for kind in every}
    lock, begun = threading.Lock(), time.monotonic()

    def told(number: int, kind: Kind, outcome: str, detail: str) -> None:
        with lock:
            counts[kind.name][outcome] += 1
            done = sum(c.total() for c in counts.values())
            if outcome in FAULTS:
                print(f"{outcome}: input {number}, {kind.name}: {detail}", flush=True)
            elif done % 1000 == 0 and not quiet:
                print(f"{done} of {count} in {time.monotonic() - begun:.0f} s", flush=True)

    class Shared:
        """One iterator for all threads."""

        def __iter__(self) -> Iterator[tuple[int, Kind]]:
            return self

        def __next__(self) -> tuple[int, Kind]:
            with lock:
                return next(inputs)

    workers = [_Worker(folder, Shared(), told) for _ in range(processes)]  # type: ignore[arg-type]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    return counts


def table(counts: dict[str, Counter[str]]) -> str:
    """The outcomes, a line a kind."""
    total = sum(counts.values(), Counter())
    lines = [f"{'kind':18s}" + "".join(f"{name:>10s}" for name in OUTCOMES)]
    for name, found in [*counts.items(), ("all", total)]:
        lines.append(f"{name:18s}" + "".join(f"{found[outcome]:10d}" for outcome in OUTCOMES))
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=20_000)
    parser.add_argument("--first", type=int, default=0, help="number of the first input")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--only", type=int, help="read one input in this process, with the traceback")
    parser.add_argument("--kind", help="its kind, if it is not that of its number")
    parser.add_argument("--serve", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.serve is not None:
        _serve(options.serve)
        return 0
    with tempfile.TemporaryDirectory(prefix="fuzz-seeds") as name:
        folder = Path(name)
        write_seeds(folder)
        if options.only is not None:
            every = {kind.name: kind for kind in kinds(folder)}
            kind = every[options.kind] if options.kind else plan(list(every.values()), options.only + 1)[-1]
            source = random.Random(f"{kind.name} {options.only}")
            kind.read(damaged_copy(source.choice(kind.seeds), Path(tempfile.mkdtemp(dir=name)), source))
            return 0
        counts = fuzz(folder, options.count, options.processes, options.first)
    print(table(counts))
    return int(any(found[fault] for found in counts.values() for fault in FAULTS))


if __name__ == "__main__":
    sys.exit(main())
