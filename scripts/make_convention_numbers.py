"""Make the oracle of ``pbrdf.convert``: Mueller matrices as other programs give them, in their own conventions.

Elements are polarisers and retarders at an angle, reflections are off a bare flat surface. Angles of the table are
degrees, the index is n − iκ whatever the program wants.

Run from the repository's root with the names of programs, each in an environment that holds it at the version named
below: ``python scripts/make_convention_numbers.py katsu pypolar``. The rows of the others stay as they are.
"""

from __future__ import annotations

import csv
import importlib.metadata
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

TARGET = Path(__file__).parents[1] / "tests" / "data_oracle" / "conventions.csv"
VERSIONS = {
    "katsu": "0.1.0",
    "polanalyser": "3.0.0",
    "pypolar": "1.2.0",
    "pyElli": "0.23.1",
    "pySCATMECH": "0.1.10",
    "mitsuba": "3.9.1",
}
COLUMNS = ["program", "version", "what", "angle", "retardance", "n", "kappa", "R"]
ELEMENTS = [f"m{i}{j}" for i in range(4) for j in range(4)]
#: Angle and retardance in degrees: no symmetry, both signs, more than half a turn.
RETARDERS = ((20.0, 50.0), (-35.0, 90.0), (70.0, 250.0))
POLARISERS = (20.0, -35.0, 100.0)
#: Angle of incidence in degrees, n, κ: gold on both sides of the principal angle, an absorber, glass on both sides of
#: Brewster's angle.
SURFACES = (
    (30.0, 0.47, 2.83),
    (70.0, 0.47, 2.83),
    (75.0, 0.47, 2.83),
    (60.0, 1.5, 0.5),
    (40.0, 1.5, 0.0),
    (70.0, 1.5, 0.0),
)
#: What, angle, retardance, n, κ, R, matrix.
Row = tuple[str, Any, Any, Any, Any, Any, np.ndarray]


def elements(polariser: Any, retarder: Any) -> Iterator[Row]:
    """Rows of the elements of functions of the angle, and of angle and retardance, in radians."""
    for angle in POLARISERS:
        yield "polariser", angle, "", "", "", "", polariser(np.deg2rad(angle))
    for angle, retardance in RETARDERS:
        yield "retarder", angle, retardance, "", "", "", retarder(np.deg2rad(angle), np.deg2rad(retardance))


def katsu() -> Iterator[Row]:
    """Its elements."""
    from katsu import mueller

    yield from elements(mueller.linear_polarizer, mueller.linear_retarder)


def polanalyser() -> Iterator[Row]:
    """Its elements."""
    import polanalyser

    yield from elements(polanalyser.polarizer, lambda angle, delta: polanalyser.retarder(delta, angle))


def pypolar() -> Iterator[Row]:
    """Its elements, and its reflection of Mueller matrices, which wants n − iκ."""
    from pypolar import mueller

    yield from elements(mueller.op_linear_polarizer, mueller.op_retarder)
    for angle, n, kappa in SURFACES:
        matrix = mueller.op_fresnel_reflection(complex(n, -kappa), np.deg2rad(angle))
        yield "reflection", angle, "", n, kappa, "", matrix


def pyelli() -> Iterator[Row]:
    """Its reflection, which wants n + iκ and divides by M00, and its reflectance."""
    import elli

    for angle, n, kappa in SURFACES:
        medium = elli.IsotropicMaterial(elli.ConstantRefractiveIndex(n=complex(n, kappa)))
        result = elli.Structure(elli.AIR, [], medium).evaluate(np.array([500.0]), angle)
        yield "reflection", angle, "", n, kappa, float(result.R[0]), result.mueller_matrix[0]


def pyscatmech() -> Iterator[Row]:
    """Its elements; ``MuellerPolarizer`` takes the least transmittance, 0 by default."""
    from pySCATMECH.mueller import MuellerPolarizer, MuellerRetarder

    yield from elements(
        lambda angle: MuellerPolarizer(angle=angle),
        lambda angle, delta: MuellerRetarder(phase=delta, angle=angle),
    )


def mitsuba() -> Iterator[Row]:
    """Its functions of Mueller matrices, single precision; x is s of the surface."""
    import mitsuba as mi

    mi.set_variant("scalar_spectral_polarized")
    m = mi.mueller
    yield from elements(
        lambda angle: m.rotated_element(angle, m.linear_polarizer()),
        lambda angle, delta: m.rotated_element(angle, m.linear_retarder(delta)),
    )
    for angle, n, kappa in SURFACES:
        matrix = m.specular_reflection(np.cos(np.deg2rad(angle)), mi.Complex2f(n, kappa))
        yield "reflection", angle, "", n, kappa, "", matrix


ROWS = {
    "katsu": katsu,
    "polanalyser": polanalyser,
    "pypolar": pypolar,
    "pyElli": pyelli,
    "pySCATMECH": pyscatmech,
    "mitsuba": mitsuba,
}


def main(programs: list[str]) -> None:
    """Write the rows of the named programs anew."""
    rows = []
    if TARGET.exists():
        with TARGET.open(newline="", encoding="utf-8") as file:
            rows = [row for row in list(csv.reader(file))[1:] if row[0] not in programs]
    for program in programs:
        version = importlib.metadata.version(program)
        if version != VERSIONS[program]:
            raise SystemExit(f"{program} {VERSIONS[program]} is wanted, {version} is here")
        for *known, matrix in ROWS[program]():
            values = np.asarray(matrix, dtype=float).ravel() + 0.0
            rows.append([program, version, *map(str, known), *(f"{x:.15g}" for x in values)])
    rows.sort(key=lambda row: list(VERSIONS).index(row[0]))
    with TARGET.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows([[*COLUMNS, *ELEMENTS], *rows])


if __name__ == "__main__":
    main(sys.argv[1:])
