#!/usr/bin/env bash
# Library:   Mitsuba 3.9.1, integrators `path` and `volpath` with a BSDF `polarizer` (scalar_spectral_polarized).
# Guess:     a lamp behind a sheet of `polarizer` lights a plate that scatters with half of its light.
# Behaviour: under `path` the plate is black: rays towards the lamp take the sheet for opaque. Under `volpath` it is right,
#            though there is no volume in the scene. (`path` finds an area lamp by chance alone: the mean is right, noisy.)
# Seen:      behind a polariser: path 0.000, volpath 0.502 of the light
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
mi.set_log_level(mi.LogLevel.Error)
T = mi.ScalarTransform4f


def radiance(integrator, sheet):
    """S0 of a white level plate under a lamp, seen from the side."""
    entries = {
        "type": "scene",
        "integrator": {"type": "stokes", "nested": {"type": integrator, "max_depth": 4}},
        "sensor": {
            "type": "perspective",
            "fov": 1.0,
            "to_world": T().look_at([0, -1, 0.5], [0, 0, 0], [0, 0, 1]),
            "film": {"type": "hdrfilm", "width": 1, "height": 1, "rfilter": {"type": "box"}},
        },
        "plate": {"type": "rectangle", "bsdf": {"type": "diffuse"}},
        "lamp": {"type": "point", "position": [0, 0, 2]},
    }
    if sheet:
        place = T().translate([0, 0, 1]).scale(3)
        entries["sheet"] = {"type": "rectangle", "to_world": place, "bsdf": {"type": "polarizer"}}
    scene = mi.load_dict(entries)
    image = np.array(mi.render(scene, spp=256))[0, 0]
    names = scene.integrator().aov_names()
    return image[len(image) - len(names) + names.index("S0.G")]


share = {name: radiance(name, True) / radiance(name, False) for name in ("path", "volpath")}
print("behind a polariser: " + ", ".join(f"{name} {value:.3f}" for name, value in share.items()) + " of the light")
raise SystemExit(0 if share["path"] == 0.0 and abs(share["volpath"] - 0.5) < 0.02 else 1)
PYTHON
