"""Speed of full-Mueller evaluation: pbrdf against NumPy and C++ with the same quadrature.

    python benchmarks/evaluation.py [--count N] [--repeat R] [--quick] [--json FILE]

Measured is the time for the 4 x 4 Mueller matrices (float64, in and out as NumPy arrays) of random
out-of-plane geometries, in three cases. pbrdf is timed warm, with its kernel compiled and in memory; the
first call in a fresh process is reported apart, once with an empty kernel cache (the kernel is compiled) and
once with the kernel on disk.

The peers, in ``benchmarks/peers/``, are a vectorised, blocked NumPy implementation in one process and a
straightforward C++ program (plain loops, ``g++ -O3 -march=native -ffast-math -fopenmp``) on as many threads
as pbrdf uses. The latter comes in two variants: as most people write it, with an early return for hidden
facets, and "branchless", without it, which lets g++ vectorise the loop over the facets. The peers are written
from the equations, apart from pbrdf's code, and use the same quadrature. All must agree to 1e-9 of f00, else
the script ends with status 1.

What a user would take instead is timed too, ``peers/other_models.py``: Mitsuba's ``roughconductor`` and ``pplastic``
through ``llvm_ad_mono_polarized`` where Mitsuba is installed, SCATMECH's shadowed facets where pySCATMECH is
(``pip install pySCATMECH``). These are other models, Mitsuba's in single precision: the cost of a direction is all that
is compared. SCATMECH's facets are pbrdf's specular part and must agree with it to 1e-6 of f00.

Times are minima over interleaved repeats. They depend on the machine (vector units, cores, memory) and on
what else it is doing: only ratios out of one and the same run mean anything, and they too differ between
machines.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import math
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from shutil import which
from typing import Any

import numpy as np
from machine import processor
from peers import double_gauss_numpy as numpy_peer
from peers.other_models import mitsuba_peers, scatmech_peer
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from pbrdf.backend import get_backend, llvm_version, thread_count
from pbrdf.models.double_gauss import DoubleGauss
from pbrdf.optics import quadrature

HERE = Path(__file__).resolve().parent
TOLERANCE = 1e-9
FLAGS = ["-O3", "-march=native", "-ffast-math", "-fopenmp", "-std=c++17", "-shared", "-fPIC"]
#: Variants of the C++ program: the name of the library and further flags.
VARIANTS = {
    "C++": ("double_gauss", []),
    "C++, branchless": ("double_gauss_branchless", ["-DBRANCHLESS"]),
}
#: Matte white, thick, of the paper's Table 1.
PAINT = numpy_peer.Paint(sigma=0.0398, n=1.6207, a=1.5174, k=1.2504, b=0.1827, t=0.6717)

Function = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Case:
    """One measurement: the paint's slope deviation, and the largest zenith angle in radians.

    ``aims`` are the ratios aimed at, by peer.
    """

    name: str
    sigma: float
    largest: float
    aims: dict[str, float] = field(default_factory=dict)


CASES = (
    Case("matte white paint, to 1.3 rad", PAINT.sigma, 1.3, {"NumPy": 30.0, "C++": 7.0}),
    Case("σ = 0.1, to 1.3 rad", 0.1, 1.3),
    Case("matte white paint, to 85°", PAINT.sigma, math.radians(85.0)),
)


class Parameters(ctypes.Structure):
    """``Paint`` of the C++ program."""

    _fields_ = [(name, ctypes.c_double) for name in numpy_peer.Paint._fields]


class RuleStructure(ctypes.Structure):
    """``Rule`` of the C++ program."""

    _fields_ = [
        (name, ctypes.c_int64 if name in ("half", "four", "two") else ctypes.c_double)
        for name in numpy_peer.Rule._fields
    ]


def default_rule() -> numpy_peer.Rule:
    """Quadrature of pbrdf's default accuracy, for the peers."""
    rule = quadrature.ACCURACIES["default"]
    return numpy_peer.Rule(
        *rule.clear,
        rule.far,
        rule.rough,
        *quadrature.CARE[0],
        *quadrature.CARE[1],
        rule.step,
        rule.half,
        rule.across.count(4) - 1,
        rule.across.count(4) + rule.across.count(2) - 1,
    )


def compile_peers() -> tuple[dict[str, Any], str]:
    """Compile and load the variants of the C++ program; returns them by name and the compiler's version."""
    compiler = which("g++")
    if compiler is None:
        return {}, "no g++ on this machine, C++ left out"
    (HERE / "build").mkdir(exist_ok=True)
    loaded = {}
    for name, (stem, extra) in VARIANTS.items():
        library = HERE / "build" / f"lib{stem}.so"
        command = [compiler, *FLAGS, *extra, str(HERE / "peers" / "double_gauss.cpp"), "-o", str(library)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            return {}, f"g++ failed, C++ left out: {done.stderr.strip()}"
        loaded[name] = ctypes.CDLL(str(library)).double_gauss_mueller
        loaded[name].restype = None
    version = subprocess.run([compiler, "-dumpfullversion"], capture_output=True, text=True, check=False)
    return loaded, f"g++ {version.stdout.strip()} {' '.join(FLAGS[:4])}"


def cpp_function(library: Any, paint: numpy_peer.Paint, rule: numpy_peer.Rule, threads: int) -> Function:
    """Wrap the C++ program for one paint."""
    parameters, rules = Parameters(*paint), RuleStructure(*rule)

    def pointer(array: np.ndarray) -> Any:
        return array.ctypes.data_as(ctypes.c_void_p)

    def function(theta_i: np.ndarray, theta_r: np.ndarray, phi: np.ndarray) -> np.ndarray:
        result = np.empty((theta_i.size, 4, 4))
        library(
            ctypes.c_int64(theta_i.size),
            *(pointer(angle) for angle in (theta_i, theta_r, phi)),
            ctypes.byref(parameters),
            ctypes.byref(rules),
            ctypes.c_int(threads),
            pointer(result),
        )
        return result

    return function


def timed(function: Function, angles: tuple[np.ndarray, ...]) -> tuple[float, np.ndarray]:
    """Time one call in seconds."""
    start = time.perf_counter()
    result = function(*angles)
    return time.perf_counter() - start, result


def random_geometries(count: int, largest: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Zenith angles uniform to ``largest``, azimuths uniform around; always the same ones."""
    random = np.random.default_rng(20170711)
    theta_i, theta_r = random.uniform(0.0, largest, (2, count))
    return theta_i, theta_r, random.uniform(0.0, 2.0 * math.pi, count)


def first_call(case: Case, count: int) -> float:
    """Time the first call of a process in seconds."""
    model = DoubleGauss(**PAINT._replace(sigma=case.sigma)._asdict())
    get_backend()
    return timed(model.mueller, random_geometries(count, case.largest))[0]


def first_calls(case: Case, count: int) -> dict[str, float]:
    """Time the first call in fresh processes, with an empty and with a filled kernel cache on disk."""
    command = [sys.executable, __file__, "--first-call", str(CASES.index(case)), "--count", str(count)]
    with tempfile.TemporaryDirectory() as directory:
        environment = {**os.environ, "DRJIT_CACHE_DIR": directory}
        seconds = [
            float(subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout)
            for _ in range(2)
        ]
    return {"kernel compiled": seconds[0], "kernel from disk": seconds[1]}


def measure(case: Case, count: int, repeat: int, peers: dict[str, Any], threads: int) -> dict[str, Any]:
    """Run one case: check that the implementations agree, then time them in turn."""
    rule = default_rule()
    paint = PAINT._replace(sigma=case.sigma)
    model = DoubleGauss(**paint._asdict())
    functions: dict[str, Function] = {
        "pbrdf": model.mueller,
        "NumPy": lambda *angles: numpy_peer.mueller(*angles, paint, rule),
    }
    functions |= {name: cpp_function(peer, paint, rule, threads) for name, peer in peers.items()}
    angles = random_geometries(count, case.largest)

    reference = model.mueller(*angles)
    difference = {}
    for name, function in functions.items():
        if name != "pbrdf":
            relative = np.abs(function(*angles) - reference).max(axis=(1, 2)) / reference[:, 0, 0]
            difference[name] = float(relative.max())
    del reference, relative

    seconds: dict[str, list[float]] = {name: [] for name in functions}
    for _ in range(repeat):
        for name, function in functions.items():
            # the fast ones run several times in a row: the first finds the caches full of another's data
            for _ in range(1 if name == "NumPy" else 3):
                seconds[name].append(timed(function, angles)[0])
    best = {name: min(values) for name, values in seconds.items()}
    farther = np.maximum(angles[0], angles[1])
    return {
        "case": case.name,
        "sigma": case.sigma,
        "largest_zenith_rad": case.largest,
        "count": count,
        "wedge_share": float(np.mean(1.0 / np.tan(farther) <= rule.clear_26 * case.sigma)),
        "first_call_s": first_calls(case, count),
        "threads": {name: 1 if name == "NumPy" else threads for name in functions},
        "best_s": best,
        "median_s": {name: float(np.median(values)) for name, values in seconds.items()},
        "ratio": {name: best[name] / best["pbrdf"] for name in functions if name != "pbrdf"},
        "aim": case.aims,
        "difference": difference,
        "agree": all(value <= TOLERANCE for value in difference.values()),
    }


def measure_others(count: int, repeat: int) -> dict[str, Any]:
    """Time other models in turn with pbrdf's ``mueller``; seconds a direction, and how far SCATMECH is off."""
    model = DoubleGauss(**PAINT._asdict())
    angles = random_geometries(count, 1.3)
    functions: dict[str, Callable[[], Any]] = {"pbrdf mueller()": lambda: model.mueller(*angles)}
    functions |= mitsuba_peers(model, angles)
    counts = dict.fromkeys(functions, count)
    difference = None
    if (scatmech := scatmech_peer(model)) is not None:
        few = [angle[: min(count, 20_000)] for angle in angles]
        functions["SCATMECH facets"] = lambda: scatmech(*few)
        counts["SCATMECH facets"] = few[0].size
        # where the lobe is not yet 0
        facets = model.mueller(*few, part="specular")
        seen = facets[:, 0, 0] > 1e-12 * facets[:, 0, 0].max()
        apart = np.abs(scatmech(*few) - facets).max(axis=(1, 2))
        difference = float((apart[seen] / facets[seen, 0, 0]).max())
    for function in functions.values():
        function()
    seconds: dict[str, list[float]] = {name: [] for name in functions}
    for _ in range(repeat):
        for name, function in functions.items():
            for _ in range(1 if name == "SCATMECH facets" else 3):
                start = time.perf_counter()
                function()
                seconds[name].append((time.perf_counter() - start) / counts[name])
    return {
        "count": counts,
        "best_s_a_direction": {name: min(values) for name, values in seconds.items()},
        "median_s_a_direction": {name: float(np.median(values)) for name, values in seconds.items()},
        "scatmech_difference": difference,
        "agree": difference is None or difference <= 1e-6,
    }


def show_others(console: Console, others: dict[str, Any]) -> None:
    """Print what other models cost."""
    table = Table(title="Other models, cost of a direction", title_justify="left", title_style="bold")
    table.box, table.padding = SIMPLE_HEAD, (0, 1)
    for heading in ("", "precision", "threads", "directions", "ns each", "÷ pbrdf"):
        table.add_column(heading, justify="right" if heading not in ("", "precision") else "left")
    best = others["best_s_a_direction"]
    for name, seconds in best.items():
        double = name in ("pbrdf mueller()", "SCATMECH facets")
        table.add_row(
            name,
            "double" if double else "single",
            "1" if name == "SCATMECH facets" else "all",
            str(others["count"][name]),
            f"{1e9 * seconds:.0f}",
            f"{seconds / best['pbrdf mueller()']:.2f}x",
        )
    console.print(table)
    if others["scatmech_difference"] is not None:
        console.print(f"SCATMECH against pbrdf's specular part: {others['scatmech_difference']:.1e} of f00\n")


def show(console: Console, results: list[dict[str, Any]]) -> None:
    """Print a table for each case."""
    for result in results:
        table = Table(
            title=f"{result['case']}: {result['count']} directions, "
            f"{100.0 * result['wedge_share']:.0f} % in the wedge",
            title_justify="left",
            title_style="bold",
            box=SIMPLE_HEAD,
            padding=0,
        )
        table.add_column("", no_wrap=True, width=16)
        for column, width in (
            ("min ms", 7),
            ("median", 7),
            ("ns each", 8),
            ("÷ pbrdf", 8),
            ("aim", 13),
            ("max|Δ|/f00", 11),
        ):
            table.add_column(column, justify="right", no_wrap=True, width=width)
        for name, best in result["best_s"].items():
            ratio, aim = result["ratio"].get(name), result["aim"].get(name)
            difference = result["difference"].get(name)
            table.add_row(
                name,
                f"{1e3 * best:.1f}",
                f"{1e3 * result['median_s'][name]:.1f}",
                f"{1e9 * best / result['count']:.0f}",
                "" if ratio is None else f"{ratio:.1f}x",
                "" if aim is None else f"≥ {aim:g}x {'met' if ratio >= aim else 'missed'}",
                "" if difference is None else f"{difference:.1e}",
            )
        console.print(table)
        first = ", ".join(f"{1e3 * s:.0f} ms ({how})" for how, s in result["first_call_s"].items())
        console.print(f"pbrdf's first call in a process: {first}\n", highlight=False)


def main() -> int:
    """Run the benchmark; returns the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=10**6, help="directions a call (default 10⁶)")
    parser.add_argument("--repeat", type=int, default=5, help="rounds over the implementations (default 5)")
    parser.add_argument("--quick", action="store_true", help="20000 directions, 2 rounds: a check")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all results to this file")
    parser.add_argument("--first-call", type=int, metavar="CASE", help=argparse.SUPPRESS)
    options = parser.parse_args()
    count, repeat = (20_000, 2) if options.quick else (options.count, options.repeat)
    if count < 1 or repeat < 1:
        parser.error("--count and --repeat must be at least 1")
    if options.first_call is not None:
        print(first_call(CASES[options.first_call], count))
        return 0

    console = Console()
    backend = get_backend()
    peers, compiler = compile_peers()
    threads = thread_count() if backend.name == "llvm" else os.cpu_count() or 1
    version = llvm_version()
    machine = {
        "processor": processor(),
        "cores": os.cpu_count(),
        "threads": threads,
        "backend": backend.name,
        "llvm": ".".join(map(str, version)) if version else "unknown",
        "numpy": np.__version__,
        "python": platform.python_version(),
        "compiler": compiler,
    }
    console.print(", ".join(f"{key} {value}" for key, value in machine.items()), highlight=False)
    results = [measure(case, count, repeat, peers, threads) for case in CASES]
    show(console, results)
    others = measure_others(count, repeat)
    show_others(console, others)
    if options.json is not None:
        report = {"machine": machine, "tolerance": TOLERANCE, "cases": results, "other_models": others}
        options.json.write_text(json.dumps(report, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    if not all(result["agree"] for result in results):
        console.print(f"[red]The implementations differ by more than {TOLERANCE:g} of f00.[/red]")
        return 1
    if not others["agree"]:
        console.print("[red]SCATMECH and pbrdf's specular part differ by more than 1e-6 of f00.[/red]")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
