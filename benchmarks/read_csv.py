"""Speed of reading CSV tables: ``pbrdf.read`` against ``pandas.read_csv`` of the same file.

    python benchmarks/read_csv.py [--rows N] [--repeat R] [--json FILE]

``pbrdf.read`` gives a checked data set (conventions applied, angles in radians, every value judged), pandas a table of
numbers. Five files: short decimals, full digits, a table as ``pbrdf.write`` writes it, decimal commas between
semicolons, labels and gaps. Values are compared bit for bit with those that ``float`` gives, else the script ends with
status 1 (pandas' own parser rounds the last digit otherwise in some of them). The aim is 4 times pandas for the first
three.

Times are minima over repeats in which both take turns: only the ratio out of one run means anything.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

import pbrdf
from pbrdf.data import make_dataset

AIM = 4.0


def write_files(folder: Path, rows: int) -> dict[str, tuple[Path, dict[str, Any]]]:
    """The files by what is in them, each with pandas' options for it."""
    rng = np.random.default_rng(11)
    theta_i, theta_r = rng.uniform(0, 80, (2, rows)).round(2)
    phi = rng.uniform(-180, 180, rows).round(1)
    I = rng.uniform(0.05, 1.0, rows)  # noqa: E741
    Q, U = I * rng.uniform(-0.4, 0.4, (2, rows))
    names = ("theta_i", "theta_r", "phi", "brdf", "Q", "U")
    plain = pd.DataFrame(dict(zip(names, (theta_i, theta_r, phi, I, Q, U), strict=True)))
    short = plain.round(5)
    labels = short.assign(group=rng.choice(["white", "black", "gold"], rows))
    labels.loc[rng.random(rows) < 0.1, "Q"] = np.nan
    short.to_csv(folder / "short.csv", index=False)
    plain.to_csv(folder / "full.csv", index=False)
    short.to_csv(folder / "commas.csv", index=False, sep=";", decimal=",")
    labels.to_csv(folder / "labels.csv", index=False)
    std = {"I": 0.01 * I, "Q": 0.01 * I, "U": 0.01 * I}
    angles = np.deg2rad([theta_i, theta_r, phi])
    pbrdf.write(make_dataset(*angles, quantity="brdf", I=I, Q=Q, U=U, std=std), folder / "written.csv")
    return {
        "short decimals": (folder / "short.csv", {}),
        "full digits": (folder / "full.csv", {}),
        "as pbrdf writes": (folder / "written.csv", {"comment": "#"}),
        "decimal commas": (folder / "commas.csv", {"sep": ";", "decimal": ","}),
        "labels and gaps": (folder / "labels.csv", {}),
    }


def fastest(calls: list[Callable[[], Any]], repeat: int) -> list[float]:
    """The least time of each call, which take turns."""
    best = [float("inf")] * len(calls)
    for _ in range(repeat):
        for k, call in enumerate(calls):
            begin = time.perf_counter()
            call()
            best[k] = min(best[k], time.perf_counter() - begin)
    return best


def same_bits(path: Path, options: dict[str, Any]) -> bool:
    """Whether the intensities are those of Python's ``float``, line by line."""
    separator, point = options.get("sep", ","), options.get("decimal", ".")
    lines = [line for line in path.read_text().split("\n") if line and not line.startswith("#")]
    names = lines[0].split(separator)
    column = names.index("I" if "I" in names else "brdf")
    wanted = [float(line.split(separator)[column].replace(point, ".")) for line in lines[1:]]
    return np.array_equal(pbrdf.read(path)["I"].values, wanted)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rows", type=int, default=200_000)
    parser.add_argument("--repeat", type=int, default=15)
    parser.add_argument("--json", type=Path, help="write what was measured to this file")
    arguments = parser.parse_args()
    table = Table("file", "MB", "pandas, s", "pbrdf, s", "ratio", box=SIMPLE_HEAD)
    measured = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, (path, options) in write_files(Path(folder), arguments.rows).items():
            if not same_bits(path, options):
                print(f"{name}: not the numbers that float gives", file=sys.stderr)
                return 1
            calls = [lambda p=path, o=options: pd.read_csv(p, **o), lambda p=path: pbrdf.read(p)]
            pandas, own = fastest(calls, arguments.repeat)
            measured[name] = {"pandas_s": pandas, "pbrdf_s": own, "ratio": own / pandas}
            size = path.stat().st_size / 1e6
            table.add_row(name, f"{size:.1f}", f"{pandas:.3f}", f"{own:.3f}", f"{own / pandas:.1f}")
    Console().print(table)
    print(f"{arguments.rows} rows; aim: {AIM:g} times pandas for the first three")
    if arguments.json:
        arguments.json.write_text(json.dumps({"rows": arguments.rows, "files": measured}, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
