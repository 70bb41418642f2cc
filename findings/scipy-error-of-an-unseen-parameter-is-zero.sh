#!/usr/bin/env bash
# Library:   SciPy 1.17.1, scipy.optimize.curve_fit.
# Guess:     a parameter that the data do not see has an infinite standard error, whatever the bounds: that is what it
#            has, with a warning, where none are given.
# Behaviour: with bounds its standard error is 0, as if it were known exactly, and there is no warning.
# Seen:      without bounds step +- inf, 1 warning; with bounds step +- 0, 0 warnings
# Exit:      0 while the behaviour stands, 1 if it has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check scipy==1.17.1 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import warnings

import numpy as np
from scipy.optimize import curve_fit

x = np.linspace(0.0, 1.0, 21)
y = 1.0 + 2.0 * x + 0.01 * np.sin(9.0 * x)


def model(x, a, b, step):
    return a + b * x + np.where(x > 2.0, step, 0.0)  # beyond all x


def error_of_the_step(**bounds):
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        _, covariance = curve_fit(model, x, y, p0=[0.5, 1.0, 1.0], **bounds)
    return np.sqrt(covariance[2, 2]), len(warned)


free, bounded = error_of_the_step(), error_of_the_step(bounds=([-10.0, -10.0, 0.0], [10.0, 10.0, 5.0]))
print(f"without bounds step +- {free[0]:g}, {free[1]} warning; "
      f"with bounds step +- {bounded[0]:g}, {bounded[1]} warnings")
raise SystemExit(0 if free == (np.inf, 1) and bounded == (0.0, 0) else 1)
PYTHON
