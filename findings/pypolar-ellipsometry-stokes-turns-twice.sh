#!/usr/bin/env bash
# Library:   pypolar 1.2.0, mueller.stokes_ellipsometry(tanpsi, Delta).
# Guess:     S = (1, -cos 2psi, sin 2psi cos Delta, -sin 2psi sin Delta), as in the table that its docstring names: light
#            whose components differ by a quarter of a turn (Delta = 90 degrees, psi = 45 degrees) is circular.
# Behaviour: it takes the cosine and sine of 2 Delta: that light is linear at -45 degrees, and Delta = 45 degrees circular.
# Seen:      Delta 90 degrees: U -1.000 V -0.000; Delta 45 degrees: U 0.000 V -1.000
# Exit:      0 while the behaviour stands, 1 if it has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pypolar==1.2.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import numpy as np
from pypolar import mueller

quarter, eighth = (mueller.stokes_ellipsometry(1.0, np.deg2rad(d)) for d in (90.0, 45.0))
print(f"Delta 90 degrees: U {quarter[2]:.3f} V {quarter[3]:.3f}; Delta 45 degrees: U {eighth[2]:.3f} V {eighth[3]:.3f}")
stands = np.allclose(quarter[2:], [-1.0, 0.0]) and np.allclose(eighth[2:], [0.0, -1.0])
raise SystemExit(0 if stands else 1)
PYTHON
