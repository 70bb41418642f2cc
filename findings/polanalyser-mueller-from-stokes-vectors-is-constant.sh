#!/usr/bin/env bash
# Library:   polanalyser 3.0.0, calcMueller(intensities, mm_psg, mm_psa) with Stokes vectors of shape (N, 4).
# Guess:     "Stokes vector is also available in (N, 3) or (N, 4)" says the docstring: the light of the generator and the
#            first row of the analyser find the same sample as their Mueller matrices do.
# Behaviour: all sixteen elements are one number, a quarter of the mean intensity: of each vector its first component alone
#            is used, as the new axis is put before the vectors of the generator and behind those of the analyser.
# Seen:      by matrices the sample to 1e-14; by vectors all elements -0.0297, mean intensity / 4 -0.0297
# Exit:      0 while the behaviour stands, 1 if it has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check polanalyser==3.0.0 opencv-python-headless==5.0.0.93 numpy==2.4.6 matplotlib==3.11.2
"$folder/venv/bin/python" - <<'PYTHON'
import numpy as np
import polanalyser

sample = np.random.default_rng(0).uniform(-1.0, 1.0, (4, 4))
angles = np.linspace(0.0, np.pi, 36, endpoint=False)
generator = [polanalyser.qwp(5.0 * angle) @ polanalyser.polarizer(0.0) for angle in angles]
analyser = [polanalyser.polarizer(np.pi / 2.0) @ polanalyser.qwp(angle) for angle in angles]
intensities = [(A @ sample @ G)[0, 0] for A, G in zip(analyser, generator)]
matrices = polanalyser.calcMueller(intensities, generator, analyser)
vectors = polanalyser.calcMueller(intensities, [G[:, 0] for G in generator], [A[0] for A in analyser])
found = abs(matrices - sample).max() < 1e-14
constant = np.ptp(vectors) < 1e-12
expected = np.mean(intensities) / 4.0  # 16 elements times 1/2 of each polariser
print(f"by matrices the sample to 1e-14: {found}; by vectors all elements {vectors[0, 0]:.4f} (alike: {constant}), "
      f"mean intensity / 4 {expected:.4f}")
raise SystemExit(0 if found and constant and abs(vectors[0, 0] - expected) < 1e-12 else 1)
PYTHON
