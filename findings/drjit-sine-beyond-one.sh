#!/usr/bin/env bash
# Library:   Dr.Jit 1.5.0, drjit.llvm.ad, with LLVM from karellen-llvm-core 23.1.4.post8.
# Guess:     beyond |x| < 8192, up to where the documentation of dr.sin promises a low error, digits are lost; what comes
#            out, a phase of a thick retarder or coating for one, is still a sine, within -1 ... 1.
# Behaviour: it is not: the float32 sine passes 1 from 3.2e7 rad on and is infinite at 1e10, the float64 one is right up to
#            3.3e9 and 1e118 at 1e10. No warning, no NaN.
# Seen:      float32 sin(1e+06) -0.3791, NumPy's of the same number -0.3500
#            float32 sin(1e+09) -1.171e+05, NumPy's of the same number 0.5458
#            float32 sin(1e+10) -inf, NumPy's of the same number -0.4875
#            float64 sin(1e+09) 0.5458, NumPy's of the same number 0.5458
#            float64 sin(1e+10) 9.535e+117, NumPy's of the same number -0.4875
# Exit:      0 while the behaviour stands, 1 if it has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check drjit==1.5.0 karellen-llvm-core==23.1.4.post8 numpy==2.4.6
DRJIT_LIBLLVM_PATH=$(find "$folder/venv" -name 'libLLVM*.so*' | head -n 1)
export DRJIT_LIBLLVM_PATH
"$folder/venv/bin/python" - <<'PYTHON'
import drjit as dr
import numpy as np
from drjit.llvm.ad import Float32, Float64

found = {}
for name, kind, dtype in (("float32", Float32, np.float32), ("float64", Float64, np.float64)):
    for x in (1e6, 1e9, 1e10):
        number = dtype(x)
        theirs = float(dr.sin(kind(float(number)))[0])
        right = float(np.sin(np.float64(number)))
        found[name, x] = theirs, right
        print(f"{name} sin({x:g}) {theirs:.4g}, NumPy's of the same number {right:.4f}")
stands = abs(found["float32", 1e6][0] - found["float32", 1e6][1]) > 0.02
stands &= abs(found["float32", 1e9][0]) > 1e4 and abs(found["float64", 1e10][0]) > 1e100
stands &= abs(found["float64", 1e9][0] - found["float64", 1e9][1]) < 1e-9
raise SystemExit(0 if stands else 1)
PYTHON
