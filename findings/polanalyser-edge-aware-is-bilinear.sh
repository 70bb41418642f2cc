#!/usr/bin/env bash
# Library:   polanalyser 3.0.0 with opencv-python-headless 5.0.0, demosaicing with COLOR_PolarMono_EA (edge-aware).
# Guess:     an edge-aware interpolation of a scene with edges differs from the bilinear one.
# Behaviour: all four channels are the bilinear ones, bit for bit: OpenCV's edge-aware rule works on the green channel,
#            the one that polanalyser throws away.
# Seen:      edge-aware differs from bilinear in 0 of 16384 values, OpenCV's green in 2048 of 4096
# Exit:      0 while the behaviour stands, 1 if it has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check polanalyser==3.0.0 opencv-python-headless==5.0.0.93 numpy==2.4.6 matplotlib==3.11.2
"$folder/venv/bin/python" - <<'PYTHON'
import cv2
import numpy as np
import polanalyser

scene = np.random.default_rng(0).integers(0, 65536, (64, 64)).astype(np.uint16)
scene[:, 32:] //= 8
plain, aware = (np.array(polanalyser.demosaicing(scene, code))
                for code in (polanalyser.COLOR_PolarMono, polanalyser.COLOR_PolarMono_EA))
different = int((plain != aware).sum())
green = [cv2.cvtColor(scene, code)[..., 1] for code in (cv2.COLOR_BayerBG2BGR, cv2.COLOR_BayerBG2BGR_EA)]
unused = int((green[0] != green[1]).sum())
print(f"edge-aware differs from bilinear in {different} of {plain.size} values, OpenCV's green in {unused} of {green[0].size}")
raise SystemExit(0 if different == 0 and unused > 0 else 1)
PYTHON
