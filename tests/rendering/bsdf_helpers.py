"""What the tests of the BSDF plugin share: Mitsuba's variants, and matrices in both programs' frames.

The change of frame is written with angles and rotation matrices here, apart from the plugin's own.
"""

from __future__ import annotations

import numpy as np
import pytest

SCALAR = ("scalar_rgb", "scalar_spectral", "scalar_spectral_polarized")
LLVM = (
    "llvm_ad_rgb",
    "llvm_ad_mono",
    "llvm_ad_mono_polarized",
    "llvm_ad_spectral",
    "llvm_ad_spectral_polarized",
)
CUDA = tuple(name.replace("llvm", "cuda") for name in LLVM)
WAVELENGTHS = (450.0, 500.0, 550.0, 600.0)
#: Mitsuba's axes are x = s and V > 0 right circular (docs/conventions.md).
D = np.diag([1.0, -1.0, -1.0, -1.0])


def use(variant):
    """Mitsuba with a variant active and the plugin known, or skip the test."""
    mi = pytest.importorskip("mitsuba", reason="rendering needs mitsuba: pip install 'mitsuba>=3.9'")
    import drjit as dr

    import pbrdf.rendering

    if variant.startswith("cuda") and not dr.has_backend(dr.JitBackend.CUDA):
        pytest.skip("this machine has no CUDA device")
    mi.set_variant(variant)
    pbrdf.rendering.register()
    return mi


def directions(count, largest, seed):
    """Unit vectors above the horizon, zenith angles uniform to ``largest`` degrees; float32 values as float64."""
    rng = np.random.default_rng(seed)
    theta, phi = np.radians(rng.uniform(0.0, largest, count)), rng.uniform(0.0, 2.0 * np.pi, count)
    v = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)
    return v.astype(np.float32).astype(float)


def vector(mi, v):
    """Mitsuba's vector of one direction or, where the variant has lanes, of many."""
    return mi.Vector3f(*(x.astype(np.float32) if np.ndim(x) else float(x) for x in np.moveaxis(v, -1, 0)))


def interaction(mi, wi, uv=(0.5, 0.5)):
    """A surface interaction seen from ``wi``."""
    import drjit as dr

    si = dr.zeros(mi.SurfaceInteraction3f, 1 if np.ndim(wi) == 1 else len(wi))
    si.wi = vector(mi, wi)
    si.uv = mi.Point2f(*(np.float32(x) if np.ndim(x) else float(x) for x in uv))
    if mi.is_spectral:
        si.wavelengths = list(WAVELENGTHS)
    return si


def call(mi, method, wi, wo, *, ctx=None, uv=(0.5, 0.5)):
    """Call a method (ctx, si, wo) of a BSDF for arrays of directions, one at a time in the scalar variants.

    Returns arrays of shape (N,) for a Float, (N, channels) for a spectrum, (N, channels, 4, 4) for Mueller
    matrices; a tuple of them where the method returns a tuple.
    """
    ctx = mi.BSDFContext() if ctx is None else ctx
    wi, wo = np.broadcast_arrays(wi, wo)
    if mi.variant().startswith("scalar"):
        results = [
            numbers(mi, method(ctx, interaction(mi, i, uv), vector(mi, o)), 1)
            for i, o in zip(wi, wo, strict=True)
        ]
        if isinstance(results[0], tuple):
            return tuple(np.concatenate(column) for column in zip(*results, strict=True))
        return np.concatenate(results)
    return numbers(mi, method(ctx, interaction(mi, wi, uv), vector(mi, wo)), len(wi))


def numbers(mi, value, count):
    """NumPy array of what a BSDF returns, lanes first."""
    if isinstance(value, tuple):
        return tuple(numbers(mi, v, count) for v in value)
    if isinstance(value, float) or type(value) is mi.Float:
        return np.broadcast_to(np.asarray(value, dtype=float), (count,))
    if mi.is_polarized:
        elements = [[_channels(value[i, j], count) for j in range(4)] for i in range(4)]
        return np.moveaxis(np.array(elements), (0, 1), (2, 3))
    return _channels(value, count)


def _channels(value, count):
    columns = [np.broadcast_to(np.asarray(x, dtype=float), (count,)) for x in value]
    return np.stack(columns, -1)


def light(wi, wo):
    """Angles θ_i, θ_r, φ of the model for light from ``wo`` to ``wi``, in double precision."""
    omega_i, omega_r = (v / np.linalg.norm(v, axis=-1, keepdims=True) for v in (wo, wi))

    def zenith(v):
        return np.arctan2(np.hypot(v[..., 0], v[..., 1]), v[..., 2])

    def azimuth(v):
        return np.arctan2(v[..., 1], v[..., 0])

    return zenith(omega_i), zenith(omega_r), azimuth(omega_r) - azimuth(omega_i) - np.pi


def implicit_axes(k):
    """x axis of Mitsuba's implicit Stokes frame about k: ``coordinate_system`` (Duff et al. 2017), in NumPy."""
    x, y, z = np.moveaxis(k, -1, 0)
    sign = np.copysign(1.0, z)
    a = -1.0 / (sign + z)
    return np.stack([1.0 + sign * x * x * a, sign * x * y * a, -sign * x], -1)


def turn(k, new, old):
    """Rotation of Stokes vectors about k from axes x = ``old`` to x = ``new``."""
    angle = np.arctan2(np.sum(k * np.cross(old, new), -1), np.sum(old * new, -1))
    c, s = np.cos(2.0 * angle), np.sin(2.0 * angle)
    R = np.zeros((*angle.shape, 4, 4))
    R[..., 0, 0] = R[..., 3, 3] = 1.0
    R[..., 1, 1] = R[..., 2, 2] = c
    R[..., 1, 2], R[..., 2, 1] = s, -s
    return R


def to_surface_frames(M, wi, wo):
    """Turn Mitsuba's matrices to x = s on both sides: from ``stokes_basis(-wo)`` and ``stokes_basis(wi)``."""
    normal = np.array([0.0, 0.0, 1.0])

    def rotation(k):
        s = np.cross(k, normal)
        return turn(k, s / np.linalg.norm(s, axis=-1, keepdims=True), implicit_axes(k))

    out, incoming = rotation(wi), rotation(-wo)
    return out @ M @ np.swapaxes(incoming, -1, -2)


def plugin(mi, model, **changes):
    """The plugin's BSDF for a model, with its accuracy unless another is asked for."""
    import pbrdf.rendering

    asked = {name: choice for name, choice in model.chosen.items() if name == "accuracy"}
    return mi.load_dict({**pbrdf.rendering.bsdf_dict(model), **asked, **changes})
