#!/usr/bin/env bash
# Library:   Dr.Jit 1.5.0, drjit.llvm.ad, with LLVM from karellen-llvm-core 23.1.4.post8.
# Guess:     a typing.NamedTuple in the state of a symbolic loop is carried like a plain tuple, derivatives included: both
#            are PyTrees, and the values agree.
# Behaviour: where the derivative is taken inside the body of another symbolic loop, that through a NamedTuple is 0,
#            without a word; the value is right, and so is the derivative outside of a loop.
# Seen:      d/dx sum of 3 x^3, twice, at x = 2 (72 by hand): plain tuple 72.0, NamedTuple 0.0, value 48.0 and 48.0
# Exit:      0 while the behaviour stands, 1 if it has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check drjit==1.5.0 karellen-llvm-core==23.1.4.post8
DRJIT_LIBLLVM_PATH=$(find "$folder/venv" -name 'libLLVM*.so*' | head -n 1)
export DRJIT_LIBLLVM_PATH
"$folder/venv/bin/python" - <<'PYTHON'
from typing import NamedTuple

import drjit as dr
from drjit.llvm.ad import Float, UInt32


class Pair(NamedTuple):
    a: Float
    b: Float


def summed(make):
    """Twice, in a symbolic loop: the value of 3 x^3, summed up by an inner loop, and its derivative."""
    twice, x = dr.opaque(UInt32, 2), dr.opaque(Float, 2.0, 3)

    def body(i, value, slope):
        y = Float(x)
        dr.enable_grad(y)
        total = dr.while_loop(
            (UInt32(0), dr.zeros(Float, 1), make(y, y * y)),
            lambda j, *_: j < 3,
            lambda j, total, pair: (j + 1, total + pair[0] * pair[1], pair),
            max_iterations=-1,
        )[1]
        dr.set_grad(y, 1.0)
        dr.forward_to(total)
        return i + 1, value + dr.detach(total), slope + dr.grad(total)

    state = (UInt32(0), dr.zeros(Float, 1), dr.zeros(Float, 1))
    _, value, slope = dr.while_loop(state, lambda i, *_: i < twice, body, max_iterations=-1)
    return float(value[0]), float(slope[0])


plain, named = summed(lambda a, b: (a, b)), summed(Pair)
print(f"plain tuple: value {plain[0]}, derivative {plain[1]}")
print(f"NamedTuple:  value {named[0]}, derivative {named[1]}")
raise SystemExit(0 if plain == (48.0, 72.0) and named == (48.0, 0.0) else 1)
PYTHON
