#!/usr/bin/env bash
# Library:   katsu 0.1.0, mueller.decompose_retarder(M), Lu and Chipman's polar decomposition.
# Guess:     the retarder in the matrix of a pure retarder is that matrix; its diattenuator is the identity.
# Behaviour: the diattenuation vector is divided by its length, 0: all elements are NaN (NumPy warns of a division). A
#            diattenuation of 1e-9 is enough for the right answer.
# Seen:      pure retarder: all NaN; with a diattenuation of 1e-9: differs from the retarder by less than 1e-6
# Exit:      0 while the behaviour stands, 1 if it has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check katsu==0.1.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import numpy as np
from katsu import mueller

plate = mueller.linear_retarder(np.deg2rad(20.0), np.pi / 3)
with np.errstate(invalid="ignore"):
    pure = mueller.decompose_retarder(plate)
nearly = mueller.decompose_retarder(plate @ mueller.linear_diattenuator(0.0, 1.0 - 2e-9))
error = np.abs(nearly - plate).max()
print(f"pure retarder: NaN {np.isnan(pure).all()}; with a diattenuation of 1e-9 differs by {error:.1e}")
raise SystemExit(0 if np.isnan(pure).all() and error < 1e-6 else 1)
PYTHON
