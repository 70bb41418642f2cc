#!/usr/bin/env bash
# Library:   katsu 0.1.0, mueller.decompose_depolarizer(M, return_all=True), Lu and Chipman's polar decomposition.
# Guess:     a depolariser that turns all states over, diag(1, -0.3, -0.2, -0.1) behind a diattenuator, has a negative
#            determinant: the paper's m_Δ has the minus sign then, and the retarder is a rotation, here the identity.
# Behaviour: the sign is taken from det(m mᵀ), which is never negative: the depolariser comes out positive and the
#            "retarder" has the minus sign, a mirror image that no retarder makes; its retardance is NaN.
# Seen:      trace of the depolariser 1.6 (expected 0.4), determinant of the retarder -1, its retardance nan
# Exit:      0 while the behaviour stands, 1 if it has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check katsu==0.1.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import numpy as np
from katsu import mueller

matrix = np.diag([1.0, -0.3, -0.2, -0.1]) @ mueller.linear_diattenuator(0.3, 0.5)
depolarizer, retarder, _ = mueller.decompose_depolarizer(matrix, return_all=True)
trace, determinant = np.trace(depolarizer), np.linalg.det(retarder)
with np.errstate(invalid="ignore"):
    retardance = mueller.retardance_from_mueller(retarder)
print(
    f"trace of the depolariser {trace:.1f} (expected 0.4), determinant of the retarder {determinant:.0f}, "
    f"its retardance {retardance}"
)
raise SystemExit(0 if abs(trace - 1.6) < 1e-9 and abs(determinant + 1) < 1e-9 and np.isnan(retardance) else 1)
PYTHON
