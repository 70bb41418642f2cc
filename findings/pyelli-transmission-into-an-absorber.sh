#!/usr/bin/env bash
# Library:   pyElli 0.23.1, IsotropicMaterial with complex index as the medium behind the surface.
# Guess:     at the bare surface of an absorber nothing is lost before the light is inside: R + T = 1 for p as for s.
# Behaviour: it is 1 for s and for transparent media; for p it misses 7 % at 60 degrees into 1.5 + 0.5i: T_pp is scaled by
#            Re(n cos) where p needs Re(n conj(cos)).
# Seen:      R_ss + T_ss 1.0000, R_pp + T_pp 0.9261, with Re(n conj(cos)) 1.0000
# Exit:      0 while the behaviour stands, 1 if it has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pyElli==0.23.1 numpy==2.4.6 packaging
"$folder/venv/bin/python" - <<'PYTHON'
import elli
import numpy as np

n, degrees = 1.5 + 0.5j, 60.0
absorber = elli.IsotropicMaterial(elli.ConstantRefractiveIndex(n=n))
r = elli.Structure(elli.AIR, [], absorber).evaluate(np.array([500.0]), degrees)
s, p = (float((a + b)[0]) for a, b in ((r.R_ss, r.T_ss), (r.R_pp, r.T_pp)))
cos = np.sqrt(1.0 - (np.sin(np.deg2rad(degrees)) / n) ** 2)
mended = float(r.R_pp[0] + r.T_pp[0] * (n * np.conj(cos)).real / (n * cos).real)
print(f"R_ss + T_ss {s:.4f}, R_pp + T_pp {p:.4f}, with Re(n conj(cos)) {mended:.4f}")
raise SystemExit(0 if abs(s - 1.0) < 1e-6 and abs(p - 0.9261) < 1e-3 and abs(mended - 1.0) < 1e-6 else 1)
PYTHON
