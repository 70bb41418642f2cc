#!/usr/bin/env bash
# Library:   pypolar 1.2.0, mueller.op_fresnel_transmission(m, theta).
# Guess:     Mueller matrices act on intensities: with op_fresnel_reflection it shares out all the light at a surface that
#            absorbs nothing, R + T = 1, as R_unpolarized and T_unpolarized of the same package do.
# Behaviour: it is made of the field amplitudes alone, without n cos(theta_t)/cos(theta_i), a factor of 2.449 at 60 degrees
#            into n = 1.5; the docstring says "field-amplitude", the Stokes vector it gives is then no flux.
# Seen:      R + T of the Mueller matrices 0.4610, of the flux functions 1.0000; ratio of the T 2.449
# Exit:      0 while the behaviour stands, 1 if it has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pypolar==1.2.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import numpy as np
from pypolar import fresnel, mueller

n, theta = 1.5, np.deg2rad(60.0)
T = float(mueller.op_fresnel_transmission(n, theta)[0, 0])
R = float(mueller.op_fresnel_reflection(n, theta)[0, 0])
flux = float(fresnel.T_unpolarized(n, theta))
whole = flux + float(fresnel.R_unpolarized(n, theta))
print(f"R + T of the Mueller matrices {R + T:.4f}, of the flux functions {whole:.4f}; ratio of the T {flux / T:.3f}")
factor = np.sqrt(n * n - np.sin(theta) ** 2) / np.cos(theta)
raise SystemExit(0 if abs(whole - 1.0) < 1e-9 and abs(flux / T - factor) < 1e-9 else 1)
PYTHON
