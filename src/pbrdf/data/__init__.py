"""Data sets: their schema, their checks, the files they come from and the conventions of others.

What stands here by name is loaded when first used, so that the names of the formats can be had without it.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pbrdf.data import convert
    from pbrdf.data.build import make_dataset
    from pbrdf.data.formats.declaration import Reader
    from pbrdf.data.readers import read, register_reader, write
    from pbrdf.data.select import measured_channels, to_brdf_scale
    from pbrdf.data.validation import Issue, check, validate

__all__ = [
    "Issue",
    "Reader",
    "check",
    "convert",
    "make_dataset",
    "measured_channels",
    "read",
    "register_reader",
    "to_brdf_scale",
    "validate",
    "write",
]

_HOME = {
    "pbrdf.data.build": ("make_dataset",),
    "pbrdf.data.formats.declaration": ("Reader",),
    "pbrdf.data.readers": ("read", "register_reader", "write"),
    "pbrdf.data.select": ("measured_channels", "to_brdf_scale"),
    "pbrdf.data.validation": ("Issue", "check", "validate"),
}
_MODULE_OF = {name: module for module, names in _HOME.items() for name in names}


def __getattr__(name: str) -> Any:
    if name == "convert":
        return importlib.import_module("pbrdf.data.convert")
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'pbrdf.data' has no attribute {name!r}")
    return getattr(importlib.import_module(_MODULE_OF[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
