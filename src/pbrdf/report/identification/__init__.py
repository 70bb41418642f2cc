"""Identification in words and figures: libraries, single measurements, maps of materials, calibration."""
