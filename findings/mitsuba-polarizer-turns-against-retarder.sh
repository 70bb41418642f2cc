#!/usr/bin/env bash
# Library:   Mitsuba 3.9.1, BSDF plugins `polarizer` and `retarder` (scalar_spectral_polarized), both with an angle `theta`.
# Guess:     equal angles mean equal axes: light polarised by `polarizer` at 30 degrees lies along the axis of `retarder` at
#            30 degrees and passes it unchanged.
# Behaviour: the two turn in opposite senses: the retarder at -30 degrees lets it pass unchanged, the one at +30 degrees
#            (a quarter-wave plate) turns 87 % of it into circular light.
# Seen:      V/I behind the plate at +30 degrees 0.866, at -30 degrees 0.000 (absolute values)
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


def mueller(**plugin):
    bsdf = mi.load_dict({k: v if k == "type" else {"type": "spectrum", "value": v} for k, v in plugin.items()})
    si = mi.SurfaceInteraction3f()
    si.wi = mi.Vector3f(0, 0, 1)
    si.uv = mi.Point2f(0.5, 0.5)
    si.n = mi.Normal3f(0, 0, 1)
    si.sh_frame = mi.Frame3f(si.n)
    return np.array(bsdf.eval_null_transmission(si)).squeeze()[..., 0]


light = mueller(type="polarizer", theta=30.0) @ np.array([1.0, 0.0, 0.0, 0.0])
circular = []
for theta in (30.0, -30.0):
    behind = mueller(type="retarder", theta=theta, delta=90.0) @ light
    circular.append(abs(behind[3] / behind[0]))
print(f"V/I behind the plate at +30 degrees {circular[0]:.3f}, at -30 degrees {circular[1]:.3f} (absolute values)")
raise SystemExit(0 if abs(circular[0] - np.sin(np.pi / 3)) < 1e-3 and circular[1] < 1e-3 else 1)
PYTHON
