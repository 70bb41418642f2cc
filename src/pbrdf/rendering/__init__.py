"""The models inside Mitsuba 3: the BSDF plugin ``pbrdf`` and painted scenes.

Nothing here imports Mitsuba before it is needed::

    import pbrdf.rendering

    pbrdf.rendering.register()                       # every variant knows the plugin from now on
    bsdf = pbrdf.rendering.bsdf_dict(pbrdf.load_paint("matte-white-thick-scene"))
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pbrdf.rendering.bsdf import register
    from pbrdf.rendering.properties import bsdf_dict

__all__ = ["bsdf_dict", "register"]

_HOME = {"bsdf_dict": "pbrdf.rendering.properties", "register": "pbrdf.rendering.bsdf"}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'pbrdf.rendering' has no attribute {name!r}")
    return getattr(importlib.import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
