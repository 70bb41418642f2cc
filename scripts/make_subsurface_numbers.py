"""Make the oracle of the body of ``germer-subsurface``: Mueller matrices of NIST SCATMECH's subsurface model.

The matrices are those of ``Diffuse_Subsurface_BRDF_Model`` without films, turned to this project's signs by
diag(1, −1, −1, 1) on both sides; the azimuth is the same. SCATMECH integrates the internal reflectance ρ_int
numerically, to about 1e-4: rows of a small R do not depend on it.

Run from the repository's root, in an environment with pySCATMECH 0.1.10 and NumPy:
``python scripts/make_subsurface_numbers.py``.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from pySCATMECH.brdf import BRDF_Model

TARGET = Path(__file__).parents[1] / "tests" / "data_oracle" / "subsurface_scatmech.csv"
INDICES, REFLECTANCES = (1.2, 1.5, 1.6207, 2.5), (1e-6, 0.3, 0.9)
COUNT, SEED = 6, 20000101
SIGNS = np.diag([1.0, -1.0, -1.0, 1.0])


def main() -> None:
    """Write the CSV file."""
    rng = np.random.default_rng(SEED)
    elements = [f"f{i}{j}" for i in range(4) for j in range(4)]
    with TARGET.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["theta_i", "theta_r", "phi", "n", "pigment", *elements])
        for n in INDICES:
            for reflectance in REFLECTANCES:
                model = BRDF_Model(
                    "Diffuse_Subsurface_BRDF_Model",
                    **{
                        "lambda": 0.5,
                        "type": 0,
                        "substrate": f"({n},0)",
                        "reflectance": {None: "Table_Reflectance", "table": f"{reflectance}"},
                        "stack": "No_StackModel",
                    },
                )
                for _ in range(COUNT):
                    theta_i, theta_r = rng.uniform(0.0, 1.5, 2)
                    phi = rng.uniform(-np.pi, np.pi)
                    f = SIGNS @ np.array(model.MuellerBRDF(theta_i, theta_r, phi)) @ SIGNS
                    numbers = (theta_i, theta_r, phi, n, reflectance, *(f.ravel() + 0.0))
                    table.writerow([f"{x:.17g}" for x in numbers])


if __name__ == "__main__":
    main()
