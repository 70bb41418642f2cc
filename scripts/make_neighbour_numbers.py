"""Make the oracle of the facets: Mueller matrices of Mitsuba 3's ``roughconductor``, turned to this project's frames.

The matrices are those of ``BSDF.eval`` over cosθ_i in the variant ``scalar_spectral_polarized``, single precision; the
change of frame is that of the tests of the BSDF plugin (``tests/rendering/bsdf_helpers.py``). Half of the geometries
lie within the lobe, half anywhere up to 75°. Mitsuba's shadowing is Smith's, separable.

Run from the repository's root, with Mitsuba 3.9.1: ``python scripts/make_neighbour_numbers.py``.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import mitsuba as mi
import numpy as np

ROOT = Path(__file__).parents[1]
TARGET = ROOT / "tests" / "data_oracle" / "roughconductor_mitsuba.csv"
#: Index, extinction, α, distribution.
METALS = (
    (1.5, 0.0, 0.1, "beckmann"),
    (0.96, 6.7, 0.3, "beckmann"),
    (1.6, 0.0, 0.05, "ggx"),
    (2.0, 1.5, 0.2, "ggx"),
    (0.2, 3.9, 0.5, "ggx"),
)
COUNT, SEED = 20, 20070625


def main() -> None:
    """Write the CSV file."""
    sys.path.insert(0, str(ROOT / "tests" / "rendering"))
    from bsdf_helpers import D, call, light, to_surface_frames

    mi.set_variant("scalar_spectral_polarized")
    rng = np.random.default_rng(SEED)
    elements = [f"f{i}{j}" for i in range(4) for j in range(4)]
    with TARGET.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["theta_i", "theta_r", "phi", "n", "kappa", "alpha", "distribution", *elements])
        for n, kappa, alpha, distribution in METALS:
            wi = directions(rng, COUNT, 70.0)
            m = np.concatenate([0.7 * alpha * rng.normal(size=(COUNT, 2)), np.ones((COUNT, 1))], -1)
            m /= np.linalg.norm(m, axis=-1, keepdims=True)
            mirrored = 2.0 * np.sum(wi * m, -1, keepdims=True) * m - wi
            anywhere = (np.arange(COUNT) % 2 == 0) | (mirrored[:, 2] < 0.05)
            wo = np.where(anywhere[:, None], directions(rng, COUNT, 75.0), mirrored)
            wo = wo.astype(np.float32).astype(float)
            bsdf = mi.load_dict(
                {
                    "type": "roughconductor",
                    "eta": {"type": "uniform", "value": n},
                    "k": {"type": "uniform", "value": kappa},
                    "alpha": alpha,
                    "distribution": distribution,
                }
            )
            matrices = to_surface_frames(call(mi, bsdf.eval, wi, wo)[:, 0], wi, wo)
            matrices = D @ matrices @ D / wo[:, 2, None, None]
            for angles, f in zip(np.stack(light(wi, wo), -1), matrices, strict=True):
                numbers = [f"{x:.17g}" for x in angles]
                table.writerow([*numbers, n, kappa, alpha, distribution, *(f"{x:.8g}" for x in f.ravel())])


def directions(rng: np.random.Generator, count: int, largest: float) -> np.ndarray:
    """Unit vectors in single precision, zenith angles uniform to ``largest`` degrees."""
    theta, phi = np.radians(rng.uniform(1.0, largest, count)), rng.uniform(0.0, 2.0 * np.pi, count)
    v = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)
    return v.astype(np.float32).astype(float)


if __name__ == "__main__":
    main()
