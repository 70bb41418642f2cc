#!/usr/bin/env bash
# Library:   Mitsuba 3.9.1, BSDF plugin `measured_polarized` (scalar_spectral_polarized), a table that is an ideal depolariser of
#            1/sr in every cell.
# Guess:     m00 is 1 and the other elements are 0 for every pair of directions, as the table says.
# Behaviour: where light and view have one direction (a lamp at the camera), twelve elements are NaN, and m00 may be 0: no
#            table can help. Where they are mirrored exactly, the surface is black. A hundredth of a degree beside
#            either, all is right.
# Seen:      apart: m00 1.000, other elements NaN 0, largest 0.000
#            one direction: m00 0.000, other elements NaN 12, largest 0.000
#            0.01 degrees beside it: m00 1.000, other elements NaN 0, largest 0.000
#            mirrored: m00 0.000, other elements NaN 0, largest 0.000
#            0.01 degrees beside that: m00 1.000, other elements NaN 0, largest 0.000
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


depolariser = bsdf([550], [np.diag([1.0, 0, 0, 0])])
cases = {
    "apart": ((0, 0), (40, 150)),
    "one direction": ((0, 0), (0, 0)),
    "0.01 degrees beside it": ((0, 0), (0.01, 30)),
    "mirrored": ((30, 0), (30, 180)),
    "0.01 degrees beside that": ((30, 0), (30.01, 180)),
}
found = {name: matrix(depolariser, view, light, 550) for name, (view, light) in cases.items()}
for name, M in found.items():
    print(f"{name}: m00 {M[0, 0]:.3f}, other elements NaN {np.isnan(M).sum()}, largest {np.nanmax(np.abs(M.ravel()[1:])):.3f}")
right = [np.allclose(M, np.diag([1.0, 0, 0, 0]), atol=1e-5) for M in found.values()]
stands = right == [True, False, True, False, True] and np.isnan(found["one direction"]).sum() == 12 and not found["mirrored"].any()
raise SystemExit(0 if stands else 1)
PYTHON
