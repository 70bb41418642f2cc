"""Make the oracle of ``pbrdf.lu_chipman``: Mueller matrices and their factors as katsu finds them, in its convention.

Only matrices that katsu decomposes rightly: with diattenuation below 1 and with a positive determinant. Each is
transmittance · depolariser · two retarders · diattenuator, so that the retarder is elliptic.

Run from the repository's root in an environment that holds katsu 0.1.0:
``python scripts/make_decomposition_numbers.py``.
"""

from __future__ import annotations

import csv
import importlib.metadata
from pathlib import Path

import numpy as np
from katsu import mueller

TARGET = Path(__file__).parents[1] / "tests" / "data_oracle" / "decompositions.csv"
VERSION = "0.1.0"
#: Transmittance; angle of the depolariser and what it leaves of Q, U, V; angle and retardance of both retarders; angle
#: and least transmittance of the diattenuator. Degrees.
CASES = (
    (1.0, (0.0, 1.0, 1.0, 1.0), (20.0, 50.0), (0.0, 0.0), (35.0, 0.5)),
    (0.4, (0.0, 1.0, 1.0, 1.0), (20.0, 90.0), (65.0, 40.0), (-20.0, 0.1)),
    (1.0, (15.0, 0.9, 0.7, 0.5), (-35.0, 120.0), (10.0, 25.0), (70.0, 0.3)),
    (0.05, (-50.0, 0.4, 0.3, 0.6), (80.0, 170.0), (0.0, 0.0), (5.0, 0.9)),
    (2.0, (30.0, 0.1, 0.05, 0.02), (45.0, 15.0), (-60.0, 75.0), (100.0, 0.02)),
)
ELEMENTS = [f"m{i}{j}" for i in range(4) for j in range(4)]


def main() -> None:
    """Write the table."""
    version = importlib.metadata.version("katsu")
    if version != VERSION:
        raise SystemExit(f"katsu {VERSION} is wanted, {version} is here")
    rows = []
    for case, (transmittance, (turn, *left), first, second, (angle, least)) in enumerate(CASES):
        retarders = (mueller.linear_retarder(*np.deg2rad(pair)) for pair in (first, second))
        matrix = transmittance * mueller.depolarizer(np.deg2rad(turn), *left)
        for element in (*retarders, mueller.linear_diattenuator(np.deg2rad(angle), least)):
            matrix = matrix @ element
        depolarizer, retarder, diattenuator = mueller.decompose_depolarizer(matrix, return_all=True)
        found = {
            "matrix": (matrix, mueller.diattenuation_from_mueller(matrix)),
            "depolarizer": (depolarizer, ""),
            "retarder": (retarder, mueller.retardance_from_mueller(retarder)),
            "diattenuator": (diattenuator, ""),
        }
        for what, (values, scalar) in found.items():
            number = scalar if scalar == "" else f"{float(scalar):.15g}"
            cells = (f"{x:.15g}" for x in np.round(np.asarray(values, dtype=float), 14).ravel() + 0.0)
            rows.append([version, str(case), what, number, *cells])
    with TARGET.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows(
            [["version", "case", "what", "number", *ELEMENTS], *rows]
        )


if __name__ == "__main__":
    main()
