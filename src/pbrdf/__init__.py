"""Polarimetric reflectance of coatings, from measurement to scene."""

from __future__ import annotations

from pbrdf.backend import point_drjit_to_llvm

__version__ = "0.1.0"

point_drjit_to_llvm()
