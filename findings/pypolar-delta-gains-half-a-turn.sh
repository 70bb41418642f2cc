#!/usr/bin/env bash
# Library:   pypolar 1.2.0, ellipsometry.tanpsi_Delta_from_rho and rho_from_tanpsi_Delta.
# Guess:     each undoes the other; Delta runs on smoothly through 90 degrees where Re(rho) changes its sign.
# Behaviour: where Re(rho) < 0, below the principal angle, Delta gets half a turn: rho comes back with the other sign, and
#            Delta of a metal jumps by 180 degrees between two angles of incidence.
# Seen:      Delta 72 degrees 271.7, 75 degrees 79.8 (arg rho: 91.7, 79.8); rho back/rho -1.000, 1.000
# Exit:      0 while the behaviour stands, 1 if it has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pypolar==1.2.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import numpy as np
from pypolar import ellipsometry, fresnel

gold = 0.47 - 2.83j
rho = [fresnel.ellipsometry_rho(gold, np.deg2rad(degrees)) for degrees in (72.0, 75.0)]
pairs = [ellipsometry.tanpsi_Delta_from_rho(r) for r in rho]
deltas = [np.rad2deg(delta) for _, delta in pairs]
angles = [np.rad2deg(np.angle(r)) for r in rho]
back = [(ellipsometry.rho_from_tanpsi_Delta(*pair) / r).real for pair, r in zip(pairs, rho)]
print(f"Delta 72 degrees {deltas[0]:.1f}, 75 degrees {deltas[1]:.1f} (arg rho: {angles[0]:.1f}, {angles[1]:.1f}); "
      f"rho back/rho {back[0]:.3f}, {back[1]:.3f}")
stands = abs(abs(deltas[0] - angles[0]) - 180.0) < 1e-6 and abs(deltas[1] - angles[1]) < 1e-6
stands = stands and abs(back[0] + 1.0) < 1e-9 and abs(back[1] - 1.0) < 1e-9
raise SystemExit(0 if stands else 1)
PYTHON
