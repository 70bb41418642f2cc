#!/usr/bin/env bash
# Library:   Mitsuba 3.9.1, sensor `irradiancemeter` under the integrator `stokes` (scalar_spectral_polarized).
# Guess:     S0 is the intensity that the sensor reads, as the image beside it.
# Behaviour: S0 lacks the sensor's weight: for a plate under an even sky the image holds the irradiance, S0 the same over pi.
# Seen:      green channel of the image over S0.G: 3.1416
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
scene = mi.load_dict(
    {
        "type": "scene",
        "integrator": {"type": "stokes", "nested": {"type": "path"}},
        "plate": {
            "type": "rectangle",
            "meter": {
                "type": "irradiancemeter",
                "film": {"type": "hdrfilm", "width": 1, "height": 1, "rfilter": {"type": "box"}},
            },
        },
        "sky": {"type": "constant"},
    }
)
image = np.array(mi.render(scene, spp=4096))[0, 0]
names = scene.integrator().aov_names()
first = len(image) - len(names)
ratio = image[1] / image[first + names.index("S0.G")]
print(f"green channel of the image over S0.G: {ratio:.4f}")
raise SystemExit(0 if abs(ratio - np.pi) < 1e-3 else 1)
PYTHON
