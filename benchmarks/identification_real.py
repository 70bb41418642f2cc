"""Identification of measured coatings: what comes out, whatever it is.

Two automotive coatings (Cornell, ``acryl_blue`` and ``mystique``: intensities at 31 wavelengths, each taken for a
specimen) and the two reference paints of a thermal-infrared goniometer (``mwir-paint``, one band: each position of the
camera is a measurement). Of each wavelength, the incidences 10°, 30°, 50° and 70° give the specimen of the library, and
20°, 40° and 60° a measurement to identify each; of the infrared paints every other position of the camera. Wavelengths
take turns in what they are for: library, calibration, test. The infrared paints have too few positions to calibrate
with: theirs are all tests, and their sets those by χ².

Each material has the model that ``pbrdf compare`` ranks first on the library's data of its brightest specimen. The
noise of a measurement is what the library's fits miss by: a part of the intensity where it is bright, and an absolute
part from where it is dark, pooled over all fits and so too small for the material that is described worst. Neighbours
share the error of a model, so that a measurement is a few geometries only. Rows: intensities as they are, and their
shape only (gain not known); sets by χ² of that noise, and calibrated.

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
from pbrdf.identification.confusion import confusion
from pbrdf.identification.identify import identify
from pbrdf.identification.labelled import calibrate_library
from pbrdf.identification.library import Library
from pbrdf.identification.material import material_from_fits
from pbrdf.inversion.result import FitResult

STARTS = 8
#: Part of the intensity and absolute part (1/sr) by which the library's fits weigh, and where darkness begins.
RELATIVE, ABSOLUTE, DARK = 0.1, 0.001, 0.01
#: Geometries of a specimen and of a measurement.
MANY, FEW = 120, 20
AUTOMOTIVE = ("acryl_blue", "mystique")
INFRARED = {"reference_paint_rough": "infrared, rough", "reference_paint_smooth": "infrared, smooth"}
LIBRARY_INCIDENCE, TEST_INCIDENCE = (10, 30, 50, 70), (20, 40, 60)


def thinned(data: xr.Dataset, count: int) -> xr.Dataset:
    """Evenly few geometries: neighbours tell the same and share the model's error."""
    return data.isel(
        geometry=np.linspace(0, data.sizes["geometry"] - 1, min(count, data.sizes["geometry"])).astype(int)
    )


def automotive(data: Path, name: str) -> tuple[list[xr.Dataset], list[list[xr.Dataset]]]:
    """Of each wavelength the measurement for the library, and those to identify."""
    whole = pbrdf.read(data / "cornell-automotive" / f"{name}.brdf")
    groups = whole["group"].values.astype(int)
    low = np.degrees(whole["theta_r"].values) < 75.0
    wavelengths = np.unique(whole["wavelength"].values)

    def of(wavelength: float, incidence: Sequence[int], count: int) -> xr.Dataset:
        chosen = (whole["wavelength"].values == wavelength) & np.isin(groups, incidence) & low
        return thinned(whole.isel(geometry=np.flatnonzero(chosen)), count)

    known = [of(wavelength, LIBRARY_INCIDENCE, MANY) for wavelength in wavelengths]
    return known, [[of(wavelength, [i], FEW) for i in TEST_INCIDENCE] for wavelength in wavelengths]


def infrared(data: Path, material: str) -> tuple[list[xr.Dataset], list[list[xr.Dataset]]]:
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

    return [thinned(of(positions[::2]), MANY)], [[thinned(of([p]), FEW) for p in positions[1::2]]]


def with_noise(data: xr.Dataset, relative: float, absolute: float) -> xr.Dataset:
    """The data with this uncertainty of the intensity."""
    return data.assign(I_std=np.hypot(relative * data["I"], absolute))


def specimens(known: Sequence[xr.Dataset]) -> tuple[str, list[FitResult]]:
    """Best of the registered models by its predictions, and its fits to every third data set."""
    brightest = max(known, key=lambda one: float(one["I"].median()))
    rung = pbrdf.compare(brightest, starts=STARTS, vary=0, folds=4).best.rung
    chosen = [with_noise(one, RELATIVE, ABSOLUTE) for one in known[::3]]
    fits = [pbrdf.fit(one, rung.cls, options=rung.options, fix=rung.fix, starts=STARTS) for one in chosen]
    return rung.name, [fit for fit in fits if fit.settled]


def missed(fits: Sequence[FitResult]) -> tuple[float, float]:
    """Part of bright intensities, and absolute part of dark ones (1/sr), by which fits miss: root mean squares."""
    measured = np.concatenate([fit.data.values[0] for fit in fits])
    modelled = np.concatenate([fit.comparison["I_modelled"].values for fit in fits])
    off, bright = modelled - measured, measured > DARK
    relative = float(np.sqrt(np.mean((off[bright] / measured[bright]) ** 2)))
    absolute = float(np.sqrt(np.mean(off[~bright] ** 2))) if (~bright).any() else 0.0
    return relative, absolute


def main() -> int:
    """Run and print what came out."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("data", type=Path, help="folder of the measured data")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the numbers there")
    options = parser.parse_args()
    sources = {name: automotive(options.data, name) for name in AUTOMOTIVE}
    sources |= {title: infrared(options.data, name) for name, title in INFRARED.items()}
    fits, models = {}, {}
    for name, (known, _) in sources.items():
        models[name], fits[name] = specimens(known)
        print(
            f"{name}: {models[name]}, {len(fits[name])} specimens, missed {np.round(missed(fits[name]), 4)}"
        )
    noise = missed([fit for own in fits.values() for fit in own])
    print(f"noise: {100.0 * noise[0]:.0f} % of the intensity and {noise[1]:.4f}/sr")
    library = Library(tuple(material_from_fits(name, own) for name, own in fits.items()))
    calibration, test = [], []
    for name, (known, asked) in sources.items():
        turns = (asked[1::3], asked[2::3]) if len(known) > 1 else ([], asked)
        for target, turn in zip((calibration, test), turns, strict=True):
            target += [(name, with_noise(one, *noise)) for own in turn for one in own]
    rows: list[dict[str, Any]] = []
    for gain in (False, True):
        calibrated = calibrate_library(library, calibration, gain=gain)
        for title, used in (("χ²", library), ("calibrated", calibrated)):
            found = [identify(one, used, gain=gain) for _, one in test]
            table = confusion(found, [name for name, _ in test])
            for row, name in enumerate(table.truth):
                own = [f for f, (label, _) in zip(found, test, strict=True) if label == name]
                rows.append(
                    {
                        "compared": "shape" if gain else "absolute",
                        "sets": title,
                        "material": name,
                        "measurements": len(own),
                        "most probable": float(np.mean([f.candidates[0].name == name for f in own])),
                        "probability": float(np.mean([f[name].probability for f in own])),
                        "in the set": float(table.coverage[row]),
                        "set size": float(table.set_size[row]),
                        "none of these": float(table.counts[row, -1] / len(own)),
                        "distance² / d.o.f.": float(
                            np.median([f[name].distance / f.degrees_of_freedom for f in own])
                        ),
                    }
                )
    table = Table(box=SIMPLE_HEAD, padding=(0, 1))
    words = ("compared", "sets", "material")
    for heading in rows[0]:
        table.add_column(heading, justify="left" if heading in words else "right")
    for row in rows:
        table.add_row(*(f"{v:.2f}" if isinstance(v, float) else str(v) for v in row.values()))
    Console(width=150).print(table, highlight=False)
    if options.json is not None:
        options.json.write_text(json.dumps(rows, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
