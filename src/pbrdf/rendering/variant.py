"""Starting Mitsuba 3 in one of its variants, with the plugins of this package."""

from __future__ import annotations

from typing import Any

from pbrdf.errors import BackendError
from pbrdf.rendering.bsdf import register
from pbrdf.rendering.mitsuba_import import import_mitsuba
from pbrdf.rendering.polarized_lamp import register_polarized_lamp
from pbrdf.rendering.sky_emitter import register_sky

__all__ = ["DEFAULT_VARIANT", "start_mitsuba"]

DEFAULT_VARIANT = "llvm_ad_mono_polarized"


def start_mitsuba(variant: str = DEFAULT_VARIANT) -> Any:
    """Import Mitsuba, make `variant` the active one and register the plugins of this package.

    These are ``pbrdf``, ``pbrdf_sky`` and ``pbrdf_polarized``. Mitsuba's active variant is a setting of the whole
    process.

    Parameters
    ----------
    variant
        Name of a polarised variant.

    Returns
    -------
    module
        ``mitsuba``.

    Raises
    ------
    BackendError
        If Mitsuba is not installed, does not have that variant, the variant knows no polarisation, or LLVM or CUDA is
        missing.
    """
    mi = import_mitsuba()
    polarised = [
        name for name in mi.variants() if name.endswith("_polarized") and not name.startswith("scalar")
    ]
    if variant not in polarised:
        raise BackendError(
            f"the variant {variant!r} cannot be used: choose one of {', '.join(polarised)}; "
            "only these carry polarisation"
        )
    try:
        mi.set_variant(variant)
    except ImportError as error:
        raise BackendError(
            f"Mitsuba cannot start {variant}: {error}. `pbrdf doctor` says what is missing"
        ) from error
    register()
    register_sky()
    register_polarized_lamp()
    return mi
