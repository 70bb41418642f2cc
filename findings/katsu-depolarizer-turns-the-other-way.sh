#!/usr/bin/env bash
# Library:   katsu 0.1.0, mueller.depolarizer(angle, a, b, c), "angle of the transmission axis w.r.t. horizontal".
# Guess:     it turns as linear_polarizer(angle), linear_retarder(angle) and mueller_rotation do: light polarised along
#            the axis, of which the depolarizer keeps everything (a = 1, b = c = 0), comes out as it went in.
# Behaviour: it turns by minus the angle, so that at 30 degrees half of that polarisation is gone.
# Seen:      DoLP behind depolarizer(+30 degrees) 0.500, behind depolarizer(-30 degrees) 1.000
# Exit:      0 while the behaviour stands, 1 if it has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check katsu==0.1.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import numpy as np
from katsu import mueller

angle = np.deg2rad(30.0)
light = mueller.linear_polarizer(angle) @ np.array([1.0, 0.0, 0.0, 0.0])


def dolp(stokes):
    return np.hypot(stokes[1], stokes[2]) / stokes[0]


same, opposite = (dolp(mueller.depolarizer(a, 1.0, 0.0, 0.0) @ light) for a in (angle, -angle))
print(f"DoLP behind depolarizer(+30 degrees) {same:.3f}, behind depolarizer(-30 degrees) {opposite:.3f}")
raise SystemExit(0 if abs(same - 0.5) < 1e-9 and abs(opposite - 1.0) < 1e-9 else 1)
PYTHON
