"""What the tests of exported tables share: what Mitsuba's own plugin makes of a file, in the project's convention."""

from __future__ import annotations

import numpy as np
import pytest

__all__ = ["evaluated", "plain_mitsuba", "share_of_f00"]


def plain_mitsuba(variant="llvm_ad_mono_polarized"):
    """Mitsuba without the plugins of this package, or skip the test."""
    mi = pytest.importorskip("mitsuba", reason="Mitsuba is not installed: pip install 'mitsuba>=3.9'")
    mi.set_variant(variant)
    return mi


def evaluated(mi, bsdf, theta_i, theta_r, phi, azimuth_i=0.4, wavelength=None):
    """What a BSDF of Mitsuba's gives, brought to our convention with Mitsuba's own rotation.

    Light travels from ``wo`` to ``wi``. Its matrix refers to the implicit bases of −wo and wi; turned to x = s of the
    surface, diag(1, −1, −1, −1) on both sides leads to Q = I_p − I_s and V > 0 left circular. The value carries cosθ of
    ``wo``. Spectral variants are asked for one wavelength, in nm.
    """
    azimuth_r = azimuth_i + np.pi + phi
    wo = np.stack([np.sin(theta_i) * np.cos(azimuth_i), np.sin(theta_i) * np.sin(azimuth_i), np.cos(theta_i)])
    wi = np.stack([np.sin(theta_r) * np.cos(azimuth_r), np.sin(theta_r) * np.sin(azimuth_r), np.cos(theta_r)])
    k_i, k_r = mi.Vector3f(-wo), mi.Vector3f(wi)
    flat = np.zeros_like(azimuth_r)
    s_i = mi.Vector3f(np.stack([flat - np.sin(azimuth_i), flat + np.cos(azimuth_i), flat]))
    s_r = mi.Vector3f(np.stack([np.sin(azimuth_r), -np.cos(azimuth_r), flat]))
    si = mi.SurfaceInteraction3f()
    si.wi = mi.Vector3f(wi)
    if mi.is_spectral:
        si.wavelengths = [mi.Float(np.full(len(theta_i), wavelength, dtype=np.float32))] * 4
    value = bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(wo))
    value = mi.mueller.rotate_mueller_basis(
        value, k_i, mi.mueller.stokes_basis(k_i), s_i, k_r, mi.mueller.stokes_basis(k_r), s_r
    )
    matrix = np.moveaxis(np.array(value, dtype=float)[:, :, 0], -1, 0)
    D = np.diag([1.0, -1.0, -1.0, -1.0])
    return D @ (matrix / np.cos(theta_i)[:, np.newaxis, np.newaxis]) @ D


def share_of_f00(found, exact):
    """Largest difference of the sixteen elements over f00."""
    return np.abs(found - exact).max((-1, -2)) / exact[..., 0, 0]
