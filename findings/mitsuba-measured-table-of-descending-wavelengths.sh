#!/usr/bin/env bash
# Library:   Mitsuba 3.9.1, BSDF plugin `measured_polarized` (scalar_spectral_polarized), wavelengths of the table in descending order.
# Guess:     each matrix is answered at the wavelength that stands beside it in `wvls`, or the file is refused.
# Behaviour: it is accepted and no wavelength is answered by its own matrix. With 450 to 650 nm as 0.45 to 0.65/sr,
#            450, 500 and 550 nm are answered with the matrix of 600 nm, 600 and 650 nm with that of 500 nm.
# Seen:      ascending: 450 nm 0.45, 500 nm 0.50, 550 nm 0.55, 600 nm 0.60, 650 nm 0.65
#            descending: 450 nm 0.60, 500 nm 0.60, 550 nm 0.60, 600 nm 0.50, 650 nm 0.50
# Exit:      0 while the behaviour stands, 1 if it has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check mitsuba==3.9.1 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import struct
import tempfile
from pathlib import Path

import mitsuba as mi
import numpy as np

mi.set_variant("scalar_spectral_polarized")


def bsdf(wavelengths, matrices, folder=tempfile.TemporaryDirectory()):
    """The plugin with a table that holds one matrix for each wavelength, the same at all angles."""
    angles = {"theta_h": np.linspace(1e-6, 1.5, 6), "theta_d": np.linspace(1e-6, 1.5, 6), "phi_d": np.linspace(-np.pi, np.pi, 9)}
    fields = {name: np.float32(nodes)[None] for name, nodes in angles.items()}
    fields["wvls"] = np.uint16(wavelengths)
    fields["M"] = np.float32(np.broadcast_to(matrices, (9, 6, 6, len(wavelengths), 4, 4)))
    head = struct.pack("<12s2BI", b"tensor_file\0", 1, 0, len(fields))
    start, values = 18 + sum(13 + len(n) + 8 * a.ndim for n, a in fields.items()), b""
    for name, a in fields.items():
        values += bytes(-(start + len(values)) % 8)
        head += struct.pack("<H", len(name)) + name.encode()
        head += struct.pack(f"<HBQ{a.ndim}Q", a.ndim, {"float32": 10, "uint16": 3}[a.dtype.name], start + len(values), *a.shape)
        values += a.tobytes()
    path = Path(folder.name) / "table.pbsdf"
    path.write_bytes(head + values)
    return mi.load_dict({"type": "measured_polarized", "filename": str(path)})


def matrix(plugin, view, light, wavelength):
    """Mueller matrix without the cosine; directions in degrees: zenith angle, azimuth."""
    def vector(zenith, azimuth):
        z, a = np.deg2rad([zenith, azimuth])
        return mi.Vector3f(*(round(float(x), 7) for x in (np.sin(z) * np.cos(a), np.sin(z) * np.sin(a), np.cos(z))))

    si = mi.SurfaceInteraction3f()
    si.wi, si.wavelengths = vector(*view), [float(wavelength)] * 4
    wo = vector(*light)
    return np.array(plugin.eval(mi.BSDFContext(), si, wo), dtype=float)[..., 0] / wo.z


up = [450, 500, 550, 600, 650]
reflectances = {w: np.diag([w / 1000, 0, 0, 0]) for w in up}
ascending = bsdf(up, [reflectances[w] for w in up])
descending = bsdf(up[::-1], [reflectances[w] for w in up[::-1]])
found = {name: [round(float(matrix(plugin, (30, 0), (40, 150), w)[0, 0]), 3) for w in up]
         for name, plugin in {"ascending": ascending, "descending": descending}.items()}
for name, values in found.items():
    print(f"{name}: " + ", ".join(f"{w} nm {value:.2f}" for w, value in zip(up, values)))
stands = found == {"ascending": [0.45, 0.5, 0.55, 0.6, 0.65], "descending": [0.6, 0.6, 0.6, 0.5, 0.5]}
raise SystemExit(0 if stands else 1)
PYTHON
