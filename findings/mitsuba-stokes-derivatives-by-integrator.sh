#!/usr/bin/env bash
# Library:   Mitsuba 3.9.1, integrator `stokes` around `direct`, `path`, `volpath` and `prb` (llvm_ad_mono_polarized), with LLVM from
#            karellen-llvm-core 23.1.4.post8.
# Guess:     `prb`, made for derivatives, gives those of a polarised picture, and at one reflection all four agree.
# Behaviour: of a `roughconductor` ball under a uniform sky, by its roughness, `prb` gives dS0 with the wrong sign (directions of
#            samples move with the roughness), and a picture whose mean S1, 0 by symmetry, is not: it does not turn Mueller
#            matrices to the world's axes. `path` gives dS0 right and loses the same turn in the derivative of S1 (0 by symmetry).
#            `direct` and `volpath` are right.
# Seen:      direct   S1 -0.000, dS0/da -0.100 (differences -0.098), dS1/da  0.000 ( 0.001)
#            path     S1 -0.000, dS0/da -0.102 (differences -0.099), dS1/da  0.048 ( 0.001)
#            volpath  S1 -0.000, dS0/da -0.098 (differences -0.099), dS1/da  0.001 ( 0.000)
#            prb      S1 -0.025, dS0/da  0.170 (differences -0.099), dS1/da  0.030 ( 0.040)
# Exit:      0 while the behaviour stands, 1 if it has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check mitsuba==3.9.1 numpy==2.4.6 karellen-llvm-core==23.1.4.post8
DRJIT_LIBLLVM_PATH=$(find "$folder/venv" -name 'libLLVM*.so*' | head -n 1)
export DRJIT_LIBLLVM_PATH
"$folder/venv/bin/python" - <<'PYTHON'
import drjit as dr
import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_mono_polarized")
mi.set_log_level(mi.LogLevel.Error)
SIZE, ALPHA, STEP = 16, 0.25, 0.02
scene = mi.load_dict({
    "type": "scene",
    "sensor": {
        "type": "perspective", "fov": 20.0, "to_world": mi.ScalarTransform4f().look_at([0, -3, 0], [0, 0, 0], [0, 0, 1]),
        "film": {"type": "hdrfilm", "width": SIZE, "height": SIZE, "rfilter": {"type": "box"}},
    },
    "sky": {"type": "constant"},
    "ball": {"type": "sphere", "radius": 0.5, "bsdf": {"type": "roughconductor", "alpha": ALPHA, "eta": 1.5, "k": 2.0}},
})
params = mi.traverse(scene)


def means(image):
    return [dr.mean(image[:, :, c].array) for c in (1, 4)]


def picture(alpha, integrator):
    params["ball.bsdf.alpha.value"] = mi.Float(alpha)
    params.update()
    return np.array([x[0] for x in means(mi.render(scene, integrator=integrator, spp=4096, seed=1))])


found = {}
for name in ("direct", "path", "volpath", "prb"):
    nested = {"type": name} | ({} if name == "direct" else {"max_depth": 2})
    integrator = mi.load_dict({"type": "stokes", "nested": nested})
    difference = (picture(ALPHA + STEP, integrator) - picture(ALPHA - STEP, integrator)) / (2.0 * STEP)
    x = mi.Float(ALPHA)
    dr.enable_grad(x)
    params["ball.bsdf.alpha.value"] = x
    params.update()
    values = means(mi.render(scene, params, integrator=integrator, spp=4096, seed=2))
    dr.forward(x)
    found[name] = values[1][0], [dr.grad(v)[0] for v in values], difference
    (s0, s1), (d0, d1) = found[name][1:]
    print(f"{name:8} S1 {found[name][0]:6.3f}, dS0/da {s0:6.3f} (differences {d0:6.3f}), dS1/da {s1:6.3f} ({d1:6.3f})")


def right(name, i):
    return abs(found[name][1][i] - found[name][2][i]) < 0.005


stands = all(right(name, i) for name in ("direct", "volpath") for i in (0, 1))
stands &= right("path", 0) and found["path"][1][1] > 0.03 and abs(found["path"][2][1]) < 0.005
stands &= found["prb"][1][0] > 0.1 and found["prb"][2][0] < -0.05
stands &= abs(found["prb"][0]) > 0.01 and abs(found["direct"][0]) < 0.001
raise SystemExit(0 if stands else 1)
PYTHON
