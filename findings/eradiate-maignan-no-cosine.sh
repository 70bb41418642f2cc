#!/usr/bin/env bash
# Library:   eradiate-mitsuba 0.5.0, BSDF plugin `maignan` (Maignan et al. 2009), variant scalar_mono_polarized_double.
# Guess:     BSDF.eval returns the BRDF times the cosine of the outgoing direction, as every BSDF of Mitsuba does (its
#            neighbour `rpv` too): eval(a -> b)/cos(b) = eval(b -> a)/cos(a) for a reciprocal surface.
# Behaviour: `maignan` returns the reflectance factor pi f, without that cosine: larger than f cos by pi/cos.
# Seen:      rpv      eval(ab)/eval(ba) 0.532089, cos(b)/cos(a) 0.532089
#            maignan  eval(ab)/eval(ba) 1.000000, eval/(pi f) 1.000000
# Exit:      0 while the behaviour stands, 1 if it has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check eradiate-mitsuba==0.5.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import math

import mitsuba as mi

mi.set_variant("scalar_mono_polarized_double")


def direction(degrees, azimuth):
    theta, phi = math.radians(degrees), math.radians(azimuth)
    return mi.Vector3f(math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta))


def brightness(bsdf, wi, wo):
    si = mi.SurfaceInteraction3f()
    si.wi = wi
    si.uv = mi.Point2f(0.5, 0.5)
    return float(bsdf.eval(mi.BSDFContext(), si, wo)[0, 0][0])


a, b = direction(20.0, 0.0), direction(60.0, 120.0)
cosines = math.cos(math.radians(60.0)) / math.cos(math.radians(20.0))
rpv = mi.load_dict({"type": "rpv", "rho_0": 0.183, "k": 0.78, "g": -0.1, "rho_c": 0.183})
C, ndvi, n = 5.0, 0.8, 1.5
maignan = mi.load_dict({"type": "maignan", "C": C, "ndvi": ndvi, "refr_re": n, "refr_im": 0.0, "ext_ior": 1.0})

# Maignan et al. (2009): pi f = C exp(-NDVI) exp(-tan g) F(g)/(4 (cos a + cos b)), F Fresnel's reflectance at half the
# angle between the rays, g
g = 0.5 * math.acos(sum(x * y for x, y in zip(a, b)))
inside = math.sqrt(n * n - math.sin(g) ** 2)
s = (math.cos(g) - inside) / (math.cos(g) + inside)
p = (n * n * math.cos(g) - inside) / (n * n * math.cos(g) + inside)
factor = C * math.exp(-ndvi) * math.exp(-math.tan(g)) * 0.5 * (s * s + p * p) / (4.0 * (a.z + b.z))

swapped = {name: brightness(x, a, b) / brightness(x, b, a) for name, x in (("rpv", rpv), ("maignan", maignan))}
whole = brightness(maignan, a, b) / factor
print(f"rpv      eval(ab)/eval(ba) {swapped['rpv']:.6f}, cos(b)/cos(a) {cosines:.6f}")
print(f"maignan  eval(ab)/eval(ba) {swapped['maignan']:.6f}, eval/(pi f) {whole:.6f}")
stands = abs(swapped["rpv"] - cosines) < 1e-9 and abs(swapped["maignan"] - 1.0) < 1e-9 and abs(whole - 1.0) < 1e-6
raise SystemExit(0 if stands else 1)
PYTHON
