"""Identification of measured coatings: what comes out, whatever it is.

Two automotive coatings (Cornell, ``acryl_blue`` and ``mystique``: intensities at 31 wavelengths, each taken for a
specimen) and the two reference paints of a thermal-infrared goniometer (``mwir-paint``, one band: each position of the
camera is a measurement). Of each wavelength, the incidences 10°, 30°, 50° and 70° give the specimen of the library (its
fit of the double-Gauss model), and 20°, 40° and 60° a measurement to identify; of the infrared paints every other
position of the camera. Wavelengths take turns in what they are for: library, calibration, test. The intensities are
absolute; their noise is stated as NOISE of the value, which is what the model misses by.

Usage: ``python benchmarks/identification_real.py DATA [--json FILE]`` with the folder of the measured data.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

import pbrdf
from pbrdf.identification.identify import calibrate_library, identify
from pbrdf.identification.library import Library
from pbrdf.identification.material import material_from_fits

NOISE, STARTS = "0.1,0.0005", 16
AUTOMOTIVE = ("acryl_blue", "mystique")
INFRARED = {"reference_paint_rough": "infrared, rough", "reference_paint_smooth": "infrared, smooth"}
LIBRARY_INCIDENCE, TEST_INCIDENCE = (10, 30, 50, 70), (20, 40, 60)


def thinned(data: xr.Dataset, count: int) -> xr.Dataset:
    """Evenly few geometries: neighbours tell the same and share the model's error."""
    return data.isel(
        geometry=np.linspace(0, data.sizes["geometry"] - 1, min(count, data.sizes["geometry"])).astype(int)
    )


def automotive(data: Path, name: str) -> tuple[list[xr.Dataset], list[xr.Dataset]]:
    """Measurements for the library and to identify, one of each for every wavelength."""
    whole = pbrdf.read(data / "cornell-automotive" / f"{name}.brdf")
    groups = whole["group"].values.astype(int)
    low = np.degrees(whole["theta_r"].values) < 75.0
    found: tuple[list[xr.Dataset], list[xr.Dataset]] = ([], [])
    for wavelength in np.unique(whole["wavelength"].values):
        for incidence, part in zip((LIBRARY_INCIDENCE, TEST_INCIDENCE), found, strict=True):
            chosen = (whole["wavelength"].values == wavelength) & np.isin(groups, incidence) & low
            part.append(thinned(whole.isel(geometry=np.flatnonzero(chosen)), 120))
    return found


def infrared(data: Path, material: str) -> tuple[list[xr.Dataset], list[xr.Dataset]]:
    """Positions of the camera for the library (taken together) and to identify."""
    import pandas as pd

    table = pd.read_csv(data / "mwir-paint" / "mwir_brdf_inplane.csv")
    # the source grazes, or what comes back is noise (README of the data)
    kept = table[(table.material == material) & (table.theta_i_deg < 75) & (table.theta_o_deg < 75)]
    kept = kept[(kept.L_o >= 0.03) & kept.f_r_per_sr.notna() & (kept.f_r_per_sr > 0)]
    positions = np.unique(kept.theta_o_deg)

    def of(chosen: Sequence[float]) -> xr.Dataset:
        rows = kept[kept.theta_o_deg.isin(chosen)]
        return pbrdf.make_dataset(
            np.radians(rows.theta_i_deg.to_numpy(float)),
            np.radians(rows.theta_o_deg.to_numpy(float)),
            np.zeros(len(rows)),
            quantity="brdf",
            I=rows.f_r_per_sr.to_numpy(float),
        )

    return [thinned(of(positions[::2]), 120)], [thinned(of([p]), 60) for p in positions[1::2]]


def main() -> int:
    """Run and print what came out."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("data", type=Path, help="folder of the measured data")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the numbers there")
    options = parser.parse_args()
    library, calibration, test = Library(()), [], []
    sources = [(name, automotive(options.data, name)) for name in AUTOMOTIVE]
    sources += [(title, infrared(options.data, name)) for name, title in INFRARED.items()]
    for name, (known, asked) in sources:
        fits = [pbrdf.fit(one, noise=NOISE, starts=STARTS) for one in known[::3] or known]
        settled = [fit for fit in fits if fit.settled]
        library = library.with_material(material_from_fits(name, settled))
        spread = np.sqrt(np.diag(library[name].covariance))
        print(f"{name}: {len(settled)} of {len(fits)} specimens, scatter of unknowns {np.round(spread, 3)}")
        if len(known) > 1:
            calibration += [(name, one) for one in asked[1::3]]
            test += [(name, one) for one in asked[2::3]]
        else:
            calibration += [(name, one) for one in asked[::2]]
            test += [(name, one) for one in asked[1::2]]
    calibrated = calibrate_library(library, calibration, noise=NOISE)
    rows: list[dict[str, Any]] = []
    for title, used in (("χ² of the stated noise", library), ("calibrated", calibrated)):
        found = [(name, identify(one, used, noise=NOISE)) for name, one in test]
        for name in library.names:
            own = [f for n, f in found if n == name]
            rows.append(
                {
                    "sets": title,
                    "material": name,
                    "measurements": len(own),
                    "most probable": float(np.mean([f.candidates[0].name == name for f in own])),
                    "in the set": float(np.mean([name in f.materials for f in own])),
                    "set size": float(np.mean([len(f.materials) for f in own])),
                    "none of these": float(np.mean([f.none_of_these for f in own])),
                    "probability": float(np.mean([f[name].probability for f in own])),
                    "distance / degrees of freedom": float(
                        np.median([f[name].distance / f.degrees_of_freedom for f in own])
                    ),
                }
            )
    table = Table(box=SIMPLE_HEAD, padding=(0, 1))
    for heading in rows[0]:
        table.add_column(heading, justify="left" if heading in ("sets", "material") else "right")
    for row in rows:
        table.add_row(*(f"{v:.2f}" if isinstance(v, float) else str(v) for v in row.values()))
    Console(width=150).print(table, highlight=False)
    if options.json is not None:
        options.json.write_text(json.dumps(rows, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
