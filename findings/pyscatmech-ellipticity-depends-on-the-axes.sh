#!/usr/bin/env bash
# Library:   pySCATMECH 0.1.10, StokesVector.ellipticity(), "ratio of the minor to major axes".
# Guess:     the shape of the ellipse does not change with the frame: linear polarisation at 0 or 45 degrees counts alike.
# Behaviour: the formula takes Q and V where it needs Q, U and V (or P = DoP*I for I): the same ellipse turned by 45
#            degrees has another ratio.
# Seen:      (1, 0.6, 0, 0.8) 0.400, turned by 45 degrees (1, 0, 0.6, 0.8) 0.444; by the angle tan(asin(0.8)/2) 0.500
# Exit:      0 while the behaviour stands, 1 if it has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pySCATMECH==0.1.10 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import numpy as np
from pySCATMECH.mueller import StokesVector

upright, turned = StokesVector(1.0, 0.6, 0.0, 0.8).ellipticity(), StokesVector(1.0, 0.0, 0.6, 0.8).ellipticity()
right = np.tan(0.5 * np.arcsin(0.8))
print(f"(1, 0.6, 0, 0.8) {upright:.3f}, turned by 45 degrees (1, 0, 0.6, 0.8) {turned:.3f}; "
      f"by the angle tan(asin(0.8)/2) {right:.3f}")
raise SystemExit(0 if abs(upright - 0.4) < 1e-9 and abs(turned - 4.0 / 9.0) < 1e-9 and abs(right - 0.5) < 1e-9 else 1)
PYTHON
