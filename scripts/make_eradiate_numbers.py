"""Make the oracles of ``rpv-hot-spot`` (its body) and ``maignan-2009`` (its facets): matrices of eradiate's Mitsuba.

The matrices are those of the plugins ``rpv`` and ``maignan`` in double precision, turned to this project's frames by
the tests' own change of frame (``tests/rendering/bsdf_helpers.py``). ``rpv`` gives f cosθ_i; ``maignan`` of this
version gives the reflectance factor πf, without the cosine, and is divided by π here. Surroundings of index 1.

Run from the repository's root, in an environment with eradiate-mitsuba 0.5.0 (in the place of Mitsuba), NumPy and
pytest: ``python scripts/make_eradiate_numbers.py``.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import mitsuba as mi
import numpy as np

ROOT = Path(__file__).parents[1]
TARGET = ROOT / "tests" / "data_oracle"
#: ρ_0, k, Θ, ρ_c: eradiate's default grassland, and soils and plants of the literature with and without hot spot.
BODIES = ((0.183, 0.78, -0.1, 0.183), (0.072, 0.668, -0.257, 0.072), (0.3, 1.2, 0.3, 1.0))
#: C, NDVI, n.
LANDS = ((5.0, 0.8, 1.5), (2.1, 0.0, 1.33))
COUNT, SEED = 20, 19930101


def main() -> None:
    """Write the CSV files."""
    sys.path.insert(0, str(ROOT / "tests" / "rendering"))
    mi.set_variant("scalar_mono_polarized_double")
    rng = np.random.default_rng(SEED)

    def rpv(rho_0: float, k: float, asymmetry: float, rho_c: float) -> dict[str, object]:
        return {"type": "rpv", "rho_0": rho_0, "k": k, "g": asymmetry, "rho_c": rho_c}

    def maignan(C: float, ndvi: float, n: float) -> dict[str, object]:
        return {"type": "maignan", "C": C, "ndvi": ndvi, "refr_re": n, "refr_im": 0.0, "ext_ior": 1.0}

    write(rng, "rpv_eradiate.csv", ("rho_0", "k", "asymmetry", "rho_c"), BODIES, rpv, lambda cosine: cosine)
    write(rng, "maignan_eradiate.csv", ("C", "ndvi", "n"), LANDS, maignan, lambda cosine: np.pi + 0 * cosine)


def write(
    rng: np.random.Generator,
    name: str,
    columns: Sequence[str],
    cases: Sequence[tuple[float, ...]],
    plugin: Callable[..., dict[str, object]],
    factor: Callable[[np.ndarray], np.ndarray],
) -> None:
    """Write the matrices of one plugin; ``factor`` of cosθ_i is what it multiplies the BRDF by."""
    from bsdf_helpers import D, call, light, to_surface_frames

    elements = [f"f{i}{j}" for i in range(4) for j in range(4)]
    with (TARGET / name).open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["theta_i", "theta_r", "phi", *columns, *elements])
        for case in cases:
            wi, wo = directions(rng), directions(rng)
            # a quarter within the hot spot
            wo[::4] = wi[::4] + 0.1 * rng.normal(size=wi[::4].shape)
            wo[:, 2] = np.abs(wo[:, 2])
            wo /= np.linalg.norm(wo, axis=-1, keepdims=True)
            found = to_surface_frames(call(mi, mi.load_dict(plugin(*case)).eval, wi, wo)[:, 0], wi, wo)
            found = D @ found @ D / factor(wo[:, 2])[:, None, None] + 0.0
            for angles, f in zip(np.stack(light(wi, wo), -1), found, strict=True):
                table.writerow([f"{x:.17g}" for x in (*angles, *case, *f.ravel())])


def directions(rng: np.random.Generator) -> np.ndarray:
    """Unit vectors, zenith angles uniform from 1° to 85°."""
    theta, phi = np.radians(rng.uniform(1.0, 85.0, COUNT)), rng.uniform(0.0, 2.0 * np.pi, COUNT)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)


if __name__ == "__main__":
    main()
