#!/usr/bin/env bash
# Library:   pySCATMECH 0.1.10, MuellerMatrix.rotate(a) and the argument `angle` of MuellerPolarizer and its like.
# Guess:     a polariser made at an angle is the polariser at 0 rotated by that angle.
# Behaviour: it is the one rotated by minus that angle.
# Seen:      MuellerPolarizer(angle=20 degrees): rotate(20 degrees) differs by 0.643, rotate(-20 degrees) by 0.000
# Exit:      0 while the behaviour stands, 1 if it has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pySCATMECH==0.1.10 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import numpy as np
from pySCATMECH.mueller import MuellerPolarizer

a = np.deg2rad(20.0)
made = np.array(MuellerPolarizer(angle=a))
with_it, against = (np.abs(np.array(MuellerPolarizer().rotate(turn)) - made).max() for turn in (a, -a))
print(f"MuellerPolarizer(angle=20 degrees): rotate(20 degrees) differs by {with_it:.3f}, "
      f"rotate(-20 degrees) by {against:.3f}")
raise SystemExit(0 if with_it > 0.6 and against < 1e-12 else 1)
PYTHON
