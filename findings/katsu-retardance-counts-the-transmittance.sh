#!/usr/bin/env bash
# Library:   katsu 0.1.0, mueller.retardance_from_mueller(M).
# Guess:     a retarder that absorbs half of the light retards as much as one that does not: the function divides M by
#            its transmittance M[0, 0], as the equation (arccos(tr M/2 - 1)) of normalised matrices asks.
# Behaviour: it takes the trace as it is: a quarter-wave plate that transmits half reads 120 degrees, without a warning.
# Seen:      retardance of a clear quarter-wave plate 90.0, of one that transmits half 120.0 degrees
# Exit:      0 while the behaviour stands, 1 if it has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check katsu==0.1.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import numpy as np
from katsu import mueller

plate = mueller.linear_retarder(np.deg2rad(20.0), np.pi / 2)
clear, dim = (float(np.rad2deg(mueller.retardance_from_mueller(t * plate))) for t in (1.0, 0.5))
print(f"retardance of a clear quarter-wave plate {clear:.1f}, of one that transmits half {dim:.1f} degrees")
raise SystemExit(0 if abs(clear - 90.0) < 1e-6 and abs(dim - 120.0) < 1e-6 else 1)
PYTHON
