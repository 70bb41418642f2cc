#!/usr/bin/env bash
# Library:   pySCATMECH 0.1.10, mueller.MuellerDiattenuator(diatten).
# Guess:     diatten is the diattenuation (Tmax - Tmin)/(Tmax + Tmin): 1 gives a polariser, 0 an empty path.
# Behaviour: it is the transmittance of the weaker axis: 1 gives the empty path, 0 the polariser.
# Seen:      diattenuation of diatten = 1, 0.5, 0: 0.000, 0.333, 1.000
# Exit:      0 while the behaviour stands, 1 if it has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pySCATMECH==0.1.10 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import numpy as np
from pySCATMECH.mueller import MuellerDiattenuator

seen = []
for diatten in (1.0, 0.5, 0.0):
    M = np.array(MuellerDiattenuator(diatten=diatten))
    seen.append(np.hypot(M[0, 1], M[0, 2]) / M[0, 0])
print("diattenuation of diatten = 1, 0.5, 0: " + ", ".join(f"{x:.3f}" for x in seen))
raise SystemExit(0 if np.allclose(seen, [0.0, 1 / 3, 1.0]) else 1)
PYTHON
