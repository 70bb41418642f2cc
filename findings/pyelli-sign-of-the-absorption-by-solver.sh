#!/usr/bin/env bash
# Library:   pyElli 0.23.1, Solver2x2 (the default for what is isotropic) and Solver4x4.
# Guess:     two solvers of one package give one answer; an index n - ik, the convention of most ellipsometers' tables, is
#            either read as absorption by both or refused by both.
# Behaviour: Solver2x2 answers as for n + ik (with a warning of active media); Solver4x4 says nothing and flips the sign of
#            Delta, so that the handedness of the reflected light turns round.
# Seen:      n + ik: 80.50 and 80.50; n - ik: 80.50 and -80.50 degrees
# Exit:      0 while the behaviour stands, 1 if it has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pyElli==0.23.1 numpy==2.4.6 packaging
"$folder/venv/bin/python" - <<'PYTHON'
import warnings

import elli
import numpy as np

warnings.simplefilter("ignore")


def delta(n, solver):
    medium = elli.IsotropicMaterial(elli.ConstantRefractiveIndex(n=n))
    return float(elli.Structure(elli.AIR, [], medium).evaluate(np.array([500.0]), 60.0, solver=solver).delta[0])


plus, minus = ([delta(n, s) for s in (elli.Solver2x2, elli.Solver4x4)] for n in (1.5 + 0.5j, 1.5 - 0.5j))
print(f"n + ik: {plus[0]:.2f} and {plus[1]:.2f}; n - ik: {minus[0]:.2f} and {minus[1]:.2f} degrees")
stands = abs(plus[0] - plus[1]) < 1e-6 and abs(minus[0] - plus[0]) < 1e-6 and abs(minus[1] + plus[0]) < 1e-6
raise SystemExit(0 if stands else 1)
PYTHON
