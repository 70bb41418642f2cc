"""Data sets: their schema, their checks, the files they come from and the conventions of others."""

from pbrdf.data.build import make_dataset
from pbrdf.data.readers import read, write
from pbrdf.data.select import measured_channels, to_brdf_scale
from pbrdf.data.validate import Issue, check, validate

__all__ = [
    "Issue",
    "check",
    "make_dataset",
    "measured_channels",
    "read",
    "to_brdf_scale",
    "validate",
    "write",
]
