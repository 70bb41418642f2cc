#!/usr/bin/env bash
# Library:   eradiate-mitsuba 0.5.0 (kernel of Eradiate 1.2.0), variant scalar_mono_polarized_double: BSDF plugins
#            `ocean_mishchenko` and `maignan` beside `roughconductor`.
# Guess:     facets of one index n + i kappa, seen along the same directions, reflect with the same Mueller matrix but for a
#            scalar (density and shadowing), whichever plugin they are of: V counts the same hand in one kernel.
# Behaviour: for kappa > 0, which is what their parameters are documented for, the two plugins of Eradiate's own have the
#            last row and the last column of the matrix (not their common element) with the opposite sign.
# Seen:      n 1.5, kappa 2.0, roughconductor   V of light at 45 degrees / I -0.433
#            n 1.5, kappa 2.0, ocean_mishchenko V of light at 45 degrees / I +0.433
#            n 1.5, kappa 2.0, maignan          V of light at 45 degrees / I +0.433
# Exit:      0 while the behaviour stands, 1 if it has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check eradiate-mitsuba==0.5.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import math

import mitsuba as mi
import numpy as np

mi.set_variant("scalar_mono_polarized_double")


def direction(degrees, azimuth):
    theta, phi = math.radians(degrees), math.radians(azimuth)
    return mi.Vector3f(math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta))


def matrix(bsdf, wi, wo):
    si = mi.SurfaceInteraction3f()
    si.wi = wi
    si.uv = mi.Point2f(0.5, 0.5)
    m = bsdf.eval(mi.BSDFContext(), si, wo)
    elements = np.array([[np.ravel(m[i, j])[0] for j in range(4)] for i in range(4)])
    return elements / elements[0, 0]


n, kappa = 1.5, 2.0
surfaces = {
    "roughconductor": {"type": "roughconductor", "alpha": 0.3, "eta": n, "k": kappa},
    "ocean_mishchenko": {"type": "ocean_mishchenko", "wind_speed": 10.0, "eta": n, "k": kappa, "ext_ior": 1.0},
    "maignan": {"type": "maignan", "C": 5.0, "ndvi": 0.8, "refr_re": n, "refr_im": kappa, "ext_ior": 1.0},
}
source, viewer = direction(40.0, 0.0), direction(50.0, 165.0)
found = {name: matrix(mi.load_dict(surface), viewer, source) for name, surface in surfaces.items()}
reverse = np.diag([1.0, 1.0, 1.0, -1.0])
reference = found["roughconductor"]
stands = abs(reference[3, 2]) > 0.1
for name, m in found.items():
    stokes = m @ [1.0, 0.0, 1.0, 0.0]
    print(f"n {n}, kappa {kappa}, {name:16s} V of light at 45 degrees / I {stokes[3] / stokes[0]:+.3f}")
    expected = reference if name == "roughconductor" else reverse @ reference @ reverse
    stands &= bool(np.abs(m - expected).max() < 1e-9)
raise SystemExit(0 if stands else 1)
PYTHON
