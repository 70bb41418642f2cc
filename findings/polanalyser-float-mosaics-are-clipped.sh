#!/usr/bin/env bash
# Library:   polanalyser 3.0.0, demosaicing of floating-point mosaics (micro-polariser cameras).
# Guess:     floats, the usual type after the dark frame has been taken off, are interpolated as floats: noise of mean 0
#            keeps its mean, and one bright pixel far away does not matter.
# Behaviour: they are scaled to 65535 at the brightest pixel, clipped at 0 and cut to whole numbers: noise around 0 gets a
#            positive mean, and beside a highlight a dim paint is left in steps, all downwards.
# Seen:      dark-subtracted noise of mean 0.00, deviation 1: 0.40; a paint at 0.9 beside a highlight of 65535: 0
# Exit:      0 while the behaviour stands, 1 if it has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check polanalyser==3.0.0 opencv-python-headless==5.0.0.93 numpy==2.4.6 matplotlib==3.11.2
"$folder/venv/bin/python" - <<'PYTHON'
import numpy as np
import polanalyser

noise = np.random.default_rng(0).normal(0.0, 1.0, (256, 256))
noise -= noise.mean()
mean = float(np.mean(np.array(polanalyser.demosaicing(noise))))
paint = np.full((64, 64), 0.9)
paint[0, 0] = 65535.0
dim = float(np.array(polanalyser.demosaicing(paint))[:, 32, 32].max())
print(f"dark-subtracted noise of mean {noise.mean():.2f}, deviation 1: {mean:.2f}; "
      f"a paint at 0.9 beside a highlight of 65535: {dim:g}")
raise SystemExit(0 if 0.3 < mean < 0.5 and dim == 0.0 else 1)
PYTHON
