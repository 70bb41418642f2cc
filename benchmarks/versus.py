"""This work tree against another revision of the repository, side by side in one run.

    python benchmarks/versus.py REV [--only ROW…] [--turns N] [--quick] [--threads N] [--limit S] [--json FILE]

REV is checked out into a temporary folder, which goes when the script ends. Each build has one process that lives as
long as the comparison (``versus_worker.py``, the same interpreter and packages, kernel caches of its own), and the two
take turns: in every turn both do the same work, and who begins alternates. The first turn of a row is not counted. A
ratio is found within each turn, so that a change of the machine's speed touches both builds alike; printed are medians
and, in brackets, the quartiles.

There are two kinds of rows. In most of them the time of REV is divided by that of the work tree: larger is better. In
the others the cost of one thing is divided by that of another in the same build (``visible`` by ``weighted``, a render
by that with ``pplastic``, a fit of G groups by G fits): smaller is better, and both builds' ratios are printed. The
targets are those of issue 12, ratios to c215ca4; with another REV they tell nothing.

What is faster must also be right. Mueller matrices may differ from REV's accuracy ``high`` by what docs/model.md,
section 4, states; fitted parameters by a hundredth of their standard errors, χ² by rounding unless it is lower;
pictures by 2e-3 of their mean. Else the script ends with status 1, as when a build fails. Where a build takes longer
than ``--limit`` seconds for one turn its process is ended and the row says "no result".

Compare on a machine that does nothing else, or with ``--threads 1``; rows of the command line count processor time.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import selectors
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from machine import processor
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

HERE = Path(__file__).resolve().parent
TREE = HERE.parent
#: Fitted parameters agree to this part of their standard errors, χ² to this part, pictures to this part of the mean.
OF_STANDARD_ERROR, OF_CHI2, OF_PICTURE = 0.01, 1e-6, 2e-3
#: Seconds that a process may take to start.
STARTING = 60.0


@dataclass(frozen=True)
class Row:
    """One row of the table.

    Attributes
    ----------
    name, work
        As on the command line, and in words.
    target
        Least ratio of REV to the work tree; where ``within`` is given, largest ratio of the work tree.
    within
        What is divided by what in the same build.
    processor
        Whether processor time counts in place of the time on the wall.
    most
        Turns at most: long work needs no many.
    error
        Stated error of a Mueller matrix relative to f00, against ``high`` of REV; None where there are none.
    """

    name: str
    work: str
    target: float | None = None
    within: tuple[str, str] | None = None
    processor: bool = False
    most: int = 1000
    error: float | None = None


_SPLIT = ("split", "single fits")
_PLASTIC = ("pbrdf", "pplastic")
ROWS = (
    Row("sigma-0.1", "full Mueller, σ = 0.1, to 1.3 rad", 5.0, error=1e-5),
    Row("sigma-0.04", "full Mueller, σ = 0.04, to 1.3 rad", 1.8, error=1e-5),
    Row("high", "accuracy high in the wedge, σ = 0.1", 4.0, most=15, error=1e-6),
    Row("visible", "render: visible ÷ weighted, polarised", 3.0, ("visible", "weighted")),
    Row("visible-rgb", "render: visible ÷ weighted, RGB", 3.0, ("visible", "weighted")),
    Row("fits", "4096 fits, 42 geometries, (I, Q, U)", 4.0, most=9),
    Row("intensity", "intensities, 1258 geometries, 64 starts", 6.0, processor=True, most=3),
    Row("split-2", "split of 2 groups ÷ 2 single fits", 2.0, _SPLIT, most=3),
    Row("split-8", "split of 8 groups ÷ 8 single fits", 2.0, _SPLIT, most=2),
    Row("split-20", "split of 20 groups ÷ 20 single fits", 2.0, _SPLIT, most=1),
    Row("command", "pbrdf fit NAME, warm", 2.0, processor=True, most=9),
    Row("command-quiet", "pbrdf fit NAME -q --no-figures", 4.0, processor=True, most=9),
    Row("command-first", "pbrdf fit NAME, no kernels on disk", 1.0 / 0.6, most=5),
    Row("rough", "render: σ = 0.1 ÷ pplastic, polarised", 2.5, _PLASTIC),
    Row("rough-rgb", "render: σ = 0.1 ÷ pplastic, RGB", 2.5, _PLASTIC),
)
#: Where the target is of another build: ``-q --no-figures`` is to take a quarter of what the full command took.
AGAINST = {"command-quiet": "command"}


class WorkerError(Exception):
    """A build did not do what was asked."""


class Worker:
    """The process of one build."""

    def __init__(self, name: str, tree: Path, scratch: Path, options: argparse.Namespace) -> None:
        self.name, self.tree, self.options = name, tree, options
        self.scratch = scratch / name
        self.scratch.mkdir()
        self.process: subprocess.Popen[bytes] | None = None

    def start(self) -> dict[str, Any]:
        """Start the process if it does not run; what it is made of."""
        if self.process is None:
            self.log = (self.scratch / "log.txt").open("ab")
            cache = self.scratch / "cache"
            cache.mkdir(exist_ok=True)
            environment = {
                **os.environ,
                "PYTHONPATH": str(self.tree / "src"),
                "DRJIT_CACHE_DIR": str(cache),
                # what is installed has its bytecode, and so have the commands here
                "PYTHONPYCACHEPREFIX": str(self.scratch / "bytecode"),
                "PYTHONDONTWRITEBYTECODE": "",
            }
            self.process = subprocess.Popen(
                [
                    sys.executable,
                    str(HERE / "versus_worker.py"),
                    str(self.tree),
                    str(self.scratch),
                    "quick" if self.options.quick else "full",
                    str(self.options.threads),
                ],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self.log,
                env=environment,
                # of a group of its own, so that what it started ends with it
                start_new_session=True,
            )
            return self.ask(STARTING, do="versions")
        return {}

    def ask(self, limit: float, **request: Any) -> dict[str, Any]:
        """Send a request and wait for the answer; raises WorkerError."""
        self.start()
        assert self.process is not None and self.process.stdin and self.process.stdout
        try:
            self.process.stdin.write(json.dumps(request).encode() + b"\n")
            self.process.stdin.flush()
            with selectors.DefaultSelector() as selector:
                selector.register(self.process.stdout, selectors.EVENT_READ)
                answered = bool(selector.select(limit))
            line = self.process.stdout.readline() if answered else b""
        except OSError:
            answered, line = True, b""
        if not answered:
            self.stop()
            raise WorkerError(f"no result in {limit:.0f} s")
        if not line:
            self.stop()
            tail = (self.scratch / "log.txt").read_text(errors="replace").strip().splitlines()[-3:]
            raise WorkerError(f"{self.name} ended: {' | '.join(tail)}")
        answer: dict[str, Any] = json.loads(line)
        if "error" in answer:
            raise WorkerError(f"{self.name}: {answer['error']}")
        return answer

    def stop(self) -> None:
        """End the process and what it started."""
        if self.process is not None:
            with suppress(ProcessLookupError):
                os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()
            for pipe in (self.process.stdin, self.process.stdout):
                if pipe:
                    pipe.close()
            self.log.close()
            self.process = None


def git(*arguments: str) -> str:
    """What a git command says; raises WorkerError."""
    done = subprocess.run(["git", "-C", str(TREE), *arguments], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise WorkerError(f"git {' '.join(arguments)}: {done.stderr.strip()}")
    return done.stdout.strip()


@contextmanager
def checked_out(revision: str, folder: Path) -> Iterator[Path]:
    """A work tree of a revision, removed at the end."""
    tree = folder / "base"
    git("worktree", "add", "--detach", "--quiet", str(tree), revision)
    try:
        yield tree
    finally:
        git("worktree", "remove", "--force", str(tree))


def quartiles(values: list[float]) -> tuple[float, float, float]:
    """Median, lower and upper quartile."""
    low, middle, high = np.percentile(values, [25.0, 50.0, 75.0])
    return float(middle), float(low), float(high)


def seconds_of(row: Row, times: dict[str, list[float]]) -> float:
    """Seconds of a turn that count."""
    return sum(values[1 if row.processor else 0] for values in times.values())


def compare(row: Row, workers: dict[str, Worker], turns: int, limit: float) -> dict[str, Any]:
    """Let the builds take turns in one row; what each took, and whether they agree."""
    taken: dict[str, list[dict[str, list[float]]]] = {name: [] for name in workers}
    failed: dict[str, str] = {}
    for turn in range(-1, turns):
        for name in sorted(workers, reverse=turn % 2 == 0):
            if name in failed:
                continue
            try:
                if turn < 0:
                    workers[name].ask(limit, row=row.name, do="prepare")
                times = workers[name].ask(limit, row=row.name, do="turn")["times"]
            except WorkerError as failure:
                failed[name] = str(failure)
                continue
            if turn >= 0:
                taken[name].append(times)
    files = {}
    for name in workers:
        if name not in failed:
            try:
                files[name] = workers[name].ask(limit, row=row.name, do="result")["file"]
            except WorkerError as failure:
                failed[name] = str(failure)
    report: dict[str, Any] = {
        "row": row.name,
        "work": row.work,
        "target": row.target,
        "failed": failed,
        "times": taken,
    }
    whole = {
        name: [seconds_of(row, times) for times in taken[name]] for name in workers if name not in failed
    }
    report["seconds"] = {name: float(np.median(values)) for name, values in whole.items()}
    if row.within:
        over, under = row.within
        report["within"] = {
            name: quartiles([times[over][0] / times[under][0] for times in taken[name]]) for name in whole
        }
        if "this" in whole:
            report["met"] = row.target is None or report["within"]["this"][0] <= row.target
    if len(whole) == 2:
        base, this = whole["base"], whole["this"]
        report["ratio"] = quartiles([b / t for b, t in zip(base, this, strict=True)])
        used = [
            sum(v[1] for v in b.values()) / sum(v[1] for v in t.values())
            for b, t in zip(taken["base"], taken["this"], strict=True)
        ]
        report["processor_ratio"] = float(np.median(used))
        with np.load(files["base"]) as base_result, np.load(files["this"]) as this_result:
            report["differences"], report["agree"] = differences(row, dict(base_result), dict(this_result))
    return report


def differences(row: Row, base: dict[str, Any], this: dict[str, Any]) -> tuple[dict[str, float], bool]:
    """How far the results of two builds lie apart, and whether within what is stated."""
    if row.error is not None:
        error = {
            name: float(
                (np.abs(found["mueller"] - base["high"]).max(axis=(1, 2)) / base["high"][:, 0, 0]).max()
            )
            for name, found in (("error of base", base), ("error of this", this))
        }
        return error, error["error of this"] <= row.error + 1e-6
    if "values" in this:
        known = np.broadcast_to(base["standard errors"], base["values"].shape) > 0.0
        apart = np.abs(this["values"] - base["values"])[known]
        errors = np.broadcast_to(base["standard errors"], base["values"].shape)[known]
        found = {"of standard errors": float((apart / errors).max())}
        agree = found["of standard errors"] <= OF_STANDARD_ERROR
        if "chi2" in this:
            found["gain in χ²"] = float(((base["chi2"] - this["chi2"]) / base["chi2"]).min())
            # a lower χ² is another, better optimum: its parameters need not agree
            agree = found["gain in χ²"] >= -OF_CHI2 and (agree or found["gain in χ²"] > OF_CHI2)
        return found, bool(agree)
    # Stokes parameters other than I and colours are compared on the scale of the first channel
    apart = {name: float(np.abs(this[name] - base[name]).max() / base[name][0]) for name in this}
    return apart, max(apart.values()) <= OF_PICTURE


def memory(trees: dict[str, Path], scratch: Path, quick: bool, limit: float) -> dict[str, str]:
    """What the work tree's ``memory.py`` prints for each build; empty if there is no such script."""
    script = HERE / "memory.py"
    if not script.exists():
        return {}
    printed = {}
    for name, tree in trees.items():
        command = [sys.executable, str(script), *(["--quick"] if quick else [])]
        environment = {**os.environ, "PYTHONPATH": str(tree / "src"), "COLUMNS": "110"}
        try:
            done = subprocess.run(
                command, env=environment, capture_output=True, text=True, check=False, timeout=10.0 * limit
            )
            printed[name] = done.stdout + done.stderr[-1000:]
        except subprocess.TimeoutExpired:
            printed[name] = f"no result in {10.0 * limit:.0f} s"
    return printed


def time_text(seconds: float) -> str:
    """Three digits of a time."""
    return f"{1e3 * seconds:.3g} ms" if seconds < 1.0 else f"{seconds:.3g} s"


def spread_text(values: tuple[float, float, float]) -> str:
    """Median and quartiles."""
    return f"{values[0]:.2f} [{values[1]:.2f} … {values[2]:.2f}]"


def table_of(reports: list[dict[str, Any]]) -> Table:
    """The table of all rows."""
    table = Table(box=SIMPLE_HEAD, padding=(0, 1))
    for heading in ("work", "REV", "this", "REV ÷ this", "processor", "target", "results"):
        left = heading in ("work", "results")
        table.add_column(heading, justify="left" if left else "right", overflow="fold")
    for report in reports:
        cells = {}
        for name in ("base", "this"):
            if name in report["failed"]:
                cells[name] = "no result"
            elif "within" in report:
                cells[name] = f"{spread_text(report['within'][name])}\n{time_text(report['seconds'][name])}"
            else:
                cells[name] = time_text(report["seconds"][name])
        target = ""
        if report["target"] is not None:
            sign = "≤" if "within" in report else "≥"
            target = f"{sign} {report['target']:.3g}"
            if "met" in report:
                target += " met" if report["met"] else " missed"
        told = "; ".join(f"{name} {value:.1e}" for name, value in report.get("differences", {}).items())
        if "agree" in report:
            told = f"{'agree' if report['agree'] else 'DIFFER'}: {told}"
        told = "; ".join([told, *report["failed"].values()]).strip("; ")
        ratio = spread_text(report["ratio"]) if "ratio" in report else ""
        processor = f"{report['processor_ratio']:.2f}" if "processor_ratio" in report else ""
        table.add_row(report["work"], cells["base"], cells["this"], ratio, processor, target, told)
    return table


def judge(reports: list[dict[str, Any]]) -> None:
    """Say which targets are met where a ratio to REV counts."""
    by_name = {report["row"]: report for report in reports}
    for report in reports:
        if "within" in report or "ratio" not in report or report["target"] is None:
            continue
        ratio = report["ratio"][0]
        other = by_name.get(AGAINST.get(report["row"], ""))
        if other and "base" in other["seconds"]:
            # of what the command took with its figures
            ratio = other["seconds"]["base"] / report["seconds"]["this"]
            report["ratio_to_full_command"] = ratio
        report["met"] = ratio >= report["target"]


def main() -> int:
    """Run the comparison; returns the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    names = [*(row.name for row in ROWS), "memory"]
    parser.add_argument("revision", metavar="REV", help="commit, branch or tag to compare with")
    parser.add_argument("--only", nargs="+", choices=names, metavar="ROW", help=f"of {', '.join(names)}")
    parser.add_argument("--turns", type=int, default=15, help="turns a row at most (default 15)")
    parser.add_argument("--quick", action="store_true", help="little work, 2 turns: does it run?")
    parser.add_argument("--threads", type=int, default=0, help="threads of Dr.Jit (default: all)")
    parser.add_argument("--limit", type=float, default=200.0, help="seconds a turn may take (default 200)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all that was measured to this file")
    options = parser.parse_args()
    turns = 2 if options.quick else options.turns
    if turns < 1 or options.limit <= 0.0:
        parser.error("--turns must be at least 1 and --limit positive")
    chosen = options.only or names
    # ended from outside, the temporary work tree goes as well
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    console = Console(width=None if sys.stdout.isatty() else 150)
    reports: list[dict[str, Any]] = []
    machine: dict[str, Any] = {}
    interrupted = False
    try:
        commit = git("rev-parse", "--short", f"{options.revision}^{{commit}}")
        with tempfile.TemporaryDirectory(prefix="pbrdf-versus-") as folder:
            scratch = Path(folder)
            with checked_out(commit, scratch) as base:
                trees = {"base": base, "this": TREE}
                (scratch / "work").mkdir()
                workers = {
                    name: Worker(name, tree, scratch / "work", options) for name, tree in trees.items()
                }
                try:
                    version = {name: worker.start() for name, worker in workers.items()}
                    machine = {
                        "processor": processor(),
                        "cores": os.cpu_count(),
                        "python": platform.python_version(),
                        **version["this"],
                        "REV": commit,
                        "this": git("describe", "--always", "--dirty"),
                    }
                    console.print(", ".join(f"{k} {v}" for k, v in machine.items()), highlight=False)
                    for row in ROWS:
                        if row.name in chosen:
                            console.print(f"{row.work} …", highlight=False, style="dim")
                            reports.append(compare(row, workers, min(turns, row.most), options.limit))
                finally:
                    for worker in workers.values():
                        worker.stop()
                used = memory(trees, scratch, options.quick, options.limit) if "memory" in chosen else {}
    except WorkerError as failure:
        console.print(f"[red]{failure}[/red]")
        return 1
    except KeyboardInterrupt:
        console.print("interrupted; what was measured:")
        interrupted, used = True, {}
    judge(reports)
    if reports:
        console.print(table_of(reports), highlight=False)
    for report in reports:
        if "ratio_to_full_command" in report:
            share = report["ratio_to_full_command"]
            console.print(
                f"{report['work']}: 1/{share:.2f} of REV's command with figures, which the target is of"
            )
    for name, text in used.items():
        console.print(f"memory, {'REV' if name == 'base' else name}:\n{text}", highlight=False, markup=False)
    if options.json is not None:
        told = {"machine": machine, "rows": reports, "memory": used}
        options.json.write_text(json.dumps(told, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    # a base that gives no result in the time allowed is a finding, a work tree that does not is a failure
    wrong = [
        report["work"]
        for report in reports
        if not report.get("agree", True)
        or "this" in report["failed"]
        or any("no result in" not in text for text in report["failed"].values())
    ]
    if wrong:
        console.print(f"[red]Failed, or the builds disagree: {'; '.join(wrong)}[/red]")
    return 130 if interrupted else 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
