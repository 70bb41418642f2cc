#!/usr/bin/env bash
# Library:   Mitsuba 3.9.1, BSDF plugin `conductor` with material "none", its documented perfect mirror
#            (scalar_spectral_polarized).
# Guess:     as every reflection off an ideal metal, it retards by half a turn: linear light stays linear at any angle.
# Behaviour: it is a totally reflecting dielectric of index 0 + 1i: at 35 degrees the retardance is 38 degrees short of half a
#            turn, and light at 45 degrees comes back elliptical, V/I = 0.62. The intensity is right.
# Seen:      m00 1.000, retardance 141.6 degrees, V/I of light at 45 degrees 0.621 (absolute value)
# Exit:      0 while the behaviour stands, 1 if it has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check mitsuba==3.9.1 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import mitsuba as mi
import numpy as np

mi.set_variant("scalar_spectral_polarized")
theta = np.deg2rad(35.0)
si = mi.SurfaceInteraction3f()
si.wi = mi.Vector3f(np.sin(theta), 0.0, np.cos(theta))
si.uv = mi.Point2f(0.5, 0.5)
si.sh_frame = mi.Frame3f(mi.Normal3f(0, 0, 1))
mirror = mi.load_dict({"type": "conductor", "material": "none"})
_, weight = mirror.sample(mi.BSDFContext(), si, 0.5, mi.Point2f(0.5, 0.5))
M = np.array(weight).squeeze()[..., 0]
retardance = np.rad2deg(np.arctan2(abs(M[2, 3]), M[2, 2]))
circular = abs((M @ [1.0, 0.0, 1.0, 0.0])[3]) / M[0, 0]
print(f"m00 {M[0, 0]:.3f}, retardance {retardance:.1f} degrees, V/I of light at 45 degrees {circular:.3f} (absolute value)")
stands = abs(M[0, 0] - 1.0) < 1e-4 and abs(retardance - 141.6) < 0.1 and abs(circular - 0.621) < 0.001
raise SystemExit(0 if stands else 1)
PYTHON
