#!/usr/bin/env bash
# Library:   Mitsuba 3.9.1, sensor `batch` under the integrator `stokes` (scalar_spectral_polarized).
# Guess:     each camera of a batch has its own axes: its part of the picture is what it shows when it is rendered alone.
# Behaviour: all cameras get the axes of the batch itself (its own `to_world`, the identity unless stated). Two cameras that
#            look along +x at light behind a polariser, the second rolled by 45 degrees, both read the angle against world y.
# Seen:      alone 90 and 45 degrees, in a batch 0 and 0 degrees
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
T = mi.ScalarTransform4f


def camera(up, **more):
    view = T().look_at([-3, 0, 0], [0, 0, 0], up)
    return {"type": "perspective", "fov": 1.0, "to_world": view, **more}


def angle(sensor, pixel):
    """Angle of linear polarisation in one pixel, degrees."""
    sheet = T().rotate([0, 1, 0], 90).scale(5)
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "stokes", "nested": {"type": "path"}},
            "sensor": sensor,
            "sheet": {"type": "rectangle", "to_world": sheet, "bsdf": {"type": "polarizer"}},
            "sky": {"type": "constant"},
        }
    )
    image = np.array(mi.render(scene, spp=64))[0, pixel]
    names = scene.integrator().aov_names()
    q, u = (image[len(image) - len(names) + names.index(name)] for name in ("S1.G", "S2.G"))
    return round(float(np.degrees(0.5 * np.arctan2(u, q)))) % 180


mi.set_log_level(mi.LogLevel.Error)
film = {"type": "hdrfilm", "width": 1, "height": 1, "rfilter": {"type": "box"}}
upright, rolled = [0, 0, 1], [0, 1, 1]
alone = [angle(camera(up, film=film), 0) for up in (upright, rolled)]
batch = {"type": "batch", "film": {**film, "width": 2}, "a": camera(upright), "b": camera(rolled)}
together = [angle(batch, pixel) for pixel in (0, 1)]
print("alone    {} and {} degrees".format(*alone))
print("in batch {} and {} degrees".format(*together))
# angles of a half-turn are the same
as_seen = np.allclose(alone, [90, 45], atol=1) and np.allclose(np.sin(np.radians(together)), 0, atol=0.02)
raise SystemExit(0 if as_seen else 1)
PYTHON
