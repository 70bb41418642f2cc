#!/usr/bin/env bash
# Library:   pypolar 1.2.0, mueller.ellipticity_angle(S).
# Guess:     the ellipse is that of the polarised part: natural light added to a beam does not change its shape.
# Behaviour: the angle is asin(V/I)/2 instead of asin(V/sqrt(Q^2 + U^2 + V^2))/2: circular light of which 30 % is polarised
#            reads 8.7 degrees.
# Seen:      fully circular 45.0, partly circular 8.7 degrees
# Exit:      0 while the behaviour stands, 1 if it has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pypolar==1.2.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import numpy as np
from pypolar import mueller

full, part = (float(np.rad2deg(mueller.ellipticity_angle(np.array([1.0, 0.0, 0.0, v])))) for v in (1.0, 0.3))
print(f"fully circular {full:.1f}, partly circular {part:.1f} degrees")
raise SystemExit(0 if abs(full - 45.0) < 1e-6 and abs(part - np.rad2deg(0.5 * np.arcsin(0.3))) < 1e-6 else 1)
PYTHON
